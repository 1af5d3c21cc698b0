"""From a log of a cable to a model that predicts what it has not seen."""

from bowden.identify.fit import Fit, ModelFit, identify, identify_log
from bowden.identify.log import Log, read_log
from bowden.identify.model import CableModel
from bowden.identify.model_file import load_model, write_model

__all__ = [
    "CableModel",
    "Fit",
    "Log",
    "ModelFit",
    "identify",
    "identify_log",
    "load_model",
    "read_log",
    "write_model",
]

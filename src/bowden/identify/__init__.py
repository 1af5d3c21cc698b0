"""From a log of a cable to a model that predicts what it has not seen."""

from bowden.identify.cable.fit import Fit, ModelFit, identify, identify_log
from bowden.identify.cable.model import CableModel
from bowden.identify.cable.model_file import load_model, write_model
from bowden.identify.log.read import Log, read_log

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

"""The detectors of contractions by their names. A new one is a file like `bowden.sensing.onset`, and a line here."""

from bowden.core.errors import ParameterError, near
from bowden.sensing.detector import Detector
from bowden.sensing.onset import ONSET

DEFAULT = ONSET
"""The detector used where none is named."""

DETECTORS: dict[str, Detector] = {detector.name: detector for detector in (ONSET,)}
"""Name → detector."""


def detector_named(name: str) -> Detector:
    """The detector of a name.

    Raises:
        ParameterError: there is none.
    """
    if name not in DETECTORS:
        raise ParameterError(f"there is no detector {name!r}", expected=near(name, DETECTORS), do="name one of them")
    return DETECTORS[name]

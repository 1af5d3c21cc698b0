"""How well a detector did, as it is printed as JSON too."""

from dataclasses import dataclass

from bowden.core.documented import Documented


@dataclass(frozen=True)
class DetectorScore(Documented):
    """Detections against labels."""

    detections: int
    """Contractions found."""
    misses: int | None
    """Labelled contractions without a detection, but for rejected ones; null without labels."""
    rejected: int | None
    """Labelled contractions without a detection that are shorter than shortest_ms; null without labels."""
    false_activations: int | None
    """Detections without a label, and each of a contraction after its first; null without labels."""
    latency_median_s: float | None
    """From a label's onset to the detection's; null without any."""
    latency_max_s: float | None
    """The largest of these."""
    false_per_minute: float | None
    """False activations a minute of the recording."""

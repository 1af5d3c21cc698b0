"""The paper's bench as a plant."""

from bowden.plants.bench import Bench
from bowden.plants.presets.paper import Calibration, parts


def bench(fit: Calibration | None = None) -> Bench:
    """The bench with a calibration; the first one where none is given."""
    return Bench(**parts(fit)._asdict())


def default_bench() -> Bench:
    """The bench that every default of this package stands on."""
    return bench()

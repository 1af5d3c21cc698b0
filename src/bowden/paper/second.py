"""The second calibration that fits the published rows as well, and what it predicts beside the first."""

from bowden.control import LAWS
from bowden.core.metrics import rmse
from bowden.core.units import DEGREES
from bowden.paper.bench import adaptive, observer, run_bench, run_chirp
from bowden.paper.figures_of_merit import closed_loop_bandwidth, dead_zone_deg
from bowden.rig.presets import bench as paper
from bowden.rig.presets.bench import Calibration

ROWS = (
    ("dead zone, uncompensated [deg]", 5.0, True),
    ("observer, constant bend [deg]", 1.707, True),
    ("observer, varying bend [deg]", 7.561, True),
    ("observer, bandwidth [rad/s]", 35.0, True),
    ("adaptive, constant bend [deg]", 0.425, False),
    ("adaptive, varying bend [deg]", 1.087, False),
)
"""Quantity, published figure, whether the calibrations were fitted to it."""


def predictions(fit: Calibration) -> list[float]:
    """The figures of `ROWS` under a calibration."""

    def deg(law_is_adaptive: bool, moved: bool) -> float:
        law = adaptive() if law_is_adaptive else observer(fit)
        return rmse(run_bench(law, moved=moved, fit=fit).error) * DEGREES

    bandwidth = closed_loop_bandwidth(run_chirp(observer(fit), fit), paper.chirp())
    return [
        dead_zone_deg(run_bench(LAWS["uncompensated"], fit=fit)),
        deg(False, False),
        deg(False, True),
        float("nan") if bandwidth is None else bandwidth,
        deg(True, False),
        deg(True, True),
    ]


def table() -> list[dict[str, object]]:
    """Each row of `ROWS` with what both calibrations give."""
    main, second = (predictions(paper.calibration(name)) for name in ("main", "second"))
    return [
        {"quantity": name, "published": published, "fitted": fitted, "main": a, "second": b}
        for (name, published, fitted), a, b in zip(ROWS, main, second, strict=True)
    ]

"""What two earlier calibrations predict, whose drive does not saturate and whose arm has the printed half width."""

from bowden.control import LAWS
from bowden.control.law import Law
from bowden.core.units import DEGREES
from bowden.paper.bench import adaptive, run_bench, run_chirp
from bowden.paper.experiment import PageTable
from bowden.paper.plots import closed_loop_bandwidth
from bowden.paper.suit_rows import five_flexions, motions_of
from bowden.plants.presets import paper
from bowden.plants.presets.paper import calibration
from bowden.plants.presets.suit import suit_calibration
from bowden.records.metrics import rmse
from bowden.sim.suit_runs import suit_adaptive, suit_adaptive_integral

ROWS = {
    "table1.adaptive.constant": "RMSE, adaptive, constant bend [°]",
    "table1.adaptive.varying": "RMSE, adaptive, varying bend [°]",
    "fig16.adaptive.bandwidth": "bandwidth, adaptive [rad/s]",
    "fig17.adaptive.energy": "energy of a flexion and extension, adaptive [J]",
    "fig17.adaptive.error": "largest error of the mean of five, adaptive [°]",
    "fig19.error": "largest error of motions of 5 s, adaptive [°]",
}
"""Claim → what it is."""


def predictions(name: str, law: Law) -> dict[str, float | None]:
    """The figures of `ROWS` under an earlier calibration; the bandwidth is None where the run leaves −3 dB nowhere."""
    fit, worn = calibration(name), suit_calibration(name)
    of_bench = adaptive(**LAWS["adaptive"].gains._asdict())
    five = five_flexions(law, fit=worn)
    return {
        "table1.adaptive.constant": rmse(run_bench(of_bench, fit=fit).error) * DEGREES,
        "table1.adaptive.varying": rmse(run_bench(of_bench, moved=True, fit=fit).error) * DEGREES,
        "fig16.adaptive.bandwidth": closed_loop_bandwidth(run_chirp(of_bench, fit), paper.chirp()),
        "fig17.adaptive.energy": five.energy,
        "fig17.adaptive.error": five.mean,
        "fig19.error": motions_of(law, 5.0, fit=worn).error,
    }


def earlier() -> dict[str, dict[str, float | None]]:
    """Both earlier calibrations by name."""
    return {"first": predictions("first", suit_adaptive()), "second": predictions("second", suit_adaptive_integral())}


def table(found: dict[str, dict[str, float | None]], main: dict[str, tuple[float | None, float | None]]) -> PageTable:
    """Both beside the main calibration.

    Args:
        found: of `earlier`.
        main: published and computed figure, by claim.
    """

    def shown(value: float | None) -> str:
        return "–" if value is None else f"{value:.3g}"

    return PageTable(
        ["quantity", "published", "main", "first", "second"],
        [
            [what, *(shown(x) for x in main[claim]), *(shown(found[name][claim]) for name in ("first", "second"))]
            for claim, what in ROWS.items()
        ],
        "First: a drive that never saturates, a = 35 mm. Second: also an observer that knows its cable exactly "
        "(period of 3.9 s), and an integral in the suit’s drive. All meet the fitted rows.",
    )

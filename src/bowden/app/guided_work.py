"""Steps of the console's guided path, as operations: each in a process of its own, see `bowden.app.job_process`."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from bowden.rig.rig import Rig
from bowden.views.text import Call


def identified(progress: Callable[[str, float], None], rig: Mapping[str, Any], folder: str) -> dict[str, Any]:
    """Identify the cable that was measured, and put it into the rig, as identify and init do."""
    from bowden.core.units import DEGREES
    from bowden.operations.identify import identify
    from bowden.plants.identified import load_cable
    from bowden.views.identify import write_identify

    place, given = Path(folder), Rig.unpack(rig)
    found = identify(place / "cable.csv", progress=progress)
    write_identify(found, Call({}, {}), out=place)
    fit = found.fit
    made = given.replace(cable=load_cable(place / "model.toml"))
    files = ["model.toml", "identify.html", *_written(made, place, "identified")]
    ahead = fit.forecast
    both = [] if ahead is None else [f"{value * DEGREES:.2g}° RMS" for value in ahead[:2]]
    forecast = f"{' left with this model as feed-forward, '.join(both)} without; " if both else ""
    said = f"{fit.best.name}: {forecast}trust: {fit.trust}"
    return {"rig": made.document(), "said": said, "files": files}


def identified_servo(progress: Callable[[str, float], None], rig: Mapping[str, Any], folder: str) -> dict[str, Any]:
    """Identify the servo that was measured, and put it into the rig: the keys that identify-servo writes."""
    from bowden.operations.identify_servo import identify_servo
    from bowden.views.identify_servo import write_identify_servo

    place, given = Path(folder), Rig.unpack(rig)
    log = place / "servo.csv"
    result = identify_servo(
        log,
        time="time_s",
        command="command_rad",
        motor="motor_rad",
        sample_time_ms=1e3 * given.sample_time,
        progress=progress,
    )
    write_identify_servo(result, Call({"into": None, "log": log}, {}), out=place)
    found = result.fit
    servo = given.servo._replace(natural_frequency=found.natural_frequency.value, damping=found.damping.value)
    if found.speed_limit is not None:
        servo = servo._replace(speed_limit=found.speed_limit.value)
    made = given.replace(servo=servo, delay=result.delay_cycles)
    frequency, damping, delay = result.natural_frequency_hz, result.damping, result.delay_s
    said = (
        f"natural frequency {frequency.value:.4g} ± {frequency.uncertainty:.1g} Hz, damping "
        f"{damping.value:.3g} ± {damping.uncertainty:.1g}, delay {1e3 * delay.value:.3g} ± "
        f"{1e3 * delay.uncertainty:.1g} ms; {result.residual_deg:.2g}° RMS of the motor's motion are left"
    )
    return {"rig": made.document(), "said": said, "files": ["servo.toml", *_written(made, place, "servo")]}


def tuned_rig(progress: Callable[[str, float], None], rig: Mapping[str, Any], folder: str) -> dict[str, Any]:
    """Tune the rig's law, and put the gains into the rig."""
    from bowden.core.units import DEGREES
    from bowden.study.tune_law import tuned

    given = Rig.unpack(rig)
    found = tuned(given, seed=0, progress=progress)
    made = found.rig
    said = f"{found.law.name}: largest RMSE over {found.runs} {found.worst_rmse * DEGREES:.3g}°, {found.found.verdict}"
    return {"rig": made.document(), "said": said, "files": _written(made, Path(folder), "tuned")}


def _written(rig: Rig, folder: Path, name: str) -> list[str]:
    """Write the rig, and the files that it names, into a folder of a name that is free."""
    number, target = 1, folder / name
    while target.exists():
        number += 1
        target = folder / f"{name}-{number}"
    target.mkdir(parents=True)
    rig.write(target / "rig.toml")
    return [f"{target.name}/rig.toml"]

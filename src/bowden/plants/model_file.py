"""model.toml, the file of an identified cable, as `bowden.plants.identified` reads it."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from bowden.core.bounded import read_toml
from bowden.core.errors import ParameterError
from bowden.core.units import DEGREES
from bowden.models.cable.scheduled import VARIABLES
from bowden.plants.cable_parameters import LEAST_SLOPE, check_parameters
from bowden.plants.counting import Covered, Encoders
from bowden.plants.predicted import DISTRIBUTED, KNOWN, joint_along, whole_slope
from bowden.plants.trust import trust_of


def log_lines(covered: Covered | None, encoders: Encoders) -> list[str]:
    """The sections of model.toml with the motion that the log covered, and its encoders; as far as they are known."""
    lines = []
    if covered is not None:
        ends = [f"{angle * DEGREES:.4f}" for angle in covered]
        lines += [
            "",
            "[covered]  # by the log, in its own angles; the models were not fitted beyond this motion",
            f"motor_deg = [{ends[0]}, {ends[1]}]",
            f"joint_deg = [{ends[2]}, {ends[3]}]",
        ]
    counts = {"motor_deg": encoders.motor, "joint_deg": encoders.joint}
    known = [f"{key} = {count * DEGREES:.11g}  # one count" for key, count in counts.items() if count]
    if encoders.joint_late:
        known.append(f"joint_late_s = {encoders.joint_late:.4g}  # the joint was read so much later than the motor")
    return lines + (["", "[encoders]", *known] if known else [])


def read_models(file: Path) -> dict[str, Any]:
    """Read all models of model.toml, as the fields of an `IdentifiedCable` by name.

    Raises:
        ParameterError: no such file, not written by `write_model`, an unknown model, or an absurd parameter.
    """
    models, best = _document(file)
    needed = (best,) if best in DISTRIBUTED else ("bouc_wen", best)
    for wanted in needed:
        if wanted not in models or wanted not in KNOWN:
            raise ParameterError(f"{file} has no model {wanted!r}", expected=f"one of {', '.join(models)}")
    found = {one: _checked(file, one, table) for one, table in models.items() if one in KNOWN}
    for wanted in needed:
        if "slope" in found[wanted] and abs(whole_slope(found[wanted])) < LEAST_SLOPE:
            raise ParameterError(
                f"{file}: slope of {wanted} is {whole_slope(found[wanted]):g}, of all its parts",
                expected=f"{LEAST_SLOPE:g} at least, either way: the joint has to move with the motor",
                do="identify the cable again",
            )
    said = {one: models[best].get(f"{one}_unit") for one in VARIABLES}
    units = {one: unit for one, unit in said.items() if isinstance(unit, str) and unit}
    errors = [models[best].get(key) for key in ("judged_rms_deg", "test_rms_deg")]
    judged = next((one for one in errors if type(one) in (int, float) and 0.0 < one < math.inf), math.nan)
    about = {"trust": trust_of(read_toml(file), file), "covered": _covered(file), "encoders": _encoders(file)}
    return {"best": best, "models": found, "units": units, "judged": judged / DEGREES, **about}


def _covered(file: Path) -> Covered | None:
    """The motion that the log covered; None where the file does not say it."""
    said = read_toml(file).get("covered")
    if said is None:
        return None
    ends: list[float] = []
    for key, most in (("motor_deg", 1e5), ("joint_deg", 1e4)):
        pair = said.get(key) if isinstance(said, dict) else None
        numbers = [one for one in pair if type(one) in (int, float)] if isinstance(pair, list) else []
        if not (len(numbers) == 2 and pair == numbers and -most <= numbers[0] < numbers[1] <= most):
            raise ParameterError(
                f"{file}: {key} of [covered] is {pair!r}",
                expected=f"two angles within ±{most:.0f}, the lower one first",
                do="write the file again, or delete the section",
            )
        ends += [one / DEGREES for one in numbers]
    return Covered(*ends)


def _encoders(file: Path) -> Encoders:
    """How the encoders read, as far as the file says it."""
    said = read_toml(file).get("encoders", {})
    known = said if isinstance(said, dict) else {}
    *counts, late = (known.get(key, 0.0) for key in ("motor_deg", "joint_deg", "joint_late_s"))
    numbers = isinstance(said, dict) and all(type(one) in (int, float) for one in (*counts, late))
    if not (numbers and all(0.0 <= one <= 180.0 for one in counts) and 0.0 <= late < math.inf):
        raise ParameterError(
            f"{file}: [encoders] is {said!r}",
            expected="motor_deg and joint_deg, one count each, up to 180°, and joint_late_s, 0 or more",
            do="write the file again, or delete the section",
        )
    motor, joint = (one / DEGREES for one in counts)
    return Encoders(motor, joint, late)


_WRITTEN = "the model.toml that `bowden identify` writes"


def _document(file: Path) -> tuple[dict[str, Any], str]:
    """The models of a file as they stand there, and the name of the recommended one."""
    try:
        document = read_toml(file)
    except OSError as error:
        raise ParameterError(f"{file} cannot be read: {error.strerror or error}", do="check the path") from None
    except ValueError as error:
        raise ParameterError(
            f"{file} is no TOML file: {error}", expected=_WRITTEN, do="of a log, identify it first"
        ) from None
    models, best = document.get("models"), document.get("best")
    if not isinstance(models, dict) or not isinstance(best, str):
        raise ParameterError(f"{file} has no models in it", expected=_WRITTEN)
    return models, best


def _checked(file: Path, name: str, table: Any) -> Mapping[str, float]:
    parameters = table.get("parameters") if isinstance(table, dict) else None
    if not isinstance(parameters, dict):
        raise ParameterError(f"{file}: [models.{name}.parameters] is missing", do="write the file again")
    check_parameters(name, parameters, str(file))
    bounds = {"shape": 0.5}
    bounds |= {f"{key}_high": parameters[f"{key}_low"] for key in ("load", "bend") if f"{key}_low" in parameters}
    for key, least in bounds.items():
        if key in parameters and not parameters[key] > least:
            raise ParameterError(f"{file}: {key} of {name} is {parameters[key]}", expected=f"a number above {least:g}")
    if name == "generalised_play":
        _check_branches(file, parameters)
    found = {key: float(value) for key, value in parameters.items()}
    if name in DISTRIBUTED:
        from bowden.plants.cables import identified

        identified(name, found)
    else:
        joint_along(name, found, np.zeros(2))  # names what is missing
    return found


def _check_branches(file: Path, given: Mapping[str, float]) -> None:
    """That the nodes and plays of a generalised play make one."""
    sizes = {kind: sum(key.startswith(f"{kind}_") for key in given) for kind in ("bend", "gap", "reach", "share")}
    said, what = f"{file}: generalised_play", f"{sizes['reach']} reaches and {sizes['share']} shares"
    if sizes["reach"] != sizes["share"]:
        raise ParameterError(f"{said} has {what}", expected="as many of both")
    for kind in ("bend", "gap"):
        if sizes[kind] < 2:
            raise ParameterError(f"{said} has {sizes[kind]} {kind}s", expected="2 or more")
    low, high = given.get("first_node", -math.inf), given.get("last_node", math.inf)
    if not high > low:
        raise ParameterError(f"{said}: first_node {low:g}, last_node {high:g}", expected="the last above the first")

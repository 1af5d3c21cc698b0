"""What a checkout makes of many rigs, good and bad, as one JSON document: the part `schema` of two_checkouts.py.

Run by text, so that an old checkout need not have it. Only what stays is used: `Rig.read`, its tree, and what follows.
"""

import json
import math
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from bowden import Rig
from bowden.core.errors import BowdenError
from bowden.design.objections import objections

FAMILIES = ("cia402", "ak_mit", "moteus", "odrive")
BASES = {
    "bench": "",
    "suit": "[suit]\nworn = true\n",
    "push": "[suit]\nworn = true\n[admittance]\nenabled = true\n[control]\nlaw = 'uncompensated'\n",
    "brake": "[suit]\nworn = true\n[drive]\nbrake_output = 'release'\n[brake]\nholding_torque_nm = 0.1\n",
    "cell": "[load_cell]\nsource = 'cia404'\nfull_scale = 5000.0\n",
    "moved": "[scenario.bend]\nkind = 'random'\n",
    **{name: f"[drive]\nfamily = '{name}'\n" for name in FAMILIES[1:]},
    **{
        kind: f"[reference]\nkind = '{kind}'\n"
        for kind in ("point_to_point", "chirp", "multisine", "periodic_minimum_jerk")
    },
    "law": "[control]\nlaw = 'observer'\n[control.gains]\nfrom_reference = 1.0\n",
    "preset": "[control]\nlaw = 'bowden'\npreset = 'suit'\n",
    "emg": "[emg]\nsource = 'lsl:EMG'\nextensor = 'triceps'\n",
    "model": "[cable]\nmodel = 'model.toml'\n",
    "counted": "[cable]\nmodel = 'model.toml'\ndirection = -1\nmotor_zero_deg = 3.0\n[cable.parameters]\nrate = 5.0\n",
    "changed": "[cable]\nmodel = 'model.toml'\n[cable.parameters]\nslope = 0.9\n",
    "recorded": "[reference]\nkind = 'recorded'\nfile = 'motion.csv'\n",
    "motors": "[bench]\ndelay_cycles = 2\n[[motor]]\nname = 'hip'\n[[motor]]\nname = 'knee'\n"
    "[motor.drive]\nnode_id = 2\n[motor.servo]\ndamping = 0.9\n",
    "pair": "[[joint]]\nname = 'q'\nco_contraction_deg = 2.0\n[[motor]]\nname = 'up'\njoint = 'q'\n"
    "[[motor]]\nname = 'down'\njoint = 'q'\n[motor.drive]\nnode_id = 2\n[motor.limits]\nslack_sign = 1.0\n",
    "independent": "independent = true\n[[motor]]\nname = 'a'\n[[motor]]\nname = 'b'\n"
    "[motor.drive]\nfamily = 'odrive'\nchannel = 'b'\n",
}
BAD = {
    "unknown section": "[benhc]\n",
    "unknown key": "[servo]\nfrequency = 1.0\n",
    "no table": "servo = 3\n",
    "no toml": "[servo\n",
    "kind": "[reference]\nkind = 'chrip'\n",
    "no kind": "[reference]\nlow_hz = 3.0\n",
    "family": "[drive]\nfamily = 'cia'\n",
    "family key": "[drive]\nfamily = 'moteus'\nhost_id = 3\n",
    "bend": "[scenario.bend]\nkind = 'random'\nlow_deg = 200.0\nhigh_deg = 100.0\n",
    "points": "[reference]\nkind = 'point_to_point'\ntimes_s = [0.0, 1.0]\npositions_deg = [0.0]\n",
    "sines": "[reference]\nkind = 'multisine'\nfrequencies_hz = [0.1]\n",
    "law": "[control]\nlaw = 'pid'\n",
    "gain": "[control.gains]\nerror_gian = 1.0\n",
    "other's gain": "[control]\nlaw = 'uncompensated'\n[control.gains]\nerror_gain = 1.0\n",
    "gain twice": "[control.gains]\n'a.b' = 1.0\na.b = 2.0\n",
    "preset": "[control]\npreset = 'none'\n",
    "no model": "[cable]\nmodel = 'nowhere.toml'\n",
    "model and slope": "[cable]\nmodel = 'model.toml'\nslope = 0.9\n",
    "hash": "[cable]\nmodel = 'model.toml'\nmodel_hash = '0'\n",
    "hash alone": "[cable]\nmodel_hash = '0'\n",
    "zero alone": "[cable]\nmotor_zero_deg = 2.0\n",
    "parameters": "[cable]\nparameters = { slope = 1.0 }\n",
    "parameter": "[cable]\nmodel = 'model.toml'\nparameters = { slop = 1.0 }\n",
    "slope": "[cable]\nslope = 0.0\n",
    "no plant": "[cable]\nplant = 'nowhere.py'\n",
    "no motion": "[reference]\nkind = 'recorded'\nfile = 'nowhere.csv'\n",
    "no file": "[reference]\nkind = 'recorded'\n",
    "switched off": "[suit]\npretension_n = 60.0\n",
    "wearer": "[wearer]\nmass_kg = 90.0\n",
    "push off": "[admittance]\nlow_deg = 1.0\n",
    "push without": "[admittance]\nenabled = true\n",
    "idle": "[suit]\nworn = true\n[motor]\nspring_nm_per_rad = 1.0\n",
    "idle width": "[suit]\nworn = true\n[cable]\nwidth = 3.0\n",
    "idle slope": "[suit]\nworn = true\n[cable]\nslope = 0.5\n",
    "brake": "[brake]\nholding_torque_nm = 0.4\n",
    "brake drive": "[suit]\nworn = true\n[brake]\nholding_torque_nm = 0.4\n",
    "emg": "[emg]\nsource = 'nothing'\n",
    "emg ends": "[emg]\nsource = 'lsl:a'\nlow_deg = 80.0\n",
    "emg muscles": "[emg]\nsource = 'lsl:a'\nflexor = 'a'\nextensor = 'a'\n",
    "proportional": "[emg]\nsource = 'lsl:a'\nmode = 'proportional'\n",
    "run": "[scenario]\nduration_s = 99000.0\n[bench]\nsample_time_ms = 1.0\n",
    "filter": "[live]\njoint_cutoff_hz = 900.0\n",
    "limits": "[limits]\nmotor_low_deg = 100.0\nmotor_high_deg = 20.0\n",
    "joint": "[limits]\njoint_high_deg = 30.0\n",
    "play": "[limits]\nplay_deg = 80.0\n",
    "heartbeat": "[drive]\ndrive_heartbeat_ms = 900.0\n",
    "two cells": "[drive]\ntension_n_per_mv = 1.0\n[load_cell]\nsource = 'cia404'\nfull_scale = 5000.0\n",
    "cell": "[load_cell]\nsource = 'cia404'\n",
    "cell's node": "[load_cell]\nsource = 'cia404'\nfull_scale = 5000.0\nnode_id = 1\n",
    "feedforward": "[suit]\nworn = true\nfriction_feedforward_nm = 90.0\n",
    "one axis": "[[motor]]\nname = 'a'\n",
    "no motor": "motor = []\n",
    "axis name": "[[motor]]\nname = 'A b'\n[[motor]]\nname = 'b'\n[motor.drive]\nnode_id = 2\n",
    "axis twice": "[[motor]]\nname = 'a'\n[[motor]]\nname = 'a'\n[motor.drive]\nnode_id = 2\n",
    "one drive": "[[motor]]\nname = 'a'\n[[motor]]\nname = 'b'\n",
    "axis key": "[[motor]]\nname = 'a'\n[[motor]]\nname = 'b'\n[motor.drvie]\nnode_id = 2\n",
    "axis value": "[[motor]]\nname = 'a'\n[[motor]]\nname = 'b'\n[motor.drive]\nnode_id = 200\n",
    "axis clock": "[[motor]]\nname = 'a'\n[[motor]]\nname = 'b'\n[motor.drive]\nnode_id = 2\n[motor.bench]\n"
    "sample_time_ms = 2.0\n",
    "nameless": "[[motor]]\n[[motor]]\n",
    "independent": "independent = true\n",
    "independent 1": "independent = 1\n[[motor]]\nname = 'a'\n[[motor]]\nname = 'b'\n[motor.drive]\nnode_id = 2\n",
    "joint alone": "[[joint]]\nname = 'q'\n",
    "joint name": "[[joint]]\nname = 'q'\n[[motor]]\nname = 'a'\njoint = 'q'\n[[motor]]\nname = 'b'\njoint = 'p'\n"
    "[motor.drive]\nnode_id = 2\n",
    "joint slack": "[[joint]]\nname = 'q'\n[[motor]]\nname = 'a'\njoint = 'q'\n[[motor]]\nname = 'b'\njoint = 'q'\n"
    "[motor.drive]\nnode_id = 2\n",
    "joint key": "[[joint]]\nnmae = 'a'\n[[motor]]\nname = 'a'\n[[motor]]\nname = 'b'\n[motor.drive]\nnode_id = 2\n",
}
MODEL = """best = "bouc_wen"
[trust]
level = "with care"
reasons = ["one cycle"]
[covered]
motor_deg = [-5.0, 90.0]
joint_deg = [-4.0, 85.0]
[models.bouc_wen.parameters]
slope = 0.92
hysteresis_gain = -0.09
rate = 6.0
shape = 1.0
exponent = 1.2
offset = 0.01
initial_h = 0.0
[models.line.parameters]
slope = 0.93
offset = 0.0
"""


def plain(value: Any) -> Any:
    """A value as JSON has it."""
    if hasattr(value, "_asdict"):
        return {key: plain(one) for key, one in value._asdict().items()}
    if isinstance(value, Mapping):
        return {str(key): plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [plain(one) for one in value]
    return value if isinstance(value, bool | int | float | str | None) else str(value)


def kept(text: str) -> Path:
    """A rig.toml with this text."""
    path = Path("case.toml")
    path.write_text(text, encoding="utf-8")
    return path


def refused(error: BowdenError) -> list[Any]:
    """How a rig is refused."""
    return [type(error).__name__, str(error).replace(str(Path.cwd()), "")]


def follows(rig: Rig) -> dict[str, Any]:
    """What follows from a rig of one motor."""
    found: dict[str, Any] = {"tree": rig.tree()}
    for name in (
        "notes",
        *("supervisor_limits", "basis", "drive_needs", "drive_parameters", "knowledge", "worn", "bench", "cabled"),
        *("start_motor", "begin", "home", "slope", "turned", "filters"),
    ):
        try:
            found[name] = plain(getattr(rig, name))
        except BowdenError as error:
            found[name] = refused(error)
    found["gains"] = plain(rig.fitted().gains)
    found["reference"] = rig.trajectory.sample(np.linspace(0.0, rig.duration, 50)).tolist()
    found["bend"] = np.asarray(rig.bend_path(np.linspace(0.0, rig.duration, 50))).tolist()
    return found


def looked_at(text: str) -> Any:
    """All that a rig.toml comes to, or why it is refused."""
    try:
        rig = Rig.read(kept(text))
    except BowdenError as error:
        return refused(error)
    try:
        packed = Rig.unpack(rig.pack())
        written = Rig.of_tree(tomllib.loads(rig.to_toml()), Path("case.toml"))
        found = {
            "objections": list(objections(rig)),
            "packed": packed.tree() == rig.tree() and packed == rig and packed.hash == rig.hash,
            "written": written.tree() == rig.tree() and written.hash == rig.hash,
        }
    except BowdenError as error:
        found = {"objections": refused(error)}
    return found | {one[0]: follows(one[1]) for one in rig.parts}


def leaves(tree: Mapping[str, Any], path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Each key of a tree with its value."""
    for key, value in tree.items():
        if isinstance(value, Mapping):
            yield from leaves(value, (*path, key))
        else:
            yield (*path, key), value


def other(value: Any) -> str:
    """Another value than this one, near it."""
    if isinstance(value, bool):
        return str(not value).lower()
    if isinstance(value, int):
        return str(value + 1)
    if isinstance(value, float):
        return repr(value * 1.01 if value else 0.01)
    if isinstance(value, list):
        return repr([one * 1.01 for one in value])
    return json.dumps(f"{value}x")


def each_key(base: str) -> dict[str, Any]:
    """Of each key that a rig says: another value, one of another type, one that is out of any range, and no number."""
    rig = Rig.read(kept(BASES[base]))
    said = tomllib.loads(BASES[base])
    found: dict[str, Any] = {}
    for path, value in leaves(rig.tree()):
        for what, given in (("other", other(value)), ("text", '"x"'), ("huge", "-1e70"), ("nan", "nan")):
            tree = tomllib.loads(text_of(said, path, given))
            try:
                made = Rig.of_tree(tree, Path("case.toml"))
                found[f"{'.'.join(path)} {what}"] = [made.hash != rig.hash, plain(dict(leaves_text(made.tree())))]
            except BowdenError as error:
                found[f"{'.'.join(path)} {what}"] = refused(error)
    return found


def leaves_text(tree: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Each key by its dotted name."""
    for path, value in leaves(tree):
        yield ".".join(path), value


def text_of(said: Mapping[str, Any], path: tuple[str, ...], given: str) -> str:
    """The text of a rig that says all this, and another value of one key."""
    rows: dict[tuple[str, ...], dict[str, str]] = {}
    for place, value in leaves(said):
        rows.setdefault(place[:-1], {})[place[-1]] = json.dumps(value)
    rows.setdefault(path[:-1], {})[path[-1]] = given
    return "\n".join(
        f"[{'.'.join(title)}]\n" + "\n".join(f"{key} = {value}" for key, value in keys.items())
        for title, keys in sorted(rows.items())
    )


def main() -> None:
    """Print the document."""
    Path("model.toml").write_text(MODEL, encoding="utf-8")
    rows = [f"{k / 100!r},{30.0 - 30.0 * math.cos(k / 100)!r}" for k in range(900)]
    Path("motion.csv").write_text("\n".join(["time_s,joint_deg", *rows, ""]), encoding="utf-8")
    found = {name: looked_at(text) for name, text in BASES.items()}
    found |= {f"bad: {name}": looked_at(text) for name, text in BAD.items()}
    for base in ("bench", "suit", "push", *FAMILIES[1:], "cell", "chirp", "moved", "emg"):
        found[f"keys of {base}"] = each_key(base)
    print(json.dumps(found))


if __name__ == "__main__":
    main()

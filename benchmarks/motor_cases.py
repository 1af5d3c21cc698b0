"""What a checkout makes of several motors, on one joint and on several: the part `motors` of two_checkouts.py.

Run by text in both checkouts.
"""

import contextlib
import io
import json
import os
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

import bowden
from bowden import Rig
from bowden.app.main import run as run_command
from bowden.live.live_run import live_run

EVERY = 250
"""Cycles between two that are kept of a trace."""
UP = "[drive]\nnode_id = 1\n"
DOWN = "[drive]\nnode_id = 2\n[limits]\nslack_sign = 1.0\n"
HEAD = '[control]\nlaw = "bowden"\n[scenario]\nduration_s = 6.0\n'
BENT = HEAD + '[scenario.bend]\nkind = "scripted"\n'

SHARED: Mapping[str, tuple[str, float, tuple[str, str]]] = {
    "plain": (HEAD, 4.0, (UP, DOWN)),
    "slack": (HEAD, -4.0, (UP, DOWN)),
    "unlike": (
        HEAD,
        2.0,
        (UP + "[cable]\nslope = 0.92\noffset_deg = 3.0\n", DOWN + "[servo]\nnatural_frequency_hz = 9.0\n"),
    ),
    "first down": (HEAD, 3.0, (DOWN, UP)),
    "bent": (BENT, 4.0, (UP, DOWN)),
    "adaptive": (HEAD.replace("bowden", "adaptive"), 4.0, (UP, DOWN)),
}  # fmt: skip
"""Head, co-contraction [deg] and both motors of rigs with one joint."""
APART: Mapping[str, tuple[str, tuple[str, ...]]] = {
    "two": (HEAD, (UP, "[drive]\nnode_id = 2\n[reference]\nlow_deg = 5.0\nhigh_deg = 40.0\n")),
    "three": (
        "independent = true\n" + HEAD,
        (
            UP,
            "[drive]\nfamily = 'moteus'\nchannel = 'b'\n[control]\nlaw = 'cascaded_pid'\n",
            "[drive]\nnode_id = 3\n[servo]\ndamping = 0.9\n",
        ),
    ),
}
BAD: Mapping[str, tuple[str, str]] = {
    "no sign": ("slack_sign = 1.0", "slack_sign = -1.0"),
    "too much": ("co_contraction_deg = 4.0", "co_contraction_deg = 20.0"),
    "beyond": ("co_contraction_deg = 4.0", "co_contraction_deg = 60.0"),
    "key": ("co_contraction_deg", "contraction_deg"),
    "reference": ("slack_sign = 1.0", "slack_sign = 1.0\n[motor.reference]\nhigh_deg = 20.0"),
    "independent": ("duration_s = 6.0", "duration_s = 6.0\n[live]\npriority = 0\n"),
    "suit": ("node_id = 2", "node_id = 2\n[motor.suit]\nworn = true"),
    "plant": ("node_id = 2", "node_id = 1"),
    "turned": ("node_id = 2", "node_id = 2\n[motor.cable]\nslope = -0.9"),
    "name": ('name = "m2"', 'name = "M 2"'),
    "twice": ('name = "m2"', 'name = "m1"'),
    "emg": ("duration_s = 6.0", 'duration_s = 6.0\n[emg]\nsource = "lsl:EMG"\n'),
}


def text_of(head: str, motors: Sequence[str], contraction: float | None = None) -> str:
    """A rig.toml."""
    first, rest = (
        ("", head) if not head.startswith("independent") else (head.split("\n", 1)[0] + "\n", head.split("\n", 1)[1])
    )
    joint = "" if contraction is None else 'joint = "q"\n'
    parts = [first, rest]
    if contraction is not None:
        parts.append(f'[[joint]]\nname = "q"\nco_contraction_deg = {contraction}\n')
    for i, own in enumerate(motors):
        parts.append(f'[[motor]]\nname = "m{i + 1}"\n{joint}' + own.replace("[", "[motor."))
    return "".join(parts)


def command(*words: str) -> Any:
    """What a command prints, and its exit code."""
    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(io.StringIO()):
        code = run_command([*words])
    try:
        found = json.loads(said.getvalue())
    except ValueError:
        found = {}
    return {**found, "code": code}


def kept(trace: Any) -> dict[str, list[float]]:
    """A trace, now and then."""
    return {name: np.nan_to_num(values[::EVERY]).tolist() for name, values in trace.columns.items()}


def loops(found: Mapping[str, Any]) -> dict[str, Any]:
    """A check without its names."""
    shared = found.get("shared") or {}
    names = ("verdict", "holds", "gain_margin_db", "phase_margin_deg", "delay_margin_s", "limit_cycle", "chatter")
    own = {name: found.get(name) for name in (*names, "simulated_peak_deg", "code")}
    own["largest_pole"] = (found.get("worst") or {}).get("largest_pole")
    margins = [[one[f"{name}"] for name in names[2:5]] for one in shared.get("loops", ())]
    return own | {"loops": margins, **{k: shared.get(k) for k in ("motors_apart_deg", "largest_pole_apart")}}


def each_of(path: Path) -> dict[str, Any]:
    """What the commands and Python say of one rig."""
    checked, ran = (command(word, str(path), "--json") for word in ("check", "simulate"))
    motors = live_run(Rig.read(path)).motors
    traces = bowden.simulate(path, duration=4.0)
    figures = ("rmse_deg", "peak_deg", "stable", "check", "mechanical_energy_j", "delay_s")
    return {
        "check": loops(checked),
        "each": [loops(one) for one in checked.get("joints", ())],
        "simulate": [{name: run.get(name) for name in figures} for run in ran.get("runs", ())],
        "motors": [
            [{name: x for name, x in motor.items() if name != "motor"} for motor in run["motors"]]
            for run in ran.get("runs", ())
        ],
        "traces": [kept(trace) for trace in traces.values()],
        "limits": [one.limits._asdict() for one in motors],
        "taut": [one.limits.taut for one in motors],
        "starts": [[one.start, one.table[::EVERY, 0].tolist()] for one in motors],
    }


def lived(path: Path, folder: Path) -> dict[str, Any]:
    """A run of it on its twins, in the loop's own process."""
    from support.joint_runs import shared_run

    folder.mkdir()
    ended, rows = shared_run(folder, Rig.read(path).replace(duration=4.0)).run()
    columns = {
        f"{name} {key}": np.nan_to_num(part[key][::25], posinf=9e9).tolist()
        for name, part in rows.parts.items()
        for key in part.columns
        if key != "run_time"
    }
    return {"mode": ended.mode, "faults": ended.faults, "columns": columns}


def main() -> None:
    """Each rig in a folder of its own."""
    found: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        path = Path("rig.toml")
        for name, (head, contraction, motors) in SHARED.items():
            path.write_text(text_of(head, motors, contraction))
            found[f"shared {name}"] = each_of(path)
            if name in ("plain", "unlike", "adaptive"):
                found[f"lived {name}"] = lived(path, Path(f"run {name}"))
        for name, (head, several) in APART.items():
            path.write_text(text_of(head, several))
            found[f"apart {name}"] = each_of(path)
        plain = text_of(HEAD, (UP, DOWN), 4.0)
        for name, (old, new) in BAD.items():
            path.write_text(plain.replace(old, new))
            found[f"bad {name}"] = [command(word, str(path), "--json")["code"] for word in ("check", "simulate")]
        path.write_text(text_of(SHARED["adaptive"][0], (UP, DOWN), 4.0))
        tuned = bowden.tune(path, generations=1)
        found["tune"] = [dict(tuned.gains), tuned.worst_rmse, tuned.worst_before, tuned.gain_margin_db]
    print(json.dumps(found, default=str))


if __name__ == "__main__":
    main()

"""The test bench of an exported law: a C program that replays a recorded run and compares its commands."""

from bowden.control.law import Law
from bowden.core.nested import leaves
from bowden.export.kinds import identifier
from bowden.export.law import prefix, state_of
from bowden.export.unit import template

COLUMNS = (
    "joint_seen",
    "motor_seen",
    "reference",
    "reference_velocity",
    "reference_acceleration",
    "requested_target",
    "source",
)
"""Columns of a recording, named as in the log of a live run: ``bowden log export run.mcap --to csv`` gives one."""


def replay_source(law: Law, *, single: bool = False) -> str:
    """The program for a law.

    Args:
        law: with its gains.
        single: the law's code is in float, and its commands are not expected to be the recorded ones to the bit.
    """
    ways = [path for path, _ in leaves(state_of(law))]
    reached = ("".join(f".at[{one}]" if isinstance(one, int) else f".{identifier(one)}" for one in way) for way in ways)
    values = "".join(f",\n                (double)state{way}" for way in reached)
    return (
        template("replay.c")
        .replace("@NAME@", prefix(law))
        .replace("@EXACT@", "0" if single else "1")
        .replace("@VALUES@", values)
        .replace("@HEADER@", ",".join(".".join(map(str, way)) for way in ways))
    )

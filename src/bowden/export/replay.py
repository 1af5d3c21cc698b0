"""The test bench of an exported law: a C program that replays a recorded run and compares its commands."""

from bowden.control.law import Law
from bowden.export.law import prefix, state_of
from bowden.export.layout import leaves
from bowden.export.unit import template

COLUMNS = ("joint_seen", "motor_seen", "reference", "reference_velocity", "reference_acceleration", "wish", "source")
"""Columns of a recording, named as in the log of a live run: ``bowden log export run.mcap --to csv`` gives one."""


def replay_source(law: Law, *, single: bool = False) -> str:
    """The program for a law.

    Args:
        law: with its gains.
        single: the law's code is in float, and its commands are not expected to be the recorded ones to the bit.
    """
    name = prefix(law)
    state = [leaf.access("state") for leaf in leaves(state_of(law))]
    values = ",\n        ".join(["(double)command", *(f"(double){text}" for text in state)])
    names = ",".join(leaf.name for leaf in leaves(state_of(law)))
    names = f"command,{names}"
    return (
        template("replay.c")
        .replace("@NAME@", name)
        .replace("@EXACT@", "0" if single else "1")
        .replace("@VALUES@", values)
        .replace("@HEADER@", names)
    )

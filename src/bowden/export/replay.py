"""The test bench of an exported law: a C program that replays a recorded run and compares its commands."""

from bowden.control.law import Law
from bowden.core.nested import leaves, name_of
from bowden.export.kinds import reached
from bowden.export.law import prefix, state_of
from bowden.export.unit import rendered

COLUMNS = (
    *("joint_seen", "motor_seen", "reference", "reference_velocity", "reference_acceleration"),
    *("requested_target", "source"),
)
"""Columns of a recording, named as in the log of a live run: ``bowden log export run.mcap`` gives one."""


def replay_source(law: Law, *, single: bool = False) -> str:
    """The program for a law.

    Args:
        law: with its gains.
        single: the law's code is in float, and its commands are not expected to be the recorded ones to the bit.
    """
    ways = [way for way, _ in leaves(state_of(law))]
    values = "".join(f",\n                (double)state{reached(way)}" for way in ways)
    header = ",".join(map(name_of, ways))
    return rendered("replay.c", name=prefix(law), exact=int(not single), values=values, header=header)

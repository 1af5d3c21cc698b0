"""Columns of logs of earlier versions, by the names that they have today.

What was recorded then is what is recorded now, under other names: the log can be drawn, exported and replayed as any.
"""

import math
from collections.abc import Iterator, Mapping, Sequence

_SUPERVISOR: Mapping[str, str] = {
    "mode": "decided.mode",
    "passed": "decided.passed",
    "before": "decided.target_before",
    "bridged": "decided.bridged",
    "released": "decided.released",
    "eased": "decided.eased",
    "latched": "decided.latched",
    "enabled": "servo.enabled",
    "model": "servo.position",
    "model_speed": "servo.speed",
    "astray": "servo.astray",
    "motor": "motor.value",
    "motor_speed": "motor.speed",
    "motor_gap": "motor.age",
    "joint": "joint.value",
    "joint_speed": "joint.speed",
    "joint_gap": "joint.age",
    "anchor_motor": "anchor.motor",
    "anchor_joint": "anchor.joint",
    "overload": "sums.overload",
    "saturated": "sums.saturated",
    "slack": "sums.slack",
    "late": "sums.late",
    "bus_errors": "sums.bus_errors",
    "failures": "sums.failures",
    "armed": "sums.armed",
    "winding": "heat.winding",
    "housing": "heat.housing",
    "i2t": "heat.i2t",
}

_PUSH: Mapping[str, str] = {
    "position": "virtual.position",
    "velocity": "virtual.velocity",
    "acceleration": "virtual.acceleration",
    "push": "push.torque",
    "rested": "push.rested",
    "slow": "push.slow",
    "spool": "estimate.spool",
    "joint": "estimate.joint",
    "spool_rate": "estimate.spool_rate",
    "joint_rate": "estimate.joint_rate",
    "current": "estimate.current",
    "flexor_node": "estimate.flexor_node",
    "extensor_node": "estimate.extensor_node",
    "estimate": "estimate.torque",
    "doubt": "estimate.doubt",
    "from_current": "estimate.from_current",
    "from_stretch": "estimate.from_stretch",
}

_ONE_BY_ONE: Mapping[str, str] = {"push.heard": "push.settled_target", "conditioned.told": "conditioned.given"}
"""Old name → name of today, of columns that no other state ever had."""

SINCE: Mapping[str, float] = {
    "foreign": 0.0,
    "sample_age": 0.0,
    "joint_torque": math.nan,
    **{f"supervisor.load.{name}": 0.0 for name in ("motor", "reading", "unanswered")},
    "supervisor.sums.strained": 0.0,
    "supervisor.sums.undisabled": 0.0,
    "supervisor.sums.off_reference": 0.0,
    **{f"supervisor.decided.{name}": 0.0 for name in ("joint_then", "motor_then", "met", "ahead")},
    **{f"supervisor.anchor.{name}": 0.0 for name in ("unanswered", "current", "travelled", "swung")},
    "supervisor.sample_age": 0.0,
    **{f"supervisor.pair.{name}": 0.0 for name in ("met", "parted")},
}
"""Columns of a run's readings and supervisor that older logs do not have, with what stands for them."""

_RENAMED: tuple[Mapping[str, str], ...] = tuple(
    {f"{part}.{old}": f"{part}.{name}" for old, name in names.items() if old != name}
    for part, names in {"supervisor": _SUPERVISOR, "admittance": _PUSH}.items()
)
"""Old name → name of today, one state a mapping; a law of then is another law, and its columns keep their names."""


def names_of_today(columns: Sequence[str]) -> tuple[str, ...]:
    """The columns of a log under today's names; those that no state of old had keep theirs.

    >>> names_of_today(("time", "supervisor.mode"))
    ('time', 'supervisor.mode')
    >>> names_of_today(("time", "push.heard"))
    ('time', 'push.settled_target')
    """
    there = set(columns)
    old = dict(_ONE_BY_ONE) | {name: new for names in _found(there) for name, new in names.items()}
    return tuple(old.get(name, name) for name in columns)


def _found(there: set[str]) -> Iterator[Mapping[str, str]]:
    """The states of which a log has every old name: one alone may be another law's own."""
    if any(name.count(".") > 1 for name in there) or not {"supervisor.winding"} & there:
        return
    yield from (names for names in _RENAMED if set(names) <= there)

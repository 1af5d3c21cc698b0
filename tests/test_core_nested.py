"""Nested states and their flat columns: names, order, units, and the way there and back, interpreted and compiled."""

from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
import pytest

from bowden.control import LAWS
from bowden.core.kernel import compiled, kernel
from bowden.core.nested import columns, flat, from_columns, names, unflatten
from bowden.core.signals import Sample
from bowden.live.row import STOPPED, SUPERVISOR

STATES = [STOPPED, *(law.start(Sample(0.1, 0.2)) for law in LAWS.values())]


@kernel
def there(state: Any, out: Any) -> None:
    numbers = flat(state)
    for i in range(len(numbers)):
        out[i] = numbers[i]


@kernel
def back(like: Any, row: Any) -> Any:
    return unflatten(like, row)


@pytest.mark.parametrize("state", STATES, ids=lambda state: type(state).__name__)
def test_a_state_comes_back_from_its_columns(state: Any) -> None:
    own = names(state)
    assert len(set(own)) == len(own) == len(flat(state))
    kept = [float(leaf) if isinstance(leaf, bool | IntEnum) else k for k, leaf in enumerate(flat(state), 1)]
    row = np.array(kept, dtype=np.float64)
    filled = unflatten(state, row)
    assert type(filled) is type(state)
    assert flat(filled) == tuple(row)
    assert from_columns(state, dict(zip(own, row, strict=True))) == filled
    assert list(columns(state, "law")) == [f"law.{name}" for name in own]
    out = np.empty(len(own))
    compiled(there)(filled, out)
    assert np.array_equal(out, row)
    assert compiled(back)(state, row) == filled


class Answer(IntEnum):
    NO = 2
    YES = 5


class Decision(NamedTuple):
    answer: Answer
    sure: bool
    count: float


def test_a_bool_stays_a_bool_and_an_enum_an_enum() -> None:
    state = Decision(Answer.YES, False, 0.0)
    row = np.array([2.0, 1.0, 3.0])
    out = np.empty(3)
    for made in (unflatten(state, row), compiled(back)(state, row)):
        assert made == (Answer.NO, True, 3.0)
        assert [type(part) for part in made] == [Answer, bool, float]
        compiled(there)(made, out)
        assert np.array_equal(out, row)


def test_units_are_those_of_the_types() -> None:
    assert SUPERVISOR["supervisor.motor.speed"] == "rad/s"
    assert SUPERVISOR["supervisor.heat.winding"] == "°C"
    assert SUPERVISOR["supervisor.decided.mode"] == "1"
    units = LAWS["bowden"].columns()
    assert units["law.deadzone.width"] == "rad"
    assert units["law.oscillation.load_time"] == "s"
    assert LAWS["adaptive"].columns()["law.joint_rate"] == "rad/s"

"""Cables for a bench: plays, alone, in a stack and between bent branches, and each by its name."""

import itertools
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.core.errors import ParameterError, near
from bowden.core.kernel import kernel
from bowden.models.cable.backlash import Play, push
from bowden.models.cable.bouc_wen import BoucWen, saturation, upright
from bowden.models.cable.bouc_wen_static import StaticTerms
from bowden.models.cable.capstan import Tendon
from bowden.models.cable.generalised_play import Branches, joined, mean_branch, push_slots
from bowden.models.cable.lumped_cable import LumpedTendon
from bowden.plants.bench import Bench
from bowden.plants.cable import Cable, Seen, bouc_wen
from bowden.plants.friction_cables import lumped, sliding
from bowden.plants.predicted import branches_of, numbered, whole_slope
from bowden.plants.scheduled_cable import scheduled


class Stack(NamedTuple):
    """Play operators side by side, as many as there are half-widths; a pure play is a stack of one."""

    slope: float
    """w₀, share of the joint's motion that has no play [rad/rad]."""
    half_widths: NDArray[np.float64]
    """rᵢ (k,) [rad]."""
    weights: NDArray[np.float64]
    """wᵢ (k,) [rad/rad]."""
    offset: float
    """[rad]"""


class Slots(NamedTuple):
    """Where the slots are; changed in place."""

    z: NDArray[np.float64]
    """(k,) [rad]."""


@kernel
def stack_start(cable: Stack, motor: float, width: float, slope_factor: float) -> Slots:
    """Every slot centred on the motor."""
    return Slots(np.full(cable.half_widths.size, motor))


@kernel
def stack_advance(
    cable: Stack, memory: Slots, before: float, after: float, scaled: float, width: float, dt: float
) -> Slots:
    """Every slot, `width` times as wide, pushed by the motor; in place."""
    for i in range(memory.z.size):
        memory.z[i] = push(memory.z[i], after, width * cable.half_widths[i])
    return memory


@kernel
def stack_look(cable: Stack, memory: Slots, motor: float, width: float, slope_factor: float) -> Seen:
    """joint = slope_factor·(w₀·motor + Σ wᵢ·zᵢ) + offset."""
    joint = cable.slope * motor
    for i in range(memory.z.size):
        joint += cable.weights[i] * memory.z[i]
    return Seen(slope_factor * joint + cable.offset, np.nan, np.nan)


@kernel
def branches_start(cable: Branches, motor: float, width: float, slope_factor: float) -> Slots:
    """Every z in the middle between the branches."""
    return Slots(np.full(cable.reaches.size, mean_branch(motor, cable)))


@kernel
def branches_advance(
    cable: Branches, memory: Slots, before: float, after: float, scaled: float, width: float, dt: float
) -> Slots:
    """Every z pushed by the branches, `width` times as far apart; in place."""
    push_slots(memory.z, after, width, cable)
    return memory


@kernel
def branches_look(cable: Branches, memory: Slots, motor: float, width: float, slope_factor: float) -> Seen:
    """See `bowden.models.cable.generalised_play`."""
    return Seen(joined(memory.z, motor, slope_factor, cable), np.nan, np.nan)


def play(parameters: Play | None = None) -> Cable:
    """Pure play, Eqs 4–5; with the defaults of `Play` where nothing is given.

    Raises:
        ParameterError: a half-width below 0.
    """
    parameters = parameters or Play()
    if not parameters.half_width >= 0.0:
        raise ParameterError(f"play: half_width is {parameters.half_width:g}", expected="a number not below 0")
    cable = Stack(0.0, np.array([parameters.half_width]), np.array([parameters.slope]), parameters.offset)
    return Cable("play", parameters, cable, stack_start, stack_advance, stack_look, parameters.slope)


def stack(slope: float, half_widths: Sequence[float], weights: Sequence[float], offset: float = 0.0) -> Cable:
    """A Prandtl–Ishlinskii stack: joint = slope·motor + Σ weightᵢ·zᵢ + offset.

    Args:
        slope: w₀ [rad/rad].
        half_widths: rᵢ (k,) [rad].
        weights: wᵢ (k,) [rad/rad].
        offset: [rad].

    Raises:
        ParameterError: lengths that differ, or a half-width below 0.
    """
    cable = Stack(float(slope), np.array(half_widths, dtype=float), np.array(weights, dtype=float), float(offset))
    if cable.half_widths.shape != cable.weights.shape or not (cable.half_widths >= 0.0).all():
        raise ParameterError(
            f"stack of plays: half-widths {list(half_widths)}, weights {list(weights)}",
            expected="two lists of one length, half-widths not below 0",
        )
    whole = cable.slope + float(cable.weights.sum())
    return Cable("prandtl_ishlinskii", cable, cable, stack_start, stack_advance, stack_look, whole)


def generalised_play(cable: Branches) -> Cable:
    """A stack of plays between two bent branches.

    Raises:
        ParameterError: lengths that do not match, a range that is none, or a gap, a reach or a share below 0.
    """
    sizes = cable.reaches.shape == cable.shares.shape and min(cable.bends.size, cable.gaps.size) >= 2
    least = min(float(values.min(initial=0.0)) for values in (cable.gaps, cable.reaches, cable.shares))
    if not (sizes and least >= 0.0 and cable.high > cable.low):
        raise ParameterError(
            f"generalised play: {cable}",
            expected="two bends and gaps or more, as many reaches as shares, none of these but bends below 0, "
            "and the last node above the first",
        )
    return Cable("generalised_play", cable, cable, branches_start, branches_advance, branches_look, cable.slope)


def identified(name: str, parameters: Mapping[str, float]) -> Cable:
    """The cable of a model that `bowden identify` has found.

    A cable that runs backwards (a negative slope) is turned round: its motor is counted the other way, so that the
    joint follows in the same direction. It begins at rest, with no hysteresis locked in, not where the log did.

    Args:
        name: ``play``, ``bouc_wen``, ``bouc_wen_static``, ``prandtl_ishlinskii``, ``generalised_play``,
            ``scheduled``, or one of `DISTRIBUTED`.
        parameters: the model's, by name; SI and radians. What is left out of a distributed one is as its default.

    Raises:
        ParameterError: another name, or a parameter that is missing.
    """
    try:
        return _IDENTIFIED[name]({key: float(value) for key, value in parameters.items()})
    except KeyError as error:
        raise ParameterError(
            f"no cable from the model {name!r} with {', '.join(parameters) or 'no parameters'}",
            expected=f"one of {', '.join(_IDENTIFIED)} with all its parameters",
            do=f"{error.args[0]!r} is missing",
        ) from None


def plant_of_model(name: str, parameters: Mapping[str, float], bench: Bench) -> Bench:
    """A bench with the cable of an identified model: its servo, motor, encoders, sheath and clock stay.

    A cable that runs backwards is turned round, see `identified`.

    Args:
        name: the model's.
        parameters: by name; radians.
        bench: with everything but the cable.

    Raises:
        ParameterError: another name, or a parameter that is missing.
    """
    cable = identified(name, parameters)
    bent = name == "scheduled" and "bend_low" in parameters
    if bent:
        cable = scheduled(parameters, "bend", bench.sheath)
    if name == "bouc_wen":
        return bench._replace(cable=cable.parameters)
    # a physical cable computes what its sheath loses, and one scheduled by the bend was measured with it
    sheath = bench.sheath._replace(loss=0.0) if cable.physical or bent else bench.sheath
    return bench._replace(cable=cable, sheath=sheath)


def bouc_wen_like(cable: Cable) -> BoucWen:
    """The Bouc–Wen cable with the slope and the dead zone that another one has in the middle of a slow stroke and back.

    How quickly its h follows is as the default's.
    """
    way = np.linspace(0.0, _SWEPT, _SWEEP + 1)
    angles = np.concatenate([way, way[-2::-1]]).tolist()
    memory, joints = cable.start(cable.prepared, 0.0, 1.0, 1.0), [0.0]
    for before, after in itertools.pairwise(angles):
        memory = cable.advance(cable.prepared, memory, before, after, after - before, 1.0, _SWEEP_STEP)
        joints.append(float(cable.look(cable.prepared, memory, after, 1.0, 1.0).joint))
    height, like = abs(joints[_SWEEP // 2] - joints[-1 - _SWEEP // 2]), BoucWen()
    return like._replace(slope=float(cable.slope), hysteresis_gain=-0.5 * height / float(saturation(like)))


def moved(name: str, parameters: Mapping[str, float], motor: NDArray[np.float64]) -> NDArray[np.float64]:
    """The joint of `identified` along a motion of the motor, a hundredth of a second from sample to sample (n,) [rad].

    Raises:
        ParameterError: see `identified`.
    """
    cable = identified(name, parameters)
    memory, joints = cable.start(cable.prepared, float(motor[0]), 1.0, 1.0), np.empty(len(motor))
    for i, after in enumerate(motor.tolist()):
        before = float(motor[max(i - 1, 0)])
        memory = cable.advance(cable.prepared, memory, before, after, after - before, 1.0, 0.01)
        joints[i] = cable.look(cable.prepared, memory, after, 1.0, 1.0).joint
    return joints


def _play(given: Mapping[str, float]) -> Cable:
    return play(Play(abs(given["slope"]), given["half_width"], given["offset"]))


def _stack(given: Mapping[str, float]) -> Cable:
    widths, weights = numbered(given, "half_width_"), numbered(given, "weight_")
    sign = -1.0 if whole_slope(given) < 0.0 else 1.0
    return stack(sign * given["slope"], widths, [sign * weight for weight in weights], given["offset"])


def _generalised(given: Mapping[str, float]) -> Cable:
    cable = branches_of(given)
    if cable.slope < 0.0:  # the motor counted the other way: the nodes come in the other order
        bends, gaps = cable.bends[::-1].copy(), cable.gaps[::-1].copy()
        cable = cable._replace(slope=-cable.slope, bends=bends, gaps=gaps, low=-cable.high, high=-cable.low)
    return generalised_play(cable)


def _bouc_wen(given: Mapping[str, float]) -> Cable:
    cable = BoucWen(**{field: given[field] for field in BoucWen._fields})
    turned = -1.0 if cable.slope < 0.0 else 1.0
    cable = upright(cable)
    if "static_centre" not in given:
        return bouc_wen(cable)
    static, heights = numbered(given, "static_", first=2), numbered(given, "hysteresis_gain_")
    terms = StaticTerms(  # Tₖ(−u) = (−1)ᵏ·Tₖ(u), and h(−motor) = −h
        np.array([turned**k * value for k, value in enumerate(static, 2)]),
        np.array([turned ** (k + 1) * value for k, value in enumerate(heights, 1)]),
        turned * given["static_centre"],
        given["static_half_range"],
    )
    return bouc_wen(cable, terms)


def _sliding(given: Mapping[str, float]) -> Cable:
    return sliding(_filled(Tendon(), given, "sliding"))


def _lumped(given: Mapping[str, float], *, dahl: bool) -> Cable:
    default = _lumped_default(dahl=dahl)
    own = {name: value for name, value in given.items() if name in _LUMPED}
    tendon = {name: value for name, value in given.items() if name not in _LUMPED}
    name = "lumped_dahl" if dahl else "lumped_coulomb"
    return lumped(_filled(default, own, name)._replace(tendon=_filled(default.tendon, tendon, name)))


def distributed_parameters(name: str) -> dict[str, float]:
    """The parameters of one of `DISTRIBUTED`, by name, as they are where nothing is said of them."""
    found = _numbers_of_tendon(Tendon())
    if name != "sliding":
        default = _lumped_default(dahl=name == "lumped_dahl")
        found = _numbers_of_tendon(default.tendon) | {one: float(getattr(default, one)) for one in _LUMPED}
    return found


def _numbers_of_tendon(tendon: Tendon) -> dict[str, float]:
    return {name: float(value) for name, value in tendon._asdict().items() if isinstance(value, int | float)}


def _lumped_default(*, dahl: bool) -> LumpedTendon:
    return LumpedTendon(dahl=dahl, presliding=1e-4 if dahl else LumpedTendon().presliding)


def _filled(default: Any, given: Mapping[str, float], cable: str) -> Any:
    """A tendon with some numbers of its own."""
    known = [name for name, value in default._asdict().items() if isinstance(value, int | float)]
    for name in given:
        if name not in known:
            raise ParameterError(f"a {cable!r} cable has no parameter {name!r}", expected=near(name, known))
    return default._replace(**{name: type(getattr(default, name))(value) for name, value in given.items()})


_IDENTIFIED: dict[str, Any] = {
    "play": _play,
    "bouc_wen": _bouc_wen,
    "bouc_wen_static": _bouc_wen,
    "prandtl_ishlinskii": _stack,
    "generalised_play": _generalised,
    "sliding": _sliding,
    "lumped_coulomb": partial(_lumped, dahl=False),
    "lumped_dahl": partial(_lumped, dahl=True),
    "scheduled": scheduled,
}

_LUMPED = ("density", "inertia", "damping", "presliding", "step")
_SWEPT, _SWEEP, _SWEEP_STEP = 1.0, 200, 0.01
"""Stroke of the motor [rad], in how many steps, and the time of each [s]."""

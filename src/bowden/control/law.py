"""The protocol of a control law, and the registry that names them.

A law is two kernels and a NamedTuple of gains:

    start(gains, sample) -> state
    step(gains, state, sample, reference, dt) -> (state, command)

Both are kernels (``docs/own_law.md``), and the state is a NamedTuple of floats, bools, enums and further NamedTuples,
so that one source runs interpreted, compiled in simulation and in the live loop, and exported as
C99, and every state variable can be recorded.
"""

import difflib
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

from bowden.control.conditioning import Conditioning
from bowden.core.arguments import format_value
from bowden.core.errors import ParameterError, near
from bowden.core.guesses import answering
from bowden.core.kernel import placeholder
from bowden.core.nested import columns, is_named, leaves, map_leaves, name_of, quantity_at
from bowden.core.part import signed
from bowden.core.signals import Reference, Sample
from bowden.drawing import shown

Gains = Any  # a NamedTuple of floats (nested ones allowed), one type a law
State = Any  # a NamedTuple of floats (nested ones allowed), one type a law
FromRig = str | Callable[[Any], float]
"""A field of `bowden.control.knowledge.Knowledge`, or a function of it; one of a nested tuple as ``cable.slope``."""


@placeholder
def law_start(gains: Any, sample: Sample) -> Any:
    """Placeholder for a law's ``start`` in a loop's source; `specialise` puts the law's own in its place."""
    raise NotImplementedError  # always replaced


@placeholder
def law_step(gains: Any, state: Any, sample: Sample, reference: Reference, dt: float) -> Any:
    """Placeholder for a law's ``step``."""
    raise NotImplementedError  # always replaced


class UltimateBounds(NamedTuple):
    """The sets in which a law's own proof lets its errors end."""

    filtered_error: float
    """Bound on |s| [rad·s]."""
    error: float
    """Bound on |e| [rad]."""


@answering(
    {
        **dict.fromkeys(("set_gains", "replace", "tuned", "set"), "law.with_gains(name=value)"),
        **dict.fromkeys(("gain", "params", "parameters"), "law.numbers, or law.gains"),
        "simulate": "bowden.simulate(rig, law)",
    },
    "law.with_gains(name=value)",
)
@signed
@dataclass(frozen=True, repr=False)
class Law(shown.Shown):
    """A control law with its gains; it can be used alone, without a rig or a simulation.

    >>> from bowden.control import LAWS
    >>> law = LAWS["uncompensated"]
    >>> state = law.start(Sample(joint=0.0, motor=0.0))
    >>> state, command = law.step(state, Sample(0.0, 0.0), Reference(0.2, 0.0, 0.0), 0.001)
    >>> float(command)
    0.2
    """

    name: str
    """Its key in `LAWS`."""
    gains: Gains
    """NamedTuple handed to the kernels."""
    start_kernel: Callable[[Gains, Sample], State]
    """``start(gains, sample) -> state``."""
    step_kernel: Callable[[Gains, State, Sample, Reference, float], tuple[State, float]]
    """``step(gains, state, sample, reference, dt) -> (state, command)``."""
    source: str
    """Where the law comes from."""
    presets: Mapping[str, Gains] = field(default_factory=dict)
    """Other named sets of gains, such as the ones a paper printed."""
    suit_preset: str | None = None
    """The preset with which the law begins on a suit, where a rig names no preset and no gains of its own."""
    from_rig: Mapping[str, FromRig] = field(default_factory=dict)
    """Gain → what of a rig's `bowden.control.knowledge.Knowledge` it takes."""
    feeds_back: frozenset[str] = frozenset({"joint", "motor"})
    """The measured angles on which the command depends once the law has begun, by their names in `Sample`."""
    compensates_lag: bool = False
    """True if the law itself sends the motor ahead of the reference, by the lag of servo and delay."""
    settling: Callable[[Any], float] | None = None
    """Gains → how long the law moves until its estimates have settled [s]; the check tries it for as long. A law that
    does not say is tried for as long as the check ever does."""
    proven: "Callable[[Any, float, float], UltimateBounds | None] | None" = None
    """Gains, the cable's slope [rad/rad] and half its dead zone at the joint [rad] → where the law's own proof lets its
    errors end; None where it says nothing, as of gains for which it does not hold."""
    deadband: float = 0.0
    """Motion of the joint below which the feedback weighs it less; the linear loop is that of larger motions [rad]."""
    tunable: frozenset[str] | None = None
    """Gains that are a designer's choice, and no fact of the rig: what `tune` moves and `check` advises to change; a
    nested part's name stands for all of it. Of a law that does not say, all that `from_rig` does not set; never None
    once the law is made."""
    limits: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    """Gain → the smallest and the largest value that makes sense; `with_gains` refuses others. A gain that is not named
    here has the range that its `Quantity` declares, if it has one."""
    state_units: Mapping[str, str] = field(default_factory=dict)
    """Field of the state, or its column (``part.field``) → unit for the record, where the state's type does not say."""
    default_gains: Gains = field(default=None, repr=False)
    """The gains with which the law comes; `gains` where nothing else is given."""
    conditioning: Conditioning = field(default=Conditioning(), repr=False, compare=False)
    """Knowledge of the rig for the conditioner of its reference, which stands before the law in every loop; no part of
    it."""
    overridden_gains: frozenset[str] = frozenset()
    """Gains that a preset or `with_gains` set: what a rig knows leaves them alone."""

    def __new__(cls, *given: Any, **named: Any) -> "Law":
        """Refuse an unknown field, and name the likely one."""
        fields = cls.__dataclass_fields__
        for name in named:
            if name not in fields:
                raise ParameterError(f"a law has no {name!r}", expected=near(name, fields), do="correct the name")
        return super().__new__(cls)

    def __post_init__(self) -> None:
        """Keep the law's own gains, and refuse a declaration that cannot be.

        Raises:
            ParameterError: `from_rig`, `tunable` or `feeds_back` names what is not there, `suit_preset` no preset, or a
                live gain is no choice or has no limits.
        """
        if not isinstance(self.name, str):
            raise ParameterError(f"Law: name is {format_value(self.name)}", expected="text", do="give it a name")
        if not is_named(self.gains):
            raise ParameterError(
                f"Law {self.name!r}: gains is {format_value(self.gains)}",
                expected="a NamedTuple of numbers",
                do="make one: class Gains(NamedTuple), and pass Gains()",
            )
        for what in ("start_kernel", "step_kernel"):
            if not callable(getattr(self, what)):
                raise ParameterError(
                    f"Law {self.name!r}: {what} is {format_value(getattr(self, what))}",
                    expected="a kernel",
                    do="pass a function that is marked with @bowden.kernel",
                )
        if self.default_gains is None:
            object.__setattr__(self, "default_gains", self.gains)
        if not isinstance(self.from_rig, Mapping):
            raise ParameterError(
                f"from_rig of law {self.name!r} is {format_value(self.from_rig)}",
                expected="gain → what it takes from the rig",
                do='write it as {"slope": "slope"}',
            )
        if self.tunable is None:
            object.__setattr__(self, "tunable", frozenset(self.gains._fields) - frozenset(self.from_rig))
        if isinstance(self.tunable, str) or not isinstance(self.tunable, Iterable):
            raise ParameterError(
                f"tunable of law {self.name!r} is {format_value(self.tunable)}",
                expected="names of gains",
                do='write it as frozenset({"bandwidth"})',
            )
        for what, given, known in (
            ("from_rig", self.from_rig, self.gains._fields),
            ("tunable", self.tunable, self.gains._fields),
            ("feeds_back", self.feeds_back, Sample._fields),
            ("suit_preset", {self.suit_preset} - {None}, self.presets),
        ):
            for name in given:
                if name not in known:
                    raise ParameterError(
                        f"{what} of law {self.name!r} names {name!r}", expected=near(str(name), known), do="correct it"
                    )
        self._take_declared()

    def _take_declared(self) -> None:
        """Take the ranges that the gains' own type declares, and refuse live gains that cannot be.

        Raises:
            ParameterError: see above.
        """
        quantities = {name_of(path): quantity_at(self.gains, path) for path, _ in leaves(self.gains)}
        ranges = {name: one.ends for name, one in quantities.items() if one is not None and one.rules}
        object.__setattr__(self, "limits", {**ranges, **self.limits})
        for name in self.live:
            low, high = self.limits.get(name, (-math.inf, math.inf))
            what = f"gain {name} of law {self.name!r} may be changed while the law runs"
            if not (math.isfinite(low) and math.isfinite(high)):
                do = "give it a range: Quantity(…, ge=…, le=…, live=True), or one in limits"
                raise ParameterError(f"{what}, and has no limits", expected="a smallest and a largest value", do=do)
            if name not in self.choices:
                do = "leave out live=True, or name it in tunable"
                raise ParameterError(f"{what}, and is a fact of the rig", expected="a choice, see tunable", do=do)

    @property
    def live(self) -> tuple[str, ...]:
        """Gains that may be changed while the law runs, since the gains' type declares them ``Quantity(…, live=True)``;
        one of a nested part by its dotted name, as in `numbers`."""
        declared = ((name_of(path), quantity_at(self.gains, path)) for path, _ in leaves(self.gains))
        return tuple(name for name, one in declared if one is not None and one.live)

    @property
    def choices(self) -> list[str]:
        """Gains that are `tunable`, those of a nested part one by one, as `numbers` names them."""
        tunable = self.tunable or ()
        return [name for name in self.numbers if name.partition(".")[0] in tunable]

    @property
    def numbers(self) -> dict[str, float]:
        """Gain → its value; one of a nested part goes by its dotted name, ``part.gain``."""
        return {name_of(path): value for path, value in leaves(self.gains)}

    def columns(self) -> dict[str, str]:
        """Column → unit of its state, as traces and logs have it: ``law.<field>``, ``law.<part>.<field>``."""
        return columns(self.start(Sample(0.0, 0.0)), "law", self.state_units)

    def _title(self) -> str:
        return f"Law {self.name}"

    def _rows(self) -> list[tuple[str, str]]:
        gains = ", ".join(f"{name} {value:.4g}" for name, value in self.numbers.items())
        rows = [("gains", gains), ("from the rig", ", ".join(self.from_rig)), ("presets", ", ".join(self.presets))]
        return [*rows, ("source", self.source)]

    def start(self, sample: Sample) -> State:
        """The state with which the law begins at this sample."""
        return self.start_kernel(self.gains, sample)

    def step(self, state: State, sample: Sample, reference: Reference, dt: float) -> tuple[State, float]:
        """The next state and the motor's target angle [rad] for one cycle of `dt` [s]."""
        return self.step_kernel(self.gains, state, sample, reference, dt)

    def with_gains(self, **changes: Any) -> "Law":
        """The same law with some gains changed, those of a nested part by their dotted names.

        Raises:
            ParameterError: a name that is not a gain of this law, or a value outside its limits.
        """
        numbers = self.numbers
        known = [*self.gains._fields, *(name for name in numbers if "." in name)]
        for name, value in changes.items():
            if name not in known:
                alike = difflib.get_close_matches(name, known, 1)
                raise ParameterError(
                    f"law {self.name!r} has no gain {name!r}",
                    expected=f"one of {', '.join(known)}",
                    do=f"did you mean {alike[0]}?" if alike else "name one of them",
                )
            if isinstance(value, bool | str | bytes) or not (isinstance(value, tuple) or hasattr(value, "__float__")):
                raise ParameterError(
                    f"gain {name} of law {self.name!r} is {value!r}", expected="a number", do="correct it"
                )
            low, high = self.limits.get(name, (-math.inf, math.inf))
            if not isinstance(value, tuple) and not low <= value <= high:
                raise ParameterError(
                    f"gain {name} of law {self.name!r} is {value:g}",
                    expected=f"a number from {low:g} to {high:g}",
                    do="correct it",
                )
        gains = self.gains._replace(**{name: value for name, value in changes.items() if name in self.gains._fields})
        if any("." in name for name in changes):
            gains = map_leaves(gains, lambda path, value: changes.get(name_of(path), value))
        return replace(
            self, gains=gains, overridden_gains=self.overridden_gains | {name.partition(".")[0] for name in changes}
        )

    def preset(self, name: str) -> "Law":
        """The same law with a named set of gains, which replaces all gains that were chosen before.

        Gains that the preset leaves as the law's own are not chosen by it: a rig may set them.

        Raises:
            ParameterError: a name that is not a preset of this law.
        """
        if name not in self.presets:
            raise ParameterError(
                f"law {self.name!r} has no preset {name!r}",
                expected=near(str(name), self.presets) if self.presets else "none",
                do="name another, or leave the preset out",
            )
        back = {gain: getattr(self.default_gains, gain) for gain in self.overridden_gains}
        named = self.presets[name]._asdict().items()
        changes = {gain: value for gain, value in named if value != getattr(self.default_gains, gain)}
        return replace(self, gains=self.gains._replace(**(back | changes)), overridden_gains=frozenset(changes))

"""How light the virtual elbow may be.

Passive is the port φ̇ → τ if Re Z(jω) ≥ 0 up to the Nyquist frequency (Colgate and Hogan, Int. J. Control 48, 1988,
65–88). Through a spring and with dead time it never is at all of them: with T = q/φ, Z = k_s·(1 − T)/(jω), and Re Z =
−k_s·Im T/ω is below zero wherever the motor lags by more than half a turn. `control.admittance.port.passive_to` says
from where on. What is asked for, then, is stability with every wearer of a range: springs, dampers and inertias, each
on the suit as it is known and on those of `doubtful`, with the virtual inertia, damping and stiffness divided by
`MARGIN`, which is the same as a torque read too large by that factor.
"""

import itertools
from typing import NamedTuple

import numpy as np

from bowden.control.admittance.port import Body, Held, Port, held_loops, sampled_loops
from bowden.control.admittance.virtual_elbow import Admittance
from bowden.core.errors import ParameterError

MARGIN = 2.0
"""Factor on the torque, 6 dB, with which the loop must still be stable [–]."""


def doubtful(port: Port) -> list[Port]:
    """The port as it is known, and as it may be: drive ± 25 % as fast, one cycle later, cables half again as stiff.

    The lead stays what it is: made for the drive as it is known.
    """
    stiffer = [port, *(port._replace(delay=port.delay + 1, **_stiffened(port, share)) for share in (1.0, 1.5))]
    return [stiffer[0]] + [
        p._replace(frequency=p.frequency * speed) for p, speed in itertools.product(stiffer[1:], (0.75, 1.25))
    ]


def _stiffened(port: Port, share: float) -> dict[str, float]:
    return {name: share * getattr(port, name) for name in ("spool_stiffness", "across", "joint_stiffness")}


def worst_pole(loops: list[Held], settings: Admittance, margin: float = MARGIN) -> float:
    """The largest magnitude of a pole, with the torque read too large by `margin` [–]."""
    tried = settings._replace(
        inertia=settings.inertia / margin, damping=settings.damping / margin, stiffness=settings.stiffness / margin
    )
    return max(float(np.max(np.abs(np.linalg.eigvals(sampled_loops(held, tried))))) for held in loops)


_STABLE = 1.0 + 1e-9
"""A virtual elbow without stiffness may stay where it is left: its pole at 1 moves nothing."""


class Limit(NamedTuple):
    """The suit with its wearers, ready to be asked which virtual elbows it can render; `limit_of` makes it."""

    loops: list[Held]

    def holds(self, settings: Admittance) -> bool:
        """True if every loop is stable with `MARGIN`."""
        return worst_pole(self.loops, settings) <= _STABLE

    def least(self, settings: Admittance, name: str) -> float | None:
        """The least ``inertia`` or ``damping`` that holds with the rest as it is, to 2 %; None where none does."""
        values = [float(value) for value in np.geomspace(10.0, 1e-4, 11)]
        best = None
        for value in values:  # from the top, since what holds may have a hole further down
            if not self.holds(settings._replace(**{name: value})):
                break
            best = value
        if best is None or best == values[-1]:
            return best
        low, high = values[values.index(best) + 1], best
        while high > 1.02 * low:
            middle = float(np.sqrt(low * high))
            low, high = (low, middle) if self.holds(settings._replace(**{name: middle})) else (middle, high)
        return high

    def refuse(self, settings: Admittance) -> None:
        """Refuse a virtual elbow that does not hold.

        Raises:
            ParameterError: with the least inertia and damping that would.
        """
        if self.holds(settings):
            return
        inertia, damping = self.least(settings, "inertia"), self.least(settings, "damping")
        ways = [] if inertia is None else [f"an inertia of at least {inertia:.2g} kg·m²"]
        ways += [] if damping is None else [f"a damping of at least {damping:.2g} N·m·s/rad"]
        raise ParameterError(
            f"admittance: with inertia {settings.inertia:g} kg·m², damping {settings.damping:g} N·m·s/rad and "
            f"stiffness {settings.stiffness:g} N·m/rad some wearer's loop swings up "
            f"(pole {worst_pole(self.loops, settings):.3f})",
            expected=" or ".join(ways) or "more inertia and damping, or less stiffness",
            do="make the virtual elbow heavier",
        )

    def clamped(self, settings: Admittance) -> Admittance:
        """The virtual elbow where it holds; otherwise the lightest in proportion that does, in steps of 5 %.

        Raises:
            ParameterError: a stiffness with which none holds.
        """
        factor = 1.0
        while factor < 1e4:
            heavier = settings._replace(inertia=settings.inertia * factor, damping=settings.damping * factor)
            if self.holds(heavier):
                return heavier
            factor *= 1.05
        raise ParameterError(
            f"admittance: no inertia and damping hold with a stiffness of {settings.stiffness:g} N·m/rad",
            expected="less stiffness",
        )


def limit_of(ports: list[Port], wearers: list[Body]) -> Limit:
    """The limit of a suit, known at some angles of the elbow, for a range of wearers."""
    return Limit([held for port in ports for maybe in doubtful(port) for held in held_loops(maybe, wearers)])

"""Two axes on one joint: a cable that pulls it up, one that pulls it down, and how far both pull against each other."""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, NamedTuple

from bowden.core.errors import ParameterError, near
from bowden.core.quantity import Quantity
from bowden.core.toml_text import quoted
from bowden.core.units import RADIANS


class PairSettings(NamedTuple):
    """Two axes on one joint, which they pull either way; both follow the joint's one reference.

    At a joint angle q, whose cable would just be taut with the motor at m, each motor stands at m with
    `co_contraction` more in the direction in which it pulls.
    """

    agonist: Annotated[str, Quantity("name of the axis whose drive has the joint's encoder", example="flexor")] = ""
    antagonist: Annotated[
        str, Quantity("name of the axis that pulls the other way; what its drive says of the joint is not used")
    ] = ""
    co_contraction: Annotated[
        float,
        Quantity(
            "how much further each motor pulls than the joint asks for; below 0 each cable hangs slack by it",
            "rad",
            ge=-20.0,
            le=45.0,
        ),
    ] = 0.0
    stiffness: Annotated[
        float, Quantity("of each cable with what it pulls at, at the joint; of the twin", "N·m/rad", gt=0.0, le=1e4)
    ] = 10.0

    @property
    def there(self) -> bool:
        """Whether there is such a pair."""
        return bool(self.agonist or self.antagonist)

    @property
    def names(self) -> tuple[str, str]:
        """Of both axes, the agonist's first."""
        return self.agonist, self.antagonist


NO_PAIR = PairSettings()
_ROOM = 0.8
"""Of the distance that the supervisor allows between joint and motor [–]."""


def check_pair(pair: PairSettings, axes: Sequence[tuple[str, Any]], independent: bool, where: str) -> None:
    """Refuse a pair that cannot be.

    Raises:
        ParameterError: no axes, or none of that name, or two that do not fit one joint.
    """
    if not pair.there:
        return
    found = dict(axes)
    for name in pair.names:
        if name not in found:
            raise ParameterError(
                f"{where}: [pair] names the axis {quoted(name)}",
                expected=near(name, found) if found else "two [[axis]] in the rig",
                do="correct it there",
            )
    for problem, expected in _problems(pair, found, independent):
        raise ParameterError(f"{where}: [pair]: {problem}", expected=expected, do="correct it there")


def _problems(pair: PairSettings, found: Mapping[str, Any], independent: bool) -> list[tuple[str, str]]:
    one, other = (found[name] for name in pair.names)
    names = " and ".join(quoted(name) for name in pair.names)
    slack = [rig.limits.slack_sign for rig in (one, other)]
    rules = (
        (pair.agonist != pair.antagonist, f"agonist and antagonist are {quoted(pair.agonist)}", "two axes"),
        (not independent, "independent is true", "false: of two cables on one joint none goes on alone"),
        (one.reference == other.reference, f"{names} have references of their own", "one: leave it to the common part"),
        (one.emg == other.emg, f"{names} have [emg] of their own", "one: leave it to the common part"),
        (
            slack[0] == -slack[1],
            f"limits.slack_sign of {names} are {slack[0]:g} and {slack[1]:g}",
            "1 and -1: where one pulls, the other lets out",
        ),
        (
            all(
                abs(pair.co_contraction) * rig.supervisor_limits.slope_high <= _ROOM * rig.supervisor_limits.play
                for rig in (one, other)
            ),
            f"co_contraction_deg is {pair.co_contraction / RADIANS:g}",
            f"{_ROOM:g} of limits.play_deg at most, or the joint would seem astray before the cables are tightened",
        ),
        (
            not (one.suit.worn or other.suit.worn),
            "a suit is worn",
            "axes without [suit], whose one motor has both cables",
        ),
        (
            all(hasattr(rig.drive, "motor_home") for rig in (one, other)),
            "a drive has no motor_home_deg",
            "families that have one, by which the co-contraction is set",
        ),
        (
            one.plant is None and other.plant is None,
            "an axis has a plant of your own",
            "cables, which the twin can put on one joint",
        ),
        (
            not any(rig.plant is None and rig.turned for rig in (one, other)),
            "an axis has a cable whose slope is negative",
            "joint angles that grow with each motor's, as a run needs them: direction = -1 below an identified model "
            "in [cable], if the log counted the motor the other way round than this drive does",
        ),
    )
    return [(problem, expected) for fine, problem, expected in rules if not fine]

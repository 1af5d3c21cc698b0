"""A rig round an identified cable, within what its log covered."""

import tomllib
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from bowden.core.guesses import answering
from bowden.core.units import RADIANS
from bowden.design.rig_of_model import Chosen, counting_of, model_text, with_stroke
from bowden.design.rig_of_suit import suit_text
from bowden.design.verdict import OURS, chosen_law
from bowden.drawing.shown import Shown
from bowden.plants.identified import IdentifiedCable
from bowden.plants.trust import Trust
from bowden.rig.counts import guessed
from bowden.rig.rig import Rig


@answering(
    {"save": "made.rig.write(path)"},
    "make another: bowden.init(fit, …)",
    lambda made, name: f"made.rig.{name}" if hasattr(Rig, name) else "",
)
@dataclass(frozen=True, repr=False)
class NewRig(Shown):
    """A rig round an identified cable."""

    rig: Rig
    """With the cable, and a reference, limits and a law that suit it."""
    why: str
    """Why it has its law, ``rig.law``."""
    known: bool
    """True if the model says what motion its log covered; else the reference is not known to lie within it."""
    text: str = field(compare=False)
    """The commented rig.toml that ``bowden init --model`` writes."""

    @property
    def cable_trust(self) -> Trust | None:
        """Trust in the cable's model; None where nothing says it."""
        return self.rig.cable_trust

    @property
    def notes(self) -> tuple[str, ...]:
        """Reference, law, and how angles are counted, in words; of a suit, whose cables it has."""
        said = [f"{label}: {text}" for label, text in self._chosen()]
        if self.rig.worn is not None:
            return tuple(said)
        if not self.rig.cable.counting.as_recorded:  # type: ignore[union-attr]
            said.append("Angles of the rig differ from those of the log: see direction and zeros in [cable]")
        counts = guessed(self.rig)
        return (*said, f"Taut: {self._taut()}", *([f"Encoders: {counts}"] if counts else []))

    def _chosen(self) -> list[tuple[str, str]]:
        """What was taken for the rig, each with its label."""
        law = "Law", f"{self.rig.law_name}{self._gains()}, {self.why}"
        if self.rig.worn is not None:
            return [("Cables", self.rig.whose_cable), law]
        low, high = (f"{end / RADIANS:g}" for end in (self.rig.reference.low, self.rig.reference.high))  # type: ignore[attr-defined]
        within = "within what the log covered"
        within = within if self.known else "the model does not say what its log covered: check it yourself"
        servo = [("Servo", f"gains are judged for {self.rig.servo_text}")] if self.rig.servo_assumed else []
        return [("Reference", f"{low} to {high}°, {within}"), law, *servo]

    def _taut(self) -> str:
        """Where the cable is taken to be let out, which no log says."""
        cable: IdentifiedCable = self.rig.cable  # type: ignore[assignment]
        counting, covered = cable.counting, cable.covered  # which is counted from that place
        motor, joint = (f"{zero / RADIANS:.3g}°" for zero in (counting.motor_zero, counting.joint_zero))
        beyond = "" if covered is None or covered[0] <= 0.0 <= covered[1] else " (which the log does not reach)"
        return (
            f"the motor is taken to have let the cable out where the log has it at {motor} and the joint at "
            f"{joint}{beyond}: a release goes there; if it pulls there, change the sign of the joint's column, and "
            "identify it again"
        )

    def _gains(self) -> str:
        given = ", ".join(f"{name} = {value:.3g}" for name, value in self.rig.gains.items())
        return f" with {given}" if given else ""

    def _title(self) -> str:
        return f"New rig {self.rig.hash}"

    def _rows(self) -> list[tuple[str, str]]:
        said = [(label.lower(), text) for label, text in self._chosen()]
        if self.rig.worn is not None:
            return said
        counting = self.rig.cable.counting  # type: ignore[union-attr]
        turned = "against the log's direction, " if counting.direction < 0 else ""
        zeros = f"{counting.motor_zero / RADIANS:.1f}° of the log's motor and {counting.joint_zero / RADIANS:.1f}°"
        counted = "" if counting.as_recorded else f"the motor {turned}from {zeros} of its joint"
        return [*said, ("counted", counted or "as in the log")]


def around(
    cable: IdentifiedCable, path: Path, place: str, parts: dict[str, Any] | None = None, *, suit: bool = False
) -> NewRig:
    """A rig round a cable.

    Args:
        cable: as it was identified.
        path: of the rig's file, which is not written here; without an ending, no file.
        place: of the model's file, from the rig's folder.
        parts: of the rig that are not as on the paper's bench.
        suit: whether it is a suit on an arm.

    Raises:
        ParameterError: a model without what zeros and limits follow from, or a part that is none.
    """
    name = path.name if path.suffix else "rig.toml"
    cable = with_stroke(cable)
    counted = replace(cable if suit else cable.counted(counting_of(cable)), file=place)

    def written(chosen: Chosen) -> str:
        return suit_text(name, place, chosen, cable) if suit else model_text(name, place, cable, chosen)

    first = written(Chosen(OURS, ""))
    rig = Rig.of_tree(tomllib.loads(first), path, keep=Rig(cable=counted)).replace(**(parts or {}))
    chosen = chosen_law(rig)
    text = written(chosen)
    rig = rig.with_law(chosen.law).replace(gains=chosen.gains)
    return NewRig(rig, chosen.why, cable.covered is not None, text)

"""An identified cable: a name, its parameters, and what they predict."""

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bowden import __version__
from bowden.core.arguments import format_value, number, path_of
from bowden.core.errors import ParameterError, error_context, near
from bowden.core.files import write_text
from bowden.core.guesses import Answering, answering
from bowden.core.toml_text import quoted
from bowden.models.cable import scheduled as scheduling
from bowden.models.cable.bouc_wen import BoucWen
from bowden.plants.cable_parameters import check_parameters, meaning
from bowden.plants.counting import MODEL_FILE, NOT_SAID, Counting, Covered, Encoders
from bowden.plants.model_file import log_lines, read_models
from bowden.plants.predicted import DISTRIBUTED, SCHEDULED, cable_of, joint_along, scheduled_of, whole_slope
from bowden.plants.recounted import recounted
from bowden.plants.trust import Trust, trust_lines

Array = NDArray[np.float64]


@answering(
    {
        **dict.fromkeys(("predict", "simulate", "joint"), "model.joint_angle(motor)"),
        **dict.fromkeys(("save", "to_file", "to_toml"), "model.write(path)"),
        **dict.fromkeys(("load", "open", "from_file"), "CableModel.read(path)"),
        "params": "model.parameters",
    },
    "make another: CableModel(name, parameters)",
    lambda model, name: f"model.parameters[{name!r}]" if name in model.__dict__["parameters"] else "",
)
@dataclass(frozen=True)
class CableModel(metaclass=Answering):
    """One model of a cable.

    >>> model = CableModel("line", {"slope": -0.9, "offset": 0.5})
    >>> model.joint_angle(np.array([0.0, 1.0])).round(3)
    array([ 0.5, -0.4])
    """

    name: str
    """One of `KNOWN`."""
    parameters: Mapping[str, float]
    """By name; SI and radians."""
    others: Mapping[str, Mapping[str, float]] = field(default_factory=dict, compare=False, repr=False)
    """The parameters of other models of the same log, by their names: laws get from a rig what ``bouc_wen`` says."""
    covered: Covered | None = field(default=None, compare=False, repr=False)
    """The motion that the log covered; None where nothing says it."""
    trust: Trust | None = field(default=None, compare=False, repr=False)
    """Trust in it, with reasons; None where it is unknown."""
    encoders: Encoders = field(default=NOT_SAID, compare=False, repr=False)
    """One count of each encoder of the log, where it was said."""

    @classmethod
    def read(cls, path: Path | str) -> "CableModel":
        """The recommended model of a model.toml, with the others that laws need.

        Raises:
            ParameterError: no such file, or none that `write`, a fit or ``bowden identify`` has written.
        """
        found = load_cable(path_of(path, "CableModel.read: path"))
        others = {name: one for name, one in found.models.items() if name != found.best}
        return cls(found.best, found.models[found.best], others, found.covered, found.trust, found.encoders)

    def write(self, path: Path | str) -> None:
        """Write the model as a model.toml, which `read`, a rig.toml and ``bowden init --model`` take.

        A fit writes more, ``fit.write``: uncertainties, errors and warnings.

        Raises:
            OutputError: the file cannot be written.
        """
        write_text(path_of(path, "CableModel.write: path"), cable_text(self.identified()))

    def identified(self) -> "IdentifiedCable":
        """All that is known of its cable: itself, as the recommended model, and the others of its log."""
        models = {self.name: dict(self.parameters)} | {name: dict(one) for name, one in self.others.items()}
        return IdentifiedCable(self.name, models, covered=self.covered, trust=self.trust, encoders=self.encoders)

    def joint_angle(self, motor: Array) -> Array:
        """Joint angle along a recorded motion of the motor, simulated straight through: (n,) [rad] → (n,) [rad].

        The motion begins where the log did: `initial_h` and `initial_lag` are the state at its first sample.

        Raises:
            ParameterError: an unknown model, or a parameter that is missing.
        """
        if self.name not in DISTRIBUTED:
            return joint_along(self.name, self.parameters, motor)
        from bowden.plants.cables import moved

        return moved(self.name, self.parameters, motor)

    def to_bouc_wen(self) -> BoucWen:
        """The cable for simulation and control.

        A cable that runs backwards keeps its signs: slope below zero and hysteresis gain above it.

        Raises:
            ParameterError: another model than ``bouc_wen``, or a parameter that is missing.
        """
        if self.name != "bouc_wen":
            raise ParameterError(f"a {self.name!r} model is no plain Bouc–Wen cable", do="take the model 'bouc_wen'")
        try:
            return cable_of(self.parameters)
        except KeyError as error:
            raise ParameterError(f"cable model 'bouc_wen' has no parameter {error.args[0]!r}") from None


@dataclass(frozen=True)
class IdentifiedCable:
    """All that an identification says of a cable: the model to use, and the others."""

    best: str
    """Name of the recommended model."""
    models: Mapping[str, Mapping[str, float]]
    """Name → parameters; SI and radians."""
    file: str = field(default="", compare=False)
    """Where it was read from, as a rig.toml names it."""
    changed: Mapping[str, float] = field(default_factory=dict, compare=False)
    """Parameters of the simulated model that differ from the file's; `models` has them already."""
    units: Mapping[str, str] = field(default_factory=dict, compare=False)
    """Of what schedules the recommended model, by name; what nothing says of is not in it."""
    counting: Counting = field(default=Counting(), compare=False)
    """How the parameters' angles are counted, against the log's; `models` has them so already."""
    covered: Covered | None = field(default=None, compare=False)
    """The motion that the log covered, counted likewise; None where the file does not say it."""
    trust: Trust | None = field(default=None, compare=False)
    """Trust in the recommended model, with reasons; None where the file has none."""
    encoders: Encoders = field(default=NOT_SAID, compare=False)
    """One count of each encoder of the log, where the file says it."""
    judged: float = field(default=math.nan, compare=False)
    """Error of the recommended model on data that it had not seen; NaN where nothing says it [rad]."""
    digest: str = field(default="", compare=False)
    """A short name of the models as their file has them, by which a rig knows the one that it was made from."""

    def __post_init__(self) -> None:
        """Name the models, before a rig counts or changes them."""
        if not self.digest:
            models = {name: {key: float(value) for key, value in one.items()} for name, one in self.models.items()}
            text = json.dumps([self.best, models], sort_keys=True)
            object.__setattr__(self, "digest", hashlib.sha256(text.encode()).hexdigest()[:16])

    @property
    def simulated(self) -> str:
        """Name of the model that a simulation runs: the recommended one; of a straight line, the plain Bouc–Wen one."""
        return "bouc_wen" if self.best == "line" else self.best

    @property
    def parameters(self) -> dict[str, float]:
        """Parameters of that model that may be changed: all that its motion depends on, also those not in its file."""
        given = {name: value for name, value in self.model(self.simulated).parameters.items() if name not in _BEGUN}
        if self.simulated not in DISTRIBUTED:
            return given
        from bowden.plants.cables import distributed_parameters

        return distributed_parameters(self.simulated) | given

    @cached_property
    def lost(self) -> float:
        """Half of the motor's travel that a reversal loses: half the loop's height over its slope, in mid-stroke [rad].

        Of a play it is its half width. The loop is the recommended model's over the motion that its log covered; where
        nothing says that, over a turn of the motor.
        """
        low, high = (-np.pi, np.pi) if self.covered is None else self.covered[:2]
        up = np.linspace(low, high, _PLACES)
        joint = self.model(self.simulated).joint_angle(np.concatenate([up, up[::-1], up]))
        down, again = joint[_PLACES : 2 * _PLACES][::-1], joint[2 * _PLACES :]
        middle = slice(_PLACES // 4, -(_PLACES // 4))
        slope = np.polyfit(up[middle], (down + again)[middle], 1)[0]  # of both ways together
        return float(abs(np.mean((down - again)[middle]) / slope))

    def with_parameters(self, given: Mapping[str, float]) -> "IdentifiedCable":
        """The same cable with these parameters of the simulated model; other models, which laws take, stay.

        Args:
            given: by name; SI and radians.

        Raises:
            ParameterError: no such parameter, or one that the model cannot have.
        """
        from bowden.plants.cables import identified  # with all plants, which an identification need not load

        own = self.parameters
        for name in given:
            if name not in own:
                raise ParameterError(
                    f"the model {self.simulated!r} has no parameter {name!r}", expected=near(name, own)
                )
        numbers = {name: number(value, f"{name} of the model {self.simulated!r}") for name, value in given.items()}
        differing = {name: value for name, value in numbers.items() if value != own[name]}
        if not differing:
            return self
        if "slope" in own:
            before, after = whole_slope(own), whole_slope({**own, **differing})
            if before * after <= 0.0:
                raise ParameterError(
                    f"the slope of the model {self.simulated!r}, of all its parts, would be {after:g}",
                    expected=f"a number {'above' if before > 0.0 else 'below'} 0, as its file has it ({before:g})",
                )
        changed = {**self.models[self.simulated], **differing}
        check_parameters(self.simulated, changed, "cable.parameters")
        identified(self.simulated, changed)
        models = {**self.models, self.simulated: changed}
        return replace(self, models=models, changed={**self.changed, **differing})

    def counted(self, counting: Counting) -> "IdentifiedCable":
        """The same cable, all its models, as a rig counts its angles.

        Raises:
            ParameterError: a model whose angles are no log's, or a cable that is not counted as it was recorded.
        """
        if counting == self.counting:
            return self
        if not self.counting.as_recorded:
            raise ParameterError(
                f"{self.file or 'the identified cable'} already counts its angles in another way than its log",
                expected="the cable as it was identified",
                do="take the first one",
            )
        models = {name: recounted(name, parameters, counting) for name, parameters in self.models.items()}
        covered = None if self.covered is None else self.covered.counted(counting)
        return replace(self, models=models, counting=counting, covered=covered)

    def model(self, name: str | None = None) -> CableModel:
        """A model by its name; the recommended one where it is not given.

        Raises:
            ParameterError: the identification has no such model.
        """
        wanted = name or self.best
        if wanted not in self.models:
            given = f"{self.file or 'the identified cable'} has no model {wanted!r}"
            raise ParameterError(given, expected=f"one of {', '.join(self.models)}")
        return CableModel(wanted, self.models[wanted])

    @property
    def bouc_wen(self) -> BoucWen:
        """The cable as the plain Bouc–Wen model has it, which every identification fits.

        Of a distributed cable that comes without one it is the model with that cable's slope and dead zone; of a
        scheduled one, that with the slope and the dead zone at its load and bend.

        Raises:
            ParameterError: it has none, or one with a slope of zero.
        """
        if self.best in DISTRIBUTED and "bouc_wen" not in self.models:
            return _like(tuple(sorted(self.model().parameters.items())))
        if self.best == SCHEDULED:
            return scheduling.bouc_wen_at(*scheduled_of(self.model().parameters), self.model("bouc_wen").to_bouc_wen())
        cable = self.model("bouc_wen").to_bouc_wen()
        if cable.slope == 0.0:
            raise ParameterError(
                f"{self.file or 'the identified cable'}: the slope of bouc_wen is 0",
                do="identify a log in which the joint moves",
            )
        return cable


def held(given: Any) -> IdentifiedCable:
    """The form in which a rig holds what an identification gives.

    Raises:
        ParameterError: it is nothing like that, or has no model with which a rig can run.
    """
    given = given.best if isinstance(getattr(given, "best", None), CableModel) else given
    given = given.identified() if isinstance(given, CableModel) else given
    if not isinstance(given, IdentifiedCable):
        raise ParameterError(
            f"Rig: cable is {format_value(given)}",
            expected="a BoucWen(slope=…), or what bowden.identify gives",
            do="of a file: Rig.read",
        )
    _ = given.bouc_wen
    return given


_PLACES = 400
"""Along a stroke, at which a loop's height is looked at."""
_BEGUN = ("initial_h", "initial_lag")
"""Parameters that say where a log began; a simulation begins at rest."""


@lru_cache(16)
def _like(parameters: tuple[tuple[str, float], ...]) -> BoucWen:
    """Of a distributed cable; moved slowly, one with mass is as the same tendon without."""
    from bowden.models.cable.capstan import Tendon
    from bowden.plants.cables import bouc_wen_like, identified

    return bouc_wen_like(identified("sliding", {k: value for k, value in parameters if k in Tendon._fields}))


def load_cable(path: Path | str, name: str = "") -> IdentifiedCable:
    """Read all models of model.toml.

    Args:
        path: of the file.
        name: of the file, as the cable shall have it; the path where it is not given.

    Raises:
        ParameterError: no such file, not written by `write_model`, an unknown model, or an absurd parameter.
    """
    return IdentifiedCable(file=name or str(Path(path)), **read_models(Path(path)))


def named(
    model: str,
    digest: str | None,
    counting: Counting,
    parameters: Mapping[str, float],
    rig: Path,
    before: Any = None,
) -> IdentifiedCable:
    """The cable that [cable] of a rig.toml names.

    Args:
        model: the file, found from that of the rig.
        digest: of its models; None where the rig does not say it.
        counting: how the rig counts its angles.
        parameters: of the simulated model, that differ from the file's.
        rig: path of the rig.toml.
        before: what serves, without reading, where it is of that file.

    Raises:
        ParameterError: a file that cannot be used, of other models than the rig was made from, or other parameters.
    """
    same = isinstance(before, IdentifiedCable) and (before.file or MODEL_FILE) == model
    same = same and before.counting == counting and digest in (None, before.digest)
    if same and before.changed.keys() <= parameters.keys():
        found: IdentifiedCable = before
    else:
        with error_context(f"{rig}: cable.model"):
            found = load_cable(rig.parent / model, model).counted(counting)
        if digest not in (None, found.digest):
            raise ParameterError(
                f"{rig}: {model} is not the model that this rig was made from, it has been written again",
                expected=f"the model {digest}, not {found.digest}",
                do=f"make a new rig: bowden init NEW.toml --model {rig.parent / model}; or, if reference, "
                f'limits and law suit the new model too, write model_hash = "{found.digest}"',
            )
    with error_context(f"{rig}: cable.parameters"):
        return found.with_parameters(parameters)


def cable_text(cable: IdentifiedCable) -> str:
    """A model.toml that `load_cable` reads back; what an identification says beside the models is not in it."""
    lines = [f"# An identified cable, written by bowden {__version__}.", f"best = {quoted(cable.best)}"]
    lines += trust_lines(cable.trust)
    lines += log_lines(cable.covered, cable.encoders)
    for name, parameters in cable.models.items():
        lines += ["", f"[models.{name}.parameters]"]
        lines += [f"{key} = {float(value)!r}  # [{meaning(key)[0]}]" for key, value in parameters.items()]
    return "\n".join(lines) + "\n"

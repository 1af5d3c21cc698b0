"""A rig: one frozen value with everything that a run needs."""

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np

from bowden.control import LAWS, Law, law_file
from bowden.control.knowledge import Knowledge, configured, preset_of, with_cable
from bowden.control.law_file import LawFile
from bowden.control.recorded_motion import held
from bowden.control.reference import PeriodicMinimumJerk, Recorded, Trajectory
from bowden.core import arguments
from bowden.core.errors import OutputError, ParameterError, error_context, near
from bowden.core.files import whole_file
from bowden.core.guesses import Answering, answering
from bowden.core.part import signed
from bowden.core.quantity import Quantity, declared
from bowden.core.toml_text import quoted
from bowden.core.units import DEGREES, HERTZ, RADIANS
from bowden.cycle.one_cycle import Filters
from bowden.drawing.shown import axes_for, fragment, screen
from bowden.drawing.style import new_figure
from bowden.models.cable.bouc_wen import BoucWen, upright
from bowden.models.cable.sheath import Sheath
from bowden.models.cable.sheath_path import BendPath
from bowden.models.drive.encoder import Encoder
from bowden.models.drive.holding_brake import HoldingBrake
from bowden.models.drive.motor import Motor
from bowden.models.drive.servo import Servo
from bowden.models.suit.geometry import ELBOW_RANGE, SuitGeometry, flexor_moment_arm
from bowden.plants import plant_file
from bowden.plants.bench import Bench
from bowden.plants.bends import Bend, ConstantBend, RandomBend, ScriptedBend
from bowden.plants.cable_parameters import outside
from bowden.plants.cable_plant import CablePlant
from bowden.plants.cables import plant_of_model
from bowden.plants.counting import NOT_SAID, Encoders
from bowden.plants.identified import CableModel, IdentifiedCable, load_cable
from bowden.plants.knowledge_of import knowledge_of
from bowden.plants.plant import Plant
from bowden.plants.plant_file import PlantFile
from bowden.plants.predicted import SCHEDULED
from bowden.plants.push_settings import AdmittanceSettings
from bowden.plants.pushing import Pushing, pushing_of
from bowden.plants.suit_parts import Suit
from bowden.plants.suit_settings import SuitSettings, WearerSettings
from bowden.plants.trust import Trust, least
from bowden.plants.user_plant import UserPlant
from bowden.plants.worn_suit import USUAL_DEAD_ZONE, elbow_dead_zone, suit_of
from bowden.rig import display, emg_setup, packing
from bowden.rig import drive as live_parts
from bowden.rig import motors as several
from bowden.rig.checked import Gains, checked, checked_number, shown
from bowden.rig.consistent import Basis
from bowden.rig.declaration import at, items_of
from bowden.rig.declaration import tree_of as section_tree
from bowden.rig.effect import refuse_idle
from bowden.rig.emg_setup import EmgRun
from bowden.rig.families import DriveNeeds, family_of, resolved
from bowden.rig.joints import JointSettings, RigJoint, check_joints, joints_of
from bowden.rig.load_cell import LoadCellParameters, moved_cell
from bowden.rig.sections import (
    DEFAULT_CABLE,
    DEFAULT_FAMILY,
    DEFAULT_WIDTH,
    PARTS,
    REFERENCES,
    WIDTH,
    Clock,
    Control,
    Scenario,
    drive_part,
)
from bowden.rig.settings import EmgSettings, LiveSettings
from bowden.rig.tree import Files, files_of, read_values, tree_of, values_of, written
from bowden.safety.limits import Limits
from bowden.sensing import wearer_file

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOST_CYCLES = 10_000_000
"""A longer run is refused: its record would not fit into the memory of a common computer."""


class IdentifiedModel(Protocol):
    """What an identification gives."""

    @property
    def best(self) -> CableModel:
        """The recommended model."""
        ...


CableLike = BoucWen | IdentifiedCable | CableModel | IdentifiedModel
GivenPlant = str | UserPlant | PlantFile | None
GivenLaw = str | Law | LawFile


class RigMotor(NamedTuple):
    """One motor of a rig."""

    name: str
    rig: "Rig"
    """All of it: what is common, with what is its own."""
    joint: str = ""
    """Name of the joint that its cable pulls, where others pull it too."""


_LINE = "line"

_CLOCK, _SCENARIO, _CONTROL = Clock(), Scenario(), Control()


@answering(
    {
        **dict.fromkeys(("load", "open", "from_file", "from_toml", "read_toml"), "Rig.read(path)"),
        **dict.fromkeys(("save", "to_file", "dump"), "rig.write(path)"),
        **dict.fromkeys(("copy", "update", "set", "with_"), "rig.replace(name=value)"),
        **{name: f"bowden.{name}(rig)" for name in ("simulate", "run", "check", "tune")},
        "to_dict": "rig.tree()",
        "path": "rig.origin",
        "model": "rig.cable",
        "dt": "rig.sample_time",
    },
    "rig.replace({name}={value})",
)
@signed
@dataclass(frozen=True, kw_only=True, repr=False)
class Rig(metaclass=Answering):
    """Everything that a run needs; the default is the bench of the paper. All numbers are in SI and radians.

    Files that it names (a cable's model, a recorded motion, a wearer, a law) are read when the rig is made and are part
    of it: what is checked is what runs. A part may also be given by those of its fields that differ from the default,
    ``suit={"worn": True}``.

    >>> rig = Rig(servo=Servo(natural_frequency=20.0, damping=0.8, speed_limit=10.0), law="bowden")
    >>> rig.bench.servo.damping
    0.8
    >>> rig.replace(delay=3).bench.delay
    3

    Raises:
        ParameterError: a value of the wrong type or out of its range, with its name and what was expected.
    """

    cable: CableLike = DEFAULT_CABLE
    """Its parameters by hand, or what an identification says of it."""
    plant: GivenPlant = None
    """A plant of one's own in place of the cable: ``FILE.py:NAME`` or a `UserPlant`. What it says itself of servo,
    motor, encoders, sheath, sample time and delay is the rig's."""
    width: float = DEFAULT_WIDTH
    """Factor on the play of a cable by hand, which laws do not know; an identified one has 1 [–]."""
    sheath: Sheath = PARTS["sheath"].default
    servo: Servo = PARTS["servo"].default
    motor: Motor = PARTS["motor"].default
    joint_encoder: Encoder = PARTS["joint_encoder"].default
    motor_encoder: Encoder = PARTS["motor_encoder"].default
    sample_time: float = _CLOCK.sample_time
    """Ts, one control cycle [s]."""
    delay: int = _CLOCK.delay
    """Cycles between a sample and the moment its command reaches the servo [–]."""
    substeps: int = _CLOCK.substeps
    """Plant sub-steps in a cycle in which the servo meets a limit [–]."""
    suit: SuitSettings = PARTS["suit"].default
    """Where it is worn, it takes the place of the bench."""
    wearer: WearerSettings = PARTS["wearer"].default
    admittance: AdmittanceSettings = PARTS["admittance"].default
    law: GivenLaw = _CONTROL.law
    """A name, ``FILE.py:NAME`` of a user's own, or a `Law`."""
    preset: str | None = _CONTROL.preset
    """A named set of gains of that law."""
    gains: Mapping[str, float] = Gains()
    """Gains of that law that differ from its own."""
    reference: Trajectory = REFERENCES["periodic_minimum_jerk"].default
    """Where the joint should be, unless EMG or the wearer's push moves it."""
    bend: Bend = ConstantBend()  # noqa: RUF009
    """How the sheath is bent during the run."""
    duration: float = _SCENARIO.duration
    """Of a run [s]."""
    seed: int = _SCENARIO.seed
    """Of the encoders' noise and of a random bend."""
    initial_motor: float | None = _SCENARIO.initial_motor
    """Motor angle before the start; None: the joint is where the reference starts [rad]."""
    drive: Any = None
    """Parameters of a family of drives; None for the default ones. What only the rig itself says of it;
    `drive_parameters` is the whole."""
    load_cell: LoadCellParameters = PARTS["load_cell"].default
    """A load cell on a CAN bus; one at the drive's own input is in `drive`."""
    brake: HoldingBrake = PARTS["brake"].default
    """A holding brake of a suit's drive; none where it has no torque."""
    limits: Limits = PARTS["limits"].default
    """What only the rig itself says of them, NaN where it says nothing; `supervisor_limits` is the whole. By those that
    differ, ``limits={"play": 0.5}``, the others follow; ``Limits(play=0.5)`` writes those of the paper's bench."""
    live: LiveSettings = PARTS["live"].default
    emg: EmgSettings = PARTS["emg"].default
    motors: tuple[RigMotor, ...] = ()
    """Two to four motors in one loop, each a name and a whole rig, with the name of its joint where it shares that;
    empty of a rig with one motor. What the rig itself says is then what is common."""
    independent: bool = False
    """True if a motor that is stopped by a fault leaves the others running."""
    joints: tuple[JointSettings, ...] = ()
    """Those that several motors move."""
    origin: str = field(default="Rig", compare=False)
    """The file that it was read from, for messages."""
    remarks: tuple[str, ...] = field(default=(), compare=False)
    """What the user should know about how the file was understood."""
    original_hash: str = field(default="", init=False, compare=False)
    """Hash of the rig of which this one is only another form, `offline`."""

    def __new__(cls, *given: Any, **named: Any) -> "Rig":
        """Refuse an unknown field, and name the likely one."""
        if given:
            raise ParameterError(
                f"Rig: {shown(given[0])} has no name", expected="every part by its name", do="Rig(cable=…, servo=…)"
            )
        for name in named:
            _check_name(name)
        return super().__new__(cls)

    def __post_init__(self) -> None:
        arguments.text(self.origin, "Rig: origin", "the name of a file")
        if not isinstance(self.remarks, tuple) or not all(isinstance(one, str) for one in self.remarks):
            raise ParameterError(
                f"Rig: remarks is {shown(self.remarks)}", expected="a tuple of texts", do="leave it out"
            )
        self._check_motors()
        self._check_clock()
        for kind in (Clock, Scenario):
            for one in declared(kind):
                value = checked_number(getattr(self, one.name), one.kind, one.quantity, one.name)
                object.__setattr__(self, one.name, value)
        drive = drive_part(getattr(self.drive, "family", DEFAULT_FAMILY))
        if self.drive is None:
            object.__setattr__(self, "drive", drive.default)
        for name, part in {**PARTS, "drive": drive}.items():
            object.__setattr__(self, name, checked(getattr(self, name), part.kind, name, part.default))
        for name, value in self._made().items():
            object.__setattr__(self, name, value)
        if self.plant is not None:
            self._take_from_plant()
        self._check_whole()

    def _check_motors(self) -> None:
        """Refuse motors that cannot be in one loop."""
        fine = isinstance(self.motors, tuple | list) and all(
            isinstance(one, tuple)
            and len(one) in (2, 3)
            and isinstance(one[1], Rig)
            and all(isinstance(text, str) for text in (one[0], *one[2:]))
            for one in self.motors
        )
        if not fine or not isinstance(self.independent, bool) or not isinstance(self.joints, tuple | list):
            raise ParameterError(
                f"Rig: motors is {shown(self.motors)}, independent {shown(self.independent)}, joints "
                f"{shown(self.joints)}",
                expected="a name and a rig for each motor, with the name of its joint where others move that too; True "
                "or False; and joints",
                do='make them: motors=(("hip", rig), ("knee", rig.replace(…)))',
            )
        object.__setattr__(self, "motors", tuple(RigMotor(*one) for one in self.motors))
        default = JointSettings()
        joints = tuple(checked(one, JointSettings, "joint", default) for one in self.joints)
        object.__setattr__(self, "joints", joints)
        if self.motors:
            several.check(self.motors, self.joints, self.origin)
        if self.motors or self.joints:
            check_joints(self.each_joint, self.independent, self.origin)

    def _check_clock(self) -> None:
        """What the length of a run depends on, with the messages that the command line knows."""
        numbers = [isinstance(one, int | float) and not isinstance(one, bool) for one in (self.duration, self.seed)]
        if numbers[1] and not 0 <= self.seed < 2**63:
            raise ParameterError(
                f"the seed is {self.seed}", expected="a whole number from 0 to 2⁶³ − 1", do="give another seed"
            )
        step = self.sample_time
        if numbers[0] and isinstance(step, int | float) and step > 0.0:
            cycles = self.duration / step
            if not (self.duration > 0.0 and 2.0 <= cycles <= MOST_CYCLES):
                raise ParameterError(
                    f"a run of {self.duration:g} s has {max(cycles, 0.0):g} cycles",
                    expected=f"a duration that makes 2 to {MOST_CYCLES} of them",
                    do="change the duration, scenario.duration_s of a rig.toml",
                )

    def _take_from_plant(self) -> None:
        """Let the rig's parts be what its plant says of itself."""
        fields = type(self).__dataclass_fields__
        if self.cable != fields["cable"].default or self.width != fields["width"].default or self.suit.worn:
            other = "a suit" if self.suit.worn else "a cable"
            raise ParameterError(
                f"{self.origin}: the rig has both a plant of its own and {other}",
                expected="one of them",
                do="leave one out",
            )
        default = {name: fields[name].default for name in plant_file.PARTS}
        with error_context(f"{self.origin}: the plant"):
            own = {name: getattr(self, name) for name in plant_file.PARTS}
            taken = plant_file.agreed(self.own_plant, own, default)
        for name, value in taken.items():
            object.__setattr__(self, name, value)

    def _made(self) -> dict[str, Any]:
        """The fields that may be given in several forms, in the one in which a rig holds them."""
        cable = _cable(self.cable)
        width = checked_number(self.width, float, WIDTH, "width")
        return {
            "cable": cable,
            "plant": plant_file.held(self.plant),
            "width": width if isinstance(cable, BoucWen) else 1.0,
            "reference": _reference(self.reference),
            "bend": _bend(self.bend),
            "law": _law(self.law),
            "gains": _gains(self.gains),
            "preset": checked_number(self.preset, str | None, Quantity("a named set of gains"), "preset"),
        }

    def _check_whole(self) -> None:
        """Refuse parts that do not fit one another."""
        if self.preset is not None:
            self.loaded_law.preset(self.preset)
        if self.gains:
            with error_context(f"{self.origin}: control.gains" if Path(self.origin).suffix else "Rig: gains"):
                self._check_gains()
        if self.emg.source is not None:
            _ = self.emg_run
        with error_context(f"{self.origin}: [suit] or [wearer]"):
            _ = self.worn
        with error_context(f"{self.origin}: [admittance]"):
            _ = self.pushing
        if not self.motors:
            refuse_idle(self)
        if not self.motors and self.brake.there:
            with error_context(f"{self.origin}: [brake]"):
                live_parts.check_brake(self.brake, self.drive, self.supervisor_limits, self.worn)

    def _check_gains(self) -> None:
        """Refuse gains that the rig's law does not have, and say whose they are: --law does not change that.

        Raises:
            ParameterError: there are such.
        """
        own = self.loaded_law
        try:
            own.with_gains(**self.gains)
        except ParameterError as error:
            others = [name for name in LAWS if name != own.name and set(self.gains) <= set(LAWS[name].numbers)]
            if set(self.gains) <= set(own.numbers) or not others:
                raise
            named = ", ".join(others)
            raise ParameterError(
                error.what,
                expected=f"gains of {own.name}, the law of the rig; these are gains of {named}",
                do="delete [control.gains], or name one of these laws in [control]"
                if Path(self.origin).suffix
                else "leave gains= out, or give one of these laws",
            ) from None

    @classmethod
    def read(cls, path: Path | str) -> "Rig":
        """The rig that a rig.toml describes; what the file leaves out is as on the paper's bench.

        What the file names (model, motion, wearer, law) is read too, and found from its folder.

        Raises:
            ParameterError: no such file, not TOML, an unknown key, a value of the wrong kind or out of its range.
            LogError: a recorded motion that cannot be used.
        """
        return cls._of_values(read_values(arguments.path_of(path, "Rig.read: path")))

    @classmethod
    def _of_values(cls, values: dict[str, Any]) -> "Rig":
        motors = []
        for name, own, joint in values.get("motors", ()):
            with error_context(f"motor {quoted(name)}"):
                motors.append(RigMotor(name, cls(**own), joint))
        return cls(**{**values, "motors": tuple(motors)})

    @classmethod
    def of_tree(cls, tree: Mapping[str, Any], origin: Path, keep: "Rig | None" = None) -> "Rig":
        """The rig from the sections of a rig.toml.

        Args:
            tree: section → key → value, in the file's units.
            origin: for messages, and to find the files that it names.
            keep: a rig whose contents of files serve where the tree names the same files.

        Raises:
            ParameterError: see `read`.
            LogError: likewise.
        """
        if not isinstance(tree, Mapping):
            raise ParameterError(
                f"Rig.of_tree: tree is {shown(tree)}", expected="the sections of a rig.toml", do="tomllib.loads(text)"
            )
        place = arguments.path_of(origin, "Rig.of_tree: origin")
        if keep is not None and not isinstance(keep, Rig):
            raise ParameterError(f"Rig.of_tree: keep is {shown(keep)}", expected="a Rig", do="leave it out")
        return cls._of_values(values_of(tree, place, None if keep is None else keep.fields))

    def tree(self) -> dict[str, Any]:
        """The rig as the sections of a rig.toml.

        Raises:
            ParameterError: a reference, law or value that a file has no words for.
        """
        if self.motors:
            return self._shared([several.MotorTree(name, rig.tree(), joint) for name, rig, joint in self.motors])
        return tree_of(self.fields)

    def _shared(self, trees: Sequence[several.MotorTree]) -> dict[str, Any]:
        """The sections of a rig with several motors."""
        joints = {several.JOINT: [section_tree(one) for one in self.joints]} if self.joints else {}
        return ({several.INDEPENDENT: True} if self.independent else {}) | several.shared(trees) | joints

    def to_toml(self) -> str:
        """The rig as the text of a rig.toml, which `read` reads back to the same hash.

        The files that it was made of are named, not written.

        Raises:
            ParameterError: see `tree`.
        """
        return written(self.tree())

    def write(self, path: Path | str, *, force: bool = False) -> None:
        """Write the rig as a rig.toml, and next to it the files that it needs: model, motion, law and wearer.

        A model.toml that is there already stays, where it has the same models: a fit's own says more of them.

        Args:
            path: of the rig.toml.
            force: overwrite files that are there with other content.

        Raises:
            ParameterError: see `tree`.
            OutputError: a file cannot be written, or another one of its name is there.
        """
        target = arguments.path_of(path, "Rig.write: path")
        if target.is_dir():
            raise OutputError(f"{target} is a folder", do=f"give the file's name: {target / 'rig.toml'}")
        tree, files = self._tree_and_files()
        contents = {target: written(tree).encode()} | {target.parent / name: text for name, text in files.items()}
        contents = {file: content for file, content in contents.items() if not self._has_model(file)}
        for file, content in contents.items():
            if file.exists() and file.read_bytes() != content and not force:
                raise OutputError(
                    f"{file} is there already, with other content",
                    do="choose another folder, or overwrite it: write(path, force=True)",
                )
        for file, content in contents.items():
            if file.parent != target.parent:  # of a package that a user's file imports
                file.parent.mkdir(parents=True, exist_ok=True)
            with whole_file(file) as part:
                part.write_bytes(content)

    def _has_model(self, file: Path) -> bool:
        """True if a file has the very models of one of the rig's cables, and the trust in them."""
        cables = [one.rig.cable for one in self.parts if isinstance(one.rig.cable, IdentifiedCable)]
        if not (cables and file.suffix == ".toml" and file.exists()):
            return False
        try:
            there = load_cable(file)
        except ParameterError:  # no model at all
            return False
        return any((there.digest, there.trust) == (one.digest, one.trust) for one in cables)

    def _tree_and_files(self) -> tuple[dict[str, Any], dict[str, bytes]]:
        """The sections with the names of the files that lie beside, and what is in these."""
        if not self.motors:
            return files_of(self.fields)
        trees, files = list[several.MotorTree](), Files()
        for name, rig, joint in self.motors:
            tree, own = files_of(rig.fields)
            trees.append(several.MotorTree(name, tree, joint))
            for file, content in own.items():
                files.add(file, content)
        return self._shared(trees), files.contents

    def replace(self, **changes: Any) -> "Rig":
        """The same rig with other values of some fields; of one with motors, in each of them.

        With another plant of one's own goes what the old one said of servo, encoders and so on; with another law go
        gains and preset of the old one. A reference stays where another cable comes: `bowden.init` makes both fit.

        Raises:
            ParameterError: a field that there is not, or a value that it cannot have.
        """
        for name in changes:
            _check_name(name)
        if not self.motors and "law" in changes and changes["law"] not in (self.law, self.law_name):
            changes = {"gains": Gains(), "preset": None} | changes
        if self.plant is not None and "plant" in changes and changes["plant"] != self.plant:
            fields = type(self).__dataclass_fields__
            back = {name: fields[name].default for name in plant_file.said_by(self.own_plant)}
            changes = back | changes
        own = {name: value for name, value in changes.items() if name not in _OF_THE_WHOLE}
        if self.motors and own and "motors" not in changes:
            return self._with_motors(lambda rig: rig.replace(**own), **changes)
        return dataclasses.replace(self, **changes)

    def _with_motors(self, made: Callable[["Rig"], "Rig"], **changes: Any) -> "Rig":
        """The same rig with each motor as it is `made` of what it was, and with further changes of what is common."""
        motors = tuple(one._replace(rig=made(one.rig)) for one in self.motors)
        return dataclasses.replace(self, **{**changes, "motors": motors})

    @property
    def parts(self) -> "tuple[RigMotor, ...]":
        """The motors; of a rig with one motor itself, without a name."""
        return self.motors or (RigMotor("", self),)

    @cached_property
    def each_joint(self) -> tuple[RigJoint, ...]:
        """Its joints, each with its motors; of a rig with one motor one."""
        return joints_of(self.parts, self.joints, self.origin)

    @property
    def cable_trust(self) -> Trust | None:
        """Trust in the models of its identified cables, of several the lowest; None where nothing says it."""
        known = [one for motor in self.parts if (one := getattr(motor.rig.cable, "trust", None)) is not None]
        return least(known) if known else None

    def only(self, name: str | None = None) -> "Rig":
        """The rig of one motor; of a rig with one motor itself, where no name is given.

        Args:
            name: of the motor.

        Raises:
            ParameterError: there is no such motor, or none is named and there are several.
        """
        names = [one.name for one in self.motors]
        if name is None and not names:
            return self
        if name is not None:
            arguments.text(name, "Rig.only: name", "the name of a motor")
        if name is None:
            raise ParameterError(
                f"{self.origin} has the motors {', '.join(names)}",
                expected="one of them for this",
                do=f"name one with --motor {names[0]}",
            )
        if name not in names:
            expected = near(str(name), names) if names else "none: the rig has one motor, without [[motor]]"
            raise ParameterError(f"{self.origin} has no motor {shown(name)}", expected=expected, do="correct --motor")
        return next(one.rig for one in self.motors if one.name == name)

    def with_law(self, law: GivenLaw | None = None, preset: str | None = None, folder: Path | None = None) -> "Rig":
        """The same rig with another law, without the gains of the old one; unchanged if no law is given.

        Args:
            law: a name, ``FILE.py:NAME`` or a `Law`.
            preset: of that law, in place of the rig's.
            folder: where a relative FILE is found; the current one if it is not given.

        Raises:
            ParameterError: an unknown law, or a user's file that cannot be used.
        """
        if self.motors:
            return self._with_motors(lambda rig: rig.with_law(law, preset, folder))
        place = None if folder is None else arguments.path_of(folder, "Rig.with_law: folder", "folder")
        given = law_file.named(law, place) if isinstance(law, str) else law
        if given is None or given == self.law or _one_file(given, self.law):
            return self if preset is None else self.replace(preset=preset)
        return self.replace(law=given, preset=preset)

    def with_gain(self, name: str, value: float) -> "Rig":
        """The same rig with another value of one of its law's gains; all other gains stay as they are.

        On a suit a law that has a preset for it begins with that; the changed rig names this preset.

        Args:
            name: of the gain; one of a nested part by its dotted name.
            value: in the law's own unit.

        Raises:
            ParameterError: the law has no such gain, or the value is outside its limits.

        >>> Rig().with_gain("feedback_gain", 30.0).fitted().gains.feedback_gain
        30.0
        """
        _ = self.only()
        preset = preset_of(self.loaded_law, self.knowledge, preset=self.preset, gains=self.gains)
        return self.replace(preset=preset, gains={**self.gains, name: value})

    def with_emg(self, source: str, wearer: wearer_file.MuscleCalibration | None = None) -> "Rig":
        """The same rig moved by another source of EMG, whose file is found from here.

        Args:
            source: ``lsl:NAME``, ``trigno:HOST`` or ``file:PATH``.
            wearer: what `bowden.emg_calibrate` returned, in place of the rig's.

        Raises:
            ParameterError: settings that do not fit it.
            StreamError: what names no source.
        """
        _ = self.only()
        arguments.text(source, "Rig.with_emg: source", '"lsl:NAME", "trigno:HOST" or "file:PATH"')
        emg = self.emg
        if wearer is not None:
            if not isinstance(wearer, wearer_file.MuscleCalibration):
                raise ParameterError(
                    f"Rig.with_emg: wearer is {shown(wearer)}",
                    expected="what bowden.emg_calibrate returns",
                    do="call it first",
                )
            emg = emg._replace(levels=wearer, wearer=emg.wearer or "wearer.toml")
        return self.replace(emg=emg_setup.found(emg, Path(self.origin).parent, source))

    def offline(self, *, whole: bool = False) -> "Rig":
        """The same rig for a simulation: with EMG, the reference is the motion that its recording asks for.

        The run then ends with the recording, unless the `whole` duration is wanted. With a live source the reference is
        the largest motion that it can ask for. The hash stays: it is the same rig.

        Raises:
            StreamError: a recording that cannot be used.
        """
        _ = self.only()
        run, whole = self.emg_run, arguments.flag(whole, "Rig.offline: whole")
        if run is None or self.original_hash:
            return self
        motion = resolved("emg.recorded").recorded(run, self.sample_time)
        if motion is None:
            said = f"{run.source} is live: simulated is the largest motion that it can ask for"
            return self._in_place_of(remarks=(*self.remarks, said))
        duration = self.duration if whole else min(self.duration, motion.duration)
        return self._in_place_of(reference=motion, duration=duration)

    def _in_place_of(self, **changes: Any) -> "Rig":
        """Another form of this rig, under its hash."""
        made = self.replace(**changes)
        object.__setattr__(made, "original_hash", self.hash)
        return made

    @property
    def fields(self) -> dict[str, Any]:
        """Name → value."""
        return {one.name: getattr(self, one.name) for one in dataclasses.fields(self)}

    @property
    def _values(self) -> dict[str, Any]:
        return {one.name: getattr(self, one.name) for one in dataclasses.fields(self) if one.compare}

    def __getstate__(self) -> dict[str, Any]:
        return self.fields

    def __setstate__(self, state: dict[str, Any]) -> None:
        for name, value in state.items():  # parts anew: a NaN that was pickled equals no other
            part = drive_part(value.family) if name == "drive" else PARTS.get(name)
            given = value if part is None else checked(value, part.kind, name, part.default)
            object.__setattr__(self, name, given)

    @cached_property
    def hash(self) -> str:
        """A short name of the rig: equal ones have the same, whether they come from Python or a file."""
        return self.original_hash or packing.digest(self._values)

    def __hash__(self) -> int:
        return hash(self.hash)

    def document(self) -> dict[str, Any]:
        """The rig as JSON values, contents of files included, as logs keep it.

        Raises:
            ParameterError: a reference, cable or law that exists only in this process.
        """
        found = packing.document(self._values) | {"origin": self.origin, "hash": self.hash}
        if not self.motors:
            return found
        motors = [{"name": name, "rig": rig.document(), "joint": joint} for name, rig, joint in self.motors]
        joints = [one._asdict() for one in self.joints]
        return found | {"motors": motors, "independent": self.independent, "joints": joints}

    def pack(self) -> bytes:
        """The rig as bytes, for another process; see `unpack`.

        Raises:
            ParameterError: see `document`, or too much of it.
        """
        return packing.packed(self.document())

    @classmethod
    def unpack(cls, pack: bytes | Mapping[str, Any]) -> "Rig":
        """The rig of `pack` or `document`; no file is read.

        Raises:
            ParameterError: it is none, or of another version.
        """
        values, beside = packing.unpacked(pack)
        if "motors" in beside:
            motors = (RigMotor(name, cls.unpack(document), joint) for name, document, joint in beside["motors"])
            values |= {"motors": tuple(motors), "independent": beside["independent"], "joints": beside["joints"]}
        return cls(**values)

    def __repr__(self) -> str:
        given = [
            f"{name}={shown(value)}" for name, value in self._values.items() if not _same(value, self._default(name))
        ]
        return f"Rig({', '.join(given)})"

    @classmethod
    def _default(cls, name: str) -> Any:
        return drive_part(DEFAULT_FAMILY).default if name == "drive" else cls.__dataclass_fields__[name].default

    def __str__(self) -> str:
        """One screen: hash, law, cable, servo, encoders, clock, reference and scenario."""
        return screen(f"Rig {self.hash}", display.rows(self))

    def _repr_html_(self) -> str:
        figure, axes = new_figure(2, 1, height=3.6, share_x=True)
        display.draw(axes, self)
        return fragment(f"Rig {self.hash}", display.rows(self), figure)

    def plot(self, axes: "Axes | Sequence[Axes] | None" = None) -> "list[Axes]":
        """Draw the reference over the run and, on second axes, how the sheath is bent.

        Args:
            axes: matplotlib's, one or two; a new figure is made where they are not given.

        Returns:
            The axes; ``axes[0].figure`` is theirs.

        Raises:
            ParameterError: something else than axes.
        """
        found = axes_for(axes, 2, 1, 7.0, 3.6)
        display.draw(found, self)
        return found

    # what a run takes from it

    @cached_property
    def turned(self) -> bool:
        """True if motor angles are counted the other way round, because the joint falls when the motor rises."""
        if self.suit.worn:  # the motor is counted in the joint's coordinate
            return False
        return self._plain_cable.slope < 0.0 if self.plant is None else self.own_plant.turned

    @property
    def _plain_cable(self) -> BoucWen:
        if isinstance(self.cable, IdentifiedCable) and self._scheduled_by_bend:
            begun = self.bend.path(self.sheath, self.duration, self.seed)(np.zeros(1))
            return self.cable.with_parameters({"bend": float(np.ravel(begun)[0])}).bouc_wen
        return self.cable if isinstance(self.cable, BoucWen) else self.cable.bouc_wen  # type: ignore[union-attr]

    @property
    def _scheduled_by_bend(self) -> bool:
        """True if the scenario's bend is what schedules the cable, and not the bend among its parameters."""
        return (
            isinstance(self.cable, IdentifiedCable)
            and self.cable.best == SCHEDULED
            and "bend_low" in self.cable.model().parameters
        )

    @property
    def identified(self) -> bool:
        """True if the cable comes from a log, and was not written by hand."""
        return isinstance(self.cable, IdentifiedCable)

    @cached_property
    def bench(self) -> Bench:
        """The bench, with the cable's plain Bouc–Wen model; one of a negative slope is turned round."""
        return Bench(
            cable=upright(self._plain_cable),
            sheath=Sheath(self.sheath.bend, (1.0 if self.plant else self.width) * self.sheath.gap, self.sheath.loss),
            servo=self.servo,
            motor=self.motor,
            joint_encoder=self.joint_encoder,
            motor_encoder=self.motor_encoder,
            sample_time=self.sample_time,
            delay=self.delay,
            substeps=self.substeps,
        )

    @cached_property
    def worn(self) -> Suit | None:
        """The suit on an arm in place of the bench; None where none is worn.

        Raises:
            ParameterError: a wearer or a part that cannot be.
        """
        if not self.suit.worn:
            return None
        identified = self.cable if isinstance(self.cable, IdentifiedCable) else None
        return suit_of(self.suit, self.wearer, self.bench, self.sheath.gap, identified)

    @property
    def own_plant(self) -> UserPlant:
        """The user's plant, with the parts that it defines itself.

        Raises:
            ParameterError: the rig has none, or its file cannot be used.
        """
        if self.plant is None or isinstance(self.plant, str):  # never text once the rig is made
            raise ParameterError(f"{self.origin}: the rig has no plant of its own", do="name one in cable.plant")
        return plant_file.loaded(self.plant)

    @cached_property
    def cabled(self) -> Bench | CablePlant | UserPlant:
        """What is moved where no suit is worn: a plant of the user's own, or the bench round its cable.

        The cable is the model that an identification recommends; a straight line is no cable with hysteresis, and the
        plain Bouc–Wen model stands for it.

        Raises:
            ParameterError: a part that cannot be.
        """
        if self.plant is not None:
            return self.own_plant._replace(**{name: getattr(self.bench, name) for name in plant_file.PARTS})
        if not isinstance(self.cable, IdentifiedCable) or self.cable.simulated == "bouc_wen":
            return self.bench
        return plant_of_model(self.cable.best, self.cable.model().parameters, self.bench)

    @property
    def slope(self) -> float:
        """Joint motion per motor motion where no suit is worn; 1 of one's own plant that does not say [rad/rad]."""
        if self.plant is None:
            return self.bench.cable.slope
        return self.own_plant.slope if self.own_plant.slope > 0.0 else 1.0

    @property
    def moved(self) -> Bench | CablePlant | UserPlant | Suit:
        """What is moved: the suit where one is worn, and else `cabled`.

        Raises:
            ParameterError: a part that cannot be.
        """
        return self.worn or self.cabled

    @property
    def simulated_plant(self) -> Plant:
        """The plant with what stands round it: the drive's brake, and under the wearer's push its load cell."""
        if self.worn is None:
            return self.cabled
        worn = self.worn._replace(brake=self.brake)
        return worn if self.pushing is None else worn._replace(load_cell=self.pushing.cell)

    @cached_property
    def pushing(self) -> Pushing | None:
        """In place of the reference, where the wearer's push makes it.

        Raises:
            ParameterError: a virtual elbow that cannot be, or one without a suit.
        """
        return pushing_of(self.admittance, self.worn)

    @cached_property
    def emg_run(self) -> EmgRun | None:
        """In place of the reference, where EMG makes it.

        Raises:
            ParameterError: settings that do not fit one another.
            StreamError: what names no source.
        """
        return emg_setup.emg_run(self.emg)

    @cached_property
    def trajectory(self) -> Trajectory:
        """Where the joint shall be; by EMG, the largest motion that it can ask for, unless the rig is `offline`."""
        run = self.emg_run
        if run is None or hasattr(self.reference, "content"):
            return self.reference
        intent = run.course.intent  # there and back without a rest: what a law is checked with
        return PeriodicMinimumJerk(intent.low, intent.high, 2.0 * intent.duration)

    @cached_property
    def begin(self) -> float:
        """Where the trajectory starts [rad]."""
        return float(self.trajectory.sample(np.zeros(1))[0, 0])

    @cached_property
    def bend_path(self) -> BendPath:
        """How the sheath is bent over the run."""
        return self.bend.path(self.bench.sheath, self.duration, self.seed)

    @cached_property
    def start_motor(self) -> float:
        """Motor angle at which a run begins [rad]."""
        if self.initial_motor is not None:
            return (-1 if self.turned else 1) * self.initial_motor
        if self.suit.worn:  # the motor is counted in the joint's coordinate
            return self.begin
        return self.cabled.resting_motor(self.begin, float(self.bend_path(np.zeros(1))[0]))

    @property
    def notes(self) -> tuple[str, ...]:
        """What the user should know about how the rig is understood."""
        notes = list(self.remarks)
        if isinstance(self.cable, IdentifiedCable) and self.cable.best == _LINE:
            where = Path(self.origin).parent / self.cable.file if self.cable.file else "the identified cable"
            notes.append(f"{where} recommends {_LINE!r}; the bench runs the cable's bouc_wen model")
        if isinstance(self.cable, IdentifiedCable) and self.cable.best == SCHEDULED:
            own = self.cable.model().parameters
            notes += outside(own, {"load": own["load"]} if "load" in own else {})
        if self.worn is not None and self.identified:
            notes.append(self.whose_cable)
        notes += [*self._gear_notes(), *self._like_metres()]
        if self._scheduled_by_bend:
            notes += self._bend_notes()
        if self.turned:
            why = (
                "the cable's slope is negative" if self.plant is None else "the joint falls as the plant's motor rises"
            )
            notes.append(f"{why}: motor angles are counted the other way round here")
        given, used = self.limits.frozen_travel, self.supervisor_limits.frozen_travel
        if used < given:
            known = f"the identified cable explains no more than {used / RADIANS:.3g}, which is used"
            notes.append(f"limits.frozen_travel_deg is {given / RADIANS:.4g}; {known}")
        asked, slower = self.limits.lowering, self.supervisor_limits.lowering
        if slower < asked and abs(asked - Limits().lowering) > _WRITTEN:
            why = "an arm is let down no faster" if self.suit.worn else "joint_speed and motor_speed allow no more"
            notes.append(
                f"limits.lowering_deg_per_s is {asked / RADIANS:.4g}; {why} than {slower / RADIANS:.3g}, which is used"
            )
        if self.emg.source is None and self.emg != PARTS["emg"].default:
            notes.append(
                "[emg] has no source, so the joint follows [reference]; set emg.source, or give simulate and run one "
                "with --emg"
            )
        if self.emg.levels is not None and not self.emg.levels.sigma:
            notes.append(f"{self.emg.wearer} was {wearer_file.EARLIER}")
        if self.worn is None or not self.admittance.enabled:
            notes += self._like_radians()
            notes += self._beyond_the_log()
        return tuple(notes)

    @property
    def encoders(self) -> Encoders:
        """How the encoders of the cable's log read; as if nobody said it on a suit, whose joint has another sensor."""
        own = isinstance(self.cable, IdentifiedCable) and self.worn is None
        return self.cable.encoders if own else NOT_SAID  # type: ignore[union-attr]

    @property
    def servo_assumed(self) -> bool:
        """True if the cable was identified, and the servo that pulls it is still that of the paper's bench."""
        if not isinstance(self.cable, IdentifiedCable) or self.worn is not None or self.plant is not None:
            return False
        papers = PARTS["servo"].default
        return math.isclose(self.servo.natural_frequency, papers.natural_frequency, rel_tol=1e-3) and math.isclose(
            self.servo.damping, papers.damping, rel_tol=1e-3
        )

    @property
    def servo_text(self) -> str:
        """The servo that gains are judged for, in words; what to do, where it is not the rig's own."""
        whose = "the servo of the paper's bench, not yours," if self.servo_assumed else "a servo"
        how = f"{self.servo.natural_frequency / HERTZ:.3g} Hz and damping {self.servo.damping:.3g}"
        late = f"which gets a command {1e3 * self.delay * self.sample_time:g} ms after its sample"
        file = Path(self.origin).name if self.origin.endswith(".toml") else "rig.toml"
        do = f": log steps of yours, then bowden identify-servo LOG --into {file}" if self.servo_assumed else ""
        return f"{whose} of {how}, {late}{do}"

    @property
    def whose_cable(self) -> str:
        """What a suit has of its identified cable, and whether that moved its joint as the suit does the elbow."""
        cable, spool = self.cable, self.suit.spool_radius
        lost = cable.lost  # type: ignore[union-attr]
        said = (
            f"both cables of the suit lose what {cable.file or 'the identified cable'} does, "  # type: ignore[union-attr]
            f"±{lost * DEGREES:.3g}° or ±{1e3 * lost * spool:.3g} mm of the spool"
        )
        slope = abs(self._plain_cable.slope)
        least, most = (spool / flexor_moment_arm(end, SuitGeometry()) for end in reversed(ELBOW_RANGE))
        if least <= slope <= most:
            return said
        return (
            f"{said}; but its slope is {slope:.3g}, and that of the elbow over this spool {least:.2g} to {most:.2g}: "
            "if its motor turned a spool of another size than suit.spool_radius_mm, delete [cable] and set "
            f"suit.play_mm to {lost:.3g} times the radius of that spool in mm"
        )

    def _gear_notes(self) -> list[str]:
        """That the log of the cable's model was probably counted before the gear, behind which the drive's angle is."""
        counts, gear = getattr(self.drive, "motor_counts_per_turn", 0.0), self.drive_needs.gear
        counted = self.cable.encoders.motor if isinstance(self.cable, IdentifiedCable) else None
        if not (counted and counts) or gear == 1.0 or abs(counted * counts / math.tau - 1.0) > _SAME_COUNT:
            return []
        return [
            f"the log of the cable's model has {counts:g} counts a turn, as the drive's encoder has before "
            f"the gear of {gear:g} in [motor]: if that is the log's encoder, identify the log with --counts-per-turn "
            f"{counts * gear:g}"
        ]

    def _bend_notes(self) -> list[str]:
        """What is said of the bends of a run whose cable is scheduled by them."""
        own = self.cable.model().parameters  # type: ignore[union-attr]
        path = self.bend_path(np.linspace(0.0, self.duration, _INSTANTS))
        low, high = float(np.min(path)), float(np.max(path))
        far = low if own["bend_low"] - low > high - own["bend_high"] else high
        found = outside(own, {"bend": far})
        if max(abs(low - own["bend"]), abs(high - own["bend"])) > _WRITTEN:
            seen = f"{low / RADIANS:.4g}°" + (f" to {high / RADIANS:.4g}°" if high - low > _WRITTEN else "")
            found.append(
                f"the sheath's bend schedules the cable: it is {seen} in this run (scenario.bend, sheath.bend_deg), "
                f"and not the {own['bend'] / RADIANS:.4g}° among the cable's parameters; laws get that one, "
                "of the beginning"
            )
        return found

    def _like_metres(self) -> list[str]:
        """What is said of lengths of a suit that are so small that they were probably meant in metres."""
        lengths = [item for item in items_of(SuitSettings) if item.quantity.file_unit == "mm"]
        usual, own = SuitSettings(), self.suit
        return [
            f"suit.{item.key} is {1e3 * at(own, item.path):.4g}; metres? {1e3 * at(own, item.path):.4g} m would be "
            f"{1e6 * at(own, item.path):.4g}"
            for item in lengths
            if own.worn and 0.0 < at(own, item.path) < _METRES * at(usual, item.path)
        ]

    def _like_radians(self) -> list[str]:
        """Note on a reference that is so small that it is probably in radians."""
        if self.emg.source is not None:
            what, ends = "emg.low_deg and high_deg", (self.emg.low, self.emg.high)
        else:
            what, ends = "the reference", self._ends
        furthest = max(map(abs, ends)) / RADIANS
        if ends[0] != ends[1] and furthest > math.pi:
            return self._one_like_radians(what, ends)
        if ends[0] == ends[1]:
            return []
        meant = f"radians? {furthest:.3g} rad would be {furthest * DEGREES:.3g}°"
        return [f"{what} goes no further than {furthest:.3g}°, less than a cable's dead zone; {meant}"]

    def _one_like_radians(self, what: str, ends: tuple[float, float]) -> list[str]:
        """Note on a range with one end in degrees and one probably in radians, of a cable with a known stroke."""
        covered = self.cable.covered if isinstance(self.cable, IdentifiedCable) else None
        for end, other in (ends, ends[::-1]):
            number = end / RADIANS
            in_order = (number < other) == (end < other)
            within = covered is not None and covered.joint_low <= number <= covered.joint_high
            if 0.0 < abs(number) <= math.pi and within and in_order:
                return [f"{what} ends at {number:.3g}°; radians? {number:.3g} rad would be {number * DEGREES:.3g}°"]
        return []

    def _beyond_the_log(self) -> list[str]:
        """What is said of a reference that leaves the motion that the cable's log covered."""
        covered = self.cable.covered if isinstance(self.cable, IdentifiedCable) else None
        if covered is None or self.worn is not None or self.plant is not None:
            return []
        low, high = self._ends
        span = covered.joint_high - covered.joint_low
        if max(covered.joint_low - low, high - covered.joint_high) <= _BEYOND * span:
            return []
        seen = f"{covered.joint_low / RADIANS:.1f} to {covered.joint_high / RADIANS:.1f}°"
        return [
            f"the reference goes from {low / RADIANS:.3g} to {high / RADIANS:.3g}°, and the log of the cable's model "
            f"covered {seen} of the joint: beyond that the model was not fitted, and its figures there are uncertain; "
            f"{self.made_anew or 'keep the reference within, or identify a log of a larger motion'}"
        ]

    @property
    def made_anew(self) -> str:
        """What to do about a cable that a program put into a rig of other angles; empty where a file names it."""
        given = isinstance(self.cable, IdentifiedCable) and not self.cable.file
        return "bowden.init(fit).rig has the reference, directions and zeros of its log" if given else ""

    @property
    def law_name(self) -> str:
        """The law as the rig names it."""
        return self.law if isinstance(self.law, str) else self.law.name

    @cached_property
    def knowledge(self) -> Knowledge:
        """What a law knows of the rig."""
        if self.worn is not None:
            return knowledge_of(self.worn)
        known = knowledge_of(self.bench if self.plant is None else self.cabled, identified=self.identified)
        if self.plant is not None and math.isnan(known.slope):
            return known
        return known._replace(relative_slope=self.slope / DEFAULT_CABLE.slope)

    def fitted(self, law: GivenLaw | None = None, known: Knowledge | None = None) -> Law:
        """The rig's law with the gains that the rig gives it; another law gets none of the rig's own gains.

        In this order: the law's own, what it knows of the rig, the preset, the rig's own (`bowden.control.knowledge`).

        Args:
            law: in place of the rig's.
            known: what the law knows of the rig, in place of `knowledge`.

        Raises:
            ParameterError: an unknown law, preset or gain.
        """
        if known is not None and not isinstance(known, Knowledge):
            raise ParameterError(
                f"Rig.fitted: known is {shown(known)}", expected="a Knowledge", do="leave it out for the rig's own"
            )
        given = None if law is None else _law(law)
        own = given is None or given == self.law or _one_file(given, self.law)
        found, gains = self.loaded_law if given is None or own else _loaded(given), self.gains if own else {}
        return configured(found, known or self.knowledge, preset=self.preset if own else None, gains=gains)

    @cached_property
    def loaded_law(self) -> Law:
        """The rig's law with its own gains.

        Raises:
            ParameterError: a user's file that cannot be used.
        """
        return _loaded(self.law)

    @property
    def chosen_law(self) -> Law:
        """The rig's law with the preset and the gains that the rig chooses, and no knowledge: for other plants.

        Raises:
            ParameterError: a user's file that cannot be used, or an unknown preset or gain.
        """
        law = self.loaded_law if self.preset is None else self.loaded_law.preset(self.preset)
        return law.with_gains(**self.gains)

    # what a live run takes from it

    @cached_property
    def supervisor_limits(self) -> Limits:
        """All limits of the supervisor, those that follow from other parts too."""
        dead_zone, taut = _WIDER * self.knowledge.width, self.home / self.slope if self.worn is None else 0.0
        parts = self.bench, self.drive, dead_zone, self.worn, self.load_cell, taut
        return live_parts.limits(self.limits, self.basis, *parts)

    @cached_property
    def basis(self) -> Basis:
        """What limits that are not written follow from."""
        cable, width = self.bench.cable, 0.0
        if self.worn is not None and (lost := elbow_dead_zone(self.worn.flexor.half_width)) > USUAL_DEAD_ZONE:
            width = lost
        if self.worn is not None or (self.plant is not None and not self.own_plant.slope > 0.0):
            return Basis(1.0, DEFAULT_CABLE.slope, width, 0.0, self.bench.servo.speed_limit, self.sample_time)
        if self.plant is None:
            width = with_cable(self.knowledge, cable, self.bench.sheath.gap, identified=True).width
        low, fastest = min(0.0, self._ends[0]), self.bench.servo.speed_limit
        return Basis(self.slope / DEFAULT_CABLE.slope, self.slope, width, low, fastest, self.sample_time)

    @cached_property
    def _ends(self) -> tuple[float, float]:
        """Least and largest angle of the reference [rad]."""
        path = self.trajectory.sample(np.linspace(0.0, min(self.duration, _LOOKED_AT), _INSTANTS))[:, 0]
        return float(path.min()), float(path.max())

    @cached_property
    def home(self) -> float:
        """The joint's rest, where the cable is just taut: zero, or the end of the reference where the cable is longer,
        or where zero is outside the joint's range [rad].
        """
        if self.worn is not None:
            return 0.0
        low, high = self._ends
        if self.limits.joint_low < 0.0 < self.limits.joint_high:
            low, high = min(0.0, low), max(0.0, high)
        end = low if self.limits.slack_sign < 0.0 else high
        return min(max(end, self.limits.joint_low), self.limits.joint_high)

    @cached_property
    def drive_needs(self) -> DriveNeeds:
        """What is asked of the drive, whatever it is.

        Raises:
            ParameterError: limits that contradict one another.
        """
        return live_parts.drive_needs(self.supervisor_limits, self.bench, self.worn)

    @cached_property
    def drive_parameters(self) -> Any:
        """All that is to be known of the drive, as its family has it.

        Raises:
            ParameterError: values that make no sense together.
        """
        live_parts.check_load(self.drive, self.load_cell, self.supervisor_limits, self.sample_time)
        return live_parts.drive_parameters(self.drive, self.drive_needs, Path(self.origin).parent)

    def on_bus(self, channel: str | None, interface: str | None = None) -> "Rig":
        """The rig with its drive on another bus, where one is given.

        Raises:
            ParameterError: a channel that is none.
        """
        for name, value in (("channel", channel), ("interface", interface)):
            if value is not None:
                arguments.text(value, f"Rig.on_bus: {name}", "the name of a bus" if name == "channel" else "its kind")
        if self.motors:
            return self._with_motors(lambda rig: rig.on_bus(channel, interface))
        moved = family_of(self.drive).moved(self.drive, channel, interface)
        cell = moved_cell(self.load_cell, channel, interface)
        same = moved == self.drive and cell == self.load_cell
        return self if same else self.replace(drive=moved, load_cell=cell)

    @property
    def filters(self) -> Filters:
        """The filters in front of the law.

        Raises:
            ParameterError: a cut-off that the cycle is too slow for.
        """
        return live_parts.filters(self.live, self.sample_time)


_OF_THE_WHOLE = ("motors", "independent", "joints", "origin", "remarks")
"""Fields of a rig with motors that are not those of each motor."""
_LOOKED_AT, _INSTANTS = 60.0, 601
"""Of a reference: for how long it is looked at [s], and how often."""
_BEYOND = 0.1
"""How far a reference may leave the motion that a log covered, over that motion [–]."""
_METRES = 0.01
"""Share of its usual length below which one was probably not written in millimetres [–]."""
_SAME_COUNT = 0.01
"""Two encoders' counts that differ by less are the same [–]."""
_WIDER = 2.0
"""Bend of the sheath over that at which the cable was identified, up to which limits know its dead zone [–]."""
_WRITTEN = 1e-3
"""A limit further from its default was written by somebody; the default's own text in degrees is rounded [rad]."""


def _check_name(name: str) -> None:
    fields = [one.name for one in dataclasses.fields(Rig) if one.init]
    if name not in fields:
        raise ParameterError(f"a rig has no {name!r}", expected=near(name, fields), do="correct the name")


def _loaded(given: GivenLaw) -> Law:
    return given if isinstance(given, Law) else law_file.loaded(given)


def _one_file(one: Any, other: Any) -> bool:
    """True if two laws are the same one of a user's file, by whatever way it is named."""
    if not (isinstance(one, LawFile) and isinstance(other, LawFile)):
        return False
    names = [law.name.rpartition(".py")[2] for law in (one, other)]
    return names[0] == names[1] and (one.path, one.source, one.modules) == (other.path, other.source, other.modules)


def _cable(given: Any) -> BoucWen | IdentifiedCable:
    if isinstance(getattr(given, "best", None), CableModel):
        given = given.best
    if isinstance(given, CableModel):
        given = given.identified()
    if isinstance(given, IdentifiedCable):
        _ = given.bouc_wen
        return given
    if not isinstance(given, BoucWen):
        raise ParameterError(
            f"Rig: cable is {shown(given)}",
            expected="a BoucWen(slope=…), or what bowden.identify gives",
            do="of a file: Rig.read",
        )
    if given.slope == 0.0:
        raise ParameterError("Rig: cable.slope is 0", expected="a number above or below 0", do="correct it")
    return checked(given, BoucWen, "cable")


def _reference(given: Any) -> Trajectory:
    if isinstance(given, Recorded):
        return held(given)
    if not (hasattr(given, "sample") and hasattr(given, "describe")) or isinstance(given, type):
        raise ParameterError(
            f"Rig: reference is {shown(given)}",
            expected="a reference such as PeriodicMinimumJerk(0.0, 1.2, 10.0)",
            do="make one: bowden.MinimumJerk.periodic(low, high, period)",
        )
    if any(type(given) is part.kind for part in REFERENCES.values()):
        checked(given, type(given), "reference")
    found: Trajectory = given
    return found


def _bend(given: Any) -> Bend:
    if isinstance(given, int | float) and not isinstance(given, bool):
        given = ConstantBend(float(given))
    if not isinstance(given, ConstantBend | ScriptedBend | RandomBend):
        raise ParameterError(
            f"Rig: bend is {shown(given)}",
            expected="an angle, or a ConstantBend(…), ScriptedBend(…) or RandomBend(…)",
            do="give the sheath's total bend in rad",
        )
    found: Bend = checked(given, type(given), "bend")
    if isinstance(found, RandomBend) and not found.low < found.high:
        raise ParameterError(
            f"Rig: bend goes from {found.low:g} to {found.high:g}", expected="low below high", do="swap them"
        )
    return found


def _law(given: Any) -> GivenLaw:
    if isinstance(given, str):
        return law_file.named(given)
    if not isinstance(given, Law | LawFile):
        raise ParameterError(
            f"Rig: law is {shown(given)}",
            expected='a name ("adaptive"), "FILE.py:NAME" or a Law',
            do="list(bowden.LAWS) has the names",
        )
    if isinstance(given, Law) and LAWS.get(given.name) == given:
        return given.name
    return law_file.held(given) if isinstance(given, Law) else given


def _gains(given: Any) -> Gains:
    if not isinstance(given, Mapping):
        raise ParameterError(
            f"Rig: gains is {shown(given)}", expected="gains by name", do="for example {'error_gain': 0.05}"
        )
    rule = Quantity("a gain", ge=-1e6, le=1e6)
    return Gains({str(name): checked_number(one, float, rule, f"gains[{name!r}]") for name, one in given.items()})


def _same(value: Any, default: Any) -> bool:
    return type(value) is type(default) and bool(value == default)

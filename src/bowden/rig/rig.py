"""A rig: one frozen value with everything that a run needs."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

from bowden.control.reference import Trajectory
from bowden.core import arguments
from bowden.core.errors import ParameterError, error_context, near
from bowden.core.guesses import Answering, answering
from bowden.core.part import signed
from bowden.core.registry import Derived, resolve
from bowden.core.toml_text import quoted
from bowden.drawing.shown import Panels, Plotted, screen
from bowden.models.cable.bouc_wen import BoucWen
from bowden.models.cable.sheath import Sheath
from bowden.models.cable.sheath_path import BendPath
from bowden.models.drive.encoder import Encoder
from bowden.models.drive.holding_brake import HoldingBrake
from bowden.models.drive.motor import Motor
from bowden.models.drive.servo import Servo
from bowden.plants.bends import Bend, ConstantBend
from bowden.plants.counting import Encoders
from bowden.plants.push_settings import AdmittanceSettings
from bowden.plants.suit_settings import SuitSettings, WearerSettings
from bowden.rig.checked import Gains, checked, shown
from bowden.rig.families import DriveNeeds, family_of
from bowden.rig.given import CableLike, GivenLaw, GivenPlant, check_whole, settle
from bowden.rig.joints import JointSettings, RigJoint, joints_of
from bowden.rig.load_cell import LoadCellParameters, moved_cell
from bowden.rig.sections import (
    DEFAULT_CABLE,
    DEFAULT_FAMILY,
    DEFAULT_WIDTH,
    PARTS,
    REFERENCES,
    Clock,
    Control,
    Scenario,
    drive_part,
)
from bowden.rig.settings import EmgSettings, JointSensor, LiveSettings, found_emg
from bowden.rig.tree import of_rig, read_values, values_of, written
from bowden.safety.limits import Limits
from bowden.sensing import wearer_file

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from bowden.control.knowledge import Knowledge
    from bowden.control.law import Law
    from bowden.cycle.one_cycle import Filters
    from bowden.plants.bench import Bench
    from bowden.plants.plant import Plant
    from bowden.plants.pushing import Pushing
    from bowden.plants.suit_parts import Suit
    from bowden.plants.trust import Trust
    from bowden.plants.user_plant import UserPlant
    from bowden.rig.consistent import Basis
    from bowden.rig.emg_run import EmgRun
    from bowden.sensing.joint_angle import JointModel


class RigMotor(NamedTuple):
    """One motor of a rig."""

    name: str
    rig: "Rig"
    """All of it: what is common, with what is its own."""
    joint: str = ""
    """Name of the joint that its cable pulls, where others pull it too."""


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
class Rig(Plotted, metaclass=Answering):
    """Everything that a run needs; the default is the bench of the paper. All numbers are in SI and radians.

    Drawn are the reference over the run and, below it, how the sheath is bent.

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

    _panels = Panels(2, 1, 7.0, 3.6)

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
    joint_sensor: JointSensor = PARTS["joint_sensor"].default
    """Where the joint's angle comes from."""
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
        settle(self, RigMotor)
        check_whole(self)

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
        return of_rig(self)

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
        resolve("rig.folder:write")(self, arguments.path_of(path, "Rig.write: path"), force=force)

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
            back = {name: fields[name].default for name in resolve("plants.plant_file:said_by")(self.own_plant)}
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
    def cable_trust(self) -> "Trust | None":
        """Trust in the models of its identified cables, of several the lowest; None where nothing says it."""
        known = [one for motor in self.parts if (one := getattr(motor.rig.cable, "trust", None)) is not None]
        return resolve("plants.trust:least")(known) if known else None

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

    def with_law(self, law: "GivenLaw | None" = None, preset: str | None = None, folder: Path | None = None) -> "Rig":
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
        law_file = resolve("control.law_file")
        given = law_file.named(law, place) if isinstance(law, str) else law
        if given is None or given == self.law or law_file.same_file(given, self.law):
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
        preset = resolve("control.knowledge:preset_of")(
            self.loaded_law, self.knowledge, preset=self.preset, gains=self.gains
        )
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
        return self.replace(emg=found_emg(emg, Path(self.origin).parent, source))

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
        motion = resolve("hardware.emg.recorded:recorded")(run, self.sample_time)
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
    def compared(self) -> dict[str, Any]:
        """Those by which two rigs are the same."""
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
        return self.original_hash or resolve("rig.packing:digest")(self.compared)

    def __hash__(self) -> int:
        return hash(self.hash)

    def document(self) -> dict[str, Any]:
        """The rig as JSON values, contents of files included, as logs keep it.

        Raises:
            ParameterError: a reference, cable or law that exists only in this process.
        """
        found: dict[str, Any] = resolve("rig.packing:of_rig")(self)
        return found

    def pack(self) -> bytes:
        """The rig as bytes, for another process; see `unpack`.

        Raises:
            ParameterError: see `document`, or too much of it.
        """
        return resolve("rig.packing:packed")(self.document())

    @classmethod
    def unpack(cls, pack: bytes | Mapping[str, Any]) -> "Rig":
        """The rig of `pack` or `document`; no file is read.

        Raises:
            ParameterError: it is none, or of another version.
        """
        values = resolve("rig.packing:unpacked")(pack)
        motors = (RigMotor(name, cls.unpack(document), joint) for name, document, joint in values["motors"])
        return cls(**{**values, "motors": tuple(motors)})

    def __repr__(self) -> str:
        given = [
            f"{name}={shown(value)}" for name, value in self.compared.items() if not _same(value, self._default(name))
        ]
        return f"Rig({', '.join(given)})"

    @classmethod
    def _default(cls, name: str) -> Any:
        return drive_part(DEFAULT_FAMILY).default if name == "drive" else cls.__dataclass_fields__[name].default

    def __str__(self) -> str:
        """One screen: hash, law, cable, servo, encoders, clock, reference and scenario."""
        return screen(self._title(), self._rows())

    def _title(self) -> str:
        return f"Rig {self.hash}"

    def _rows(self) -> list[tuple[str, str]]:
        found: list[tuple[str, str]] = resolve("rig.display:rows")(self)
        return found

    def _draw(self, axes: "Sequence[Axes]") -> None:
        resolve("rig.display:draw")(axes, self)

    @property
    def identified(self) -> bool:
        """True if the cable comes from a log, and was not written by hand."""
        return not isinstance(self.cable, BoucWen)

    @property
    def law_name(self) -> str:
        """The law as the rig names it."""
        return self.law if isinstance(self.law, str) else self.law.name

    def fitted(self, law: "GivenLaw | None" = None, known: "Knowledge | None" = None) -> "Law":
        """The rig's law with the gains that the rig gives it; another law gets none of the rig's own gains.

        In this order: the law's own, what it knows of the rig, the preset, the rig's own (`bowden.control.knowledge`).

        Args:
            law: in place of the rig's.
            known: what the law knows of the rig, in place of `knowledge`.

        Raises:
            ParameterError: an unknown law, preset or gain.
        """
        found: Law = resolve("rig.laws:fitted")(self, law, known)
        return found

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

    # what follows from it: each is computed once, when it is asked for, by the function of its name in that file

    turned: ClassVar[Derived[bool]] = Derived("rig.plant")
    bench: ClassVar[Derived["Bench"]] = Derived("rig.plant")
    worn: ClassVar[Derived["Suit | None"]] = Derived("rig.plant")
    own_plant: ClassVar[Derived["UserPlant"]] = Derived("rig.plant")
    cabled: ClassVar[Derived["Bench | UserPlant"]] = Derived("rig.plant")
    slope: ClassVar[Derived[float]] = Derived("rig.plant")
    moved: ClassVar[Derived["Bench | UserPlant | Suit"]] = Derived("rig.plant")
    simulated_plant: ClassVar[Derived["Plant"]] = Derived("rig.plant")
    joint_model: ClassVar[Derived["JointModel"]] = Derived("rig.plant")
    pushing: ClassVar[Derived["Pushing | None"]] = Derived("rig.plant")
    emg_run: ClassVar[Derived["EmgRun | None"]] = Derived("rig.plant")
    trajectory: ClassVar[Derived[Trajectory]] = Derived("rig.plant")
    reference_ends: ClassVar[Derived[tuple[float, float]]] = Derived("rig.plant")
    begin: ClassVar[Derived[float]] = Derived("rig.plant")
    bend_path: ClassVar[Derived[BendPath]] = Derived("rig.plant")
    start_motor: ClassVar[Derived[float]] = Derived("rig.plant")
    encoders: ClassVar[Derived[Encoders]] = Derived("rig.plant")
    knowledge: ClassVar[Derived["Knowledge"]] = Derived("rig.laws")
    loaded_law: ClassVar[Derived["Law"]] = Derived("rig.laws")
    chosen_law: ClassVar[Derived["Law"]] = Derived("rig.laws")
    supervisor_limits: ClassVar[Derived[Limits]] = Derived("rig.drive")
    basis: ClassVar[Derived["Basis"]] = Derived("rig.drive")
    home: ClassVar[Derived[float]] = Derived("rig.drive")
    drive_needs: ClassVar[Derived[DriveNeeds]] = Derived("rig.drive")
    drive_parameters: ClassVar[Derived[Any]] = Derived("rig.drive")
    filters: ClassVar[Derived["Filters"]] = Derived("rig.drive")
    notes: ClassVar[Derived[tuple[str, ...]]] = Derived("rig.notes")
    servo_assumed: ClassVar[Derived[bool]] = Derived("rig.notes")
    servo_text: ClassVar[Derived[str]] = Derived("rig.notes")
    whose_cable: ClassVar[Derived[str]] = Derived("rig.notes")
    made_anew: ClassVar[Derived[str]] = Derived("rig.notes")


_OF_THE_WHOLE = ("motors", "independent", "joints", "origin", "remarks")
"""Fields of a rig with motors that are not those of each motor."""


def _check_name(name: str) -> None:
    fields = [one.name for one in dataclasses.fields(Rig) if one.init]
    if name not in fields:
        raise ParameterError(f"a rig has no {name!r}", expected=near(name, fields), do="correct the name")


def _same(value: Any, default: Any) -> bool:
    return type(value) is type(default) and bool(value == default)

"""The only place where things are wired: from a rig.toml to a bench, a law, a reference and a sheath that moves."""

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bowden.control import LAWS, Law, user_law
from bowden.control.knowledge import Knowledge, configured
from bowden.control.reference import Trajectory
from bowden.core.errors import BowdenError, ParameterError
from bowden.core.units import RADIANS
from bowden.models.cable.bouc_wen import BoucWen
from bowden.models.cable.sheath import Sheath, slope_factor
from bowden.models.drive.encoder import Encoder
from bowden.models.drive.motor import Motor
from bowden.models.drive.servo import Servo
from bowden.plants.bench import Bench
from bowden.plants.knowledge_of import knowledge_of
from bowden.plants.suit_parts import Suit
from bowden.rig import emg_motion
from bowden.rig import schema as schema
from bowden.rig.compose_admittance import Pushing, pushing_of
from bowden.rig.compose_motion import bend_of, reference_of
from bowden.rig.compose_suit import suit_of
from bowden.rig.config import read_rig
from bowden.rig.emg_setup import emg_run
from bowden.sim.scenario import BendPath

MOST_CYCLES = 10_000_000
"""A longer run is refused: its record would not fit into the memory of a common computer."""


@dataclass(frozen=True)
class Setup:
    """Everything that a run needs but its laws."""

    bench: Bench
    reference: Trajectory
    bend: BendPath
    duration: float
    """[s]"""
    seed: int
    initial_motor: float
    """[rad]"""
    notes: tuple[str, ...]
    """What the user should know about how the file was understood."""
    turned: bool
    """Whether motor angles are counted the other way round, because the cable's slope is negative."""
    suit: Suit | None
    """In place of the bench, where one is worn."""
    pushing: Pushing | None
    """In place of the reference, where the wearer's push makes it."""


def setup(
    path: Path,
    duration: float | None = None,
    seed: int | None = None,
    *,
    emg: str | None = None,
    offline: bool = False,
) -> tuple[Setup, schema.Rig]:
    """Read a rig.toml and build all but the laws.

    Args:
        path: the rig.toml.
        duration: in place of the file's [s].
        seed: in place of the file's.
        emg: source of EMG, in place of the file's.
        offline: whether the reference of a run by EMG is made of its recording, in place of its largest motions; the
            run then ends with the recording, unless `duration` is given.

    Raises:
        ParameterError: a file, key or value that cannot be used.
        StreamError: a recording of EMG that cannot be used.
    """
    rig, reference = read_rig(path), None
    notes: tuple[str, ...] = ()
    by_emg = emg_run(rig.emg, path.parent, emg)
    if by_emg is not None:
        recorded = emg_motion.recorded(by_emg, rig.bench.sample_time_ms * schema.MILLISECONDS) if offline else None
        reference = recorded or emg_motion.stand_in(by_emg)
        if recorded is not None and duration is None:
            duration = min(rig.scenario.duration_s, recorded.duration)  # as the live run, which ends with it
        if offline and recorded is None:
            notes = (f"{by_emg.source} is live: simulated is the largest motion that it can ask for",)
    built = setup_of(rig, path, duration, seed, reference)
    return replace(built, notes=built.notes + notes), rig


def setup_of(
    rig: schema.Rig,
    path: Path,
    duration: float | None = None,
    seed: int | None = None,
    reference: Trajectory | None = None,
    bend: BendPath | None = None,
    begin: float | None = None,
) -> Setup:
    """`setup` for a rig that is read already; `path` says where from.

    Args:
        rig: the file's contents.
        path: for messages, and to find the files that it names.
        duration: in place of the file's [s].
        seed: in place of the file's.
        reference: one made before, in place of the file's.
        bend: likewise.
        begin: where the reference starts, if that is known [rad].

    Raises:
        ParameterError: a value that cannot be used.
    """
    scenario = rig.scenario
    duration = scenario.duration_s if duration is None else duration
    seed = scenario.seed if seed is None else seed
    cable, width, notes = _cable(rig.cable, path)
    turned = cable.slope < 0.0
    if turned:
        # joint = αφ·x + αh·h(x) is the same motion for −x, −αφ and −αh, since h(−x) = −h(x)
        cable = cable._replace(slope=-cable.slope, hysteresis_gain=-cable.hysteresis_gain)
        notes.append("the cable's slope is negative: motor angles are counted the other way round here")
    bench = _bench(rig, cable, width)
    if not (duration > 0.0 and 2.0 <= duration / bench.sample_time <= MOST_CYCLES):
        raise ParameterError(
            f"a run of {duration:g} s has {max(duration, 0.0) / bench.sample_time:g} cycles",
            expected=f"a duration that makes 2 to {MOST_CYCLES} of them",
            do="change scenario.duration_s or --duration",
        )
    if not 0 <= seed < 2**63:
        raise ParameterError(f"the seed is {seed}", expected="a whole number from 0 to 2⁶³ − 1", do="change --seed")
    if reference is None:
        with _asked_for_by(f"{path}: reference"):
            reference = reference_of(rig.reference, path.parent)
    bend = bend or bend_of(scenario.bend, bench.sheath, duration, seed)
    initial = scenario.initial_motor_deg
    with _asked_for_by(f"{path}: [suit] or [wearer]"):
        suit = suit_of(rig, bench)
    with _asked_for_by(f"{path}: [admittance]"):
        pushing = pushing_of(rig, suit)
    if suit is not None and initial is None:  # the motor is counted in the joint's coordinate
        initial = (_begin(reference) if begin is None else begin) / RADIANS
    return Setup(
        bench=bench,
        reference=reference,
        bend=bend,
        duration=duration,
        seed=seed,
        initial_motor=_resting(bench, _begin(reference) if begin is None else begin, bend)
        if initial is None
        else (-1 if turned else 1) * initial * RADIANS,
        notes=tuple(notes),
        turned=turned,
        suit=suit,
        pushing=pushing,
    )


def law_for(name: str, rig: schema.Rig, bench: Bench, folder: Path, preset: str | None = None) -> Law:
    """A law with the gains that this rig gives it.

    In this order: its own, what the rig tells it, the preset, and the rig's own gains last, if it is the rig's law
    (`bowden.control.knowledge`).

    Args:
        name: a key of `LAWS`, or ``FILE.py:NAME`` of a user's own.
        rig: the file's contents.
        bench: with the cable as the laws know it.
        folder: where a relative FILE is found.
        preset: in place of the rig's.

    Raises:
        ParameterError: an unknown law, preset or gain, or a user's file that cannot be used.
    """
    known = known_of(rig, bench, suit_of(rig, bench))
    return fitted(law_named(name, folder), rig, known, preset, rigs_own=name == rig.control.law)


def law_named(name: str, folder: Path) -> Law:
    """A law with its own gains; `name` and `folder` are those of `law_for`.

    Raises:
        ParameterError: an unknown law, or a user's file that cannot be used.
    """
    return user_law.load(name, folder) if user_law.is_file(name) else LAWS[name]


def known_of(rig: schema.Rig, bench: Bench, suit: Suit | None) -> Knowledge:
    """What a rig knows.

    Args:
        rig: the file's contents.
        bench: with the cable as the laws know it.
        suit: in place of it, where one is worn.
    """
    return knowledge_of(bench, identified=rig.cable.model is not None) if suit is None else knowledge_of(suit)


def fitted(law: Law, rig: schema.Rig, known: Knowledge, preset: str | None = None, *, rigs_own: bool) -> Law:
    """A law with its own gains, given those that the rig gives it; see `law_for`.

    Args:
        law: as it comes.
        rig: the file's contents.
        known: what the rig knows.
        preset: in place of the rig's.
        rigs_own: whether it is the law that the rig names.
    """
    gains = rig.control.gains if rigs_own else {}
    with _asked_for_by("the rig's control.gains"):
        law.with_gains(**gains)
    chosen = preset or (rig.control.preset if rigs_own else None)
    return configured(law, known, preset=chosen, gains=gains)


def _cable(section: schema.CableSection, rig: Path) -> tuple[BoucWen, float, list[str]]:
    """The cable, the factor on its play, and notes."""
    if section.model is not None:
        with _asked_for_by(f"{rig}: cable.model"):
            return _identified(rig.parent / section.model)
    cable = BoucWen(
        slope=section.slope,
        hysteresis_gain=section.hysteresis_gain_rad,
        rate=section.rate_per_rad,
        shape=section.shape,
        exponent=section.exponent,
        offset=section.offset_deg * RADIANS,
    )
    return cable, section.width, []


@contextlib.contextmanager
def _asked_for_by(key: str) -> Iterator[None]:
    """Say which key of which file led to a failure."""
    try:
        yield
    except BowdenError as error:
        do = error.do or "correct it there"
        raise type(error)(f"{key}: {error.what}", expected=error.expected, do=do) from error


def _identified(path: Path) -> tuple[BoucWen, float, list[str]]:
    from bowden.identify.cable.model_file import load_model

    cable, best = load_model(path, "bouc_wen").to_bouc_wen(), load_model(path).name
    if cable.slope == 0.0:
        raise ParameterError(f"{path}: the slope of bouc_wen is 0", do="identify a log in which the joint moves")
    if best == "bouc_wen":
        return cable, 1.0, []
    return cable, 1.0, [f"{path} recommends {best!r}; the bench runs the cable's bouc_wen model"]


def _bench(rig: schema.Rig, cable: BoucWen, width: float) -> Bench:
    encoders = [
        Encoder(encoder.resolution_deg * RADIANS, encoder.noise_deg * RADIANS)
        for encoder in (rig.encoder.joint, rig.encoder.motor)
    ]
    return Bench(
        cable=cable,
        sheath=Sheath(rig.sheath.bend_deg * RADIANS, width * rig.sheath.gap, rig.sheath.loss),
        servo=Servo(
            natural_frequency=rig.servo.natural_frequency_hz * schema.HERTZ,
            damping=rig.servo.damping,
            speed_limit=rig.servo.speed_limit_deg_per_s * RADIANS,
        ),
        motor=Motor(
            torque_constant=rig.motor.torque_constant_nm_per_a,
            resistance=rig.motor.resistance_ohm,
            gear=rig.motor.gear,
            inertia=rig.motor.inertia_kg_m2,
            spring=rig.motor.spring_nm_per_rad,
            pretension=rig.motor.pretension_nm,
            current_limit=rig.motor.current_limit_a,
        ),
        joint_encoder=encoders[0],
        motor_encoder=encoders[1],
        sample_time=rig.bench.sample_time_ms * schema.MILLISECONDS,
        delay=rig.bench.delay_cycles,
        substeps=rig.bench.substeps,
    )


def _begin(reference: Trajectory) -> float:
    return float(reference.sample(np.zeros(1))[0, 0])


def _resting(bench: Bench, begin: float, bend: BendPath) -> float:
    """The motor angle at which the joint is at `begin`, where the reference starts, with h = 0 [rad]."""
    slope = bench.cable.slope * float(slope_factor(float(bend(np.zeros(1))[0]), bench.sheath))
    return (begin - bench.cable.offset) / slope

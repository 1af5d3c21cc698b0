"""Logs of one simulated cable and its servo, as a laboratory would record them.

The cable is the paper's (Bouc–Wen), seen by encoders that count and are noisy. Under load its friction grows and it
gives way:

    αh(load) = αh(0) + αh′·load,    offset(load) = offset(0) + offset′·load

Source of the numbers that the paper does not have: chosen, of the size that the paper's bench and small tendon drives
show.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from bowden.control.reference import Chirp, Multisine
from bowden.core.kernel import floor, kernel
from bowden.core.units import DEGREES, HERTZ, RADIANS
from bowden.models.cable.bouc_wen import BoucWen
from bowden.models.cable.bouc_wen_sensitivity import hysteresis
from bowden.models.drive.encoder import Encoder
from bowden.models.drive.servo import Servo, ServoState, ServoStep, prepare, servo_step
from bowden.sim.samples.files import SampleFile, csv_text

Array = NDArray[np.float64]

CABLE = BoucWen(offset=-0.8 * RADIANS)
"""The paper's, with a joint whose zero is not quite the motor's."""
LOADS = {"low": 0.02, "mid": 0.06, "high": 0.12}
"""File → torque at its joint [N·m]."""
GAIN_AT_NO_LOAD, GAIN_PER_LOAD = -0.06, -0.6
"""αh without load [rad], and what a load adds to it [rad/(N·m)]."""
OFFSET_PER_LOAD = -0.25
"""[rad/(N·m)]"""
NEW_GAIN, NEW_OFFSET = 1.012, 0.7 * RADIANS
"""Of ``new.csv`` against ``log.csv``: the joint's encoder was mounted again; [–] and [rad]."""
SERVO = Servo()
SERVO_DELAY = 0.0024
"""From a command to the servo [s]."""
MOTOR, JOINT = (Encoder(resolution=counts * RADIANS, noise=0.01 * RADIANS) for counts in (0.022, 0.044))
COUNTS = (8192, 4000)
"""In a turn of the encoders of ``raw.csv``."""
_MOTION = Multisine(
    frequencies=(0.11, 0.29, 0.53),
    amplitudes=tuple(a * RADIANS for a in (27.0, 14.0, 7.0)),
    phases=tuple(a * RADIANS for a in (0.0, 90.0, 200.0)),
    centre=42.0 * RADIANS,
    ramp=2.0,
)
"""Of the motor: small loops within large ones, over more than the joint's 0 to 70° need."""
_CHIRP = Chirp(12.0 * RADIANS, 0.3, 12.0, 10.0)
_SUB_STEPS = 10


def cable_files(seed: int) -> dict[str, SampleFile]:
    """Name → file of the sample; the last one is the truth.

    Args:
        seed: of the encoders' noise.
    """
    random = np.random.default_rng(seed)
    files = {"log.csv": SampleFile(_log(40.0, 200.0, random), "a cable: time, motor and joint; 40 s at 200 Hz")}
    for name, load in LOADS.items():
        files[f"{name}.csv"] = SampleFile(_loaded(load, random), f"another cable under {load:g} N·m")
    new = _log(10.0, 200.0, random, NEW_GAIN, NEW_OFFSET)
    files["new.csv"] = SampleFile(new, "the cable of log.csv on another day, 10 s")
    files["raw.csv"] = SampleFile(_raw(random), "the same cable as counts of its encoders, without times; 1000 Hz")
    files["step.csv"] = SampleFile(_servo_log(random, "step"), "a servo: time, command and motor, steps")
    files["chirp.csv"] = SampleFile(_servo_log(random, "chirp"), "the same servo, a chirp; columns without units")
    files["cable.truth.toml"] = SampleFile(_truth(seed), "the numbers behind them, to compare with")
    return files


def joint_of(motor: Array, cable: BoucWen) -> Array:
    """Joint angle along a motion of the motor (n,) [rad], Eq. 6; the cable begins in the middle of its loop."""
    return cable.slope * motor + cable.hysteresis_gain * hysteresis(motor, 0.0, cable) + cable.offset


def loaded(load: float) -> BoucWen:
    """The cable of the logs under load, at one [N·m]."""
    gain, offset = GAIN_AT_NO_LOAD + GAIN_PER_LOAD * load, OFFSET_PER_LOAD * load
    return BoucWen(hysteresis_gain=gain, offset=offset)


@kernel
def follow(command: Array, late: float, prepared: ServoStep, sub_steps: int, motor: Array) -> None:
    """The motor (n,) of a servo at rest whose command comes `late` samples late, each sample in `sub_steps`."""
    state = ServoState(0.0, 0.0, 0.0)
    for k in range(len(command)):
        motor[k] = state.position
        for i in range(sub_steps):
            place = max(0, int(floor(k + (i + 0.5) / sub_steps - late)))
            state = servo_step(state, command[place], prepared)


def _seen(angle: Array, encoder: Encoder, random: np.random.Generator) -> Array:
    """What an encoder shows along a motion (n,) [rad]; as `bowden.models.drive.encoder.reading` does it."""
    noisy = angle + encoder.noise * random.normal(size=len(angle))
    return encoder.resolution * np.floor(noisy / encoder.resolution + 0.5)


def _log(duration: float, rate: float, random: np.random.Generator, gain: float = 1.0, offset: float = 0.0) -> str:
    time = np.arange(round(duration * rate)) / rate
    motor = _MOTION.sample(time)[:, 0]
    joint = gain * joint_of(motor, CABLE) + offset
    return _table(time, motor, joint, random)


def _table(time: Array, motor: Array, joint: Array, random: np.random.Generator, **more: tuple[Array, int]) -> str:
    seen = {
        "motor_deg": (DEGREES * _seen(motor, MOTOR, random), 3),
        "joint_deg": (DEGREES * _seen(joint, JOINT, random), 3),
    }
    return csv_text({"time_s": (time, 3)} | seen | more)


def _loaded(load: float, random: np.random.Generator) -> str:
    time = np.arange(2500) / 100.0
    motor = _MOTION.sample(time)[:, 0]
    torque = load + 0.0004 * random.normal(size=len(time))
    return _table(time, motor, joint_of(motor, loaded(load)), random, joint_torque_nm=(torque, 4))


def _raw(random: np.random.Generator) -> str:
    motor = _MOTION.sample(np.arange(40_000) / 1000.0)[:, 0]
    angles = {"motor": motor, "joint": joint_of(motor, CABLE)}
    noisy = {name: angle + MOTOR.noise * random.normal(size=len(angle)) for name, angle in angles.items()}
    turns = zip(noisy.items(), COUNTS, strict=True)
    return csv_text({name: (np.floor(angle / (2.0 * np.pi) * counts + 0.5), 0) for (name, angle), counts in turns})


def _servo_log(random: np.random.Generator, kind: str) -> str:
    dt = 1e-3
    if kind == "step":
        time = np.arange(3000, dtype=np.float64) * dt
        command = 20.0 * RADIANS * ((time > 0.3) * 1.0 - (time > 1.5) * 0.5)
    else:
        time = np.arange(10_000, dtype=np.float64) * dt
        command = _CHIRP.sample(time)[:, 0]
    motor = np.empty(len(time))
    follow(command, SERVO_DELAY / dt, prepare(SERVO, dt / _SUB_STEPS), _SUB_STEPS, motor)
    names = ("time_s", "command_deg", "motor_deg") if kind == "step" else ("time", "target", "motor")
    columns = ((time, 3), (DEGREES * command, 3), (DEGREES * _seen(motor, MOTOR, random), 3))
    return csv_text(dict(zip(names, columns, strict=True)))


def _truth(seed: int) -> str:
    def cable(one: BoucWen) -> str:
        fields: Mapping[str, float] = one._asdict()
        return "\n".join(f"{name} = {value:.6g}" for name, value in fields.items())

    under = "\n\n".join(
        f"[{name}]  # {name}.csv\nload_nm = {load:g}\n{cable(loaded(load))}" for name, load in LOADS.items()
    )
    return f"""\
# What is behind the simulated logs of bowden sample cable --seed {seed}: compare it with what is identified.
# Angles in radians, names as in the model.toml of bowden identify.

[log]  # log.csv and raw.csv: the paper's cable, Bouc-Wen
{cable(CABLE)}

[new]  # new.csv: the joint of log.csv, seen by an encoder that was mounted again
gain = {NEW_GAIN:g}
offset_deg = {NEW_OFFSET * DEGREES:.6g}

{under}

[servo]  # step.csv and chirp.csv
natural_frequency_hz = {SERVO.natural_frequency / HERTZ:.6g}
damping = {SERVO.damping:g}
delay_ms = {1e3 * SERVO_DELAY:g}

[encoders]  # of all but raw.csv, whose counts of a turn are {COUNTS[0]} and {COUNTS[1]}
motor_count_deg = {MOTOR.resolution * DEGREES:g}
joint_count_deg = {JOINT.resolution * DEGREES:g}
noise_deg = {MOTOR.noise * DEGREES:g}
"""

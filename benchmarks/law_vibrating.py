"""Whether a reference that vibrates carries our law's correction away: ``python benchmarks/law_vibrating.py``.

Its turns come before a wide dead zone is crossed, so that each crossing is given up for the next one. What the jumps
there and back leave must not add up. Plays of 0 to 0.6 rad behind the bench's servo, whose width is given between 0 and
1.2 times what it is, or not at all (a fifth of them); a joint that moves 0.6 to 1.5 times as far as was given; readings
with noise of 0, 0.2 or 1 mrad; references of 0.5 to 25 Hz and 0.06 to 36° from turn to turn, for 8 s. See
docs/background/our_law.md.
"""

import argparse
import json

import numpy as np

from bowden.control import LAWS
from bowden.control.our_law.gains import BowdenGains
from bowden.control.our_law.law import start, step
from bowden.core.kernel import compiled, kernel
from bowden.core.signals import Reference, Sample
from bowden.core.units import DEGREES
from bowden.models.drive.servo import Servo, ServoState, ServoStep, prepare, servo_step

DT, SECONDS, WIDEST = 1e-3, 8.0, 0.6
QUANTILES = (0.5, 0.95, 1.0)
GAINS: BowdenGains = LAWS["bowden"].gains


@kernel
def carried(
    gains: BowdenGains,
    servo: ServoStep,
    reference: np.ndarray,
    noise: np.ndarray,
    width: float,
    slope: float,
    dt: float,
) -> tuple[float, float]:
    """Largest correction in the last second [rad], and RMS of the error in the second half [rad]."""
    motor, joint, target, most, squares = ServoState(0.0, 0.0, 0.0), 0.0, 0.0, 0.0, 0.0
    state, count = start(gains, Sample(0.0, 0.0)), len(reference)
    for k in range(count):
        position, velocity, acceleration = reference[k]
        wanted = Reference(position, velocity, acceleration)
        state, command = step(gains, state, Sample(joint + noise[k], motor.position), wanted, dt)
        motor = servo_step(motor, target, servo)
        target = command
        joint = max(slope * (motor.position - width), min(slope * motor.position, joint))
        if k * dt > count * dt - 1.0:
            most = max(most, abs(state.observer.requested))
        if 2 * k >= count:
            squares += (joint - position) ** 2
    return most, np.sqrt(2.0 * squares / count)


def drawn(number: int) -> tuple[float, float]:
    """What `carried` gives for a draw, which is made from its number."""
    random = np.random.default_rng((20261126, number))
    width = random.uniform(0.0, WIDEST)
    given = random.choice([0.0, 1.0], p=[0.2, 0.8]) * random.uniform(0.0, 1.2) * width
    rate = 2.0 * np.pi * 10.0 ** random.uniform(np.log10(0.5), np.log10(25.0))
    amplitude, slope = 10.0 ** random.uniform(np.log10(5e-4), np.log10(0.316)), random.uniform(0.6, 1.5)
    phase = rate * np.arange(0.0, SECONDS, DT)
    reference = amplitude * np.column_stack([1.0 - np.cos(phase), rate * np.sin(phase), rate**2 * np.cos(phase)])
    noise = random.choice([0.0, 2e-4, 1e-3]) * random.standard_normal(len(phase))
    servo = prepare(Servo(speed_limit=1000.0), DT)
    gains = GAINS._replace(width=min(given, WIDEST))
    return compiled(carried)(gains, servo, reference, noise, width, slope, DT)


def main() -> None:
    """Print how far the correction went."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--json", action="store_true", help="one JSON document, nothing else")
    parser.add_argument("--count", type=int, default=3000, help="of draws")
    asked = parser.parse_args()
    found = np.array([drawn(number) for number in range(asked.count)])
    document = {
        "draws": asked.count,
        "beyond_two_dead_zones": int(np.sum(found[:, 0] > 2.0 * WIDEST)),
        "largest_correction_rad": float(found[:, 0].max()),
        "rmse_deg": (np.quantile(found[:, 1], QUANTILES) * DEGREES).tolist(),
    }
    print(json.dumps(document) if asked.json else "\n".join(f"{name}: {value}" for name, value in document.items()))


if __name__ == "__main__":
    main()

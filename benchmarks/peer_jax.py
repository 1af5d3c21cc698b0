"""The same sampled loop written in JAX, with diffrax between the samples, against one minute of ours."""

from importlib.metadata import version
from importlib.util import find_spec
from typing import Any

import numpy as np

from bowden.records.metrics import rmse
from bowden.sim.run import simulate
from measure import Row, Timing, by_turns
from peer_control import BENCH, LAW, REFERENCE

DURATION = 60.0
REPEATS = 20
WHAT = "a minute against JAX and diffrax"


def rows(rounds: int = 5) -> tuple[list[Row], list[str]]:
    """The comparison's row and note.

    Raises:
        RuntimeError: the two do not agree: they did not do the same work.
    """
    if find_spec("jax") is None or find_spec("diffrax") is None:
        return [Row(WHAT, "", "", "skipped: pip install jax diffrax", "", "")], []
    loop, references = _loop()
    trace = simulate(BENCH, LAW, REFERENCE, duration=DURATION)
    difference = rmse(np.asarray(loop(references)) - trace["reference"]) / rmse(trace.error) - 1.0
    if not abs(difference) < 0.03:
        raise RuntimeError(f"JAX's RMSE is {100 * difference:+.1f} % off ours: not the same work")
    timings = by_turns(rounds, ours=_ours, peer=lambda: loop(references).block_until_ready())
    ours = Timing(tuple(seconds / REPEATS for seconds in timings["ours"].seconds))
    note = (
        f"JAX {version('jax')}, diffrax {version('diffrax')}, on the processor: `lax.scan` over the cycles, "
        "one step of Tsit5 for the three states of the plant in each, compiled beforehand; it records the joint alone. "
        f"RMSE {100 * difference:+.2f} % of ours."
    )
    return [Row(WHAT, ours, timings["peer"], timings["peer"].over(ours), "× faster", "–")], [note]


def _loop() -> tuple[Any, Any]:
    """The compiled loop, from references (n, 2) to joint angles (n,), and the references."""
    import diffrax
    import jax
    import jax.numpy as jnp

    jax.config.update("jax_enable_x64", True)
    cable, servo, gains, dt = BENCH.cable, BENCH.servo, LAW.gains, BENCH.sample_time
    height, width = cable.hysteresis_gain * BENCH.sheath.gap, BENCH.sheath.gap
    omega, zeta, shape = servo.natural_frequency, servo.damping, cable.shape

    def rates(_: Any, x: Any, command: Any) -> Any:
        u, h = x[1] / width, x[2]
        size = jnp.abs(h) ** 3
        bent = shape * jnp.abs(u) * jnp.sign(h) * size + (shape - 1.0) * u * size
        return jnp.stack([x[1], omega**2 * (command - x[0]) - 2.0 * zeta * omega * x[1], cable.rate * (u - bent)])

    solver, term = diffrax.Tsit5(), diffrax.ODETerm(rates)

    def cycle(carry: Any, reference: Any) -> tuple[Any, Any]:
        x, integral, inverse, bound, last, rate, applied = carry
        joint = cable.slope * x[0] + height * x[2]
        error = joint - reference[0]
        integral = integral + error * dt
        rate = rate + ((joint - last) / dt - rate) * dt / (gains.derivative_time + dt)
        s = gains.error_gain * error + integral
        direction = jnp.tanh(s / gains.smoothing)
        wanted = reference[0] - gains.error_gain * (rate - reference[1]) - bound * direction
        command = inverse * wanted - gains.feedback_gain * s
        grown = inverse - dt * gains.slope_adaptation * (wanted * s + gains.slope_leakage * inverse)
        bound = bound + dt * gains.bound_adaptation * (inverse * direction * s - gains.bound_leakage * bound)
        first = solver.init(term, 0.0, dt, x, applied)
        x, _, _, _, _ = solver.step(term, 0.0, dt, x, applied, first, made_jump=False)
        return (x, integral, grown, bound, joint, rate, command), joint

    start = (jnp.zeros(3), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    start = tuple(jnp.asarray(value, dtype=jnp.float64) for value in start)
    motion = REFERENCE.sample(np.arange(round(DURATION / dt)) * dt)
    references = jnp.asarray(np.ascontiguousarray(motion[:, :2]))
    assert BENCH.delay == 1
    return jax.jit(lambda given: jax.lax.scan(cycle, start, given)[1]), references


def _ours() -> None:
    for _ in range(REPEATS):
        simulate(BENCH, LAW, REFERENCE, duration=DURATION)

"""The exported EMG detector and safety gate give the bits of Python's."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from bowden.core.errors import ParameterError
from bowden.core.kernel import compiled, kernel
from bowden.core.nested import flat, unflatten
from bowden.core.signals import DriveReading
from bowden.export.modules import emg_modules, safety_module
from bowden.export.unit import Module
from bowden.models.drive.thermal import ThermalState, cold
from bowden.safety.faults import Fault, Reaction
from bowden.safety.limits import Limits
from bowden.safety.state import Mode, Observed, PreflightResult, Request, Verdict
from bowden.safety.supervisor import begin, supervise
from bowden.sensing.intent import IntentSettings, intent_start, intent_step
from bowden.sensing.stream import EnvelopeFilter, OnsetDetector
from exported import muscle
from support.exported_c import COMPILER, Exported, bits

pytestmark = pytest.mark.skipif(COMPILER is None, reason="no C compiler")
Array = NDArray[np.float64]
DT = 1e-3


def exported_emg(rate: float, values: Array, folder: Path, *, single: bool = False) -> Array:
    """Of each sample the signal, its envelope, 1 in a contraction, the trouble, and rest."""
    rows = np.column_stack([np.arange(len(values)) == 0, values])
    envelope, onset = emg_modules(rate)
    chain = Exported(envelope, "step", "envelope_start(&state, value)", folder, single=single).over(rows)
    found = Exported(onset, "step", "onset_start(&state)", folder, single=single).over(rows)
    return np.column_stack([chain[:, -2:], found[:, -2:], found[:, -3]])


@pytest.mark.parametrize("rate", [1925.93, *(pytest.param(other, marks=pytest.mark.long) for other in (900.0, 5000.0))])
def test_exported_detector_gives_the_bits_of_python(rate: float, tmp_path: Path) -> None:
    values = muscle(rate, 100_000)
    found = exported_emg(rate, values, tmp_path)
    enveloped, detected = EnvelopeFilter(rate).feed(values), OnsetDetector(rate).feed(values)
    assert detected.active.any()
    assert {0.0, 1.0} <= set(detected.trouble)
    assert (bits(found) == bits(np.column_stack([*enveloped, *detected]))).all()


def test_detector_in_float_finds_the_same_contractions(tmp_path: Path) -> None:
    rate = 2000.0
    values = muscle(rate, 60_000)
    found = exported_emg(rate, values, tmp_path, single=True)[:, 2]
    active = OnsetDetector(rate).feed(values).active
    begins, ends = (np.flatnonzero(np.diff(one, prepend=0.0) > 0.5) for one in (active, found))
    assert len(begins) == len(ends) >= 6
    assert np.abs(begins - ends).max() <= 0.01 * rate  # a third of the evidence that an onset needs


def test_a_rate_that_the_detector_does_not_take_is_refused() -> None:
    for rate in (899.0, 5001.0, float("nan")):
        with pytest.raises(ParameterError, match="from 900 to 5000 Hz"):
            emg_modules(rate)


def drives(count: int) -> Iterator[tuple[float, Observed, float]]:
    """Runs of 400 cycles: armed, running, then with a wild number now and then, acknowledged at the end."""
    random = np.random.default_rng(5)
    wild = [0.0, -0.0, np.nan, np.inf, -np.inf, 1e9, -3.0, 5e-324]
    for k in range(count):
        n = k % 400
        angle = 0.3 * np.sin(6e-3 * max(0, n - 40))
        state = 4.0 if n > 8 else 2.0
        request = {5: Request.ARM, 30: Request.RUN, 396: Request.ACKNOWLEDGE}.get(n, Request.NONE)
        reading = [
            angle,
            0.9 * angle,
            1.0,
            20.0,
            30.0,
            0.0,
            0.0,
            0.001,
            state,
            0.0,
            0.0,
            0.0,
            1e-3,
            2.0,
            0.1,
            0.02,
            0.0,
        ]
        values = [*reading, 1e-5, DT, 0.01, 0.02, angle + 0.01]
        recorder, preflight = True, PreflightResult.PASSED if n > 20 else PreflightResult.PENDING
        if n > 150 and random.random() < 0.02:
            values[random.integers(len(values))] = float(random.choice(wild))
        if n > 150 and random.random() < 0.002:
            recorder, preflight = bool(random.random() < 0.5), PreflightResult.FAILED
        others = {300: Reaction.R2, 350: Reaction.R3}.get(n if k // 400 % 3 == 2 else -1, Reaction.NONE)
        neighbour = {200: angle + 9.0, 210: np.nan}.get(n, angle if n < 250 or k // 400 % 3 else angle - 1.0)
        reference = {60: np.nan, 330: np.inf}.get(n, 0.9 * angle + (0.6 if n % 120 < 40 and k // 400 % 4 == 1 else 0.0))
        lateness, elapsed, operator_age, emg_age, requested = values[17:]
        observed = Observed(
            DriveReading(*values[:17]), lateness, elapsed, request, operator_age, recorder, preflight, emg_age
        )
        yield float(n == 0), observed._replace(others=others, neighbour=neighbour, reference=reference), requested


@kernel
def run_gate(limits: Limits, warmth: ThermalState, observed: Observed, rows: Array, out: Array) -> None:
    state = begin(limits, observed.reading, warmth)
    for k in range(len(rows)):
        observed = unflatten(observed, rows[k, 1:])
        if rows[k, 0] != 0.0:
            state = begin(limits, observed.reading, warmth)
        state, verdict = supervise(limits, state, observed, rows[k, -2], rows[k, -1])
        numbers = flat((state, verdict))
        for j in range(len(numbers)):
            out[k, j] = numbers[j]


@pytest.mark.parametrize("count", [20_000, pytest.param(100_000, marks=pytest.mark.long)])
def test_exported_gate_gives_the_bits_of_python(count: int, tmp_path: Path) -> None:
    """Of all cycles compiled, and of the first 800 in plain Python."""
    limits, cycles = (
        Limits(
            **dict.fromkeys(
                ("measures_temperature", "measures_tension", "measures_torque", "uses_emg", "shared"), True
            ),
            off_reference_time=0.03,
        ),
        list(drives(count)),
    )
    rows = np.array(
        [[anew, *flat(observed), requested_target, DT] for anew, observed, requested_target in cycles], dtype=float
    )
    start = "safety_ThermalState warmth; safety_cold(&warmth); safety_begin(&state, &observed.reading, &warmth)"
    found = Exported(safety_module(limits), "supervise", start, tmp_path).over(rows)
    expected, warmth = np.empty_like(found), cold(limits.thermal)
    compiled(run_gate)(limits, warmth, cycles[0][1], rows, expected)
    state = begin(limits, cycles[0][1].reading, warmth)
    for (anew, observed, requested_target), row in zip(cycles[:800], expected, strict=False):
        state = begin(limits, observed.reading, warmth) if anew else state
        with np.errstate(all="ignore"):
            state, verdict = supervise(limits, state, observed, requested_target, DT)
        assert (bits(flat((state, verdict))) == bits(row)).all()
    modes = set(expected[:, Verdict._fields.index("mode") - len(Verdict._fields)])
    assert {float(mode) for mode in Mode} <= modes
    assert (expected[:, -1].astype(np.int64) >> Fault.JOINT_OFF_REFERENCE & 1).any()
    assert (bits(found) == bits(expected)).all()


@pytest.mark.long
def test_the_intent_of_two_muscles_that_overlap_gives_the_bits_of_python(tmp_path: Path) -> None:
    state, two = intent_start(0.0), IntentSettings(muscles=2)
    functions = {"start": (intent_start, "state"), "step": (intent_step, "state reference")}
    module = Module("intent", "", functions, {"settings": (two, "")})
    time = np.arange(12000) * DT
    on = np.column_stack([time % 3.1 < 1.2, (time + 2.3) % 3.1 < 1.2])
    rows = np.column_stack([np.arange(12000) == 0, on, np.full(12000, DT)])
    found = Exported(module, "step", "intent_start(&state, 0.0)", tmp_path).over(rows)
    twin, late = compiled(intent_step), 0
    for k, row in enumerate(found):
        state, reference = twin(two, state, *on[k].tolist(), DT)
        assert (bits(flat((state, reference))) == bits(row)).all(), k
        late += state.late != 0
    assert late > 500
    assert np.ptp(found[:, -3]) > 1.0

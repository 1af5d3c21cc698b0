"""The exported EMG detector and safety gate give the bits of Python's."""

import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from bowden.core.errors import ParameterError
from bowden.core.kernel import compiled
from bowden.core.nested import flat
from bowden.core.signals import DriveReading
from bowden.export.checked import Argument, Function
from bowden.export.code import Style
from bowden.export.layout import leaves
from bowden.export.module import Module, files
from bowden.export.parts import emg_modules, safety_module
from bowden.export.readme import FLAGS
from bowden.models.drive.thermal import ThermalState, cold
from bowden.safety.faults import Fault
from bowden.safety.limits import Limits
from bowden.safety.state import Mode, Observed, Request, Verdict
from bowden.safety.supervisor import begin, supervise
from bowden.sensing.intent import IntentSettings, intent_start, intent_step
from bowden.sensing.stream import EnvelopeFilter, OnsetDetector
from detector import muscle
from support.states import floated

pytest.importorskip("casadi", reason="casadi, of the extra export, is not installed")
COMPILER = shutil.which("cc")
pytestmark = pytest.mark.skipif(COMPILER is None, reason="no C compiler")
Array = NDArray[np.float64]
DT = 1e-3

DETECT = """#include <stdio.h>
#include "envelope.h"
#include "onset.h"
int main(void)
{
    static envelope_state envelope;
    static onset_state onset;
    double value;
    for (long k = 0; fread(&value, 8, 1, stdin) == 1; ++k) {
        envelope_real signal;
        onset_real trouble;
        double out[5];
        if (k == 0) {
            envelope_start(&envelope, (envelope_real)value);
            onset_start(&onset, (onset_real)value);
        }
        out[1] = (double)envelope_step(&envelope, (envelope_real)value, &signal);
        out[0] = (double)signal;
        out[2] = (double)onset_step(&onset, (onset_real)value, &trouble);
        out[3] = (double)trouble;
        out[4] = (double)onset.rest;
        fwrite(out, sizeof out, 1, stdout);
    }
    return 0;
}
"""

GATE = """#include <stdio.h>
#include "safety.h"
int main(void)
{
    static safety_state state;
    double row[27];
    while (fread(row, 8, 27, stdin) == 27) {
        safety_observed observed;
        safety_verdict verdict;
@OBSERVED@
        if (row[0] != 0.0) {
            safety_thermal_state warmth;
            safety_cold(&warmth);
            safety_begin(&state, &observed.reading, &warmth);
        }
        safety_supervise(&state, &observed, row[25], row[26], &verdict);
        fwrite(&state, sizeof state, 1, stdout);
        fwrite(&verdict, sizeof verdict, 1, stdout);
    }
    return 0;
}
"""


def run(modules: tuple[Module, ...], main: str, rows: Array, folder: Path, *, single: bool = False) -> Array:
    for module in modules:
        for name, text in files(module, Style(module.prefix, single), "for a test").items():
            (folder / name).write_text(text, encoding="utf-8")
    (folder / "main.c").write_text(main)
    sources = [f"{module.prefix}.c" for module in modules]
    subprocess.run([str(COMPILER), *FLAGS.split(), *sources, "main.c", "-o", "main", "-lm"], cwd=folder, check=True)
    done = subprocess.run([folder / "main"], input=rows.tobytes(), capture_output=True, check=True, timeout=60)
    return np.frombuffer(done.stdout).reshape(len(rows), -1)


def bits(values: Array) -> NDArray[np.int64]:
    array = np.array(values, dtype=np.float64)
    array[np.isnan(array)] = np.nan
    return array.view(np.int64)


@pytest.mark.parametrize("rate", [1925.93, *(pytest.param(other, marks=pytest.mark.long) for other in (900.0, 5000.0))])
def test_exported_detector_gives_the_bits_of_python(rate: float, tmp_path: Path) -> None:
    values = muscle(rate, 40_000)
    found = run(emg_modules(rate), DETECT, values, tmp_path)
    enveloped, detected = EnvelopeFilter(rate).feed(values), OnsetDetector(rate).feed(values)
    assert detected.active.any()
    assert {0.0, 1.0} <= set(detected.trouble)
    assert (bits(found) == bits(np.column_stack([*enveloped, *detected]))).all()


def test_detector_in_float_finds_the_same_contractions(tmp_path: Path) -> None:
    rate = 2000.0
    values = muscle(rate, 60_000)
    found = run(emg_modules(rate), DETECT, values, tmp_path, single=True)[:, 2]
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
        reading = [angle, 0.9 * angle, 1.0, 20.0, 30.0, 0.0, 0.0, 0.001, state, 0.0, 0.0, 0.0, 1e-3, 2.0]
        rest = [1e-5, DT, float(request), 0.01, 1.0, float(n > 20), 0.02, angle + 0.01]
        values = [*reading, *rest]
        if n > 150 and random.random() < 0.02:
            values[random.integers(len(values))] = float(random.choice(wild))
        others = {300: 2.0, 320: np.nan, 350: 3.0}.get(n if k // 400 % 3 == 2 else -1, 0.0)
        opposite = {200: angle + 9.0, 210: np.nan}.get(n, angle if n < 250 or k // 400 % 3 else angle - 1.0)
        reference = {60: np.nan, 330: np.inf}.get(n, 0.9 * angle + (0.6 if n % 120 < 40 and k // 400 % 4 == 1 else 0.0))
        rest = others, opposite, reference
        yield float(n == 0), Observed(DriveReading(*values[:14]), *values[14:21], *rest), values[21]


def test_exported_gate_gives_the_bits_of_python(tmp_path: Path) -> None:
    limits, cycles = (
        Limits(
            **dict.fromkeys(("measures_temperature", "measures_tension", "measures_torque", "uses_emg", "paired"), 1.0),
            off_reference_time=0.03,
        ),
        list(drives(4000)),
    )
    numbers = [[anew, *observed.reading, *observed[1:], wish, DT] for anew, observed, wish in cycles]
    filled = [leaf.access("observed").replace("->", ".") for leaf in leaves(cycles[0][1])]
    main = GATE.replace("@OBSERVED@", "\n".join(f"{name} = row[{k + 1}];" for k, name in enumerate(filled)))
    found = run((safety_module(limits),), main, np.array(numbers, dtype=float), tmp_path)
    warmth = ThermalState(*map(float, cold(limits.thermal)))
    twin, state, expected = compiled(supervise), None, []
    plain = begin(limits, cycles[0][1].reading, warmth)
    for k, (anew, observed, wish) in enumerate(cycles):
        if anew:
            begun = begin(limits, observed.reading, warmth)
            state = plain = floated(begun)
        state, verdict = twin(limits, state, observed, wish, DT)
        expected.append([*flat(state), *verdict])
        if k < 800:
            with np.errstate(all="ignore"):
                plain, said = supervise(limits, plain, observed, wish, DT)
            assert (bits(np.array([*flat(plain), *said], dtype=float)) == bits(np.array(expected[-1]))).all()
    rows = np.array(expected)
    modes = set(rows[:, -len(Verdict._fields) + Verdict._fields.index("mode")])
    assert {float(mode) for mode in Mode} <= modes
    assert (rows[:, -1] // 2.0**Fault.JOINT_OFF_REFERENCE % 2.0 == 1.0).any()
    assert (bits(found) == bits(rows)).all()


INTENT = """#include <stdio.h>
#include "intent.h"
int main(void)
{
    static intent_state state;
    double row[2];
    intent_start(&state, 0.0);
    while (fread(row, 8, 2, stdin) == 2) {
        intent_reference reference;
        intent_step(&state, row[0], row[1], 0.001, &reference);
        double out[5] = {state.mode, state.owed, reference.position, reference.velocity, reference.acceleration};
        fwrite(out, sizeof out, 1, stdout);
    }
    return 0;
}
"""


@pytest.mark.long
def test_the_intent_of_two_muscles_that_overlap_gives_the_bits_of_python(tmp_path: Path) -> None:
    state, two = intent_start(0.0), IntentSettings(muscles=2.0)
    module = Module(
        "intent",
        "",
        (
            Function("start", intent_start, (Argument("position", 0.0),), ("state",), ""),
            Function(
                "step",
                intent_step,
                (
                    Argument("settings", two, constant=True),
                    *(Argument("state", state), Argument("flexor", 0.0), Argument("extensor", 0.0)),
                    Argument("dt", DT),
                ),
                ("state", "reference"),
                "",
            ),
        ),
        structs={"state": "state"},
    )
    time = np.arange(12000) * DT
    on = np.column_stack([time % 3.1 < 1.2, (time + 2.3) % 3.1 < 1.2]).astype(np.float64)
    on[3000:3010] = np.nan
    rows = run((module,), INTENT, on, tmp_path)
    twin, owed = compiled(intent_step), 0
    for k, row in enumerate(rows):
        state, reference = twin(two, state, on[k, 0], on[k, 1], DT)
        assert (bits(np.array([state.mode, state.owed, *reference])) == bits(row)).all(), k
        owed += state.owed != 0.0
    assert owed > 500
    assert np.ptp(rows[:, 2]) > 1.0

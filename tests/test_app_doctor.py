"""`bowden doctor`: figures of this machine that make sense, and readers of what other programs and kernels say."""

import os
from pathlib import Path

import numpy as np
import pytest

from bowden.app.main import run
from bowden.core.errors import ParameterError
from bowden.hardware.realtime import check_processor
from bowden.live.machine import EDGES_US, figures, histogram, look
from support.command import Command


def test_the_document_is_as_its_schema_and_the_process_is_left_as_it_was(command: Command) -> None:
    policy, processors = os.sched_getscheduler(0), os.sched_getaffinity(0)
    found = command.document("doctor --seconds 0.3")
    assert found["lateness"]["cycles"] == sum(bucket["cycles"] for bucket in found["histogram"]) == 300
    assert 0.0 < found["lateness"]["p50_us"] <= found["lateness"]["p99_us"] <= found["lateness"]["max_us"]
    assert (os.sched_getscheduler(0), os.sched_getaffinity(0)) == (policy, processors)


def test_it_tells_a_person(command: Command) -> None:
    out = command("doctor --seconds 0.2 --priority 0").out
    assert "lateness of" in out
    assert "CAN" in out


@pytest.mark.parametrize("options", [["--seconds", "0"], ["--priority", "100"], ["--cpu", "4096"]])
def test_what_makes_no_sense_is_refused(options: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["doctor", *options]) == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 1


def test_a_processor_that_is_not_ours_is_refused() -> None:
    with pytest.raises(ParameterError, match="cpu is 4096"):
        check_processor(4096, "--cpu")


def test_percentiles_and_histogram_are_those_of_the_numbers() -> None:
    late = np.linspace(0.0, 1e-3, 10_001)
    found = figures(late)
    assert (found.p50_us, found.p99_us, found.max_us) == pytest.approx((500.0, 990.0, 1000.0))
    counts = histogram(np.array([4e-6, 6e-6, 6e-6, 1.0]))
    assert counts[:2] == [1, 2]
    assert counts[-1] == 1
    assert len(counts) == len(EDGES_US) + 1


def test_a_machine_is_read_from_proc_and_sys(tmp_path: Path) -> None:
    for name, text in {
        "proc/sys/kernel/version": "#1 SMP PREEMPT_RT Debian",
        "proc/sys/kernel/osrelease": "6.1.0-rt",
        "sys/class/net/can0/type": "280",
        "sys/class/net/can0/operstate": "up",
        "sys/class/net/eth0/type": "1",
        "sys/devices/system/cpu/isolated": "1,3-4",
    }.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text + "\n")
    found = look(tmp_path)
    assert found.real_time
    assert found.can == {"can0": "up"}
    assert found.isolated == (1, 3, 4)
    assert found.clock_source == "unknown"

"""One long run against a twin: memory, descriptors and threads of each of its processes, and what ended it."""

import contextlib
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from measure import Figure

RIG = "[scenario]\nduration_s = {seconds}\n[limits]\nreading_age = 10.0\nlateness_s = 0.04\n"
SETTLED = 60.0
"""By then everything is loaded, and from then on nothing may grow [s]."""
EVERY = 2.0
"""[s]"""
MOST_GROWTH = 4.0
"""Of a process' resident memory: the allocator's own waves [MB]."""
ROLES = {"loop": "loop_process", "recorder": "live.recorder", "twin": "until-orphaned"}


def figures(minutes: float) -> tuple[list[Figure], str]:
    """Growth over one run of so many minutes, after its first."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "rig.toml").write_text(RIG.format(seconds=60.0 * minutes))
        words = [sys.executable, "-c", "from bowden.app.main import main; main()", "run", "rig.toml", "--twin"]
        words += ["--auto", "--json", "--out", str(folder / "out")]
        run = subprocess.Popen(words, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        samples: dict[str, list[tuple[float, float, int, int]]] = {}
        begun = time.monotonic()
        while run.poll() is None and time.monotonic() < begun + 60.0 * minutes + 120.0:
            for role, pid in {"operator": run.pid, **_children(run.pid)}.items():
                with contextlib.suppress(OSError, ValueError, StopIteration):  # it has just ended
                    samples.setdefault(role, []).append((time.monotonic() - begun, *state_of(pid)))
            time.sleep(EVERY)
        said, errors = run.communicate(timeout=60.0)
    found = json.loads(said) if said else {"ended_well": False, "faults": [errors.strip()], "cycles": 0, "overruns": 0}
    shown = []
    for role, values in samples.items():
        last = values[-1][0] - 5.0  # at the end they write, and go
        later = [value for value in values if SETTLED <= value[0] <= last] or values
        memory, files, threads = ([value[i] for value in later] for i in (1, 2, 3))
        grown = sum(memory[-5:]) / len(memory[-5:]) - sum(memory[:5]) / len(memory[:5])
        held = grown <= MOST_GROWTH and max(files) == min(files) and max(threads) == min(threads)
        text = f"{memory[0]:.0f} MB and {grown:+.2f} MB; {min(files)}–{max(files)}; {min(threads)}–{max(threads)}"
        target = f"≤ {MOST_GROWTH:g} MB more; the same; the same"
        shown.append(Figure(f"{role}: memory, descriptors, threads", text, target, held))
    ended = f"{found['cycles']} cycles, {found['overruns']} skipped, faults: {', '.join(found['faults']) or 'none'}"
    shown.append(Figure(f"a run of {minutes:g} min", ended, "no fault", bool(found["ended_well"])))
    return shown, f"- `bowden run --twin --auto`, looked at every {EVERY:g} s, from {SETTLED:g} s on."


def _children(parent: int) -> dict[str, int]:
    found = {}
    with contextlib.suppress(OSError):
        for thread in Path(f"/proc/{parent}/task").iterdir():
            for child in (thread / "children").read_text().split():
                said = Path(f"/proc/{child}/cmdline").read_text()
                found |= {role: int(child) for role, word in ROLES.items() if word in said}
    return found


def state_of(pid: int) -> tuple[float, int, int]:
    """Resident memory [MB], descriptors, threads."""
    lines = (line.split() for line in Path(f"/proc/{pid}/status").read_text().splitlines())
    said = {words[0]: int(words[1]) for words in lines if words[0] in ("VmRSS:", "Threads:")}
    return said["VmRSS:"] / 1024.0, len(list(Path(f"/proc/{pid}/fd").iterdir())), said["Threads:"]

"""What this machine can do, in a terminal."""

from typing import TYPE_CHECKING

from bowden.core.errors import counted
from bowden.views.text import Call

if TYPE_CHECKING:
    from bowden.operations.doctor import Diagnosis


def show_doctor(found: "Diagnosis", call: Call) -> None:
    """Kernel, privileges, lateness, buses, streams, and what to change."""
    late = found.lateness
    print(f"kernel      {found.kernel.release}, {found.kernel.preemption}")
    print(f"clock       {found.clock_source}; processors {', '.join(map(str, found.processors))}")
    for grant in (*found.privileges, *found.granted):
        print(f"{'may' if grant.granted else 'MAY NOT':11} {grant.name}: {grant.said}")
    print(f"\nlateness of {late.cycles} wakings, one in {found.period_ms:g} ms")
    for name, row in (("bare loop", late), ("cyclictest", found.cyclictest)):
        if row is None:
            print("  cyclictest  not installed, or no real-time priority")
            continue
        shares = f"p50 {row.p50_us:.0f}  p99 {row.p99_us:.0f}  p99.9 {row.p999_us:.0f}  max {row.max_us:.0f} µs"
        print(f"  {name:10}  {shares}")
    most = max(bucket.cycles for bucket in found.histogram)
    for bucket in found.histogram:
        if bucket.cycles:
            edge = "above" if bucket.up_to_us is None else f"≤ {bucket.up_to_us:g}"
            print(f"  {edge:>7} µs {bucket.cycles:8d} {'█' * max(1, round(40 * bucket.cycles / most))}")
    interfaces, emg = found.can.interfaces, found.emg
    print(f"\nCAN         {', '.join(f'{name} ({state})' for name, state in interfaces.items()) or 'none'}")
    count = len(emg.streams)
    print(f"EMG         {emg.problem or ('no stream' if not count else f'{count} of LSL')}")
    for one in emg.streams:
        said = one.problem or f"{counted(one.channels, 'channel')}, {one.rate_hz:g} Hz"
        print(f"            lsl:{one.name}#{one.source_id} of {one.host}: {said}")
    print("\nWhat to change:" if found.advice else "\nNothing to change.")
    for line in found.advice:
        print(f"- {line}")

"""What this machine can do, in a terminal."""

from bowden.core.errors import counted
from bowden.operations.doctor import Diagnosis
from bowden.views.text import Call


def show_doctor(found: Diagnosis, call: Call) -> None:
    """Kernel, privileges, lateness, buses, streams, and what to change."""
    late, here = found.lateness, found.machine
    print(f"kernel      {here.release}, {here.preemption}")
    print(f"clock       {here.clock_source}; processors {', '.join(map(str, here.processors))}")
    for grant in (*found.privileges, *found.granted):
        print(f"{'may' if grant.granted else 'MAY NOT':11} {grant.name}: {grant.detail}")
    print(f"\nlateness of {late.cycles} wakings, one in {found.period_ms:g} ms")
    print(f"  p50 {late.p50_us:.0f}  p99 {late.p99_us:.0f}  p99.9 {late.p999_us:.0f}  max {late.max_us:.0f} µs")
    most = max(bucket.cycles for bucket in found.histogram)
    for bucket in found.histogram:
        if bucket.cycles:
            edge = "above" if bucket.up_to_us is None else f"≤ {bucket.up_to_us:g}"
            print(f"  {edge:>7} µs {bucket.cycles:8d} {'█' * max(1, round(40 * bucket.cycles / most))}")
    interfaces, emg = here.can, found.emg
    print(f"\nCAN         {', '.join(f'{name} ({state})' for name, state in interfaces.items()) or 'none'}")
    count = len(emg.streams)
    print(f"EMG         {emg.problem or ('no stream' if not count else f'{count} of LSL')}")
    for one in emg.streams:
        said = one.problem or f"{counted(one.channels, 'channel')}, {one.rate_hz:g} Hz"
        print(f"            lsl:{one.name}#{one.source_id} of {one.host}: {said}")
    print("\nWhat to change:" if found.advice else "\nNothing to change.")
    for line in found.advice:
        print(f"- {line}")

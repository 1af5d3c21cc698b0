"""What an export wrote, in a terminal."""

import shlex

from bowden.operations.export import Exported
from bowden.views.text import Call


def show_export(found: Exported, call: Call) -> None:
    """The files, what the law costs on a microcontroller, and what comes next."""
    print(f"{found.law} in {found.precision}: {', '.join(file.name for file in found.files)}")
    cost, soft = found.cortex_m4f, ", which is software there" if found.precision == "double" else ""
    if cost is None:
        print("Cortex-M4F: not measured; that needs gcc-arm-none-eabi, libnewlib-arm-none-eabi and qemu-system-arm")
    else:
        print(
            f"The law alone on an emulated Cortex-M4F, in {found.precision}{soft}: {cost.code_bytes} bytes of code, "
            f"{cost.state_bytes} of state, {cost.stack_bytes} of "
            f"stack, {cost.instructions_mean:.0f} instructions a cycle ({cost.instructions_max:.0f} at most); "
            f"commands within {cost.furthest_rad:.2g} rad of Python's"
        )
    print(f"Wrote {call['folder']}  ({call.seconds:.1f} s)")
    print(f"Next: {shlex.join(['make', '-C', str(call['folder']), 'check'])}  # replays a run of the rig in C")

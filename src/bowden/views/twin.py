"""A twin, in a terminal."""

import shlex

from bowden.operations.twin import TwinFaults, TwinJournal, TwinStarted
from bowden.views.text import Call


def show_twin(found: TwinStarted | TwinJournal | TwinFaults, call: Call) -> None:
    """Where it is, its state, or what it can be given."""
    if isinstance(found, TwinFaults):
        for one in found.faults:
            side = " joint|motor" if one.side else ""
            amount = "" if one.amount is None else f" [{one.amount:g} {one.unit}]"
            print(f"{one.fault + side + amount:36} {one.meaning}")
    elif isinstance(found, TwinJournal):
        state = found.twin
        faults = ", ".join(state.faults) or "none"
        print(f"twin: {state.state.lower().replace('_', ' ')}, motor {state.motor:.4f} rad; faults: {faults}")
    else:
        where = found.address | {"control": found.control}
        words = shlex.join([str(call["rig"]), *call.repeated("channel")])
        print(f"twin: {', '.join(f'{key} {value}' for key, value in where.items())}")
        print(f"It runs until Ctrl-C. In another terminal: bowden run {words}, or bowden twin {words} --status")

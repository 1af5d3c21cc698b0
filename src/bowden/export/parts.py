"""What stands round a law on the chip: the EMG detector before it, the safety gate behind it."""

from bowden.core.errors import ParameterError
from bowden.core.signals import EMERGENCY_STOP, DriveReading, DriveState
from bowden.cycle.one_cycle import NOTHING_OBSERVED
from bowden.export.checked import Argument, Function
from bowden.export.layout import identifier
from bowden.export.module import Module
from bowden.hardware.ports import Power
from bowden.models.drive.thermal import ThermalState, cold
from bowden.safety.faults import Fault
from bowden.safety.limits import Limits
from bowden.safety.state import Mode, Request
from bowden.safety.supervisor import begin, supervise
from bowden.sensing.detector import Detector
from bowden.sensing.detectors import DEFAULT
from bowden.sensing.envelope import envelope_start, envelope_step, prepare_envelope


def emg_modules(rate: float, kind: Detector = DEFAULT) -> tuple[Module, Module]:
    """The envelope of an EMG signal, and the detector of contractions in it.

    Args:
        rate: samples a second [Hz].
        kind: the detector.

    Raises:
        ParameterError: a rate that the detector does not take.
    """
    if not kind.safe <= rate <= kind.quickest:
        raise ParameterError(
            f"the EMG's rate is {rate:g} Hz",
            expected=f"from {kind.safe:g} to {kind.quickest:g} Hz",
            do="change --emg-rate",
        )
    value, first = Argument("value", 0.0), Argument("first", 0.0)
    chain = Argument("chain", prepare_envelope(rate), constant=True)
    detector = Argument("detector", kind.prepared(rate), constant=True)
    envelope = Module(
        "envelope",
        f"The envelope of an EMG signal of {rate:g} samples a second.",
        (
            Function("start", envelope_start, (first,), ("state",), "Before the first sample."),
            Function(
                "step",
                envelope_step,
                (chain, Argument("state", envelope_start(0.0)), value),
                ("state", "signal", "return"),
                "One sample: its envelope, and the signal without offset and mains, in the signal's own unit.",
            ),
        ),
        structs={"state": "state"},
    )
    onset = Module(
        identifier(kind.name),
        f"Contractions in an EMG signal of {rate:g} samples a second.",
        (
            Function("start", kind.start, (detector, first), ("state",), "Before the first sample, NAN if missing."),
            Function(
                "step",
                kind.step,
                (detector, Argument("state", kind.start(detector.example, 0.0)), value),
                ("state", "return", "trouble"),
                "One sample, NAN if missing: 1 in a contraction; trouble is 1 for flat, 2 for movement or mains.",
            ),
        ),
        structs={"state": "state"},
    )
    return envelope, onset


def _cold(limits: Limits) -> ThermalState:
    return cold(limits.thermal)


_NOTHING = DriveReading(*(0.0,) * len(DriveReading._fields))


def safety_module(limits: Limits) -> Module:
    """The supervisor, with a rig's limits as constants."""
    warmth = cold(limits.thermal)
    bound = Argument("limits", limits, constant=True)
    state = begin(limits, _NOTHING, warmth)
    return Module(
        "safety",
        "The supervisor: it stands last before the wire, and may only refuse or stop.",
        (
            Function(
                "cold",
                _cold,
                (bound,),
                ("warmth",),
                "A motor as warm as its surroundings.",
            ),
            Function(
                "begin",
                begin,
                (bound, Argument("reading", _NOTHING), Argument("warmth", warmth)),
                ("state",),
                "Stopped, with the motor as warm as the last run left it.",
            ),
            Function(
                "supervise",
                supervise,
                (
                    bound,
                    Argument("state", state),
                    Argument("observed", NOTHING_OBSERVED),
                    Argument("wish", 0.0),
                    Argument("dt", 0.001),
                ),
                ("state", "verdict"),
                "One cycle of dt [s]: the law's wish [rad] or less, and whether there is power.",
            ),
        ),
        structs={"state": "state", "warmth": "thermal_state"},
        enums=(Request, Mode, DriveState, Power, Fault),
        numbers={"emergency_stop": (EMERGENCY_STOP, "among the codes of `emergency`, for an emergency stop")},
    )

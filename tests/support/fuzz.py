"""Everything that reads what others wrote, fed with what nobody would: seeds, how they are changed, and what must hold.

A target takes any bytes and ends, or refuses them with a `BowdenError`: no other exception, within `LONGEST` and
`MOST_MEMORY`. What once broke a target lies in ``tests/data/fuzz/TARGET`` and is tried before anything else; ``make
soak`` tries a million inputs.
"""

import contextlib
import ctypes
import gzip
import io
import random
import re
import resource
import signal
import struct
import tempfile
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from bowden.control.law_file import LawFile
from bowden.core.clock import MonotonicClock
from bowden.core.errors import BowdenError, DriveError
from bowden.hardware.buses.packets import PROTOCOLS, PacketReader
from bowden.hardware.drives import canopen_dialogue, canopen_frames, emergencies
from bowden.hardware.emg import lsl_info, trigno_protocol
from bowden.identify.emg.log import read_emg, read_labels
from bowden.identify.log.read import read_log
from bowden.live.log_facts import facts
from bowden.live.mcap_log import LogFile, about
from bowden.live.mcap_read import read as read_mcap
from bowden.live.mcap_read import read_trace
from bowden.live.ring import Description
from bowden.plants.identified import load_cable
from bowden.records.trace import Trace
from bowden.rig.rig import Rig
from bowden.sensing import wearer_file
from bowden.study.load import load

ROOT = Path(__file__).parents[2]
CORPUS = ROOT / "tests" / "data" / "fuzz"
LONGEST = 10
"""Of one input [s]."""
MOST_MEMORY = 1536 << 20
"""That what is taken may add to the process [bytes]."""


class Target(NamedTuple):
    """Something that reads bytes of others."""

    seeds: Callable[[], list[bytes]]
    """What it reads as a rule."""
    take: Callable[[bytes], object]
    share: float
    """Of a million inputs: the quick ones take most of them."""


class Hang(Exception):
    """An input has taken longer than `LONGEST`."""


def _stop(*_: object) -> None:
    raise Hang


@contextlib.contextmanager
def watched() -> Iterator[None]:
    """Bounds for all that is taken meanwhile: of memory, and, by `_stop`, of time."""
    before = resource.getrlimit(resource.RLIMIT_DATA)
    handler = signal.signal(signal.SIGALRM, _stop)
    held = int(Path("/proc/self/statm").read_text().split()[5]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_DATA, (held + MOST_MEMORY, before[1]))
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, handler)
        resource.setrlimit(resource.RLIMIT_DATA, before)


def tried(target: Target, data: bytes) -> bool:
    """Whether a target has taken an input, and not refused it; within `watched`.

    Raises:
        Exception: whatever else came of it.
    """
    signal.setitimer(signal.ITIMER_REAL, LONGEST)
    try:
        target.take(data)
    except BowdenError:
        return False
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
    return True


def changed(name: str, number: int) -> bytes:
    """Input number so-and-so of a target: one of its seeds, or what once broke it, with some changes."""
    chance = random.Random(f"{name} {number}")
    data = bytearray(chance.choice(seeds(name)))
    for _ in range(chance.choice((0, 1, 1, 1, 2, 3, 8, 30))):
        at, end = sorted(chance.randrange(len(data) + 1) for _ in range(2))
        end = min(end, at + chance.choice((1, 2, 4, 8, 60, 4000)))
        kind = chance.randrange(8)
        if kind == 0 and data:
            data[min(at, len(data) - 1)] ^= 1 << chance.randrange(8)
        elif kind == 1:
            del data[at:end]
        elif kind == 2:
            data[at:at] = data[at:end] * chance.choice((1, 2, 50))
        elif kind == 3:
            data[at:end] = chance.randbytes(end - at)
        elif kind == 4:
            data[at:end] = chance.choice(_WORDS)
        elif kind == 5:
            data[at : at + 4] = struct.pack(chance.choice("<>") + "I", chance.choice(_NUMBERS))
        elif kind == 6:
            other = chance.choice(seeds(name))
            data[at:end] = other[chance.randrange(len(other) + 1) :][: chance.choice((4, 60, 4000))]
        elif _digits(data, at):
            first, last = _digits(data, at)
            data[first:last] = chance.choice(_VALUES)
    return bytes(data)


def _digits(data: bytearray, at: int) -> tuple[int, int] | tuple[()]:
    """Where the next number begins and ends that is written in digits."""
    places = range(at, min(len(data), at + 400))
    first = next((i for i in places if data[i] in b"0123456789"), None)
    if first is None:
        return ()
    last = next((i for i in range(first, min(len(data), first + 30)) if data[i] not in b"0123456789.e+-"), first + 1)
    return first, last


_VALUES = (
    *b"0 -1 0.0 -0.0 3.5 1e4 1e-4 1e5 100000 5e-324 1e308 -1e300 nan inf 1e59 1e-59 1_0 true [] {} [[1]] ''".split(),
    *b"1979-05-27 07:32:00 2147483647 4294967296 9223372036854775807".split(),
    *(b"9" * 30, b"0x" + b"f" * 40),
)
_WORDS = (
    *_VALUES,
    *b"= [ ] [[ { } \" ''' # , ; . .. < > &#0; ]]> \xc2\xb0\xc2\xb5\xce\xa9 /dev/zero kind".split(),
    *(b"\n", b"\r\n", b"\t", b"\x00", b"\x1b[2J", b"\xef\xbb\xbf", b"\xe2\x80\xa8", b"\xff\xfe", b"\xc3\x28"),
    *(b"[" * 300, b"(" * 300, b"a." * 70, b"1," * 200),
)
_NUMBERS = (0, 1, 2**31 - 1, 2**31, 2**32 - 1, 14, 15, 255, 65536, 2**24)


@cache
def seeds(name: str) -> list[bytes]:
    """What the inputs of a target are made of."""
    return [*TARGETS[name].seeds(), *kept(name)]


def kept(name: str) -> list[bytes]:
    """What once broke a target."""
    return [path.read_bytes() for path in sorted((CORPUS / name).glob("*"))] if (CORPUS / name).is_dir() else []


@cache
def _folder() -> Path:
    return Path(tempfile.mkdtemp(prefix="bowden-fuzz-"))


def _file(read: Callable[[Path], object], name: str) -> Callable[[bytes], object]:
    """What reads a file, as what takes its bytes."""

    def take(data: bytes) -> object:
        path = _folder() / name
        path.write_bytes(data)
        return read(path)

    return take


def _rigs() -> list[bytes]:
    """The default, and what the pages show."""
    shown = "".join(page.read_text(encoding="utf-8") for page in sorted((ROOT / "docs").glob("*.md")))
    return [
        Rig().to_toml().encode(),
        *(block.encode() for block in re.findall(r"```toml\n(.*?)```", shown, re.DOTALL)),
    ]


_STUDY = b"""runs = 3
seed = 4
duration_s = 1.0
laws = ["adaptive", "observer"]
[set]
servo.damping = 0.9
"suit.worn" = false
[vary]
cable.slope = { uniform = [0.8, 1.0] }
servo.natural_frequency_hz = { normal = [8.0, 1.0], low = 5.0, high = 11.0 }
bench.delay_cycles = { integer = [0, 3] }
control.gains.feedback_gain = { log_uniform = [2.0, 20.0] }
scenario.bend.bend_deg = { choice = [1, 2] }
[known]
delay = { fixed = 1.0 }
[fault]
kind = { choice = ["nothing", "joint_frozen"] }
begin_s = 0.3
length_s = { uniform = [0.1, 0.2] }
"""
_WEARER = b'[emg]\nchannel = "emg_mV"\nrest = 0.01\nmvc = 0.9\nsource = "a.csv"\nmains_hz = 50\n'
_MODEL = b"""best = "bouc_wen"
source = "log.csv"
samples = 400
warnings = []
[models.bouc_wen]
train_rms_deg = 0.1
[models.bouc_wen.parameters]
slope = 0.93
offset = 0.0
hysteresis_gain = 0.05
initial_h = 0.1
rate = 40.0
shape = 0.6
exponent = 1.0
[models.bouc_wen.uncertainty]
slope = inf
"""
_LAW = b"""from dataclasses import replace
from bowden.control import LAWS
A, B = (1.0, 2.0), {"a": [3, 4]}
LAW = replace(LAWS["adaptive"], name="mine").with_gains(feedback_gain=4.0)
"""


def _tables() -> list[bytes]:
    t = np.arange(300) * 0.01
    rows = np.column_stack([t, 20 * np.sin(t), 19 * np.sin(t) - 0.5 * np.sign(np.cos(t))])
    text = "\n".join(",".join(f"{one:.4g}" for one in row) for row in rows)
    german = "time;motor;joint\n[s];[deg];[deg]\n" + text.replace(",", ";").replace(".", ",")
    english = f"time_s,motor_deg,joint_deg\n{text}\n"
    parts = [english, german, "# made by hand\ntime\tmotor\tjoint\n" + text.replace(",", "\t")]
    packed = io.BytesIO()
    with gzip.GzipFile(fileobj=packed, mode="wb", mtime=0) as file:
        file.write(english.encode())
    return [*(part.encode() for part in parts), english.encode("utf-16"), packed.getvalue()]


def _emg() -> list[bytes]:
    noise = np.random.default_rng(1).standard_normal(1100)
    rows = "\n".join(f"{k / 500:g},{0.01 * one:.3f}" for k, one in enumerate(noise))
    return [f"time_s,emg_mV\n{rows}\n".encode()]


def _trace() -> Trace:
    t = np.arange(200) * 0.1
    columns = {"time": t, "motor": np.sin(t), "reference": np.sin(t), "joint": 0.9 * np.sin(t)}
    units = dict.fromkeys(columns, "rad") | {"time": "s"}
    return Trace(columns, units, {"law": "adaptive"}, 3)


def _traces() -> list[bytes]:
    csv, npz = _folder() / "seed.csv", _folder() / "seed.npz"
    _trace().write(csv)
    _trace().write(npz)
    return [csv.read_bytes(), npz.read_bytes()]


def _matlab() -> list[bytes]:
    from scipy.io import savemat

    t = np.arange(200) * 0.1
    content = {"time": t, "motor": np.sin(t), "joint": np.sin(t) - 0.01}
    many = {"log": content, "names": np.array(["a", "b"], dtype=object), "text": "words", "flag": True, "m": np.eye(3)}
    found = []
    for given, options in ((content, {"do_compression": True}), (content, {"format": "4"}), (many, {})):
        file = io.BytesIO()
        savemat(file, given, **options)
        found.append(file.getvalue())
    return found


def _mcap() -> list[bytes]:
    path = _folder() / "seed.mcap"
    columns = ("time", "motor", "joint", "lateness", "mode", "faults")
    described = Description(columns, ("s", "rad", "rad", "s", "1", "1"), {"law": "adaptive", "seed": 3}, 10**18)
    rows = np.random.default_rng(1).standard_normal((60, len(columns)))
    with path.open("wb") as file:
        log = LogFile(file.fileno(), about(described, {"software": "bowden 1"}))
        for first in range(0, 60, 20):
            part = np.arange(first, first + 20)
            log.write(part, rows[part])
        log.finish({"lost": "0", "dropped": "0"})
    return [path.read_bytes()]


def _of_mcap(path: Path) -> None:
    found = read_mcap(path)
    facts(found)
    found.trace()


class _Hostile:
    """A bus on which a node answers every question with the next eight bytes that it was given."""

    clock = MonotonicClock()

    def __init__(self, data: bytes) -> None:
        self._answers = [data[at : at + 8] for at in range(0, min(len(data), 2000), 8)]
        self._asked = False

    def send_now(self, identifier: int, data: bytes) -> None:
        self._asked = True

    def wait_for(self, matches: Any, timeout: float) -> tuple[int, bytes] | None:
        asked, self._asked = self._asked, False
        return (0x582, self._answers.pop(0)) if asked and self._answers else None


def _wild(data: bytes) -> None:
    """Frames of any identifier, and what our side makes of each of them."""
    heard = canopen_dialogue.Dialogue(_Hostile(b""), 2, 127, 0.0)
    for at in range(0, min(len(data), 800), 10):
        cob_id = data[at] * 8 + (data[at + 1] & 7 if at + 1 < len(data) else 0)
        body = data[at + 2 : at + 10]
        heard.take(cob_id, body)
        for unpack in (canopen_frames.MOTION.unpack, canopen_frames.SENSORS.unpack, canopen_frames.ORDER.unpack,
                       canopen_frames.unpack_emergency, canopen_frames.unpack_heartbeat):  # fmt: skip
            unpack(body)
    for code in heard.emergencies:
        emergencies.emergency_text(code)


def _sdo(data: bytes) -> None:
    asked = canopen_dialogue.Dialogue(_Hostile(data), 2, 127, 0.0, "a drive")
    for ask in (lambda: asked.read(0x1000), lambda: asked.text(0x1008), lambda: asked.write(0x6060, 0, 8, 1)):
        with contextlib.suppress(DriveError):
            ask()


def _frames() -> list[bytes]:
    question = struct.pack("<BHB4s", 0x43, 0x1000, 0, b"\x92\x01\x02\0")
    long = struct.pack("<BHBI", 0x41, 0x1008, 0, 9) + b"\0EPOS4 X" + b"\x1bYZ" + bytes(5)
    kept_ = struct.pack("<BHBI", 0x60, 0x6060, 0, 0) + struct.pack("<BHBI", 0x4F, 0x6060, 0, 8)
    return [question + long + kept_, struct.pack("<BHBI", 0x80, 0x1000, 0, 0x06020000) * 4, bytes(range(256))]


def _packets() -> list[bytes]:
    """Of a host and of servos, one after another."""
    said = [(1, b"\x01"), (1, b"\x55\x00\xff\xff\xfd\x00"), (254, b"\x83\x74\x00\x04\x00\x01\x00\x08\x00\x00")]
    return [b"".join(packets.pack(*frame) for frame in said) for packets in PROTOCOLS.values()]


def _of_line(data: bytes) -> None:
    """Whatever comes, a whole packet after it is read, at the latest once the line has been quiet."""
    for packets in PROTOCOLS.values():
        for replies in (False, True):
            reader = PacketReader(packets, replies=replies)
            for at in range(0, len(data), 7):
                reader.feed(data[at : at + 7], 10)
            reader.forget()
            assert reader.feed(packets.pack(3, b"\x55\x00\x01"))[-1] == (3, b"\x55\x00\x01") or not replies


def _trigno(data: bytes) -> None:
    lines, samples = trigno_protocol.Lines(), trigno_protocol.Samples()
    half = len(data) // 2
    samples.feed(data[:half])
    samples.feed(data[half:])
    found = lines.feed(data[:half]) + lines.feed(data[half:])
    answers = (found + ["INVALID COMMAND"] * 7)[:7]
    trigno_protocol.rate_of(trigno_protocol.EMG_PORT, *answers[:4])
    trigno_protocol.columns_of([trigno_protocol.SensorAnswers(1, *answers[4:7])])


_TRIGNO = [
    b"NO\r\nYES\r\n0.0135\r\n26\r\n1\r\n1\r\nV\r\n",
    b"YES\r\nUPSAMPLING OFF\r\nCANNOT COMPLETE\r\n26\r\n0\r\n4\r\nMILLIVOLTS\r\n",
]

_XML = (
    b'<?xml version="1.0"?><info><name>EMG</name><type>EMG</type><channel_count>2</channel_count>'
    b"<channel_format>float32</channel_format><source_id>x</source_id><nominal_srate>2000</nominal_srate>"
    b"<version>1.1</version><created_at>1</created_at><uid>u</uid><session_id>d</session_id><hostname>h</hostname>"
    b"<v4address/><v4data_port>1</v4data_port><v4service_port>1</v4service_port>"
    b"<v6address/><v6data_port>1</v6data_port><v6service_port>1</v6service_port>"
    b"<desc><channels><channel><label>a</label><unit>mV</unit></channel><channel><label>b</label><unit>mV</unit>"
    b"</channel></channels></desc></info>"
)


def _lsl(data: bytes) -> None:
    """What a stream says of itself, through liblsl's own parser."""
    from pylsl import StreamInfo
    from pylsl.lib import lib

    lib.lsl_streaminfo_from_xml.restype = ctypes.c_void_p
    with contextlib.suppress(RuntimeError, UnicodeDecodeError):
        handle = lib.lsl_streaminfo_from_xml(data.replace(b"\0", b""))
        if handle:
            info = StreamInfo(handle=handle)
            lsl_info.check_info(info, info.name())
            lsl_info.channel_names(info, ("a",))
            lsl_info.unit_of(info)


TARGETS: dict[str, Target] = {
    "rig": Target(_rigs, _file(Rig.read, "rig.toml"), 0.02),
    "study": Target(lambda: [_STUDY], _file(load, "study.toml"), 0.01),
    "wearer": Target(lambda: [_WEARER], _file(wearer_file.read, "wearer.toml"), 0.1),
    "model": Target(lambda: [_MODEL], _file(load_cable, "model.toml"), 0.1),
    "law": Target(lambda: [_LAW], _file(lambda path: LawFile.found(str(path)), "law.py"), 0.02),
    "csv": Target(_tables, _file(read_log, "log.csv"), 0.03),
    "emg": Target(_emg, _file(read_emg, "emg.csv"), 0.03),
    "labels": Target(lambda: [b"onset_s,offset_s\n1,2\n3,4\n"], _file(read_labels, "labels.csv"), 0.05),
    "trace": Target(_traces, _file(read_trace, "trace"), 0.03),
    "npz": Target(_traces, _file(read_log, "log.npz"), 0.02),
    "mat": Target(_matlab, _file(read_log, "log.mat"), 0.0005),  # each in a process of its own
    "mcap": Target(_mcap, _file(_of_mcap, "log.mcap"), 0.04),
    "frames": Target(_frames, _wild, 0.2),
    "sdo": Target(_frames, _sdo, 0.1),
    "packets": Target(_packets, _of_line, 0.1),
    "trigno": Target(lambda: _TRIGNO, _trigno, 0.15),
    "lsl": Target(lambda: [_XML], _lsl, 0.05),
}

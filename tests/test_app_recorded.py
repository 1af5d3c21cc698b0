"""A recorded motion as the reference: read from a file, or refused in one line."""

import gzip
from pathlib import Path

import numpy as np
import pytest

from bowden.control.motion_file import read_motion
from bowden.control.recorded_motion import RecordedFile
from bowden.core.errors import BowdenError
from bowden.core.units import RADIANS
from bowden.records.trace import Trace

pytestmark = pytest.mark.usefixtures("undrawn")


def motion(folder: Path, text: str | bytes, **keys: str | float) -> RecordedFile:
    (folder / "motion.csv").write_bytes(text.encode() if isinstance(text, str) else text)
    return RecordedFile(file="motion.csv", **keys)


TIME = np.arange(400) * 0.01
ANGLE = 30.0 * np.sin(2.0 * np.pi * 0.5 * TIME)
TEXT = "time_s,other,joint_deg\n" + "\n".join(f"{t},x,{a}" for t, a in zip(TIME.tolist(), ANGLE.tolist(), strict=True))


def test_a_text_file_becomes_the_reference(tmp_path: Path) -> None:
    reference = read_motion(motion(tmp_path, "# by hand\n" + TEXT), tmp_path)
    inner = (TIME > 0.5) & (TIME < 3.5)
    assert np.max(np.abs(reference.sample(TIME)[inner, 0] - ANGLE[inner] * RADIANS)) < 0.05 * RADIANS


def test_gzipped_text_and_a_trace_are_read_too(tmp_path: Path) -> None:
    plain = read_motion(motion(tmp_path, TEXT), tmp_path)
    with gzip.open(tmp_path / "motion.csv.gz", "wt") as file:
        file.write(TEXT)
    trace = Trace({"time": TIME, "joint": ANGLE * RADIANS}, {"time": "s", "joint": "rad"})
    trace.write(tmp_path / "trace.csv")
    trace.write(tmp_path / "trace.parquet")
    sections = [RecordedFile(file="motion.csv.gz")] + [
        RecordedFile(file=f"trace.{ending}", time_column="time", position_column="joint", unit="rad")
        for ending in ("csv", "parquet")
    ]
    for section in sections:
        assert np.allclose(read_motion(section, tmp_path).sample(TIME), plain.sample(TIME), atol=1e-12)


def test_a_persons_elbow(shared_data: Path) -> None:
    section = RecordedFile(file="elbow/arm_flexion_goniometer.csv.gz", position_column="elbow_deg")
    reference = read_motion(section, shared_data)
    positions = reference.sample(np.arange(0.0, reference.duration, 0.01))[:, 0] / RADIANS
    assert 0.0 < positions.min() < 10.0
    assert 115.0 < positions.max() < 130.0


@pytest.mark.parametrize(
    ("text", "keys", "said"),
    [
        (TEXT, {"position_column": "joint"}, "has no column 'joint'; expected joint_deg (did you mean this?)"),
        (TEXT, {"position_column": "other"}, "line 2: other is 'x'; expected a number"),
        (TEXT, {"unit": "rad"}, "which looks like degrees"),
        (TEXT + "\n4.0,x,nan", {}, "not numbers"),
        ("\n".join(TEXT.splitlines()[:9]), {}, "at least 16"),
        ("", {}, "motion.csv is empty"),
        (b"\x00\xff\x00\xff", {}, "motion.csv"),
        ("# nothing but a comment", {}, "motion.csv"),
    ],
)
def test_what_cannot_be_followed_is_refused_in_one_line(
    tmp_path: Path, text: str | bytes, keys: dict[str, str], said: str
) -> None:
    with pytest.raises(BowdenError) as caught:
        read_motion(motion(tmp_path, text, **keys), tmp_path)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    for ending in ("csv", "parquet"):
        with pytest.raises(BowdenError, match="no such file"):
            read_motion(RecordedFile(file=f"none.{ending}"), tmp_path)

"""Recordings in the formats of other programs, each written by the package that reads it or by another."""

import sys
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bowden
from bowden.core.errors import LogError, MissingExtraError
from bowden.models.cable.prandtl_ishlinskii import plays
from bowden.records.foreign import FORMATS

TIME = np.arange(600) / 50.0
MOTOR = 0.5 * np.sin(1.9 * TIME) + 0.2 * np.sin(4.3 * TIME + 0.5)
JOINT = 0.9 * plays(MOTOR, np.array([0.06]))[:, 0] + 0.1


def hdf5(path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in (("time_s", TIME), ("run/motor_rad", MOTOR), ("run/joint_rad", JOINT)):
            file[name] = values[None]
    with path.open("r+b") as file:  # MATLAB's own head
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\0\x02IM")


def tdms(path: Path, *, timed: bool = True) -> None:
    nptdms = pytest.importorskip("nptdms")
    said = {"unit_string": "deg"} if timed else {"unit_string": "deg", "wf_increment": 0.02, "wf_start_offset": 0.0}
    channels = [
        nptdms.ChannelObject("run", name, np.degrees(angle), said)
        for name, angle in (("motor", MOTOR), ("joint", JOINT))
    ]
    if timed:
        channels.append(nptdms.ChannelObject("run", "Time", TIME, {"unit_string": "s"}))
    with nptdms.TdmsWriter(str(path)) as file:
        file.write_segment(channels)


_XML = '<?xml version="1.0"?>'
_MAIN = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
_OF = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
_PACKAGE = "http://schemas.openxmlformats.org/package/2006"


def workbook(path: Path) -> None:
    pytest.importorskip("python_calamine")

    def cell(value: str | float) -> str:
        if isinstance(value, str):
            return f'<c t="inlineStr"><is><t>{value}</t></is></c>'
        return f"<c><v>{value!r}</v></c>"

    rows: list[list[Any]] = [["Rig 7"], [], ["time_s", "motor_rad", "joint_rad", "state"]]
    rows += [[*row, "ok"] for row in np.c_[TIME, MOTOR, JOINT].tolist()]
    sheet = "".join(f"<row>{''.join(map(cell, row))}</row>" for row in rows)
    related = f'<Relationships xmlns="{_PACKAGE}/relationships"><Relationship Id="r1" '
    parts = {
        "[Content_Types].xml": f'<Types xmlns="{_PACKAGE}/content-types"/>',
        "_rels/.rels": f'{related}Type="{_OF}/officeDocument" Target="xl/workbook.xml"/></Relationships>',
        "xl/_rels/workbook.xml.rels": f'{related}Type="{_OF}/worksheet" Target="worksheets/one.xml"/></Relationships>',
        "xl/workbook.xml": f'<workbook xmlns="{_MAIN}" xmlns:r="{_OF}"><sheets><sheet name="A" sheetId="1" r:id="r1"/>'
        "</sheets></workbook>",
        "xl/worksheets/one.xml": f'<worksheet xmlns="{_MAIN}"><sheetData>{sheet}</sheetData></worksheet>',
    }
    with zipfile.ZipFile(path, "w") as file:
        for name, text in parts.items():
            file.writestr(name, _XML + text)


def bag(path: Path, storage: str = "SQLITE3") -> None:
    """The motor at 50 Hz with a stamp of its own, the joint at 25 Hz with none."""
    rosbag2 = pytest.importorskip("rosbags.rosbag2")
    from rosbags.typesys import Stores, get_typestore

    types = get_typestore(Stores.ROS2_HUMBLE)
    stamp, header, state, number = (
        types.types[name]
        for name in (
            "builtin_interfaces/msg/Time",
            "std_msgs/msg/Header",
            "sensor_msgs/msg/JointState",
            "std_msgs/msg/Float64",
        )
    )
    with rosbag2.Writer(path, version=9, storage_plugin=rosbag2.StoragePlugin[storage]) as file:
        motors = file.add_connection("/states", state.__msgtype__, typestore=types)
        joints = file.add_connection("/elbow", number.__msgtype__, typestore=types)
        for i, time in enumerate(TIME):
            now, none = 1_700_000_000_000_000_000 + round(1e9 * time), np.empty(0)
            at = header(stamp=stamp(sec=now // 10**9, nanosec=now % 10**9), frame_id="")
            one = state(header=at, name=["motor"], position=MOTOR[i : i + 1], velocity=none, effort=none)
            file.write(motors, now + 7_000_000, types.serialize_cdr(one, state.__msgtype__))
            if i % 2 == 0:
                file.write(joints, now, types.serialize_cdr(number(data=JOINT[i]), number.__msgtype__))


@pytest.mark.parametrize("write", [hdf5, tdms, workbook])
def test_a_recording_of_another_program_is_read(write: Any, tmp_path: Path) -> None:
    write(tmp_path / "log")
    log = bowden.read_log(tmp_path / "log")
    for found, true in ((log.time, TIME), (log.motor, MOTOR), (log.joint, JOINT)):
        assert found == pytest.approx(true, abs=1e-12)
    content = (tmp_path / "log").read_bytes()
    (tmp_path / "log").write_bytes(content[:600] + bytes(64) + content[664 : len(content) // 2])
    with pytest.raises(LogError) as refused:
        bowden.read_log(tmp_path / "log")
    assert "\n" not in str(refused.value)


def test_a_waveform_of_labview_has_its_times(tmp_path: Path) -> None:
    tdms(tmp_path / "log.tdms", timed=False)
    assert bowden.read_log(tmp_path / "log.tdms").time == pytest.approx(TIME)


@pytest.mark.parametrize("storage", ["SQLITE3", "MCAP"])
def test_a_bag_of_two_topics_is_one_log(storage: str, tmp_path: Path) -> None:
    bag(tmp_path / "bag", storage)
    (inner,) = (one for one in (tmp_path / "bag").iterdir() if one.suffix != ".yaml")
    for path, joint in ((tmp_path / "bag", None), (inner, "/elbow/data")):  # a word in its name says it as well
        log = bowden.read_log(path, motor="/states/position/motor", joint=joint, unit="rad")
        assert log.joint == pytest.approx(JOINT[::2], abs=1e-12)
        assert log.motor == pytest.approx(MOTOR[::2], abs=1e-12)
        assert any("stand in different rows" in said for said in log.warnings)
    (tmp_path / "bag" / "metadata.yaml").unlink()
    with pytest.raises(LogError, match="part of a bag of ROS 2; expected its folder"):
        bowden.read_log(inner)


@pytest.mark.parametrize(
    ("begin", "kind"), [(b"TDSm", "tdms"), (b"\x89HDF\r\n\x1a\n", "hdf5"), (b"\xd0\xcf\x11\xe0", "workbook")]
)
def test_a_format_whose_package_is_missing_names_its_extra(
    begin: bytes, kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, FORMATS[kind].module, None)
    (tmp_path / "log").write_bytes(begin + bytes(600))
    with pytest.raises(MissingExtraError, match=rf'pip install "bowden\[{FORMATS[kind].extra}\]"'):
        bowden.read_log(tmp_path / "log")

"""The console of a rig with several motors: what of it can be set, and what is shown of each motor."""

from pathlib import Path

import pytest

from bowden.console.settings import RunSettings
from bowden.console.state import rig_of
from bowden.console.stream import columns_of, curves_of
from bowden.core.errors import ParameterError
from bowden.live.live_run import live_run
from bowden.rig.rig import Rig, RigMotor
from console_client import RIG, Page, RunningConsole, running_console


@pytest.fixture(scope="module")
def leg() -> Rig:
    hip = Rig(law="bowden")
    knee = hip.replace(drive=hip.drive._replace(node_id=2))
    return Rig(motors=(RigMotor("hip", hip), RigMotor("knee", knee)))


def test_the_duration_and_texts_are_set_and_all_else_is_as_the_file_says(leg: Rig) -> None:
    settings = RunSettings(leg)
    changed = settings.changed({"duration": 7.0, "subject": "anna"})
    assert {rig.duration for _, rig, _ in changed.rig.motors} == {7.0}
    assert changed.about["subject"] == "anna"
    for given in (
        {"law": "adaptive"},
        {"gains": {"bandwidth": 1.0}},
        {"preset": None},
        {"reference": {"low_deg": 1.0}},
    ):
        with pytest.raises(ParameterError, match="of a rig with several motors is as its file says"):
            settings.changed(given)
    said, of_one = settings.document(locked=True), RunSettings(leg.only("hip")).document(locked=True)
    assert {*said} == {*of_one}
    assert said["law"] == "hip: bowden, knee: bowden"
    assert said["gains"] == {}


def test_each_motor_has_curves_in_groups_of_its_own_and_the_loops_stand_once(leg: Rig) -> None:
    live = live_run(leg)
    columns = live.columns()
    offered = curves_of([*columns], [*columns.values()], live.log_settings())
    names = [one.name for one in offered]
    assert len({*names}) == len(names)
    assert {"joint_deg", "knee.joint_deg", "error_deg", "knee.error_deg", "lateness_us"} <= {*names}
    assert "knee.lateness_us" not in names
    assert {source for one in offered for source in one.source} <= {*columns}
    own = live_run(leg.only("hip")).columns()
    alone = columns_of([*own], [*own.values()], live.log_settings())
    loop = [one for one in alone if one.group == "loop"]
    assert len(offered) == 2 * (len(alone) - len(loop)) + len(loop)
    by_name = {one.name: one for one in offered}
    assert by_name["knee.joint_deg"].source == ("knee.joint",)
    assert by_name["knee.joint_deg"].group == "knee: motion"
    assert by_name["knee.joint_deg"].high == pytest.approx(by_name["joint_deg"].high)


def test_faults_are_injected_into_the_twin_of_a_motor(leg: Rig) -> None:
    faults = [one["name"] for one in rig_of(leg, "leg.toml", twin=True)["faults"]]
    assert {"hip: drive_fault", "knee: encoder_frozen joint"} <= {*faults}
    assert len({*faults}) == len(faults)
    alone = [one["name"] for one in rig_of(leg.only("hip"), "hip.toml", twin=True)["faults"]]
    assert "drive_fault" in alone
    assert len(faults) == 2 * len(alone)


@pytest.mark.live
def test_a_fault_of_one_motor_is_told_with_its_name_and_an_acknowledgement_is_for_all(tmp_path: Path) -> None:
    motors = 'console_lease_s = 2.0\n[[motor]]\nname = "hip"\n[[motor]]\nname = "knee"\n[motor.drive]\nnode_id = 2\n'
    (tmp_path / "leg.toml").write_text(RIG + motors)

    def faulted(page: Page, running: RunningConsole) -> None:
        page.start()
        page.run()
        steps = [step["name"] for step in page.state["run"]["preflight"]]
        assert {"hip: the drive enables", "knee: the drive enables"} <= {*steps}
        assert page.post("/api/inject", fault="knee: drive_fault") == ""
        page.until(lambda state: state["run"]["mode"] == "latched", 10.0, "latched")
        first = page.state["run"]["first_fault"]
        assert first["meaning"].startswith("knee: ")
        assert {"hip: another motor is off"} & {one["meaning"] for one in page.state["run"]["consequences"]}
        # refused until the page has seen the state after the stop, as a user who presses again
        page.until(lambda _: page.post("/api/request", request="acknowledge") == "", 5.0, "acknowledged")
        page.until(lambda state: state["run"]["mode"] == "stopped", 5.0, "stopped")
        assert page.post("/api/request", request="end") == ""
        page.until(lambda state: state["phase"] == "idle", 30.0, "the end")

    with running_console(tmp_path / "leg.toml", tmp_path / "out", "--twin") as running:
        running.carried_through(faulted)

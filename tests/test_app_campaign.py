"""``bowden campaign``: its rows are single runs, it goes on where it was, and what cannot be is refused in one line."""

import contextlib
import errno
import functools
import io
import itertools
import json
import multiprocessing
import os
import shutil
import signal
import threading
import time
import tomllib
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pyarrow.dataset as ds
import pyarrow.parquet as pq
import pytest

from bowden.app import main
from bowden.core.errors import ParameterError
from bowden.operations.schema import json_schema
from bowden.records.trace import Trace
from bowden.study import workers as campaign_workers
from bowden.study import workers as study_pack
from bowden.study.load import load
from support.command import Command

pytestmark = pytest.mark.usefixtures("undrawn")

ROOT = Path(__file__).parents[1]
STUDY = """
laws = ["adaptive"]
runs = 32
duration_s = 0.6

[set]
"scenario.bend" = { kind = "random", low_deg = 120.0, high_deg = 300.0, fastest_s = 0.2 }

[vary]
"servo.natural_frequency_hz" = { log_uniform = [4, 20] }
"bench.delay_cycles" = { integer = [0, 3] }
"cable.slope" = { uniform = [0.6, 1.2] }
"control.gains.feedback_gain" = { log_uniform = [5, 60] }
"reference.period_s" = { choice = [0.5, 1.0] }

[known]
servo_frequency = { uniform = [0.8, 1.2] }

[fault]
kind = { choice = ["nothing", "joint_frozen", "joint_nan"] }
begin_s = { uniform = [0.2, 0.5] }
length_s = 0.1
"""


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "study.toml").write_text(STUDY)
    return tmp_path


CAMPAIGN = ("campaign", "study.toml", "--out", "out", "--workers", "1")


@pytest.fixture(scope="module")
def computed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """The study computed once: its folder, and the document that was printed."""
    folder = tmp_path_factory.mktemp("campaign")
    (folder / "study.toml").write_text(STUDY)
    printed = io.StringIO()
    with contextlib.chdir(folder), contextlib.redirect_stdout(printed):
        assert main.run([*CAMPAIGN, "--json"]) == 0
    return folder, printed.getvalue()


@pytest.fixture
def whole(computed: tuple[Path, str], folder: Path) -> dict[str, Any]:
    shutil.copytree(computed[0] / "out", folder / "out")
    found: dict[str, Any] = json.loads(computed[1])
    jsonschema.validate(found, json_schema("campaign"))
    return found


def test_every_row_is_a_run_that_can_be_had_alone(whole: dict[str, Any], command: Command) -> None:
    rows = ds.dataset("out/runs").to_table().to_pylist()
    assert [row["number"] for row in rows] == list(range(32))
    assert whole["laws"][0]["runs"] == 32
    ended = {row["fault.kind"]: row["ended"] for row in rows}
    assert ended == {"nothing": True, "joint_frozen": True, "joint_nan": False}
    assert {row["bench.delay_cycles"] for row in rows} == {0, 1, 2, 3}
    for kind in ended:
        row = next(row for row in rows if row["fault.kind"] == kind)
        alone = command.document(*CAMPAIGN, "--run", str(row["number"]))
        assert all(row[name] == value for name, value in alone["drawn"].items())
        (run,) = alone["runs"]
        assert run["ended"] is row["ended"]
        for name in ("rmse_deg", "rmse_after_10s_deg", "peak_deg", "electrical_energy_j"):
            assert run[name] == row[name]
        trace = Trace.read(alone["files"][0])
        assert np.isfinite(trace["joint"]).sum() == row["cycles"]
        gains = trace.settings["gains"]
        assert gains["feedback_gain"] == row["control.gains.feedback_gain"]
        assert trace.settings["plant"]["servo"]["natural_frequency"] == pytest.approx(
            2.0 * np.pi * row["servo.natural_frequency_hz"]
        )
        assert Path(alone["files"][-1]).is_file()


def test_a_study_with_more_runs_keeps_those_that_are_there(
    whole: dict[str, Any], command: Command, folder: Path
) -> None:
    before = ds.dataset("out/runs").to_table().sort_by("number").to_pylist()
    assert {row["number"] for row in before} == set(range(32))
    Path("out/runs/part-000015.parquet").unlink()  # interrupted: numbers 30 and 31 are not there
    Path("study.toml").write_text(STUDY.replace("runs = 32", "runs = 40"))
    found = command.document(*CAMPAIGN)
    assert found["chunks_kept"] == 10
    assert found["chunks_set_aside"] == 0
    rows = ds.dataset("out/runs").to_table().sort_by("number").to_pylist()
    assert [row["number"] for row in rows] == list(range(40))
    assert repr(rows[:32]) == repr(before)
    assert "runs" not in command(*CAMPAIGN).err
    shutil.rmtree("out")
    assert command.document(*CAMPAIGN)["rows_sha256"] == found["rows_sha256"], "as if it had had so many from the start"
    Path("study.toml").write_text(STUDY)
    assert "runs was 40 and is 32" in command.refused(*CAMPAIGN)


def test_units_stand_in_the_files(whole: dict[str, Any]) -> None:
    schema = pq.read_schema("out/runs/part-000000.parquet")
    units = {name: schema.field(name).metadata[b"unit"].decode() for name in schema.names}
    assert units["servo.natural_frequency_hz"] == "Hz"
    assert (units["rmse_deg"], units["electrical_energy_j"], units["fault.begin_s"]) == ("deg", "J", "s")
    about = json.loads(schema.metadata[b"bowden"])
    assert about["study"] == whole["study"]


def test_the_page_has_the_commands_that_rerun_the_worst(whole: dict[str, Any]) -> None:
    page = Path("out/campaign.html").read_text(encoding="utf-8")
    for case in whole["laws"][0]["worst"]:
        assert f"bowden campaign study.toml --out out --run {case['number']}<" in page
    assert whole["rows_sha256"] in page
    for name in ("servo.natural_frequency_hz", "fault.kind", "known.servo_frequency"):
        assert name in page


def test_it_goes_on_where_it_was_and_mends_what_is_damaged(whole: dict[str, Any], command: Command) -> None:
    assert (whole["chunks_computed"], whole["chunks_kept"]) == (16, 0)
    Path("out/runs/part-000003.parquet").unlink()
    damaged = Path("out/runs/part-000007.parquet")
    damaged.write_bytes(damaged.read_bytes()[:-40])
    again, said = command.whole(*CAMPAIGN)
    assert (again["chunks_computed"], again["chunks_kept"], again["chunks_set_aside"]) == (2, 14, 1)
    assert again["rows_sha256"] == whole["rows_sha256"]
    assert again["laws"] == whole["laws"]
    assert "part-000007.parquet" in said
    assert "set aside" in said
    assert Path("out/aside/part-000007.parquet").is_file()


@pytest.mark.parametrize(
    ("failure", "code", "said"),
    [
        (OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)), 2, "No space left on device; "),
        (KeyboardInterrupt(), 130, "interrupted; "),
    ],
)
def test_what_was_computed_is_kept(
    failure: BaseException,
    code: int,
    said: str,
    command: Command,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    written, count = pq.write_table, itertools.count()

    def failing(*arguments: Any, **options: Any) -> None:
        if next(count) == 5:
            raise failure
        written(*arguments, **options)

    with monkeypatch.context() as patch:
        patch.setattr(pq, "write_table", failing)
        error = command.refused(*CAMPAIGN, code=code)
    assert said in error
    assert "5 of 16 chunks are kept in out, and the same command goes on from there" in error
    assert len(list(Path("out/runs").iterdir())) == 5
    again = command.document(*CAMPAIGN)
    assert (again["chunks_computed"], again["chunks_kept"]) == (11, 5)


@pytest.mark.parametrize("failure", [KeyboardInterrupt(), ParameterError("no cluster", do="start one")])
def test_nothing_is_said_of_what_is_kept_where_nothing_is(
    failure: BaseException, command: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    def failing(*_: Any) -> None:
        raise failure

    monkeypatch.setattr(study_pack, "warm", failing)
    code, said = (130, "interrupted") if isinstance(failure, KeyboardInterrupt) else (2, "no cluster; start one")
    assert command.refused(*CAMPAIGN, code=code) == f"bowden: {said}\n"


def test_another_study_does_not_mix_with_what_is_there(whole: dict[str, Any], command: Command) -> None:
    Path("study.toml").write_text("# a comment changes nothing\n" + STUDY)
    assert command.document(*CAMPAIGN)["chunks_computed"] == 0
    Path("study.toml").write_text(STUDY.replace("[5, 60]", "[5, 50]").replace("runs = 32", "runs = 31"))
    error = command.refused(*CAMPAIGN)
    assert "runs was 32 and is 31" in error
    assert "draws.control.gains.feedback_gain.log_uniform was [5, 60] and is [5, 50]" in error


def test_what_is_added_last_leaves_the_rest_as_it_was(folder: Path) -> None:
    before = load(Path("study.toml"))
    Path("other.toml").write_text(
        STUDY.replace('"bench.delay', '"servo.damping" = { uniform = [0.5, 1.0] }\n"bench.delay')
    )
    Path("more.toml").write_text(STUDY + "\n")
    other, more = load(Path("other.toml")), load(Path("more.toml"))
    assert more.drawn(7) == before.drawn(7)
    assert more.hash == before.hash != other.hash
    assert other.drawn(7).seed == before.drawn(7).seed
    name = "servo.natural_frequency_hz"
    assert other.drawn(7).values[name] == before.drawn(7).values[name]
    assert before.drawn(7) != before.drawn(8)


def test_a_packed_study_is_the_same_study(tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    law = (ROOT / "examples" / "my_law.py").read_text()
    (tmp_path / "mine" / "my_law.py").write_text(law)
    (tmp_path / "model.toml").write_text("")
    Path("study.toml").write_text(STUDY.replace('["adaptive"]', '["mine/my_law.py", "uncompensated"]'))
    text = Path("study.toml").read_text().replace('"control.gains.feedback_gain" = { log_uniform = [5, 60] }\n', "")
    Path("study.toml").write_text(text)
    study = load(Path("study.toml"))
    again = study_pack.unpacked(study_pack.packed(study))
    assert [law.name for law in again.laws] == [law.name for law in study.laws]
    for number in (0, 5):
        (_, laws, fault), (_, others, another) = study.run(number), again.run(number)
        assert study.drawn(number) == again.drawn(number)
        assert [law.gains._asdict() for law in laws] == [law.gains._asdict() for law in others]
        assert fault == another
        assert study.run(number)[0].bench == again.run(number)[0].bench


def test_other_software_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    pack = study_pack.packed(load(Path("study.toml")))
    monkeypatch.setattr(study_pack, "software", lambda: "0.0.1 (other)")
    with pytest.raises(Exception, match=r"a worker has bowden 0.0.1 \(other\), and the command .*same software"):
        study_pack.unpacked(pack)


def children() -> list[int]:
    return [process.pid or 0 for process in multiprocessing.active_children()]


def test_a_process_that_is_killed_is_replaced_and_one_that_stands_still_holds_up_no_end() -> None:
    study = load(Path("study.toml"))
    work = [(chunk, range(chunk, chunk + 1)) for chunk in range(12)]
    found = campaign_workers.in_processes(study, work, 2)
    seen = [next(found)[0]]
    os.kill(children()[0], signal.SIGKILL)
    seen += [chunk for chunk, _ in itertools.islice(found, 7)]
    for pid in children():
        os.kill(pid, signal.SIGSTOP)  # as Ctrl-Z, or a machine out of memory, leaves it
    begun = time.monotonic()
    found.close()  # as Ctrl-C does
    assert time.monotonic() - begun < 2.0
    assert not children()
    rest = [one for one in work if one[0] not in seen]
    seen += [chunk for chunk, _ in campaign_workers.in_this_process(study, rest)]
    assert sorted(seen) == list(range(12))


def test_processes_that_die_again_and_again_are_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(campaign_workers, "_prepare", functools.partial(os._exit, 1))
    with pytest.raises(ParameterError, match=r"died 3 times in a row; find what"):
        list(campaign_workers.in_processes(load(Path("study.toml")), [(0, range(1)), (1, range(1, 2))], 2))


class UnpackableError(Exception):
    def __init__(self, what: str, *, line: int) -> None:
        super().__init__(f"{what} at line {line}")
        self.lock = threading.Lock()  # which no way of packing takes


def test_an_error_that_cannot_be_packed_comes_as_its_text(monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: object) -> bytes:
        raise UnpackableError("no number", line=3)

    monkeypatch.setattr(campaign_workers, "compute", fails)
    with pytest.raises(ParameterError, match="UnpackableError: no number at line 3"):
        campaign_workers._computed(b"", 0, 1)


@pytest.mark.parametrize(
    ("before", "after", "said"),
    [
        ("servo.natural_frequency_hz", "servo.natural_freq_hz", "servo.natural_frequency_hz (did you mean this?)"),
        ("[0.6, 1.2]", "[1.2, 0.6]", 'vary."cable.slope": uniform is [1.2, 0.6]; expected [low, high]'),
        ("uniform = [0.6, 1.2]", "uniform = [0.6, 300]", "cable.slope reaches 300.0; expected a number not above 100"),
        ("integer = [0, 3]", "integer = [-1, 3]", "bench.delay_cycles reaches -1; expected a number not below 0"),
        ("[5, 60]", "[5, 60000]", "control.gains.feedback_gain: gain feedback_gain of law 'adaptive' is 60000"),
        ("uniform = [0.6, 1.2]", "uniform = [0.6, 1.2], fixed = 1", "has uniform and fixed; expected one of"),
        ("uniform = [0.6, 1.2]", "normal = [1, 0.1], low = 0.8", "normal without high"),
        ("uniform = [0.8, 1.2]", "uniform = [-0.8, 1.2]", "known.servo_frequency reaches -0.8"),
        ('"joint_frozen"', '"joint_frosen"', "fault.kind is 'joint_frosen'; expected nothing, joint_nan"),
        ('["adaptive"]', '["adaptiv"]', "adaptive (did you mean this?)"),
        ('["adaptive"]', '["adaptive", "adaptive"]', "two of one name"),
        ("[0.6, 1.2]", "[nan, 1.2]", 'vary."cable.slope".uniform.0 is nan; expected a finite number'),
        (
            '"cable.slope"',
            '"wearer.share"',
            "vary has 'wearer.share', which changes nothing here; expected suit.worn = true",
        ),
        ("low_deg = 120.0", "low_deg = 320.0", "expected low_deg below high_deg"),
        ("[vary]", '"servo.damping" = 0.9\nservo.damping = 0.8\n\n[vary]', "set has 'servo.damping' twice"),
    ],
)
def test_what_cannot_be_is_refused(before: str, after: str, said: str, command: Command) -> None:
    assert before in STUDY
    Path("study.toml").write_text(STUDY.replace(before, after, 1))
    assert said in command.refused(*CAMPAIGN)
    assert not Path("out").exists()


def test_a_key_without_quotation_marks_is_the_same_key() -> None:
    """To TOML it is a table, which must not stand for the whole section."""
    before = load(Path("study.toml"))
    text = STUDY.replace("[vary]", '"servo.damping" = 0.8\n"servo.speed_limit_deg_per_s" = 400.0\n\n[vary]')
    Path("quoted.toml").write_text(text)
    bare = text.replace('"servo.damping"', "servo.damping").replace('"servo.natural', "servo.natural")
    bare = bare.replace('"servo.speed_limit_deg_per_s"', "servo.speed_limit_deg_per_s").replace('_hz" =', "_hz =")
    Path("bare.toml").write_text(bare)
    quoted, same = load(Path("quoted.toml")), load(Path("bare.toml"))
    assert same.rig == quoted.rig != before.rig
    assert [column.name for column in same.columns] == [column.name for column in quoted.columns]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--run", "32"], "--run is 32, and study.toml has 32 runs; expected a number from 0 to 31"),
        (["--cluster", "local:none"], "expected local:N"),
        (["--workers", "0"], "see bowden campaign --help"),
        (["--out", ""], "--out is ''"),
    ],
)
def test_options_that_cannot_be(arguments: list[str], said: str, command: Command) -> None:
    assert said in command.refused("campaign", "study.toml", *arguments)


def test_values_that_clash_in_one_run_name_it(command: Command) -> None:
    """Each end may be alone, but not every pair of them; what is computed until then is kept."""
    text = STUDY.replace('"cable.slope" =', '"scenario.bend.low_deg" = { uniform = [100, 310] }\n"cable.slope" =')
    Path("study.toml").write_text(text)
    error = command.refused(*CAMPAIGN)
    assert "low_deg" in error
    assert "expected low_deg below high_deg" in error


def test_the_cycle_may_differ_from_run_to_run(folder: Path, command: Command) -> None:
    """Also where it is longer than the rig's."""
    text = 'runs = 4\nduration_s = 0.5\n[vary]\n"bench.sample_time_ms" = { choice = [10.0, 20.0] }\n'
    (folder / "study.toml").write_text(text)
    command(*CAMPAIGN)
    rows = ds.dataset("out/runs").to_table().to_pylist()
    assert all(row["cycles"] * row["bench.sample_time_ms"] == 500.0 for row in rows)


def test_the_study_on_the_page_can_be_run(command: Command) -> None:
    page = (ROOT / "docs" / "campaign.md").read_text(encoding="utf-8")
    text = page.partition("```toml\n")[2].partition("```")[0]
    jsonschema.validate(tomllib.loads(text), json_schema("study"))
    Path("study.toml").write_text(text)
    assert main.run(["init"]) == 0
    study = load(Path("study.toml"))
    assert [law.name for law in study.laws] == ["adaptive", "bowden"]
    rig, (_, ours), fault = study.run(3)
    drawn = study.drawn(3).values
    truth = rig.servo.natural_frequency
    assert ours.gains.servo_frequency == pytest.approx(truth * float(drawn["known.servo_frequency"]))
    assert fault.end - fault.begin == 500.0

"""A console in which gains are changed while the law runs: who may, what is refused and why, what the log has."""

import json
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, example, settings
from hypothesis import given as drawn
from hypothesis import strategies as st

from bowden.live.log_facts import facts, needed
from bowden.live.mcap_read import read
from console_client import RIG, Page, RunningConsole, running_console
from live_runs import assert_replays

pytestmark = [pytest.mark.live]


@pytest.fixture(scope="module")
def console(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningConsole]:
    folder = tmp_path_factory.mktemp("console")
    (folder / "rig.toml").write_text(RIG + "[control]\nlaw = 'cascaded_pid'\n")
    with running_console(folder / "rig.toml", folder / "out", "--twin") as running:
        yield running


def gain(page: Page, name: str = "integral_gain") -> dict[str, Any]:
    found: dict[str, Any] = page.state["settings"]["gains"][name]
    return found


def change(page: Page, value: Any, name: Any = "integral_gain") -> str:
    """Ask for a gain; why it is refused at once, or empty."""
    said = page.post("/api/gain", name=name, value=value)
    return said if isinstance(said, str) else ""


def until(page: Page, how: str) -> None:
    def there(state: dict[str, Any]) -> bool:
        return bool(state["settings"]["gains"]["integral_gain"].get("change", {}).get("state") == how)

    page.until(there, 60.0, how)


def test_a_gain_is_changed_while_the_law_runs(console: RunningConsole) -> None:
    console.carried_through(changed_while_the_law_runs)


def changed_while_the_law_runs(page: Page, console: RunningConsole) -> None:
    assert gain(page)["live"]
    assert not gain(page, "derivative_time")["live"]
    assert change(page, 30.0) == "no session is live"
    page.start()
    page.run()
    begun = page.state["settings"]["gains"]

    for name in ("derivative_time", "slope"):
        status, _, said = page.request("POST", "/api/gain", json.dumps({"name": name, "value": 0.03}).encode())
        assert status == 400
        assert f"gain {name} of law 'cascaded_pid' cannot be changed" in json.loads(said)["error"]["what"]
    viewer = console.page().open()
    viewer.until(lambda state: state["run"], 5.0, "the run")
    assert change(viewer, 30.0) == "this page does not control"
    viewer.close()
    assert page.state["settings"]["gains"] == begun

    assert change(page, 30.0) == ""
    assert change(page, 31.0) == "another change of gains goes on"
    until(page, "in force")
    assert gain(page)["value"] == 30.0
    assert change(page, 400.0) == ""
    until(page, "refused")
    assert "do not hold on this rig" in gain(page)["change"]["text"]
    assert gain(page)["value"] == 30.0

    assert change(page, 35.0) == ""
    other = console.page().open().take()  # who does not control any more when the check is done changes nothing
    until(other, "refused")
    assert gain(other)["change"]["text"] == "this page does not control: take the control first"
    assert gain(other)["value"] == 30.0

    log = console.out / f"{other.state['run']['log']}.mcap"
    assert other.post("/api/request", request="end") == ""
    other.until(lambda state: state["phase"] == "idle", 30.0, "the end")
    assert gain(other)["value"] == begun["integral_gain"]["value"], "the settings are those that were set"
    found = read(log)
    asked = found["asked.integral_gain"]
    assert asked[np.flatnonzero(np.diff(asked)) + 1].tolist() == [30.0]
    (told,) = facts(read(log, needed(log))).gains
    assert (told.name, told.before, told.to) == ("integral_gain", begun["integral_gain"]["value"], 30.0)
    assert told.in_force_s - told.time_s == pytest.approx(0.5, abs=0.1)
    assert_replays(str(log))


_PLAIN = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20)
_NAME = st.sampled_from(["integral_gain", "bandwidth", "slope", "", "integral_gain.x", "__class__"]) | _PLAIN
_VALUE = st.one_of(
    st.none() | st.booleans() | st.text(max_size=20) | st.lists(_PLAIN, max_size=3),
    st.floats(max_value=-1e-9) | st.floats(min_value=1e5) | st.integers(min_value=100_000) | st.integers(max_value=-1),
    st.just(float("nan")),
)
"""Nothing that a live gain of this law may be."""


def test_nothing_that_no_gain_can_be_changes_one(console: RunningConsole) -> None:
    """While a session is live, from the page that controls: refused in words, and the console goes on."""
    page = console.in_control()
    page.start()
    begun = page.state["settings"]["gains"]

    @settings(max_examples=40, deadline=None, suppress_health_check=list(HealthCheck), database=None)
    @drawn(name=_NAME, value=_VALUE)
    @example(name="integral_gain", value=10**400)
    @example(name="integral_gain", value=-(10**400))
    @example(name="\ud800", value=1.0)
    @example(name="x" * 3000, value=1.0)
    @example(name="integral_gain", value="\ud800")
    def asked(name: Any, value: Any) -> None:
        time.sleep(0.03)  # a session's requests have a limit of their rate
        status, _, said = page.request("POST", "/api/gain", json.dumps({"name": name, "value": value}).encode())
        assert status == 400, said
        assert set(json.loads(said)["error"]) == {"what", "expected", "do"}
        assert len(said) < 2000

    asked()
    for body in (b'{"name": "integral_gain", "value": 1e999}', b'{"name": "integral_gain"}', b"[]", b'{"value": 1}'):
        assert page.request("POST", "/api/gain", body)[0] == 400
    time.sleep(0.5)
    assert page.state["settings"]["gains"] == begun
    assert page.state["run"]["mode"] == "stopped"
    assert page.post("/api/request", request="end") == ""
    page.until(lambda state: state["phase"] == "idle", 30.0, "the end")
    page.close()

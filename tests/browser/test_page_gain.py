"""A gain is changed in Chromium while the law runs: by the keyboard, by the button, and refused with the reason."""

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from bowden.live.log_facts import facts, needed
from bowden.live.mcap_read import read
from browser.test_page_run import button, end, picture, reach, ready_to_arm, running
from console_client import RIG, RunningConsole, running_console
from live_runs import assert_replays

pytestmark = [pytest.mark.browser, pytest.mark.live]


@pytest.fixture(scope="module")
def console(browser: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningConsole]:
    """With a lease that a computer shared with others does not lose: that is not what is tried here."""
    folder = tmp_path_factory.mktemp("console")
    (folder / "rig.toml").write_text(RIG + "console_lease_s = 2.0\n[control]\nlaw = 'cascaded_pid'\n")
    with running_console(folder / "rig.toml", folder / "out", "--twin") as running_one:
        yield running_one


def says(page: Any, name: str, words: str, seconds: float = 60.0) -> None:
    """Wait for what the page says of a change of this gain."""
    there = page.locator(".field", has=page.locator(f"#gain-{name}")).locator(".change")
    deadline = time.monotonic() + seconds
    while words not in (there.text_content() or ""):
        if time.monotonic() > deadline:
            said = page.locator(".banner-text, .change, .message, .problem, .fault, .noted").all_inner_texts()
            raise AssertionError(f"{words} did not come: {said}")
        page.wait_for_timeout(20)


@pytest.mark.long  # the same without a browser: test_console_gains
def test_a_gain_is_changed_while_the_law_runs(
    page: Any, console: RunningConsole, request: pytest.FixtureRequest
) -> None:
    ready_to_arm(page, console)
    running(page)
    field, other = page.locator("#gain-integral_gain"), page.locator("#gain-derivative_time")
    assert field.is_enabled()
    assert other.is_disabled()
    says(page, "derivative_time", "Locked while the law runs")
    assert not button(page, "Change derivative_time").count()
    assert button(page, "Change integral_gain").is_disabled(), "it is the value in force"

    reach(page, field)
    field.fill("30")
    page.keyboard.press("Tab")
    page.wait_for_timeout(1500)
    assert field.input_value() == "30"
    assert not page.locator(".change", has_text="in force").count(), "leaving the field sends nothing"
    reach(page, field)
    page.keyboard.press("Enter")
    says(page, "integral_gain", "Checking 30 on this rig")
    assert button(page, "Change proportional_gain").is_disabled()
    says(page, "integral_gain", "30 is in force; it was 40.")
    page.wait_for_timeout(2000)
    field.fill("400")
    button(page, "Change integral_gain").click()
    says(page, "integral_gain", "400 is refused, 30 stays in force")
    says(page, "integral_gain", "do not hold on this rig")
    button(page, "Change integral_gain").scroll_into_view_if_needed()
    picture(page, request, "live_gain")
    field.fill("-1")
    button(page, "Change integral_gain").click()
    page.locator(".message", has_text="expected: a number from 0 to 10000").wait_for(timeout=10_000)
    assert field.get_attribute("aria-invalid") == "true"
    assert page.locator(".banner-word").inner_text().startswith("Running")

    page.locator("#stop").click()
    end(page)
    assert field.input_value() == "40", "the settings are those that were set"
    assert not page.locator(".change:visible").count()
    log = max((console.out).glob("*.mcap"), key=lambda path: path.stat().st_mtime)
    assert [(one.before, one.to) for one in facts(read(Path(log), needed(log))).gains] == [(40.0, 30.0)]
    assert_replays(str(log))

"""The console's page with an invented server: every state without barriers, keys, holding, control, hostile text."""

import copy
import time
from collections.abc import Callable
from typing import Any

import pytest

from console_page import COLUMNS, FAULT, InventedServer, idle, live, states

pytestmark = [pytest.mark.browser, pytest.mark.live]

SCHEMES = ["light", pytest.param("dark", marks=pytest.mark.long)]
SIZES = {"1280x720": (1280, 720), "at 200 %": (640, 360)}


def opened(page: Any, state: dict[str, Any]) -> InventedServer:
    server = InventedServer(page, state)
    server.open()
    return server


def barriers(page: Any, axe: str) -> list[str]:
    """What axe-core finds against WCAG 2.2 A and AA, and its own good practice."""
    page.evaluate(axe)
    found = page.evaluate(
        """async () => (await axe.run(document, {runOnly: ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa",
        "best-practice"]})).violations.map(v => `${v.id}: ${v.nodes.map(n => n.target + ' ' + n.failureSummary)}`)"""
    )
    return list(found)


def overflow(page: Any) -> int:
    """By how many pixels the page is wider than its window."""
    return int(page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth"))


@pytest.mark.parametrize("scheme", SCHEMES)
def test_no_state_has_barriers(page: Any, axe: str, scheme: str) -> None:
    page.emulate_media(color_scheme=scheme)
    server = opened(page, idle())
    for name, state in states().items():
        server.show(state)
        page.wait_for_timeout(250)  # colours change within 0.15 s
        assert barriers(page, axe) == [], name


@pytest.mark.parametrize("scheme", SCHEMES)
def test_the_other_pages_have_no_barriers(page: Any, axe: str, scheme: str) -> None:
    page.emulate_media(color_scheme=scheme)
    server = opened(page, states()["step"])
    page.get_by_role("button", name="Identify and tune").click()
    assert barriers(page, axe) == []
    server.show(idle())
    page.get_by_role("button", name="Earlier runs").click()
    page.get_by_role("button", name="Open the run of 2026-11-23 14:02").click()
    page.get_by_role("heading", name="Run of").wait_for()
    page.get_by_role("button", name="Replay").click()
    page.get_by_text("of 60.0 s").wait_for()
    assert barriers(page, axe) == []
    for i in (2, 3):
        page.get_by_role("button", name=f"Compare the run of 2026-11-23 14:0{i}").click()
    page.get_by_role("button", name="Compare two").click()
    page.get_by_role("heading", name="Two runs side by side").wait_for()
    assert barriers(page, axe) == []


@pytest.mark.parametrize("size", SIZES.values(), ids=SIZES)
def test_state_and_stop_stay_in_sight_and_nothing_is_cut_off(page: Any, size: tuple[int, int]) -> None:
    page.set_viewport_size({"width": size[0], "height": size[1]})
    server = opened(page, idle())
    for name, state in states().items():
        server.show(state)
        page.wait_for_timeout(60)
        assert overflow(page) <= 0, name
        page.evaluate("scrollTo(0, document.body.scrollHeight)")
        for part in ("#stop", "#banner", ".drive"):
            box = page.locator(part).bounding_box()
            assert box["y"] >= 0, (name, part)
            assert box["y"] + box["height"] <= size[1] / 2, (name, part)
            assert box["x"] + box["width"] <= size[0], (name, part)
    page.get_by_role("button", name="Earlier runs").click()
    list_ = page.get_by_role("region", name="Earlier runs")
    list_.get_by_role("table").get_by_role("row").nth(2).wait_for()
    sideways = list_.evaluate("one => one.scrollWidth - one.clientWidth")
    assert sideways <= 0


def test_a_state_is_said_in_words_and_shape_too(page: Any) -> None:
    server = opened(page, idle())
    seen = set()
    for mode in ("stopped", "preflight", "ready", "running", "bridging", "releasing", "latched"):
        server.show(live(mode))
        page.locator(".banner-word", has_text=mode.capitalize()).wait_for()
        seen.add(page.locator(".banner-icon path").get_attribute("d"))
        assert mode.capitalize() in page.locator(".top [role=status]").inner_text()
    assert len(seen) == 7
    assert "TWIN" in page.locator(".drive").inner_text()
    server.show(states()["hardware"])
    page.locator(".drive", has_text="HARDWARE").wait_for()


def comes(page: Any, holds: Callable[[], bool]) -> bool:
    """Whether it becomes so, on a computer that may be busy."""
    deadline = time.monotonic() + 8.0
    while not holds() and time.monotonic() < deadline:
        page.wait_for_timeout(20)
    return holds()


def asked(server: InventedServer, name: str) -> int:
    if name == "stop":
        return sum(path == "/api/stop" for path, _ in server.asked)
    return sum(path == "/api/request" and body["request"] == name for path, body in server.asked)


@pytest.mark.parametrize("state", ["running", "viewer", "hardware"])
def test_stop_takes_one_click_or_a_key_from_every_page(page: Any, state: str) -> None:
    server = opened(page, states()[state])
    page.mouse.move(*(page.locator("#stop").bounding_box()[at] + 20 for at in "xy"))
    page.mouse.down()  # the press is enough
    assert comes(page, lambda: (asked(server, "stop"), sum("stop" in said for said in server.said)) == (1, 1))
    page.mouse.up()
    for number, key in enumerate(("Space", "Escape"), 2):
        page.keyboard.press(key)
        assert comes(page, lambda number=number: asked(server, "stop") == number)
    page.wait_for_timeout(300)
    assert asked(server, "stop") == 3


def test_space_types_in_a_text_and_escape_stops_there(page: Any) -> None:
    server = opened(page, idle())
    page.fill("#notes", "")
    page.locator("#notes").press_sequentially("a b")
    assert page.input_value("#notes") == "a b"
    assert asked(server, "stop") == 0
    page.keyboard.press("Escape")
    assert comes(page, lambda: asked(server, "stop") == 1)


@pytest.mark.parametrize(("mode", "button"), [("stopped", "Hold to arm"), ("ready", "Run"), ("latched", "Acknowledge")])
def test_space_on_a_button_stops_and_does_not_press_it(page: Any, mode: str, button: str) -> None:
    server = opened(page, live(mode))
    page.locator(".flow button", has_text=button).focus()
    page.keyboard.down("Space")
    page.wait_for_timeout(1200)
    page.keyboard.up("Space")
    page.wait_for_timeout(100)
    assert [path for path, _ in server.asked] == ["/api/stop"]


@pytest.mark.parametrize("by", ["pointer", "Enter"])
def test_arming_takes_a_whole_second(page: Any, by: str) -> None:
    server = opened(page, live("stopped"))
    button = page.locator(".hold")
    button.focus()
    box = button.bounding_box()
    page.mouse.move(box["x"] + 9, box["y"] + 9)

    def press(milliseconds: float) -> None:
        (page.mouse.down if by == "pointer" else lambda: page.keyboard.down("Enter"))()
        page.wait_for_timeout(milliseconds)
        (page.mouse.up if by == "pointer" else lambda: page.keyboard.up("Enter"))()
        page.wait_for_timeout(100)

    for short in (0, 300, 800):
        press(short)
        assert asked(server, "arm") == 0
    page.get_by_text("hold the button for a full second").wait_for()
    press(2500)
    assert comes(page, lambda: asked(server, "arm") == 1)


def test_stop_while_the_button_is_held_arms_nothing(page: Any) -> None:
    server = opened(page, live("stopped"))
    page.locator(".hold").focus()
    page.keyboard.down("Enter")
    page.wait_for_timeout(500)
    page.keyboard.press("Space")
    page.wait_for_timeout(900)
    page.keyboard.up("Enter")
    assert comes(page, lambda: asked(server, "stop") == 1)
    assert asked(server, "arm") == 0


def test_a_stop_of_another_page_while_the_button_is_held_arms_nothing(page: Any) -> None:
    server = opened(page, live("stopped") | {"stops": 1})
    page.locator(".hold").focus()
    page.keyboard.down("Enter")
    page.wait_for_timeout(300)
    server.show(live("stopped") | {"stops": 2})
    page.wait_for_timeout(1500)
    page.keyboard.up("Enter")
    assert asked(server, "arm") == 0


def test_what_did_not_end_as_asked_is_not_said_to_be_without_power(page: Any) -> None:
    ended = {"mode": "running", "reason": "", "error": "the loop's process has gone"}
    server = opened(page, live("running", ended=ended | {"well": False}, power=False) | {"phase": "idle"})
    assert page.locator(".banner-word").inner_text() == "Ended badly"
    assert "make sure at the rig" in page.locator(".banner-meaning").inner_text()
    server.show(live("stopped", ended=ended | {"well": True}, power=False) | {"phase": "idle"})
    page.locator(".banner-word", has_text="Ended").filter(has_not_text="badly").wait_for()


def test_a_refused_value_does_not_stay_as_if_it_were_set(page: Any) -> None:
    opened(page, idle())
    refused = {"error": {"what": "gain eta is -1", "expected": "0 to 200", "do": "correct it"}}
    page.route("**/api/settings", lambda route: route.fulfill(status=400, json=refused))
    field = page.get_by_label("eta [1/s]")
    field.fill("-1")
    field.press("Enter")
    page.get_by_text("gain eta is -1").wait_for()
    page.locator("#subject").focus()
    assert comes(page, lambda: field.input_value() == "12.5")


def test_gains_that_do_not_hold_cannot_be_started(page: Any) -> None:
    server = opened(page, states()["refused"])
    page.get_by_text("Does not hold: cannot be armed").wait_for()
    assert page.get_by_role("button", name="Start", exact=True).is_disabled()
    assert page.locator(".hold").is_disabled()
    server.show(states()["checked"])
    page.get_by_text("The gains hold.").wait_for()
    assert page.get_by_role("button", name="Start", exact=True).is_enabled()


def test_a_viewer_can_only_look_stop_and_take_over_on_purpose(page: Any) -> None:
    server = opened(page, states()["viewer"])
    page.get_by_text("Another page controls").wait_for()
    for button in page.locator(".flow button").all():
        assert button.is_disabled()
    page.get_by_role("button", name="Take over", exact=True).click()
    assert server.asked == []
    page.get_by_role("button", name="Yes, take over").click()
    comes(page, lambda: bool(server.asked))
    assert server.asked == [("/api/control", {"take": True})]


def lives(server: InventedServer) -> list[int]:
    return [said["life"] for said in server.said if "life" in said]


def test_only_the_page_in_control_gives_signs_of_life_ten_a_second(page: Any) -> None:
    server = opened(page, states()["viewer"])
    page.wait_for_timeout(500)
    assert lives(server) == []
    server.show(live("running"))
    page.wait_for_timeout(2000)
    given = lives(server)
    assert given == list(range(1, len(given) + 1))
    assert 12 <= len(given) <= 24
    server.show(states()["viewer"])
    page.wait_for_timeout(200)
    before = len(lives(server))
    page.wait_for_timeout(400)
    assert len(lives(server)) == before


def test_a_lost_connection_is_said_and_stop_says_that_it_was_not_sent(page: Any) -> None:
    server = opened(page, live("running"))
    page.route("**/api/stop", lambda route: route.abort())
    server.lose()
    page.locator(".banner-word", has_text="No connection").wait_for()
    assert "hardware emergency stop" in page.locator(".banner-meaning").inner_text()
    page.keyboard.press("Space")
    page.get_by_text("Stop was NOT taken").wait_for()


def test_a_frozen_server_is_a_lost_one_within_a_second_and_comes_back(page: Any) -> None:
    """Its socket is open and says nothing: nothing is shown as if it were so now, and nothing gives power."""
    server = opened(page, live("running"))
    page.wait_for_timeout(1500)
    assert page.locator(".banner-word").inner_text() == "Running"
    waiting: list[Any] = []
    page.route("**/api/stop", lambda route: waiting.append(route))  # never answered
    server.freeze()
    began = time.monotonic()
    page.locator(".banner-word", has_text="No connection").wait_for()
    assert time.monotonic() - began < 3.0
    meaning = page.locator(".banner-meaning").inner_text()
    assert "No news from the rig for" in meaning
    assert "this page cannot stop it. Use the hardware emergency stop" in meaning
    page.get_by_text("everything below is as it was, not as it is").wait_for()
    assert page.locator(".time-value").all_inner_texts() == ["–", "–"]
    for button in page.locator(".flow button").all():
        assert button.is_disabled()
    assert page.locator("#stop").is_enabled()
    assert "may not get there" in page.locator("#stop").inner_text()
    page.locator("#stop").click()
    page.get_by_text("it may not get there").wait_for()
    page.get_by_text("has not answered the stop").wait_for()
    assert len(waiting) == 1
    page.evaluate("window.silent = false")
    page.locator(".banner-word", has_text="Running").wait_for()
    assert not page.get_by_text("everything below is as it was").is_visible()


@pytest.mark.parametrize("mode", ["stopped", "ready"])
def test_arming_and_running_carry_what_the_page_saw(page: Any, mode: str) -> None:
    server = opened(page, live(mode))
    page.wait_for_timeout(1000)
    button = page.locator(".hold") if mode == "stopped" else page.get_by_role("button", name="Run", exact=True)
    button.focus()
    page.keyboard.down("Enter")
    page.wait_for_timeout(1500)
    page.keyboard.up("Enter")
    assert comes(page, lambda: any(path == "/api/request" for path, _ in server.asked))
    (body,) = [body for path, body in server.asked if path == "/api/request"]
    assert body["seen"] > 1001


@pytest.mark.parametrize("key", ["Space", "Escape"])
def test_keys_stop_also_where_a_frame_had_the_focus(page: Any, key: str) -> None:
    """A page in a frame has its own keys: it gives the focus back once a rig is started, and takes none."""
    server = opened(page, idle())
    page.get_by_role("button", name="Earlier runs").click()
    page.get_by_role("button", name="Open the run of 2026-11-23 14:03").click()
    page.get_by_role("button", name="Log page").click()
    page.frame_locator("iframe").get_by_text("log page").click()
    assert page.evaluate("document.activeElement.tagName") == "IFRAME"
    before = len(lives(server))
    page.wait_for_timeout(500)
    assert len(lives(server)) <= before + 1, "no sign of life while keys go elsewhere"
    server.show(live("running"))
    page.get_by_text("this page can be looked at and not used").wait_for()
    assert page.evaluate("document.activeElement.tagName") != "IFRAME"
    page.keyboard.press(key)
    assert comes(page, lambda: asked(server, "stop") == 1)
    box = page.locator("iframe").bounding_box()
    page.mouse.click(box["x"] + 20, box["y"] + 20)
    for _ in range(12):
        page.keyboard.press("Tab")
        assert page.evaluate("document.activeElement.tagName") != "IFRAME"
    page.keyboard.press(key)
    assert comes(page, lambda: asked(server, "stop") == 2)


def test_no_text_of_a_rig_a_log_or_a_note_becomes_html(page: Any) -> None:
    evil = "<img src=x onerror=\"document.title='broken'\"><script>document.title='broken'</script>"
    state = live("latched")
    state["rig"] |= {"name": evil, "hash": evil, "bus": evil}
    state["settings"] |= {"law": evil, "laws": [evil], "subject": evil, "notes": evil}
    state["settings"]["gains"] = {evil: {"value": 1.0, "unit": evil, "meaning": evil}}
    state["check"] |= {"text": evil, "rows": [[evil, evil]]}
    columns = copy.deepcopy(COLUMNS)
    columns[0] |= {"title": evil, "group": evil, "unit": evil}
    fault = FAULT | {"meaning": evil, "remedy": evil}
    state["run"] |= {
        "first_fault": fault,
        "consequences": [fault],
        "next": evil,
        "estimates": {evil: 1.0},
        "lost": evil,
    }
    state["run"] |= {"events": [{"at": 1.0, "text": evil}], "log": evil, "columns": columns, "notes": [evil]}
    state["error"] = {"what": evil, "expected": evil, "do": evil}
    server = InventedServer(page, state)
    page.goto("http://console.test/")
    page.locator(".fault-title").wait_for()
    server.send_curves()
    page.wait_for_timeout(300)
    assert page.locator("img, main script, iframe").count() == 0
    assert "broken" not in page.title().replace(evil, "")
    assert page.locator(".rig-name").inner_text() == evil


def test_a_report_opens_in_a_frame_without_scripts(page: Any) -> None:
    opened(page, idle())
    page.get_by_role("button", name="Earlier runs").click()
    page.get_by_role("button", name="Open the run of 2026-11-23 14:03").click()
    page.get_by_role("button", name="Log page").click()
    page.frame_locator("iframe").get_by_text("log page").wait_for()
    assert page.locator("iframe").get_attribute("sandbox") == ""
    assert page.title() != "x"


def test_curves_are_drawn_halted_zoomed_and_chosen(page: Any) -> None:
    server = opened(page, live("running"))
    page.locator(".panel").nth(4).wait_for()
    assert comes(page, lambda: page.locator(".panel .value").first.inner_text().endswith("°"))
    assert server.view["columns"] == [column["name"] for column in COLUMNS[:8]]
    page.select_option("select[aria-label='Window of time']", "120")
    assert comes(page, lambda: server.view["seconds"] == 120)
    page.get_by_text("Choose traces").click()
    page.get_by_role("button", name="lateness").press("Enter")
    assert comes(page, lambda: "lateness_us" in server.view["columns"])
    page.locator(".plots").focus()
    page.keyboard.press("p")
    page.get_by_text("Curves are halted").wait_for()
    page.keyboard.press("+")
    page.keyboard.press("ArrowLeft")
    page.get_by_role("button", name="Back to now").press("Enter")
    assert page.get_by_text("Curves are halted").count() == 0

"""The console's page with an invented server: any state can be shown without a rig."""

import copy
import json
import math
import struct
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

STATIC = Path(__file__).parents[1] / "src" / "bowden" / "console" / "static"
ORIGIN = "http://console.test"
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; "
    "connect-src 'self' ws://console.test; frame-src 'self'"
)
TYPES = {".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml"}

SHOWN = [
    ("reference_deg", "reference", "°", "motion", None, None),
    ("joint_deg", "joint", "°", "motion", None, 110.0),
    ("motor_deg", "motor", "°", "motion", None, None),
    ("error_deg", "error", "°", "error", None, None),
    ("command_deg", "command", "°", "command", None, None),
    ("requested_target_deg", "requested_target", "°", "command", None, None),
    ("current_a", "motor current", "A", "current", -8.0, 8.0),
    ("winding_c", "winding", "°C", "temperature", None, 155.0),
]
COLUMNS = [
    {"name": n, "title": t, "unit": u, "group": g, "low": low, "high": high} for n, t, u, g, low, high in SHOWN
] + [{"name": "lateness_us", "title": "lateness", "unit": "µs", "group": "loop", "low": None, "high": 5000.0}]
FAULT = {
    "name": "JOINT_FROZEN",
    "at": 8.412,
    "meaning": "joint angle does not change",
    "remedy": "look at the joint encoder, its coupling and the cable",
}
FOLLOWS = [
    {"name": "NOT_FOLLOWING", "at": 8.531, "meaning": "motor does not follow its model", "remedy": "look for a jam"},
    {"name": "DRIVE_DROPPED", "at": 8.6, "meaning": "drive switched off by itself", "remedy": "look at its supply"},
]
STEPS = ["Drive enables", "Sensors are quiet", "Motor moves out and joint follows", "Motor comes back", "Ready to run"]


def preflight(done: int, failed: bool = False) -> list[dict[str, str]]:
    states = ["done" if i < done else "waiting" for i in range(len(STEPS))]
    if done < len(STEPS):
        states[done] = "failed" if failed else "going"
    said = {"failed": "the joint stood still while the motor moved by 12°"}
    return [{"name": name, "state": s, "said": said.get(s, "")} for name, s in zip(STEPS, states, strict=True)]


def idle() -> dict[str, Any]:
    """A twin, of which nothing is started."""
    return {
        "rig": {
            "name": "bench with a worn cable",
            "hash": "4f1c9a77be02d55310aa",
            "drive": "twin",
            "bus": "unix",
            "faults": [{"name": "encoder_frozen joint", "title": "joint encoder keeps its value"}],
        },
        "you": {"controls": True, "viewers": 1, "controller": "since 14:03:21"},
        "phase": "idle",
        "settings": {
            "law": "adaptive",
            "laws": [
                {"name": "none", "title": "none"},
                {"name": "adaptive", "title": "adaptive"},
                {"name": "bowden", "title": "bowden"},
            ],
            "preset": "paper",
            "presets": [{"name": "paper", "title": "paper"}, {"name": "tuned", "title": "tuned"}],
            "gains": {
                "eta": {
                    "value": 12.5,
                    "low": 0.0,
                    "high": 200.0,
                    "unit": "1/s",
                    "meaning": "how fast the width is learned",
                    "live": False,
                },
                "sigma": {
                    "value": 0.02,
                    "low": 0.0,
                    "high": 1.0,
                    "unit": "1",
                    "meaning": "leak of what is learned",
                    "live": False,
                },
            },
            "reference": {
                "kind": "periodic_minimum_jerk",
                "kinds": ["periodic_minimum_jerk", "point_to_point", "chirp"],
                "fields": {
                    "low_deg": {"value": 0.0, "low": -720.0, "high": 720.0, "unit": "°", "meaning": "lower end"},
                    "high_deg": {"value": 70.0, "low": -720.0, "high": 720.0, "unit": "°", "meaning": "upper end"},
                    "period_s": {"value": 10.0, "low": 0.0, "high": 100000.0, "unit": "s", "meaning": "there and back"},
                },
            },
            "duration": 60.0,
            "subject": "",
            "session": "",
            "notes": "",
            "locked": False,
        },
        "check": None,
        "run": None,
        "path": {
            "step": "measure",
            "running": False,
            "fraction": None,
            "files": [],
            "said": "",
            "next": "Begin with Measure.",
            "steps": [],
        },
        "error": None,
    }


def checked(holds: bool = True) -> dict[str, Any]:
    state = idle()
    state["check"] = {
        "running": False,
        "holds": holds,
        "name": "holds" if holds else "diverges",
        "text": "Stable on the nominal cable and on 40 others."
        if holds
        else "The joint runs away after 3.2 s: lower eta.",
        "rows": [["gain margin", "2.9"], ["phase margin", "48°"], ["delay margin", "11 ms"]],
        "of": "77ab",
    }
    return state


def live(mode: str, **changes: Any) -> dict[str, Any]:
    """A run in a mode."""
    state = checked()
    state["phase"] = "live"
    state["settings"]["locked"] = True
    powered = mode in ("preflight", "ready", "running", "bridging", "releasing")
    done = {"stopped": 0, "preflight": 2}.get(mode, len(STEPS))
    said = {
        "stopped": "Hold the button Arm for a second: the motor gets power.",
        "preflight": "Wait for the preflight.",
        "ready": "Preflight passed. Press Run.",
        "running": "Stop with Space.",
        "latched": "Correct the cause, then acknowledge.",
    }
    state["run"] = {
        "mode": mode,
        "power": powered,
        "preflight": preflight(done)
        if mode != "stopped"
        else [{"name": n, "state": "waiting", "said": ""} for n in STEPS],
        "elapsed": 0.0 if mode in ("stopped", "preflight", "ready") else 21.4,
        "remaining": 60.0 if mode in ("stopped", "preflight", "ready") else 38.6,
        "first_fault": None,
        "consequences": [],
        "events": [
            {"at": 0.002, "text": "stopped"},
            {"at": 4.1, "text": "armed by page 1"},
            {"at": 6.73, "text": "preflight passed"},
        ],
        "next": said.get(mode, ""),
        "log": "bowden-1",
        "columns": COLUMNS,
        "estimates": {"width": 8.31, "slope": 0.94},
        "lateness": {"median_us": 61.0, "most_us": 412.0, "overruns": 0},
        "recorder": "recording",
        "lost": "",
        "drive_said": "",
        "notes": [],
        "ended": None,
    }
    if mode == "latched":
        state["run"] |= {"first_fault": FAULT, "consequences": FOLLOWS}
    state["run"] |= changes
    return state


def states() -> dict[str, dict[str, Any]]:
    """Every state that the page must show."""
    hardware = live("running")
    hardware["rig"] |= {"drive": "hardware", "bus": "socketcan can0", "name": "suit, left elbow", "faults": []}
    viewer = live("running")
    viewer["you"] = {"controls": False, "viewers": 3, "controller": "since 14:03:21"}
    broken = live(
        "stopped",
        preflight=preflight(2, failed=True),
        first_fault=FAULT | {"meaning": "preflight failed, or armed for too long"},
    )
    step = idle()
    step["phase"] = "step"
    step["path"] = {
        "step": "identify",
        "running": True,
        "fraction": 0.4,
        "files": [],
        "said": "fits model 3 of 7",
        "next": "Wait.",
        "steps": [
            {
                "name": "measure",
                "state": "done",
                "said": "61 s of motion",
                "files": ["cable.csv", "servo.csv"],
                "page": None,
            },
            {"name": "identify", "state": "going", "said": "fits model 3 of 7", "files": [], "page": None},
        ],
    }
    checking = idle()
    checking["phase"], checking["check"] = (
        "checking",
        {"running": True, "holds": False, "name": "", "text": "", "rows": [], "of": ""},
    )
    error = idle()
    error["error"] = {"what": "the loop did not start", "expected": "a bus that answers", "do": "look at the bus cable"}
    unsure = checked()
    unsure["check"] |= {"name": "not known", "text": "the model has no friction: margins are not known"}
    return {
        "idle": idle(),
        "unsure": unsure,
        "checking": checking,
        "checked": checked(),
        "refused": checked(False),
        "stopped": live("stopped"),
        "preflight": live("preflight"),
        "preflight-failed": broken,
        "ready": live("ready"),
        "running": live("running"),
        "hardware": hardware,
        "viewer": viewer,
        "bridging": live("bridging"),
        "releasing": live("releasing"),
        "latched": live("latched"),
        "step": step,
        "error": error,
    }


def value(column: str, t: float) -> float:
    """An invented signal."""
    phase = 0.5 - 0.5 * math.cos(2.0 * math.pi * t / 5.0)
    slope = math.sin(2.0 * math.pi * t / 5.0)
    reference = 70.0 * phase
    return {
        "reference_deg": reference,
        "joint_deg": reference - 2.0 * slope,
        "motor_deg": reference * 1.2 + 9.0 * math.tanh(6.0 * slope),
        "error_deg": -2.0 * slope,
        "command_deg": reference * 1.2 + 9.2 * math.tanh(6.0 * slope),
        "requested_target_deg": reference * 1.2 + 9.4 * math.tanh(6.0 * slope),
        "current_a": 1.2 + 1.7 * slope,
        "winding_c": 41.0 + t / 20.0,
    }.get(column, 60.0 + 20.0 * math.sin(40.0 * t))


def frame(view: dict[str, Any], begin: float, end: float, kind: int = 2) -> bytes:
    """A frame of the invented signals."""
    step = view["seconds"] / view["pixels"]
    first, last = round(begin / step), round(end / step)
    pixels = last - first
    head = struct.pack("<BBHIdd", kind, len(view["columns"]), pixels, view.get("number", 0), first * step, step)
    body = b"".join(
        struct.pack("<ff", low - 0.05 * abs(math.sin(137.0 * k)), low + 0.05 * abs(math.sin(91.0 * k)))
        for name in view["columns"]
        for k in range(first, last)
        for low in (value(name, k * step),)
    )
    return head + body


def strokes(view: dict[str, Any]) -> bytes:
    """Joint over motor."""
    pairs = [(value("motor_deg", 0.01 * i), value("joint_deg", 0.01 * i)) for i in range(1000)]
    return struct.pack("<BBHII", 3, 0, 0, view["number"], len(pairs)) + b"".join(struct.pack("<ff", *p) for p in pairs)


EARLIER = [
    {
        "id": f"bowden-{i}",
        "time": f"2026-11-23 14:0{i}",
        "law": law,
        "rig": "bench with a worn cable",
        "subject": who,
        "session": "a",
        "rmse_deg": rmse,
        "seconds": 60.0,
        "how": how,
        "first_fault": fault,
    }
    for i, law, who, rmse, how, fault in [
        (3, "bowden", "S02", 0.271, "ended as asked", None),
        (2, "adaptive", "S02", 0.412, "ended by a fault", "joint angle does not change"),
        (1, "none", "S01", 4.371, "stopped by the operator", None),
    ]
]


BEATS = """
window.silent = false;
window.WebSocket = class extends window.WebSocket {
  constructor(...given) {
    super(...given);
    let stamp = 1000;
    setInterval(() => {
      if (this.readyState !== 1 || window.silent) return;
      stamp += 1;
      this.onmessage?.(new MessageEvent("message", { data: JSON.stringify({ beat: stamp }) }));
    }, 100);
  }
};
"""
"""Each socket hears ten times a second that the last state still holds, until ``window.silent``."""


class InventedServer:
    """Answers the page's requests in its own browser; what was asked stands in ``asked``."""

    def __init__(self, page: Any, state: dict[str, Any]) -> None:
        self.page = page
        self.state = copy.deepcopy(state)
        self.asked: list[tuple[str, Any]] = []
        self.said: list[dict[str, Any]] = []
        self.view: dict[str, Any] = {}
        self.sockets: list[Any] = []
        self.answer = ""
        self.gone = False
        self.time = 20.0
        page.route(f"{ORIGIN}/**", self._request)
        page.route_web_socket(f"{ORIGIN.replace('http', 'ws')}/stream", self._socket)

    def open(self) -> None:
        self.page.goto(f"{ORIGIN}/")
        self.page.locator(".rig-name", has_text=self.state["rig"]["name"]).wait_for()

    def show(self, state: dict[str, Any]) -> None:
        self.state = copy.deepcopy(state)
        self._send(json.dumps({"state": self.state, "beat": 1}))

    def freeze(self) -> None:
        """It says nothing more, and its socket stays open."""
        self.page.evaluate("window.silent = true")

    def lose(self) -> None:
        """The connection breaks, and no other one can be made."""
        self.gone = True
        for socket in self.sockets:
            socket.close()

    def send_curves(self) -> None:
        if self.view.get("columns"):
            self._send(frame(self.view, self.time - self.view["seconds"], self.time))
            if self.view.get("xy"):
                self._send(strokes(self.view))

    def _send(self, message: str | bytes) -> None:
        for socket in self.sockets:
            socket.send(message)

    def _socket(self, socket: Any) -> None:
        if self.gone:
            socket.close()
            return
        self.sockets.append(socket)
        socket.on_message(self._message)
        socket.send(json.dumps({"tab": "t1"}))
        socket.send(json.dumps({"state": self.state, "beat": 1}))

    def _message(self, message: str) -> None:
        said = json.loads(message)
        self.said.append(said)
        if "view" in said:
            self.view = said["view"]
            self.send_curves()

    def _request(self, route: Any) -> None:
        url, method = urlsplit(route.request.url), route.request.method
        path = "/static/index.html" if url.path == "/" else url.path
        if path.startswith("/static/") and (STATIC / path.removeprefix("/static/")).is_file():
            file = STATIC / path.removeprefix("/static/")
            headers = {"Content-Type": TYPES[file.suffix], "Content-Security-Policy": POLICY}
            begin = BEATS.encode() if file.name == "console.js" else b""
            route.fulfill(body=begin + file.read_bytes(), headers=headers)
            return
        if method == "POST":
            body = json.loads(route.request.post_data or "{}")
            self.asked.append((url.path, body))
            route.fulfill(json={"answer": self.answer} if url.path == "/api/request" else self.state)
            return
        if url.path == "/api/runs":
            words = parse_qs(url.query).get("search", [""])[0]
            route.fulfill(json=[run for run in EARLIER if words in json.dumps(run)])
        elif url.path.endswith("/curves"):
            asked = {name: values[0] for name, values in parse_qs(url.query).items()}
            begin, end = float(asked["from"]), float(asked["to"])
            view = {"columns": asked["columns"].split(","), "pixels": int(asked["pixels"]), "seconds": end - begin}
            route.fulfill(body=frame(view, begin, end), content_type="application/octet-stream")
        elif url.path.endswith("/page.html"):
            route.fulfill(body="<h1>log page</h1><script>parent.document.title='x'</script>", content_type="text/html")
        elif url.path.startswith("/api/runs/"):
            run = next(one for one in EARLIER if url.path.endswith(one["id"]))
            more = {
                "notes": "first try with the new sheath",
                "metrics": [["RMSE", f"{run['rmse_deg']} °"], ["largest error", "1.9 °"]],
                "events": [{"at": 0.0, "text": "stopped"}, {"at": 3.2, "text": "armed"}],
                "columns": COLUMNS,
                "from": 0.0,
                "to": 60.0,
                "first_fault": FAULT if run["first_fault"] else None,
                "consequences": FOLLOWS if run["first_fault"] else [],
            }
            route.fulfill(json=run | more)
        else:
            route.fulfill(status=404, json={"error": {"what": "no such page", "expected": "", "do": "look elsewhere"}})

/** The page of `bowden console`. */

import "uplot/dist/uPlot.min.css";
import "./console.css";
import { Curves } from "./curves";
import { attribute, h, hidden, text } from "./dom";
import { flow } from "./flow";
import { header } from "./header";
import { watchKeys } from "./keys";
import { Link } from "./link";
import { path } from "./path";
import { runs } from "./runs";
import { guardFrames } from "./sandbox";
import { settings } from "./settings";
import { status } from "./status";

const link = new Link();

const message = h("p", { class: "message", role: "status" });
const dismiss = h("button", { type: "button", class: "small", onclick: () => say("") }, "Close");
const messageBar = h("section", { class: "message-bar", "aria-label": "Message" }, message, dismiss);
messageBar.hidden = true;
let fade = 0;
function say(words: string, bad = false): void {
  text(message, words);
  messageBar.hidden = words === "";
  attribute(messageBar, "class", `message-bar${bad ? " bad" : ""}`);
  window.clearTimeout(fade);
  if (words && !bad) fade = window.setTimeout(() => say(""), 6000);
}

const top = header(link, say);
const way = flow(link, say);
const form = settings(link, say);
const seen = status(link, say);
const earlier = runs(say);

let views = 0;
const curves = new Curves({
  kind: "live",
  empty: "Curves appear here when the rig is started.",
  wanted: (view) => {
    if (view.columns.length === 0) return;
    views += 1;
    link.show({ ...view, number: views });
  },
});
link.onframe = (frame) => {
  if (frame.view === views) curves.take(frame);
};
link.onstrokes = (strokes) => {
  if (strokes.view === views) curves.takeStrokes(strokes);
};

const guided = path(link, say, () => show("run"));
const rooms: Record<string, HTMLElement> = {
  run: h(
    "div",
    { class: "page live" },
    h("div", { class: "column do" }, way.element),
    h("div", { class: "column form" }, form.element, seen.check),
    h("div", { class: "column see" }, curves.element),
    h("div", { class: "column tell" }, seen.preflight, curves.strokes.element, seen.estimates, seen.events, seen.inject),
  ),
  path: guided.element,
  runs: earlier.element,
};
const TITLES: Record<string, string> = { run: "Rig", path: "Identify and tune", runs: "Earlier runs" };
const tabs = Object.keys(rooms).map((name) => h("button", { type: "button", class: "tab", "data-page": name, onclick: () => show(name) }, TITLES[name]!));
function show(name: string): void {
  for (const [other, room] of Object.entries(rooms)) room.hidden = other !== name;
  for (const tab of tabs) attribute(tab, "aria-current", tab.dataset.page === name ? "page" : null);
  if (name === "runs") earlier.open();
}

const problem = h("p", { class: "problem", role: "alert" });
problem.hidden = true;
const old = h("p", { class: "old" }, "No news from the rig: everything below is as it was, not as it is.");
old.hidden = true;
document.body.append(
  h("a", { class: "skip", href: "#main" }, "Skip to content"),
  top.element,
  h("div", { class: "under" }, h("nav", { "aria-label": "Pages" }, ...tabs), h("aside", { class: "emergency", id: "stop-help", "aria-label": "About stop" }, "Stop here does not replace the hardware emergency stop. Space stops, but in a text field; Esc stops everywhere.")),
  h("main", { id: "main", tabindex: -1 }, old, problem, seen.fault, seen.noted, ...Object.values(rooms)),
  messageBar,
);
show("run");

let log: string | null = null;
function update(): void {
  top.update();
  way.update();
  form.update();
  seen.update();
  guided.update();
  guardFrames(link.busy());
  const state = link.state;
  if (!state) return;
  hidden(old, link.connected);
  const error = state.error;
  hidden(problem, error === null);
  if (error) text(problem, [error.what, error.expected && `expected: ${error.expected}`, error.do].filter(Boolean).join(". "));
  const run = state.run;
  attribute(rooms.run!, "class", `page live${run === null ? " fresh" : ""}`);
  if (run && run.log !== log) {
    log = run.log;
    curves.clear();
  }
  if (run) curves.setColumns(run.columns);
  if (!rooms.run!.hidden) curves.fit();
}
link.listen(update);
link.onchange = update;

watchKeys(top.stop, () => link.busy());

function frame(now: number): void {
  if (!rooms.run!.hidden) curves.draw(now);
  if (!rooms.runs!.hidden) earlier.draw(now);
  requestAnimationFrame(frame);
}
requestAnimationFrame(frame);
link.start();
update();

declare global {
  interface Window {
    /** For tests, and for those who look for a fault: when frames were drawn, and signs of life that were sent. */
    bowdenConsole: { drawn: () => { at: number; took: number }[]; beats: () => number };
  }
}
window.bowdenConsole = { drawn: () => curves.drawn.slice(), beats: () => link.beats };

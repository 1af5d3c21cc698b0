/** Earlier runs: list, search, one of them, two side by side, replay. */

import { Curves, type View } from "./curves";
import { attribute, h, hidden, moment, number, refill, text } from "./dom";
import type { Say } from "./flow";
import { openPage } from "./sandbox";
import { eventList, faultBody, row } from "./status";
import { Refused, decode, get, getBytes, type Earlier, type Fault, type OneRun } from "./wire";

const SPEEDS = [0.25, 0.5, 1, 2, 5, 10];
/** Of the list. Its roles are written out: where it is narrow each run is a block, and a browser takes it for no table any more. */
const COLUMNS = ["Time", "Law", "Rig", "Subject", "Session", "RMSE [°]", "Length [s]", "How it ended", "First fault"];
const OVERVIEW = ["reference_deg", "joint_deg", "error_deg"];

export interface Runs {
  element: HTMLElement;
  /** Called when the page comes into sight. */
  open: () => void;
  draw: (now: number) => void;
  curves: () => Curves | null;
}

export function runs(say: Say): Runs {
  const search = h("input", { type: "search", id: "search", autocomplete: "off", maxlength: 200 });
  const body = h("tbody", { role: "rowgroup" });
  const empty = h("p", { class: "empty" }, "Reading the runs…");
  const compare = h("button", { type: "button", class: "small", onclick: () => void showTwo() }, "Compare two");
  const chosenText = h("span", { class: "hint" });
  const shown = h("div", { class: "one" });
  const table = h(
    "div",
    { class: "wide", tabindex: 0, role: "region", "aria-label": "Earlier runs" },
    h(
      "table",
      { class: "list earlier", role: "table" },
      h("thead", { role: "rowgroup" }, h("tr", { role: "row" }, ...COLUMNS.map((title) => h("th", { scope: "col", role: "columnheader" }, title)), h("td", { role: "cell" }))),
      body,
    ),
  );
  const element = h("div", { class: "page runs" }, h("div", { class: "bar" }, h("label", { class: "inline", for: "search" }, "Search "), search, compare, chosenText), empty, table, shown);
  let chosen: string[] = [];
  let replaying: Replay | null = null;
  let asked = 0;

  search.addEventListener("input", () => void load());
  const trouble = (error: unknown) => say(error instanceof Refused ? `${error.problem.what}. ${error.problem.do}.` : "The console does not answer.", true);

  async function load(): Promise<void> {
    const mine = ++asked;
    try {
      const list = (await get(`/api/runs?search=${encodeURIComponent(search.value)}`)) as Earlier[];
      if (mine !== asked) return;
      hidden(empty, list.length > 0);
      hidden(table, list.length === 0);
      text(empty, search.value ? "No run has these words." : "No run is in this folder yet.");
      refill(body, list, () => list.map(line));
      marks();
    } catch (error) {
      trouble(error);
    }
  }

  function line(run: Earlier): HTMLElement {
    const values = [moment(run.time), run.law, run.rig, run.subject, run.session, number(run.rmse_deg), run.seconds === null ? "–" : run.seconds.toFixed(1), run.how, faultName(run.first_fault)];
    const kinds = ["time", "", "", "", "", "number", "number", "", ""];
    return h(
      "tr",
      { role: "row" },
      ...values.map((words, at) => h("td", { class: kinds[at], role: "cell", "data-title": COLUMNS[at] }, words)),
      h(
        "td",
        { class: "acts", role: "cell" },
        h("button", { type: "button", class: "small", "aria-label": `Open the run of ${moment(run.time)}`, onclick: () => void showOne(run.id) }, "Open"),
        h("button", { type: "button", class: "small", "data-run": run.id, "aria-pressed": "false", "aria-label": `Compare the run of ${moment(run.time)}`, onclick: () => pick(run.id) }, "Compare"),
      ),
    );
  }

  function pick(id: string): void {
    chosen = chosen.includes(id) ? chosen.filter((other) => other !== id) : [...chosen, id].slice(-2);
    marks();
  }
  function marks(): void {
    for (const button of body.querySelectorAll<HTMLElement>("[data-run]")) attribute(button, "aria-pressed", String(chosen.includes(button.dataset.run ?? "")));
    compare.disabled = chosen.length !== 2;
    text(chosenText, chosen.length === 2 ? "Two runs are chosen." : "Press Compare at two runs.");
  }
  marks();

  const one = async (id: string) => (await get(`/api/runs/${encodeURIComponent(id)}`)) as OneRun;

  async function showOne(id: string): Promise<void> {
    try {
      const run = await one(id);
      replaying = null;
      const at = `/api/runs/${encodeURIComponent(id)}`;
      const page = h("div", { class: "opened" });
      const title = h("h2", { tabindex: -1 }, `Run of ${moment(run.time)}`);
      const files = ["mcap", "parquet", "csv"].map((kind) => h("a", { class: "small button", href: `${at}/log.${kind}`, download: true }, kind.toUpperCase()));
      const player = h("div", {});
      shown.replaceChildren(
        title,
        h("p", {}, [run.law, run.rig, run.subject && `subject ${run.subject}`, run.session && `session ${run.session}`].filter(Boolean).join(" · ")),
        run.notes ? h("p", { class: "notes" }, run.notes) : "",
        h(
          "div",
          { class: "bar" },
          h("span", {}, "Download"),
          ...files,
          h("button", { type: "button", class: "small", onclick: () => openPage(page, `${at}/page.html`, "Log page") }, "Log page"),
          h("button", { type: "button", class: "small", onclick: () => replay(run, player) }, "Replay"),
        ),
        player,
        ...(run.first_fault && typeof run.first_fault === "object" ? [h("section", { class: "fault", "aria-label": "First fault" }, ...faultBody(run.first_fault, run.consequences ?? []))] : []),
        h(
          "div",
          { class: "two" },
          h("section", { class: "card" }, h("h3", {}, "Metrics"), h("dl", { class: "rows" }, ...run.metrics.map(([name, value]) => row(name, value)))),
          h("section", { class: "card" }, h("h3", {}, "Events"), h("ol", { class: "events", tabindex: 0, "aria-label": "Events" }, ...eventList(run.events))),
        ),
        page,
      );
      title.focus();
      title.scrollIntoView({ block: "nearest" });
    } catch (error) {
      trouble(error);
    }
  }

  function replay(run: OneRun, into: HTMLElement): void {
    replaying = new Replay(run, trouble);
    into.replaceChildren(replaying.element);
    replaying.element.scrollIntoView({ block: "nearest" });
  }

  async function showTwo(): Promise<void> {
    const [a, b] = chosen;
    if (!a || !b) return;
    try {
      const pair = await Promise.all([one(a), one(b)]);
      replaying = null;
      const names = [...new Set(pair.flatMap((run) => run.metrics.map(([name]) => name)))];
      const value = (run: OneRun, name: string) => run.metrics.find(([other]) => other === name)?.[1] ?? "–";
      const title = h("h2", { tabindex: -1 }, "Two runs side by side");
      stills = [];
      const head = (run: OneRun) => h("th", { scope: "col" }, `${moment(run.time)} · ${run.law}`);
      const rows = [
        ["subject", pair.map((run) => run.subject || "–")],
        ["session", pair.map((run) => run.session || "–")],
        ["how it ended", pair.map((run) => run.how)],
        ["first fault", pair.map((run) => faultName(run.first_fault) || "none")],
        ...names.map((name) => [name, pair.map((run) => value(run, name))]),
      ] as [string, string[]][];
      shown.replaceChildren(
        title,
        h(
          "div",
          { class: "wide", tabindex: 0, role: "region", "aria-label": "Metrics of both runs" },
          h("table", { class: "list" }, h("thead", {}, h("tr", {}, h("td", {}), ...pair.map(head))), h("tbody", {}, ...rows.map(([name, values]) => h("tr", {}, h("th", { scope: "row" }, name), ...values.map((words) => h("td", {}, words)))))),
        ),
        h("div", { class: "two" }, ...pair.map((run) => still(run, trouble))),
      );
      title.focus();
      title.scrollIntoView({ block: "nearest" });
    } catch (error) {
      trouble(error);
    }
  }

  return {
    element,
    open: () => void load(),
    draw: (now) => {
      replaying?.tick(now);
      for (const curves of stills) if (curves.element.isConnected) curves.draw(now);
    },
    curves: () => replaying?.curves ?? null,
  };
}

/** Curves of whole runs, which stand beside one another. */
let stills: Curves[] = [];

/** The whole of a run: reference, joint, error. */
function still(run: OneRun, trouble: (error: unknown) => void): HTMLElement {
  const at = `/api/runs/${encodeURIComponent(run.id)}`;
  let mine = 0;
  const curves: Curves = new Curves({
    kind: "whole",
    empty: "This log has none of these columns.",
    wanted: (view: View) => {
      const number = ++mine;
      const span = Math.max(run.to - run.from, 0.1);
      curves.seconds = span;
      void getBytes(`${at}/curves?columns=${view.columns.map(encodeURIComponent).join(",")}&from=${run.from}&to=${run.to}&pixels=${view.pixels}`)
        .then((bytes) => {
          const frame = decode(bytes);
          if (number !== mine || !frame || "pairs" in frame) return;
          curves.take(frame);
          curves.setEnd(run.to);
          curves.touched();
        })
        .catch(trouble);
    },
  });
  const columns = run.columns.filter((column) => OVERVIEW.includes(column.name));
  stills.push(curves);
  const element = h("section", { class: "card still", "aria-label": `Run of ${moment(run.time)}` }, h("h3", {}, `${moment(run.time)} · ${run.law}`), curves.element);
  requestAnimationFrame(() => curves.setColumns(columns));
  return element;
}

function faultName(fault: string | Fault | null): string {
  if (fault === null || fault === undefined) return "";
  return typeof fault === "string" ? fault : fault.meaning;
}

/** A log through the same curves, at a speed of one's choice. */
class Replay {
  readonly element: HTMLElement;
  readonly curves: Curves;
  private time: number;
  private playing = true;
  private speed = 1;
  private last: number | null = null;
  private view: View | null = null;
  private readonly asked = new Set<number>();
  private readonly play: HTMLButtonElement;
  private readonly slider: HTMLInputElement;
  private readonly clock = h("span", { class: "clock" });
  private generation = 0;

  constructor(
    private readonly run: OneRun,
    private readonly trouble: (error: unknown) => void,
  ) {
    this.time = run.from;
    this.curves = new Curves({
      kind: "replay",
      empty: "This log has no columns to draw.",
      windows: 6,
      wanted: (view) => {
        this.view = view;
        this.asked.clear();
        this.generation += 1;
        this.fetch();
      },
    });
    this.play = h("button", { type: "button", class: "small", onclick: () => this.toggle() }, "Pause");
    this.slider = h("input", { type: "range", min: run.from, max: run.to, step: "any", "aria-label": "Time in the log [s]" });
    this.slider.addEventListener("input", () => {
      this.time = this.slider.valueAsNumber;
      this.show();
    });
    const speed = h("select", { "aria-label": "Speed of the replay", onchange: () => (this.speed = Number(speed.value)) });
    for (const times of SPEEDS) speed.append(h("option", { value: times }, `${times}×`));
    speed.value = "1";
    this.element = h("section", { class: "card replay", "aria-label": "Replay" }, h("div", { class: "bar" }, this.play, speed, this.slider, this.clock), this.curves.element);
    requestAnimationFrame(() => this.curves.setColumns(run.columns));
  }

  tick(now: number): void {
    if (!this.element.isConnected) return;
    if (this.playing && this.last !== null) {
      this.time = Math.min(this.time + (this.speed * (now - this.last)) / 1000, this.run.to);
      if (this.time >= this.run.to) this.toggle();
      this.show();
    }
    this.last = now;
    this.curves.draw(now);
  }

  private toggle(): void {
    this.playing = !this.playing;
    if (this.playing && this.time >= this.run.to) this.time = this.run.from;
    text(this.play, this.playing ? "Pause" : "Play");
  }

  private show(): void {
    if (this.slider !== document.activeElement || this.playing) this.slider.value = String(this.time);
    text(this.clock, `${this.time.toFixed(1)} of ${this.run.to.toFixed(1)} s`);
    this.curves.setEnd(this.time);
    this.fetch();
  }

  /** Ask for the pieces, each one window long, that are in sight or will be soon. */
  private fetch(): void {
    const view = this.view;
    if (!view || view.columns.length === 0) return;
    const piece = view.seconds;
    const first = Math.max(Math.floor((this.time - piece) / piece), Math.floor(this.run.from / piece));
    const last = Math.min(Math.floor(this.time / piece) + 1, Math.floor(this.run.to / piece));
    for (const kept of this.asked) if (kept < first - 1 || kept > last + 1) this.asked.delete(kept);
    for (let k = first; k <= last; k++) {
      if (this.asked.has(k)) continue;
      this.asked.add(k);
      const mine = this.generation;
      const at = `/api/runs/${encodeURIComponent(this.run.id)}/curves`;
      void getBytes(`${at}?columns=${view.columns.map(encodeURIComponent).join(",")}&from=${k * piece}&to=${(k + 1) * piece}&pixels=${view.pixels}`)
        .then((bytes) => {
          const frame = decode(bytes);
          if (mine !== this.generation || !frame || "pairs" in frame) return;
          this.curves.buffer?.add(frame);
          this.curves.touched();
        })
        .catch((error: unknown) => {
          this.asked.delete(k);
          if (this.playing) this.toggle();
          this.trouble(error);
        });
    }
  }
}

/** Scrolling curves: a panel for each group of columns, all over the same time. */

import uPlot from "uplot";
import { Buffer } from "./buffer";
import { attribute, h, hidden, number, refill, text } from "./dom";
import { Strokesplot } from "./strokes";
import type { Column, Frame, Strokes } from "./wire";

export const WINDOWS = [2, 5, 10, 30, 60, 120, 300];
const MOST_COLUMNS = 16;
const MOST_SHOWN_FIRST = 4;
/** Groups of columns → title of their panel. Of others the name is the title. */
const TITLES: Record<string, string> = {
  motion: "Angle",
  error: "Error",
  command: "Command",
  current: "Current",
  tension: "Tension",
  temperature: "Temperature",
  emg: "EMG",
  law: "Estimates of the law",
  loop: "Loop",
};
/** Groups that stay far from their limits when all is well: the limits are in sight, if they are to be. */
const WITH_LIMITS = new Set(["current", "tension", "temperature", "emg"]);
/** What is shown first, where there is nothing chosen. */
const FIRST = ["reference_deg", "joint_deg", "motor_deg", "error_deg", "command_deg", "requested_target_deg", "emg_level", "emg_flexor", "emg_extensor", "current_a", "winding_c"];
const NAMES: Record<string, string> = { 2: "2 s", 5: "5 s", 10: "10 s", 30: "30 s", 60: "1 min", 120: "2 min", 300: "5 min" };
const LEFT = 58;
const RIGHT = 16;
const LEGEND = 22;
const AXIS = 28;
const LEAST = 66;
const MOST = 400;
/** Numbers that change more often than this cannot be read. */
const LABEL_MS = 150;
/** Frames come about every 25 ms, and not evenly. */
const BEHIND_S = 0.06;

interface Panel {
  group: string;
  columns: Column[];
  element: HTMLElement;
  plot: uPlot;
  values: HTMLElement[];
  low: number;
  high: number;
}

export interface View {
  columns: string[];
  seconds: number;
  pixels: number;
  xy: boolean;
}

export interface CurvesOptions {
  /** Called when other data are wanted. */
  wanted: (view: View) => void;
  /** How many windows of data are kept. */
  windows?: number;
  /** Curves of a run that goes on, a log that is replayed, or a whole log at once. */
  kind: "live" | "replay" | "whole";
  empty: string;
}

export class Curves {
  readonly element: HTMLElement;
  /** When frames were drawn [ms], and how long each took. */
  readonly drawn: { at: number; took: number }[] = [];
  buffer: Buffer | null = null;
  seconds = 10;
  private columns: Column[] = [];
  private chosen = new Set<string>();
  private panels: Panel[] = [];
  private halted: { buffer: Buffer; from: number; to: number } | null = null;
  private end: number | null = null;
  private dirty = false;
  private ahead = NaN;
  private shownEnd = NaN;
  private withLimits = true;
  private xy = true;
  private cursor: number | null = null;
  private labelled = 0;
  private unlabelled = false;
  private pixels = 0;
  private top = 0;
  private readonly plots = h("div", { class: "plots" });
  /** Joint over motor; stands where the page puts it. */
  readonly strokes = new Strokesplot();
  private readonly chooser = h("div", { class: "chooser" });
  private readonly empty: HTMLElement;
  private readonly pause: HTMLButtonElement;
  private readonly limits: HTMLButtonElement;
  private readonly whole: HTMLButtonElement;
  private readonly window: HTMLSelectElement;
  private readonly halt = h("span", { class: "halted", role: "status" });

  constructor(private readonly options: CurvesOptions) {
    this.empty = h("p", { class: "empty" }, options.empty);
    this.window = h("select", { "aria-label": "Window of time", onchange: () => this.setWindow(Number(this.window.value)) });
    for (const seconds of WINDOWS) this.window.append(h("option", { value: seconds }, NAMES[seconds]!));
    this.window.value = String(this.seconds);
    this.pause = h("button", { type: "button", class: "small", "aria-pressed": "false", onclick: () => this.togglePause() }, "Pause");
    this.pause.hidden = options.kind !== "live";
    this.limits = h("button", { type: "button", class: "small", "aria-pressed": "true", onclick: () => this.toggleLimits() }, "Limits in sight");
    const closer = h("button", { type: "button", class: "small", "aria-label": "Zoom in", onclick: () => this.zoom(0.5) }, "+");
    const farther = h("button", { type: "button", class: "small", "aria-label": "Zoom out", onclick: () => this.zoom(2) }, "−");
    this.whole = h("button", { type: "button", class: "small", onclick: () => this.resume() }, options.kind === "live" ? "Back to now" : "Whole window");
    this.whole.hidden = true;
    const choose = h("details", { class: "choose" }, h("summary", { class: "small" }, "Choose traces"), this.chooser);
    this.plots.tabIndex = 0;
    this.plots.setAttribute("role", "group");
    this.plots.setAttribute("aria-label", "Curves. Left and right arrow move the cursor, plus and minus zoom, P pauses.");
    this.plots.addEventListener("keydown", (event) => this.key(event));
    this.element = h(
      "div",
      { class: "curves" },
      h("div", { class: "bar" }, h("label", { class: "inline", hidden: options.kind === "whole" }, "Window ", this.window), this.pause, closer, farther, this.whole, this.limits, choose, this.halt),
      this.empty,
      this.plots,
    );
    this.strokes.element.hidden = true;
    new ResizeObserver(() => this.resize()).observe(this.plots);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.rebuild());
  }

  /** The columns that there are; those that are shown first are chosen, where none of them was. */
  setColumns(columns: Column[]): void {
    const key = (all: Column[]) => JSON.stringify(all);
    if (key(columns) === key(this.columns)) return;
    this.columns = columns;
    const known = new Set(columns.map((column) => column.name));
    for (const name of this.chosen) if (!known.has(name)) this.chosen.delete(name);
    if (this.chosen.size === 0) {
      const first = FIRST.filter((name) => known.has(name));
      for (const name of first.length ? first : columns.map((column) => column.name).slice(0, MOST_SHOWN_FIRST)) this.chosen.add(name);
    }
    this.rebuild();
  }

  /** Time to show at the right edge [s], in place of the newest. */
  setEnd(end: number | null): void {
    if (this.end === end) return;
    this.end = end;
    this.dirty = true;
  }

  take(frame: Frame): void {
    const buffer = this.buffer;
    if (!buffer) return;
    buffer.put(frame);
    this.dirty = true;
    if (buffer.end === null) return;
    // The data's clock against ours, by those frames that were quickest: the edge moves evenly between two frames.
    const ahead = buffer.end - performance.now() / 1000;
    if (frame.anew || !(Math.abs(ahead - this.ahead) < 0.5)) this.ahead = ahead;
    else this.ahead = Math.max(ahead, this.ahead - 0.0005);
  }

  /** Right edge of what is drawn [s]: it follows the data a little behind, and never runs past them. */
  private edge(buffer: Buffer | null, now: number): number {
    if (this.end !== null) return this.end;
    const newest = buffer?.end ?? null;
    if (newest === null) return this.seconds;
    return Math.min(newest, now / 1000 + this.ahead - BEHIND_S);
  }

  takeStrokes(strokes: Strokes): void {
    if (this.halted === null) this.strokes.take(strokes.pairs);
  }

  touched(): void {
    this.dirty = true;
  }

  clear(): void {
    this.buffer?.clear();
    this.halted = null;
    this.strokes.take(new Float32Array(0));
    this.state();
    this.dirty = true;
  }

  view(): View {
    return { columns: this.order(), seconds: this.seconds, pixels: this.pixels, xy: this.xy };
  }

  /** Draw what has changed; called once for each frame of the screen. */
  draw(now: number): void {
    this.strokes.draw();
    if (this.unlabelled && now - this.labelled > LABEL_MS) {
      this.labelled = now;
      this.unlabelled = false;
      for (const panel of this.panels) this.labels(panel);
    }
    if (this.panels.length === 0) return;
    const buffer = this.halted?.buffer ?? this.buffer;
    const end = this.halted?.to ?? this.edge(buffer, performance.now());
    if (!this.dirty && end === this.shownEnd) return;
    this.dirty = false;
    this.shownEnd = end;
    const begin = this.halted?.from ?? end - this.seconds;
    const began = performance.now();
    for (const panel of this.panels) this.drawPanel(panel, buffer, begin, end);
    this.unlabelled = true;
    this.drawn.push({ at: began, took: performance.now() - began });
    if (this.drawn.length > 4000) this.drawn.splice(0, 2000);
  }

  private drawPanel(panel: Panel, buffer: Buffer | null, begin: number, end: number): void {
    const names = panel.columns.map((column) => column.name);
    const drawn = buffer?.between(begin, end, names) ?? { x: [], y: names.map(() => []), low: [], high: [] };
    let low = Math.min(...drawn.low);
    let high = Math.max(...drawn.high);
    if (!(low <= high)) [low, high] = [0, 1];
    if (this.withLimits && WITH_LIMITS.has(panel.group)) {
      for (const column of panel.columns) {
        if (column.low !== null && column.low !== undefined) low = Math.min(low, column.low);
        if (column.high !== null && column.high !== undefined) high = Math.max(high, column.high);
      }
    }
    const room = Math.max((high - low) * 0.06, Math.abs(high) * 1e-3, 1e-3);
    [low, high] = [low - room, high + room];
    // Grow at once, shrink only when much would be empty: the scale stands still while a motion goes on.
    const span = panel.high - panel.low;
    if (low < panel.low || high > panel.high || !(high - low > 0.6 * span)) [panel.low, panel.high] = [low, high];
    panel.plot.batch(() => {
      panel.plot.setData([drawn.x, ...drawn.y] as uPlot.AlignedData, false);
      panel.plot.setScale("x", { min: begin, max: end });
      panel.plot.setScale("y", { min: panel.low, max: panel.high });
    });
  }

  /** The value of each curve: at the cursor, or the newest. */
  private labels(panel: Panel): void {
    const index = this.cursor === null ? null : panel.plot.cursor.idx;
    panel.columns.forEach((column, c) => {
      const curve = panel.plot.data[c + 1] as (number | null)[] | undefined;
      let at = index ?? (curve ? curve.length - 1 : -1);
      if (index !== null && index !== undefined) at -= at % 2;
      const value = curve?.[at] ?? null;
      text(panel.values[c]!, reading(value, column.unit));
    });
  }

  private order(): string[] {
    return this.columns.filter((column) => this.chosen.has(column.name)).map((column) => column.name).slice(0, MOST_COLUMNS);
  }

  private rebuild(): void {
    for (const panel of this.panels) panel.plot.destroy();
    this.plots.replaceChildren();
    this.panels = [];
    const names = this.order();
    const shown = this.columns.filter((column) => names.includes(column.name));
    const groups = [...new Set(shown.map((column) => column.group))];
    hidden(this.empty, shown.length > 0);
    hidden(this.plots, shown.length === 0);
    hidden(this.strokes.element, shown.length === 0 || !this.xy || this.options.kind !== "live");
    groups.forEach((group, i) => {
      const columns = shown.filter((column) => column.group === group);
      this.panels.push(this.panel(group, columns, i === groups.length - 1));
    });
    this.chosenButtons();
    this.strokes.restyle();
    this.resize(true);
  }

  private chosenButtons(): void {
    const groups = [...new Set(this.columns.map((column) => column.group))];
    refill(this.chooser, [this.columns, [...this.chosen], this.xy], () => [
      ...groups.map((group) =>
        h(
          "div",
          { class: "choose-group", role: "group", "aria-label": TITLES[group] ?? group },
          h("span", { class: "choose-title" }, TITLES[group] ?? group),
          ...this.columns
            .filter((column) => column.group === group)
            .map((column) =>
              h(
                "button",
                { type: "button", class: "chip", "data-column": column.name, "aria-pressed": String(this.chosen.has(column.name)), onclick: () => this.toggle(column.name) },
                column.title,
              ),
            ),
        ),
      ),
      this.options.kind === "live" && h(
        "div",
        { class: "choose-group", role: "group", "aria-label": "Hysteresis" },
        h("span", { class: "choose-title" }, "Hysteresis"),
        h("button", { type: "button", class: "chip", "data-column": "xy", "aria-pressed": String(this.xy), onclick: () => this.toggleStrokes() }, "joint over motor"),
      ),
      h("p", { class: "hint" }, `At most ${MOST_COLUMNS} traces at a time.`),
    ]);
  }

  private toggle(name: string): void {
    if (this.chosen.has(name)) this.chosen.delete(name);
    else if (this.chosen.size < MOST_COLUMNS) this.chosen.add(name);
    this.rebuild();
    this.want();
    this.chooser.querySelector<HTMLElement>(`[data-column="${CSS.escape(name)}"]`)?.focus();
  }

  private toggleStrokes(): void {
    this.xy = !this.xy;
    this.rebuild();
    this.want();
    this.chooser.querySelector<HTMLElement>('[data-column="xy"]')?.focus();
  }

  private panel(group: string, columns: Column[], lowest: boolean): Panel {
    const style = getComputedStyle(document.documentElement);
    const colour = (name: string) => style.getPropertyValue(name).trim();
    const axis = { stroke: colour("--soft"), grid: { stroke: colour("--grid"), width: 1 }, ticks: { stroke: colour("--grid"), width: 1, size: 4 }, font: "12px system-ui, sans-serif" };
    const values = columns.map(() => h("span", { class: "value" }));
    const legend = columns.map((column, c) => {
      const swatch = h("span", { class: `swatch${dashed(column) ? " dashed" : ""}`, "aria-hidden": "true" });
      swatch.style.borderTopColor = colour(`--trace-${place(this.columns, column)}`);
      const limit = WITH_LIMITS.has(group) ? limitText(column) : "";
      return h("span", { class: "key" }, swatch, h("span", {}, column.title), values[c]!, limit && h("span", { class: "limit" }, limit));
    });
    const host = h("div", { class: "plot" });
    const element = h("div", { class: "panel", role: "group", "aria-label": TITLES[group] ?? group }, h("div", { class: "legend" }, h("h3", {}, TITLES[group] ?? group), ...legend), host);
    this.plots.append(element);
    const plot = new uPlot(
      {
        width: 300,
        height: 100,
        legend: { show: false },
        padding: [4, RIGHT, lowest ? 0 : 4, 0],
        cursor: {
          sync: { key: this.options.kind, scales: ["x", null] },
          drag: { x: true, y: false, setScale: false },
          points: { size: 6 },
          y: false,
        },
        scales: { x: { time: false, auto: false }, y: { auto: false } },
        axes: [
          { ...axis, show: lowest, size: 28, values: (_, splits) => splits.map((value) => `${Number(value.toFixed(3))} s`) },
          { ...axis, size: LEFT, space: 24, splits: (_u, _axis, low, high, step) => ticks(low, high, step) },
        ],
        series: [
          {},
          ...columns.map((column) => ({
            stroke: colour(`--trace-${place(this.columns, column)}`),
            width: dashed(column) ? 1.5 : 1.25,
            ...(dashed(column) ? { dash: [5, 4] } : {}),
            points: { show: false },
            spanGaps: false,
          })),
        ],
        hooks: {
          draw: [(u) => drawLimits(u, columns, colour("--limit"))],
          setSelect: [(u) => this.selected(u)],
          setCursor: [
            (u) => {
              const left = u.cursor.left;
              this.cursor = left === undefined || left < 0 ? null : left;
              const mine = this.panels.find((panel) => panel.plot === u);
              if (mine) this.labels(mine);
            },
          ],
        },
      },
      [[], ...columns.map(() => [])] as uPlot.AlignedData,
      host,
    );
    host.addEventListener("dblclick", () => this.resume());
    return { group, columns, element, plot, values, low: 0, high: -1 };
  }

  /** Fit into the room that there is. */
  fit(): void {
    const top = Math.round(this.plots.getBoundingClientRect().top + window.scrollY);
    if (top !== this.top && this.element.isConnected && this.plots.clientWidth > 0) {
      this.top = top;
      this.resize();
    }
  }

  private resize(anew = false): void {
    const width = Math.floor(this.plots.clientWidth);
    if (width < 50 || this.panels.length === 0) return;
    const count = this.panels.length;
    // The first panel has one and a half of the height; all together end at the lower edge, where there is room.
    const top = this.options.kind === "live" ? this.plots.getBoundingClientRect().top + window.scrollY : window.innerHeight / 3;
    const each = Math.max(LEAST, Math.floor((window.innerHeight - top - AXIS - 24 - count * LEGEND) / (count + (count > 1 ? 0.5 : 0))));
    for (const [i, panel] of this.panels.entries()) {
      const height = Math.min(i === 0 && count > 1 ? Math.floor(each * 1.5) : each, MOST) + (i === count - 1 ? AXIS : 0);
      if (anew || panel.plot.width !== width || panel.plot.height !== height) panel.plot.setSize({ width, height });
    }
    this.dirty = true;
    const pixels = Math.max(100, Math.min(2000, width - LEFT - RIGHT));
    if (anew || Math.abs(pixels - this.pixels) > 0.1 * this.pixels) {
      this.pixels = pixels;
      this.want();
    }
  }

  private want(): void {
    const columns = this.order();
    const capacity = Math.ceil((this.options.windows ?? 1) * this.pixels) + 8;
    const before = this.buffer;
    if (!before || before.capacity !== capacity || before.columns.join() !== columns.join()) {
      this.buffer = new Buffer(columns, capacity);
    }
    if (this.pixels > 0) this.options.wanted(this.view());
  }

  setWindow(seconds: number): void {
    this.seconds = seconds;
    this.window.value = String(seconds);
    this.halted = null;
    this.state();
    this.want();
    this.dirty = true;
  }

  private selected(u: uPlot): void {
    if (u.select.width < 4) return;
    const from = u.posToVal(u.select.left, "x");
    const to = u.posToVal(u.select.left + u.select.width, "x");
    u.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
    this.haltAt(from, to);
  }

  private haltAt(from: number, to: number): void {
    const buffer = this.halted?.buffer ?? this.buffer?.copy();
    if (!buffer || !(to - from > 0.005)) return;
    this.halted = { buffer, from, to };
    this.state();
    this.dirty = true;
  }

  private zoom(by: number): void {
    const buffer = this.halted?.buffer ?? this.buffer;
    if (!buffer) return;
    const to = this.halted?.to ?? this.end ?? buffer.end ?? this.seconds;
    const from = this.halted?.from ?? to - this.seconds;
    const width = Math.min((to - from) * by, this.seconds);
    const middle = this.cursorTime() ?? (from + to) / 2;
    const share = (middle - from) / (to - from);
    this.haltAt(middle - share * width, middle + (1 - share) * width);
  }

  private cursorTime(): number | null {
    const first = this.panels[0];
    return this.cursor === null || !first ? null : first.plot.posToVal(this.cursor, "x");
  }

  togglePause(): void {
    if (this.halted) this.resume();
    else {
      const to = this.end ?? this.buffer?.end ?? this.seconds;
      this.haltAt(to - this.seconds, to);
    }
  }

  private resume(): void {
    this.halted = null;
    this.state();
    this.dirty = true;
  }

  private toggleLimits(): void {
    this.withLimits = !this.withLimits;
    attribute(this.limits, "aria-pressed", String(this.withLimits));
    for (const panel of this.panels) [panel.low, panel.high] = [0, -1];
    this.dirty = true;
  }

  /** Show whether the curves are halted. */
  private state(): void {
    attribute(this.pause, "aria-pressed", String(this.halted !== null));
    hidden(this.whole, this.halted === null);
    text(this.halt, this.halted && this.options.kind === "live" ? "Curves are halted. The rig goes on." : "");
  }

  private key(event: KeyboardEvent): void {
    if (event.target !== this.plots) return;
    const first = this.panels[0];
    if (!first) return;
    const width = first.plot.over.clientWidth;
    if (event.key === "ArrowLeft" || event.key === "ArrowRight") {
      const by = (event.key === "ArrowLeft" ? -1 : 1) * (event.shiftKey ? 20 : 4);
      const left = Math.max(0, Math.min(width, (this.cursor ?? width) + by));
      for (const panel of this.panels) panel.plot.setCursor({ left, top: 5 });
      for (const panel of this.panels) this.labels(panel);
    } else if (event.key === "+") this.zoom(0.5);
    else if (event.key === "-") this.zoom(2);
    else if (event.key.toLowerCase() === "p" && this.options.kind === "live") this.togglePause();
    else return;
    event.preventDefault();
  }
}

const DIGITS: Record<string, number> = { "°": 2, "°/s": 1, A: 2, N: 1, "°C": 1, "%": 1, "µs": 0, "N·m": 2 };

function reading(value: number | null, unit: string): string {
  const digits = DIGITS[unit];
  const said = value !== null && digits !== undefined ? value.toFixed(digits) : number(value);
  return unit === "1" || unit === "" || value === null ? said : `${said} ${unit}`;
}

function place(all: Column[], column: Column): number {
  const same = all.filter((other) => other.group === column.group);
  return same.findIndex((other) => other.name === column.name) % 8;
}

function dashed(column: Column): boolean {
  return column.name.startsWith("reference") || column.name.startsWith("requested_target");
}

function limitText(column: Column): string {
  const given = [column.low, column.high].filter((limit) => limit !== null && limit !== undefined) as number[];
  if (given.length === 0) return "";
  return `limit ${given.map((limit) => String(Number(limit.toPrecision(3)))).join(" … ")}`;
}

function drawLimits(u: uPlot, columns: Column[], colour: string): void {
  const { ctx, bbox } = u;
  const lines = new Set(columns.flatMap((column) => [column.low, column.high]).filter((limit) => limit !== null && limit !== undefined));
  if (lines.size === 0) return;
  ctx.save();
  ctx.strokeStyle = ctx.fillStyle = colour;
  ctx.font = `${11 * uPlot.pxRatio}px system-ui, sans-serif`;
  ctx.textAlign = "right";
  ctx.lineWidth = 1.5;
  ctx.setLineDash([8, 4]);
  for (const limit of lines) {
    const y = Math.round(u.valToPos(limit as number, "y", true));
    if (y < bbox.top || y > bbox.top + bbox.height) continue;
    ctx.beginPath();
    ctx.moveTo(bbox.left, y);
    ctx.lineTo(bbox.left + bbox.width, y);
    ctx.stroke();
    ctx.fillText("limit", bbox.left + bbox.width - 4, y + (y < bbox.top + 14 * uPlot.pxRatio ? 11 : -4) * uPlot.pxRatio);
  }
  ctx.restore();
}

/** Multiples of a step, or of a part of it where that is more than a scale of one number: what has one has no size. */
function ticks(low: number, high: number, step: number): number[] {
  const first = Math.ceil(low / step);
  const count = Math.floor(high / step) - first + 1;
  if (count < 2) return ticks(low, high, step / 2);
  return Array.from({ length: count }, (_, i) => (first + i) * step);
}

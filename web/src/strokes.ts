/** Joint over motor of the last strokes: the hysteresis of the cable. */

import { h, text } from "./dom";

const SIDE = 240;
const EDGE = { left: 40, right: 10, top: 10, bottom: 34 };

export class Strokesplot {
  readonly element: HTMLElement;
  private readonly canvas = h("canvas", { role: "img", "aria-label": "Joint over motor: the hysteresis of the last strokes" });
  private readonly said = h("p", { class: "hint" });
  private pairs = new Float32Array(0);
  private dirty = true;

  constructor() {
    this.element = h("section", { class: "card strokes", "aria-label": "Hysteresis" }, h("div", { class: "legend" }, h("h3", {}, "Joint over motor")), this.canvas, this.said);
  }

  take(pairs: Float32Array): void {
    this.pairs = pairs as Float32Array<ArrayBuffer>;
    this.dirty = true;
  }

  restyle(): void {
    this.dirty = true;
  }

  draw(): void {
    if (!this.dirty || this.element.hidden) return;
    this.dirty = false;
    const ratio = Math.max(1, Math.min(2, window.devicePixelRatio));
    if (this.canvas.width !== SIDE * ratio) {
      this.canvas.width = this.canvas.height = SIDE * ratio;
    }
    const context = this.canvas.getContext("2d");
    if (!context) return;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, SIDE, SIDE);
    const style = getComputedStyle(document.documentElement);
    const colour = (name: string) => style.getPropertyValue(name).trim();
    const pairs = this.pairs;
    let [left, right, low, high] = [Infinity, -Infinity, Infinity, -Infinity];
    for (let i = 0; i + 1 < pairs.length; i += 2) {
      const [x, y] = [pairs[i]!, pairs[i + 1]!];
      if (!Number.isFinite(x) || !Number.isFinite(y)) continue;
      [left, right] = [Math.min(left, x), Math.max(right, x)];
      [low, high] = [Math.min(low, y), Math.max(high, y)];
    }
    if (!(left <= right)) {
      text(this.said, "Appears when the joint moves.");
      return;
    }
    text(this.said, "The wider the loop, the more motion the cable loses.");
    [left, right] = roomy(left, right);
    [low, high] = roomy(low, high);
    const width = SIDE - EDGE.left - EDGE.right;
    const height = SIDE - EDGE.top - EDGE.bottom;
    const x = (value: number) => EDGE.left + ((value - left) / (right - left)) * width;
    const y = (value: number) => EDGE.top + (1 - (value - low) / (high - low)) * height;
    context.font = "12px system-ui, sans-serif";
    context.fillStyle = colour("--soft");
    context.strokeStyle = colour("--grid");
    context.lineWidth = 1;
    context.textAlign = "center";
    for (const tick of ticks(left, right)) {
      line(context, x(tick), EDGE.top, x(tick), EDGE.top + height);
      context.fillText(String(tick), x(tick), EDGE.top + height + 14);
    }
    context.textAlign = "right";
    for (const tick of ticks(low, high)) {
      line(context, EDGE.left, y(tick), EDGE.left + width, y(tick));
      context.fillText(String(tick), EDGE.left - 5, y(tick) + 4);
    }
    context.fillText("motor [°]", EDGE.left + width, SIDE - 6);
    context.textAlign = "left";
    context.fillText("joint [°]", EDGE.left + 4, EDGE.top + 12);
    context.strokeStyle = colour("--trace-1");
    context.lineWidth = 1.5;
    context.beginPath();
    let gap = true;
    for (let i = 0; i + 1 < pairs.length; i += 2) {
      const [px, py] = [pairs[i]!, pairs[i + 1]!];
      if (!Number.isFinite(px) || !Number.isFinite(py)) {
        gap = true;
        continue;
      }
      if (gap) context.moveTo(x(px), y(py));
      else context.lineTo(x(px), y(py));
      gap = false;
    }
    context.stroke();
  }
}

function roomy(low: number, high: number): [number, number] {
  const room = Math.max(0.05 * (high - low), 0.5);
  return [low - room, high + room];
}

function line(context: CanvasRenderingContext2D, x0: number, y0: number, x1: number, y1: number): void {
  context.beginPath();
  context.moveTo(Math.round(x0) + 0.5, Math.round(y0) + 0.5);
  context.lineTo(Math.round(x1) + 0.5, Math.round(y1) + 0.5);
  context.stroke();
}

/** About four round numbers. */
function ticks(low: number, high: number): number[] {
  const rough = (high - low) / 4;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((by) => by * power).find((wanted) => wanted >= rough) ?? rough;
  const found: number[] = [];
  for (let tick = Math.ceil(low / step) * step; tick <= high; tick += step) found.push(Number(tick.toPrecision(6)));
  return found;
}

/** Min and max of each pixel of time, by the pixel's number since the run began; the newest ones are kept. */

import type { Frame } from "./wire";

const NONE = -1e15;

/** What is drawn of a span of time: two points for each pixel, its least and its greatest value. */
export interface Drawn {
  x: number[];
  y: (number | null)[][];
  low: number[];
  high: number[];
}

export class Buffer {
  /** Seconds per pixel. */
  step = 0;
  /** Number of the newest pixel. */
  newest = NONE;
  private stamps: Float64Array;
  private values: Float32Array[];

  constructor(
    readonly columns: string[],
    readonly capacity: number,
  ) {
    this.stamps = new Float64Array(capacity).fill(NONE);
    this.values = columns.map(() => new Float32Array(2 * capacity));
  }

  /** Time of the end of the newest pixel [s]; null if there is none. */
  get end(): number | null {
    return this.newest === NONE ? null : (this.newest + 1) * this.step;
  }

  clear(): void {
    this.stamps.fill(NONE);
    this.newest = NONE;
  }

  put(frame: Frame): void {
    if (frame.columns !== this.columns.length) return;
    if (frame.anew || Math.abs(frame.step - this.step) > 1e-9 * frame.step) this.clear();
    this.step = frame.step;
    const first = Math.round(frame.start / frame.step);
    for (let i = 0; i < frame.pixels; i++) {
      const at = (((first + i) % this.capacity) + this.capacity) % this.capacity;
      this.stamps[at] = first + i;
      for (let c = 0; c < frame.columns; c++) {
        const from = 2 * (c * frame.pixels + i);
        const into = this.values[c]!;
        into[2 * at] = frame.values[from]!;
        into[2 * at + 1] = frame.values[from + 1]!;
      }
    }
    if (frame.pixels > 0) this.newest = Math.max(this.newest, first + frame.pixels - 1);
  }

  /** Add pixels that may lie anywhere, as those of a log that is read piece by piece. */
  add(frame: Frame): void {
    this.put({ ...frame, anew: false });
  }

  copy(): Buffer {
    const other = new Buffer(this.columns, this.capacity);
    other.step = this.step;
    other.newest = this.newest;
    other.stamps.set(this.stamps);
    this.values.forEach((column, c) => other.values[c]!.set(column));
    return other;
  }

  /** What stands from one time to another, of some columns. */
  between(from: number, to: number, names: string[]): Drawn {
    const places = names.map((name) => this.columns.indexOf(name));
    const drawn: Drawn = {
      x: [],
      y: names.map(() => []),
      low: names.map(() => Infinity),
      high: names.map(() => -Infinity),
    };
    if (this.newest === NONE || !(this.step > 0)) return drawn;
    const last = Math.min(Math.ceil(to / this.step), this.newest);
    const first = Math.max(Math.floor(from / this.step), last - this.capacity + 1);
    for (let k = first; k <= last; k++) {
      const at = ((k % this.capacity) + this.capacity) % this.capacity;
      if (this.stamps[at] !== k) continue;
      const time = (k + 0.5) * this.step;
      drawn.x.push(time, time);
      for (let c = 0; c < names.length; c++) {
        const column = places[c]! < 0 ? undefined : this.values[places[c]!];
        const low = column ? column[2 * at]! : NaN;
        const high = column ? column[2 * at + 1]! : NaN;
        if (Number.isFinite(low) && Number.isFinite(high)) {
          drawn.y[c]!.push(low, high);
          if (low < drawn.low[c]!) drawn.low[c] = low;
          if (high > drawn.high[c]!) drawn.high[c] = high;
        } else drawn.y[c]!.push(null, null);
      }
    }
    return drawn;
  }
}

/** What goes over the wire: docs/decisions/0018-console.md. */

export type Mode = "stopped" | "preflight" | "ready" | "running" | "bridging" | "releasing" | "latched";
export type Phase = "idle" | "checking" | "starting" | "live" | "ending" | "step";

/** A number that the user may change, within limits. */
export interface Quantity {
  value: number | number[] | string | boolean | null;
  low?: number | null;
  high?: number | null;
  unit?: string;
  meaning?: string;
  /** Whether it may be changed while the law runs. */
  live?: boolean;
  /** Its newest change in this run. */
  change?: { to: number; from: number; state: "checking" | "going" | "in force" | "refused"; text: string };
}

export interface Choice {
  name: string;
  title?: string;
}

export interface Settings {
  law: string;
  laws: (Choice | string)[];
  /** Empty: what the rig itself says; null: the law's defaults. */
  preset: string | null;
  presets: ({ name: string | null; title?: string } | string)[];
  /** Names of the gains that were changed here. */
  edited?: string[];
  gains: Record<string, Quantity>;
  reference: { kind: string; kinds?: (Choice | string)[]; fields?: Record<string, Quantity> };
  duration: number | null;
  subject: string;
  session: string;
  notes: string;
  locked: boolean;
}

export interface Check {
  running: boolean;
  /** Whether these gains may be armed: all but those that do not hold. */
  holds: boolean;
  /** The verdict in a word; null where there is nothing to check, as for a measurement. */
  name: string | null;
  text: string;
  rows: [string, string][];
  of: string;
}

export interface Fault {
  name: string;
  at: number | null;
  meaning: string;
  remedy: string;
}

export interface Happening {
  at: number | null;
  text: string;
}

/** A curve that can be drawn. */
export interface Column {
  name: string;
  title: string;
  unit: string;
  group: string;
  low: number | null;
  high: number | null;
}

export interface PreflightStep {
  name: string;
  state: "waiting" | "going" | "done" | "failed";
  said: string;
}

export interface Run {
  mode: Mode;
  power: boolean;
  preflight: PreflightStep[];
  elapsed: number | null;
  remaining: number | null;
  first_fault: Fault | null;
  consequences: Fault[];
  events: Happening[];
  next: string;
  log: string;
  /** Why power was taken off without anybody asking: the sign of life was lost. */
  lost?: string;
  /** What the drive says of its own fault. */
  drive_said?: string;
  notes?: string[];
  /** How it ended; null while it goes on. */
  ended?: { well: boolean; mode: string | null; reason: string; error: string } | null;
  columns: Column[];
  estimates: Record<string, number | null>;
  lateness: { median_us: number | null; most_us: number | null; overruns: number | null } | null;
  recorder: string;
}

export interface PathStep {
  name: string;
  state: PreflightStep["state"];
  said: string;
  files: string[];
  page?: string | null;
}

export interface Path {
  step: string;
  running?: boolean;
  fraction: number | null;
  files: string[];
  said: string;
  next: string;
  steps?: PathStep[];
}

export interface Problem {
  what: string;
  expected: string;
  do: string;
}

export interface State {
  rig: { name: string; hash: string; drive: "twin" | "hardware"; bus: string; faults?: Choice[] };
  you: { controls: boolean; viewers: number; controller: string | null };
  phase: Phase;
  /** How many stops there were, by whomever. */
  stops?: number;
  settings: Settings;
  check: Check | null;
  run: Run | null;
  path: Path | null;
  error: Problem | null;
}

/** A row of the list of earlier runs. */
export interface Earlier {
  id: string;
  time: string;
  law: string;
  rig: string;
  subject: string;
  session: string;
  rmse_deg: number | null;
  seconds: number | null;
  how: string;
  first_fault: string | Fault | null;
}

/** All that is known of one earlier run. */
export interface OneRun extends Earlier {
  notes?: string;
  consequences?: Fault[];
  metrics: [string, string][];
  events: Happening[];
  columns: Column[];
  from: number;
  to: number;
}

/** Min and max of each column for each pixel. */
export interface Frame {
  anew: boolean;
  view: number;
  columns: number;
  pixels: number;
  start: number;
  step: number;
  /** For each column, for each pixel: min, max. */
  values: Float32Array;
}

/** Joint over motor [°]: pairs of motor and joint. */
export interface Strokes {
  view: number;
  pairs: Float32Array;
}

const HEAD = 24;
const HEAD_OF_PAIRS = 12;

/** What a binary message holds; null if it is none of ours. */
export function decode(bytes: ArrayBuffer): Frame | Strokes | null {
  if (bytes.byteLength < HEAD_OF_PAIRS) return null;
  const view = new DataView(bytes);
  const kind = view.getUint8(0);
  const number = view.getUint32(4, true);
  if (kind === 3) {
    const count = view.getUint32(8, true);
    if (bytes.byteLength < HEAD_OF_PAIRS + 8 * count) return null;
    return { view: number, pairs: new Float32Array(bytes, HEAD_OF_PAIRS, 2 * count) };
  }
  if ((kind !== 1 && kind !== 2) || bytes.byteLength < HEAD) return null;
  const columns = view.getUint8(1);
  const pixels = view.getUint16(2, true);
  const start = view.getFloat64(8, true);
  const step = view.getFloat64(16, true);
  if (bytes.byteLength < HEAD + 8 * columns * pixels || !(step > 0)) return null;
  const values = new Float32Array(bytes, HEAD, 2 * columns * pixels);
  return { anew: kind === 2, view: number, columns, pixels, start, step, values };
}

/** An answer of the server that is an error. */
export class Refused extends Error {
  constructor(
    readonly problem: Problem,
    readonly status: number,
  ) {
    super(problem.what);
  }
}

async function answered(response: Response): Promise<unknown> {
  let body: unknown = null;
  try {
    body = await response.json();
  } catch {
    body = null;
  }
  if (response.ok) return body;
  const error = (body as { error?: Partial<Problem> } | null)?.error;
  throw new Refused(
    {
      what: error?.what ?? `the console answered ${response.status}`,
      expected: error?.expected ?? "",
      do: error?.do ?? (response.status === 401 ? "open the link again that bowden console printed" : "try again"),
    },
    response.status,
  );
}

/** Which tab this is: the server says so on each new connection, and the lease is a tab's. */
export const tab = { id: "" };

export async function post(path: string, body: unknown): Promise<unknown> {
  const response = await fetch(path, {
    method: "POST",
    headers: { "Content-Type": "application/json", ...(tab.id ? { "Bowden-Tab": tab.id } : {}) },
    body: JSON.stringify(body),
    credentials: "same-origin",
  });
  return answered(response);
}

export async function get(path: string): Promise<unknown> {
  return answered(await fetch(path, { credentials: "same-origin" }));
}

export async function getBytes(path: string): Promise<ArrayBuffer> {
  const response = await fetch(path, { credentials: "same-origin" });
  if (!response.ok) await answered(response);
  return response.arrayBuffer();
}

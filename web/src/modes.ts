/** What each state is called, looks like and means. */

import type { Phase, Run, State } from "./wire";

export interface Look {
  name: string;
  icon: string;
  /** Class of the banner: its colour. */
  kind: string;
  meaning: string;
}

const MODES: Record<Run["mode"], Look> = {
  stopped: { name: "Stopped", icon: "square", kind: "stopped", meaning: "Power is off." },
  preflight: { name: "Preflight", icon: "dial", kind: "preflight", meaning: "Power on. The motor moves a little." },
  ready: { name: "Ready", icon: "flag", kind: "ready", meaning: "Power on. The rig waits for Run." },
  running: { name: "Running", icon: "play", kind: "running", meaning: "The law moves the motor." },
  bridging: { name: "Bridging", icon: "bridge", kind: "bridging", meaning: "A signal is missing: the target is held." },
  releasing: { name: "Releasing", icon: "down", kind: "releasing", meaning: "The cable is let out, then power goes off." },
  latched: { name: "Latched", icon: "lock", kind: "latched", meaning: "Power is off until you acknowledge." },
};

const PHASES: Record<Exclude<Phase, "live">, Look> = {
  idle: { name: "Not started", icon: "ring", kind: "idle", meaning: "No program moves the rig." },
  checking: { name: "Checking", icon: "dots", kind: "idle", meaning: "On a model. Nothing moves." },
  starting: { name: "Starting", icon: "dots", kind: "idle", meaning: "Loop and recorder start. Power is off." },
  ending: { name: "Ending", icon: "dots", kind: "idle", meaning: "The cable is let out, power goes off, then the log is closed." },
  step: { name: "Guided step", icon: "dots", kind: "preflight", meaning: "A step of the guided path goes on." },
};

const LOST: Look = {
  name: "No connection",
  icon: "broken",
  kind: "lost",
  meaning: "This page cannot see or stop the rig now. Use the hardware emergency stop.",
};
const silent = (seconds: number): Look => ({
  ...LOST,
  meaning: `No news from the rig for ${seconds} s: this page cannot stop it. Use the hardware emergency stop.`,
});
const ENDED: Look = { ...PHASES.idle, name: "Ended", meaning: "Power is off, the log is closed." };
const BADLY: Look = { ...LOST, name: "Ended badly", icon: "warning", meaning: "It did not end as asked: make sure at the rig that power is off." };
const WAITING: Look = { name: "Connecting", icon: "dots", kind: "idle", meaning: "" };

export function lookOf(state: State | null, connected: boolean, silence: number): Look {
  if (!state) return silence < 1 ? WAITING : LOST;
  if (!connected) return silent(silence);
  if ((state.phase === "live" || state.run?.power) && state.run) return MODES[state.run.mode] ?? WAITING;
  if (state.phase === "idle" && state.run) return state.run.ended?.well ? ENDED : BADLY;
  return state.phase === "live" ? WAITING : (PHASES[state.phase] ?? WAITING);
}

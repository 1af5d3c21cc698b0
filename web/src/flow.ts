/** The way to a run, step by step: check, start, arm, run; acknowledge, end. */

import { attribute, h, hidden, icon, refill, text } from "./dom";
import { holdButton } from "./hold";
import type { Link } from "./link";
import { Refused, post, type State } from "./wire";

export type Say = (words: string, bad?: boolean) => void;

let before: Promise<unknown> = Promise.resolve();

/** Do a request and say what came of it, after those that were asked for earlier: a setting comes before its check. */
export function ask(link: Link, path: string, body: unknown, say: Say): Promise<boolean> {
  const mine = before.then(() => asked(link, path, body, say));
  before = mine;
  return mine;
}

async function asked(link: Link, path: string, body: unknown, say: Say): Promise<boolean> {
  try {
    const answer = (await post(path, body)) as (Partial<State> & { answer?: string }) | null;
    if (answer && answer.rig && answer.settings) link.take(answer as State);
    if (answer?.answer) {
      say(answer.answer, true);
      return false;
    }
    return true;
  } catch (error) {
    if (error instanceof Refused) {
      const { what, expected, do: remedy } = error.problem;
      say([what, expected && `expected: ${expected}`, remedy].filter(Boolean).join(". "), true);
    } else say("The console does not answer.", true);
    return false;
  }
}

/** With a capital and a full stop. */
export function sentence(words: string): string {
  const end = /[.!?]$/.test(words) ? "" : ".";
  return words.charAt(0).toUpperCase() + words.slice(1) + end;
}

interface Step {
  row: HTMLElement;
  mark: HTMLElement;
  hint: HTMLElement;
}

export function flow(link: Link, say: Say): { element: HTMLElement; update: () => void } {
  const request = (name: string, done: string) => {
    void ask(link, "/api/request", { request: name, seen: link.seen }, say).then((ok) => ok && done && say(done));
  };
  const button = (words: string, act: () => void) => {
    const made = h("button", { type: "button", class: "step-button" }, words);
    made.addEventListener("click", act);
    // A key that is held down does not press the next button, too.
    made.addEventListener("keydown", (event) => event.key === "Enter" && event.repeat && event.preventDefault());
    return made;
  };
  const check = button("Check", () => void ask(link, "/api/check", {}, say));
  const start = button("Start", () => request("start", ""));
  const arm = holdButton(
    "Hold to arm",
    () => request("arm", "Armed. The motor gets power and makes small motions."),
    () => say("Not armed: hold the button for a full second."),
  );
  const run = button("Run", () => request("run", ""));
  const acknowledge = button("Acknowledge fault", () => request("acknowledge", ""));
  const end = button("End", () => request("end", ""));

  const step = (made: HTMLButtonElement, extra?: HTMLElement): Step => {
    const mark = h("span", { class: "mark" });
    const hint = h("p", { class: "hint" });
    const row = h("li", { class: "flow-step" }, mark, h("div", { class: "flow-body" }, made, extra, hint));
    return { row, mark, hint };
  };
  const help = h("span", { id: "hold-help", class: "unseen" }, "Hold the mouse button or Enter for one second. Space stops, also here.");
  const steps = {
    check: step(check),
    start: step(start),
    arm: step(arm.button, help),
    run: step(run),
    acknowledge: step(acknowledge),
    end: step(end),
  };
  const next = h("p", { class: "next" });
  const element = h(
    "section",
    { class: "card", "aria-labelledby": "flow-title" },
    h("h2", { id: "flow-title" }, "To a run"),
    next,
    h("ol", { class: "flow" }, steps.check.row, steps.start.row, steps.arm.row, steps.run.row, steps.acknowledge.row, steps.end.row),
  );

  function show(one: Step, made: HTMLButtonElement, may: boolean, primary: boolean, done: boolean, words: string): void {
    if (made !== arm.button && made.disabled === may) made.disabled = !may;
    made.classList.toggle("primary", primary && may);
    attribute(one.row, "class", `flow-step${done ? " done" : ""}${primary ? " current" : ""}`);
    refill(one.mark, done, () => [icon(done ? "check" : "ring"), h("span", { class: "unseen" }, done ? "done" : "not done")]);
    text(one.hint, words);
    hidden(one.hint, words === "");
  }

  let stops: number | undefined;
  function update(): void {
    const state = link.state;
    if (!state) return;
    const { phase, run: now } = state;
    const controls = state.you.controls && link.connected;
    const live = phase === "live" && now !== null && link.connected;
    const mode = live ? now.mode : null;
    const holds = state.check?.holds === true && !state.check.running;
    const idle = phase === "idle" && link.connected;
    const armed = mode === "preflight" || mode === "ready" || mode === "running" || mode === "bridging";
    text(next, !link.connected ? "No news from the rig: what is below may be old." : !controls ? "Take control at the top to use these buttons. Stop needs no control." : live && now.next ? sentence(now.next) : "");
    hidden(next, next.textContent === "");
    const verdict = state.check === null || state.check.running ? "" : holds ? (state.check.name === "holds" ? "The gains hold." : "Read the verdict before you start.") : "These gains do not hold. Change them.";
    show(steps.check, check, controls && idle, idle && !holds, holds || live, phase === "checking" ? "Checking on a model…" : verdict || "Nothing moves.");
    show(steps.start, start, controls && idle && holds, idle && holds, live, phase === "starting" ? "Starting…" : live ? "" : "Starts loop and recorder. Power stays off.");
    const mayArm = controls && mode === "stopped";
    if (state.stops !== stops) {
      stops = state.stops;
      arm.enable(false); // somebody has stopped: who holds the button lets it go, and begins again
    }
    arm.enable(mayArm);
    show(steps.arm, arm.button, mayArm, mode === "stopped", armed, mayArm || idle ? "One second, by mouse, touch or Enter. The motor gets power." : "");
    show(steps.run, run, controls && mode === "ready", mode === "ready", mode === "running" || mode === "bridging", mode === "preflight" ? "Wait for the preflight." : "");
    show(steps.acknowledge, acknowledge, controls && mode === "latched", mode === "latched", false, mode === "latched" ? "Correct the cause first." : "");
    hidden(steps.acknowledge.row, !live || (mode !== "latched" && now.first_fault === null));
    if (live && mode !== "latched" && now.first_fault !== null) acknowledge.disabled = !controls;
    show(steps.end, end, controls && live, false, false, live ? "Power off, then the log is closed." : "");
    hidden(steps.end.row, phase !== "live" && phase !== "ending");
  }
  return { element, update };
}

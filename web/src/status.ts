/** What goes on: check, preflight, the first fault, estimates, lateness, events. */

import { attribute, h, hidden, icon, number, refill, text } from "./dom";
import { ask, type Say } from "./flow";
import type { Link } from "./link";
import type { Fault, Happening } from "./wire";

const MARKS = { waiting: "ring", going: "dots", done: "check", failed: "cross" } as const;
const WORDS = { waiting: "waits", going: "going on", done: "done", failed: "failed" } as const;

export function faultBody(first: Fault, consequences: Fault[], drive = ""): Node[] {
  return [
    h("p", { class: "fault-title" }, icon("warning"), h("span", {}, "First fault: ", h("strong", {}, first.meaning)), first.at === null ? "" : h("span", { class: "at" }, `at ${first.at.toFixed(3)} s`)),
    h("p", { class: "remedy" }, h("strong", {}, "What to do: "), first.remedy),
    ...(drive ? [h("p", {}, h("strong", {}, "The drive says: "), drive)] : []),
    ...(consequences.length
      ? [
          h(
            "details",
            { class: "consequences" },
            h("summary", {}, `${consequences.length} more followed from it`),
            h("ul", {}, ...consequences.map((fault) => h("li", {}, fault.meaning, fault.at === null ? "" : ` at ${fault.at.toFixed(3)} s`, h("span", { class: "hint" }, ` ${fault.remedy}`)))),
          ),
        ]
      : []),
  ];
}

export function eventList(events: Happening[]): Node[] {
  return events.map((event) => h("li", {}, h("span", { class: "at" }, event.at === null ? "–" : `${event.at.toFixed(2)} s`), h("span", {}, event.text)));
}

function micro(value: number | null): string {
  return value === null ? "–" : `${value.toFixed(0)} µs`;
}

/** A name and what it is, one under the other where that is long. */
export function row(name: string, value: string): HTMLElement {
  return h("div", { class: value.length > 22 ? "long" : "" }, h("dt", {}, name), h("dd", {}, value));
}

export interface Status {
  fault: HTMLElement;
  noted: HTMLElement;
  check: HTMLElement;
  preflight: HTMLElement;
  estimates: HTMLElement;
  events: HTMLElement;
  inject: HTMLElement;
  update: () => void;
}

export function status(link: Link, say: Say): Status {
  const fault = h("section", { class: "fault", role: "alert", "aria-label": "First fault" });
  fault.hidden = true;
  const noted = h("section", { class: "noted", role: "status", "aria-label": "Notes" });

  const verdict = h("p", { class: "verdict" });
  const checkText = h("p", { class: "check-text" });
  const checkRows = h("dl", { class: "rows" });
  const check = h("section", { class: "card", "aria-labelledby": "check-title" }, h("h2", { id: "check-title" }, "Check"), verdict, checkText, checkRows);

  const steps = h("ul", { class: "ticks" });
  const preflight = h("section", { class: "card", "aria-labelledby": "preflight-title" }, h("h2", { id: "preflight-title" }, "Preflight"), steps);

  const estimateRows = h("dl", { class: "rows" });
  const hints = h("div", {});
  const lateRows = h("dl", { class: "rows" });
  const estimates = h(
    "section",
    { class: "card", "aria-labelledby": "estimates-title" },
    h("h2", { id: "estimates-title" }, "Estimates of the law"),
    estimateRows,
    h("h2", { class: "second" }, "Loop"),
    lateRows,
    hints,
  );

  const list = h("ol", { class: "events", "aria-label": "Events, newest first", tabindex: 0 });
  const events = h("section", { class: "card", "aria-labelledby": "events-title" }, h("h2", { id: "events-title" }, "Events"), list);

  const chosen = h("select", { id: "inject" });
  const injectButton = h("button", { type: "button", class: "small", onclick: () => void ask(link, "/api/inject", { fault: chosen.value }, say).then((ok) => ok && say("The twin has this fault now.")) }, "Inject");
  const mendButton = h("button", { type: "button", class: "small", onclick: () => void ask(link, "/api/inject", { fault: "none" }, say).then((ok) => ok && say("The twin has no fault any more.")) }, "Mend all");
  const inject = h(
    "section",
    { class: "card", "aria-labelledby": "inject-title" },
    h("h2", { id: "inject-title" }, "Try a fault"),
    h("p", { class: "hint" }, "On the twin alone: give the simulated drive a fault and see what happens."),
    h("div", { class: "field" }, h("label", { for: "inject" }, "Fault"), chosen),
    h("div", { class: "bar" }, injectButton, mendButton),
  );


  function update(): void {
    const state = link.state;
    if (!state) return;
    const { run, check: now } = state;
    const first = run?.first_fault ?? null;
    hidden(fault, first === null);
    if (first) refill(fault, [first, run?.consequences, run?.drive_said], () => faultBody(first, run?.consequences ?? [], run?.drive_said));
    const notes = [
      ...(run?.lost ? [`The run was stopped: ${run.lost}. Arm anew.`] : []),
      ...(run?.ended && !run.ended.well ? [`The run did not end as asked${run.ended.reason ? `: ${run.ended.reason}` : ""}. ${run.ended.error}`] : []),
    ];
    hidden(noted, notes.length === 0);
    refill(noted, notes, () => notes.map((words) => h("p", {}, icon("warning"), h("span", {}, words))));
    refill(hints, run?.notes, () => (run?.notes ?? []).map((words) => h("p", { class: "hint" }, words)));

    hidden(check, now === null);
    if (now) {
      const sure = now.holds && (now.name === "holds" || now.name === null);
      const kind = now.running ? "going" : sure ? "holds" : now.holds ? "unsure" : "fails";
      attribute(verdict, "class", `verdict ${kind}`);
      const picture = { going: "dots", holds: "check", unsure: "warning", fails: "cross" }[kind];
      const words = { going: "Checking…", holds: "Holds", unsure: `${now.name ?? ""}: may be armed`, fails: "Does not hold: cannot be armed" }[kind];
      refill(verdict, [kind, words], () => [icon(picture), words]);
      text(checkText, now.text);
      hidden(checkText, now.text === "");
      const rows = now.rows.filter(([name]) => name !== "verdict");
      refill(checkRows, rows, () => rows.map(([name, value]) => row(name, value)));
      hidden(checkRows, rows.length === 0);
    }

    const ticks = run?.preflight ?? [];
    const failed = ticks.some((step) => step.state === "failed");
    const moving = run !== null && !["stopped", "preflight", "ready"].includes(run.mode);
    hidden(preflight, ticks.length === 0 || ((state.phase !== "live" || moving) && !failed));
    refill(steps, ticks, () =>
      ticks.map((step) =>
        h("li", { class: step.state }, icon(MARKS[step.state]), h("span", {}, step.name, h("span", { class: "unseen" }, `: ${WORDS[step.state]}`), step.said && h("span", { class: "hint block" }, step.said))),
      ),
    );

    const values = Object.entries(run?.estimates ?? {});
    hidden(estimates, run === null);
    refill(estimateRows, values, () => (values.length ? values.map(([name, value]) => row(name, number(value))) : [row("none", "")]));
    const late = run?.lateness;
    const loop: [string, string][] = [
      ["lateness, median", late ? micro(late.median_us) : "–"],
      ["lateness, most", late ? micro(late.most_us) : "–"],
      ["overruns", late?.overruns === null || late === null || late === undefined ? "–" : String(late.overruns)],
      ["recorder", run?.recorder ?? "–"],
      ["log", run?.log || "–"],
    ];
    refill(lateRows, loop, () => loop.map(([name, value]) => row(name, value)));

    const happened = [...(run?.events ?? [])].reverse();
    hidden(events, run === null);
    refill(list, happened, () => eventList(happened));

    const faults = state.rig.faults ?? [];
    hidden(inject, state.rig.drive !== "twin" || faults.length === 0 || state.phase !== "live");
    refill(chosen, faults, () => faults.map((one) => h("option", { value: one.name }, one.title ?? one.name)));
    const may = state.you.controls && link.connected;
    for (const button of [injectButton, mendButton]) if (button.disabled === may) button.disabled = !may;
  }
  return { fault, noted, check, preflight, estimates, events, inject, update };
}

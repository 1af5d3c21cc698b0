/** The guided path: measure, identify, identify the servo, tune, run. */

import { attribute, h, hidden, icon, refill, text } from "./dom";
import { ask, type Say } from "./flow";
import type { Link } from "./link";
import { openPage } from "./sandbox";
import type { PathStep } from "./wire";

const STEPS: { name: string; title: string; words: string; moves: boolean }[] = [
  { name: "measure", title: "Measure", words: "The motor moves through ramps, sines and a chirp. It is armed, run and ended on the page Rig; then the files are written.", moves: true },
  { name: "identify", title: "Identify", words: "A model of the cable is fitted to the logs. Nothing moves.", moves: false },
  { name: "identify-servo", title: "Identify servo", words: "Natural frequency, damping and delay of the motor's servo are fitted to the log. Nothing moves.", moves: false },
  { name: "tune", title: "Tune", words: "Gains with margins are found for this model. Nothing moves.", moves: false },
  { name: "run", title: "Run", words: "A law moves the joint. It is armed and run on the page Rig.", moves: true },
];
const MARKS = { waiting: "ring", going: "dots", done: "check", failed: "cross" } as const;
const WORDS = { waiting: "not done", going: "going on", done: "done", failed: "failed" } as const;

export function path(link: Link, say: Say, toRun: () => void): { element: HTMLElement; update: () => void } {
  const page = h("div", { class: "opened" });
  const none = h("p", { class: "empty" }, "The guided path is not possible for this rig.");
  const said = h("p", { class: "next" });
  const rows = STEPS.map((step, i) => {
    const begin = h("button", {
      type: "button",
      class: "step-button",
      onclick: () => {
        if (step.name === "run") toRun();
        else void ask(link, "/api/path", { step: step.name }, say).then((ok) => ok && step.name === "measure" && toRun());
      },
    }, step.name === "run" ? "Go to the rig" : `Begin: ${step.title.toLowerCase()}`);
    begin.addEventListener("keydown", (event) => event.key === "Enter" && event.repeat && event.preventDefault());
    const mark = h("span", { class: "mark" });
    const words = h("p", { class: "path-said" });
    const progress = h("progress", { max: 1, "aria-label": `${step.title}: share done` });
    const files = h("ul", { class: "files" });
    const look = h("div", {});
    const element = h(
      "li",
      { class: "path-step" },
      mark,
      h("div", { class: "flow-body" }, h("h2", {}, `${i + 1}. ${step.title}`), h("p", {}, step.words), step.moves && h("p", { class: "hint" }, "It moves the rig: keep your hand on the stop."), begin, progress, words, files, look),
    );
    return { step, element, begin, mark, words, progress, files, look };
  });
  const element = h(
    "div",
    { class: "page path" },
    h("p", {}, "From a cable that nobody knows to a law that moves it. Each step does what the command of its name does, and leaves the same files."),
    said,
    none,
    h("ol", { class: "path-steps" }, ...rows.map((row) => row.element)),
    page,
  );

  function update(): void {
    const state = link.state;
    if (!state) return;
    const now = state.path ?? null;
    hidden(none, now !== null);
    text(said, now?.next ?? "");
    hidden(said, !now?.next);
    const free = state.you.controls && link.connected && state.phase === "idle";
    for (const row of rows) {
      const known: PathStep | undefined = now?.steps?.find((step) => step.name === row.step.name);
      const here = now !== null && now.step === row.step.name;
      const going = here && (now.running ?? state.phase === "step");
      const how = known?.state ?? (going ? "going" : "waiting");
      attribute(row.element, "class", `path-step ${how}`);
      refill(row.mark, how, () => [icon(MARKS[how]), h("span", { class: "unseen" }, WORDS[how])]);
      const may = row.step.name === "run" || (free && now !== null);
      if (row.begin.disabled === may) row.begin.disabled = !may;
      hidden(row.progress, !going);
      if (going) {
        if (now.fraction === null) row.progress.removeAttribute("value");
        else row.progress.value = now.fraction;
      }
      const words = known?.said ?? (here ? now.said : "");
      text(row.words, words);
      hidden(row.words, words === "");
      const files = known?.files ?? (here ? now.files : []);
      refill(row.files, files, () => files.map((name) => h("li", {}, h("code", {}, name))));
      const address = known?.page ?? null;
      refill(row.look, address, () => (address ? [h("button", { type: "button", class: "small", onclick: () => openPage(page, address, `${row.step.title}: its page`) }, "Show its page")] : []));
    }
  }
  return { element, update };
}

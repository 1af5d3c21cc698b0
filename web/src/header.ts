/** What is always in sight: which rig, twin or hardware, the state, who controls, and stop. */

import { attribute, duration, h, hidden, icon, refill, text } from "./dom";
import type { Link } from "./link";
import { lookOf } from "./modes";
import { Refused, post, type State } from "./wire";

export interface Header {
  element: HTMLElement;
  update: () => void;
  stop: () => void;
}

export function header(link: Link, say: (words: string, bad?: boolean) => void): Header {
  const name = h("h1", { class: "rig-name" }, "bowden console");
  const hash = h("span", { class: "hash" });
  const drive = h("div", { class: "drive" });
  const banner = h("div", { class: "banner", id: "banner" });
  const picture = h("span", { class: "banner-icon" });
  const word = h("strong", { class: "banner-word" });
  const meaning = h("span", { class: "banner-meaning" });
  const elapsed = h("span", { class: "time-value" });
  const remaining = h("span", { class: "time-value" });
  const spoken = h("div", { class: "unseen", role: "status", "aria-live": "assertive" });
  banner.append(
    picture,
    h("div", { class: "banner-text" }, word, meaning),
    h("div", { class: "times" }, h("div", {}, h("span", { class: "time-name" }, "elapsed "), elapsed), h("div", {}, h("span", { class: "time-name" }, "remaining "), remaining)),
  );

  const who = h("p", { class: "who" });
  const take = h("button", { type: "button", class: "small", onclick: () => void takeControl() }, "Take control");
  const give = h("button", { type: "button", class: "small", onclick: () => void control(false) }, "Give back");
  const sure = h("button", { type: "button", class: "small danger", onclick: () => void control(true) }, "Yes, take over");
  const unsure = h("button", { type: "button", class: "small", onclick: () => ask(false) }, "No");
  const asked = h("span", { class: "asked" }, sure, unsure);
  asked.hidden = true;

  let pressed = false;
  const stopKeys = h("span", { class: "stop-keys" });
  const stopButton = h(
    "button",
    { type: "button", class: "stop", id: "stop", "aria-describedby": "stop-help" },
    h("span", { class: "stop-word" }, "STOP"),
    stopKeys,
  );
  function stop(): void {
    if (link.connected) say("Stop sent.");
    else say("Stop is tried, but there is no news from the rig: it may not get there. Use the hardware emergency stop.", true);
    const late = () => say("The console has not answered the stop for 1 s: it may not have got there. Use the hardware emergency stop.", true);
    void link.stop(late).then((taken) => {
      if (taken) say("The console has taken the stop.");
      else say("Stop was NOT taken: no connection. Use the hardware emergency stop.", true);
    });
  }
  stopButton.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    pressed = true;
    stop();
  });
  // A click follows the pointer that went down; one without it is a key's, or that of a screen reader.
  stopButton.addEventListener("click", () => {
    if (!pressed) stop();
    pressed = false;
  });

  function ask(yes: boolean): void {
    asked.hidden = !yes;
    take.hidden = yes;
    (yes ? unsure : take).focus();
  }
  async function control(taken: boolean): Promise<void> {
    asked.hidden = true;
    try {
      const answer = (await post("/api/control", { take: taken })) as State | null;
      if (answer && "you" in answer) link.take(answer);
      say(taken ? "You control the rig from this page." : "Control is given back.");
    } catch (error) {
      if (error instanceof Refused) say(`${error.problem.what}. ${error.problem.do}.`, true);
      else say("The console does not answer.", true);
    }
    update();
  }
  async function takeControl(): Promise<void> {
    if (link.state?.you.controller && !link.state.you.controls) ask(true);
    else await control(true);
  }

  let last = "";
  function update(): void {
    const state = link.state;
    const look = lookOf(state, link.connected, link.silence());
    document.body.classList.toggle("stale", state !== null && !link.connected);
    banner.className = `banner ${look.kind}`;
    refill(picture, look.icon, () => [icon(look.icon)]);
    text(word, look.name);
    text(meaning, look.meaning);
    if (last !== look.name) {
      last = look.name;
      text(spoken, `${look.name}. ${look.meaning}`);
    }
    text(stopKeys, link.connected || !state ? "Space or Esc" : "may not get there");
    document.title = `${look.name} · ${state?.rig.name ?? "bowden console"}`;
    const run = link.connected ? state?.run : null;
    text(elapsed, duration(run?.elapsed));
    text(remaining, duration(run?.remaining));
    if (!state) return;
    text(name, state.rig.name);
    text(hash, state.rig.hash.slice(0, 12));
    attribute(hash, "title", `hash of the rig: ${state.rig.hash}`);
    const hardware = state.rig.drive === "hardware";
    attribute(drive, "class", `drive ${hardware ? "hardware" : "twin"}`);
    refill(drive, [state.rig.drive, state.rig.bus], () => [
      icon(hardware ? "bolt" : "computer"),
      h("span", {}, h("strong", {}, hardware ? "HARDWARE" : "TWIN"), h("small", {}, hardware ? state.rig.bus || "real drive" : "simulated drive")),
    ]);
    const { controls, controller, viewers } = state.you;
    const others = viewers > 1 ? ` · ${viewers} pages open` : "";
    if (!link.connected) text(who, "Not known who controls.");
    else if (controls && !link.inFront()) text(who, "This page is not in front: no sign of life.");
    else if (controls) text(who, `You control${others}`);
    else text(who, `${controller ? `Another page controls, ${controller}` : "Nobody controls"}${others}`);
    attribute(who, "class", controls && link.connected ? "who mine" : "who");
    if (controls) asked.hidden = true;
    hidden(take, controls || !asked.hidden);
    text(take, controller ? "Take over" : "Take control");
    hidden(give, !controls);
  }

  const element = h(
    "header",
    { class: "top" },
    h("div", { class: "rig" }, name, h("div", { class: "rig-hash" }, "rig ", hash)),
    drive,
    banner,
    h("div", { class: "control" }, who, h("div", { class: "control-buttons" }, take, give, asked)),
    stopButton,
    spoken,
  );
  return { element, update, stop };
}

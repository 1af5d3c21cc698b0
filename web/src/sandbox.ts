/** A report in a frame that runs no script. */

import { h } from "./dom";

/** Show a page of this console, and only of this console, in a sandboxed frame. */
export function openPage(into: HTMLElement, address: string, title: string): void {
  const url = new URL(address, location.href);
  if (url.origin !== location.origin) return;
  const close = h("button", { type: "button", class: "small frame-close", onclick: () => into.replaceChildren() }, "Close");
  const note = h("p", { class: "hint frame-note" }, "A rig is started, or there is no news from it. So this page can be looked at and not used: keys that are pressed in it would not stop the rig.");
  note.hidden = true;
  into.replaceChildren(h("div", { class: "bar" }, h("h2", {}, title), close), note, h("iframe", { class: "report", sandbox: "", src: url.href, title, referrerpolicy: "no-referrer" }));
  guardFrames(guarded);
  into.scrollIntoView({ block: "start" });
  close.focus({ preventScroll: true });
}

let guarded = true;

/** Keys that are pressed in a frame go to its page and do not stop: while a rig is started no frame has or takes the focus. */
export function guardFrames(busy: boolean): void {
  guarded = busy;
  for (const frame of document.querySelectorAll<HTMLIFrameElement>("iframe.report")) {
    const around = frame.parentElement;
    if (busy && document.activeElement === frame) {
      frame.blur();
      around?.querySelector<HTMLElement>(".frame-close")?.focus({ preventScroll: true });
    }
    frame.inert = busy;
    const note = around?.querySelector<HTMLElement>(".frame-note");
    if (note) note.hidden = !busy;
  }
}

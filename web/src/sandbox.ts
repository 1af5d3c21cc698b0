/** A report in a frame that runs no script. */

import { h } from "./dom";

/** Show a page of this console, and only of this console, in a sandboxed frame. */
export function openPage(into: HTMLElement, address: string, title: string): void {
  const url = new URL(address, location.href);
  if (url.origin !== location.origin) return;
  const close = h("button", { type: "button", class: "small", onclick: () => into.replaceChildren() }, "Close");
  into.replaceChildren(h("div", { class: "bar" }, h("h2", {}, title), close), h("iframe", { class: "report", sandbox: "", src: url.href, title, referrerpolicy: "no-referrer" }));
  into.scrollIntoView({ block: "start" });
  close.focus({ preventScroll: true });
}

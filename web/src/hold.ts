/** A button that acts after it has been held for a second: by pointer, or by Enter. Space never holds it: Space stops. */

import { h, text } from "./dom";

const HOLD_MS = 1000;

export interface Hold {
  button: HTMLButtonElement;
  enable: (yes: boolean) => void;
}

export function holdButton(words: string, act: () => void, cancelled: () => void): Hold {
  const fill = h("span", { class: "fill", "aria-hidden": "true" });
  const label = h("span", { class: "label" }, words);
  const button = h("button", { type: "button", class: "hold", "aria-describedby": "hold-help" }, fill, label);
  let began = 0;
  let frame = 0;

  function draw(): void {
    const share = Math.min((performance.now() - began) / HOLD_MS, 1);
    fill.style.transform = `scaleX(${share})`;
    if (share < 1) frame = requestAnimationFrame(draw);
  }
  let timer = 0;
  function begin(): void {
    if (button.disabled || timer) return;
    began = performance.now();
    text(label, "Keep holding…");
    timer = window.setTimeout(() => {
      end();
      act();
    }, HOLD_MS);
    frame = requestAnimationFrame(draw);
  }
  function end(): boolean {
    if (!timer) return false;
    window.clearTimeout(timer);
    timer = 0;
    cancelAnimationFrame(frame);
    fill.style.transform = "scaleX(0)";
    text(label, words);
    return true;
  }
  function cancel(): void {
    if (end()) cancelled();
  }
  button.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    button.setPointerCapture(event.pointerId);
    begin();
  });
  for (const name of ["pointerup", "pointercancel", "blur", "lostpointercapture"]) button.addEventListener(name, cancel);
  button.addEventListener("keydown", (event) => {
    if (event.key !== "Enter") return;
    event.preventDefault();
    if (!event.repeat) begin();
  });
  button.addEventListener("keyup", (event) => {
    if (event.key === "Enter") cancel();
  });
  button.addEventListener("contextmenu", (event) => event.preventDefault());
  window.addEventListener("keydown", (event) => {
    if (event.code === "Space" || event.key === "Escape") cancel();
  }, true);
  return {
    button,
    enable: (yes) => {
      if (button.disabled === yes) button.disabled = !yes;
      if (!yes) end();
    },
  };
}

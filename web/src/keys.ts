/** The keys that stop: Space from everywhere but a text field, Escape from everywhere. */

const TYPED = new Set(["text", "search", "number", "email", "url", "tel", "password", ""]);

/** Whether a key that is pressed there is typed into a text. */
export function isTyping(target: EventTarget | null): boolean {
  if (target instanceof HTMLTextAreaElement) return true;
  return target instanceof HTMLInputElement && TYPED.has(target.type);
}

/**
 * Call `stop` on these keys. While `busy` says so (something has power or may get it), Space does nothing else: it never
 * presses the button that has the focus.
 */
export function watchKeys(stop: () => void, busy: () => boolean): void {
  let swallow = false;
  window.addEventListener(
    "keydown",
    (event) => {
      const space = event.code === "Space" && !isTyping(event.target);
      if (!space && event.key !== "Escape") return;
      if (space && (busy() || !isControl(event.target))) {
        event.preventDefault();
        event.stopPropagation();
        swallow = true;
      }
      if (!event.repeat) stop();
    },
    true,
  );
  // A button is pressed by Space when the key comes up.
  window.addEventListener(
    "keyup",
    (event) => {
      if (event.code === "Space" && swallow) {
        event.preventDefault();
        event.stopPropagation();
        swallow = false;
      }
    },
    true,
  );
}

function isControl(target: EventTarget | null): boolean {
  return target instanceof HTMLElement && target.closest("button, select, summary, a, input") !== null;
}

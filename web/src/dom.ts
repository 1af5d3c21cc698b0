/** Elements made in code; text is always set as text. */

type Value = string | number | boolean | null | undefined | ((event: never) => void);
type Child = Node | string | null | undefined | false;

/** An element with attributes, listeners (`onclick: …`) and children. */
export function h<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  attributes: Record<string, Value> = {},
  ...children: Child[]
): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (value === null || value === undefined || value === false) continue;
    if (typeof value === "function") element.addEventListener(name.slice(2), value as EventListener);
    else if (name === "class") element.className = String(value);
    else element.setAttribute(name, value === true ? "" : String(value));
  }
  for (const child of children) if (child !== null && child !== undefined && child !== false) element.append(child);
  return element;
}

/** Set a text, only if it is another one: a screen reader and a selection are left alone otherwise. */
export function text(element: HTMLElement, words: string): void {
  if (element.textContent !== words) element.textContent = words;
}

export function hidden(element: HTMLElement, yes: boolean): void {
  if (element.hidden !== yes) element.hidden = yes;
}

export function attribute(element: Element, name: string, value: string | null): void {
  if (value === null) {
    if (element.hasAttribute(name)) element.removeAttribute(name);
  } else if (element.getAttribute(name) !== value) element.setAttribute(name, value);
}

const made = new WeakMap<HTMLElement, string>();

/** Fill an element anew, only if what it is made from has changed. */
export function refill(element: HTMLElement, from: unknown, make: () => Child[]): void {
  const key = JSON.stringify(from) ?? "";
  if (made.get(element) === key) return;
  made.set(element, key);
  element.replaceChildren(...make().filter((child): child is Node | string => Boolean(child)));
}

const SVG = "http://www.w3.org/2000/svg";

const ICONS: Record<string, string> = {
  square: "M5 5h14v14H5z",
  dial: "M12 3a9 9 0 1 0 9 9h-9z",
  flag: "M6 3h2v18H6zM9 4h10l-3 4 3 4H9z",
  play: "M6 4l14 8-14 8z",
  bridge: "M2 17c4-9 16-9 20 0h-3c-3-5-11-5-14 0zM2 19h20v2H2z",
  down: "M9 3h6v9h5l-8 9-8-9h5z",
  lock: "M7 10V8a5 5 0 0 1 10 0v2h2v11H5V10zm3 0h4V8a2 2 0 0 0-4 0z",
  dots: "M4 10h4v4H4zM10 10h4v4h-4zM16 10h4v4h-4z",
  broken: "M4 2l18 18-2 2L2 4zM3 8h8l2 2H5v8h13v2H3z",
  check: "M9 19l-6-6 2.5-2.5L9 14 18.500 4.500 21 7z",
  cross: "M6 3l6 6 6-6 3 3-6 6 6 6-3 3-6-6-6 6-3-3 6-6-6-6z",
  ring: "M12 3a9 9 0 1 0 0 18 9 9 0 0 0 0-18zm0 3a6 6 0 1 1 0 12 6 6 0 0 1 0-12z",
  computer: "M3 4h18v12H3zm2 2v8h14V6zM8 18h8v2H8z",
  bolt: "M13 2L4 14h6l-2 8 10-13h-6z",
  warning: "M12 2l11 20H1zm-1.300 7v6h2.600V9zm0 8v2.500h2.600V17z",
};

/** A picture without a meaning of its own: words stand beside it. */
export function icon(name: string): SVGSVGElement {
  const svg = document.createElementNS(SVG, "svg");
  svg.setAttribute("viewBox", "0 0 24 24");
  svg.setAttribute("aria-hidden", "true");
  svg.setAttribute("class", "icon");
  const path = document.createElementNS(SVG, "path");
  path.setAttribute("d", ICONS[name] ?? ICONS.ring!);
  path.setAttribute("fill", "currentColor");
  path.setAttribute("fill-rule", "evenodd");
  svg.append(path);
  return svg;
}

/** Seconds as minutes and seconds, or with a tenth below a minute. */
export function duration(seconds: number | null | undefined): string {
  if (seconds === null || seconds === undefined || !Number.isFinite(seconds)) return "–";
  if (seconds < 60) return `${Math.max(0, seconds).toFixed(1)} s`;
  const whole = Math.floor(seconds);
  return `${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, "0")} min`;
}

/** A time of the log, as the computer of this page has it. */
export function moment(time: string): string {
  const when = new Date(time);
  return Number.isNaN(when.getTime()) ? time : when.toLocaleString("sv-SE");
}

/** A number with about four digits. */
export function number(value: number | null | undefined): string {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  const size = Math.abs(value);
  if (size >= 1000) return value.toFixed(0);
  if (size >= 100) return value.toFixed(1);
  if (size >= 0.1 || size === 0) return value.toFixed(2);
  if (size >= 0.001) return value.toFixed(4);
  return value.toExponential(1);
}

export function titled(choice: { name: string; title?: string } | string): { name: string; title: string } {
  return typeof choice === "string" ? { name: choice, title: choice } : { name: choice.name, title: choice.title ?? choice.name };
}

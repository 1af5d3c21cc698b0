/** What a run is made of: law, gains, reference, duration, who and why. */

import { attribute, h, hidden, number, refill, text, titled } from "./dom";
import { ask, sentence, type Say } from "./flow";
import type { Link } from "./link";
import type { Quantity, State } from "./wire";

/** In the list of presets: the law's defaults, which have no name. */
const DEFAULTS = "\u0000defaults";

type Field = HTMLInputElement | HTMLSelectElement | HTMLTextAreaElement;

export function settings(link: Link, say: Say): { element: HTMLElement; update: () => void } {
  const set = (body: Record<string, unknown>): Promise<boolean> => ask(link, "/api/settings", body, say);
  /** Fields that the user is in, or whose change is not sent yet: the state does not write into them. */
  const busy = new WeakSet<Field>();

  function commit<F extends Field>(field: F, send: () => Promise<boolean>): F {
    field.addEventListener("input", () => busy.add(field));
    // What was refused is not left there as if it were set.
    field.addEventListener("blur", () => {
      if (!busy.has(field)) attribute(field, "aria-invalid", null);
      update();
    });
    field.addEventListener("change", () => {
      void send().then((ok) => {
        busy.delete(field);
        attribute(field, "aria-invalid", ok ? null : "true");
        update();
      });
    });
    return field;
  }
  function fill(field: Field, value: string): void {
    if (!busy.has(field) && field !== document.activeElement && field.value !== value) field.value = value;
  }

  const law: HTMLSelectElement = commit(h("select", { id: "law" }), () => set({ law: law.value }));
  const preset: HTMLSelectElement = commit(h("select", { id: "preset" }), () => set({ preset: preset.value === DEFAULTS ? null : preset.value }));
  const kind: HTMLSelectElement = commit(h("select", { id: "kind" }), () => set({ reference: { kind: kind.value } }));
  const seconds: HTMLInputElement = commit(h("input", { id: "duration", type: "number", min: 0, step: "any" }), () => set({ duration: seconds.valueAsNumber }));
  const subject: HTMLInputElement = commit(h("input", { id: "subject", type: "text", maxlength: 200, autocomplete: "off" }), () => set({ subject: subject.value }));
  const session: HTMLInputElement = commit(h("input", { id: "session", type: "text", maxlength: 200, autocomplete: "off" }), () => set({ session: session.value }));
  const notes: HTMLTextAreaElement = commit(h("textarea", { id: "notes", rows: 2, maxlength: 4000 }), () => set({ notes: notes.value }));
  const gains = h("div", { class: "quantities" });
  const reference = h("div", { class: "quantities" });
  const locked = h("p", { class: "hint" }, "A run is open. End it to change these; gains with a button may be changed while the law runs.");
  const label = (words: string, field: Field) => h("div", { class: "field" }, h("label", { for: field.id }, words), field);
  const presetField = label("Gains begin with", preset);
  const editedNames = h("span", {});
  const undo = h("button", { type: "button", class: "small", onclick: () => void set({ preset: link.state?.settings.preset ?? null }) }, "Undo changes");
  const editedLine = h("p", { class: "hint" }, editedNames, undo);

  const summary = h("span", { class: "settings-summary" });
  const details = h(
    "details",
    { class: "card settings", open: true },
    h("summary", {}, h("h2", {}, "Settings"), summary),
    locked,
    h("div", { class: "pair" }, label("Law", law), presetField),
    h("fieldset", {}, h("legend", {}, "Gains"), editedLine, gains),
    h("fieldset", {}, h("legend", {}, "Reference"), label("Kind", kind), reference),
    label("Duration [s]", seconds),
    h("div", { class: "pair" }, label("Subject", subject), label("Session", session)),
    label("Notes", notes),
    h("p", { class: "hint" }, "All of this is written into the log."),
  );

  let quantities: { name: string; field: Field }[] = [];
  /** Of each gain: the button that changes it while the law runs, and what became of that. */
  const changes = new Map<string, { field: HTMLInputElement; button: HTMLButtonElement; said: HTMLElement }>();

  function gain(name: string, given: Quantity): HTMLElement {
    const row = quantity("gain", name, given, (value) => (running() ? Promise.resolve(true) : set({ gains: { [name]: value } })));
    const field = row.querySelector("input")!;
    const change = (): void => {
      if (button.disabled) return;
      void ask(link, "/api/gain", { name, value: field.valueAsNumber }, say).then((ok) => {
        if (ok) busy.delete(field);
        attribute(field, "aria-invalid", ok ? null : "true");
        update();
      });
    };
    const button = h("button", { type: "button", class: "small", onclick: change }, `Change ${name}`);
    // While the law runs a value goes to it by Enter or the button alone, not by leaving the field.
    field.addEventListener("keydown", (event) => {
      if (event.key === "Enter" && !event.repeat && running()) change();
    });
    field.addEventListener("change", (event) => running() && event.stopImmediatePropagation(), true);
    field.addEventListener("input", () => update());
    const said = h("p", { class: "change", role: "status" });
    row.append(button, said);
    changes.set(name, { field, button, said });
    return row;
  }
  const running = (): boolean => link.state?.phase === "live";

  function quantity(prefix: string, name: string, given: Quantity, send: (value: unknown) => Promise<boolean>): HTMLElement {
    const id = `${prefix}-${name}`;
    const numeric = typeof given.value === "number" || given.value === null;
    const field = h("input", { id, type: numeric ? "number" : "text", step: numeric ? "any" : null, autocomplete: "off" });
    const bounds = limits(given);
    if (numeric && typeof given.low === "number") field.min = String(given.low);
    if (numeric && typeof given.high === "number") field.max = String(given.high);
    const hint = h("p", { class: "hint", id: `${id}-hint` }, [given.meaning, bounds].filter(Boolean).join(" · "));
    field.setAttribute("aria-describedby", hint.id);
    commit(field, () => send(parse(field, given)));
    quantities.push({ name: id, field });
    const unit = given.unit && given.unit !== "1" ? ` [${given.unit}]` : "";
    return h("div", { class: "field" }, h("label", { for: id }, `${name}${unit}`), field, hint);
  }

  function choices(field: HTMLSelectElement, all: Parameters<typeof titled>[0][], value: string): void {
    refill(field, all, () => all.map((choice) => h("option", { value: titled(choice).name }, titled(choice).title)));
    fill(field, value);
  }

  let wasLocked: boolean | null = null;
  function update(): void {
    const state: State | null = link.state;
    if (!state) return;
    const now = state.settings;
    const free = state.you.controls && link.connected && !now.locked && state.phase === "idle";
    choices(law, now.laws, now.law);
    const presets = now.presets.map((one) => (typeof one === "string" ? titled(one) : titled({ name: one.name ?? DEFAULTS, title: one.title })));
    choices(preset, presets, now.preset ?? DEFAULTS);
    hidden(presetField, now.presets.length === 0);
    const edited = now.edited ?? [];
    hidden(editedLine, edited.length === 0);
    text(editedNames, edited.length === 0 ? "" : `Changed here: ${edited.join(", ")}. `);
    if (undo.disabled === free) undo.disabled = !free;
    const kinds = now.reference.kinds ?? [now.reference.kind];
    choices(kind, kinds, now.reference.kind);
    fill(seconds, now.duration === null ? "" : String(now.duration));
    fill(subject, now.subject);
    fill(session, now.session);
    fill(notes, now.notes);
    const shape = (all: Record<string, Quantity>) => Object.entries(all).map(([name, { low, high, unit, meaning }]) => [name, low, high, unit, meaning]);
    const fields = now.reference.fields ?? {};
    const before = quantities;
    quantities = [];
    let made = false;
    refill(gains, [now.law, shape(now.gains)], () => {
      made = true;
      changes.clear();
      return Object.entries(now.gains).map(([name, given]) => gain(name, given));
    });
    if (!made) quantities.push(...before.filter(({ name }) => name.startsWith("gain-")));
    made = false;
    refill(reference, [now.reference.kind, shape(fields)], () => {
      made = true;
      return Object.entries(fields).map(([name, given]) =>
        quantity("reference", name, given, (value) => set({ reference: { kind: kind.value, [name]: value } })),
      );
    });
    if (!made) quantities.push(...before.filter(({ name }) => name.startsWith("reference-")));
    if (wasLocked === true && !now.locked) {
      // What was typed and not sent is of the run that has ended.
      for (const [name, { field }] of changes) {
        busy.delete(field);
        field.value = shown(now.gains[name]?.value ?? null);
      }
    }
    for (const { name, field } of quantities) {
      const at = name.indexOf("-");
      const given = name.startsWith("gain-") ? now.gains[name.slice(at + 1)] : fields[name.slice(at + 1)];
      if (!given) continue;
      const under = given.change?.state === "checking" || given.change?.state === "going";
      fill(field, shown(under ? given.change!.to : given.value));
      const may = free || (given.live === true && state.you.controls && link.connected && state.phase === "live");
      if (field.disabled === may) field.disabled = !may;
    }
    for (const [name, one] of changes) showChange(one, now.gains[name], state);
    for (const field of [law, preset, kind, seconds, subject, session, notes]) if (field.disabled === free) field.disabled = !free;
    hidden(locked, !now.locked);
    text(summary, `${now.law}${now.duration ? `, ${now.duration} s` : ""}`);
    // Out of the way when a run opens; back when it ends.
    if (wasLocked !== now.locked) {
      if (wasLocked !== null || now.locked) details.open = !now.locked || Object.values(now.gains).some((given) => given.live === true);
      wasLocked = now.locked;
    }
  }
  function showChange({ field, button, said }: { field: HTMLInputElement; button: HTMLButtonElement; said: HTMLElement }, given: Quantity | undefined, state: State): void {
    const live = state.phase === "live" && given?.live === true;
    if (!running() && !busy.has(field)) attribute(field, "aria-invalid", null);
    hidden(button, !live);
    const going = Object.values(state.settings.gains).some(({ change }) => change?.state === "checking" || change?.state === "going");
    const may = live && !going && !field.disabled && Number.isFinite(field.valueAsNumber) && field.valueAsNumber !== given?.value;
    if (button.disabled === may) button.disabled = !may;
    const words = live ? changed(given) : state.phase === "live" ? LOCKED : "";
    text(said, words);
    attribute(said, "class", `change ${live ? (given.change?.state ?? "").replace(" ", "-") : ""}`.trim());
    hidden(said, words === "");
  }
  return { element: details, update };
}

const LOCKED = "Locked while the law runs: it is no gain that the law lets change then.";

/** What became of the newest change of a gain. */
function changed({ change, value }: Quantity): string {
  if (!change) return "";
  if (change.state === "checking") return `Checking ${change.to} on this rig… ${value} stays in force.`;
  if (change.state === "going") return `Holds. Going over to ${change.to}, now ${number(value as number)}.${change.text ? ` ${sentence(change.text)}` : ""}`;
  if (change.state === "in force") return `${change.to} is in force; it was ${change.from}.${change.text ? ` ${sentence(change.text)}` : ""}`;
  return `${change.to} is refused, ${value} stays in force: ${sentence(change.text)}`;
}

function shown(value: Quantity["value"]): string {
  if (value === null || value === undefined) return "";
  return Array.isArray(value) ? value.join(", ") : String(value);
}

function parse(field: HTMLInputElement, given: Quantity): unknown {
  if (field.type === "number") return field.value === "" ? null : field.valueAsNumber;
  if (Array.isArray(given.value)) return field.value.split(/[,;\s]+/).filter(Boolean).map(Number);
  if (typeof given.value === "boolean") return field.value.trim() === "true";
  return field.value;
}

function limits(given: Quantity): string {
  const { low, high } = given;
  const has = (limit: number | null | undefined): limit is number => typeof limit === "number" && Number.isFinite(limit);
  if (has(low) && has(high)) return `${low} to ${high}`;
  if (has(low)) return `at least ${low}`;
  return has(high) ? `at most ${high}` : "";
}

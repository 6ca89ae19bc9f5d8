/** Makes and finds elements of the page. */

type Child = Node | string | null | undefined | false;

/** Attributes of an element; `on` has its listeners, `class` and `data-*` are written as in HTML. */
export interface Attributes {
  [name: string]: string | number | boolean | null | undefined | Record<string, (event: never) => void>;
  on?: Record<string, (event: never) => void>;
}

/** An element with its attributes and children. False and null leave an attribute or a child out. */
export function el<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  attributes: Attributes = {},
  ...children: Child[]
): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name === "on") continue;
    if (value === null || value === undefined || value === false) continue;
    element.setAttribute(name, value === true ? "" : String(value));
  }
  for (const [event, listener] of Object.entries(attributes.on ?? {})) {
    element.addEventListener(event, listener as EventListener);
  }
  add(element, ...children);
  return element;
}

/** Appends children to an element. */
export function add(parent: Element, ...children: Child[]): void {
  for (const child of children) if (child) parent.append(child);
}

/** Sets an element's text only where it changes, so that the page is laid out no more than needed. */
export function setText(element: Element, text: string): void {
  if (element.textContent !== text) element.textContent = text;
}

/** Sets or removes an attribute only where it changes. */
export function setAttribute(element: Element, name: string, value: string | null): void {
  if (element.getAttribute(name) === value) return;
  if (value === null) element.removeAttribute(name);
  else element.setAttribute(name, value);
}

/** A switch with its label. */
export function toggle(
  label: string,
  id: string,
  on: boolean,
  change: (on: boolean) => void,
  hint?: string,
): HTMLLabelElement {
  const input = el("input", { type: "checkbox", role: "switch", id, "data-test": id });
  input.checked = on;
  input.addEventListener("change", () => change(input.checked));
  const text = el("span", { class: "toggle-text" }, el("span", {}, label), hint ? el("small", {}, hint) : null);
  return el("label", { class: "toggle", for: id }, input, el("span", { class: "knob", "aria-hidden": "true" }), text);
}

/** A button with a text. */
export function button(label: string, id: string, click: () => void, kind = ""): HTMLButtonElement {
  return el("button", { type: "button", class: `button ${kind}`.trim(), "data-test": id, on: { click } }, label);
}

/** A choice of one of several values. */
export function select(
  label: string,
  id: string,
  options: [value: string, text: string][],
  change: (value: string) => void,
): { root: HTMLLabelElement; input: HTMLSelectElement; set: (options: [string, string][], value?: string) => void } {
  const input = el("select", { id, "data-test": id });
  const set = (entries: [string, string][], value?: string): void => {
    const kept = value ?? input.value;
    input.replaceChildren(...entries.map(([v, text]) => el("option", { value: v }, text)));
    if (entries.some(([v]) => v === kept)) input.value = kept;
  };
  set(options);
  input.addEventListener("change", () => change(input.value));
  return { root: el("label", { class: "field", for: id }, el("span", {}, label), input), input, set };
}

/** A slider with its label and its value as text. */
export function slider(
  label: string,
  id: string,
  range: { min: number; max: number; step: number; value: number; text: (value: number) => string },
  input: (value: number) => void,
): { root: HTMLDivElement; input: HTMLInputElement; set: (value: number) => void } {
  const control = el("input", {
    type: "range", id, "data-test": id, min: range.min, max: range.max, step: range.step,
  });
  control.value = String(range.value);
  const value = el("output", { for: id }, range.text(range.value));
  control.addEventListener("input", () => {
    setText(value, range.text(Number(control.value)));
    input(Number(control.value));
  });
  const set = (to: number): void => {
    control.value = String(to);
    setText(value, range.text(to));
  };
  const root = el("div", { class: "slider" }, el("label", { for: id }, label), value, control);
  return { root, input: control, set };
}

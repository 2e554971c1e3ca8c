// Controls: each has a label, a unit, an explanation, and a place for a message of the engine.
import { h, newId } from "./dom";
import { NumberField, text } from "./number";

export { text };

export interface Control {
  element: HTMLElement;
  /// Shows the current value.
  refresh(): void;
  /// Ends what it follows, when it is taken from the page.
  readonly end?: () => void;
}

interface Described {
  label: string;
  /// One sentence.
  help: string;
  /// Key of the sample that the control sets: `layer[0].density_kg_m3`.
  key?: string;
}

export interface SliderOptions extends Described {
  unit: string;
  /// Ends of the slider. The number field takes any number; the engine says if it is refused.
  min: number;
  max: number;
  step: number;
  /// `log0` has the value 0 at its left end, then rises from `min` as `log` does.
  scale?: "linear" | "log" | "log0";
  get(): number;
  set(value: number): void;
}

const STEPS = 400;

export function slider(options: SliderOptions): Control {
  const { label, unit, help, min, max, scale = "linear" } = options;
  const [rangeId, helpId] = [newId(), newId()];
  const linear = scale === "linear";
  const range = h("input", {
    type: "range",
    id: rangeId,
    min: linear ? min : 0,
    max: linear ? max : STEPS,
    step: linear ? options.step : 1,
    "aria-label": `${label}, ${unit || "no unit"}`,
    "aria-describedby": helpId,
  });

  const toPosition = (value: number): number => {
    if (linear) return value;
    if (scale === "log0" && value <= 0) return 0;
    return (Math.log(value / min) / Math.log(max / min)) * STEPS;
  };
  const toValue = (position: number): number => {
    if (linear) return position;
    if (scale === "log0" && position <= 0) return 0;
    return Number((min * (max / min) ** (position / STEPS)).toPrecision(3));
  };
  const showText = (value: number) => {
    range.setAttribute("aria-valuetext", `${text(value)} ${unit}`);
  };
  const show = (value: number) => {
    range.value = String(toPosition(value));
    showText(value);
    number.show(value);
  };
  const number = new NumberField({
    step: options.step,
    low: scale === "log0" ? 0 : min,
    high: max,
    describedBy: helpId,
    set: (value) => {
      show(value);
      options.set(value);
    },
  });
  range.addEventListener("input", () => {
    const value = toValue(Number(range.value));
    number.show(value);
    showText(value);
    options.set(value);
  });
  const refresh = () => show(options.get());
  const element = framed(
    options,
    helpId,
    h("label", { for: number.input.id, class: "name" }, label),
    h("span", { class: "value" }, number.input, h("span", { class: "unit" }, unit)),
    range,
    number.message,
  );
  element.title = help;
  refresh();
  return { element, refresh };
}

export interface ChoiceOptions extends Described {
  choices: readonly (readonly [value: string, label: string])[];
  get(): string;
  set(value: string): void;
}

export function choice(options: ChoiceOptions): Control {
  const [id, helpId] = [newId(), newId()];
  const select = h(
    "select",
    { id, "aria-describedby": helpId },
    ...options.choices.map(([value, label]) => h("option", { value }, label)),
  );
  select.addEventListener("change", () => options.set(select.value));
  const refresh = () => {
    select.value = options.get();
  };
  const element = framed(options, helpId, h("label", { for: id, class: "name" }, options.label), h("span", { class: "value" }, select));
  element.title = options.help;
  refresh();
  return { element, refresh };
}

export interface SwitchOptions extends Described {
  get(): boolean;
  set(value: boolean): void;
}

export function checkbox(options: SwitchOptions): Control {
  const [id, helpId] = [newId(), newId()];
  const input = h("input", { type: "checkbox", id, "aria-describedby": helpId });
  input.addEventListener("change", () => options.set(input.checked));
  const refresh = () => {
    input.checked = options.get();
  };
  const element = framed(options, helpId, h("label", { for: id, class: "name check" }, input, ` ${options.label}`));
  element.title = options.help;
  refresh();
  return { element, refresh };
}

/// Buttons of which one is pressed.
export function segments(options: ChoiceOptions): Control {
  const name = newId("s");
  const helpId = newId();
  const inputs = options.choices.map(([value, label]) => {
    const input = h("input", { type: "radio", name, value, "aria-describedby": helpId });
    input.addEventListener("change", () => options.set(value));
    return { value, input, element: h("label", null, input, h("span", null, label)) };
  });
  const refresh = () => {
    for (const { value, input } of inputs) input.checked = value === options.get();
  };
  const element = h(
    "fieldset",
    { class: "segments", title: options.help },
    h("legend", { class: "visually-hidden" }, options.label),
    ...inputs.map((i) => i.element),
    h("span", { id: helpId, class: "visually-hidden" }, options.help),
  );
  refresh();
  return { element, refresh };
}

/// The frame of a control: its row, its help behind a button, its message.
function framed(options: Described, helpId: string, ...children: HTMLElement[]): HTMLElement {
  const help = h("small", { id: helpId, class: "help", hidden: true }, options.help);
  const button = h("button", { type: "button", class: "ask", "aria-label": `What is this: ${options.label}`, "aria-expanded": "false" }, "?");
  button.addEventListener("click", () => {
    help.hidden = !help.hidden;
    button.setAttribute("aria-expanded", String(!help.hidden));
  });
  const [name, ...rest] = children;
  const element = h("div", { class: "control" }, h("span", { class: "title" }, name, button), ...rest, help);
  if (options.key) element.dataset.key = options.key;
  return element;
}

/// Shows a message at the control below `root` whose key is `key` or its nearest parent.
/// Returns whether there is one.
export function showMessage(root: HTMLElement, key: string | undefined, message: string): boolean {
  clearMessages(root);
  if (!key) return false;
  const controls = [...root.querySelectorAll<HTMLElement>("[data-key]")];
  const fits = (own: string) => own === key || key.startsWith(`${own}.`) || key.startsWith(`${own}[`);
  const inner = (own: string) => own.startsWith(`${key}.`) || own.startsWith(`${key}[`);
  const best =
    controls.filter((c) => fits(c.dataset.key!)).sort((a, b) => b.dataset.key!.length - a.dataset.key!.length)[0] ??
    controls.find((c) => inner(c.dataset.key!));
  if (!best) return false;
  best.classList.add("wrong");
  for (let at: HTMLElement | null = best; at; at = at.parentElement) if (at instanceof HTMLDetailsElement) at.open = true;
  const id = newId("m");
  best.append(h("small", { class: "message", id, role: "alert" }, message));
  for (const input of best.querySelectorAll("input, select")) {
    input.setAttribute("aria-invalid", "true");
    input.setAttribute("aria-errormessage", id);
  }
  return true;
}

export function clearMessages(root: HTMLElement): void {
  for (const message of root.querySelectorAll(".message")) message.remove();
  for (const control of root.querySelectorAll(".wrong")) control.classList.remove("wrong");
  // What is wrong with the text of a field, the field itself says and clears.
  for (const input of root.querySelectorAll("[aria-invalid]:not([data-mistyped])")) {
    input.removeAttribute("aria-invalid");
    input.removeAttribute("aria-errormessage");
  }
}

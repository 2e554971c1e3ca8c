// A field for a number. It is a text field, because number fields drop a decimal comma silently.
import { h, newId } from "./dom";

/// The number in a text with a decimal point or comma; null if the text is no finite number.
export function parseNumber(given: string): number | null {
  const plain = given.trim().replace(/^[−–]/, "-").replace(",", ".");
  if (!/^[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?$/i.test(plain)) return null;
  const value = Number(plain);
  return Number.isFinite(value) ? value : null;
}

/// The value one step up or down, which does not leave the range from `low` to `high` by itself.
export function stepped(value: number, by: number, low: number, high: number): number {
  const next = Number((value + by).toPrecision(12));
  if (by > 0) return value <= high ? Math.min(next, high) : next;
  return value >= low ? Math.max(next, low) : next;
}

/// A number as people write it: no more digits than it has.
export function text(value: number): string {
  return String(Number(value.toPrecision(12)));
}

export interface NumberFieldOptions {
  step: number;
  /// The arrow keys do not leave this range.
  low: number;
  high: number;
  /// What a typed number must be within, in words: "from 350 to 2500 nm". Without it any number
  /// is taken, and the engine says whether it is refused.
  within?: string;
  /// The explanation of the field.
  describedBy?: string;
  set(value: number): void;
}

export class NumberField {
  readonly input: HTMLInputElement;
  /// What is wrong with the text of the field.
  readonly message = h("small", { class: "mistyped", role: "alert", hidden: true, id: newId("m") });
  readonly #options: NumberFieldOptions;
  /// The value of the state; null if there is none yet.
  #value: number | null = null;

  constructor(options: NumberFieldOptions) {
    this.#options = options;
    this.input = h("input", { type: "text", id: newId("n"), role: "spinbutton", inputMode: "decimal", autocomplete: "off", "aria-describedby": options.describedBy });
    this.input.addEventListener("input", () => this.#typed(false));
    this.input.addEventListener("blur", () => this.restore());
    this.input.addEventListener("keydown", (event) => {
      if (event.key === "Enter") return this.#typed(true);
      const by = { ArrowUp: 1, ArrowDown: -1, PageUp: 10, PageDown: -10 }[event.key];
      if (by === undefined || this.#value === null) return;
      event.preventDefault();
      const { step, low, high } = options;
      const next = stepped(this.#value, by * step, low, high);
      this.input.value = text(next);
      this.#typed(true);
    });
  }

  /// Shows the value of the state. A text that has this value already stays as it was typed.
  show(value: number): void {
    if (value !== this.#value) this.#say("");
    this.#value = value;
    this.input.setAttribute("aria-valuenow", String(value));
    const typing = document.activeElement === this.input && (parseNumber(this.input.value) === value || !this.message.hidden);
    if (!typing) this.input.value = text(value);
  }

  /// The field is left, or shall be as if: a wrong text gives way to the value, and is named.
  restore(): void {
    this.#typed(true);
    if (this.#value !== null) this.input.value = text(this.#value);
    this.#mark(false);
  }

  /// `done`: nothing more will be typed.
  #typed(done: boolean): void {
    const given = this.input.value;
    const { low, high, within } = this.#options;
    const value = parseNumber(given);
    if (value === null) {
      // Nothing, a sign or an exponent alone: more may follow.
      if (!done && /^\s*[+−–-]?\s*$|\d[eE][+-]?$/.test(given)) return;
      if (given.trim() || this.#value !== null) this.#say(`${given.trim() ? `“${given.trim()}” is not a number` : "A number is missing"}${this.#kept()}.`);
      return;
    }
    if (within && !(value >= low && value <= high)) return this.#say(`${text(value)} is not ${within}${this.#kept()}.`);
    if (done && (value === this.#value || (this.#value !== null && given === text(this.#value)))) return;
    this.#say("");
    this.#options.set(value);
  }

  #kept(): string {
    return this.#value === null ? "" : `: the value stays ${text(this.#value)}`;
  }

  #say(message: string): void {
    if (this.message.textContent !== message) this.message.textContent = message;
    this.message.hidden = !message;
    this.#mark(!!message);
  }

  #mark(wrong: boolean): void {
    this.input.toggleAttribute("data-mistyped", wrong);
    if (wrong) {
      this.input.setAttribute("aria-invalid", "true");
      this.input.setAttribute("aria-errormessage", this.message.id);
    } else if (this.input.getAttribute("aria-errormessage") === this.message.id) {
      this.input.removeAttribute("aria-invalid");
      this.input.removeAttribute("aria-errormessage");
    }
  }
}

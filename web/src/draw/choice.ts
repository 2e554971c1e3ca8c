// A group of choices of which one holds, with a legend that is seen.

import { h, newId } from "../dom";

export class Choice<T extends string> {
  readonly element: HTMLFieldSetElement;
  private readonly options = new Map<T, { input: HTMLInputElement; text: HTMLElement }>();

  constructor(legend: string, options: readonly (readonly [T, string])[], onChoice: (value: T) => void) {
    const name = newId("choice");
    this.element = h("fieldset", { class: "segments choice" }, h("legend", null, legend));
    for (const [value, words] of options) {
      const input = h("input", { type: "radio", name, value });
      const text = h("span", null, words);
      input.addEventListener("change", () => onChoice(value));
      this.options.set(value, { input, text });
      this.element.append(h("label", null, input, text));
    }
  }

  set value(value: T) {
    const option = this.options.get(value);
    if (option) option.input.checked = true;
  }

  /** Another text for an option. */
  rename(value: T, words: string): void {
    const option = this.options.get(value);
    if (option && option.text.textContent !== words) option.text.textContent = words;
  }
}

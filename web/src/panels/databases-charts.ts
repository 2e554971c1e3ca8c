// The spectra of a look-up, with a simulation beside them.
import type { Curve } from "../curves";
import { h } from "../dom";
import { Chart } from "../draw/chart";
import { number } from "../draw/ticks";
import type { LookupAnswer, Spectrum } from "../messages";
import { QUANTITIES, type Quantity } from "./databases-colour";
import { quantityName } from "./databases-data";

interface Figure {
  chart: Chart;
  caption: HTMLElement;
  read: HTMLOutputElement;
  figure: HTMLElement;
}

export class LookupCharts {
  readonly element: HTMLElement;
  readonly #figures: Record<Quantity, Figure>;
  #answer: LookupAnswer | null = null;
  #simulated: Spectrum | null = null;

  constructor() {
    const figure = (quantity: Quantity): Figure => {
      const caption = h("figcaption");
      const read = h("output", { class: "read" });
      const chart = new Chart(`Spectrum of ${quantity}`, () => 220);
      chart.onCursor = (nm) => {
        read.textContent = nm === null ? "" : this.#reading(quantity, nm);
      };
      return { chart, caption, read, figure: h("figure", null, caption, chart.element, read) };
    };
    this.#figures = Object.fromEntries(QUANTITIES.map((quantity) => [quantity, figure(quantity)])) as Record<Quantity, Figure>;
    this.element = h("div", { class: "figures" }, ...QUANTITIES.map((quantity) => this.#figures[quantity].figure));
  }

  /// Shows a look-up in a file with this `metadata`.
  show(answer: LookupAnswer, simulated: Spectrum | null, metadata: Record<string, string>): void {
    this.#answer = answer;
    this.#simulated = simulated;
    for (const quantity of QUANTITIES) {
      const { chart, caption, figure, read } = this.#figures[quantity];
      const values = answer[quantity];
      figure.hidden = values === null;
      if (!values) continue;
      const name = quantityName(metadata, quantity);
      caption.textContent = "Line: look-up. Dashed: simulation, with a band of one standard error.";
      caption.hidden = !simulated;
      read.textContent = "";
      chart.set(this.#curves(quantity, answer.wavelengths_nm, values), {
        x: "wavelength, nm", y: `${name}, unit 1`,
        xRange: [answer.wavelengths_nm[0]!, answer.wavelengths_nm.at(-1)!],
      });
    }
  }

  #curves(quantity: Quantity, x: number[], y: number[]): Curve[] {
    const list: Curve[] = [{ name: "look-up", colour: `--${quantity}`, x, y, style: x.length <= 40 ? "dots" : "line" }];
    const simulated = this.#simulated;
    if (simulated) {
      list.push({ name: "simulation", colour: "--ink", x: simulated.wavelengths_nm, y: simulated[quantity], band: simulated[`${quantity}_se`], dash: [6, 4] });
    }
    return list;
  }

  #reading(quantity: Quantity, nm: number): string {
    const i = this.#answer?.wavelengths_nm.indexOf(nm) ?? -1;
    const value = this.#answer?.[quantity]?.[i];
    if (value === undefined) return "";
    const simulated = this.#simulated;
    const there = simulated?.[quantity][i];
    const beside = there === undefined
      ? ""
      : `; simulation ${number(there, 4)}, standard error ${number(simulated![`${quantity}_se`][i]!, 2)}`;
    return `${number(nm, 4)} nm: ${number(value, 4)}${beside}`;
  }
}

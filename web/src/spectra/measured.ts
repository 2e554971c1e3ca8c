// A measured file beside the simulation: residuals, and errors by band.
import { h } from "../dom";
import { Chart } from "../draw/chart";
import type { Measured, Statistics } from "../messages";
import { Value } from "../observable";
import { namedMessage, type MeasuredFile, type Page } from "../page";
import { MOST_FILE_BYTES, pointsOf } from "./points";

/// The bands in words.
const BANDS: Record<string, string> = { ir_a: "infrared A", ir_b: "infrared B" };

export class MeasuredPanel {
  readonly element = h("section", { class: "measured", hidden: true });
  readonly answer = new Value<Measured | null>(null);
  readonly #page: Page;
  readonly #chart = new Chart("Simulated − measured", () => 180);
  readonly #content = h("div");

  constructor(page: Page) {
    this.#page = page;
    const close = h("button", { type: "button", class: "small", onclick: () => {
        this.element.hidden = true;
        page.state.set({ measured: null });
      } }, "Remove the file");
    this.element.append(h("h3", null, "Measured"), this.#content, this.#chart.element, close);
    page.state.subscribe((_, changed) => {
      if (changed.has("measured")) void this.#update();
    });
    page.shown.subscribe(() => void this.#update());
  }

  /// Reads a file. The state keeps its points, and only those.
  async open(file: File): Promise<void> {
    const { name } = file;
    try {
      if (file.size > MOST_FILE_BYTES) throw new Error(`the file has ${(file.size / 1e6).toFixed(0)} MB, more than the ${MOST_FILE_BYTES / 1e6} MB that this page reads`);
      // Beside black snow: what counts is the file.
      const wavelengths_nm = Array.from({ length: 2151 }, (_, i) => 350 + i);
      const none = wavelengths_nm.map(() => 0);
      const black = { wavelengths_nm, reflectance: none, reflectance_se: none, transmittance: none, transmittance_se: none };
      const answer = await this.#page.engine.ask({ ask: "measured", name, text: await file.text(), ...black });
      this.#page.state.set({ measured: pointsOf(name, answer) });
    } catch (error) {
      this.#refuse(name, error);
    }
  }

  #refuse(name: string, error: unknown): void {
    this.element.hidden = false;
    this.answer.set(null);
    this.#content.replaceChildren(h("p", { class: "error", role: "alert" }, namedMessage(name, error)));
    this.#chart.element.hidden = true;
  }

  async #update(): Promise<void> {
    const { measured } = this.#page.state.get();
    const spectrum = this.#page.shown.value?.spectrum;
    this.element.hidden = !measured;
    if (!measured || !spectrum) {
      this.answer.set(null);
      return;
    }
    const { wavelengths_nm, reflectance, reflectance_se, transmittance, transmittance_se } = spectrum;
    try {
      const answer = await this.#page.engine.askLatest("measured", {
        ask: "measured",
        name: measured.name,
        text: measured.text,
        ...{ wavelengths_nm, reflectance, reflectance_se, transmittance, transmittance_se },
      });
      if (answer) this.#show(measured, answer);
    } catch (error) {
      this.#refuse(measured.name, error);
    }
  }

  #show({ name, notes }: MeasuredFile, answer: Measured): void {
    const cells = (s: Statistics) => [h("td", null, String(s.points)), h("td", null, s.rmse.toFixed(4)), h("td", null, signed(s.bias))];
    const head = h("tr", null, ...["Band", "Points", "RMSE", "Bias"].map((title) => h("th", { scope: "col" }, title)));
    const rows = answer.bands.map((band) => h("tr", null, h("th", { scope: "row" }, `${BANDS[band.name] ?? band.name}, ${band.from_nm}–${band.to_nm} nm`), ...cells(band)));
    if (answer.overall) rows.unshift(h("tr", null, h("th", { scope: "row" }, "All"), ...cells(answer.overall)));
    this.#content.replaceChildren(
      h("p", null, h("strong", null, name), `, ${answer.quantity}.`),
      ...(notes ?? answer.notes).map((note) => h("p", { class: "muted" }, note)),
      answer.residuals.length > 0
        ? h("div", { class: "scroll" }, h("table", null, h("caption", null, `Simulated minus measured ${answer.quantity}`), h("thead", null, head), h("tbody", null, ...rows)))
        : h("p", null, "The file has no wavelength in common with the simulation. Choose other wavelengths above."),
    );
    const kept = answer.residuals.filter((r) => !r.excluded);
    this.#chart.element.hidden = kept.length < 2;
    if (kept.length >= 2) {
      const x = kept.map((r) => r.nm);
      this.#chart.set(
        [
          { name: "zero", x, y: x.map(() => 0), colour: "--muted", dash: [4, 4] },
          { name: "residual", x, y: kept.map((r) => r.residual), colour: "--measured", style: "points" },
        ],
        { x: "wavelength, nm", y: "simulated − measured" },
      );
    }
    this.answer.set(answer);
  }
}

function signed(value: number): string {
  return `${value < 0 ? "−" : "+"}${Math.abs(value).toFixed(4)}`;
}

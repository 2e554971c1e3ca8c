// Colours of a look-up, and how far it is from a simulation of the same snow.
import { h } from "../dom";
import { number } from "../draw/ticks";
import type { LookupAnswer, Spectrum } from "../messages";
import { table } from "./databases-about";
import { brightening, capital, cssColour, deltaE, rmse, rootMeanSquare } from "./databases-data";

export type Quantity = "reflectance" | "transmittance";
export const QUANTITIES: readonly Quantity[] = ["reflectance", "transmittance"];

export interface Swatch {
  name: string;
  xyz: number[];
  lab: number[];
  linear: number[];
  clipped: boolean;
}

export function swatchElement({ name, xyz, linear, lab, clipped }: Swatch): HTMLElement {
  const factor = brightening(xyz[1]!);
  const patch = h("div", { class: "patch" });
  patch.style.background = cssColour(linear);
  const patches = h("div", { class: "patches" }, patch);
  if (factor > 1) {
    const bright = h("div", { class: "patch" });
    bright.style.background = cssColour(linear, factor);
    patches.append(bright);
  }
  const beyond = linear.some((part) => part < -0.001 || factor * part > 1.001);
  const lines = [
    `Y ${number(xyz[1]!)} of white`,
    `L* ${number(lab[0]!)}, a*\u00a0${number(lab[1]!)}, b*\u00a0${number(lab[2]!)}`,
    ...(factor > 1 ? [`right: brightened ${number(factor)} times`] : []),
    ...(clipped || beyond ? ["outside sRGB: the nearest colour is shown"] : []),
  ];
  return h("figure", { class: "swatch" }, patches,
    h("figcaption", null, h("b", null, capital(name)), ...lines.map((line) => h("span", null, line))));
}

/// A table of the differences.
export function comparison(answer: LookupAnswer, together: Spectrum, swatches: Swatch[], light: string): HTMLElement[] {
  const rows: HTMLElement[] = [];
  for (const quantity of QUANTITIES) {
    const values = answer[quantity];
    if (!values) continue;
    const name = quantity === "reflectance" ? "reflected" : "transmitted";
    const [here, there] = [name, `${name}, simulated`].map((wanted) => swatches.find((s) => s.name === wanted));
    rows.push(h("tr", null,
      h("th", { scope: "row" }, capital(quantity)),
      h("td", null, here && there ? number(deltaE(here.lab, there.lab), 2) : "-"),
      h("td", null, number(rmse(values, together[quantity]), 2)),
      h("td", null, number(rootMeanSquare(together[`${quantity}_se`]), 2))));
  }
  return [
    table(`Look-up against simulation, light ${light}`, ["Quantity", "Delta-E (CIE 1976)", "RMSE", "Standard error"], rows),
    h("p", { class: "note" }, "The RMSE and the standard error (root mean square) are over the wavelengths of the file. An RMSE of the size of the standard error is the noise of this simulation."),
  ];
}

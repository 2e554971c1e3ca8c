// The curves of a chart, from spectra.
import type { Spectrum } from "./messages";

export type Quantity = "reflectance" | "transmittance" | "absorptance";
export const QUANTITIES: readonly Quantity[] = ["reflectance", "transmittance", "absorptance"];
export const NAMES: Record<Quantity, string> = { reflectance: "Reflectance", transmittance: "Transmittance", absorptance: "Absorptance" };

export interface Curve {
  name: string;
  x: readonly number[];
  y: readonly number[];
  /// Half the width of the band around a line, or half the length of the bar at a point.
  band?: readonly number[];
  /// A colour of the style sheet: `--reflectance`.
  colour: string;
  /// Lengths of dashes and gaps.
  dash?: number[];
  /// A line if left out, with dots at its values, or smooth through them; or only points.
  style?: "line" | "dots" | "smooth" | "points";
}

export const DASHES = [[8, 4], [2, 3], [10, 3, 2, 3], [4, 2]];

/// Twice the whole uncertainty: the standard error and the systematic error of the engine.
export function bandOf(spectrum: Spectrum, quantity: Quantity): number[] {
  const se = spectrum[`${quantity}_se`];
  // Absorptance is what the two others leave.
  const share = quantity === "absorptance" ? Math.SQRT2 : 1;
  return se.map((own, i) => 2 * Math.hypot(own, share * (spectrum.method_error[i] ?? 0)));
}

export function curveOf(spectrum: Spectrum, quantity: Quantity): Curve {
  return {
    name: NAMES[quantity],
    x: spectrum.wavelengths_nm,
    y: spectrum[quantity],
    band: bandOf(spectrum, quantity),
    colour: `--${quantity}`,
  };
}

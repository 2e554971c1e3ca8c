// What the panel of directions shows, from the answer of the engine.

import type { Directions, Sample } from "../messages";
import { Hemisphere } from "../draw/interpolate";
import { number, percent } from "../draw/ticks";

export const NM = { min: 350, max: 2500 } as const;

export interface Settings {
  wavelength_nm: number;
  side: "reflected" | "transmitted";
  factor: "brf" | "anisotropy";
  show: "value" | "se";
}

const START: Settings = { wavelength_nm: 550, side: "reflected", factor: "brf", show: "value" };

/** The settings that a link holds, with every one that it lacks or that makes no sense as usual. */
export function settings(stored: Readonly<Record<string, unknown>>): Settings {
  const one = <K extends keyof Settings>(key: K, allowed: readonly Settings[K][]): Settings[K] =>
    allowed.includes(stored[key] as Settings[K]) ? (stored[key] as Settings[K]) : START[key];
  const nm = stored.wavelength_nm;
  const inside = typeof nm === "number" && nm >= NM.min && nm <= NM.max;
  return {
    wavelength_nm: inside ? nm : START.wavelength_nm,
    side: one("side", ["reflected", "transmitted"]),
    factor: one("factor", ["brf", "anisotropy"]),
    show: one("show", ["value", "se"]),
  };
}

/** The angle of the beam, degrees; null under diffuse light. */
export function incidence(sample: Sample): number | null {
  return "incidence_angle_deg" in sample.illumination ? sample.illumination.incidence_angle_deg : null;
}

/** The views at which the engine measures. Under diffuse light no azimuth differs from another. */
export function nodes(sample: Sample): { view_deg: number[]; relative_azimuth_deg: number[] } {
  if (incidence(sample) === null) {
    return { view_deg: every(0, 85, 5), relative_azimuth_deg: [0] };
  }
  return { view_deg: [...every(0, 70, 10), 75, 80, 85], relative_azimuth_deg: every(0, 180, 15) };
}

function every(from: number, to: number, step: number): number[] {
  return Array.from({ length: Math.round((to - from) / step) + 1 }, (_, i) => from + i * step);
}

/** The names of the factors: short, and in full. */
export function names(diffuse: boolean, side: Settings["side"], factor: Settings["factor"]) {
  const reflected = side === "reflected";
  const short = `${diffuse ? "HD" : "B"}${reflected ? "RF" : "TF"}`;
  const kind = reflected ? "reflectance" : "transmittance";
  const full = `${diffuse ? "hemispherical-directional" : "bidirectional"} ${kind} factor`;
  if (factor === "brf") return { short, full };
  return { short: "anisotropy factor", full: `anisotropy factor (${short} over ${kind})` };
}

export interface Chosen {
  value: number[][];
  se: number[][];
  values: Hemisphere;
  errors: Hemisphere;
}

/** The quantity that the settings choose. The anisotropy factor is the factor over the sum. */
export function choose(answer: Directions, { side, factor }: Pick<Settings, "side" | "factor">): Chosen {
  const reflected = side === "reflected";
  const sum = reflected ? answer.reflectance : answer.transmittance;
  const scale = factor === "brf" ? 1 : sum > 0 ? 1 / sum : 0;
  const scaled = (rows: readonly (readonly number[])[]) => rows.map((row) => row.map((v) => v * scale));
  const value = scaled(reflected ? answer.brf : answer.btf);
  const se = scaled(reflected ? answer.brf_se : answer.btf_se);
  const { view_deg, relative_azimuth_deg } = answer;
  return {
    value,
    se,
    values: new Hemisphere(view_deg, relative_azimuth_deg, value),
    errors: new Hemisphere(view_deg, relative_azimuth_deg, se),
  };
}

/** The largest standard error in units of its value, and the direction that has it. */
export function largestRelativeError(
  answer: Directions,
  { value, se }: Pick<Chosen, "value" | "se">,
): { share: number; view: number; azimuth: number } | null {
  let worst: { share: number; view: number; azimuth: number } | null = null;
  for (const [i, view] of answer.view_deg.entries()) {
    for (const [j, azimuth] of answer.relative_azimuth_deg.entries()) {
      const share = se[i]![j]! / value[i]![j]!;
      if (value[i]![j]! > 0 && (!worst || share > worst.share)) worst = { share, view, azimuth };
    }
  }
  return worst;
}

/**
 * The principal plane as a curve: negative angles look back toward the light, positive ones
 * forward. Under diffuse light it begins at the normal.
 */
export function principalPlane(
  answer: Pick<Directions, "view_deg" | "relative_azimuth_deg">,
  rows: readonly (readonly number[])[],
): { x: number[]; y: number[] } {
  const forward = answer.relative_azimuth_deg.indexOf(0);
  const back = answer.relative_azimuth_deg.indexOf(180);
  const x: number[] = [];
  const y: number[] = [];
  if (back >= 0) {
    for (let i = answer.view_deg.length - 1; i >= 0; i--) {
      if (answer.view_deg[i] === 0) continue;
      x.push(-answer.view_deg[i]!);
      y.push(rows[i]![back]!);
    }
  }
  for (const [i, view] of answer.view_deg.entries()) {
    x.push(view);
    // All azimuths are one direction at the normal.
    const row = rows[i]!;
    y.push(view === 0 ? row.reduce((sum, v) => sum + v, 0) / row.length : row[forward]!);
  }
  return { x, y };
}

/** Range of the colours of a quantity, rounded outward a little so that it is easy to read. */
export function colourRange(rows: readonly (readonly number[])[], fromZero: boolean): [number, number] {
  const all = rows.flat().filter(Number.isFinite);
  let [low, high] = [Math.min(...all), Math.max(...all)];
  if (!all.length) return [0, 1];
  if (fromZero) low = 0;
  if (!(high > low)) return [low, low + (Math.abs(low) * 0.1 || 1)];
  const step = 10 ** Math.floor(Math.log10(high - low)) / 10;
  low = Math.floor(low / step + 1e-9) * step;
  high = Math.ceil(high / step - 1e-9) * step;
  return [Number(low.toPrecision(12)), Number(high.toPrecision(12))];
}

/** What the panel says about a direction. */
export function readout(
  name: string,
  { values, errors }: Pick<Chosen, "values" | "errors">,
  view: number,
  azimuth: number | null,
): string {
  const where =
    azimuth === null
      ? `View ${number(view)}\u00b0`
      : `View ${number(view)}\u00b0, relative azimuth ${number(azimuth)}\u00b0`;
  if (view > values.edge) return `${where}: beyond the last view, ${number(values.edge)}\u00b0`;
  const value = values.at(view, azimuth ?? 0);
  const se = errors.at(view, azimuth ?? 0);
  const relative = value > 0 ? ` (${percent(se / value)})` : "";
  return `${where}: ${name} ${number(value, 4)}, standard error ${number(se, 2)}${relative}`;
}

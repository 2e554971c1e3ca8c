// What the panel of databases shows, from the metadata of a compact file.

import type { CompactFile } from "../messages";
import { grouped, number } from "../draw/ticks";

export interface Axis {
  name: string;
  unit: string;
  values: number[];
}

const NAMES: Record<string, string> = {
  view_deg: "View angle",
  relative_azimuth_deg: "Relative azimuth",
  black_carbon_ng_g: "Black carbon",
  brown_carbon_ng_g: "Brown carbon",
  absorber_ug_g: "Absorber",
  water_saturation: "Water saturation",
  temperature_c: "Temperature",
  sphericity: "Sphericity",
  substrate_reflectance: "Substrate reflectance",
  facetness: "Facetness",
  grain_size_um: "Grain size",
  density_kg_m3: "Density",
  thickness_cm: "Thickness",
  angle_deg: "Incidence angle",
  incidence_angle_deg: "Incidence angle",
};

/** The name of an axis in words; what is not known is shown as it is. */
export function axisName(name: string): string {
  return NAMES[name] ?? name;
}

const UNITS: Record<string, string> = {
  "1": "1",
  um: "\u00b5m",
  degree: "\u00b0",
  "kg/m3": "kg/m\u00b3",
  "kg m-3": "kg/m\u00b3",
  "ng g-1": "ng/g",
  "ug g-1": "\u00b5g/g",
  degC: "\u00b0C",
};

export function unitText(unit: string): string {
  return UNITS[unit] ?? unit;
}

/// A slab of this thickness, cm, stands for a half space.
const HALF_SPACE_CM = 1e6;

/** A value with its unit. Pure numbers have none. */
export function valueText(axis: Pick<Axis, "name" | "unit">, value: number): string {
  if (axis.name === "thickness_cm" && value >= HALF_SPACE_CM) return "half space";
  const unit = unitText(axis.unit);
  if (unit === "1") return number(value, 4);
  return `${number(value, 4)}${unit === "\u00b0" ? "" : "\u00a0"}${unit}`;
}

/// Where a value stands on its slider: axes with large ratios move by ratios, as look-ups do.
function scale(name: string): [(x: number) => number, (u: number) => number] {
  switch (name) {
    case "grain_size_um":
    case "density_kg_m3":
    case "sphericity":
      return [Math.log, Math.exp];
    case "thickness_cm":
      return [(x) => Math.log(1 + x / 0.5), (u) => 0.5 * (Math.exp(u) - 1)];
    case "black_carbon_ng_g":
    case "brown_carbon_ng_g":
      return [(x) => Math.sqrt(x + 20), (u) => u * u - 20];
    case "absorber_ug_g":
      return [(x) => Math.sqrt(x + 10), (u) => u * u - 10];
    default:
      return [(x) => x, (u) => u];
  }
}

/** Share from 0 to 1 along the slider of an axis at which a value lies. */
export function toShare(axis: Pick<Axis, "name" | "values">, value: number): number {
  const [to] = scale(axis.name);
  const [low, high] = [to(axis.values[0]!), to(axis.values.at(-1)!)];
  const share = (to(value) - low) / (high - low);
  return Number.isFinite(share) ? Math.min(1, Math.max(0, share)) : 0;
}

/// A slider this near to a node stands on it.
const SNAP = 0.006;

/** The value at a share of the slider: the node if one is near, else rounded to four digits. */
export function fromShare(axis: Pick<Axis, "name" | "values">, share: number): number {
  for (const node of axis.values) {
    if (Math.abs(toShare(axis, node) - share) < SNAP) return node;
  }
  const [to, back] = scale(axis.name);
  const [low, high] = [to(axis.values[0]!), to(axis.values.at(-1)!)];
  const value = Number(back(low + share * (high - low)).toPrecision(4));
  return Math.min(axis.values.at(-1)!, Math.max(axis.values[0]!, value));
}

/** Shares of the slider at which the nodes lie. */
export function axisTicks(axis: Pick<Axis, "name" | "values">): number[] {
  return axis.values.map((node) => toShare(axis, node));
}

/** Where a value lies among the nodes, in words. */
export function amongNodes(axis: Axis, value: number): string {
  if (axis.values.includes(value)) return "on a node";
  const last = axis.values.at(-1)!;
  if (value < axis.values[0]!) return `below the first node, ${valueText(axis, axis.values[0]!)}`;
  if (value > last) return `beyond the last node, ${valueText(axis, last)}`;
  const above = axis.values.findIndex((node) => node > value);
  return `between ${valueText(axis, axis.values[above - 1]!)} and ${valueText(axis, axis.values[above]!)}`;
}

/** Where the sliders stand at first: on the middle nodes, angles on the first, or where `wished` says. */
export function startPoint(
  axes: readonly Axis[],
  wished: Readonly<Record<string, unknown>> = {},
): Record<string, number> {
  return Object.fromEntries(
    axes.map(({ name, values }) => {
      const wish = wished[name];
      const inside = typeof wish === "number" && wish >= values[0]! && wish <= values.at(-1)!;
      return [name, inside ? wish : values[name.endsWith("_deg") ? 0 : (values.length - 1) >> 1]!];
    }),
  );
}

// ---- metadata, which anyone may have written

function json(text: string | undefined): Record<string, unknown> | null {
  if (text === undefined) return null;
  try {
    const value: unknown = JSON.parse(text);
    return isObject(value) ? value : null;
  } catch {
    return null;
  }
}

function isObject(value: unknown): value is Record<string, unknown> {
  return typeof value === "object" && value !== null && !Array.isArray(value);
}

/// [mean, 95th percentile, maximum]
type Triple = [number, number, number];

function triple(value: unknown): Triple | null {
  if (!Array.isArray(value) || value.length !== 3) return null;
  return value.every((part) => typeof part === "number" && Number.isFinite(part)) ? (value as Triple) : null;
}

export interface Errors {
  delta_e: Triple | null;
  rmse: Triple | null;
}

export interface CertifiedQuantity {
  quantity: string;
  total: Errors;
  /// What the total consists of, with what each part means.
  parts: ({ name: string; meaning: string } & Errors)[];
  worst: { at: string; delta_e: number | null; rmse: number | null }[];
}

export interface Certificate {
  points: number | null;
  rays: number | null;
  seed: number | null;
  quantities: CertifiedQuantity[];
}

const PARTS: [string, string, string][] = [
  ["compression", "Compression", "fewer numbers than the spectra that the file was made from"],
  ["interpolation", "Interpolation", "look-ups between the nodes, with the noise of the nodes"],
  ["simulation", "Simulation", "the same on the nodes: their noise alone"],
  ["wavelengths", "Wavelengths", "straight lines between the wavelengths that the file keeps"],
  ["noise", "Noise of the check", "one standard error of the fresh simulations"],
];

/** The certificate of a file: how far its answers are from fresh simulations. Null without one. */
export function certificate(metadata: Readonly<Record<string, string>>): Certificate | null {
  const found = json(metadata.certificate ?? metadata.error_budget);
  if (!found || !isObject(found.quantities)) return null;
  const errors = (value: unknown): Errors | null => {
    if (!isObject(value)) return null;
    const [delta_e, rmse] = [triple(value.delta_e), triple(value.rmse)];
    return delta_e || rmse ? { delta_e, rmse } : null;
  };
  const quantities: CertifiedQuantity[] = [];
  for (const [quantity, content] of Object.entries(found.quantities)) {
    if (!isObject(content)) continue;
    const total = errors(content.total);
    if (!total) continue;
    const parts: CertifiedQuantity["parts"] = [];
    for (const [key, name, meaning] of PARTS) {
      const part = errors(content[key]);
      if (part) parts.push({ name, meaning, ...part });
    }
    for (const [axis, value] of Object.entries(isObject(content.axes) ? content.axes : {})) {
      const part = errors(value);
      if (part) parts.push({ name: `Off the nodes: ${axisName(axis).toLowerCase()}`, meaning: "in this axis alone", ...part });
    }
    const worst = (Array.isArray(content.worst) ? content.worst : []).filter(isObject).map((point) => ({
      at: String(point.at),
      delta_e: finite(point.delta_e),
      rmse: finite(point.rmse),
    }));
    quantities.push({ quantity, total, parts, worst });
  }
  if (!quantities.length) return null;
  return { points: finite(found.points), rays: finite(found.rays), seed: finite(found.seed), quantities };
}

function finite(value: unknown): number | null {
  return typeof value === "number" && Number.isFinite(value) ? value : null;
}

/** The total of one quantity in plain words. */
export function certificateWords({ quantity, total }: Pick<CertifiedQuantity, "quantity" | "total">): string[] {
  const list: string[] = [];
  const say = ([mean, most, largest]: Triple) =>
    `${number(mean, 2)} on average, at most ${number(most, 2)} at 95 % of the points, ${number(largest, 2)} at worst`;
  if (total.delta_e) list.push(`${capital(quantity)}, colour: Delta-E ${say(total.delta_e)}.`);
  if (total.rmse) list.push(`${capital(quantity)}, spectrum: RMSE ${say(total.rmse)}.`);
  return list;
}

/** How the certificate came about. */
export function certificateSource({ points, rays, seed }: Certificate): string {
  const many = points === null ? "fresh simulations" : `${grouped(points)} fresh simulations at random points`;
  const walks = rays === null ? "" : `, ${grouped(rays)} walks each`;
  return `The answers of the file were compared with ${many}${walks}${seed === null ? "" : `, seed ${seed}`}.`;
}

/** The bounds that the file was made to keep, in words; empty without any. */
export function boundsWords(metadata: Readonly<Record<string, string>>): string[] {
  const list: string[] = [];
  for (const [quantity, bound] of Object.entries(json(metadata.bounds) ?? {})) {
    if (!isObject(bound)) continue;
    const kept = [];
    const [delta_e, rmse] = [finite(bound.max_delta_e), finite(bound.max_rmse)];
    if (delta_e !== null) kept.push(`Delta-E ${number(delta_e)}`);
    if (rmse !== null) kept.push(`RMSE ${number(rmse)}`);
    if (kept.length) list.push(`${capital(quantity)}: on every node, compression stays below ${kept.join(" and ")}.`);
  }
  return list;
}

export interface ErrorRow {
  quantity: string;
  components: number;
  chosen: boolean;
  delta_e: { mean: number; max: number } | null;
  rmse: { mean: number; max: number } | null;
}

/** The rows of the error table. */
export function errorTable(metadata: Readonly<Record<string, string>>): ErrorRow[] {
  const rows: ErrorRow[] = [];
  for (const [quantity, table] of Object.entries(json(metadata.error_table) ?? {})) {
    if (!isObject(table) || !Array.isArray(table.rows)) continue;
    for (const row of table.rows.filter(isObject)) {
      const components = finite(row.components);
      if (components === null) continue;
      const errors = (value: unknown) => {
        if (!isObject(value)) return null;
        const [mean, max] = [finite(value.mean), finite(value.max)];
        return mean === null || max === null ? null : { mean, max };
      };
      rows.push({
        quantity, components, chosen: components === table.chosen,
        delta_e: errors(row.delta_e), rmse: errors(row.rmse),
      });
    }
  }
  return rows;
}

/** The provenance as names and texts, nested keys joined by dots. */
export function provenance(metadata: Readonly<Record<string, string>>): [string, string][] {
  const list: [string, string][] = [];
  const walk = (value: unknown, name: string, depth: number) => {
    if (isObject(value) && depth < 4) {
      for (const [key, inner] of Object.entries(value)) walk(inner, name ? `${name}.${key}` : key, depth + 1);
    } else {
      const text = typeof value === "string" ? value : JSON.stringify(value);
      list.push([name, text.length > 400 ? `${text.slice(0, 400)} ...` : text]);
    }
  };
  const found = json(metadata.provenance);
  if (found) walk(found, "", 0);
  else if (metadata.provenance) list.push(["provenance", metadata.provenance.slice(0, 400)]);
  return list;
}

/** Number of curves, bytes that its spectra would take as float32, and bytes of its metadata. */
export function size(file: Pick<CompactFile, "axes" | "wavelengths_nm" | "quantities" | "metadata">): {
  curves: number;
  spectraBytes: number;
  metadataBytes: number;
} {
  const curves = file.axes.reduce((product, axis) => product * axis.values.length, 1);
  const text = Object.entries(file.metadata).flat().join("");
  return {
    curves,
    spectraBytes: 4 * curves * file.wavelengths_nm.length * file.quantities.length,
    metadataBytes: new TextEncoder().encode(text).length,
  };
}

/** Whether the file holds anisotropy factors, not shares of light. */
export function holdsFactors(metadata: Readonly<Record<string, string>>): boolean {
  return metadata.content === "anisotropy_factor";
}

/** The name of a quantity of the file. */
export function quantityName(metadata: Readonly<Record<string, string>>, name: string): string {
  if (!holdsFactors(metadata)) return capital(name);
  return `Anisotropy factor of ${name === "reflectance" ? "reflected" : "transmitted"} light`;
}

// ---- comparing

/** Root mean square of the differences. */
export function rmse(a: readonly number[], b: readonly number[]): number {
  const sum = a.reduce((total, value, i) => total + (value - b[i]!) ** 2, 0);
  return Math.sqrt(sum / a.length);
}

/** Root mean square of the values. */
export function rootMeanSquare(values: readonly number[]): number {
  return Math.sqrt(values.reduce((total, value) => total + value * value, 0) / values.length);
}

/** Distance of two colours in CIELAB: Delta-E of CIE 1976. */
export function deltaE(a: readonly number[], b: readonly number[]): number {
  return Math.hypot(a[0]! - b[0]!, a[1]! - b[1]!, a[2]! - b[2]!);
}

/**
 * The factor, with two digits, that brings a dark colour to the luminance 0.3 of white; 1 where
 * it is bright enough.
 */
export function brightening(luminance: number): number {
  if (!(luminance > 0) || luminance >= 0.15) return 1;
  return Number((0.3 / luminance).toPrecision(2));
}

/** A linear sRGB colour times `factor` as CSS. */
export function cssColour(linear: readonly number[], factor = 1): string {
  const encoded = linear.map((part) => {
    const v = Math.min(1, Math.max(0, factor * part));
    return Math.round(255 * (v <= 0.0031308 ? 12.92 * v : 1.055 * v ** (1 / 2.4) - 0.055));
  });
  return `rgb(${encoded.join(" ")})`;
}

export function capital(text: string): string {
  return text.charAt(0).toUpperCase() + text.slice(1);
}

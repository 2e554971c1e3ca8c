// Changes of a sample. None edits in place.
import type { Absorber, Files, Grain, Layer, Law, Sample } from "../messages";

export const MOST_LAYERS = 12;
export const MOST_GRAINS = 3;
export const MOST_ABSORBERS = 8;

/// What the engine takes where a key is left out (MODEL: the representative sample).
export const DEFAULTS = {
  temperature_c: -1,
  water: 0,
  sphericity: { min: 0.6, max: 0.95, mean: 0.798, sd: 0.064 } satisfies Law,
  aspect_ratio: { min: 0.5, max: 2, mean: 1, sd: 0.3 } satisfies Law,
  sedimentation: 1,
  mass_absorption_efficiency_m2_g: 16.619,
  reference_wavelength_nm: 880,
};

export function withLayer(sample: Sample, index: number, change: (layer: Layer) => Layer): Sample {
  return { ...sample, layer: sample.layer.map((layer, i) => (i === index ? change(layer) : layer)) };
}

export function withGrain(sample: Sample, layer: number, grain: number, change: (grain: Grain) => Grain): Sample {
  return withLayer(sample, layer, (l) => ({ ...l, grain: l.grain.map((g, i) => (i === grain ? change(g) : g)) }));
}

/// A copy without some keys.
export function without<T extends object>(object: T, ...keys: (keyof T)[]): T {
  const copy = { ...object };
  for (const key of keys) delete copy[key];
  return copy;
}

/// Moves a layer. A half space can only be the base: one that leaves it becomes a metre of snow.
export function moveLayer(sample: Sample, from: number, to: number): Sample {
  const layer = [...sample.layer];
  const [moved] = layer.splice(from, 1);
  layer.splice(to, 0, moved!);
  return { ...sample, layer: layer.map((l, i) => (i > 0 && l.thickness_cm === "inf" ? { ...l, thickness_cm: 100 } : l)) };
}

export function newLayer(): Layer {
  return {
    thickness_cm: 5,
    density_kg_m3: 150,
    temperature_c: -1,
    grain: [{ size_um: { min: 100, max: 300 }, facetness: { min: 0.4, max: 0.6, mean: 0.5, sd: 0.072 } }],
  };
}

/// Moves the mean of a law and its limits with it; the limits are cut at `low` and `high`.
export function moveMean(law: Law, mean: number, low: number, high: number, spread: number): Law {
  const cut = (value: number) => round(Math.min(high, Math.max(low, value)));
  // A law that was cut at an end gets its width back when it leaves it.
  const below = Math.max(law.mean - law.min, law.min <= low ? spread : 0);
  const above = Math.max(law.max - law.mean, law.max >= high ? spread : 0);
  return { ...law, mean, min: cut(mean - below), max: cut(mean + above) };
}

/// Sets one share of several that sum to 1, and scales the others.
export function shareOut(shares: number[], index: number, value: number): number[] {
  const share = Math.min(1, Math.max(0, value));
  const others = shares.reduce((sum, s, i) => (i === index ? sum : sum + s), 0);
  const scaled = shares.map((s, i) => {
    if (i === index) return round(share);
    return round(others > 0 ? (s / others) * (1 - share) : (1 - share) / (shares.length - 1));
  });
  // What rounding left over goes to the last of the others.
  const last = index === shares.length - 1 ? shares.length - 2 : shares.length - 1;
  if (last >= 0) scaled[last] = round(1 - scaled.reduce((sum, s, i) => (i === last ? sum : sum + s), 0));
  return scaled;
}

export function shares(layer: Layer): number[] {
  return layer.grain.map((grain) => grain.fraction ?? 1 / layer.grain.length);
}

export function withShares(layer: Layer, fractions: number[]): Layer {
  if (layer.grain.length === 1) return { ...layer, grain: [without(layer.grain[0]!, "fraction")] };
  return { ...layer, grain: layer.grain.map((grain, i) => ({ ...grain, fraction: fractions[i]! })) };
}

export function addGrain(layer: Layer): Layer {
  const n = layer.grain.length;
  const last = layer.grain[n - 1]!;
  const old = shares(layer);
  const grown = { ...layer, grain: [...layer.grain, structuredClone(last)] };
  return withShares(grown, shareOut([...old, 0], n, 1 / (n + 1)));
}

export function removeGrain(layer: Layer, index: number): Layer {
  const old = shares(layer).filter((_, i) => i !== index);
  const sum = old.reduce((a, b) => a + b, 0);
  const left = { ...layer, grain: layer.grain.filter((_, i) => i !== index) };
  const first = sum > 0 ? old[0]! / sum : 1 / old.length;
  const scaled = old.map((s) => (sum > 0 ? s / sum : 1 / old.length));
  return withShares(left, old.length > 1 ? shareOut(scaled, 0, first) : [1]);
}

export type SizeKind = "size_um" | "ssa_m2_kg" | "optical_radius_um";

export function sizeKind(grain: Grain): SizeKind {
  if (grain.size_um) return "size_um";
  return grain.ssa_m2_kg !== undefined ? "ssa_m2_kg" : "optical_radius_um";
}

/// Gives the size another way. `measured` is what the layer has now, so that the snow stays
/// about the same.
export function withSizeKind(grain: Grain, kind: SizeKind, measured: { ssa_m2_kg: number; optical_radius_um: number } | undefined): Grain {
  const bare = without(grain, "size_um", "ssa_m2_kg", "optical_radius_um");
  if (kind === "size_um") {
    const length = Math.max(20, Math.round((measured?.optical_radius_um ?? 150) * 3));
    return { ...bare, size_um: { min: Math.max(10, Math.round(length * 0.8)), max: Math.round(length * 1.2) } };
  }
  const value = measured?.[kind] ?? (kind === "ssa_m2_kg" ? 20 : 150);
  return { ...bare, [kind]: Number(value.toPrecision(3)) };
}

/// Six digits are enough for a share, and keep 0.1 + 0.2 out of files.
export function round(value: number): number {
  return Math.round(value * 1e6) / 1e6;
}

export function withAbsorber(sample: Sample, layer: number, absorber: number, change: (absorber: Absorber) => Absorber): Sample {
  return withLayer(sample, layer, (l) => ({ ...l, absorber: (l.absorber ?? []).map((a, i) => (i === absorber ? change(a) : a)) }));
}

export function addAbsorber(layer: Layer): Layer {
  return { ...layer, absorber: [...(layer.absorber ?? []), { species: "dust_libya", concentration_ug_g: 10, phase: "pores" }] };
}

export function removeAbsorber(layer: Layer, index: number): Layer {
  const left = (layer.absorber ?? []).filter((_, i) => i !== index);
  return left.length > 0 ? { ...layer, absorber: left } : without(layer, "absorber");
}

/// What an absorber is: one of the species, or a law or table of its own.
export type Substance = { species: string } | "law" | "file" | "list";

export function substance(absorber: Absorber): Substance {
  if (absorber.species !== undefined) return { species: absorber.species };
  if (absorber.file !== undefined) return "file";
  return Array.isArray(absorber.mass_absorption_efficiency_m2_g) ? "list" : "law";
}

/// The absorber with another species, file or power law, and with its mass.
export function withSubstance(absorber: Absorber, next: { species: string } | { file: string } | "law"): Absorber {
  const bare = without(absorber, "name", "species", "file", "mass_absorption_efficiency_m2_g", "reference_wavelength_nm", "angstrom_exponent");
  if (next !== "law") return { ...bare, ...next };
  return { ...bare, mass_absorption_efficiency_m2_g: 0.1, reference_wavelength_nm: 400, angstrom_exponent: 3 };
}

/// The files that the sample names.
export function usedFiles(sample: Sample, files: Files): Files {
  const named = sample.layer.flatMap((layer) => (layer.absorber ?? []).map((absorber) => absorber.file));
  const used = new Set([sample.substrate?.reflectance, ...named]);
  return Object.fromEntries(Object.entries(files).filter(([name]) => used.has(name)));
}

/// A name for a file beside the others, such as "dust 2.csv": a name stands for one text.
export function freeName(name: string, content: string, files: Files): string {
  const [, stem = "", ending = ""] = /^(.*?)(\.[^.]*)?$/s.exec(name)!;
  let free = name;
  for (let n = 2; files[free] !== undefined && files[free] !== content; n++) free = `${stem} ${n}${ending}`;
  return free;
}

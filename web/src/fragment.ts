// The state as the fragment of a link, and back.
//
// `#z=` holds JSON, deflated, in base64url; `#j=` the same without compression. Only what
// differs from the initial state is written. A link may come from anybody: what does not have
// the right shape is left out, and the engine checks the numbers.
import { base64, concatenate } from "./bytes";
import { PANELS, type State } from "./page";
import type { Sample } from "./messages";
import { droppedName, initialState } from "./state";

/// A fragment that unpacks to more than this is not read, bytes.
export const MOST_BYTES = 4_000_000;
/// Longer fragments are not written: browsers cut addresses of 2 million characters.
export const MOST_CHARACTERS = 1_000_000;
/// What a link does without if it would be too long, in this order.
const OPTIONAL = ["measured", "held", "files"] as const;

/// A fragment that `fromFragment` reads, and the keys of the state that did not fit.
export async function toLink(state: State): Promise<{ fragment: string; omitted: (typeof OPTIONAL)[number][] }> {
  const initial = initialState();
  for (let n = 0; n <= OPTIONAL.length; n++) {
    const omitted = OPTIONAL.slice(0, n);
    const rest = { ...state, ...Object.fromEntries(omitted.map((key) => [key, initial[key]])) };
    const fragment = await toFragment(rest);
    if (fragment !== null) return { fragment, omitted: omitted.filter((key) => JSON.stringify(state[key]) !== JSON.stringify(initial[key])) };
  }
  return { fragment: "", omitted: [...OPTIONAL] };
}

/// Null if the fragment would be too long to be read again.
async function toFragment(state: State): Promise<string | null> {
  const initial = initialState();
  const entries = Object.entries(state).filter(
    ([key, value]) => JSON.stringify(value) !== JSON.stringify(initial[key as keyof State]),
  );
  if (entries.length === 0) return "";
  const bytes = new TextEncoder().encode(JSON.stringify(Object.fromEntries(entries)));
  if (bytes.length > MOST_BYTES) return null;
  const fragment = await packed(bytes);
  return fragment.length > MOST_CHARACTERS ? null : fragment;
}

async function packed(bytes: Uint8Array): Promise<string> {
  if (typeof CompressionStream === "undefined") return `#j=${base64url(bytes)}`;
  return `#z=${base64url(await through(bytes, new CompressionStream("deflate-raw"), Infinity))}`;
}

/// Null if there is no state in the fragment; throws if it cannot be read.
export async function fromFragment(fragment: string): Promise<State | null> {
  const found = /^#?([zj])=([A-Za-z0-9_-]+)$/.exec(fragment);
  if (!found) {
    if (fragment.length > 1) throw new Error("The link is damaged: it does not hold a state.");
    return null;
  }
  try {
    let bytes = fromBase64url(found[2]!);
    if (found[1] === "z") bytes = await through(bytes, new DecompressionStream("deflate-raw"), MOST_BYTES);
    return accept(JSON.parse(new TextDecoder().decode(bytes)));
  } catch {
    throw new Error("The link is damaged: its state cannot be read.");
  }
}

/// The initial state with what is sound in `given`.
export function accept(given: unknown): State {
  const state = initialState();
  if (!isRecord(given)) return state;
  const take = <K extends keyof State>(key: K, sound: (value: unknown) => boolean) => {
    if (key in given && sound(given[key])) state[key] = given[key] as State[K];
  };
  take("sample", isSample);
  take("files", isFiles);
  take("panel", oneOf(PANELS));
  take("layer", (value) => Number.isInteger(value) && Number(value) >= 0);
  take("range", oneOf(["visible", "full", "sample"]));
  take("scale", oneOf(["linear", "log"]));
  take("shown", (value) => isRecord(value) && ["reflectance", "transmittance", "absorptance"].every((k) => typeof value[k] === "boolean"));
  take("held", (value) => Array.isArray(value) && value.length <= 8 && value.every(isHeld));
  take("measured", (value) => isRecord(value) && isText(value.name) && isText(value.text) && optional(value, ["notes"], (notes) => Array.isArray(notes) && notes.every(isText)));
  take("light", isText);
  take("droppedLight", (value) => isRecord(value) && isText(value.name) && isNumbers(value.wavelengths_nm) && isNumbers(value.power));
  take("exposure_stops", (value) => isNumber(value) && Math.abs(value as number) <= 20);
  take("seed", (value) => Number.isSafeInteger(value) && Number(value) >= 0);
  take("directions", isRecord);
  take("databases", isRecord);
  if (state.droppedLight) {
    const { name } = state.droppedLight;
    state.droppedLight = { ...state.droppedLight, name: droppedName(name) };
    if (state.light === name) state.light = droppedName(name);
  }
  state.layer = Math.min(state.layer, state.sample.layer.length - 1);
  return state;
}

const isRecord = (value: unknown): value is Record<string, unknown> =>
  typeof value === "object" && value !== null && !Array.isArray(value);
const isText = (value: unknown): value is string => typeof value === "string";
const isNumber = (value: unknown): value is number => typeof value === "number" && Number.isFinite(value);
const isFiles = (value: unknown) => isRecord(value) && Object.values(value).every(isText);
const isNumbers = (value: unknown) => Array.isArray(value) && value.length <= 10_000 && value.every(isNumber);

function oneOf(names: readonly string[]) {
  return (value: unknown) => isText(value) && names.includes(value);
}

function isHeld(value: unknown): boolean {
  return isRecord(value) && isText(value.name) && isSample(value.sample) && isFiles(value.files) && isNumber(value.rays);
}

/// Whether the page can show this sample. The engine says whether it is a good one.
export function isSample(value: unknown): value is Sample {
  return (
    isRecord(value) &&
    value.version === 1 &&
    isIllumination(value.illumination) &&
    isWavelengths(value.wavelengths) &&
    Array.isArray(value.layer) &&
    value.layer.length >= 1 &&
    value.layer.length <= 100 &&
    value.layer.every(isLayer) &&
    (value.substrate === undefined || isSubstrate(value.substrate)) &&
    (value.model === undefined || isRecord(value.model))
  );
}

/// Whether each of `keys` is there and has a value that is sound.
const all = (record: Record<string, unknown>, keys: readonly string[], sound: (value: unknown) => boolean) => keys.every((key) => sound(record[key]));
/// Whether each of `keys` is left out or has a value that is sound.
const optional = (record: Record<string, unknown>, keys: readonly string[], sound: (value: unknown) => boolean) =>
  keys.every((key) => record[key] === undefined || sound(record[key]));

function isIllumination(value: unknown): boolean {
  if (!isRecord(value)) return false;
  return "diffuse" in value ? value.diffuse === true && value.incidence_angle_deg === undefined : isNumber(value.incidence_angle_deg);
}

function isWavelengths(value: unknown): boolean {
  return isRecord(value) && optional(value, ["start_nm", "stop_nm", "step_nm"], isNumber) && optional(value, ["values_nm"], isNumbers);
}

function isSubstrate(value: unknown): boolean {
  if (!isRecord(value)) return false;
  return isNumber(value.reflectance) || isNumbers(value.reflectance) || isText(value.reflectance);
}

function isLayer(value: unknown): boolean {
  return (
    isRecord(value) &&
    (isNumber(value.thickness_cm) || value.thickness_cm === "inf") &&
    (value.density_kg_m3 !== undefined || value.wet_density_kg_m3 !== undefined) &&
    optional(value, ["density_kg_m3", "wet_density_kg_m3", "temperature_c", "water_saturation", "water_fraction"], isNumber) &&
    Array.isArray(value.grain) &&
    value.grain.length >= 1 &&
    value.grain.length <= 100 &&
    value.grain.every(isGrain) &&
    optional(value, ["black_carbon", "brown_carbon"], isCarbon) &&
    optional(value, ["absorber"], (list) => Array.isArray(list) && list.length <= 100 && list.every(isAbsorber))
  );
}

function isAbsorber(value: unknown): boolean {
  return (
    isRecord(value) &&
    optional(value, ["name", "concentration_per", "phase", "species", "file"], isText) &&
    optional(value, ["concentration_ng_g", "concentration_ug_g", "sedimentation", "reference_wavelength_nm", "angstrom_exponent"], isNumber) &&
    optional(value, ["mass_absorption_efficiency_m2_g"], (given) => isNumber(given) || isNumbers(given))
  );
}

function isCarbon(value: unknown): boolean {
  if (!isRecord(value) || !isNumber(value.concentration_ng_g)) return false;
  return Object.entries(value).every(([key, part]) => (key === "concentration_per" ? isText(part) : isNumber(part)));
}

function isGrain(value: unknown): boolean {
  return (
    isRecord(value) &&
    isLaw(value.facetness) &&
    ["size_um", "optical_radius_um", "ssa_m2_kg"].some((key) => value[key] !== undefined) &&
    optional(value, ["size_um"], (size) => isRecord(size) && all(size, ["min", "max"], isNumber)) &&
    optional(value, ["optical_radius_um", "ssa_m2_kg", "fraction"], isNumber) &&
    optional(value, ["shape"], isText) &&
    optional(value, ["sphericity", "aspect_ratio"], isLaw)
  );
}

function isLaw(value: unknown): boolean {
  return isRecord(value) && all(value, ["min", "max", "mean", "sd"], isNumber);
}

async function through(bytes: Uint8Array, stream: CompressionStream | DecompressionStream, most: number): Promise<Uint8Array> {
  const writer = stream.writable.getWriter();
  const written = writer.write(bytes as Uint8Array<ArrayBuffer>).then(() => writer.close());
  written.catch(() => undefined);
  const parts: Uint8Array[] = [];
  let length = 0;
  const reader = stream.readable.getReader();
  for (;;) {
    const { value, done } = await reader.read();
    if (done) break;
    length += value.length;
    if (length > most) {
      await reader.cancel();
      throw new Error("too long");
    }
    parts.push(value);
  }
  await written;
  return concatenate(parts);
}

function base64url(bytes: Uint8Array): string {
  return base64(bytes).replaceAll("+", "-").replaceAll("/", "_").replaceAll("=", "");
}

function fromBase64url(text: string): Uint8Array {
  return Uint8Array.from(atob(text.replaceAll("-", "+").replaceAll("_", "/")), (c) => c.charCodeAt(0));
}

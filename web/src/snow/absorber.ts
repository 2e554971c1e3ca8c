// The controls of one light-absorbing substance of a layer.
import { choice, slider, text, type Control } from "../controls";
import { fileDrop, h } from "../dom";
import type { Absorber } from "../messages";
import { namedMessage, type Page } from "../page";
import { addAbsorber, DEFAULTS, freeName, MOST_ABSORBERS, removeAbsorber, substance, usedFiles, withAbsorber, withLayer, without, withSubstance } from "./edit";
import { help, limits, names } from "./schema";

const PATH = "layer.absorber";
const MOST_FILE_BYTES = 200_000;
const HEADER = "wavelength_nm,mac_m2_g";
const LAW = "the law";
const FILE = "the file";
const LIST = "the list";

/// A species in words: `dust_saudi_arabia` is "Dust, Saudi Arabia".
export function speciesName(species: string): string {
  const capital = (word: string) => word.charAt(0).toUpperCase() + word.slice(1);
  const words = species.split("_");
  return words[0] === "dust" ? `Dust, ${words.slice(1).map(capital).join(" ")}` : capital(words.join(" "));
}

/// "20 µg/g dust, Libya", for the stack.
export function absorberText(absorber: Absorber): string {
  const name = absorber.name ?? absorber.file ?? (absorber.species ? speciesName(absorber.species) : "absorber");
  return `${text(amount(absorber))} ${unitOf(absorber)} ${name.replace(/^Dust/, "dust")}`;
}

/// Its mass in units of 1e-6 of the mass of snow.
export function microgramsPerGram(absorber: Absorber): number {
  return absorber.concentration_ug_g ?? (absorber.concentration_ng_g ?? 0) / 1000;
}

const massKey = (absorber: Absorber) => (absorber.concentration_ng_g === undefined ? "concentration_ug_g" : "concentration_ng_g");
const amount = (absorber: Absorber) => absorber[massKey(absorber)] ?? 0;
const unitOf = (absorber: Absorber) => (massKey(absorber) === "concentration_ng_g" ? "ng/g" : "µg/g");

/// What decides which controls an absorber has.
export function absorberOutline(absorber: Absorber): unknown {
  return [substance(absorber), absorber.file, massKey(absorber), absorber.sedimentation === undefined];
}

export function absorberControls(page: Page, layer: number, index: number): Control {
  const at = `layer[${layer}].absorber[${index}]`;
  const absorber = (): Absorber => page.state.get().sample.layer[layer]!.absorber![index]!;
  const set = (change: (a: Absorber) => Absorber, merge: string) => {
    const { sample: before, files } = page.state.get();
    const sample = withAbsorber(before, layer, index, change);
    page.state.set({ sample, files: usedFiles(sample, files) }, `${at}.${merge}`);
  };
  const kind = substance(absorber());
  const fieldset = h("fieldset", { class: "grain", "data-key": at });
  const what = choice({
    label: "Substance",
    help: help(PATH),
    key: `${at}.species`,
    choices: [
      ...names(`${PATH}.species`).map((name) => [name, speciesName(name)] as const),
      [LAW, "a power law…"],
      ...(kind === "file" ? [[FILE, "a table"] as const] : []),
      ...(kind === "list" ? [[LIST, "a list of numbers"] as const] : []),
    ],
    get: () => {
      const now = substance(absorber());
      return typeof now === "object" ? now.species : { law: LAW, file: FILE, list: LIST }[now];
    },
    set: (value) => {
      if (value !== FILE && value !== LIST) set((a) => withSubstance(a, value === LAW ? "law" : { species: value }), "species");
    },
  });
  const problem = h("p", { class: "error", role: "alert", hidden: true });
  const open = async (given: File) => {
    try {
      await openTable(page, layer, index, given);
    } catch (error) {
      problem.textContent = namedMessage(given.name, error);
      problem.hidden = false;
    }
  };
  const drop = fileDrop(fieldset, "Table of the absorption…", ".csv", (given) => void open(given));
  drop.title = `${help(`${PATH}.file`)} It can also be dropped here.`;
  drop.dataset.key = `${at}.file`;
  const controls = [what, massControl(at, absorber, set), unitControl(absorber, set), ...placeControls(at, absorber, set)];
  if (kind === "law") controls.push(...lawControls(at, absorber, set));
  const remove = h(
    "button",
    {
      type: "button",
      class: "small",
      onclick: () => {
        const { sample: before, files } = page.state.get();
        const sample = withLayer(before, layer, (l) => removeAbsorber(l, index));
        page.state.set({ sample, files: usedFiles(sample, files) });
      },
    },
    "Remove this absorber",
  );
  fieldset.append(h("legend", null, `Absorber ${index + 1}`), what.element, kind === "file" ? h("p", { class: "derived" }, `Now the table ${absorber().file}.`) : "", drop, problem, ...controls.slice(1).map((c) => c.element), remove);
  return { element: fieldset, refresh: () => controls.forEach((c) => c.refresh()) };
}

type Set = (change: (a: Absorber) => Absorber, merge: string) => void;

function massControl(at: string, absorber: () => Absorber, set: Set): Control {
  const key = massKey(absorber());
  const nanograms = key === "concentration_ng_g";
  return slider({
    label: "Concentration",
    unit: unitOf(absorber()),
    help: help(`${PATH}.${key}`),
    key: `${at}.${key}`,
    ...(nanograms ? { min: 10, max: 1e7 } : { min: 0.01, max: 1e4 }),
    step: nanograms ? 10 : 1,
    scale: "log0",
    get: () => amount(absorber()),
    set: (value) => set((a) => ({ ...a, [key]: value }), key),
  });
}

function unitControl(absorber: () => Absorber, set: Set): Control {
  return choice({
    label: "Unit",
    help: "1 µg/g is 1000 ng/g: a millionth of the mass of the snow.",
    choices: [
      ["concentration_ug_g", "µg/g"],
      ["concentration_ng_g", "ng/g"],
    ],
    get: () => massKey(absorber()),
    set: (value) =>
      set((a) => {
        const bare = without(a, "concentration_ng_g", "concentration_ug_g");
        const mass = microgramsPerGram(a);
        return value === "concentration_ug_g" ? { ...bare, concentration_ug_g: mass } : { ...bare, concentration_ng_g: Number((mass * 1000).toPrecision(12)) };
      }, "unit"),
  });
}

/// Where the substance is, and what its mass refers to.
function placeControls(at: string, absorber: () => Absorber, set: Set): Control[] {
  const place = choice({
    label: "Where it is",
    help: `${help(`${PATH}.phase`)} ${help(`${PATH}.sedimentation`)}`,
    key: `${at}.phase`,
    choices: [
      ["ice", "inside the ice"],
      ["pores", "in the pores"],
      ["both", "in both"],
    ],
    get: () => (absorber().sedimentation === undefined ? (absorber().phase ?? "ice") : "both"),
    set: (value) =>
      set((a) => {
        const bare = without(a, "phase", "sedimentation");
        return value === "both" ? { ...bare, sedimentation: 0.5 } : { ...bare, phase: value as "ice" | "pores" };
      }, "phase"),
  });
  const share = slider({
    label: "Share inside the ice",
    unit: "",
    help: help(`${PATH}.sedimentation`),
    key: `${at}.sedimentation`,
    ...limits(`${PATH}.sedimentation`),
    step: 0.05,
    get: () => absorber().sedimentation ?? DEFAULTS.sedimentation,
    set: (value) => set((a) => ({ ...a, sedimentation: value }), "sedimentation"),
  });
  const per = choice({
    label: "Per mass of",
    help: help(`${PATH}.concentration_per`),
    key: `${at}.concentration_per`,
    choices: [
      ["dry_mass", "dry snow"],
      ["wet_mass", "snow with its water"],
    ],
    get: () => absorber().concentration_per ?? "dry_mass",
    set: (value) => set((a) => ({ ...a, concentration_per: value as "dry_mass" | "wet_mass" }), "per"),
  });
  return absorber().sedimentation === undefined ? [place, per] : [place, share, per];
}

function lawControls(at: string, absorber: () => Absorber, set: Set): Control[] {
  const part = (
    own: "mass_absorption_efficiency_m2_g" | "reference_wavelength_nm" | "angstrom_exponent",
    label: string,
    unit: string,
    ends: { min: number; max: number; step: number; scale?: "log0" },
  ) =>
    slider({
      label,
      unit,
      help: help(`${PATH}.${own}`),
      key: `${at}.${own}`,
      ...ends,
      get: () => Number(absorber()[own] ?? 0),
      set: (value) => set((a) => ({ ...a, [own]: value }), own),
    });
  return [
    part("mass_absorption_efficiency_m2_g", "Mass absorption efficiency", "m²/g", { min: 0.001, max: 100, step: 0.01, scale: "log0" }),
    part("reference_wavelength_nm", "at the wavelength", "nm", { ...limits(`${PATH}.reference_wavelength_nm`, { min: 350, max: 1000 }), step: 10 }),
    part("angstrom_exponent", "Ångström exponent", "", { ...limits(`${PATH}.angstrom_exponent`, { max: 8 }), step: 0.1 }),
  ];
}

/// Makes a file the law of an absorber of a layer; of a new one behind the last.
async function openTable(page: Page, layer: number, index: number, given: File): Promise<void> {
  if (given.size > MOST_FILE_BYTES) throw new Error(`a table of an absorber has ${MOST_FILE_BYTES / 1000} kB at most, so that a link can hold it`);
  const content = await given.text();
  const { sample: before, files } = page.state.get();
  const name = freeName(given.name, content, files);
  const count = before.layer[layer]!.absorber?.length ?? 0;
  if (count >= MOST_ABSORBERS && index >= count) throw new Error(`a layer has ${MOST_ABSORBERS} absorbers at most on this page`);
  const room = index < count ? before : withLayer(before, layer, addAbsorber);
  const sample = withAbsorber(room, layer, index, (a) => withSubstance(a, { file: name }));
  page.state.set({ sample, files: usedFiles(sample, { ...files, [name]: content }) });
}

/// Adds the absorber of a table that was dropped anywhere to the selected layer; false if the file
/// is no such table.
export async function openDropped(page: Page, file: File): Promise<boolean> {
  const lines = (await file.slice(0, 4096).text()).split(/\r?\n/);
  const header = lines.find((line) => line.trim() && !line.startsWith("#")) ?? "";
  if (header.replace(/[\s"\ufeff]/g, "") !== HEADER) return false;
  const { sample, layer } = page.state.get();
  try {
    await openTable(page, layer, sample.layer[layer]!.absorber?.length ?? 0, file);
  } catch (error) {
    page.say(namedMessage(file.name, error));
  }
  return true;
}

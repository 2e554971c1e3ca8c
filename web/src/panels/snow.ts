// The panel "Snow": the sample and its light.
import { choice, clearMessages, segments, showMessage, slider, type Control } from "../controls";
import { fileDrop, h } from "../dom";
import type { Sample } from "../messages";
import { namedMessage, type Page } from "../page";
import { absorberOutline } from "../snow/absorber";
import { freeName, usedFiles } from "../snow/edit";
import { layerControls } from "../snow/layer";
import { help, limits, names, standard } from "../snow/schema";
import { drawSky } from "../snow/sky";
import { stack } from "../snow/stack";

export function mount(root: HTMLElement, page: Page): void {
  const { state } = page;
  const setSample = (change: (sample: Sample) => Sample, merge?: string) => state.set({ sample: change(state.get().sample) }, merge);

  const presets = h("select", { id: "preset", "aria-label": "Preset", title: "Replaces the snow by a ready sample" }, h("option", { value: "" }, "Choose a ready sample…"));
  page.about.subscribe((about) => {
    presets.replaceChildren(
      h("option", { value: "" }, "Choose a ready sample…"),
      ...(about?.presets ?? []).map((preset) => h("option", { value: preset.name }, `${preset.name.replaceAll("_", " ")}: ${preset.title.replace(/\.$/, "")}`)),
    );
    presets.disabled = !about;
  });
  presets.addEventListener("change", () => {
    const preset = page.about.value?.presets.find((p) => p.name === presets.value);
    if (preset) {
      state.set({ sample: structuredClone(preset.sample), files: { ...preset.files }, layer: preset.sample.layer.length - 1 });
      page.say(`Sample: ${preset.title}`);
    }
    presets.value = "";
  });

  const light = segments({
    label: "Light",
    help: help("illumination"),
    choices: [
      ["sun", "Sun"],
      ["sky", "Overcast sky"],
    ],
    get: () => ("diffuse" in state.get().sample.illumination ? "sky" : "sun"),
    set: (value) => setSample((s) => ({ ...s, illumination: value === "sky" ? { diffuse: true } : { incidence_angle_deg: 0 } })),
  });
  const angle = slider({
    label: "Incidence angle",
    unit: "°",
    help: help("illumination.incidence_angle_deg"),
    key: "illumination",
    ...limits("illumination.incidence_angle_deg", { max: 85 }),
    max: 85,
    step: 1,
    get: () => ("incidence_angle_deg" in state.get().sample.illumination ? (state.get().sample.illumination as { incidence_angle_deg: number }).incidence_angle_deg : 0),
    set: (value) => setSample((s) => ({ ...s, illumination: { incidence_angle_deg: value } }), "angle"),
  });
  const sky = h("canvas", { class: "sky", role: "img" });
  const layers = stack(page);
  const substrate = substrateControls(page);
  const model = modelControls(page);

  const heading = h("h3");
  const editor = h("div", { class: "editor" });
  const messages = h("div", { class: "notes", "aria-live": "polite" });
  root.append(
    h("h2", null, "Snow"),
    presets,
    h("section", { class: "light" }, light.element, angle.element),
    h("div", { class: "column" }, sky, layers.element),
    messages,
    h("section", null, heading, editor),
    h("section", null, h("h3", null, "Substrate"), substrate.element),
    model.element,
  );

  let structure = "";
  let layer: Control | null = null;
  const refresh = () => {
    const { sample, layer: index } = state.get();
    const now = outline(sample, index);
    if (now !== structure) {
      structure = now;
      // Details that are open stay open.
      const open = new Set([...editor.querySelectorAll("details[open] > summary")].map((s) => s.textContent));
      layer?.end?.();
      layer = layerControls(page, index);
      editor.replaceChildren(layer.element);
      for (const summary of editor.querySelectorAll("summary")) {
        if (open.has(summary.textContent)) (summary.parentElement as HTMLDetailsElement).open = true;
      }
    }
    const n = sample.layer.length;
    heading.textContent = n === 1 ? "The layer" : `Layer ${n - index} of ${n}, ${index === n - 1 ? "the surface" : index === 0 ? "the base" : "from the surface"}`;
    const sun = "incidence_angle_deg" in sample.illumination;
    angle.element.hidden = !sun;
    for (const control of [light, angle, layers, substrate, model]) control.refresh();
    layer?.refresh();
    drawSky(sky, sample);
  };
  state.subscribe((_, changed) => {
    if (changed.has("sample") || changed.has("layer") || changed.has("files")) refresh();
  });
  refresh();
  new ResizeObserver(() => drawSky(sky, state.get().sample)).observe(sky);

  const report = () => {
    const refused = page.refused.value;
    messages.replaceChildren();
    clearMessages(root);
    if (refused) {
      const which = /^layer\[(\d+)\]/.exec(refused.key ?? "")?.[1];
      // The message belongs to another layer: say so, and lead there.
      const other = which !== undefined && Number(which) !== state.get().layer && Number(which) < state.get().sample.layer.length;
      if (other || !showMessage(root, refused.key, plain(refused.message))) {
        const go = other && h("button", { type: "button", class: "small", onclick: () => state.set({ layer: Number(which) }) }, "Show this layer");
        messages.append(h("p", { class: "error", role: "alert" }, plain(refused.message)), go || "");
      }
      return;
    }
    for (const note of [...(page.checked.value?.warnings ?? []), ...(page.checked.value?.notes ?? [])]) {
      messages.append(h("p", null, plain(note)));
    }
  };
  page.refused.subscribe(report);
  page.checked.subscribe(report);
  state.subscribe((_, changed) => {
    if (changed.has("layer")) report();
  });
}

/// A message without the line of the file, which nobody sees here.
function plain(message: string): string {
  return message.replace(/^the sample(:\d+)*: /, "").replaceAll("`", "");
}

/// What decides which controls there are.
function outline(sample: Sample, index: number): string {
  const layer = sample.layer[index]!;
  return JSON.stringify([
    index,
    sample.layer.length,
    layer.thickness_cm === "inf",
    layer.density_kg_m3 === undefined,
    layer.water_fraction === undefined,
    layer.absorber?.map(absorberOutline),
    layer.grain.map((g) => [g.shape === "hexagonal", g.size_um === undefined, g.ssa_m2_kg === undefined]),
  ]);
}

const MOST_SUBSTRATE_BYTES = 200_000;

function substrateControls(page: Page): Control {
  const { state } = page;
  const file = h("p", { class: "derived" });
  const problem = h("p", { class: "error", role: "alert", hidden: true });
  const element = h("div");
  const complain = (text: string) => {
    problem.textContent = text;
    problem.hidden = !text;
  };
  const open = async (given: File) => {
    try {
      if (given.size > MOST_SUBSTRATE_BYTES) throw new Error(`a spectrum of a substrate has ${MOST_SUBSTRATE_BYTES / 1000} kB at most, so that a link can hold it`);
      const content = await given.text();
      const { sample: before, files } = state.get();
      const name = freeName(given.name, content, files);
      const sample = { ...before, substrate: { reflectance: name } };
      complain("");
      state.set({ sample, files: usedFiles(sample, { ...files, [name]: content }) });
    } catch (error) {
      complain(namedMessage(given.name, error));
    }
  };
  const drop = fileDrop(element, "Spectrum of the substrate…", ".csv,.txt,.tsv", (given) => void open(given));
  drop.title = "A table of wavelength (nm) and reflectance; it can also be dropped here.";
  const value = slider({
    label: "Reflectance",
    unit: "",
    help: help("substrate"),
    key: "substrate",
    ...{ min: 0, max: 1, step: 0.01 },
    get: () => {
      const given = state.get().sample.substrate?.reflectance;
      return typeof given === "number" ? given : 0;
    },
    set: (reflectance) => {
      const { substrate: _, ...rest } = state.get().sample;
      state.set({ sample: reflectance > 0 ? { ...rest, substrate: { reflectance } } : rest }, "substrate");
    },
  });
  element.append(value.element, file, drop, problem);
  const refresh = () => {
    value.refresh();
    const given = state.get().sample.substrate?.reflectance;
    file.textContent = given === undefined || typeof given === "number" ? "" : `Now a spectrum${typeof given === "string" ? `: ${given}` : ""}. Moving the slider replaces it.`;
  };
  refresh();
  return { element, refresh };
}

/// The choices of the model, as the schema lists them.
function modelControls(page: Page): Control {
  const { state } = page;
  const labels: Record<string, string> = {
    preset: "Variant of the model",
    entry: "Where rays enter a grain",
    facets: "Facets",
    size_law: "Law of sizes",
    layers: "Between layers",
    carbon_law: "Spectral law of carbon",
    impurity_mass: "Mass of carbon",
    ice: "Refractive index of ice",
  };
  const controls = Object.entries(labels).map(([key, label]) => {
    const path = `model.${key}`;
    return choice({
      label,
      help: help(path),
      key: path,
      choices: [["", `default (${standard(path)})`] as const, ...names(path).map((name) => [name, name.replaceAll("_", " ")] as const)],
      get: () => String(state.get().sample.model?.[key] ?? ""),
      set: (value) => {
        const { model, ...rest } = state.get().sample;
        const { [key]: _, ...others } = model ?? {};
        const next = value ? { ...others, [key]: value } : others;
        state.set({ sample: Object.keys(next).length > 0 ? { ...rest, model: next } : rest });
      },
    });
  });
  const element = h("details", { class: "model", "data-key": "model" }, h("summary", null, "Model"), ...controls.map((c) => c.element));
  return { element, refresh: () => controls.forEach((c) => c.refresh()) };
}


// The controls of one layer.
import { checkbox, choice, slider, type Control } from "../controls";
import { h } from "../dom";
import type { Carbon, Layer } from "../messages";
import type { Page } from "../page";
import { absorberControls } from "./absorber";
import { addAbsorber, addGrain, DEFAULTS, MOST_ABSORBERS, MOST_GRAINS, without, withLayer } from "./edit";
import { grainControls } from "./grain";
import { help, limits } from "./schema";

export function layerControls(page: Page, index: number): Control {
  const at = `layer[${index}]`;
  const layer = (): Layer => page.state.get().sample.layer[index]!;
  const set = (change: (l: Layer) => Layer, merge: string) => {
    page.state.set({ sample: withLayer(page.state.get().sample, index, change) }, `${at}.${merge}`);
  };
  const controls: Control[] = [];
  const infinite = layer().thickness_cm === "inf";
  if (!infinite) {
    controls.push(
      slider({
        label: "Thickness",
        unit: "cm",
        help: help("layer.thickness_cm"),
        key: `${at}.thickness_cm`,
        ...{ min: 0.5, max: 100, step: 0.5, scale: "log" as const },
        get: () => Number(layer().thickness_cm),
        set: (value) => set((l) => ({ ...l, thickness_cm: value }), "thickness_cm"),
      }),
    );
  }
  if (index === 0) {
    controls.push(
      checkbox({
        label: "Endlessly thick",
        help: "The base layer has no lower end (a half space): no light is transmitted.",
        key: infinite ? `${at}.thickness_cm` : undefined!,
        get: () => layer().thickness_cm === "inf",
        set: (on) => set((l) => ({ ...l, thickness_cm: on ? "inf" : 100 }), "inf"),
      }),
    );
  }
  controls.push(...densityControls(at, layer, set));
  controls.push(
    slider({
      label: "Temperature",
      unit: "°C",
      help: help("layer.temperature_c"),
      key: `${at}.temperature_c`,
      ...limits("layer.temperature_c"),
      step: 0.5,
      get: () => layer().temperature_c ?? DEFAULTS.temperature_c,
      set: (value) => set((l) => ({ ...l, temperature_c: value }), "temperature_c"),
    }),
  );
  controls.push(...waterControls(at, layer, set));
  controls.push(carbonControls("black_carbon", at, layer, set), carbonControls("brown_carbon", at, layer, set));
  const absorbers = (layer().absorber ?? []).map((_, i) => absorberControls(page, index, i));
  const another = h(
    "button",
    {
      type: "button",
      class: "small",
      title: help("layer.absorber"),
      disabled: absorbers.length >= MOST_ABSORBERS,
      onclick: () => set(addAbsorber, `absorber-${Date.now()}`),
    },
    "Add dust, ash or another absorber",
  );
  const grains = layer().grain.map((_, i) => grainControls(page, index, i));
  const more = h(
    "button",
    { type: "button", class: "small", disabled: layer().grain.length >= MOST_GRAINS, onclick: () => set(addGrain, `grain-${Date.now()}`) },
    "Add a grain type",
  );
  const derived = h("p", { class: "derived" });
  const refresh = () => {
    for (const control of [...controls, ...absorbers, ...grains]) control.refresh();
  };
  const end = page.checked.subscribe((answer) => {
    const own = answer?.layers[index];
    derived.textContent = own
      ? `All its grains together: SSA ${own.ssa_m2_kg.toFixed(1)} m²/kg, optical radius ${own.optical_radius_um.toFixed(0)} µm.`
      : "";
  });
  const element = h("div", { class: "layer-controls" }, ...[...controls, ...absorbers].map((c) => c.element), another, ...grains.map((g) => g.element), more, derived);
  return { element, refresh, end };
}

type Set = (change: (l: Layer) => Layer, merge: string) => void;

function densityControls(at: string, layer: () => Layer, set: Set): Control[] {
  const key = layer().density_kg_m3 !== undefined ? "density_kg_m3" : "wet_density_kg_m3";
  return [
    slider({
      label: key === "density_kg_m3" ? "Density, dry" : "Density with its water",
      unit: "kg/m³",
      help: help(`layer.${key}`),
      key: `${at}.${key}`,
      ...limits(`layer.${key}`, { max: key === "density_kg_m3" ? 550 : 700 }),
      step: 5,
      get: () => layer()[key] ?? 0,
      set: (value) => set((l) => ({ ...l, [key]: value }), key),
    }),
    checkbox({
      label: "Density includes the water",
      help: help("layer.wet_density_kg_m3"),
      get: () => layer().density_kg_m3 === undefined,
      set: (on) =>
        set((l) => {
          const value = l.density_kg_m3 ?? l.wet_density_kg_m3 ?? 275;
          const bare = without(l, "density_kg_m3", "wet_density_kg_m3");
          return on ? { ...bare, wet_density_kg_m3: value } : { ...bare, density_kg_m3: Math.min(550, value) };
        }, "wet"),
    }),
  ];
}

function waterControls(at: string, layer: () => Layer, set: Set): Control[] {
  const key = layer().water_fraction !== undefined ? "water_fraction" : "water_saturation";
  return [
    slider({
      label: "Liquid water",
      unit: key === "water_fraction" ? "of volume" : "of pores",
      help: help(`layer.${key}`),
      key: `${at}.${key}`,
      ...limits(`layer.${key}`, { max: key === "water_fraction" ? 0.15 : 0.3 }),
      step: 0.005,
      get: () => layer()[key] ?? DEFAULTS.water,
      set: (value) => set((l) => ({ ...l, [key]: value }), key),
    }),
    choice({
      label: "Water as a share of",
      help: `${help("layer.water_saturation")} ${help("layer.water_fraction")}`,
      choices: [
        ["water_saturation", "the pores"],
        ["water_fraction", "the volume"],
      ],
      get: () => key,
      set: (value) =>
        set((l) => {
          const porosity = Math.max(0.05, 1 - (l.density_kg_m3 ?? l.wet_density_kg_m3 ?? 275) / 917);
          const bare = without(l, "water_saturation", "water_fraction");
          const old = l[key] ?? 0;
          const given = value === "water_fraction" ? old * porosity : old / porosity;
          return { ...bare, [value]: Number(Math.min(0.5, given).toPrecision(3)) };
        }, "water"),
    }),
  ];
}

function carbonControls(name: "black_carbon" | "brown_carbon", at: string, layer: () => Layer, set: Set): Control {
  const title = name === "black_carbon" ? "Black carbon (soot)" : "Brown carbon";
  const key = `${at}.${name}`;
  const edit = (change: Partial<Carbon>, merge: string) => {
    set((l) => ({ ...l, [name]: { ...(l[name] ?? { concentration_ng_g: 0 }), ...change } }), `${name}.${merge}`);
  };
  const amount = slider({
    label: title,
    unit: "ng/g",
    help: `${help(`layer.${name}.concentration_ng_g`)} At 0 there is none.`,
    key: `${key}.concentration_ng_g`,
    ...{ min: 1, max: 100_000, step: 1, scale: "log0" as const },
    get: () => layer()[name]?.concentration_ng_g ?? 0,
    set: (value) => {
      // Without carbon the key goes, unless more of it was set.
      const only = Object.keys(layer()[name] ?? {}).every((k) => k === "concentration_ng_g");
      if (value === 0 && only) set((l) => without(l, name), `${name}.amount`);
      else edit({ concentration_ng_g: value }, "amount");
    },
  });
  const detail = (
    own: "sedimentation" | "mass_absorption_efficiency_m2_g" | "reference_wavelength_nm" | "angstrom_exponent",
    label: string,
    unit: string,
    ends: { min: number; max: number },
    step: number,
    standard: number,
  ) =>
    slider({
      label,
      unit,
      help: help(`layer.${name}.${own}`),
      key: `${key}.${own}`,
      ...limits(`layer.${name}.${own}`, ends),
      step,
      get: () => layer()[name]?.[own] ?? standard,
      set: (value) => edit({ [own]: value }, own),
    });
  const details = [
    detail("sedimentation", "Share inside the ice", "", { min: 0, max: 1 }, 0.05, DEFAULTS.sedimentation),
    detail("mass_absorption_efficiency_m2_g", "Mass absorption efficiency", "m²/g", { min: 0, max: 30 }, 0.1, DEFAULTS.mass_absorption_efficiency_m2_g),
    detail("reference_wavelength_nm", "at the wavelength", "nm", { min: 350, max: 1000 }, 10, DEFAULTS.reference_wavelength_nm),
    detail("angstrom_exponent", "Ångström exponent", "", { min: 0, max: 8 }, 0.1, name === "black_carbon" ? 1 : 2),
    choice({
      label: "Per mass of",
      help: help(`layer.${name}.concentration_per`),
      key: `${key}.concentration_per`,
      choices: [
        ["dry_mass", "dry snow"],
        ["wet_mass", "snow with its water"],
      ],
      get: () => layer()[name]?.concentration_per ?? "dry_mass",
      set: (value) => edit({ concentration_per: value as "dry_mass" | "wet_mass" }, "per"),
    }),
  ];
  const box = h("details", { class: "spread" }, h("summary", null, `More on the ${title.replace(" (soot)", "").toLowerCase()}`), ...details.map((d) => d.element));
  const refresh = () => {
    for (const control of [amount, ...details]) control.refresh();
    box.hidden = !layer()[name];
  };
  refresh();
  return { element: h("div", { "data-key": key }, amount.element, box), refresh };
}

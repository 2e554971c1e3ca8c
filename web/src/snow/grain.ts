// The controls of one grain type.
import { choice, slider, text, type Control } from "../controls";
import { h } from "../dom";
import type { Grain, Law } from "../messages";
import type { Page } from "../page";
import { addLaw } from "./law";
import { DEFAULTS, removeGrain, shareOut, shares, sizeKind, withGrain, withLayer, withShares, withSizeKind, type SizeKind } from "./edit";
import { help, limits } from "./schema";

export function grainControls(page: Page, layer: number, index: number): Control {
  const at = `layer[${layer}].grain[${index}]`;
  const grain = (): Grain => page.state.get().sample.layer[layer]!.grain[index]!;
  const count = page.state.get().sample.layer[layer]!.grain.length;
  const set = (change: (g: Grain) => Grain, merge: string) => {
    page.state.set({ sample: withGrain(page.state.get().sample, layer, index, change) }, `${at}.${merge}`);
  };
  const controls: Control[] = [];

  if (count > 1) {
    controls.push(
      slider({
        label: "Share of the ice",
        unit: "",
        help: help("layer.grain.fraction"),
        key: `${at}.fraction`,
        ...{ min: 0, max: 1, step: 0.01 },
        get: () => shares(page.state.get().sample.layer[layer]!)[index]!,
        set: (value) => {
          const change = withLayer(page.state.get().sample, layer, (l) => withShares(l, shareOut(shares(l), index, value)));
          page.state.set({ sample: change }, `${at}.fraction`);
        },
      }),
    );
  }
  controls.push(...sizeControls(page, layer, at, grain, set));
  controls.push(
    addLaw({
      label: "Facetness",
      key: `${at}.facetness`,
      path: "layer.grain.facetness",
      ...limits("layer.grain.facetness.mean"),
      spread: 0.1,
      get: () => grain().facetness,
      set: (law, part) => set((g) => ({ ...g, facetness: law }), `facetness.${part}`),
    }),
  );
  controls.push(
    choice({
      label: "Shape",
      help: help("layer.grain.shape"),
      key: `${at}.shape`,
      choices: [
        ["spheroid", "prolate spheroids"],
        ["oblate", "oblate spheroids"],
        ["hexagonal", "hexagonal prisms"],
      ],
      get: () => grain().shape ?? "spheroid",
      set: (value) => set((g) => withShape(g, value as NonNullable<Grain["shape"]>), "shape"),
    }),
  );
  if (grain().shape === "hexagonal") {
    controls.push(
      addLaw({
        label: "Aspect ratio",
        key: `${at}.aspect_ratio`,
        path: "layer.grain.aspect_ratio",
        ...limits("layer.grain.aspect_ratio.mean", { min: 0.1, max: 10 }),
        spread: 0.5,
        get: () => grain().aspect_ratio ?? DEFAULTS.aspect_ratio,
        set: (law, part) => set((g) => ({ ...g, aspect_ratio: law }), `aspect_ratio.${part}`),
      }),
    );
  } else {
    controls.push(
      addLaw({
        label: "Sphericity",
        key: `${at}.sphericity`,
        path: "layer.grain.sphericity",
        ...limits("layer.grain.sphericity.mean", { min: 0.2 }),
        spread: 0.15,
        get: (): Law => grain().sphericity ?? DEFAULTS.sphericity,
        set: (law, part) => set((g) => ({ ...g, sphericity: law }), `sphericity.${part}`),
      }),
    );
  }
  const remove =
    count > 1 &&
    h(
      "button",
      {
        type: "button",
        class: "small",
        onclick: () => page.state.set({ sample: withLayer(page.state.get().sample, layer, (l) => removeGrain(l, index)) }),
      },
      "Remove this type",
    );
  const element = h(
    "fieldset",
    { class: "grain", "data-key": at },
    h("legend", null, count > 1 ? `Grain type ${index + 1}` : "Grains"),
    ...controls.map((c) => c.element),
    remove,
  );
  return { element, refresh: () => controls.forEach((c) => c.refresh()) };
}

function withShape(grain: Grain, shape: NonNullable<Grain["shape"]>): Grain {
  const { sphericity, aspect_ratio, shape: _, ...rest } = grain;
  if (shape === "hexagonal") return { ...rest, shape, aspect_ratio: aspect_ratio ?? DEFAULTS.aspect_ratio };
  const kept = sphericity ? { ...rest, sphericity } : rest;
  return shape === "spheroid" ? kept : { ...kept, shape };
}

function sizeControls(
  page: Page,
  layer: number,
  at: string,
  grain: () => Grain,
  set: (change: (g: Grain) => Grain, merge: string) => void,
): Control[] {
  const kind = choice({
    label: "Size given as",
    help: "Grains have a range of lengths, or one size that has a given specific surface area (SSA) or optical radius.",
    choices: [
      ["size_um", "range of lengths"],
      ["ssa_m2_kg", "specific surface area"],
      ["optical_radius_um", "optical radius"],
    ],
    get: () => sizeKind(grain()),
    set: (value) => set((g) => withSizeKind(g, value as SizeKind, page.checked.value?.layers[layer]), "kind"),
  });
  const now = sizeKind(grain());
  if (now !== "size_um") {
    const ssa = now === "ssa_m2_kg";
    const one = slider({
      label: ssa ? "Specific surface area" : "Optical radius",
      unit: ssa ? "m²/kg" : "µm",
      help: help(`layer.grain.${now}`),
      key: `${at}.${now}`,
      ...(ssa ? { min: 2, max: 100 } : { min: 30, max: 1500 }),
      step: 1,
      scale: "log",
      get: () => grain()[now] ?? 0,
      set: (value) => set((g) => ({ ...g, [now]: value }), now),
    });
    return [kind, one];
  }
  const bound = (part: "min" | "max"): Control =>
    slider({
      label: part === "min" ? "Smallest grain" : "Largest grain",
      unit: "µm",
      help: `${help("layer.grain.size_um")} ${help(`layer.grain.size_um.${part}`)}`,
      key: `${at}.size_um.${part}`,
      ...{ min: 50, max: 3000, step: 10, scale: "log" as const },
      get: () => grain().size_um?.[part] ?? 0,
      set: (value) =>
        set((g) => {
          const size = { ...(g.size_um ?? { min: value, max: value }), [part]: value };
          // The other end gives way.
          if (part === "min" && size.max < value) size.max = value;
          if (part === "max" && size.min > value) size.min = value;
          return { ...g, size_um: size };
        }, `size_um.${part}`),
    });
  return [kind, bound("min"), bound("max")];
}

/// "300-750 µm", "20 m²/kg" or "radius 150 µm", for the stack.
export function sizeText(grain: Grain): string {
  if (grain.size_um) return `${text(grain.size_um.min)}–${text(grain.size_um.max)} µm`;
  if (grain.ssa_m2_kg !== undefined) return `${text(grain.ssa_m2_kg)} m²/kg`;
  return `radius ${text(grain.optical_radius_um ?? 0)} µm`;
}

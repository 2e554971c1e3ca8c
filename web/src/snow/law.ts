// A truncated normal law: its mean as a slider, its limits and standard deviation behind it.
import { slider, type Control } from "../controls";
import { h } from "../dom";
import type { Law } from "../messages";
import { moveMean, round } from "./edit";
import { help } from "./schema";

export interface LawOptions {
  label: string;
  key: string;
  /// Of the schema: `layer.grain.facetness`.
  path: string;
  /// Ends of the slider.
  min: number;
  max: number;
  /// Half the width that a law gets back when it leaves the end of its range.
  spread: number;
  get(): Law;
  set(law: Law, part: string): void;
}

export function addLaw(options: LawOptions): Control {
  const { label, key, path, min, max, get, set } = options;
  const mean = slider({
    label: `${label}, mean`,
    unit: "",
    help: help(path),
    key,
    ...{ min, max, step: 0.01 },
    get: () => get().mean,
    set: (value) => set(moveMean(get(), round(value), min, max, options.spread), "mean"),
  });
  const part = (name: "min" | "max" | "sd", title: string, most: number) =>
    slider({
      label: title,
      unit: "",
      help: help(`${path}.${name}`),
      key: `${key}.${name}`,
      ...{ min: name === "sd" ? 0.01 : min, max: most, step: 0.01 },
      get: () => get()[name],
      set: (value) => set({ ...get(), [name]: value }, name),
    });
  const parts = [part("min", "smallest", max), part("max", "largest", max), part("sd", "standard deviation", 0.5)];
  const spread = h("details", { class: "spread" }, h("summary", null, `Spread of the ${label.toLowerCase()}`), ...parts.map((p) => p.element));
  return {
    element: h("div", null, mean.element, spread),
    refresh: () => [mean, ...parts].forEach((c) => c.refresh()),
  };
}

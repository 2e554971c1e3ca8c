// The state of the page, with undo and redo.
import type { Sample } from "./messages";
import type { State, Store } from "./page";

/// The representative sample of Varsa 2025, section 7.1: `configs/samples/representative.toml`.
const REPRESENTATIVE: Sample = {
  version: 1,
  illumination: { incidence_angle_deg: 0 },
  wavelengths: { start_nm: 400, stop_nm: 2500, step_nm: 10 },
  layer: [
    {
      thickness_cm: 12,
      density_kg_m3: 275,
      temperature_c: -1,
      water_saturation: 0.05,
      grain: [
        {
          size_um: { min: 300, max: 750 },
          facetness: { min: 0.2, max: 0.4, mean: 0.3, sd: 0.072 },
          sphericity: { min: 0.6, max: 0.95, mean: 0.798, sd: 0.064 },
        },
      ],
    },
  ],
};

const DROPPED = " (file)";

/// The name of a dropped light, which no built-in light has.
export function droppedName(name: string): string {
  return name.endsWith(DROPPED) ? name : `${name}${DROPPED}`;
}

export function initialState(): State {
  return {
    sample: structuredClone(REPRESENTATIVE),
    files: {},
    panel: "spectra",
    layer: 0,
    range: "visible",
    scale: "linear",
    shown: { reflectance: true, transmittance: true, absorptance: true },
    held: [],
    measured: null,
    light: "D65",
    droppedLight: null,
    exposure_stops: 0,
    seed: 1,
    directions: {},
    databases: {},
  };
}

/// Changes of these keys alone are not steps of undo: they move the reader, not the snow.
const VIEW: ReadonlySet<keyof State> = new Set(["panel", "layer"]);
/// Changes of one control closer together than this are one step, ms.
const TOGETHER_MS = 800;
const MOST_STEPS = 200;

type Listener = (state: State, changed: ReadonlySet<keyof State>) => void;

export class History implements Store {
  #state: State;
  #undo: State[] = [];
  #redo: State[] = [];
  #merge: string | undefined;
  #last = -Infinity;
  readonly #listeners = new Set<Listener>();
  readonly #now: () => number;

  constructor(state: State, now: () => number = () => performance.now()) {
    this.#state = state;
    this.#now = now;
  }

  get(): State {
    return this.#state;
  }

  get canUndo(): boolean {
    return this.#undo.length > 0;
  }

  get canRedo(): boolean {
    return this.#redo.length > 0;
  }

  set(change: Partial<State>, merge?: string): void {
    const keys = Object.keys(change) as (keyof State)[];
    const changed = new Set(keys.filter((key) => change[key] !== this.#state[key]));
    if (changed.size === 0) return;
    const now = this.#now();
    if ([...changed].some((key) => !VIEW.has(key))) {
      const together = merge !== undefined && merge === this.#merge && now - this.#last < TOGETHER_MS;
      if (!together) {
        this.#undo.push(this.#state);
        if (this.#undo.length > MOST_STEPS) this.#undo.shift();
      }
      this.#redo = [];
      this.#merge = merge;
      this.#last = now;
    }
    this.#replace({ ...this.#state, ...change }, changed);
  }

  undo(): boolean {
    return this.#step(this.#undo, this.#redo);
  }

  redo(): boolean {
    return this.#step(this.#redo, this.#undo);
  }

  /// Another state altogether, as a link gives it. Can be undone.
  load(state: State): void {
    this.set(state);
  }

  subscribe(listener: Listener): () => void {
    this.#listeners.add(listener);
    return () => this.#listeners.delete(listener);
  }

  #step(from: State[], to: State[]): boolean {
    const state = from.pop();
    if (!state) return false;
    to.push(this.#state);
    this.#merge = undefined;
    // The reader stays on the panel that is open.
    const next = { ...state, panel: this.#state.panel };
    next.layer = Math.min(next.layer, next.sample.layer.length - 1);
    const keys = Object.keys(next) as (keyof State)[];
    this.#replace(next, new Set(keys.filter((key) => next[key] !== this.#state[key])));
    return true;
  }

  #replace(state: State, changed: ReadonlySet<keyof State>): void {
    this.#state = state;
    for (const listener of this.#listeners) listener(state, changed);
  }
}

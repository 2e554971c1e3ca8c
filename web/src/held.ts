// Curves that are held for comparison: their spectra at the wavelengths of the page.
import { inRange, messageOf, type Held, type Page, type Range } from "./page";
import type { Sample, Spectrum } from "./messages";
import { Value } from "./observable";

export interface HeldCurve {
  held: Held;
  spectrum: Spectrum | null;
}

export const MOST_HELD = 4;

export class HeldCurves {
  readonly curves = new Value<HeldCurve[]>([]);
  readonly #page: Page;
  readonly #known = new Map<string, Spectrum>();
  /// Counts updates: an older one gives up.
  #version = 0;

  constructor(page: Page) {
    this.#page = page;
    page.state.subscribe((_, changed) => {
      if (changed.has("held") || changed.has("range") || changed.has("seed")) void this.#update();
    });
  }

  /// Holds the curve that is shown.
  hold(): void {
    const { state, shown } = this.#page;
    const now = state.get();
    const { spectrum } = shown.value ?? {};
    if (!spectrum || now.held.length >= MOST_HELD) return;
    const used = new Set(now.held.map((h) => h.name));
    const name = ["A", "B", "C", "D", "E"].find((letter) => !used.has(`Held ${letter}`))!;
    const held: Held = { name: `Held ${name}`, sample: now.sample, files: now.files, rays: spectrum.rays };
    // The curve on the screen may still be that of the sample a moment ago.
    if (shown.value && JSON.stringify(shown.value.sample) === JSON.stringify(inRange(now.sample, now.range))) {
      this.#known.set(keyOf(held, shown.value.sample, now.seed), spectrum);
    }
    state.set({ held: [...now.held, held] });
  }

  async start(): Promise<void> {
    await this.#update();
  }

  async #update(): Promise<void> {
    const now = ++this.#version;
    const { held, range, seed } = this.#page.state.get();
    for (const key of this.#known.keys()) {
      if (this.#known.size > 40) this.#known.delete(key);
    }
    this.#show(held, range, seed);
    for (const [index, one] of held.entries()) {
      const sample = inRange(one.sample, range);
      const key = keyOf(one, sample, seed);
      if (this.#known.has(key)) continue;
      const { files, rays } = one;
      try {
        const spectrum = await this.#page.engine.askLatest(`held ${index}`, { ask: "simulate", sample, files, rays, seed });
        if (!spectrum) return;
        this.#known.set(key, spectrum);
      } catch (error) {
        this.#page.say(`${one.name}: ${messageOf(error)}`);
      }
      if (now !== this.#version) return;
      this.#show(held, range, seed);
    }
  }

  #show(held: Held[], range: Range, seed: number): void {
    this.curves.set(held.map((one) => ({ held: one, spectrum: this.#known.get(keyOf(one, inRange(one.sample, range), seed)) ?? null })));
  }
}

function keyOf(held: Held, sample: Sample, seed: number): string {
  return JSON.stringify([sample, held.files, held.rays, seed]);
}

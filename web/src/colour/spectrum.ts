// The visible spectrum of the current sample, for its colours.
import type { Spectrum } from "../messages";
import { inVisible, RAYS, REST_MS, type Page } from "../page";
import { Value } from "../observable";

/// Whether colours can be computed from these wavelengths: 400-700 nm without gaps.
export function coversVisible(nm: readonly number[]): boolean {
  const inside = nm.filter((x) => x >= 400 && x <= 700);
  const gaps = inside.slice(1).every((x, i) => x - inside[i]! <= 10.001);
  return inside.length > 2 && inside[0]! <= 400.001 && inside[inside.length - 1]! >= 699.999 && gaps;
}

/// Follows the spectrum on the screen, or simulates the visible one if that does not do.
/// `wanted` says whether anybody looks.
export function visibleSpectrum(page: Page, wanted: () => boolean): { spectrum: Value<Spectrum | null>; update(): void } {
  const spectrum = new Value<Spectrum | null>(null);
  let done = "";
  let timer: ReturnType<typeof setTimeout> | undefined;
  const update = () => {
    clearTimeout(timer);
    const shown = page.shown.value;
    if (!wanted() || !shown) return;
    if (coversVisible(shown.spectrum.wavelengths_nm)) {
      spectrum.set(shown.spectrum);
      return;
    }
    timer = setTimeout(() => {
      const { sample: given, files, seed } = page.state.get();
      const sample = inVisible(given);
      const key = JSON.stringify([sample, files, seed]);
      if (key === done && spectrum.value) return;
      page.engine.askLatest("visible", { ask: "simulate", sample, files, rays: RAYS[1], seed }).then(
        (answer) => {
          if (!answer) return;
          done = key;
          spectrum.set(answer);
        },
        () => undefined, // The status line has the refusal of this sample already.
      );
    }, REST_MS);
  };
  page.shown.subscribe(update);
  return { spectrum, update };
}

// A wedge of snow, 0 to 60 cm thick, in transmitted and in reflected light.
import { colour, fitCanvas, h, onTheme } from "../dom";
import type { Colours, Light, Wedge } from "../messages";
import { inVisible, RAYS, REST_MS, type Page } from "../page";

export const DEEPEST_CM = 60;
const THICKNESSES = [0.25, 0.5, 0.75, 1, 1.5, 2, 2.5, 3, 4, 5, 6, 7, 8, 10, 12, 14, 16, 18, 20, 23, 26, 29, 32, 36, 40, 44, 48, 52, 56, 60];
const BAR = 64;
const GAP = 26;
const AXIS = 34;

interface Strip {
  thicknesses_cm: number[];
  transmitted: Colours;
  reflected: Colours;
}

export class WedgePicture {
  readonly element: HTMLElement;
  readonly #canvas = h("canvas", { class: "wedge", role: "img", "aria-label": "A wedge of snow; not computed yet" });
  readonly #readout = h("output", { class: "readout" }, "Point at the wedge, or move the slider, to read a colour.");
  readonly #page: Page;
  readonly #wanted: () => boolean;
  readonly #light: () => Light;
  #wedge: Wedge | null = null;
  #strip: Strip | null = null;
  #key = "";
  #timer: ReturnType<typeof setTimeout> | undefined;

  constructor(page: Page, wanted: () => boolean, light: () => Light) {
    this.#page = page;
    this.#wanted = wanted;
    this.#light = light;
    const reader = h("input", { type: "range", min: "0", max: String(DEEPEST_CM), step: "0.5", value: "0", "aria-label": "Read the colours at this thickness, cm" });
    reader.addEventListener("input", () => this.#read(Number(reader.value)));
    this.element = h("div", null, this.#canvas, h("div", { class: "reader" }, h("label", null, "Read at", reader), this.#readout));
    new ResizeObserver(() => this.draw()).observe(this.#canvas);
    onTheme(() => this.draw());
    this.#canvas.addEventListener("pointermove", (event) => {
      const box = this.#canvas.getBoundingClientRect();
      const cm = ((event.clientX - box.left) / box.width) * DEEPEST_CM;
      reader.value = String(cm);
      this.#read(cm);
    });
  }

  /// The sample changed: coarse soon, finer at rest.
  update(): void {
    if (!this.#wanted()) return;
    const { sample: given, files, seed } = this.#page.state.get();
    const sample = inVisible(given);
    const key = JSON.stringify([sample.illumination, sample.layer, sample.substrate, sample.model, files, seed]);
    if (key === this.#key) return;
    this.#key = key;
    clearTimeout(this.#timer);
    const ask = async (stage: number): Promise<void> => {
      try {
        const rays = RAYS[stage]!;
        const wedge = await this.#page.engine.askLatest("wedge", { ask: "wedge", sample, files, rays, seed, thicknesses_cm: THICKNESSES });
        if (!wedge || key !== this.#key) return;
        this.#wedge = wedge;
        await this.recolour();
        if (stage < 1) await ask(stage + 1);
      } catch {
        // The status line has the refusal of this sample already.
        if (key === this.#key) this.#key = "";
      }
    };
    this.#timer = setTimeout(() => void ask(0), REST_MS);
  }

  /// The light or the exposure changed.
  async recolour(): Promise<void> {
    const wedge = this.#wedge;
    if (!wedge) return;
    const { thicknesses_cm, wavelengths_nm, transmittance, reflectance } = wedge;
    if (thicknesses_cm.length === 0) {
      this.#strip = null;
      return this.draw();
    }
    const exposure = 2 ** this.#page.state.get().exposure_stops;
    const light = this.#light();
    const ask = (channel: string, spectra: number[][]) =>
      this.#page.engine.askLatest(channel, { ask: "colour", wavelengths_nm, spectra, light, exposure });
    const [transmitted, reflected] = await Promise.all([ask("wedge T", transmittance), ask("wedge R", reflectance)]);
    if (!transmitted || !reflected) return;
    this.#strip = { thicknesses_cm, transmitted, reflected };
    this.draw();
  }

  draw(): void {
    const width = this.#canvas.clientWidth;
    if (width === 0) return;
    const context = fitCanvas(this.#canvas, width, 2 * BAR + 2 * GAP + AXIS);
    context.font = `13px ${getComputedStyle(document.body).fontFamily}`;
    const strip = this.#strip;
    const rows: [string, Colours | undefined, number][] = [
      ["Transmitted light", strip?.transmitted, GAP],
      ["Reflected light", strip?.reflected, 2 * GAP + BAR],
    ];
    for (const [name, colours, top] of rows) {
      context.fillStyle = colour("--ink");
      context.fillText(name, 0, top - 8);
      this.#bar(context, width, top, strip?.thicknesses_cm ?? [], colours);
    }
    const bottom = 2 * GAP + 2 * BAR;
    context.fillStyle = context.strokeStyle = colour("--ink");
    const every = width < 420 ? 10 : 5;
    for (let cm = 0; cm <= DEEPEST_CM; cm += every) {
      const x = (cm / DEEPEST_CM) * (width - 1);
      context.fillRect(x, bottom, 1, 5);
      context.textAlign = cm === 0 ? "left" : cm === DEEPEST_CM ? "right" : "center";
      context.fillText(cm === 0 ? "0 cm" : String(cm), x, bottom + 19);
    }
    context.textAlign = "left";
    this.#canvas.setAttribute("aria-label", describe(strip));
  }

  #bar(context: CanvasRenderingContext2D, width: number, top: number, thicknesses: number[], colours: Colours | undefined): void {
    context.fillStyle = colour("--sunk");
    context.fillRect(0, top, width, BAR);
    if (!colours || thicknesses.length === 0) return;
    const pixels = Math.ceil(width);
    for (let x = 0; x < pixels; x++) {
      const place = at(thicknesses, (x / width) * DEEPEST_CM);
      if (!place) continue;
      const [a, b] = [colours.srgb[place.index]!, colours.srgb[place.index + 1] ?? colours.srgb[place.index]!];
      const mix = a.map((v, i) => Math.round(v + (b[i]! - v) * place.share));
      context.fillStyle = `rgb(${mix.join(" ")})`;
      context.fillRect(x, top, 1.5, BAR);
    }
    // What the screen cannot show, and thicknesses that this snow cannot have.
    const edges = thicknesses.map((cm) => (cm / DEEPEST_CM) * width);
    hatch(context, 0, edges[0]!, top, "--muted");
    colours.clipped.forEach((clipped, i) => {
      if (!clipped) return;
      const left = i === 0 ? edges[0]! : (edges[i - 1]! + edges[i]!) / 2;
      const right = i + 1 < edges.length ? (edges[i]! + edges[i + 1]!) / 2 : edges[i]!;
      hatch(context, left, right, top, "--clip");
    });
  }

  #read(cm: number): void {
    const strip = this.#strip;
    const place = strip && at(strip.thicknesses_cm, cm);
    if (!strip || !place) {
      this.#readout.textContent = strip ? "This snow cannot be so thin." : "The wedge is not computed yet.";
      return;
    }
    const nearest = place.share > 0.5 ? place.index + 1 : place.index;
    const row = (name: string, colours: Colours) => {
      const lab = colours.lab[nearest]!;
      return `${name}: Y ${percent(colours.xyz[nearest]![1]!)}, L* ${lab[0]!.toFixed(1)}, a* ${lab[1]!.toFixed(1)}, b* ${lab[2]!.toFixed(1)}${colours.clipped[nearest] ? ", clipped" : ""}`;
    };
    this.#readout.textContent = `${strip.thicknesses_cm[nearest]} cm. ${row("Transmitted", strip.transmitted)}. ${row("Reflected", strip.reflected)}.`;
  }
}

/// The pair of thicknesses around `cm`, and how far between them.
function at(thicknesses: number[], cm: number): { index: number; share: number } | null {
  const last = thicknesses.length - 1;
  if (last < 0 || cm < thicknesses[0]! || cm > thicknesses[last]! + 0.5) return null;
  let index = 0;
  while (index + 1 < last && thicknesses[index + 1]! <= cm) index++;
  if (index === last) return { index, share: 0 };
  const share = (cm - thicknesses[index]!) / (thicknesses[index + 1]! - thicknesses[index]!);
  return { index, share: Math.min(1, share) };
}

function hatch(context: CanvasRenderingContext2D, left: number, right: number, top: number, name: string): void {
  if (right - left < 0.5) return;
  context.save();
  context.beginPath();
  context.rect(left, top, right - left, BAR);
  context.clip();
  context.strokeStyle = colour(name);
  context.lineWidth = 1;
  context.beginPath();
  for (let x = Math.floor((left - BAR) / 8) * 8; x < right; x += 8) {
    context.moveTo(x, top + BAR);
    context.lineTo(x + BAR, top);
  }
  context.stroke();
  context.restore();
}

function describe(strip: Strip | null): string {
  if (!strip) return "A wedge of snow; not computed yet";
  const { thicknesses_cm: cm, transmitted } = strip;
  const last = cm.length - 1;
  return `A wedge of snow from ${cm[0]} to ${cm[last]} cm. Transmitted luminance falls from ${percent(transmitted.xyz[0]![1]!)} to ${percent(transmitted.xyz[last]![1]!)}.`;
}

export function percent(share: number): string {
  return `${Number((100 * share).toPrecision(3))} %`;
}

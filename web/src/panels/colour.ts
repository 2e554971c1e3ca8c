// The panel "Colour": swatches under several lights, and a wedge of thickness.
import { slider } from "../controls";
import { visibleSpectrum } from "../colour/spectrum";
import { percent, WedgePicture } from "../colour/wedge";
import { fileDrop, h } from "../dom";
import type { HeldCurves } from "../held";
import type { Colours, Light, Spectrum } from "../messages";
import { Gone, messageOf, namedMessage, type Page } from "../page";
import { droppedName } from "../state";

/// The lights that are shown, and what they are.
const LIGHTS: Record<string, string> = {
  E: "equal energy",
  D55: "sun at mid-morning",
  D65: "daylight",
  A: "light bulb",
  "LED-B5": "cool white LED",
  "FL3.15": "fluorescent lamp",
};

export function mount(root: HTMLElement, page: Page, held: HeldCurves): void {
  const { state } = page;
  const wanted = () => !root.hidden;
  const lightOf = (name: string): Light => {
    const { droppedLight } = state.get();
    if (droppedLight && droppedLight.name === name) return droppedLight;
    return Object.hasOwn(LIGHTS, name) ? name : "D65";
  };
  const visible = visibleSpectrum(page, wanted);
  const wedge = new WedgePicture(page, wanted, () => lightOf(state.get().light));
  const grid = h("div", { class: "swatches" });
  const exposure = slider({
    label: "Exposure",
    unit: "stops",
    help: "Brightens the colours on the screen: each stop doubles the light. At 0 a white surface is white. L*a*b* and differences stay those of the true light.",
    ...{ min: -2, max: 12, step: 0.5 },
    get: () => state.get().exposure_stops,
    set: (value) => state.set({ exposure_stops: Math.max(-20, Math.min(20, value)) }, "exposure"),
  });
  const auto = h("button", { type: "button", title: "Makes the brighter one of the two swatches of transmitted light as bright as paper" }, "Expose for transmitted light");
  let brightest = 0;
  auto.addEventListener("click", () => {
    if (brightest > 0) state.set({ exposure_stops: Math.max(-2, Math.min(12, Math.round(2 * Math.log2(0.8 / brightest)) / 2)) });
  });
  const problem = h("p", { class: "error", role: "alert", hidden: true });
  const read = (file: File) => {
    void file
      .text()
      .then((content) => page.engine.ask({ ask: "light", name: file.name, text: content }))
      .then((answer) => {
        problem.hidden = true;
        page.say(answer.notes.join(" "));
        const light = { ...answer.light, name: droppedName(answer.light.name) };
        state.set({ droppedLight: light, light: light.name });
      })
      .catch((error: unknown) => {
        problem.hidden = false;
        problem.textContent = namedMessage(file.name, error);
      });
  };
  const drop = fileDrop(root, "Spectrum of a light…", ".csv,.txt,.tsv,.spd", read);
  drop.title = "A table of wavelength (nm) and relative power; it can also be dropped on this panel.";

  root.append(
    h("h2", null, "Colour"),
    h("div", { class: "bar" }, exposure.element, auto, drop),
    problem,
    grid,
    h("p", { class: "muted" }, "Hatched: outside what the screen can show at this exposure. ΔE*ab (CIE 1976) compares with the first held curve."),
    h("h3", null, "A wedge of this snow"),
    h("p", { class: "muted" }, "The surface layer grows to the total thickness below. The light is the one chosen above."),
    wedge.element,
  );

  const names = () => [...Object.keys(LIGHTS), ...(state.get().droppedLight ? [state.get().droppedLight!.name] : [])];
  let round = 0;
  const swatches = async () => {
    const spectrum = visible.spectrum.value;
    if (!wanted() || !spectrum) return;
    const mine = ++round;
    const other = held.curves.value[0]?.spectrum ?? null;
    const stops = 2 ** state.get().exposure_stops;
    try {
      const rows = await Promise.all(names().map((name) => colours(page, spectrum, other, lightOf(name), stops)));
      if (mine !== round) return;
      show(names(), rows);
    } catch (error) {
      if (error instanceof Gone) return;
      problem.hidden = false;
      problem.textContent = messageOf(error);
    }
  };

  function show(lights: string[], rows: Row[]): void {
    const chosen = state.get().light;
    brightest = Math.max(...rows.map((row) => row.now.xyz[0]![1]!));
    // Elements are kept, so that the focus stays.
    while (grid.children.length > lights.length) grid.lastElementChild!.remove();
    lights.forEach((name, i) => {
      let card = grid.children[i] as HTMLElement | undefined;
      if (!card) {
        card = h("div", { class: "card" }, h("label", null, h("input", { type: "radio", name: "light" }), h("strong"), h("span", { class: "muted" })), h("div", { class: "pair" }));
        const input = card.querySelector("input")!;
        input.addEventListener("change", () => state.set({ light: input.value }));
        grid.append(card);
      }
      const input = card.querySelector("input")!;
      input.value = name;
      input.checked = name === chosen;
      card.classList.toggle("selected", name === chosen);
      card.querySelector("strong")!.textContent = name;
      card.querySelector(".muted")!.textContent = LIGHTS[name] ?? "dropped";
      const row = rows[i]!;
      card.querySelector(".pair")!.replaceChildren(swatch("Transmitted", row, 0), swatch("Reflected", row, 1));
    });
  }

  visible.spectrum.subscribe(() => void swatches());
  held.curves.subscribe(() => void swatches());
  state.subscribe((_, changed) => {
    if (changed.has("exposure_stops")) exposure.refresh();
    if (changed.has("panel")) {
      visible.update();
      wedge.draw();
    }
    if (changed.has("panel") || changed.has("light") || changed.has("droppedLight") || changed.has("exposure_stops")) {
      void swatches();
      if (!changed.has("panel")) wedge.recolour().catch(() => undefined);
    }
    wedge.update();
  });
  page.shown.subscribe(() => wedge.update());
}

interface Row {
  now: Colours;
  held: Colours | null;
}

async function colours(page: Page, spectrum: Spectrum, held: Spectrum | null, light: Light, exposure: number): Promise<Row> {
  const ask = (s: Spectrum) =>
    page.engine.ask({ ask: "colour", wavelengths_nm: s.wavelengths_nm, spectra: [s.transmittance, s.reflectance], light, exposure });
  const [now, other] = await Promise.all([ask(spectrum), held ? ask(held).catch(() => null) : null]);
  return { now, held: other };
}

function swatch(title: string, row: Row, index: number): HTMLElement {
  const { now, held } = row;
  const lab = now.lab[index]!;
  const patch = (colours: Colours, name: string) => {
    const box = h("div", { class: `patch${colours.clipped[index] ? " clipped" : ""}`, role: "img", title: name });
    box.style.backgroundColor = `rgb(${colours.srgb[index]!.join(" ")})`;
    box.setAttribute("aria-label", `${name}: ${hex(colours.srgb[index]!)}${colours.clipped[index] ? ", clipped" : ""}`);
    return box;
  };
  const delta = held ? Math.hypot(...lab.map((v, i) => v - held.lab[index]![i]!)) : null;
  return h(
    "div",
    { class: "swatch" },
    h("div", { class: "patches" }, patch(now, title), held ? patch(held, `${title}, held`) : null),
    h("div", null, h("strong", null, title)),
    h("div", { class: "muted" }, hex(now.srgb[index]!)),
    h("div", { class: "muted", title: "CIELAB, relative to the light" }, `Y ${percent(now.xyz[index]![1]!)} · L* ${lab[0]!.toFixed(1)}`),
    h("div", { class: "muted", title: "CIELAB, relative to the light" }, `a* ${signed(lab[1]!)} · b* ${signed(lab[2]!)}`),
    delta === null ? null : h("div", null, `ΔE to held: ${delta.toFixed(2)}`),
  );
}

function signed(value: number): string {
  return value.toFixed(1).replace("-", "−");
}

function hex(srgb: readonly number[]): string {
  return `#${srgb.map((v) => Math.max(0, Math.min(255, Math.round(v))).toString(16).padStart(2, "0")).join("")}`;
}

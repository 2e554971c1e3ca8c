// The panel "Spectra": reflectance, transmittance and absorptance over wavelength.
import { choice, segments, text } from "../controls";
import { bandOf, curveOf, DASHES, NAMES, QUANTITIES, type Curve } from "../curves";
import { fileDrop, h } from "../dom";
import { Chart, type Axes } from "../draw/chart";
import { MOST_HELD, type HeldCurves } from "../held";
import type { Page } from "../page";
import { MeasuredPanel } from "../spectra/measured";
import { numbers } from "../spectra/numbers";

/// Returns what reads a measured file.
export function mount(root: HTMLElement, page: Page, held: HeldCurves): (file: File) => void {
  const { state } = page;
  const range = choice({
    label: "Wavelengths",
    help: "Which wavelengths are simulated. Fewer answer faster; colours need the visible ones only.",
    choices: [
      ["visible", "visible, 400–700 nm"],
      ["full", "350–2500 nm"],
      ["sample", "those of the sample"],
    ],
    get: () => state.get().range,
    set: (value) => state.set({ range: value as "visible" | "full" | "sample" }),
  });
  const scale = segments({
    label: "Scale of the values",
    help: "A logarithmic scale shows small transmittances.",
    choices: [
      ["linear", "Linear"],
      ["log", "Log"],
    ],
    get: () => state.get().scale,
    set: (value) => state.set({ scale: value as "linear" | "log" }),
  });
  const hold = h("button", { type: "button", id: "hold", title: "Keeps this curve, dashed, to compare with" }, "Hold this curve");
  hold.addEventListener("click", () => held.hold());

  let readAt: number | null = null;
  const readout = h("output", { class: "readout" });
  const reader = h("input", { type: "range", min: 400, max: 700, step: 10, "aria-label": "Read the values at this wavelength, nm", title: "Read the values at a wavelength" });
  reader.addEventListener("input", () => {
    readAt = Number(reader.value);
    read();
  });
  const chart = new Chart("Spectra", (width) => Math.round(Math.max(260, Math.min(width * 0.62, Math.max(360, window.innerHeight - 400)))));
  chart.onCursor = (nm) => {
    if (nm === null) return;
    readAt = nm;
    read();
  };

  function read(): void {
    const spectrum = page.shown.value?.spectrum;
    if (!spectrum) return;
    const x = spectrum.wavelengths_nm;
    const wanted = readAt ?? x[Math.floor(x.length / 2)]!;
    let at = 0;
    x.forEach((nm, i) => {
      if (Math.abs(nm - wanted) < Math.abs(x[at]! - wanted)) at = i;
    });
    Object.assign(reader, { min: String(x[0]), max: String(x[x.length - 1]), step: "any", value: String(x[at]) });
    reader.setAttribute("aria-valuetext", `${text(x[at]!)} nm`);
    readout.replaceChildren(
      h("strong", null, `${text(x[at]!)} nm`),
      ...QUANTITIES.map((quantity) => {
        const [value, half] = [spectrum[quantity][at]!, bandOf(spectrum, quantity)[at]!];
        return h("span", { class: `mark ${quantity}` }, `${NAMES[quantity]} ${withError(value, half)}`);
      }),
    );
  }

  const toggles = h(
    "div",
    { class: "legend", role: "group", "aria-label": "Curves" },
    ...QUANTITIES.map((quantity) => {
      const input = h("input", { type: "checkbox" });
      const refresh = () => {
        input.checked = state.get().shown[quantity];
      };
      input.addEventListener("change", () => state.set({ shown: { ...state.get().shown, [quantity]: input.checked } }));
      state.subscribe(refresh);
      refresh();
      return h("label", { class: `mark ${quantity}`, title: meaning[quantity] }, input, NAMES[quantity]);
    }),
    h("span", { class: "muted" }, "Bands: ±2 standard errors, with the error of the method"),
  );
  const heldList = h("div", { class: "held" });
  const measured = new MeasuredPanel(page);
  const open = (file: File) => void measured.open(file);
  const drop = fileDrop(root, "Measured file…", ".csv,.txt,.tsv,.sig,.sed,.asc,.dat", open);
  drop.title = "A spectrum of an instrument (CSV, ASD, SVC, Spectral Evolution, ECOSTRESS); it can also be dropped on this panel. It stays in this browser.";

  root.append(
    h("h2", null, "Spectra"),
    h("div", { class: "bar" }, range.element, scale.element, hold, drop),
    chart.element,
    toggles,
    h("div", { class: "reader" }, h("label", null, "Read at", reader), readout),
    heldList,
    measured.element,
    numbers(page),
  );

  const draw = () => {
    if (root.hidden) return;
    chart.set(curvesOf(page, held, measured), axesOf(page));
  };
  const refresh = () => {
    range.refresh();
    scale.refresh();
    const { held: list } = state.get();
    hold.disabled = list.length >= MOST_HELD || !page.shown.value;
    heldList.replaceChildren(
      ...list.map((one, index) =>
        h(
          "span",
          { class: "chip" },
          h("span", { class: `dash dash${index % DASHES.length}` }),
          one.name,
          h("button", { type: "button", class: "small", title: "Puts this snow back into the controls", onclick: () => state.set({ sample: one.sample, files: one.files, layer: Math.min(state.get().layer, one.sample.layer.length - 1) }) }, "Use"),
          h("button", { type: "button", class: "small", "aria-label": `Remove ${one.name}`, onclick: () => state.set({ held: state.get().held.filter((h) => h !== one) }) }, "×"),
        ),
      ),
    );
    draw();
  };
  state.subscribe((_, changed) => {
    if (["range", "scale", "shown", "held", "measured", "panel"].some((key) => changed.has(key as never))) refresh();
  });
  page.shown.subscribe(() => {
    hold.disabled = state.get().held.length >= MOST_HELD || !page.shown.value;
    draw();
    read();
  });
  held.curves.subscribe(draw);
  measured.answer.subscribe(draw);
  refresh();
  return open;
}

const meaning = {
  reflectance: "Share of the light that leaves the snow at its surface.",
  transmittance: "Share of the light that leaves the snow at its lower side.",
  absorptance: "Share of the light that is absorbed by ice, water, carbon and the substrate's losses.",
};

/// All curves of the chart.
export function curvesOf(page: Page, held: HeldCurves, measured: MeasuredPanel | null): Curve[] {
  const { shown } = page.state.get();
  const wanted = QUANTITIES.filter((quantity) => shown[quantity]);
  const curves: Curve[] = [];
  const spectrum = page.shown.value?.spectrum;
  if (spectrum) curves.push(...wanted.map((quantity) => curveOf(spectrum, quantity)));
  held.curves.value.forEach(({ held: { name }, spectrum: own }, index) => {
    if (!own) return;
    for (const quantity of wanted) {
      const { band: _, ...curve } = curveOf(own, quantity);
      curves.push({ ...curve, name: `${name}, ${NAMES[quantity].toLowerCase()}`, dash: DASHES[index % DASHES.length]! });
    }
  });
  const answer = measured?.answer.value;
  if (answer) curves.push({ name: "Measured", x: answer.wavelengths_nm, y: answer.values, colour: "--measured", style: "points" });
  return curves;
}

export function axesOf(page: Page): Axes {
  const { scale, shown } = page.state.get();
  const whole = shown.reflectance || shown.absorptance;
  return { x: "wavelength, nm", y: "share of the incident light", ...(scale === "log" ? { log: true } : { low: 0 }), ...(whole ? { high: 1 } : {}) };
}

function withError(value: number, half: number): string {
  if (half > 0 && half < 1e-5) return `${value.toExponential(2)} ± ${half.toExponential(0)}`;
  if (half === 0) return `${Number(value.toPrecision(3))}`;
  const digits = Math.max(0, Math.min(6, 1 - Math.floor(Math.log10(half))));
  return `${value.toFixed(digits)} ± ${half.toFixed(digits)}`;
}

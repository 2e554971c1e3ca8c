// On narrow screens, above the controls of the snow: a small chart and two colours, so that
// the answer is seen while a control is dragged.
import { visibleSpectrum } from "./colour/spectrum";
import { QUANTITIES } from "./curves";
import { colour, fitCanvas, h, onTheme } from "./dom";
import type { Page } from "./page";

const HEIGHT = 76;

export function mountStrip(root: HTMLElement, page: Page): void {
  const canvas = h("canvas");
  const colours = ["T", "R"].map((name) => h("span", { class: "patch" }, name));
  root.append(canvas, h("div", { class: "patches" }, ...colours));
  const seen = () => root.clientHeight > 0;
  const visible = visibleSpectrum(page, seen);

  const draw = () => {
    const spectrum = page.shown.value?.spectrum;
    if (!seen() || !spectrum) return;
    const width = canvas.clientWidth;
    const context = fitCanvas(canvas, width, HEIGHT);
    const x = spectrum.wavelengths_nm;
    const [first, last] = [x[0]!, x[x.length - 1]!];
    context.strokeStyle = colour("--grid");
    context.strokeRect(0.5, 0.5, width - 1, HEIGHT - 15);
    context.lineWidth = 2;
    for (const quantity of QUANTITIES) {
      if (!page.state.get().shown[quantity]) continue;
      context.strokeStyle = colour(`--${quantity}`);
      context.beginPath();
      spectrum[quantity].forEach((y, i) => context.lineTo(((x[i]! - first) / (last - first || 1)) * width, 2 + (1 - y) * (HEIGHT - 18)));
      context.stroke();
    }
    context.fillStyle = colour("--muted");
    context.font = `11px ${getComputedStyle(document.body).fontFamily}`;
    context.fillText(`${first} nm`, 0, HEIGHT - 2);
    context.textAlign = "right";
    context.fillText(`${last} nm`, width, HEIGHT - 2);
  };
  visible.spectrum.subscribe((spectrum) => {
    if (!spectrum || !seen()) return;
    const { wavelengths_nm, transmittance, reflectance } = spectrum;
    const spectra = [transmittance, reflectance];
    const exposure = 2 ** page.state.get().exposure_stops;
    page.engine.askLatest("strip", { ask: "colour", wavelengths_nm, spectra, light: "D65", exposure }).then(
      (answer) =>
        answer?.srgb.forEach((srgb, i) => {
          colours[i]!.style.backgroundColor = `rgb(${srgb.join(" ")})`;
          colours[i]!.style.color = srgb[1]! > 120 ? "#000" : "#fff";
        }),
      () => undefined,
    );
  });
  page.shown.subscribe(draw);
  onTheme(draw);
  new ResizeObserver(() => {
    draw();
    visible.update();
  }).observe(root);
}

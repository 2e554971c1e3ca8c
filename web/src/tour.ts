// A tour of one minute: a few steps, each beside what it is about.
import { h } from "./dom";
import type { PanelName, Page } from "./page";

const STEPS: { panel: PanelName; target: string; title: string; text: string }[] = [
  { panel: "snow", target: "#panel-snow .stack", title: "Build a snowpack", text: "Each box is a layer, the surface on top. Drag a layer by its handle to move it. Click it to change its thickness, density and grains below." },
  { panel: "snow", target: "#preset", title: "Or start from a sample", text: "Ready samples of the literature: fresh snow, a wet crust, sooty snow on grass. The ? beside a control says what it is." },
  { panel: "spectra", target: "#panel-spectra .chart", title: "Read the spectra", text: "Reflectance, transmittance and absorptance follow while you drag. Wide bands are coarse answers; they narrow when you stop." },
  { panel: "spectra", target: "#panel-spectra .bar", title: "Compare", text: "Hold a curve and change the snow, or drop a measured file: the page shows residuals and the error of each band." },
  { panel: "colour", target: "#panel-colour", title: "See the colours", text: "Light that falls through the snow, and light that it reflects, under several lights, and a wedge up to 60 cm thick." },
  { panel: "take", target: "#panel-take", title: "Take it with you", text: "A link holds everything. The sample file gives the same numbers in the program." },
];

export function startTour(page: Page): void {
  const before = page.state.get().panel;
  let step = 0;
  let marked: Element | null = null;
  const title = h("h2", { id: "tour-title" });
  const text = h("p");
  const count = h("span", { class: "muted" });
  const back = h("button", { type: "button" }, "Back");
  const next = h("button", { type: "button", class: "primary" }, "Next");
  const skip = h("button", { type: "button" }, "Skip");
  const dialog = h("dialog", { class: "tour", "aria-labelledby": "tour-title" }, title, text, h("div", { class: "bar" }, count, skip, back, next));

  const show = () => {
    const { panel, target, title: name, text: words } = STEPS[step]!;
    page.state.set({ panel });
    marked?.classList.remove("marked");
    marked = document.querySelector(target);
    marked?.classList.add("marked");
    marked?.scrollIntoView({ block: "center", behavior: matchMedia("(prefers-reduced-motion: reduce)").matches ? "auto" : "smooth" });
    title.textContent = name;
    text.textContent = words;
    count.textContent = `${step + 1} of ${STEPS.length}`;
    back.disabled = step === 0;
    next.textContent = step === STEPS.length - 1 ? "Done" : "Next";
    skip.hidden = step === STEPS.length - 1;
  };
  back.addEventListener("click", () => {
    step--;
    show();
  });
  next.addEventListener("click", () => {
    if (++step >= STEPS.length) return dialog.close();
    show();
  });
  skip.addEventListener("click", () => dialog.close());
  dialog.addEventListener("close", () => {
    marked?.classList.remove("marked");
    dialog.remove();
    page.state.set({ panel: before });
    document.getElementById("tour")?.focus();
  });
  document.body.append(dialog);
  dialog.showModal();
  show();
  next.focus();
}

// The panel "Take away": a link, files, and the command that gives the same numbers.
import { download, h } from "../dom";
import { isServed } from "../engine/server";
import { toLink } from "../fragment";
import type { HeldCurves } from "../held";
import type { Spectrum } from "../messages";
import { RAYS, type Page } from "../page";
import { pngOf, svgOf } from "../svg";
import { axesOf, curvesOf } from "./spectra";

/// Colours on white paper (Okabe and Ito).
const PAPER: Record<string, string> = {
  "--reflectance": "#0072b2",
  "--transmittance": "#d55e00",
  "--absorptance": "#00795a",
  "--measured": "#8a3f78",
};

/// Parts of the state that a link may have to leave out.
const OMITTED = { measured: "the measured file", held: "the held curves", files: "the files of the sample" } as const;

export function mount(root: HTMLElement, page: Page, held: HeldCurves): void {
  const { state } = page;
  const link = h("input", { type: "text", readOnly: true, id: "link", "aria-label": "Link to this state" });
  const without = h("p", { role: "status", hidden: true });
  const toml = h("pre", { tabIndex: 0, "aria-label": "Sample file" });
  const command = h("pre", { tabIndex: 0, "aria-label": "Command" });
  const button = (label: string, title: string, onclick: () => void) => h("button", { type: "button", title, onclick }, label);
  const copy = (label: string, from: () => string) =>
    button(label, "Copies it to the clipboard", () => {
      navigator.clipboard.writeText(from()).then(
        () => page.say("Copied."),
        () => page.say("The browser did not allow copying: select the text and copy it."),
      );
    });
  const picture = (): string | null => {
    const shown = page.shown.value;
    if (!shown) return null;
    const caption = `SPLITSnow ${page.about.value?.version ?? ""}, engine ${shown.spectrum.engine}, ${shown.spectrum.rays} walks, seed ${shown.spectrum.seed}. Bands: 2 standard errors, with the error of the method.`;
    return svgOf(curvesOf(page, held, null), axesOf(page), "Share of the incident light", caption, (name) => PAPER[name] ?? "#1b1f24");
  };
  const files = h(
    "div",
    { class: "bar" },
    button("Sample file (TOML)", "The sample as `splitsnow simulate` reads it", () => {
      const text = toml.textContent ?? "";
      if (text) download("sample.toml", text, "application/toml");
      for (const [name, content] of Object.entries(state.get().files)) download(name.split("/").pop()!, content);
    }),
    button("Spectrum (CSV)", "Wavelength, reflectance, transmittance, absorptance, with standard errors", () => {
      const spectrum = page.shown.value?.spectrum;
      if (spectrum) download("spectrum.csv", csvOf(spectrum, page.about.value?.version ?? ""), "text/csv");
    }),
    button("Picture (PNG)", "The chart of the spectra on white", () => {
      const svg = picture();
      if (svg) pngOf(svg).then((png) => download("spectrum.png", png), () => page.say("The browser could not draw the picture."));
    }),
    button("Drawing (SVG)", "The chart of the spectra on white, as lines", () => {
      const svg = picture();
      if (svg) download("spectrum.svg", svg, "image/svg+xml");
    }),
  );
  root.append(
    h("h2", null, "Take away"),
    h("h3", null, "A link to all this"),
    h("p", { class: "muted" }, isServed()
      ? "The address of this page is of this computer and works for nobody else. What follows holds the whole state: put it behind the address of any copy of the page."
      : "The whole state is in the link; nothing is stored anywhere else."),
    h("div", { class: "bar" }, link, copy("Copy", () => link.value)),
    without,
    h("h3", null, "Files"),
    files,
    h("h3", null, "The same numbers from the program"),
    h("p", { class: "muted" }, "Save the sample file, then run:"),
    command,
    h("div", { class: "bar" }, copy("Copy the command", () => command.textContent ?? "")),
    h("h3", null, "sample.toml"),
    toml,
    h("div", { class: "bar" }, copy("Copy the file", () => toml.textContent ?? "")),
  );

  const refresh = async () => {
    if (root.hidden) return;
    const now = state.get();
    const { fragment, omitted } = await toLink(now);
    link.value = isServed() ? fragment || "#" : `${location.origin}${location.pathname}${fragment}`;
    without.hidden = omitted.length === 0;
    without.textContent = `Too much for a link: it is without ${omitted.map((key) => OMITTED[key]).join(" and ")}.`;
    const rays = RAYS[RAYS.length - 1]!;
    const engine = page.shown.value?.spectrum.engine;
    command.textContent = `splitsnow simulate sample.toml${engine ? ` --engine ${engine}` : ""} --rays ${rays} --seed ${now.seed} > spectrum.csv`;
    const shown = page.shown.value;
    if (!shown) return;
    // The file has the wavelengths of the page, so that it gives the numbers of the page.
    try {
      const answer = await page.engine.askLatest("toml", { ask: "sample", sample: shown.sample, files: now.files });
      if (answer) toml.textContent = answer.toml;
    } catch {
      toml.textContent = "";
    }
  };
  state.subscribe(() => void refresh());
  page.shown.subscribe(() => void refresh());
}

export function csvOf(spectrum: Spectrum, version: string): string {
  const lines = [
    `# splitsnow ${version}, page`,
    `# engine: ${spectrum.engine}`,
    `# rays: ${spectrum.rays}`,
    `# seed: ${spectrum.seed}`,
    `# method_error: ${Math.max(...spectrum.method_error)} at most, of reflectance and transmittance`,
    "wavelength_nm,reflectance,reflectance_se,transmittance,transmittance_se,absorptance,absorptance_se",
  ];
  const { wavelengths_nm, reflectance, reflectance_se, transmittance, transmittance_se, absorptance, absorptance_se } = spectrum;
  wavelengths_nm.forEach((nm, i) => {
    lines.push([nm, reflectance[i], reflectance_se[i], transmittance[i], transmittance_se[i], absorptance[i], absorptance_se[i]].join(","));
  });
  return `${lines.join("\n")}\n`;
}

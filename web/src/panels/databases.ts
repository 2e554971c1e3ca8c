// The panel of databases: look-ups in compact files, and what the files say about themselves.

import "./databases.css";
import type { CompactFile, Light, LookupAnswer, Spectrum } from "../messages";
import { messageOf, namedMessage, RAYS, Refused, REST_MS, type Page } from "../page";
import { h, isCompact, newId } from "../dom";
import { NumberField } from "../number";
import dome from "../../../examples/mitsuba/dome.safetensors?url";
import snow from "../../../examples/mitsuba/snow.safetensors?url";
import snows from "../../../examples/mitsuba/snows.safetensors?url";
import sooty from "../../../examples/mitsuba/sooty.safetensors?url";
import { Chart, type Curve } from "../draw/chart";
import { bytes as bytesText, grouped, number } from "../draw/ticks";
import {
  amongNodes, axisName, axisTicks, boundsWords, brightening, capital, certificate, certificateSource,
  certificateWords, cssColour, deltaE, errorTable, fromShare, holdsFactors, provenance,
  quantityName, rmse, rootMeanSquare, size, startPoint, toShare, unitText, valueText, type Axis,
} from "./databases-data";

/// Files that come with the page.
const EXAMPLES = [
  { file: "snow.safetensors", url: snow, title: "One snow, 5 to 35 cm" },
  { file: "snows.safetensors", url: snows, title: "Snows by grain size and density" },
  { file: "sooty.safetensors", url: sooty, title: "Sooty snow" },
  { file: "dome.safetensors", url: dome, title: "Snow of an igloo" },
] as const;

/// Larger files are not read: they would not fit the memory of the engine.
const MOST_BYTES = 256e6;

interface Open {
  file: CompactFile;
  bytes: Uint8Array;
  point: Record<string, number>;
  /// Whether a look-up has succeeded since the engine read the file. The engine keeps few files,
  /// and none when it is started again; it then gets the bytes again.
  known: boolean;
}

type Quantity = "reflectance" | "transmittance";
const QUANTITIES: readonly Quantity[] = ["reflectance", "transmittance"];

interface Swatch {
  name: string;
  xyz: number[];
  lab: number[];
  linear: number[];
  clipped: boolean;
}

/// Returns what opens compact files and shows them.
export function mount(root: HTMLElement, page: Page): (files: File[]) => void {
  root.classList.add("databases");
  const files: Open[] = [];
  let current: Open | null = null;
  let answer: LookupAnswer | null = null;
  let simulated: Spectrum | null = null;
  /// What this panel wrote into the state last.
  let written: Record<string, unknown> | null = null;
  let started = false;
  let simulation = 0;

  const stored = (key: string): unknown => page.state.get().databases[key];
  const store = (merge?: string) => {
    written = {
      ...(current ? { file: current.file.name, point: current.point } : {}),
      light: lightSelect.value || "D65",
    };
    page.state.set({ databases: written }, merge);
  };

  // ---- choosing a file

  const alert = h("p", { class: "problem", role: "alert", hidden: true });
  const input = h("input", { type: "file", accept: ".safetensors", multiple: true, class: "visually-hidden", tabIndex: -1, "aria-label": "Compact file" });
  input.addEventListener("change", () => {
    void openAll([...(input.files ?? [])]);
    input.value = "";
  });
  const examples = EXAMPLES.map(({ file, title }) =>
    h("button", { type: "button", onclick: () => void openExample(file) }, title));
  const fileSelectId = newId("file");
  const fileSelect = h("select", { id: fileSelectId });
  fileSelect.addEventListener("change", () => {
    const chosen = files[Number(fileSelect.value)];
    if (chosen) select(chosen);
  });
  const closeButton = h("button", { type: "button", onclick: () => close() }, "Close file");
  const chooser = h("div", { class: "chooser", hidden: true },
    h("label", { for: fileSelectId }, "File"), fileSelect, closeButton);
  const intro = h("p", { class: "note" },
    "A compact file (.safetensors) holds the spectra of many snows in a few kilobytes. Drop one here, open one, or take an example. The file stays on this computer.");
  const limit = h("p", { class: "note", hidden: true });
  page.about.subscribe(() => {
    const most = page.engine.mostBytes;
    limit.hidden = most === undefined;
    if (most !== undefined) limit.textContent = `\`splitsnow serve\` takes files of up to ${bytesText(most)}; a copy of the page on a web server takes ${bytesText(MOST_BYTES)}.`;
  });
  const opener = h("div", { class: "opener" },
    h("button", { type: "button", class: "primary", onclick: () => input.click() }, "Open a file"), input,
    h("span", { class: "or" }, "Examples:"), ...examples);
  const body = h("div", { class: "body", hidden: true });
  root.append(h("h2", null, "Databases"), intro, limit, opener, alert, chooser, body);

  root.addEventListener("dragover", (event) => {
    if (!event.dataTransfer?.types.includes("Files")) return;
    event.preventDefault();
    root.classList.add("dropping");
  });
  root.addEventListener("dragleave", (event) => {
    if (!root.contains(event.relatedTarget as Node | null)) root.classList.remove("dropping");
  });
  root.addEventListener("drop", (event) => {
    root.classList.remove("dropping");
    const dropped = [...(event.dataTransfer?.files ?? [])].filter(isCompact);
    if (!dropped.length) return;
    event.preventDefault();
    void openAll(dropped);
  });

  const complain = (text: string | null) => {
    alert.textContent = text ?? "";
    alert.hidden = text === null;
  };

  const openAll = async (list: File[]) => {
    // A file that opens clears the message of an earlier one, but not of one that came with it.
    const wrong: string[] = [];
    for (const file of list) {
      try {
        const most = Math.min(MOST_BYTES, page.engine.mostBytes ?? MOST_BYTES);
        if (file.size > most) {
          const elsewhere = most < MOST_BYTES ? `; a copy of the page on a web server reads ${bytesText(MOST_BYTES)}` : "";
          throw new Error(`${bytesText(file.size)} is more than this page reads (${bytesText(most)}${elsewhere})`);
        }
        await open(file.name, new Uint8Array(await file.arrayBuffer()));
      } catch (error) {
        wrong.push(namedMessage(file.name, error));
      }
    }
    if (wrong.length > 0) complain(wrong.join("\n"));
  };
  const openExample = async (name: string, point?: Record<string, unknown>, quietly = false) => {
    const example = EXAMPLES.find((other) => other.file === name);
    if (!example) return;
    const known = files.find((open) => open.file.name === name);
    if (known) return select(known);
    try {
      const response = await fetch(example.url);
      if (!response.ok) throw new Error(`the example cannot be loaded (${response.status})`);
      await open(name, new Uint8Array(await response.arrayBuffer()), point, quietly);
    } catch (error) {
      complain(namedMessage(name, error));
    }
  };
  const open = async (name: string, bytes: Uint8Array, point?: Record<string, unknown>, quietly = false) => {
    const file = await page.engine.ask({ ask: "open", name }, bytes);
    const opened = { file, bytes, point: startPoint(file.axes, point), known: false };
    // The same file again takes the place of the first.
    const before = files.findIndex((other) => other.file.name === file.name && same(other.bytes, bytes));
    if (before >= 0) files[before] = opened;
    else files.push(opened);
    select(opened, quietly);
  };
  const close = () => {
    const at = files.indexOf(current!);
    if (at < 0) return;
    files.splice(at, 1);
    const next = files[Math.min(at, files.length - 1)];
    if (next) return select(next);
    current = null;
    body.hidden = chooser.hidden = true;
    complain(null);
    store();
  };
  const select = (open: Open, quietly = false) => {
    current = open;
    complain(null);
    fileSelect.replaceChildren(...files.map((other, i) =>
      h("option", { value: String(i), selected: other === open }, `${other.file.name}, ${bytesText(other.file.bytes)}`)));
    chooser.hidden = body.hidden = false;
    describe(open);
    if (!quietly) store();
    void look();
  };

  // ---- the parts of the body

  const axesHost = h("div", { class: "axes" });
  const lookProblem = h("p", { class: "problem", role: "status", hidden: true });
  const swatchHost = h("div", { class: "swatches" });
  const lightId = newId("light");
  const lightSelect = h("select", { id: lightId });
  lightSelect.addEventListener("change", () => {
    store();
    void colour();
  });
  const lightRow = h("div", { class: "light" }, h("label", { for: lightId }, "Light"), lightSelect);
  const charts = Object.fromEntries(QUANTITIES.map((quantity) => {
    const host = h("div", { class: "spectrum" });
    const caption = h("figcaption");
    const read = h("output", { class: "read" });
    const chart = new Chart(host, `Spectrum of ${quantity}`, 220);
    chart.onCursor = (nm) => {
      read.textContent = nm === null ? "" : reading(quantity, nm);
    };
    return [quantity, { chart, caption, read, figure: h("figure", null, caption, host, read) }];
  })) as Record<Quantity, { chart: Chart; caption: HTMLElement; read: HTMLOutputElement; figure: HTMLElement }>;
  const simulateButton = h("button", { type: "button", class: "primary", onclick: () => void simulate() }, "Simulate here");
  const simulateStatus = h("p", { role: "status", class: "note" });
  const difference = h("div", { class: "difference" });
  const about = h("div", { class: "about" });
  body.append(
    h("div", { class: "columns" },
      h("section", null, h("h3", null, "Snow"), axesHost),
      h("section", null, h("h3", null, "Colour"), lightRow, swatchHost)),
    lookProblem,
    h("div", { class: "figures" }, ...QUANTITIES.map((quantity) => charts[quantity].figure)),
    h("section", { class: "simulate" }, h("div", { class: "row" }, simulateButton, simulateStatus), difference),
    about);

  const light = (): Light => {
    const dropped = page.state.get().droppedLight;
    return dropped && lightSelect.value === dropped.name ? dropped : lightSelect.value || "D65";
  };
  const listLights = () => {
    const dropped = page.state.get().droppedLight;
    const names = [...(page.about.value?.illuminants ?? ["D65"]), ...(dropped ? [dropped.name] : [])];
    const wished = lightSelect.value || stored("light");
    lightSelect.replaceChildren(...names.map((name) => h("option", { value: name }, name)));
    lightSelect.value = typeof wished === "string" && names.includes(wished) ? wished : "D65";
  };
  page.about.subscribe(listLights);

  let refreshAxes = () => {};
  const describe = (open: Open) => {
    const { file } = open;
    axesHost.replaceChildren();
    const refreshes: (() => void)[] = [];
    for (const axis of file.axes) {
      if (axis.values.length < 2) {
        axesHost.append(h("p", { class: "single" }, h("span", null, axisName(axis.name)), ` ${valueText(axis, axis.values[0] ?? Number.NaN)}`));
        continue;
      }
      const control = axisControl(axis, () => open.point[axis.name]!, (value) => {
        open.point = { ...open.point, [axis.name]: value };
        store(`databases-${axis.name}`);
        void look();
      });
      refreshes.push(control.refresh);
      axesHost.append(control.element);
    }
    refreshAxes = () => refreshes.forEach((refresh) => refresh());
    lightRow.parentElement!.hidden = holdsFactors(file.metadata);
    about.replaceChildren(...aboutFile(file));
  };

  // ---- looking up

  const look = async () => {
    if (!current) return;
    const open = current;
    simulation += 1;
    simulated = null;
    difference.replaceChildren();
    simulateStatus.textContent = "";
    try {
      const ask = () =>
        page.engine.askLatest("databases-lookup", { ask: "lookup", id: open.file.id, point: open.point });
      const got = await ask().catch(async (error: unknown) => {
        if (!open.known || !(error instanceof Refused)) throw error;
        open.known = false;
        open.file = await page.engine.ask({ ask: "open", name: open.file.name }, open.bytes);
        return ask();
      });
      if (!got || open !== current) return;
      open.known = true;
      answer = got;
      lookProblem.hidden = true;
      body.classList.remove("stale");
    } catch (error) {
      if (open !== current) return;
      lookProblem.textContent = messageOf(error);
      lookProblem.hidden = false;
      body.classList.add("stale");
      answer = null;
    }
    simulateButton.disabled = !answer?.sample;
    if (answer && !answer.sample) {
      simulateStatus.textContent = "This file does not say enough about the snow to simulate it.";
    }
    plot();
    void colour();
  };

  const plot = () => {
    if (!answer || !current) return;
    const { metadata } = current.file;
    for (const quantity of QUANTITIES) {
      const { chart, caption, figure, read } = charts[quantity];
      const values = answer[quantity];
      figure.hidden = values === null;
      if (!values) continue;
      const name = quantityName(metadata, quantity);
      caption.textContent = "Line: look-up. Dashed: simulation, with a band of one standard error.";
      caption.hidden = !simulated;
      read.textContent = "";
      chart.set(curves(quantity), {
        x: "wavelength, nm", y: `${name}, unit 1`,
        xRange: [answer.wavelengths_nm[0]!, answer.wavelengths_nm.at(-1)!],
      });
    }
  };
  const curves = (quantity: Quantity): Curve[] => {
    const x = answer!.wavelengths_nm;
    const list: Curve[] = [];
    if (simulated) {
      list.push({ name: "simulation", colour: "--ink", x: simulated.wavelengths_nm, y: simulated[quantity], se: simulated[`${quantity}_se`], dash: [6, 4] });
    }
    list.unshift({ name: "look-up", colour: `--${quantity}`, x, y: answer![quantity]!, dots: x.length <= 40 });
    return list;
  };
  const reading = (quantity: Quantity, nm: number): string => {
    const i = answer?.wavelengths_nm.indexOf(nm) ?? -1;
    const value = answer?.[quantity]?.[i];
    if (value === undefined) return "";
    const there = simulated?.[quantity][i];
    const beside = there === undefined
      ? ""
      : `; simulation ${number(there, 4)}, standard error ${number(simulated![`${quantity}_se`][i]!, 2)}`;
    return `${number(nm, 4)} nm: ${number(value, 4)}${beside}`;
  };

  // ---- colours

  const colour = async () => {
    if (!answer || !current || holdsFactors(current.file.metadata)) return;
    const [mine, together] = [answer, simulated];
    const names: string[] = [];
    const spectra: number[][] = [];
    for (const quantity of QUANTITIES) {
      const values = mine[quantity];
      if (!values) continue;
      names.push(quantity === "reflectance" ? "reflected" : "transmitted");
      spectra.push(values);
      if (!together) continue;
      names.push(`${names.at(-1)!}, simulated`);
      spectra.push(together[quantity]);
    }
    try {
      const got = await page.engine.askLatest("databases-colour", { ask: "colour", wavelengths_nm: mine.wavelengths_nm, spectra, light: light() });
      if (!got || mine !== answer || together !== simulated) return;
      const swatches = names.map((name, i) => ({
        name, xyz: got.xyz[i]!, lab: got.lab[i]!, linear: got.linear[i]!, clipped: got.clipped[i]!,
      }));
      swatchHost.replaceChildren(...swatches.map(swatchElement));
      if (together) compare(together, swatches);
    } catch (error) {
      if (mine !== answer) return;
      swatchHost.replaceChildren(h("p", { class: "note" }, `No colour: ${messageOf(error)}`));
      if (together) compare(together, []);
    }
  };

  // ---- simulating the snow of the point

  const simulate = async () => {
    const [mine, open] = [answer, current];
    if (!mine?.sample || !open) return;
    simulation += 1;
    const turn = simulation;
    const sample = { ...mine.sample, wavelengths: { values_nm: mine.wavelengths_nm } };
    for (const [stage, rays] of RAYS.entries()) {
      if (stage === 1) await new Promise((resolve) => setTimeout(resolve, REST_MS));
      if (turn !== simulation) return;
      simulateStatus.textContent = `Simulating with ${grouped(rays)} walks per refractive index.`;
      const began = performance.now();
      try {
        const got = await page.engine.askLatest("databases-simulate", { ask: "simulate", sample, rays, seed: page.state.get().seed });
        if (turn !== simulation) return;
        if (!got) {
          simulateStatus.textContent = "";
          return;
        }
        simulated = got;
        plot();
        await colour();
        if (turn !== simulation) return;
        const seconds = number((performance.now() - began) / 1000, 2);
        simulateStatus.textContent = `${grouped(rays)} walks per refractive index in ${seconds} s, engine ${got.engine}.`;
      } catch (error) {
        if (turn !== simulation) return;
        simulateStatus.textContent = `Not simulated: ${messageOf(error)}`;
        return;
      }
    }
  };
  const compare = (together: Spectrum, swatches: Swatch[]) => {
    const rows: HTMLElement[] = [];
    for (const quantity of QUANTITIES) {
      const values = answer?.[quantity];
      if (!values) continue;
      const name = quantity === "reflectance" ? "reflected" : "transmitted";
      const [here, there] = [name, `${name}, simulated`].map((wanted) => swatches.find((s) => s.name === wanted));
      rows.push(h("tr", null,
        h("th", { scope: "row" }, capital(quantity)),
        h("td", null, here && there ? number(deltaE(here.lab, there.lab), 2) : "-"),
        h("td", null, number(rmse(values, together[quantity]), 2)),
        h("td", null, number(rootMeanSquare(together[`${quantity}_se`]), 2))));
    }
    difference.replaceChildren(
      table(`Look-up against simulation, light ${lightSelect.value}`, ["Quantity", "Delta-E (CIE 1976)", "RMSE", "Standard error"], rows),
      h("p", { class: "note" }, "The RMSE and the standard error (root mean square) are over the wavelengths of the file. An RMSE of the size of the standard error is the noise of this simulation."));
  };

  // ---- what a link or undo asks for

  const follow = () => {
    const { file, point, light: wishedLight } = page.state.get().databases;
    if (typeof wishedLight === "string" && [...lightSelect.options].some((option) => option.value === wishedLight)) {
      lightSelect.value = wishedLight;
    }
    const wished = typeof point === "object" && point !== null ? (point as Record<string, unknown>) : {};
    const name = typeof file === "string" && file ? file : EXAMPLES[0].file;
    const known = files.find((open) => open.file.name === name);
    if (known) {
      known.point = startPoint(known.file.axes, wished);
      if (known !== current) return select(known, true);
      refreshAxes();
      return void look();
    }
    if (EXAMPLES.some((example) => example.file === name)) return void openExample(name, wished, true);
    const missing = `The link shows the file ${name}, which a link does not hold. Open it here.`;
    if (current) return complain(missing);
    void openExample(EXAMPLES[0].file, {}, true).then(() => complain(missing));
  };
  const start = () => {
    if (started || page.state.get().panel !== "databases") return;
    started = true;
    follow();
  };
  page.state.subscribe((state, changed) => {
    start();
    if (changed.has("droppedLight")) listLights();
    if (started && changed.has("databases") && state.databases !== written) follow();
  });
  start();
  return (dropped) => {
    // No example comes between.
    started = true;
    page.state.set({ panel: "databases" });
    void openAll(dropped);
  };
}

function same(a: Uint8Array, b: Uint8Array): boolean {
  return a.length === b.length && a.every((byte, i) => byte === b[i]);
}

/// A slider with its nodes, a field for exact numbers, and where the value lies.
function axisControl(axis: Axis, get: () => number, set: (value: number) => void): { element: HTMLElement; refresh(): void } {
  const steps = 1000;
  const [listId, whereId] = [newId("nodes"), newId("where")];
  const unit = unitText(axis.unit);
  const slider = h("input", { type: "range", min: "0", max: String(steps), step: "1", "aria-label": `${axisName(axis.name)}, ${unit}`, "aria-describedby": whereId });
  slider.setAttribute("list", listId);
  const shares = axisTicks(axis);
  const list = h("datalist", { id: listId }, ...shares.map((share) => h("option", { value: String(Math.round(share * steps)) })));
  const marks = h("div", { class: "nodes", "aria-hidden": "true" });
  for (const [i, share] of shares.entries()) {
    const mark = h("button", { type: "button", class: "node", tabIndex: -1, title: `Node: ${valueText(axis, axis.values[i]!)}` });
    mark.style.setProperty("--at", String(share));
    mark.addEventListener("click", () => {
      set(axis.values[i]!);
      refresh();
    });
    marks.append(mark);
  }
  const where = h("small", { id: whereId, class: "where" });
  const move = (value: number) => {
    set(value);
    refresh();
  };
  slider.addEventListener("input", () => move(fromShare(axis, slider.valueAsNumber / steps)));
  slider.addEventListener("keydown", (event) => {
    const now = get();
    const by = { ArrowRight: 0.01, ArrowUp: 0.01, ArrowLeft: -0.01, ArrowDown: -0.01 }[event.key];
    let next: number | undefined;
    if (by !== undefined) next = fromShare(axis, Math.min(1, Math.max(0, toShare(axis, now) + by)));
    // From node to node.
    else if (event.key === "PageUp") next = axis.values.find((node) => node > now);
    else if (event.key === "PageDown") next = axis.values.findLast((node) => node < now);
    else return;
    event.preventDefault();
    if (next !== undefined) move(next);
  });
  const [low, high] = [axis.values[0]!, axis.values.at(-1)!];
  // A hundredth of the range, as a round number.
  const step = 10 ** Math.floor(Math.log10((high - low) / 20));
  const field = new NumberField({ step, low, high, describedBy: whereId, set: move });
  const refresh = () => {
    const value = get();
    slider.value = String(Math.round(toShare(axis, value) * steps));
    field.show(value);
    slider.setAttribute("aria-valuetext", valueText(axis, value));
    where.textContent = amongNodes(axis, value);
  };
  refresh();
  const element = h("div", { class: "axis" },
    h("div", { class: "head" },
      h("label", { for: field.input.id }, axisName(axis.name)),
      h("span", { class: "exact" }, field.input, h("span", { class: "unit" }, unit === "1" ? "(unit 1)" : unit))),
    h("div", { class: "track" }, slider, marks), list, where, field.message);
  return { element, refresh };
}

function swatchElement({ name, xyz, linear, lab, clipped }: Swatch): HTMLElement {
  const factor = brightening(xyz[1]!);
  const patch = h("div", { class: "patch" });
  patch.style.background = cssColour(linear);
  const patches = h("div", { class: "patches" }, patch);
  if (factor > 1) {
    const bright = h("div", { class: "patch" });
    bright.style.background = cssColour(linear, factor);
    patches.append(bright);
  }
  const beyond = linear.some((part) => part < -0.001 || factor * part > 1.001);
  const lines = [
    `Y ${number(xyz[1]!)} of white`,
    `L* ${number(lab[0]!)}, a*\u00a0${number(lab[1]!)}, b*\u00a0${number(lab[2]!)}`,
    ...(factor > 1 ? [`right: brightened ${number(factor)} times`] : []),
    ...(clipped || beyond ? ["outside sRGB: the nearest colour is shown"] : []),
  ];
  return h("figure", { class: "swatch" }, patches,
    h("figcaption", null, h("b", null, capital(name)), ...lines.map((line) => h("span", null, line))));
}

function table(caption: string, heads: string[], rows: HTMLElement[]): HTMLElement {
  return h("div", { class: "scroll" },
    h("table", null, h("caption", null, caption),
      h("thead", null, h("tr", null, ...heads.map((head) => h("th", { scope: "col" }, head)))),
      h("tbody", null, ...rows)));
}

function triples(value: [number, number, number] | null): string[] {
  return value ? value.map((part) => number(part, 2)) : ["-", "-", "-"];
}

/// What a file says about itself.
function aboutFile(file: CompactFile): HTMLElement[] {
  const { metadata } = file;
  const parts: HTMLElement[] = [];

  const certified = certificate(metadata);
  const section = h("section", { class: "certificate" }, h("h3", null, "Certificate"));
  if (certified) {
    section.append(
      h("p", null, certificateSource(certified)),
      h("ul", null, ...certified.quantities.flatMap(certificateWords).map((line) => h("li", null, line))),
      h("p", { class: "note" }, "Delta-E is the distance of two colours in CIELAB. RMSE is the root mean square difference over the wavelengths of a spectrum. Smaller is better; side by side, an eye sees differences from about 2 Delta-E."));
    const bounds = boundsWords(metadata);
    if (bounds.length) section.append(h("ul", null, ...bounds.map((line) => h("li", null, line))));
    for (const quantity of certified.quantities) {
      const rows = [{ name: "Total", meaning: "look-up against simulation", ...quantity.total }, ...quantity.parts];
      section.append(h("details", null, h("summary", null, `${capital(quantity.quantity)}: where the error comes from`),
        table("Mean, 95th percentile and largest",
          ["Part", "Delta-E mean", "95 %", "max", "RMSE mean", "95 %", "max"],
          rows.map((row) => h("tr", null,
            h("th", { scope: "row" }, row.name, h("small", null, row.meaning)),
            ...[...triples(row.delta_e), ...triples(row.rmse)].map((cell) => h("td", null, cell))))),
        quantity.worst.length ? h("p", null, "The worst points:") : null,
        h("ul", null, ...quantity.worst.map(({ at, delta_e, rmse: off }) => h("li", null,
          `${at}: ${[delta_e === null ? "" : `Delta-E ${number(delta_e, 2)}`, off === null ? "" : `RMSE ${number(off, 2)}`].filter(Boolean).join(", ")}`)))));
    }
  } else {
    section.append(h("p", null, "This file has no error budget: nobody has compared it with fresh simulations. `splitsnow verify` does so and writes the result into the file."));
    const bounds = boundsWords(metadata);
    if (bounds.length) section.append(h("ul", null, ...bounds.map((line) => h("li", null, line))));
  }
  parts.push(section);

  const rows = errorTable(metadata);
  if (rows.length) {
    parts.push(h("section", null, h("h3", null, "Compression"),
      table("Errors of the curves on the nodes, by number of components; the file has the rows marked *",
        ["Quantity", "Components", "Delta-E mean", "max", "RMSE mean", "max"],
        rows.map((row) => h("tr", row.chosen ? { class: "chosen" } : null,
          h("th", { scope: "row" }, quantityName(metadata, row.quantity)),
          h("td", null, `${row.components}${row.chosen ? " *" : ""}`),
          ...[row.delta_e, row.rmse].flatMap((errors) => (errors ? [errors.mean, errors.max] : [null, null]))
            .map((value) => h("td", null, value === null ? "-" : number(value, 2))))))));
  }

  const { curves, spectraBytes, metadataBytes } = size(file);
  const [first, last] = [file.wavelengths_nm[0]!, file.wavelengths_nm.at(-1)!];
  const facts: [string, string][] = [
    ["File", `${file.name}, ${bytesText(file.bytes)}, of which ${bytesText(metadataBytes)} describe it`],
    ["Curves", `${grouped(curves)}: every combination of the nodes, for each quantity`],
    ["Wavelengths", `${file.wavelengths_nm.length}, from ${number(first, 4)} to ${number(last, 4)} nm`],
    ...file.quantities.map(({ name, components }): [string, string] =>
      [quantityName(metadata, name), `${components} ${components === 1 ? "component" : "components"}`]),
    ["Basis, precision", `${file.basis}, ${file.precision}`],
    ["Spectra as float32", bytesText(spectraBytes)],
    ...(metadata.between_wavelengths ? [["Between wavelengths", metadata.between_wavelengths] as [string, string]] : []),
  ];
  parts.push(h("section", null, h("h3", null, "Size"), definitions(facts)));

  const origin = provenance(metadata);
  const rest = Object.entries(metadata).filter(([key]) =>
    !["certificate", "error_budget", "error_table", "provenance", "bounds", "scene"].includes(key));
  parts.push(h("section", null, h("h3", null, "Provenance"), definitions(origin),
    metadata.scene ? h("details", null, h("summary", null, "Scene that the file was made for"), h("pre", null, metadata.scene)) : null,
    h("details", null, h("summary", null, "Other metadata"), definitions(rest.map(([key, value]) => [key, value.slice(0, 2000)])))));
  return parts;
}

function definitions(list: readonly [string, string][]): HTMLElement {
  return h("dl", null, ...list.flatMap(([term, text]) => [h("dt", null, term), h("dd", null, text)]));
}

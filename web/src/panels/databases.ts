// The panel of databases: look-ups in compact files, and what the files say about themselves.

import "./databases.css";
import type { CompactFile, Light, LookupAnswer, Spectrum } from "../messages";
import { messageOf, namedMessage, RAYS, Refused, REST_MS, type Page } from "../page";
import { h, newId } from "../dom";
import dome from "../../../examples/mitsuba/dome.safetensors?url";
import snow from "../../../examples/mitsuba/snow.safetensors?url";
import snows from "../../../examples/mitsuba/snows.safetensors?url";
import sooty from "../../../examples/mitsuba/sooty.safetensors?url";
import { bytes as bytesText, grouped, number } from "../draw/ticks";
import { aboutFile } from "./databases-about";
import { axisControl } from "./databases-axis";
import { LookupCharts } from "./databases-charts";
import { comparison, QUANTITIES, swatchElement } from "./databases-colour";
import { axisName, holdsFactors, startPoint, valueText } from "./databases-data";

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
  // The page opens what is dropped.
  root.addEventListener("drop", () => root.classList.remove("dropping"));

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
  const charts = new LookupCharts();
  const simulateButton = h("button", { type: "button", class: "primary", onclick: () => void simulate() }, "Simulate here");
  const simulateStatus = h("p", { role: "status", class: "note" });
  const difference = h("div", { class: "difference" });
  const about = h("div", { class: "about" });
  body.append(
    h("div", { class: "columns" },
      h("section", null, h("h3", null, "Snow"), axesHost),
      h("section", null, h("h3", null, "Colour"), lightRow, swatchHost)),
    lookProblem,
    charts.element,
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
    if (answer && current) charts.show(answer, simulated, current.file.metadata);
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
      if (together) difference.replaceChildren(...comparison(mine, together, swatches, lightSelect.value));
    } catch (error) {
      if (mine !== answer) return;
      swatchHost.replaceChildren(h("p", { class: "note" }, `No colour: ${messageOf(error)}`));
      if (together) difference.replaceChildren(...comparison(mine, together, [], lightSelect.value));
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

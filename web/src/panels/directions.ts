// The panel of directions: where the light goes that the snow reflects and transmits.

import "./directions.css";
import type { Directions } from "../messages";
import { inVisible, messageOf, Refused, REST_MS, VIEW_RAYS, type Page } from "../page";
import { redrawOnChange, theme } from "../draw/canvas";
import { Chart } from "../draw/chart";
import { direction, drawDisc } from "../draw/disc";
import { h, newId } from "../dom";
import { NumberField } from "../number";
import { Choice } from "../draw/choice";
import { grouped, number, percent } from "../draw/ticks";
import {
  choose, colourRange, incidence, largestRelativeError, names, NM, nodes, principalPlane, readout,
  settings, type Chosen, type Settings,
} from "./directions-data";

/// The last view that is measured, degrees.
const MOST_VIEW = 85;

export function mount(root: HTMLElement, page: Page): void {
  root.classList.add("directions");
  let now = settings(page.state.get().directions);
  let answer: Directions | null = null;
  /// The angle of the beam of the answer; null under diffuse light.
  let beam: number | null = null;
  let chosen: Chosen | null = null;
  let cursor: { view: number; azimuth: number } | null = null;
  /// What is asked now, and what the answer is for.
  let asked = "";
  let answered = "";
  let turn = 0;
  /// Seconds that the answer took, and walks that are under way.
  let took = 0;
  let next: number | null = null;

  // ---- controls

  const set = (change: Partial<Settings>, merge?: string) => {
    now = { ...now, ...change };
    page.state.set({ directions: { ...now } }, merge);
  };
  const side = new Choice<Settings["side"]>("Light", [["reflected", "reflected"], ["transmitted", "transmitted"]],
    (value) => set({ side: value }));
  const factor = new Choice<Settings["factor"]>("Quantity", [["brf", "BRF"], ["anisotropy", "anisotropy factor"]],
    (value) => set({ factor: value }));
  const show = new Choice<Settings["show"]>("Show", [["value", "value"], ["se", "standard error"]],
    (value) => set({ show: value }));
  const slider = h("input", { id: newId("nm"), type: "range", min: NM.min, max: NM.max, step: 10, "aria-label": "Wavelength of the directions, nm" });
  const field = new NumberField({
    step: 10,
    low: NM.min,
    high: NM.max,
    within: `from ${NM.min} to ${NM.max} nm`,
    set: (nm) => set({ wavelength_nm: nm }, "directions-wavelength"),
  });
  slider.addEventListener("input", () => set({ wavelength_nm: slider.valueAsNumber }, "directions-wavelength"));
  const controls = h("div", { class: "controls" },
    h("div", { class: "wavelength" }, h("label", { for: field.input.id }, "Wavelength"), slider, field.input, h("span", {}, "nm"), field.message),
    side.element, factor.element, show.element);

  // ---- drawings

  const heading = h("h3");
  const alert = h("p", { class: "problem", role: "alert", hidden: true });
  const progress = h("p", { class: "progress", role: "status" }, "Waiting for the engine.");
  const discHost = h("div", { class: "disc" });
  const canvas = h("canvas", {
    tabIndex: 0, role: "application",
    "aria-label": "Polar disc of all views. Arrow keys up and down change the view angle, left and right the azimuth.",
  });
  discHost.append(canvas);
  const viewField = new NumberField({
    step: 1,
    low: 0,
    high: MOST_VIEW,
    within: `a view from 0 to ${MOST_VIEW}°`,
    set: (view) => point({ view, azimuth: cursor?.azimuth ?? 0 }),
  });
  const azimuthField = new NumberField({
    step: 1,
    low: 0,
    high: 180,
    within: "an azimuth from 0 to 180°",
    set: (azimuth) => point({ view: cursor?.view ?? 0, azimuth }),
  });
  const at = h("output", { "aria-live": "polite", for: `${viewField.input.id} ${azimuthField.input.id}` });
  const azimuthLabel = h("label", { for: azimuthField.input.id }, "Azimuth, \u00b0");
  const probe = h("div", { class: "probe" },
    h("label", { for: viewField.input.id }, "View, \u00b0"), viewField.input, azimuthLabel, azimuthField.input, at,
    viewField.message, azimuthField.message);
  const discFigure = h("figure", {}, discHost);
  const plane = new Chart("Principal plane", () => 300);
  const planeCaption = h("figcaption");
  const planeFigure = h("figure", {}, planeCaption, plane.element);
  const note = h("p", { class: "note" });
  const results = h("div", { hidden: true }, h("div", { class: "figures" }, discFigure, planeFigure), probe, note);
  root.append(h("h2", null, "Directions"), controls, alert, heading, progress, results);

  const draw = () => {
    side.value = now.side;
    factor.value = now.factor;
    show.value = now.show;
    slider.value = String(now.wavelength_nm);
    slider.setAttribute("aria-valuetext", `${now.wavelength_nm} nm`);
    field.show(now.wavelength_nm);
    const diffuse = answer ? beam === null : incidence(page.state.get().sample) === null;
    factor.rename("brf", names(diffuse, now.side, "brf").short);
    if (!answer) return;
    results.hidden = false;
    chosen = choose(answer, now);
    const { short, full } = names(diffuse, now.side, now.factor);
    const isError = now.show === "se";
    heading.textContent = `${isError ? "Standard error of the " : ""}${isError ? full : capital(full)} at ${number(answer.wavelength_nm, 4)} nm`;
    discFigure.hidden = diffuse;
    for (const part of [azimuthLabel, azimuthField.input]) part.hidden = diffuse;
    drawDiscNow();

    const shown = isError ? chosen.se : chosen.value;
    const { x, y } = principalPlane(answer, shown);
    const errors = principalPlane(answer, chosen.se).y;
    const axis = diffuse || beam === 0
      ? "view angle, \u00b0"
      : "view angle, \u00b0 (negative: back toward the light)";
    const marks = [];
    if (beam !== null && now.side === "reflected") marks.push({ x: -beam, name: "sun" });
    if (beam !== null && now.side === "transmitted") marks.push({ x: beam, name: "beam" });
    plane.set(
      [{ name: short, colour: now.side === "reflected" ? "--reflectance" : "--transmittance", x, y, style: "smooth", ...(isError ? {} : { band: errors }) }],
      {
        x: axis, y: `${isError ? "standard error of " : ""}${short}, unit 1`,
        xRange: diffuse ? [0, 90] : [-90, 90],
        xTicks: diffuse ? [0, 15, 30, 45, 60, 75, 90] : [-90, -60, -30, 0, 30, 60, 90],
        marks,
        ...(isError ? { low: 0 } : {}),
      },
    );
    planeCaption.textContent = diffuse
      ? `${short} over the view angle, bars: one standard error`
      : `Principal plane: views in the plane of the beam${isError ? "" : ", bars: one standard error"}`;
    note.textContent = words(beam, now, answer);
    say();
    if (alert.hidden) report();
  };

  const drawDiscNow = () => {
    if (!answer || !chosen || discFigure.hidden) return;
    const width = Math.min(discHost.clientWidth, 460);
    if (width < 80) return;
    canvas.style.width = `${width}px`;
    const isError = now.show === "se";
    const [low, high] = colourRange(isError ? chosen.se : chosen.value, isError);
    const { short } = names(beam === null, now.side, now.factor);
    drawDisc(canvas, width, {
      field: isError ? chosen.errors : chosen.values,
      low, high,
      caption: `${isError ? "standard error of " : ""}${short}, unit 1`,
      cursor,
      sides: beam !== 0,
      ...(beam === null ? {} : {
        mark: now.side === "reflected"
          ? { view: beam, azimuth: 180, name: "sun" }
          : { view: beam, azimuth: 0, name: "beam" },
      }),
    }, theme(root));
  };
  redrawOnChange(discHost, drawDiscNow);

  // ---- reading a direction

  const say = () => {
    if (!answer || !chosen) return;
    const { short } = names(beam === null, now.side, now.factor);
    if (!cursor) {
      at.textContent = "Point at the drawing, or type a direction.";
      return;
    }
    at.textContent = readout(short, chosen, cursor.view, beam === null ? null : cursor.azimuth);
    viewField.show(cursor.view);
    azimuthField.show(foldedAzimuth(cursor.azimuth));
  };
  const point = (place: typeof cursor) => {
    cursor = place;
    drawDiscNow();
    say();
  };
  const under = (event: PointerEvent) => {
    const box = canvas.getBoundingClientRect();
    const place = direction(box.width, event.clientX - box.left, event.clientY - box.top);
    if (place) point({ view: Math.round(place.view), azimuth: Math.round(place.azimuth) });
  };
  canvas.addEventListener("pointermove", under);
  canvas.addEventListener("pointerdown", under);
  canvas.addEventListener("keydown", (event) => {
    const step = event.shiftKey ? 10 : 1;
    const { view, azimuth } = cursor ?? { view: 0, azimuth: 0 };
    const to = {
      ArrowUp: { view: Math.min(MOST_VIEW, view + step), azimuth },
      ArrowDown: { view: Math.max(0, view - step), azimuth },
      ArrowLeft: { view, azimuth: (azimuth + 5 * step) % 360 },
      ArrowRight: { view, azimuth: (azimuth + 360 - 5 * step) % 360 },
      Home: { view: 0, azimuth: 0 },
      Escape: null,
    }[event.key];
    if (to === undefined) return;
    event.preventDefault();
    point(to);
  });
  plane.onCursor = (x) => {
    if (x !== null) point({ view: Math.round(Math.abs(x)), azimuth: x < 0 ? 180 : 0 });
  };

  // ---- asking: more and more walks, until something changes

  const ask = async () => {
    const { sample, files, seed, panel } = page.state.get();
    if (panel !== "directions") return;
    // The wavelengths of the sample do not matter here.
    const snow = inVisible(sample);
    const key = JSON.stringify([snow, files, seed, now.wavelength_nm]);
    if (key === asked) return;
    asked = key;
    turn += 1;
    const mine = turn;
    root.setAttribute("aria-busy", "true");
    for (const [stage, rays] of VIEW_RAYS.entries()) {
      if (stage === 1) await new Promise((resolve) => setTimeout(resolve, REST_MS));
      if (mine !== turn) return;
      // What is there already need not be walked again.
      if (key === answered && answer && rays <= answer.rays) continue;
      // Nobody looks: the rest waits until somebody does.
      if (page.state.get().panel !== "directions") {
        asked = "";
        next = null;
        break;
      }
      const began = performance.now();
      next = rays;
      report();
      try {
        const got = await page.engine.askLatest("directions", {
          ask: "directions", sample: snow, files, rays, seed, wavelength_nm: now.wavelength_nm, ...nodes(snow),
        });
        if (mine !== turn) return;
        if (!got) {
          asked = "";
          break;
        }
        answer = got;
        answered = key;
        beam = incidence(snow);
        took = (performance.now() - began) / 1000;
        alert.hidden = true;
        root.classList.remove("stale");
        next = null;
        draw();
      } catch (error) {
        if (mine !== turn) return;
        problem(error);
        break;
      }
    }
    root.removeAttribute("aria-busy");
  };
  const report = () => {
    const coming = next === null ? "" : `${answer ? "Next:" : "Under way:"} ${grouped(next)} walks.`;
    progress.textContent = `${summary()} ${coming}`.trim();
  };
  const summary = () => {
    if (!answer || !chosen) return "";
    const worst = largestRelativeError(answer, chosen);
    const seconds = `${grouped(answer.rays)} walks per refractive index in ${number(took, 2)} s.`;
    if (!worst) return seconds;
    const where = beam === null
      ? `view ${worst.view}\u00b0`
      : `view ${worst.view}\u00b0, azimuth ${worst.azimuth}\u00b0`;
    return `${seconds} Largest relative standard error: ${percent(worst.share)} (${where}).`;
  };
  const problem = (error: unknown) => {
    const text = messageOf(error);
    const key = error instanceof Refused ? error.key : undefined;
    alert.textContent = key && !text.includes(key) ? `${key}: ${text}` : text;
    alert.hidden = false;
    next = null;
    root.classList.add("stale");
    progress.textContent = answer ? "The drawing shows the last snow that could be computed." : "";
  };

  page.state.subscribe((state, changed) => {
    if (changed.has("directions")) now = settings(state.directions);
    if (changed.has("directions") || (!answer && changed.has("sample"))) draw();
    void ask();
  });
  draw();
  void ask();
}

function capital(text: string): string {
  return text.charAt(0).toUpperCase() + text.slice(1);
}

function foldedAzimuth(azimuth: number): number {
  return azimuth > 180 ? 360 - azimuth : azimuth;
}

function words(beam: number | null, { side, factor }: Settings, answer: Directions): string {
  const reflected = side === "reflected";
  const [sum, se] = reflected
    ? [answer.reflectance, answer.reflectance_se]
    : [answer.transmittance, answer.transmittance_se];
  const total = `${reflected ? "Reflectance" : "Transmittance"}: ${number(sum, 4)}, standard error ${number(se, 2)}.`;
  const lambert = factor === "anisotropy"
    ? "A Lambertian surface has an anisotropy factor of 1 in every direction."
    : `A Lambertian surface that ${reflected ? "reflects" : "transmits"} all light has a factor of 1 in every direction.`;
  const between = "Views are computed on one side of the principal plane and mirrored; between them the drawing is interpolated.";
  let kind = `Azimuth 0\u00b0 is forward, 180\u00b0 is back toward the light. ${between}`;
  if (beam === null) kind = "The light is diffuse, so the azimuth does not matter.";
  else if (beam === 0) kind = "The beam comes along the normal, so the azimuth does not matter.";
  return `${total} ${lambert} ${kind}${reflected ? "" : " Views of transmitted light lie below the snow."}`;
}

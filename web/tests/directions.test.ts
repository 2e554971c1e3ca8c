// What the panel of directions computes: interpolation on the disc, curves, names.
import { afterAll, beforeAll, describe, expect, test } from "vitest";
import type { Browser } from "playwright-core";
import { launch, open, serve } from "./browser";
import type { Directions, Sample } from "../src/messages";
import { bilinear, fold, Hemisphere, hermite, linear, slopes } from "../src/draw/interpolate";
import { direction, place } from "../src/draw/disc";
import { colour } from "../src/draw/colourmap";
import { bytes, number, percent, ticks } from "../src/draw/ticks";
import {
  choose, colourRange, incidence, largestRelativeError, names, nodes, principalPlane, readout, settings,
} from "../src/panels/directions-data";

const VIEWS = [0, 20, 40, 60, 80];
const AZIMUTHS = [0, 45, 90, 135, 180];

function field(f: (view: number, azimuth: number) => number): Hemisphere {
  return new Hemisphere(VIEWS, AZIMUTHS, VIEWS.map((view) => AZIMUTHS.map((azimuth) => f(view, azimuth))));
}

const peaked = (view: number, azimuth: number) =>
  1 + (view / 90) ** 2 * Math.cos((azimuth * Math.PI) / 180);

function answer(): Directions {
  const rows = (f: (view: number, azimuth: number) => number) => VIEWS.map((v) => AZIMUTHS.map((a) => f(v, a)));
  return {
    wavelength_nm: 550,
    view_deg: VIEWS,
    relative_azimuth_deg: AZIMUTHS,
    brf: rows(peaked),
    brf_se: rows((view) => 0.01 + view / 10000),
    btf: rows(() => 0.2),
    btf_se: rows(() => 0.01),
    reflectance: 0.8,
    reflectance_se: 0.001,
    transmittance: 0.1,
    transmittance_se: 0.001,
    engine: "spectral",
    rays: 2048,
  };
}

describe("interpolation", () => {
  test("goes through the nodes and stays between neighbours", () => {
    const x = [0, 1, 3, 4, 6];
    const y = [0, 0, 1, 1, 5];
    const slope = slopes(x, y);
    for (const [i, at] of x.entries()) expect(hermite(x, y, slope, at)).toBeCloseTo(y[i]!, 12);
    for (let at = 0; at <= 6; at += 0.05) {
      const i = x.findLastIndex((node) => node <= at);
      const [a, b] = [y[i]!, y[Math.min(i + 1, 4)]!];
      const value = hermite(x, y, slope, at);
      expect(value).toBeGreaterThanOrEqual(Math.min(a, b) - 1e-12);
      expect(value).toBeLessThanOrEqual(Math.max(a, b) + 1e-12);
    }
    expect(hermite(x, y, slope, 9)).toBe(5);
    expect(linear(x, y, 5)).toBe(3);
  });

  test("keeps straight lines straight", () => {
    const x = [0, 2, 3, 7];
    const y = x.map((value) => 3 * value - 1);
    for (const at of [0.3, 2.5, 6.9]) expect(hermite(x, y, slopes(x, y), at)).toBeCloseTo(3 * at - 1, 12);
  });

  test("on the disc goes through the nodes and is mirrored", () => {
    const disc = field(peaked);
    for (const view of VIEWS) {
      for (const azimuth of AZIMUTHS) expect(disc.at(view, azimuth)).toBeCloseTo(peaked(view, azimuth), 12);
    }
    expect(disc.at(33, 70)).toBe(disc.at(33, 290));
    expect(disc.at(33, -70)).toBe(disc.at(33, 70));
    expect(Math.abs(disc.at(50, 110) - peaked(50, 110))).toBeLessThan(0.02);
  });

  test("on the disc has one value at the normal, and is continuous through it", () => {
    const noisy = new Hemisphere([0, 30, 60], [0, 90, 180], [[1, 1.2, 1.4], [2, 1, 0.5], [3, 1, 0.4]]);
    expect(noisy.at(0, 0)).toBeCloseTo(1.2, 12);
    expect(noisy.at(0, 77)).toBeCloseTo(1.2, 12);
    expect(Math.abs(noisy.at(0.01, 0) - noisy.at(0.01, 180))).toBeLessThan(0.01);
  });

  test("a field that is the same everywhere stays so", () => {
    const flat = field(() => 0.7);
    for (const [view, azimuth] of [[0, 0], [13, 222], [79.9, 5], [85, 90]] as const) {
      expect(flat.at(view, azimuth)).toBeCloseTo(0.7, 12);
    }
  });

  test("the table of every degree agrees with the field", () => {
    const disc = field(peaked);
    const table = disc.everyDegree();
    expect(table.length).toBe(81);
    for (const [view, azimuth] of [[0, 0], [17, 33], [80, 180]] as const) {
      expect(table[view]![azimuth]).toBeCloseTo(disc.at(view, azimuth), 12);
    }
    expect(bilinear(table, 17.5, 33.5)).toBeCloseTo(disc.at(17.5, 33.5), 3);
  });

  test("azimuths fold into the half plane", () => {
    expect([0, 180, 190, 359, 361, -30].map(fold)).toEqual([0, 180, 170, 1, 1, 30]);
  });
});

describe("the disc", () => {
  test("places directions and finds them again", () => {
    for (const [view, azimuth] of [[0, 0], [45, 0], [45, 180], [60, 90], [80, 271]] as const) {
      const [x, y] = place(400, view, azimuth);
      const back = direction(400, x, y)!;
      expect(back.view).toBeCloseTo(view, 8);
      if (view > 0) expect(back.azimuth).toBeCloseTo(azimuth, 6);
    }
    expect(direction(400, 0, 0)).toBeNull();
  });

  test("has forward on the right and the light on the left", () => {
    expect(place(400, 60, 0)[0]).toBeGreaterThan(300);
    expect(place(400, 60, 180)[0]).toBeLessThan(100);
  });

  test("the colours rise in lightness", () => {
    const light = ([r, g, b]: number[]) => 0.2126 * r! ** 2.2 + 0.7152 * g! ** 2.2 + 0.0722 * b! ** 2.2;
    for (let i = 1; i <= 20; i++) expect(light(colour(i / 20))).toBeGreaterThan(light(colour((i - 1) / 20)));
    expect(colour(Number.NaN)).toEqual(colour(0));
    expect(colour(2)).toEqual(colour(1));
  });
});

describe("numbers", () => {
  test("ticks are round", () => {
    expect(ticks(0, 1)).toEqual([0, 0.2, 0.4, 0.6, 0.8, 1]);
    expect(ticks(0.93, 1.27, 4)).toEqual([1, 1.1, 1.2]);
    expect(ticks(350, 2500, 5)).toEqual([500, 1000, 1500, 2000, 2500]);
    expect(ticks(0.00012, 0.00031, 4)).toEqual([0.00015, 0.0002, 0.00025, 0.0003]);
    expect(ticks(2, 2)).toEqual([2]);
  });

  test("texts", () => {
    expect([0, 0.12345, 12.345, 1234.5, 0.9999, -0.5, 1e-7, 2.5e6].map((v) => number(v))).toEqual([
      "0", "0.123", "12.3", "1235", "1", "\u22120.5", "1e\u22127", "2.5e6",
    ]);
    expect(number(Number.NaN)).toBe("-");
    expect(percent(0.0123)).toBe("1.2\u00a0%");
    expect([12, 5756, 2.5e6].map(bytes)).toEqual(["12 bytes", "5.76 kB", "2.5 MB"]);
  });
});

describe("the panel", () => {
  const sample = (illumination: Sample["illumination"]) => ({ illumination }) as Sample;

  test("takes what is sound of a link", () => {
    expect(settings({}).wavelength_nm).toBe(550);
    expect(settings({ wavelength_nm: 1e9, side: "up", factor: "anisotropy" })).toEqual({
      wavelength_nm: 550, side: "reflected", factor: "anisotropy", show: "value",
    });
  });

  test("asks for one azimuth under diffuse light", () => {
    expect(incidence(sample({ diffuse: true }))).toBeNull();
    expect(nodes(sample({ diffuse: true })).relative_azimuth_deg).toEqual([0]);
    const beam = nodes(sample({ incidence_angle_deg: 60 }));
    expect(beam.relative_azimuth_deg.at(0)).toBe(0);
    expect(beam.relative_azimuth_deg.at(-1)).toBe(180);
    expect(beam.view_deg.every((view) => view >= 0 && view < 90)).toBe(true);
  });

  test("names the factors", () => {
    expect(names(false, "reflected", "brf")).toEqual({ short: "BRF", full: "bidirectional reflectance factor" });
    expect(names(true, "reflected", "brf").short).toBe("HDRF");
    expect(names(false, "transmitted", "brf").short).toBe("BTF");
    expect(names(true, "transmitted", "anisotropy").full).toBe("anisotropy factor (HDTF over transmittance)");
  });

  test("the anisotropy factor is the factor over the sum", () => {
    const whole = answer();
    const brf = choose(whole, { side: "reflected", factor: "brf" });
    const anisotropy = choose(whole, { side: "reflected", factor: "anisotropy" });
    expect(brf.value[2]![1]).toBe(whole.brf[2]![1]);
    expect(anisotropy.value[2]![1]).toBeCloseTo(whole.brf[2]![1]! / 0.8, 12);
    expect(anisotropy.se[2]![1]).toBeCloseTo(whole.brf_se[2]![1]! / 0.8, 12);
    const below = choose(whole, { side: "transmitted", factor: "anisotropy" });
    expect(below.value[0]![0]).toBeCloseTo(2, 12);
    const dark = choose({ ...whole, transmittance: 0 }, { side: "transmitted", factor: "anisotropy" });
    expect(dark.value.flat().every((value) => value === 0)).toBe(true);
  });

  test("finds the largest relative error", () => {
    const whole = answer();
    const worst = largestRelativeError(whole, choose(whole, { side: "reflected", factor: "brf" }))!;
    expect([worst.view, worst.azimuth]).toEqual([80, 180]);
    expect(worst.share).toBeCloseTo(0.018 / peaked(80, 180), 12);
    expect(largestRelativeError(whole, { value: whole.brf.map((r) => r.map(() => 0)), se: whole.brf_se })).toBeNull();
  });

  test("the principal plane goes from back to forward", () => {
    const whole = answer();
    const { x, y } = principalPlane(whole, whole.brf);
    expect(x).toEqual([-80, -60, -40, -20, 0, 20, 40, 60, 80]);
    expect(y[0]).toBeCloseTo(peaked(80, 180), 12);
    expect(y.at(-1)).toBeCloseTo(peaked(80, 0), 12);
    const diffuse = principalPlane({ view_deg: [0, 40], relative_azimuth_deg: [0] }, [[1], [2]]);
    expect(diffuse).toEqual({ x: [0, 40], y: [1, 2] });
  });

  test("the range of colours holds all values", () => {
    const [low, high] = colourRange([[0.912, 1.33]], false);
    expect(low).toBeLessThanOrEqual(0.912);
    expect(high).toBeGreaterThanOrEqual(1.33);
    expect(colourRange([[0.2, 0.3]], true)[0]).toBe(0);
    expect(colourRange([[0.5, 0.5]], false)[1]).toBeGreaterThan(0.5);
    expect(colourRange([[0, 0]], true)).toEqual([0, 1]);
  });

  test("reads a direction", () => {
    const whole = answer();
    const chosen = choose(whole, { side: "reflected", factor: "brf" });
    expect(readout("BRF", chosen, 40, 90)).toBe(
      "View 40\u00b0, relative azimuth 90\u00b0: BRF 1, standard error 0.014 (1.4\u00a0%)",
    );
    expect(readout("BRF", chosen, 85, 0)).toContain("beyond the last view, 80\u00b0");
    expect(readout("HDRF", chosen, 40, null)).toContain("View 40\u00b0: HDRF");
  });
});

describe("in the browser", () => {
  let browser: Browser;
  let site: Awaited<ReturnType<typeof serve>>;
  beforeAll(async () => {
    site = await serve();
    browser = await launch();
  });
  afterAll(async () => {
    await browser?.close();
    site?.server.close();
  });

  const walked = (text: RegExp) => [
    (pattern: string) => new RegExp(pattern).test(document.querySelector(".directions .progress")?.textContent ?? ""),
    text.source,
    { timeout: 200_000 },
  ] as const;

  test("the disc fills up, is read by the keyboard, and its settings are in the link", async () => {
    const { page, wrong } = await open(browser, site.url);
    await page.click("#tab-directions");
    await page.waitForFunction(...walked(/^2.048 walks per refractive index/));
    const panel = page.locator(".directions");
    expect(await panel.locator("h3").innerText()).toBe("Bidirectional reflectance factor at 550 nm");
    expect(await panel.locator(".progress").innerText()).toMatch(/Largest relative standard error: .*\s%/);
    await panel.locator(".disc canvas").focus();
    await page.keyboard.press("Shift+ArrowUp");
    await page.keyboard.press("ArrowLeft");
    expect(await panel.locator("output").innerText()).toMatch(/^View 10\u00b0, relative azimuth 5\u00b0: BRF .*, standard error/);
    for (const [name, value] of [["View", "95"], ["Azimuth", "-20"]] as const) {
      await panel.getByRole("spinbutton", { name }).fill(value);
      await panel.locator(".mistyped", { hasText: `${value} is not` }).waitFor();
    }
    await panel.getByLabel("transmitted", { exact: true }).check();
    await panel.getByLabel("anisotropy factor", { exact: true }).check();
    await panel.getByLabel("standard error", { exact: true }).check();
    expect(await panel.locator("h3").innerText()).toBe(
      "Standard error of the anisotropy factor (BTF over transmittance) at 550 nm",
    );
    await page.waitForTimeout(500);
    const { page: again } = await open(browser, page.url());
    await again.waitForSelector(".directions:not([hidden])");
    expect(await again.locator(".directions").getByLabel("standard error", { exact: true }).isChecked()).toBe(true);
    expect(wrong).toEqual([]);
    await again.context().close();
    await page.context().close();
  });

  test("under diffuse light there is a curve and no disc", async () => {
    const { page, wrong } = await open(browser, site.url);
    await page.locator("#panel-snow").getByLabel("Overcast sky").check();
    await page.click("#tab-directions");
    await page.waitForFunction(...walked(/^2.048 walks per refractive index/));
    const panel = page.locator(".directions");
    expect(await panel.locator("h3").innerText()).toContain("Hemispherical-directional");
    expect(await panel.locator(".disc").isVisible()).toBe(false);
    expect(await panel.locator("[aria-label^=Principal]").isVisible()).toBe(true);
    expect(wrong).toEqual([]);
    await page.context().close();
  });
});

// What the panel of databases computes: axes, the words of the certificate, comparisons.
import { readdirSync, readFileSync } from "node:fs";
import { fileURLToPath } from "node:url";
import { afterAll, beforeAll, describe, expect, test } from "vitest";
import type { Browser, Page } from "playwright-core";
import { launch, open, serve } from "./browser";
import {
  amongNodes, axisName, axisTicks, boundsWords, brightening, certificate, certificateSource, certificateWords,
  cssColour, deltaE, errorTable, fromShare, holdsFactors, provenance, quantityName, rmse, size,
  startPoint, toShare, valueText,
} from "../src/panels/databases-data";
import { grouped } from "../src/draw/ticks";

/// The metadata of an example, read as docs/formats.md says.
function metadata(name: string): Record<string, string> {
  const file = readFileSync(new URL(`../../examples/mitsuba/${name}.safetensors`, import.meta.url));
  const length = Number(file.readBigUInt64LE(0));
  return JSON.parse(file.subarray(8, 8 + length).toString("utf8")).__metadata__;
}

const thickness = { name: "thickness_cm", unit: "cm", values: [5, 8, 14, 35] };
const size_um = { name: "grain_size_um", unit: "um", values: [100, 200, 400] };

describe("axes", () => {
  test("the ticks lie where the nodes are", () => {
    expect(axisTicks(size_um)[0]).toBe(0);
    expect(axisTicks(size_um)[1]).toBeCloseTo(0.5, 12);
    expect(axisTicks(size_um)[2]).toBe(1);
    expect(axisTicks({ name: "angle_deg", values: [0, 20, 80] })).toEqual([0, 0.25, 1]);
    const shares = axisTicks(thickness);
    expect(shares.every((share, i) => i === 0 || share > shares[i - 1]!)).toBe(true);
  });

  test("a slider near a node stands on it", () => {
    for (const axis of [thickness, size_um]) {
      for (const node of axis.values) {
        expect(fromShare(axis, toShare(axis, node))).toBe(node);
        expect(fromShare(axis, Math.min(1, toShare(axis, node) + 0.004))).toBe(node);
      }
    }
  });

  test("a slider goes over all values, and none beyond", () => {
    let last = 0;
    for (let share = 0; share <= 1; share += 0.001) {
      const value = fromShare(thickness, share);
      expect(value).toBeGreaterThanOrEqual(last);
      expect(value).toBeLessThanOrEqual(35);
      last = value;
    }
    expect(toShare(thickness, 500)).toBe(1);
    expect(toShare(thickness, -5)).toBe(0);
    expect(toShare({ name: "facetness", values: [0.3] }, 0.3)).toBe(0);
  });

  test("says where a value lies", () => {
    expect(amongNodes(thickness, 8)).toBe("on a node");
    expect(amongNodes(thickness, 9)).toBe("between 8\u00a0cm and 14\u00a0cm");
    expect(amongNodes(thickness, 1)).toContain("below the first node");
    expect(amongNodes(thickness, 99)).toContain("beyond the last node");
  });

  test("values have units", () => {
    expect(valueText(size_um, 250)).toBe("250\u00a0\u00b5m");
    expect(valueText({ name: "angle_deg", unit: "degree" }, 30)).toBe("30\u00b0");
    expect(valueText({ name: "facetness", unit: "1" }, 0.3)).toBe("0.3");
    expect(valueText({ name: "density_kg_m3", unit: "kg m-3" }, 275)).toBe("275\u00a0kg/m\u00b3");
    expect(valueText(thickness, 1e6)).toBe("half space");
    const dust = { name: "absorber_ug_g", unit: "ug g-1", values: [0, 20, 500] };
    expect([axisName(dust.name), valueText(dust, 20)]).toEqual(["Absorber", "20\u00a0\u00b5g/g"]);
    for (const node of dust.values) expect(fromShare(dust, toShare(dust, node))).toBe(node);
  });

  test("the first point is a node, or what a link wants where that is sound", () => {
    expect(startPoint([thickness, size_um])).toEqual({ thickness_cm: 8, grain_size_um: 200 });
    expect(startPoint([thickness, size_um], { thickness_cm: 9.5, grain_size_um: 1e9 })).toEqual({
      thickness_cm: 9.5, grain_size_um: 200,
    });
    expect(startPoint([thickness], { thickness_cm: "thick" })).toEqual({ thickness_cm: 8 });
    expect(startPoint([{ name: "incidence_angle_deg", unit: "degree", values: [0, 86, 89] }])).toEqual({ incidence_angle_deg: 0 });
  });
});

describe("the certificate", () => {
  test("of an example in words", () => {
    const found = certificate(metadata("snow"))!;
    expect(certificateSource(found)).toBe(
      "The answers of the file were compared with 584 fresh simulations at random points, 262\u202f144 walks each, seed 1.",
    );
    const transmitted = found.quantities.find(({ quantity }) => quantity === "transmittance")!;
    expect(certificateWords(transmitted)).toEqual([
      "Transmittance, colour: Delta-E 0.17 on average, at most 0.29 at 95 % of the points, 0.39 at worst.",
      "Transmittance, spectrum: RMSE 0.00024 on average, at most 0.00078 at 95 % of the points, 0.001 at worst.",
    ]);
    expect(transmitted.parts.map(({ name }) => name)).toContain("Off the nodes: thickness");
    expect(transmitted.worst.length).toBe(3);
    expect(transmitted.worst[0]!.at).toContain("grain size 300 um");
  });

  test("leaves out parts that were not tried", () => {
    const [only] = certificate(metadata("snows"))!.quantities;
    expect(only!.parts.map(({ name }) => name)).not.toContain("Simulation");
  });

  test("has its newer name as well", () => {
    const { certificate: text } = metadata("snow");
    expect(certificate({ error_budget: text! })).toEqual(certificate({ certificate: text! }));
  });

  test("of a hostile file is left out", () => {
    for (const text of ["", "{", "[]", "null", '"x"', '{"quantities":[]}', '{"quantities":{"a":7}}',
      '{"quantities":{"a":{"total":{"delta_e":[1,2],"rmse":"x"}}}}']) {
      expect(certificate({ certificate: text })).toBeNull();
      expect(errorTable({ error_table: text })).toEqual([]);
      expect(boundsWords({ bounds: text })).toEqual([]);
    }
    expect(certificate({})).toBeNull();
    const odd = certificate({ certificate: '{"points":"many","quantities":{"a":{"total":{"rmse":[1,2,3]},"worst":[7,{}],"axes":4}}}' })!;
    expect(odd.points).toBeNull();
    expect(odd.quantities[0]!.total.delta_e).toBeNull();
    expect(certificateWords(odd.quantities[0]!)).toHaveLength(1);
  });

  test("bounds and errors of compression", () => {
    expect(boundsWords(metadata("snow"))).toEqual([
      "Reflectance: on every node, compression stays below Delta-E 0.225.",
      "Transmittance: on every node, compression stays below Delta-E 0.225.",
    ]);
    const rows = errorTable(metadata("snow"));
    expect(rows.map(({ quantity, components, chosen }) => [quantity, components, chosen])).toEqual([
      ["reflectance", 2, true],
      ["transmittance", 3, true],
    ]);
    expect(rows[0]!.delta_e!.max).toBeCloseTo(0.123392, 6);
  });

  test("provenance as names and texts", () => {
    const list = provenance(metadata("snow"));
    expect(list).toContainEqual(["engine", "doubling"]);
    expect(list).toContainEqual(["rays", "65536"]);
    expect(provenance({ provenance: '{"a":{"b":[1,2]}}' })).toEqual([["a.b", "[1,2]"]]);
    expect(provenance({ provenance: "not JSON" })).toEqual([["provenance", "not JSON"]]);
    expect(provenance({})).toEqual([]);
  });
});

describe("comparing and drawing", () => {
  test("sizes", () => {
    const file = { axes: [thickness, size_um], wavelengths_nm: [400, 500], quantities: [{ name: "reflectance" as const, components: 2 }], metadata: { title: "n\u00e9v\u00e9" } };
    expect(size(file)).toEqual({ curves: 12, spectraBytes: 96, metadataBytes: 11 });
    expect([7, 584, 262144, 1234567].map(grouped)).toEqual(["7", "584", "262\u202f144", "1\u202f234\u202f567"]);
  });

  test("differences", () => {
    expect(rmse([1, 2], [1, 4])).toBeCloseTo(Math.SQRT2, 12);
    expect(deltaE([50, 3, 0], [50, 0, 4])).toBe(5);
  });

  test("dark colours are brightened to 0.3 of white", () => {
    expect(brightening(0.9)).toBe(1);
    expect(brightening(0.01)).toBe(30);
    expect(brightening(0.0123)).toBe(24);
    expect(brightening(0)).toBe(1);
  });

  test("colours are encoded and clipped", () => {
    expect(cssColour([1, 0, 0.5])).toBe("rgb(255 0 188)");
    expect(cssColour([2, -1, 0.001], 0.5)).toBe("rgb(255 0 2)");
  });

  test("files of anisotropy factors are named so", () => {
    const views = { content: "anisotropy_factor" };
    expect(holdsFactors(views)).toBe(true);
    expect(quantityName(views, "reflectance")).toBe("Anisotropy factor of reflected light");
    expect(quantityName({}, "reflectance")).toBe("Reflectance");
  });
});

describe("in the browser", () => {
  let browser: Browser;
  let site: Awaited<ReturnType<typeof serve>>;
  let page: Page;
  let wrong: string[];
  beforeAll(async () => {
    site = await serve();
    browser = await launch();
    ({ page, wrong } = await open(browser, site.url));
    await page.click("#tab-databases");
    await page.waitForSelector(".databases .swatch");
  });
  afterAll(async () => {
    expect(wrong).toEqual([]);
    await browser?.close();
    site?.server.close();
  });

  const seeds = fileURLToPath(new URL("../../fuzz/seeds/compact/", import.meta.url));
  const current = () => page.getByLabel("File", { exact: true }).evaluate((e) => (e as HTMLSelectElement).selectedOptions[0]?.textContent);
  const problem = () => page.locator(".databases > .problem").evaluate((e) => ((e as HTMLElement).hidden ? null : e.textContent));

  test("an example answers to the keyboard, node by node, and undo goes back", async () => {
    expect(await page.locator("#undo").isDisabled()).toBe(true);
    await page.getByRole("button", { name: "Sooty snow" }).click();
    const field = page.getByLabel("Black carbon", { exact: true });
    await page.waitForFunction(() => document.querySelector(".databases select")?.textContent?.includes("sooty"));
    await page.getByRole("slider", { name: "Black carbon, ng/g" }).focus();
    await page.keyboard.press("PageUp");
    expect(await field.inputValue()).toBe("400");
    await page.waitForTimeout(1000);
    await page.keyboard.press("ArrowLeft");
    expect(Number(await field.inputValue())).toBeLessThan(400);
    await page.locator("#undo").click();
    expect(await field.inputValue()).toBe("400");
  });

  test("a look-up stands beside a simulation of the same snow", async () => {
    await page.getByRole("button", { name: "Simulate here" }).click();
    await page.waitForFunction(
      () => /^32.768 walks .* engine/.test(document.querySelector(".simulate .note")?.textContent ?? ""),
      null,
      { timeout: 200_000 },
    );
    const rows = await page.locator(".difference tbody tr").allInnerTexts();
    expect(rows.length).toBe(2);
    // What the certificate promises: 0.85 at worst.
    for (const row of rows) expect(Number(row.split("\t")[1])).toBeLessThan(1);
  });

  test("hostile files give a message, and the file before stays", async () => {
    for (const name of readdirSync(seeds).filter((name) => /^(other_type|truncated|valid_views)/.test(name))) {
      const before = await current();
      await page.setInputFiles(".databases input[type=file]", seeds + name);
      await page.waitForFunction((n) => document.querySelector(".databases > .problem")?.textContent?.startsWith(n), name);
      expect(await current()).toBe(before);
    }
    await page.setInputFiles(".databases input[type=file]", { name: "empty.safetensors", mimeType: "", buffer: Buffer.alloc(0) });
    await page.waitForFunction(() => document.querySelector(".databases > .problem")?.textContent?.startsWith("empty"));
    expect(await page.locator(".databases .swatch").count()).toBeGreaterThan(0);
  });

  test("more files than the engine keeps can be open", async () => {
    const sound = readdirSync(seeds).filter((name) => /^valid/.test(name) && !/views/.test(name));
    expect(sound.length).toBeGreaterThan(7);
    for (const name of sound) {
      await page.setInputFiles(".databases input[type=file]", seeds + name);
      await page.waitForFunction((n) => (document.querySelector(".databases .chooser select") as HTMLSelectElement).selectedOptions[0]?.textContent?.startsWith(n), name);
      expect(await problem()).toBeNull();
    }
    await page.getByLabel("File", { exact: true }).selectOption({ index: 0 });
    await page.waitForFunction(() => document.querySelector(".databases .swatch")?.textContent?.includes("Reflected"));
    expect(await current()).toMatch(/^snow.safetensors/);
    expect(await page.locator(".databases .body > .problem").isVisible()).toBe(false);
    expect(await page.locator(".databases .body").getAttribute("class")).not.toContain("stale");
  });

  test("a value beyond the file gives a message until it is mended", async () => {
    const field = page.getByRole("spinbutton", { name: "Thickness" }).last();
    await field.fill("-3");
    await page.waitForSelector(".databases .body > .problem:not([hidden])");
    expect(await page.locator(".databases .body > .problem").innerText()).toContain("thickness_cm = -3 is outside");
    await field.fill("9");
    await page.waitForSelector(".databases .body > .problem", { state: "hidden" });
  });
});

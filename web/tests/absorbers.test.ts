// Dust, ash and other absorbers of a layer, in Chromium.
import { afterAll, afterEach, beforeAll, expect, test } from "vitest";
import type { Browser, Page } from "playwright-core";
import { answered, dropFile, launch, open, serve } from "./browser";

let browser: Browser;
let site: Awaited<ReturnType<typeof serve>>;
let page: Page;
let wrong: string[] = [];

beforeAll(async () => {
  site = await serve();
  browser = await launch();
});
afterAll(async () => {
  await browser?.close();
  site?.server.close();
});
afterEach(async () => {
  expect(wrong).toEqual([]);
  await page?.context().close();
});

async function start(hash = ""): Promise<void> {
  ({ page, wrong } = await open(browser, site.url + hash));
  await page.waitForFunction(() => / walks, /.test(document.getElementById("status")?.textContent ?? ""));
}

const ADD = "text=Add dust, ash or another absorber";
const absorbers = () => page.locator('fieldset[data-key^="layer[0].absorber"]');
const choice = (n: number, label: string) => absorbers().nth(n).getByLabel(label, { exact: true });
const mass = (unit: "ug" | "ng") => page.locator(`[data-key="layer[0].absorber[0].concentration_${unit}_g"] input[role="spinbutton"]`);
const detail = () => page.locator(".stack .detail").first().innerText();
const reflectance = () => page.locator("#panel-spectra .readout").innerText();

/// The sample file, once it holds `text`.
async function toml(text: string): Promise<string> {
  await page.click("#tab-take");
  const file = page.locator('#panel-take pre[aria-label="Sample file"]');
  await page.waitForFunction((wanted) => document.querySelector('#panel-take pre[aria-label="Sample file"]')?.textContent?.includes(wanted), text);
  return file.innerText();
}

/// Opens the link anew, once it has followed.
async function reload(): Promise<void> {
  await page.waitForTimeout(500);
  const hash = await page.evaluate(() => location.hash);
  await page.context().close();
  await start(hash);
}

test("dust is added, changed, refused, removed and brought back", async () => {
  await start();
  await answered(page);
  const clean = await reflectance();
  await page.click(ADD);
  expect(await absorbers().count()).toBe(1);
  expect(await detail()).toContain("10 µg/g dust, Libya");
  await mass("ug").fill("300");
  await answered(page);
  expect(await reflectance()).not.toBe(clean);
  const message = page.locator('[data-key="layer[0].absorber[0].concentration_ug_g"] .message');
  await mass("ug").fill("2000000");
  await message.waitFor();
  expect(await message.innerText()).toContain("0 to 1000000");
  await mass("ug").fill("300");
  await message.waitFor({ state: "detached" });
  await choice(0, "Unit").selectOption("concentration_ng_g");
  expect(await mass("ng").inputValue()).toBe("300000");
  await choice(0, "Substance").selectOption("volcanic_ash");
  expect(await detail()).toContain("300000 ng/g Volcanic ash");
  await page.click("text=Remove this absorber");
  expect(await absorbers().count()).toBe(0);
  await page.keyboard.press("Control+z");
  expect(await choice(0, "Substance").inputValue()).toBe("volcanic_ash");
  expect(await mass("ng").inputValue()).toBe("300000");
  await answered(page);
  expect(await page.locator("#panel-snow .error:visible, #panel-snow .message").count()).toBe(0);
});

test("several absorbers by species and by a law, in ice and pores, survive a link and are in the file", async () => {
  await start();
  await page.click(ADD);
  await page.click(ADD);
  await choice(1, "Substance").selectOption("the law");
  const law = absorbers().nth(1);
  await law.locator('[data-key$="mass_absorption_efficiency_m2_g"] input[role="spinbutton"]').fill("0.25");
  await law.locator('[data-key$="reference_wavelength_nm"] input[role="spinbutton"]').fill("500");
  await law.locator('[data-key$="angstrom_exponent"] input[role="spinbutton"]').fill("2.5");
  await choice(1, "Where it is").selectOption("both");
  await law.locator('[data-key$="sedimentation"] input[role="spinbutton"]').fill("0.75");
  await choice(1, "Per mass of").selectOption("wet_mass");
  await answered(page);
  await reload();
  expect(await absorbers().count()).toBe(2);
  expect(await choice(0, "Where it is").inputValue()).toBe("pores");
  expect(await choice(1, "Per mass of").inputValue()).toBe("wet_mass");
  const file = await toml("angstrom_exponent = 2.5");
  for (const line of ["mass_absorption_efficiency_m2_g = 0.25", "reference_wavelength_nm = 500", "sedimentation = 0.75", 'concentration_per = "wet_mass"']) expect(file).toContain(line);
  expect(file.match(/\[\[layer\.absorber\]\]/g)).toHaveLength(2);
  await page.click("text=Remove this absorber >> nth=0");
  expect(await absorbers().count()).toBe(1);
  expect(await choice(0, "Substance").inputValue()).toBe("the law");
});

test("a dropped table is an absorber, wherever it is dropped", async () => {
  await start();
  const table = (to: number) => `# soil\nwavelength_nm,mac_m2_g\n350,0.2\n${to},0.02\n`;
  await dropFile(page, "header", "soil.csv", table(2500));
  await absorbers().first().waitFor();
  expect(await detail()).toContain("10 µg/g soil.csv");
  await answered(page);
  await page.locator("#panel-snow .notes", { hasText: "soil.csv: mass absorption efficiency in m2/g, 2 rows" }).waitFor();
  // Another file of the same name takes the place of the first, which undo brings back.
  await dropFile(page, 'fieldset[data-key="layer[0].absorber[0]"]', "soil.csv", table(600));
  const message = () => page.locator('[data-key="layer[0].absorber[0].file"] .message');
  await message().waitFor();
  expect(await message().innerText()).toContain("covers 350 to 600 nm");
  await page.keyboard.press("Control+z");
  await message().waitFor({ state: "detached" });
  await answered(page);
  await reload();
  expect(await choice(0, "Substance").inputValue()).toBe("the file");
  expect(await toml("absorber")).toContain('name = "soil"');
  // A species instead: the link no longer holds the table.
  await choice(0, "Substance").selectOption("dust_china");
  await page.waitForTimeout(500);
  await reload();
  expect(await choice(0, "Substance").inputValue()).toBe("dust_china");
  expect(await page.locator("#panel-snow .error:visible, #panel-snow .message").count()).toBe(0);
  await dropFile(page, 'fieldset[data-key="layer[0].absorber[0]"]', "bad.csv", "nm;k\n1;2\n");
  await message().waitFor();
  expect(await message().innerText()).toContain("cannot be used");
});

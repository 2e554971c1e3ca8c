// The page beside the program, whose path is in `SPLITSNOW`: the same numbers to the bit, and the
// page of `splitsnow serve`. `npm run test:program` runs this file alone.
import { execFileSync, spawn, type ChildProcess } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { afterAll, afterEach, beforeAll, expect, test } from "vitest";
import type { Browser, Page } from "playwright-core";
import { launch, open, OUT, serve, settled, WEB } from "./browser";

const program = process.env.SPLITSNOW ?? "";
let browser: Browser;
let folder: string;
let served: ChildProcess | undefined;
let page: Page;
let wrong: string[];

beforeAll(async () => {
  browser = await launch();
  folder = mkdtempSync(join(tmpdir(), "page-"));
});
afterAll(async () => {
  served?.kill("SIGINT");
  await browser.close();
  rmSync(folder, { recursive: true });
});
afterEach(async () => {
  expect(wrong).toEqual([]);
  await page.context().close();
});

async function save(label: string, name: string): Promise<string> {
  const named = page.waitForEvent("download", (download) => download.suggestedFilename() === name);
  const [download] = await Promise.all([named, page.click(`text=${label}`)]);
  return readFileSync(await download.path(), "utf8");
}

const rows = (csv: string) => csv.trim().split("\n").filter((line) => !line.startsWith("#"));

/// The numbers of the columns that both tables have, by wavelength.
function numbers(csv: string): Record<string, number>[] {
  const [header, ...lines] = rows(csv);
  const names = header!.split(",");
  return lines.map((line) => Object.fromEntries(line.split(",").map((text, i) => [names[i], Number(text)])));
}

/// The numbers of the page and of the program for the file and the command that the page gives.
async function compare() {
  await page.click("#tab-take");
  await page.waitForFunction(() => document.querySelector("#panel-take pre + .bar ~ pre")?.textContent?.includes("[[layer]]"));
  writeFileSync(join(folder, "sample.toml"), await save("Sample file (TOML)", "sample.toml"));
  const own = numbers(await save("Spectrum (CSV)", "spectrum.csv"));
  const command = await page.locator("#panel-take pre").first().innerText();
  const [name, ...words] = command.replace(/\s*>.*/s, "").trim().split(/\s+/);
  expect(name).toBe("splitsnow");
  const found = numbers(execFileSync(program, words, { cwd: folder, encoding: "utf8" }));
  expect(found.length).toBeGreaterThan(30);
  expect(own.map(Object.keys)[0]).toEqual(expect.arrayContaining(Object.keys(found[0]!)));
  for (const [i, row] of found.entries()) {
    for (const [column, value] of Object.entries(row)) expect(own[i]![column], `${column} at ${row.wavelength_nm} nm`).toBe(value);
  }
}

test("the browser's numbers are those of the program, to the bit", async () => {
  const site = await serve();
  ({ page, wrong } = await open(browser, site.url));
  await settled(page);
  await compare();
  site.server.close();
});

test("so they are with dust, ash and a table, and where grains crowd", async () => {
  const site = await serve();
  const grain = (min: number, max: number) => ({ fraction: 0.25, size_um: { min, max }, facetness: { min: 0.2, max: 0.4, mean: 0.3, sd: 0.072 } });
  const law = { mass_absorption_efficiency_m2_g: 0.1, reference_wavelength_nm: 400, angstrom_exponent: 3 };
  const absorber = [
    { species: "dust_libya", concentration_ug_g: 30, phase: "pores" },
    { species: "volcanic_ash", concentration_ng_g: 7000 },
    { ...law, concentration_ug_g: 3.3, sedimentation: 0.3, concentration_per: "wet_mass" },
    { file: "soil.csv", concentration_ug_g: 20 },
  ];
  const layer = { thickness_cm: 5, density_kg_m3: 300, water_saturation: 0.02, absorber };
  const crowded = [{ ...grain(50, 100), fraction: 0.5 }, grain(200, 400), grain(400, 500)];
  for (const [engine, changed] of [
    ["hybrid", { ...layer, grain: [{ ...grain(400, 800), fraction: 1 }] }],
    ["tabulated", { ...layer, thickness_cm: 0.5, grain: crowded }],
  ] as const) {
    const sample = { version: 1, illumination: { incidence_angle_deg: 30 }, wavelengths: { start_nm: 400, stop_nm: 700, step_nm: 10 }, layer: [changed] };
    const state = { sample, files: { "soil.csv": "wavelength_nm,mac_m2_g\n350,0.2\n611,0.07\n800,0.01\n" } };
    ({ page, wrong } = await open(browser, `${site.url}#j=${Buffer.from(JSON.stringify(state)).toString("base64url")}`));
    await settled(page);
    expect(await page.locator("#status").innerText()).toContain(`engine ${engine}`);
    await compare();
    if (engine === "hybrid") await page.context().close();
  }
  site.server.close();
});

test("the page of `splitsnow serve` asks the program", async () => {
  served = spawn(program, ["serve"], { stdio: ["ignore", "pipe", "ignore"] });
  const url = await new Promise<string>((resolve) => served!.stdout!.once("data", (bytes) => resolve(String(bytes).trim())));
  ({ page, wrong } = await open(browser, url));
  const asked: string[] = [];
  page.on("request", (request) => asked.push(`${request.method()} ${request.url().replace(url, "")}`));
  await settled(page);
  expect(await page.locator("#status").innerText()).toContain("native");
  await compare();
  await page.click("#tab-databases");
  await page.click("text=One snow, 5 to 35 cm");
  await page.locator("text=Certificate").first().waitFor();
  await page.click("#tab-directions");
  await page.waitForFunction(() => /16.384 walks|131.072 walks/.test(document.getElementById("panel-directions")?.innerText ?? ""), null, { timeout: 200_000 });
  await page.screenshot({ path: join(OUT, "served-directions.png") });
  expect(asked).toContain("POST ask");
  expect(asked.filter((request) => request.includes(".wasm"))).toEqual([]);
});

test("the page that the program holds is the page of these sources", async () => {
  ({ page, wrong } = await open(browser, "about:blank"));
  const committed = execFileSync("git", ["ls-files", "--modified", "--others", "--exclude-standard", "dist"], { cwd: WEB, encoding: "utf8" });
  expect(committed).toBe("");
});

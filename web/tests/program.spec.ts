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

async function save(label: string): Promise<string> {
  const [download] = await Promise.all([page.waitForEvent("download"), page.click(`text=${label}`)]);
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
  writeFileSync(join(folder, "sample.toml"), await save("Sample file (TOML)"));
  const own = numbers(await save("Spectrum (CSV)"));
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

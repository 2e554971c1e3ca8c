// The page used as a person would, in Chromium.
import { execFileSync } from "node:child_process";
import { cpSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { afterAll, afterEach, beforeAll, describe, expect, test } from "vitest";
import type { Browser, Download, Page } from "playwright-core";
import { answered, dropFile as drop, launch, open, OUT, serve, settled, WEB } from "./browser";

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
  // No error on the console, no request to another host, in any of the tests.
  expect(wrong).toEqual([]);
  await page?.context().close();
});

async function start(hash = "", options = {}): Promise<void> {
  ({ page, wrong } = await open(browser, site.url + hash, options));
  await page.waitForFunction(() => / walks, /.test(document.getElementById("status")?.textContent ?? ""));
}

const layers = () => page.$$eval(".stack .what", (all) => all.map((e) => e.textContent));
const field = (label: string) => page.locator("#panel-snow .control", { hasText: label }).locator('input[role="spinbutton"]').first();
const readout = () => page.locator("#panel-spectra .readout").innerText();
const link = () => page.evaluate(() => location.hash);

/// Does something, and waits until the link has followed.
async function andLink(act: () => Promise<unknown>): Promise<string> {
  const before = await link();
  await act();
  await page.waitForFunction((old) => location.hash !== old, before);
  return link();
}

const dropFile = (target: string, name: string, content: string) => drop(page, target, name, content);

async function contentOf(download: Download): Promise<Buffer> {
  return readFileSync(await download.path());
}

async function choosePreset(name: string): Promise<void> {
  await page.waitForFunction(() => document.querySelectorAll("#preset option").length > 3);
  await page.selectOption("#preset", name);
}

describe("snow", () => {
  test("a typed number changes the spectrum, and undo brings it back", async () => {
    await start();
    await settled(page);
    const before = await readout();
    await field("Thickness").fill("3");
    await page.waitForFunction((old) => document.querySelector("#panel-spectra .readout")?.textContent !== old, before);
    await settled(page);
    expect(await readout()).not.toBe(before);
    expect(await layers()).toEqual(["3 cm"]);
    await page.keyboard.press("Control+z");
    await settled(page);
    expect(await field("Thickness").inputValue()).toBe("12");
    expect(await readout()).toBe(before);
    await page.keyboard.press("Control+Shift+Z");
    expect(await field("Thickness").inputValue()).toBe("3");
  });

  test("a refused number gets its message at its control", async () => {
    await start();
    await field("Density, dry").fill("20");
    const message = page.locator('[data-key="layer[0].density_kg_m3"] .message');
    await message.waitFor();
    expect(await message.innerText()).toContain("50 to 550");
    expect(await field("Density, dry").getAttribute("aria-invalid")).toBe("true");
    await field("Density, dry").fill("200");
    await message.waitFor({ state: "detached" });
    await answered(page);
  });

  test("a decimal comma is taken, and what is no number is refused with a message", async () => {
    await start();
    const thickness = field("Thickness");
    const message = page.locator('[data-key="layer[0].thickness_cm"] .mistyped');
    await thickness.fill("12,5");
    expect(await layers()).toEqual(["12.5 cm"]);
    for (const [wrong, said] of [["1e999", "1e999"], ["thick", "thick"], ["", "missing"]] as const) {
      await thickness.fill(wrong);
      await thickness.blur();
      expect(await message.innerText()).toContain(said);
      expect(await thickness.inputValue()).toBe("12.5");
      expect(await layers()).toEqual(["12.5 cm"]);
    }
    await thickness.press("ArrowUp");
    expect(await layers()).toEqual(["13 cm"]);
    expect(await message.isVisible()).toBe(false);
    await page.click("#tab-directions");
    await page.locator("#panel-directions").getByRole("spinbutton", { name: "Wavelength" }).fill("100");
    await page.locator("#panel-directions .mistyped", { hasText: "100 is not" }).waitFor();
  });

  test("layers are added, dragged, moved by keys, duplicated and removed", async () => {
    await start();
    await page.click("text=Add >> nth=0");
    expect(await layers()).toEqual(["Surface · 5 cm", "Base · 12 cm"]);
    const handle = (n: number) => page.locator(".stack .handle").nth(n).boundingBox();
    const [top, bottom] = [(await handle(0))!, (await handle(1))!];
    await page.mouse.move(top.x + 10, top.y + top.height / 2);
    await page.mouse.down();
    await page.mouse.move(top.x + 10, bottom.y + 10, { steps: 5 });
    await page.mouse.move(top.x + 10, bottom.y + bottom.height - 8, { steps: 5 });
    await page.mouse.up();
    expect(await layers()).toEqual(["Surface · 12 cm", "Base · 5 cm"]);
    await page.locator(".stack .pick").nth(1).focus();
    await page.keyboard.press("Alt+ArrowUp");
    expect(await layers()).toEqual(["Surface · 5 cm", "Base · 12 cm"]);
    expect(await page.evaluate(() => document.activeElement?.querySelector(".what")?.textContent)).toBe("Surface · 5 cm");
    await page.click("text=Duplicate");
    expect(await layers()).toHaveLength(3);
    await page.click("#panel-snow >> text=Remove >> nth=0");
    expect(await layers()).toEqual(["Surface · 5 cm", "Base · 12 cm"]);
    await answered(page);
  });

  test("a layer does not stick to the mouse that was released elsewhere, and selecting leaks nothing", async () => {
    await start();
    await page.click("text=Add >> nth=0");
    const item = page.locator(".stack li").nth(0);
    const box = (await item.boundingBox())!;
    // Pressed, released where the page does not see it, and back without a button.
    await item.dispatchEvent("pointerdown", { button: 0, buttons: 1, pointerId: 1, pointerType: "mouse", clientX: box.x + 60, clientY: box.y + 10 });
    await item.dispatchEvent("pointermove", { buttons: 0, pointerId: 1, pointerType: "mouse", clientX: box.x + 60, clientY: box.y + 60 });
    expect(await page.locator(".stack .dragged").count()).toBe(0);
    expect(await item.evaluate((e) => (e as HTMLElement).style.transform)).toBe("");
    await answered(page);
    const session = await page.context().newCDPSession(page);
    const counts = async () => {
      await session.send("HeapProfiler.collectGarbage");
      return session.send("Memory.getDOMCounters");
    };
    const select = (times: number) =>
      page.evaluate(async (n) => {
        for (let i = 0; i < n; i++) {
          document.querySelectorAll<HTMLElement>(".stack .pick")[i % 2]!.click();
          await new Promise((resolve) => setTimeout(resolve));
        }
      }, times);
    await select(10);
    const before = await counts();
    await select(100);
    const after = await counts();
    console.log(`100 selections: ${before.nodes} to ${after.nodes} nodes, ${before.jsEventListeners} to ${after.jsEventListeners} listeners`);
    expect(after.nodes).toBeLessThan(before.nodes + 500);
    expect(after.jsEventListeners).toBeLessThan(before.jsEventListeners + 100);
  });

  test("only the picture of a layer that changed is drawn again", async () => {
    await start();
    for (let i = 0; i < 3; i++) await page.click("text=Add >> nth=0");
    const drawn = await page.evaluate(async () => {
      const seen = new Set<Node>();
      const observer = new MutationObserver((all) => all.forEach((m) => seen.add(m.target)));
      observer.observe(document.querySelector(".stack")!, { subtree: true, attributes: true, attributeFilter: ["width"] });
      const slider = document.querySelector<HTMLInputElement>('[data-key="layer[3].density_kg_m3"] input[type="range"]')!;
      slider.value = "300";
      slider.dispatchEvent(new Event("input", { bubbles: true }));
      await new Promise((resolve) => setTimeout(resolve, 100));
      return seen.size;
    });
    expect(drawn).toBe(1);
  });

  test("ready samples, three grain types, water and carbon by hand", async () => {
    await start();
    for (const name of ["soot_on_grass", "mixture"]) {
      await choosePreset(name);
      await answered(page);
    }
    await page.click("text=Add a grain type");
    expect(await page.locator("fieldset.grain").count()).toBe(3);
    await page.locator("fieldset.grain").nth(0).locator("select").first().selectOption("ssa_m2_kg");
    await field("Liquid water").fill("0.1");
    await field("Black carbon").fill("500");
    await page.locator('[data-key="substrate"] input[role="spinbutton"]').fill("0.3");
    await page.locator("fieldset.grain").nth(1).locator("select").nth(1).selectOption("hexagonal");
    await answered(page);
    expect(await page.locator("#panel-snow .error:visible, #panel-snow .message").count()).toBe(0);
  });

  test("deep snow of crowded grains is answered, and the seconds are counted", async () => {
    const grain = (min: number, max: number, fraction: number) => ({ fraction, size_um: { min, max }, facetness: { min: 0.2, max: 0.4, mean: 0.3, sd: 0.072 } });
    const layer = { thickness_cm: 120, density_kg_m3: 275, water_saturation: 0.05, grain: [grain(400, 500, 0.34), grain(200, 400, 0.33), grain(50, 100, 0.33)] };
    const sample = { version: 1, illumination: { incidence_angle_deg: 0 }, wavelengths: { start_nm: 400, stop_nm: 700, step_nm: 10 }, layer: [layer] };
    const begun = Date.now();
    ({ page, wrong } = await open(browser, `${site.url}#j=${Buffer.from(JSON.stringify({ sample })).toString("base64url")}`));
    await page.waitForFunction(() => /Simulating… \d+ s so far/.test(document.getElementById("status")?.textContent ?? ""));
    await answered(page);
    // Half as deep a snow took 64 s with the walks of `auto`, and 6 s with its own.
    expect((Date.now() - begun) / 1000).toBeLessThan(100);
    expect(await page.locator("#status").innerText()).toContain("engine tabulated");
  });

  test("sliders move with the keyboard", async () => {
    await start();
    const slider = page.locator('[data-key="layer[0].density_kg_m3"] input[type="range"]');
    await slider.focus();
    await page.keyboard.press("ArrowRight");
    expect(await field("Density, dry").inputValue()).toBe("280");
    await answered(page);
  });
});

describe("spectra", () => {
  test("a curve is held and compared, also in a reloaded link", async () => {
    await start();
    await page.click("#hold");
    await page.locator(".chip", { hasText: "Held A" }).waitFor();
    await field("Thickness").fill("4");
    await page.check('#panel-spectra input[value="log"]');
    await settled(page);
    const hash = await andLink(() => page.click("#tab-colour"));
    await page.locator("text=ΔE to held").first().waitFor();
    const colours = await page.locator("#panel-colour .swatches").innerText();
    await page.context().close();
    await start(hash);
    await page.locator("text=ΔE to held").first().waitFor();
    await page.waitForFunction((old) => (document.querySelector("#panel-colour .swatches") as HTMLElement).innerText === old, colours);
    expect(await field("Thickness").inputValue()).toBe("4");
    expect(await page.locator('#panel-spectra input[value="log"]').isChecked()).toBe(true);
  });

  test("a dropped measured file gets residuals and errors by band", async () => {
    await start();
    await page.selectOption("#panel-spectra select", "full");
    const rows = Array.from({ length: 200 }, (_, i) => `${400 + 10 * i},${(0.95 * Math.exp(-i / 120)).toFixed(4)}`);
    await dropFile("#panel-spectra", "field.csv", `wavelength_nm,reflectance\n${rows.join("\n")}\n`);
    await page.waitForFunction(() => document.querySelectorAll(".measured tbody tr").length > 2);
    const text = await page.locator(".measured").innerText();
    expect(text).toContain("field.csv, reflectance");
    expect(text).toMatch(/All\t\d+\t0\.\d{4}/);
    await page.click("text=Remove the file");
    await page.locator(".measured").waitFor({ state: "hidden" });
    await dropFile("#panel-spectra", "nonsense.csv", "\u0000\u0001 this is no spectrum");
    await page.locator(".measured .error").waitFor();
  });
});

describe("files", () => {
  const spectrum = `wavelength_nm,reflectance\n${Array.from({ length: 216 }, (_, i) => `${350 + 10 * i},${(0.1 + i / 500).toFixed(3)}`).join("\n")}\n`;

  test("dropped anywhere open where they belong", async () => {
    await start();
    await dropFile("header", "field.csv", spectrum);
    await page.locator(".measured", { hasText: "field.csv, reflectance" }).waitFor();
    await page.click("#tab-databases");
    await dropFile("#panel-databases", "again.csv", spectrum);
    await page.locator(".measured", { hasText: "again.csv, reflectance" }).waitFor();
    expect(await page.locator("#tab-spectra").getAttribute("aria-selected")).toBe("true");
    await dropFile("#panel-snow h2", "bad.safetensors", "no compact file");
    await page.locator(".databases > .problem", { hasText: "bad.safetensors" }).waitFor();
    expect(await page.locator("#tab-databases").getAttribute("aria-selected")).toBe("true");
    await dropFile('#panel-snow [data-key="substrate"]', "grass.csv", spectrum);
    await page.locator(".ground", { hasText: "grass.csv" }).waitFor();
    await answered(page);
    expect(await page.locator("#panel-snow .error:visible, #panel-snow .message:visible").count()).toBe(0);
  });

  test("a long measured file stays short in the link", async () => {
    await start();
    // 15 MB.
    await page.evaluate(() => {
      const rows = Array.from({ length: 430_000 }, (_, i) => `${(350 + i * 0.005).toFixed(6)},${(0.5 + 0.3 * Math.sin(i / 9000)).toFixed(20)}`);
      const data = new DataTransfer();
      data.items.add(new File([`wavelength_nm,reflectance\n${rows.join("\n")}\n`], "long.csv"));
      document.querySelector("#panel-spectra")!.dispatchEvent(new DragEvent("drop", { dataTransfer: data, bubbles: true, cancelable: true }));
    });
    await page.locator(".measured", { hasText: /long\.csv, reflectance|long\.csv:/ }).waitFor();
    expect(await page.locator(".measured").innerText()).toContain("one in 86 is kept");
    await page.waitForFunction(() => location.hash.length > 1000);
    const hash = await link();
    console.log(`link of a measured file of 15 MB: ${hash.length} characters`);
    expect(hash.length).toBeLessThan(200_000);
    await page.context().close();
    await start(hash);
    await page.locator(".measured", { hasText: "long.csv, reflectance" }).waitFor();
  });
});

describe("colour", () => {
  test("swatches, wedge, exposure and a dropped light", async () => {
    await start();
    await page.click("#tab-colour");
    await page.waitForFunction(() => document.querySelectorAll("#panel-colour .card").length === 6);
    await page.waitForFunction(() => /Transmitted luminance falls/.test(document.querySelector(".wedge")?.getAttribute("aria-label") ?? ""));
    const before = await page.locator("#panel-colour .patch").first().getAttribute("aria-label");
    await page.click("text=Expose for transmitted light");
    await page.waitForFunction((old) => document.querySelector("#panel-colour .patch")?.getAttribute("aria-label") !== old, before);
    await dropFile("#panel-colour", "D65.csv", "wavelength_nm,power\n380,0.1\n500,0.5\n600,1\n780,1.5\n");
    await page.waitForFunction(() => document.querySelectorAll("#panel-colour .card").length === 7);
    expect(await page.locator("#panel-colour .card strong").allInnerTexts()).toContain("D65");
    const box = (await page.locator(".wedge").boundingBox())!;
    await page.hover(".wedge", { position: { x: box.width / 2, y: 60 } });
    await page.locator("#panel-colour .readout", { hasText: /^(29|32) cm. Transmitted: Y/ }).waitFor();
    await page.locator('#panel-colour input[aria-label^="Read the colours"]').focus();
    await page.keyboard.press("Home");
    await page.locator("#panel-colour .readout", { hasText: "cannot be so thin" }).waitFor();
    await answered(page);
  });
});

describe("take away", () => {
  test("files: sample, numbers, picture, drawing", async () => {
    await start();
    await settled(page);
    await page.click("#tab-take");
    await page.waitForFunction(() => document.querySelector("#panel-take pre + .bar ~ pre")?.textContent?.includes("[[layer]]"));
    const save = async (label: string) => {
      const [download] = await Promise.all([page.waitForEvent("download"), page.click(`text=${label}`)]);
      return { name: download.suggestedFilename(), bytes: await contentOf(download) };
    };
    const toml = await save("Sample file (TOML)");
    expect([toml.name, toml.bytes.toString().includes("thickness_cm = 12")]).toEqual(["sample.toml", true]);
    const csv = (await save("Spectrum (CSV)")).bytes.toString();
    expect(csv.trim().split("\n").filter((line) => !line.startsWith("#"))).toHaveLength(32);
    expect(csv).toContain("# rays: 32768");
    const png = (await save("Picture (PNG)")).bytes;
    expect(png.subarray(1, 4).toString()).toBe("PNG");
    expect((await save("Drawing (SVG)")).bytes.toString()).toContain("Wavelength (nm)");
    expect(await page.locator("#panel-take pre").first().innerText()).toMatch(/^splitsnow simulate sample.toml --engine \w+ --rays 32768 --seed 1/);
    expect(await page.locator("#link").inputValue()).toContain(site.url);
  });
});

describe("page", () => {
  test("a damaged or hostile link gives a message", async () => {
    const bad = Buffer.from(JSON.stringify({ sample: { version: 1, illumination: { diffuse: true }, wavelengths: {}, layer: [{ thickness_cm: 1e300, density_kg_m3: -5, grain: [{ size_um: { min: 1, max: 0 }, facetness: { min: 9, max: -9, mean: 1, sd: 0 } }] }] } })).toString("base64url");
    for (const hash of ["#z=AAAA", `#j=${bad}`]) {
      ({ page, wrong } = await open(browser, site.url + hash));
      await page.waitForFunction(() => / walks, |damaged|cannot be simulated/.test(document.getElementById("status")?.textContent ?? ""));
      if (hash.startsWith("#j")) await page.locator("#panel-snow .error:visible, #panel-snow .message").first().waitFor();
      expect(wrong).toEqual([]);
      if (hash === "#z=AAAA") await page.context().close();
    }
  });

  test("a link with one wrong type gives a page that works", async () => {
    const grain = { size_um: { min: 300, max: 700 }, facetness: { min: 0, max: 1, mean: 0.5, sd: 0.1 } };
    const sample = { version: 1, illumination: { incidence_angle_deg: null }, wavelengths: { values_nm: [500] }, layer: [{ thickness_cm: 3, density_kg_m3: 200, grain: [grain] }] };
    await start(`#j=${Buffer.from(JSON.stringify({ sample })).toString("base64url")}`);
    expect(await layers()).toEqual(["12 cm"]);
  });

  test("says once that the program is gone, and what it takes", async () => {
    ({ page, wrong } = await open(browser, "about:blank"));
    let there = true;
    await page.route("**/page/", async (route) => {
      const response = await route.fetch();
      await route.fulfill({ response, body: (await response.text()).replace('content="wasm"', 'content="server"') });
    });
    await page.route("**/ask", (route) =>
      there ? route.fulfill({ json: { version: "1", build: "native", threads: 1, illuminants: ["D65"], presets: [] } }) : route.abort());
    // The program answers the first question, and no other.
    page.on("requestfinished", (request) => {
      if (request.url().endsWith("/ask")) there = false;
    });
    await page.goto(site.url);
    await page.locator("#status", { hasText: "The program does not answer" }).waitFor();
    for (const panel of ["spectra", "colour", "directions"]) {
      await page.click(`#tab-${panel}`);
      await page.waitForTimeout(300);
      expect(await page.getByText("The program does not answer").count()).toBe(1);
      expect(await page.getByText("cannot be simulated").count()).toBe(0);
    }
    await page.click("#tab-databases");
    await page.setInputFiles(".databases input[type=file]", { name: "big.safetensors", mimeType: "", buffer: Buffer.alloc(17_000_000) });
    await page.locator(".databases > .problem", { hasText: /17 MB is more than this page reads \(16 MB/ }).waitFor();
    await page.click("#tab-take");
    await page.waitForFunction(() => (document.getElementById("link") as HTMLInputElement).value.startsWith("#"));
    // The requests that failed.
    wrong = [];
  });

  test("nothing is wider than a small phone", async () => {
    await start("", { viewport: { width: 320, height: 640 } });
    await page.click("#tab-snow");
    for (let i = 0; i < 2; i++) await page.click("text=Add >> nth=0");
    const filled: Record<string, string> = {
      colour: "#panel-colour .card",
      directions: "#panel-directions .progress >> text=walks per",
      databases: "#panel-databases .swatch",
    };
    for (const name of ["snow", "spectra", "colour", "directions", "databases", "take"]) {
      await page.click(`#tab-${name}`);
      if (filled[name]) await page.locator(filled[name]).first().waitFor();
      await page.waitForTimeout(300);
      await page.screenshot({ path: join(OUT, `small-${name}.png`), fullPage: true });
      const wide = await page.evaluate(() =>
        [...document.querySelectorAll("body *")]
          .filter((e) => e.getBoundingClientRect().right > 320.5 && !e.closest(".scroll, #tabs, .visually-hidden, .stack, pre"))
          .map((e) => e.outerHTML.slice(0, 100)),
      );
      expect([name, await page.evaluate(() => document.documentElement.scrollWidth), wide]).toEqual([name, 320, []]);
    }
  });

  test("the tour ends where it began", async () => {
    await start();
    await page.click("#tour");
    for (let i = 0; i < 5; i++) await page.click("dialog >> text=Next");
    await page.click("dialog >> text=Done");
    await page.locator("dialog").waitFor({ state: "detached" });
    expect(await page.locator("#tab-spectra").getAttribute("aria-selected")).toBe("true");
    await page.click("#tour");
    await page.keyboard.press("Escape");
    await page.locator("dialog").waitFor({ state: "detached" });
  });

  test("opens and goes on without a network", async () => {
    await start();
    await page.waitForFunction(() => navigator.serviceWorker.controller !== null);
    site.server.close();
    site.server.closeAllConnections();
    await page.reload();
    await answered(page);
    await page.click("#tab-databases");
    await page.click("#panel-databases >> text=Sooty snow");
    await page.locator("text=Certificate").first().waitFor();
    await page.click("#tab-spectra");
    await page.selectOption("#panel-spectra select", "full");
    // Supersede fine simulations, so that workers are replaced.
    for (const cm of [5, 6, 7]) {
      await field("Thickness").fill(String(cm));
      await page.waitForTimeout(1200);
    }
    await page.selectOption("#panel-spectra select", "visible");
    await answered(page);
    site = await serve();
  });

  test("a new version replaces the kept one, a damaged one does not", async () => {
    const folder = mkdtempSync(join(tmpdir(), "site-"));
    cpSync(join(WEB, "site"), folder, { recursive: true });
    const own = await serve(folder);
    const retitle = (from: string, to: string) => {
      const index = join(folder, "index.html");
      writeFileSync(index, readFileSync(index, "utf8").replace(`<title>${from}`, `<title>${to}`));
    };
    try {
      ({ page, wrong } = await open(browser, own.url));
      await page.waitForFunction(() => navigator.serviceWorker.controller !== null);
      retitle("SPLITSnow", "Second");
      execFileSync("node", [join(WEB, "offline.mjs"), folder]);
      // The page says so, and the next load shows it; no old file is left.
      await page.reload();
      await page.locator("#status", { hasText: "new version" }).waitFor();
      expect(await page.title()).toContain("SPLITSnow");
      await page.reload();
      expect(await page.title()).toContain("Second");
      expect(await page.evaluate(async () => (await caches.keys()).length)).toBe(1);
      // Half a new version: its list does not fit its files.
      retitle("Second", "Third");
      execFileSync("node", [join(WEB, "offline.mjs"), folder]);
      retitle("Third", "Damaged");
      const failed = page.evaluate(async () => {
        const registration = (await navigator.serviceWorker.getRegistration())!;
        await registration.update();
        const worker = registration.installing!;
        await new Promise((resolve) => worker.addEventListener("statechange", resolve));
        return [worker.state, (await caches.keys()).length];
      });
      expect(await failed).toEqual(["redundant", 1]);
      await page.reload();
      await answered(page);
      expect(await page.title()).toContain("Second");
    } finally {
      own.server.close();
      rmSync(folder, { recursive: true });
    }
  });

  test("tabs and controls have names", async () => {
    await start();
    const nameless = await page.$$eval("button, input, select, [role=img], canvas:not([aria-hidden])", (all) =>
      all
        .filter((e) => !(e as HTMLInputElement).labels?.length && !e.getAttribute("aria-label") && !e.textContent?.trim() && !e.closest("[aria-hidden=true]"))
        .map((e) => e.outerHTML.slice(0, 120)),
    );
    expect(nameless).toEqual([]);
    await page.locator("#tab-spectra").focus();
    await page.keyboard.press("ArrowRight");
    expect(await page.locator("#tab-colour").getAttribute("aria-selected")).toBe("true");
  });
});

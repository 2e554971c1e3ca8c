// Screenshots of every panel, at the size of a desktop and of a phone, light and dark. They
// are written to tests/out, to be looked at.
import { join } from "node:path";
import { afterAll, beforeAll, expect, test } from "vitest";
import type { Browser } from "playwright-core";
import { answered, dropFile, launch, open, OUT, serve } from "../browser";

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

const SIZES = { desktop: { width: 1280, height: 860 }, phone: { width: 360, height: 740 } };
for (const [size, viewport] of Object.entries(SIZES)) {
  for (const colorScheme of ["light", "dark"] as const) {
    test(`${size}, ${colorScheme}`, async () => {
      const { page, wrong } = await open(browser, site.url, { viewport, colorScheme });
      await page.waitForFunction(() => document.querySelectorAll("#preset option").length > 3);
      const choose = (name: string) =>
        page.evaluate((value) => {
          const preset = document.querySelector<HTMLSelectElement>("#preset")!;
          preset.value = value;
          preset.dispatchEvent(new Event("change"));
        }, name);
      await choose("soot_on_grass");
      await answered(page);
      await page.evaluate(() => document.getElementById("hold")!.click());
      await choose("crust");
      await answered(page);
      for (const name of ["snow", "spectra", "colour", "directions", "databases", "take"]) {
        if (name === "snow" && size === "desktop") continue;
        // A disc needs the sun.
        if (name === "directions") {
          await choose("representative");
          await page.evaluate(() => {
            const slider = document.querySelector<HTMLInputElement>('[data-key="illumination"] input[type="range"]')!;
            slider.value = "50";
            slider.dispatchEvent(new Event("input", { bubbles: true }));
          });
        }
        await page.click(`#tab-${name}`);
        if (name === "colour") await page.waitForFunction(() => /falls from/.test(document.querySelector(".wedge")?.getAttribute("aria-label") ?? ""));
        if (name === "directions") await page.locator("#panel-directions .progress", { hasText: /^16.384 walks per/ }).waitFor({ timeout: 100_000 });
        if (name === "databases") await page.locator("#panel-databases .swatch").first().waitFor();
        await page.waitForTimeout(500);
        await page.screenshot({ path: join(OUT, `${size}-${colorScheme}-${name}.png`) });
        // Nothing is wider than the screen.
        expect(await page.evaluate(() => document.documentElement.scrollWidth)).toBeLessThanOrEqual(viewport.width);
      }
      // A layer with dust and a table.
      await choose("dusty");
      if (size === "phone") await page.click("#tab-snow");
      else await page.click("#tab-spectra");
      await dropFile(page, "header", "soil_of_the_valley.csv", "wavelength_nm,mac_m2_g\n350,0.2\n2500,0.02\n");
      await page.locator('fieldset[data-key="layer[0].absorber[1]"]').waitFor();
      await answered(page);
      await page.locator('fieldset[data-key="layer[0].absorber[0]"]').evaluate((element) => element.scrollIntoView({ block: "start" }));
      await page.waitForTimeout(500);
      await page.screenshot({ path: join(OUT, `${size}-${colorScheme}-absorbers.png`) });
      expect(await page.evaluate(() => document.documentElement.scrollWidth)).toBeLessThanOrEqual(viewport.width);
      expect(wrong).toEqual([]);
      await page.context().close();
    });
  }
}

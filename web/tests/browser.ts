// What the browser tests share: a server of the built page, and Chromium.
import { readFile } from "node:fs/promises";
import { existsSync, mkdirSync } from "node:fs";
import { createServer, type Server } from "node:http";
import { dirname, extname, join, normalize } from "node:path";
import { fileURLToPath } from "node:url";
import { chromium, type Browser, type BrowserContextOptions, type Page } from "playwright-core";

export const WEB = dirname(dirname(fileURLToPath(import.meta.url)));
export const OUT = join(WEB, "tests", "out");
mkdirSync(OUT, { recursive: true });

const TYPES: Record<string, string> = {
  ".html": "text/html",
  ".js": "text/javascript",
  ".css": "text/css",
  ".svg": "image/svg+xml",
  ".wasm": "application/wasm",
};

/// Serves the built page in a folder, as GitHub Pages does.
export async function serve(root = join(WEB, "site")): Promise<{ url: string; server: Server }> {
  const server = createServer((request, response) => {
    const path = normalize(decodeURIComponent(new URL(request.url ?? "/", "http://x").pathname)).replace(/^\/page\//, "/");
    const file = join(root, path.endsWith("/") ? "index.html" : path);
    readFile(file).then(
      (bytes) => response.writeHead(200, { "Content-Type": TYPES[extname(file)] ?? "application/octet-stream" }).end(bytes),
      () => response.writeHead(404).end("not found"),
    );
  });
  await new Promise<void>((resolve) => server.listen(0, "127.0.0.1", resolve));
  const address = server.address();
  if (!address || typeof address === "string") throw new Error("no address");
  return { url: `http://127.0.0.1:${address.port}/page/`, server };
}

/// Chromium; `CHROMIUM` names another one. Missing is an error: these tests are never skipped.
export async function launch(): Promise<Browser> {
  const executablePath = process.env.CHROMIUM ?? "/usr/bin/chromium";
  if (!existsSync(executablePath)) {
    throw new Error(`${executablePath} is missing: install Chromium (apt-get install chromium) or set CHROMIUM`);
  }
  return chromium.launch({ executablePath, args: ["--no-sandbox", "--headless=new", "--enable-precise-memory-info", "--js-flags=--expose-gc"] });
}

/// A page that records what must not happen: errors, and requests to other hosts.
export async function open(browser: Browser, url: string, options: BrowserContextOptions = {}): Promise<{ page: Page; wrong: string[] }> {
  const context = await browser.newContext({ viewport: { width: 1280, height: 900 }, ...options });
  const page = await context.newPage();
  const wrong: string[] = [];
  page.on("console", (message) => {
    if (message.type() === "error" || message.type() === "warning") wrong.push(`${message.type()}: ${message.text()}`);
  });
  page.on("pageerror", (error) => wrong.push(`error: ${error.message}`));
  page.on("request", (request) => {
    const { protocol, host } = new URL(request.url());
    if (protocol.startsWith("http") && host !== new URL(url).host) wrong.push(`request: ${request.url()}`);
  });
  await page.goto(url);
  return { page, wrong };
}

/// Waits until a curve of the current sample is shown, however coarse.
export async function answered(page: Page): Promise<void> {
  await page.waitForFunction(() => document.getElementById("results")?.getAttribute("data-stale") === "false", null, { timeout: 200_000 });
}

/// Waits until the finest simulation is shown.
export async function settled(page: Page): Promise<void> {
  await page.waitForFunction(
    () => /32.768 walks/.test(document.getElementById("status")?.textContent ?? "") && document.getElementById("results")?.getAttribute("aria-busy") === "false",
    null,
    { timeout: 200_000 },
  );
}

/// Drops a text file.
export async function dropFile(page: Page, target: string, name: string, content: string): Promise<void> {
  const transfer = await page.evaluateHandle(
    ([n, c]) => {
      const data = new DataTransfer();
      data.items.add(new File([c!], n!));
      return data;
    },
    [name, content],
  );
  await page.dispatchEvent(target, "dragover", { dataTransfer: transfer });
  await page.dispatchEvent(target, "drop", { dataTransfer: transfer });
}

// Builds the page before its tests if a source is newer than the built page.
import { spawnSync } from "node:child_process";
import { readdirSync, statSync, existsSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";

const web = dirname(dirname(fileURLToPath(import.meta.url)));
const built = join(web, "site", "index.html");
const newest = (path) =>
  statSync(path).isDirectory() ? Math.max(0, ...readdirSync(path).map((name) => newest(join(path, name)))) : statSync(path).mtimeMs;
const sources = ["src", "build", "index.html", "package.json", "vite.config.ts", "site.mjs", "offline.mjs", "sw.js"].map((name) => join(web, name));
const stale = !existsSync(built) || sources.some((path) => existsSync(path) && newest(path) > statSync(built).mtimeMs);
if (stale) process.exit(spawnSync("npm", ["run", "build"], { cwd: web, stdio: "inherit", shell: true }).status ?? 1);

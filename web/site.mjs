// Puts the built page and the engine into `site`, which any static server shows.
import { copyFileSync, cpSync, rmSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";

const web = dirname(fileURLToPath(import.meta.url));
const site = join(web, "site");
rmSync(site, { recursive: true, force: true });
cpSync(join(web, "dist"), site, { recursive: true });
copyFileSync(join(web, "build", "splitsnow.wasm"), join(site, "splitsnow.wasm"));

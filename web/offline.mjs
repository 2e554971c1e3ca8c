// `node offline.mjs FOLDER` writes the service worker `sw.js` for the page in a folder.
import { createHash } from "node:crypto";
import { readdirSync, readFileSync, statSync, writeFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";

const hash = (bytes) => createHash("sha256").update(bytes).digest("base64");

const folder = process.argv[2];
const names = readdirSync(folder, { recursive: true })
  .map((name) => name.replaceAll("\\", "/"))
  .filter((name) => name !== "sw.js" && statSync(join(folder, name)).isFile())
  .sort();
// Servers may redirect index.html to its folder, and a service worker must not answer with that.
const files = names.map((name) => [name === "index.html" ? "./" : name, `sha256-${hash(readFileSync(join(folder, name)))}`]);
const list = JSON.stringify(Object.fromEntries(files), null, 2);
const text = readFileSync(join(dirname(fileURLToPath(import.meta.url)), "sw.js"), "utf8");
writeFileSync(join(folder, "sw.js"), `const FILES = ${list};\nconst VERSION = ${JSON.stringify(hash(list + text))};\n\n${text}`);

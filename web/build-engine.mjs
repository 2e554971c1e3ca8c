// Builds the engine, `build/splitsnow.wasm`, from the crate `splitsnow-web`.
//
// `node build-engine.mjs --if-missing` does nothing if the file is there. `CARGO` and `RUSTC`
// choose other programs, and `CARGO_BUILD_ARGS` adds arguments (`-Z build-std=std,panic_abort`).
import { spawnSync } from "node:child_process";
import { copyFileSync, existsSync, mkdirSync, readFileSync, statSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { gzipSync } from "node:zlib";

const TARGET = "wasm32-unknown-unknown";
const web = dirname(fileURLToPath(import.meta.url));
const root = dirname(web);
const out = join(web, "build", "splitsnow.wasm");

if (process.argv.includes("--if-missing") && existsSync(out)) process.exit(0);

const cargo = process.env.CARGO ?? "cargo";
const rustc = process.env.RUSTC ?? "rustc";
const extra = (process.env.CARGO_BUILD_ARGS ?? "").split(" ").filter(Boolean);

/// Runs a program; returns its output, or null if it fails.
function output(program, args) {
  const run = spawnSync(program, args, { cwd: root, encoding: "utf8" });
  return run.status === 0 ? run.stdout.trim() : null;
}

function fail(message) {
  console.error(`engine: ${message}`);
  process.exit(1);
}

function hasTarget() {
  const folder = output(rustc, ["--print", "target-libdir", "--target", TARGET]);
  return folder !== null && existsSync(folder);
}

if (output(rustc, ["--version"]) === null) fail(`${rustc} is not there: install Rust from https://rustup.rs`);
const buildsStd = extra.some((argument) => argument.startsWith("build-std")) || process.env.CARGO_UNSTABLE_BUILD_STD;
if (!hasTarget() && !buildsStd) {
  console.error(`engine: adding the target ${TARGET}`);
  spawnSync("rustup", ["target", "add", TARGET], { cwd: root, stdio: "inherit" });
  if (!hasTarget()) {
    fail(
      `the Rust target ${TARGET} is missing. Run \`rustup target add ${TARGET}\`. Where rustup cannot fetch it, ` +
        `run \`sh web/debian-engine.sh\` on Debian 12, set RUSTC and CARGO_BUILD_ARGS for a compiler that builds the ` +
        `standard library, or copy a finished module to web/build/splitsnow.wasm.`,
    );
  }
}

const folder = join(root, "target", "wasm");
const args = ["build", "--release", "--locked", "--target", TARGET, "-p", "splitsnow-web", ...extra];
const run = spawnSync(cargo, args, {
  cwd: root,
  stdio: "inherit",
  // Flags of the native build (target-cpu) must not reach this one.
  env: { ...process.env, RUSTFLAGS: "-C target-feature=+simd128", CARGO_ENCODED_RUSTFLAGS: undefined, CARGO_TARGET_DIR: folder },
});
if (run.status !== 0) fail(`\`${cargo} ${args.join(" ")}\` failed`);
mkdirSync(dirname(out), { recursive: true });
copyFileSync(join(folder, TARGET, "release", "splitsnow_web.wasm"), out);
const kB = (bytes) => `${Math.round(bytes / 1000)} kB`;
console.log(`engine: ${out}, ${kB(statSync(out).size)}, gzipped ${kB(gzipSync(readFileSync(out)).length)}`);

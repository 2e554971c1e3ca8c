// Chooses and starts the engine.
import type { Engine } from "../page";
import { MOST_WORKERS, Pool } from "./pool";
import type { WorkerLike } from "./protocol";
import { isServed, Server } from "./server";
// The worker is part of the page's script, so that one can be started without a network.
import EngineWorker from "./worker?worker&inline";

/// Memory of all workers for tables of grain events, bytes. They share the index nodes, and with
/// them the tables. With 320 MiB a change was not redrawn sooner, and the workers took 411 MB.
const TABLES = 64 << 20;

export async function startEngine(): Promise<Engine> {
  return isServed() ? new Server() : local();
}

/// Lets the page open without a network from the next visit on. `renewed` is called when a new
/// version of the page replaced the one that is open. `splitsnow serve` needs none of this, and
/// where a browser refuses (an address without TLS), the page asks the network as before.
export function keepOffline(renewed: () => void): void {
  const workers = navigator.serviceWorker as ServiceWorkerContainer | undefined;
  if (isServed() || !import.meta.env.PROD || !workers) return;
  if (workers.controller) workers.addEventListener("controllerchange", renewed);
  workers.register(new URL("sw.js", document.baseURI)).catch(() => undefined);
}

async function local(): Promise<Engine> {
  const module = await compile(new URL("splitsnow.wasm", document.baseURI));
  // GiB, a power of two up to 8; some browsers do not say. A worker takes up to 0.1 GB.
  const { deviceMemory = MOST_WORKERS } = navigator as { deviceMemory?: number };
  const workers = Math.max(1, Math.min(navigator.hardwareConcurrency || 1, MOST_WORKERS, deviceMemory));
  const spawn = (): WorkerLike => {
    const worker = new EngineWorker() as WorkerLike;
    worker.postMessage({ module, tables: Math.floor(TABLES / workers) });
    return worker;
  };
  return new Pool({ spawn, workers });
}

async function compile(url: URL): Promise<WebAssembly.Module> {
  if (typeof WebAssembly === "undefined") throw new Error("This browser does not run WebAssembly.");
  const response = await fetch(url);
  if (!response.ok) throw new Error(`The engine could not be loaded (${url.pathname}: ${response.status}).`);
  // Some servers send another type than application/wasm: compile from bytes then.
  if (response.headers.get("Content-Type")?.startsWith("application/wasm")) {
    return WebAssembly.compileStreaming(response);
  }
  return WebAssembly.compile(await response.arrayBuffer());
}

// Chooses and starts the engine.
import type { Engine } from "../page";
import { MOST_WORKERS, Pool } from "./pool";
import type { WorkerLike } from "./protocol";
import { isServed, Server } from "./server";
// The worker is part of the page's script, so that one can be started without a network.
import EngineWorker from "./worker?worker&inline";

export async function startEngine(): Promise<Engine> {
  return isServed() ? new Server() : local();
}

async function local(): Promise<Engine> {
  const module = await compile(new URL("splitsnow.wasm", document.baseURI));
  const spawn = (): WorkerLike => {
    const worker = new EngineWorker() as WorkerLike;
    worker.postMessage({ module });
    return worker;
  };
  const workers = Math.max(1, Math.min(navigator.hardwareConcurrency || 1, MOST_WORKERS));
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

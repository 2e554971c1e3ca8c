// What passes between the pool and a worker.

/// To a worker: first the compiled module and the memory for its tables, bytes; then requests.
export type ToWorker = { module: WebAssembly.Module; tables: number } | { id: number; json: string; data: Uint8Array | null };

/// From a worker: an answer, or `trap` if the engine stopped. A worker whose engine has stopped
/// is of no use any more.
export type FromWorker = { id: number; json: string; data: Uint8Array | null } | { id: number; trap: string };

/// The part of `Worker` that the pool uses, so that tests can put something else in its place.
export interface WorkerLike {
  postMessage(message: ToWorker, transfer?: Transferable[]): void;
  onmessage: ((event: MessageEvent<FromWorker>) => void) | null;
  onerror: ((event: ErrorEvent) => void) | null;
  terminate(): void;
}

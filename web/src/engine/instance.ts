// One instance of the WebAssembly module: JSON and bytes in, JSON and bytes out.

interface Exports {
  memory: WebAssembly.Memory;
  start(tables: number): void;
  allocate(bytes: number): number;
  release(pointer: number, bytes: number): void;
  answer(json: number, jsonBytes: number, data: number, dataBytes: number): number;
}

export interface Answer {
  json: string;
  data: Uint8Array | null;
}

export class Instance {
  readonly #exports: Exports;

  /// `tables` bytes are for tables of grain events.
  constructor(module: WebAssembly.Module, tables: number) {
    this.#exports = new WebAssembly.Instance(module).exports as unknown as Exports;
    this.#exports.start(tables);
  }

  /// Throws `WebAssembly.RuntimeError` if the engine stops; the instance is then broken.
  answer(json: string, data: Uint8Array | null): Answer {
    const wasm = this.#exports;
    const text = this.#put(new TextEncoder().encode(json));
    const bytes = this.#put(data ?? new Uint8Array(0));
    const record = wasm.answer(text.at, text.length, bytes.at, bytes.length);
    // The memory may have grown and moved since: look at it only now.
    const fields = new Uint32Array(wasm.memory.buffer, record, 4);
    const [jsonAt = 0, jsonLength = 0, dataAt = 0, dataLength = 0] = fields;
    const answer = {
      json: new TextDecoder().decode(new Uint8Array(wasm.memory.buffer, jsonAt, jsonLength)),
      data: dataLength > 0 ? new Uint8Array(wasm.memory.buffer, dataAt, dataLength).slice() : null,
    };
    wasm.release(text.at, text.length);
    wasm.release(bytes.at, bytes.length);
    wasm.release(jsonAt, jsonLength);
    wasm.release(dataAt, dataLength);
    wasm.release(record, 16);
    return answer;
  }

  #put(bytes: Uint8Array): { at: number; length: number } {
    const at = this.#exports.allocate(bytes.length);
    new Uint8Array(this.#exports.memory.buffer, at, bytes.length).set(bytes);
    return { at, length: bytes.length };
  }
}

// A worker: one instance of the engine, one request at a time.
import { Instance } from "./instance";
import type { FromWorker, ToWorker } from "./protocol";

let instance: Instance | null = null;

self.onmessage = (event: MessageEvent<ToWorker>) => {
  const message = event.data;
  if ("module" in message) {
    instance = new Instance(message.module, message.tables);
    return;
  }
  const { id } = message;
  try {
    if (!instance) throw new Error("no engine");
    const answer = instance.answer(message.json, message.data);
    reply({ id, ...answer }, answer.data ? [answer.data.buffer as ArrayBuffer] : []);
  } catch (error) {
    instance = null;
    reply({ id, trap: error instanceof Error ? error.message : String(error) }, []);
  }
};

function reply(message: FromWorker, transfer: Transferable[]): void {
  (self as unknown as Worker).postMessage(message, transfer);
}

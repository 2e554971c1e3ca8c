// The engine behind `splitsnow serve`: the same messages over HTTP.
import { base64 } from "../bytes";
import type { Request } from "../messages";
import { Gone, Refused, type AnswerTo, type Engine } from "../page";
import { read } from "./pool";

export class Server implements Engine {
  readonly name = "native, on this computer";
  /// A message may have 24 MiB; bytes travel as base64 in it.
  readonly mostBytes = 16e6;
  /// Names this page, so that the files that it opened are its own.
  readonly #client = crypto.randomUUID();
  readonly #channels = new Map<string, AbortController>();

  ask<R extends Request>(request: R, data?: Uint8Array): Promise<AnswerTo<R>> {
    return this.#post(request, data, undefined);
  }

  async askLatest<R extends Request>(channel: string, request: R, data?: Uint8Array): Promise<AnswerTo<R> | null> {
    // The server stops the work of a request whose connection ends.
    this.#channels.get(channel)?.abort();
    const abort = new AbortController();
    this.#channels.set(channel, abort);
    try {
      const answer = await this.#post(request, data, abort.signal);
      return abort.signal.aborted ? null : answer;
    } catch (error) {
      if (abort.signal.aborted) return null;
      throw error;
    } finally {
      if (this.#channels.get(channel) === abort) this.#channels.delete(channel);
    }
  }

  async #post<R extends Request>(request: R, data: Uint8Array | undefined, signal: AbortSignal | undefined) {
    const body = JSON.stringify(data ? { ...request, data: base64(data) } : request);
    let response: Response;
    try {
      response = await fetch("./ask", {
        method: "POST",
        headers: { "Content-Type": "application/json", "X-SPLITSnow-Client": this.#client },
        body,
        ...(signal ? { signal } : {}),
      });
    } catch (error) {
      if (signal?.aborted) throw error;
      throw new Gone("The program does not answer. Is `splitsnow serve` still running?");
    }
    const json = await response.text();
    try {
      return read({ json }) as AnswerTo<R>;
    } catch (error) {
      if (error instanceof Refused) throw error;
      throw new Refused(`The program answered ${response.status} ${response.statusText}: ${json.slice(0, 200)}`);
    }
  }
}

/// Whether the page came from `splitsnow serve`.
export function isServed(): boolean {
  return document.querySelector('meta[name="splitsnow-engine"]')?.getAttribute("content") === "server";
}

// Keeps the spectrum of the current sample up to date: coarse while a control moves, finer at
// rest.
import { FEW_RAYS, Gone, inRange, messageOf, RAYS, Refused, REST_MS, SLOW_MS, STUCK_MS, type Engine, type Shown, type Store } from "./page";
import type { SampleAnswer } from "./messages";
import { Value } from "./observable";


export class Simulation {
  readonly shown = new Value<Shown | null>(null);
  readonly checked = new Value<SampleAnswer | null>(null);
  readonly refused = new Value<Refused | null>(null);
  /// Walks that are on their way; 0 if none are.
  readonly pending = new Value<number>(0);

  readonly #engine: Engine;
  readonly #store: Store;
  #version = 0;
  /// Whether the curve that is shown belongs to an earlier sample.
  readonly stale = new Value(false);
  /// Whole seconds since the last change, while no curve of the sample is shown.
  readonly waited = new Value(0);
  #clock: ReturnType<typeof setInterval> | undefined;
  /// When the coarse simulation that runs was started, or 0. It is left to finish, so that a
  /// curve is seen while dragging, unless it is stuck.
  #coarse = 0;
  /// Walks of the coarse simulation.
  #fewest: number = RAYS[0];
  #late: ReturnType<typeof setTimeout> | undefined;
  #rest: ReturnType<typeof setTimeout> | undefined;
  #changed = 0;

  constructor(engine: Engine, store: Store) {
    this.#engine = engine;
    this.#store = store;
    this.stale.subscribe((stale) => {
      clearInterval(this.#clock);
      this.waited.set(0);
      if (stale) this.#clock = setInterval(() => this.waited.set(Math.floor((Date.now() - this.#changed) / 1000)), 1000);
    });
    store.subscribe((_, changed) => {
      if (changed.has("sample") || changed.has("files") || changed.has("range") || changed.has("seed")) this.start();
    });
  }

  start(): void {
    this.#version++;
    this.#changed = Date.now();
    this.pending.set(this.#fewest);
    this.stale.set(true);
    clearTimeout(this.#rest);
    clearTimeout(this.#late);
    void this.#check();
    const left = this.#coarse ? this.#coarse + STUCK_MS - Date.now() : 0;
    if (left <= 0) void this.#stage(0);
    else this.#late = setTimeout(() => void this.#stage(0), left);
  }

  async #check(): Promise<void> {
    const { sample: given, files, range } = this.#store.get();
    const sample = inRange(given, range);
    try {
      const answer = await this.#engine.askLatest("check", { ask: "sample", sample, files });
      if (!answer) return;
      this.checked.set(answer);
      this.refused.set(null);
    } catch (error) {
      this.#fail(error);
    }
  }

  async #stage(stage: number): Promise<void> {
    const version = this.#version;
    const { sample: given, files, range, seed } = this.#store.get();
    const sample = inRange(given, range);
    const rays = stage === 0 ? this.#fewest : RAYS[stage]!;
    const started = performance.now();
    const coarse = stage === 0 ? Date.now() : 0;
    this.#coarse = coarse;
    clearTimeout(this.#late);
    this.pending.set(rays);
    let failed = false;
    try {
      const spectrum = await this.#engine.askLatest("spectrum", { ask: "simulate", sample, files, rays, seed });
      if (!spectrum) {
        // Nothing superseded it: there is no engine any more.
        if (version === this.#version) this.pending.set(0);
        return;
      }
      const ms = performance.now() - started;
      this.shown.set({ sample, spectrum, seconds: ms / 1000 });
      if (stage === 0) this.#adapt(ms);
      if (version === this.#version) this.stale.set(false);
    } catch (error) {
      failed = true;
      if (version === this.#version) this.#fail(error);
    } finally {
      if (stage === 0 && this.#coarse === coarse) this.#coarse = 0;
    }
    if (version !== this.#version) {
      // The sample changed meanwhile. A finer stage was superseded by the change itself.
      if (stage === 0) void this.#stage(0);
      return;
    }
    this.pending.set(0);
    if (failed || stage + 1 >= RAYS.length) return;
    const wait = Math.max(0, this.#changed + REST_MS - Date.now());
    this.pending.set(RAYS[stage + 1]!);
    this.#rest = setTimeout(() => void this.#stage(stage + 1), wait);
  }

  /// Fewer walks where an answer is slow, and the usual number again where it is fast.
  #adapt(ms: number): void {
    if (ms > SLOW_MS) this.#fewest = FEW_RAYS;
    else if (ms < SLOW_MS / 2) this.#fewest = RAYS[0];
  }

  #fail(error: unknown): void {
    // The snow is not at fault.
    if (error instanceof Gone) return;
    this.checked.set(null);
    this.refused.set(error instanceof Refused ? error : new Refused(messageOf(error)));
  }
}

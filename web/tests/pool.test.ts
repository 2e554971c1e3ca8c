import { afterEach, beforeEach, describe, expect, test, vi } from "vitest";
import type { Request } from "../src/messages";
import type { FromWorker, ToWorker, WorkerLike } from "../src/engine/protocol";
import { Pool } from "../src/engine/pool";
import { Refused } from "../src/page";
import { initialState } from "../src/state";

/// A worker without an engine. It answers after `MS[ask]`, or never if that is infinite.
class Fake implements WorkerLike {
  static all: Fake[] = [];
  onmessage: WorkerLike["onmessage"] = null;
  onerror: WorkerLike["onerror"] = null;
  asked: Request[] = [];
  data: (Uint8Array | null)[] = [];
  terminated = false;

  constructor() {
    Fake.all.push(this);
  }

  postMessage(message: ToWorker): void {
    if ("module" in message) return;
    const request = JSON.parse(message.json) as Request;
    this.asked.push(request);
    this.data.push(message.data);
    setTimeout(() => {
      if (!this.terminated) this.onmessage?.({ data: answer(message.id, request) } as MessageEvent<FromWorker>);
    }, MS[request.ask] ?? 1);
  }

  terminate(): void {
    this.terminated = true;
  }
}

let MS: Partial<Record<Request["ask"], number>> = {};
let nodes = 5;

function answer(id: number, request: Request): FromWorker {
  const json = (value: unknown, data: Uint8Array | null = null) => ({ id, json: JSON.stringify(value), data });
  switch (request.ask) {
    case "sample":
      return json({ nodes, sample });
    case "walk":
      return json({ walks: 1 }, Uint8Array.of(request.worker));
    case "simulate":
      return json({ rays: request.rays });
    case "wedge":
      return { id, trap: "unreachable" };
    case "light":
      return json({ error: "no light", key: "power" });
    default:
      return json({});
  }
}

const { sample } = initialState();
const simulate = (rays: number, seed = 1) => ({ ask: "simulate" as const, sample, rays, seed });
const directions = { ask: "directions" as const, sample, rays: 2048, seed: 1, wavelength_nm: 550, view_deg: [0], relative_azimuth_deg: [0] };
const pool = (workers: number) => new Pool({ spawn: () => new Fake(), workers });
const requests = () => Fake.all.flatMap((fake) => fake.asked.map((request) => request.ask));

beforeEach(() => {
  vi.useFakeTimers();
  Fake.all = [];
  MS = {};
  nodes = 5;
});
afterEach(() => vi.useRealTimers());

describe("pool", () => {
  test("shares walks over the workers and puts them together", async () => {
    const answer = pool(3).ask(simulate(2048));
    await vi.runAllTimersAsync();
    expect(await answer).toEqual({ rays: 2048 });
    expect(requests().filter((ask) => ask === "walk")).toHaveLength(3);
    const last = Fake.all.flatMap((fake) => fake.data).filter((data) => data !== null);
    expect(last.map((data) => [...data!])).toEqual([[0, 1, 2]]);
  });

  test("does not use more workers than nodes", async () => {
    nodes = 1;
    const engine = pool(3);
    const check = engine.ask({ ask: "sample", sample });
    await vi.runAllTimersAsync();
    await check;
    const answer = engine.ask(simulate(2048));
    await vi.runAllTimersAsync();
    await answer;
    expect(requests()).toEqual(["simulate", "sample"]);
  });

  test("drops what is superseded: the latest wins", async () => {
    MS = { walk: 50 };
    const engine = pool(2);
    const answers = [1, 2, 3].map((seed) => engine.askLatest("spectrum", simulate(2048, seed)));
    await vi.runAllTimersAsync();
    expect(await Promise.all(answers)).toEqual([null, null, { rays: 2048 }]);
    expect(engine.replaced).toBe(0);
  });

  test("replaces a worker that is stuck in a superseded fine request after three seconds", async () => {
    MS = { walk: 1e9 };
    const engine = pool(2);
    const first = engine.askLatest("spectrum", simulate(131072));
    await vi.advanceTimersByTimeAsync(1000);
    // Nothing else waits: the workers may finish.
    const second = engine.askLatest("spectrum", { ask: "about" });
    expect(await first).toBeNull();
    await vi.advanceTimersByTimeAsync(100);
    expect(await second).toEqual({});
    expect(engine.replaced).toBe(0);
    await vi.advanceTimersByTimeAsync(2000);
    expect(engine.replaced).toBe(2);
  });

  test("lets superseded coarse walks finish, and replaces their workers only when they are stuck", async () => {
    MS = { walk: 10_000 };
    const engine = pool(2);
    const first = engine.askLatest("spectrum", simulate(2048, 1));
    await vi.advanceTimersByTimeAsync(1000);
    const second = engine.askLatest("spectrum", simulate(2048, 2));
    expect(await first).toBeNull();
    await vi.advanceTimersByTimeAsync(30_000);
    expect(await second).toEqual({ rays: 2048 });
    expect(engine.replaced).toBe(0);
    MS = { walk: 1e9 };
    void engine.askLatest("spectrum", simulate(2048, 3));
    await vi.advanceTimersByTimeAsync(1000);
    MS = {};
    const last = engine.askLatest("spectrum", simulate(2048, 4));
    await vi.advanceTimersByTimeAsync(18_000);
    expect(engine.replaced).toBe(0);
    await vi.advanceTimersByTimeAsync(2000);
    expect(await last).toEqual({ rays: 2048 });
    expect(engine.replaced).toBe(2);
  });

  test("does not let a new simulation wait for a superseded fine one", async () => {
    const engine = pool(1);
    MS = { simulate: 1e9 };
    void engine.askLatest("spectrum", simulate(131072));
    await vi.advanceTimersByTimeAsync(1000);
    MS = {};
    const next = engine.askLatest("spectrum", simulate(2048));
    await vi.advanceTimersByTimeAsync(50);
    expect(await next).toEqual({ rays: 2048 });
    expect(engine.replaced).toBe(1);
  });

  test("lets what takes longest make room for a simulation, and does it again afterwards", async () => {
    MS = { directions: 60_000 };
    const engine = pool(1);
    const long = engine.ask(directions);
    await vi.advanceTimersByTimeAsync(300);
    const spectrum = engine.ask(simulate(2048));
    await vi.advanceTimersByTimeAsync(690);
    expect([requests(), engine.replaced]).toEqual([["directions"], 0]);
    await vi.advanceTimersByTimeAsync(20);
    expect(await spectrum).toEqual({ rays: 2048 });
    expect([requests(), engine.replaced]).toEqual([["directions", "simulate", "directions"], 1]);
    await vi.advanceTimersByTimeAsync(60_000);
    expect(await long).toEqual({});
    expect(engine.replaced).toBe(1);
  });

  test("keeps what takes longest away from the worker that puts simulations together", async () => {
    MS = { directions: 60_000 };
    nodes = 1;
    const engine = pool(2);
    const check = engine.ask({ ask: "sample", sample });
    void engine.ask(directions);
    await vi.advanceTimersByTimeAsync(10);
    await check;
    const spectrum = engine.ask(simulate(2048));
    await vi.advanceTimersByTimeAsync(10);
    expect(await spectrum).toEqual({ rays: 2048 });
    expect(engine.replaced).toBe(0);
  });

  test("answers quick questions while all workers walk", async () => {
    MS = { walk: 1e9 };
    const engine = pool(2);
    void engine.ask(simulate(131072));
    await vi.advanceTimersByTimeAsync(10);
    const about = engine.ask({ ask: "about" });
    await vi.advanceTimersByTimeAsync(10);
    expect(await about).toEqual({});
  });

  test("gives refusals with their key", async () => {
    const answer = pool(1).ask({ ask: "light", name: "x", text: "" });
    const check = expect(answer).rejects.toMatchObject({ name: "Refused", message: "no light", key: "power" });
    await vi.runAllTimersAsync();
    await check;
  });

  test("goes on after the engine has stopped", async () => {
    const engine = pool(1);
    const wedge = engine.ask({ ask: "wedge", sample, rays: 1, seed: 1, thicknesses_cm: [1] });
    const check = expect(wedge).rejects.toThrow(Refused);
    await vi.runAllTimersAsync();
    await check;
    expect(engine.replaced).toBe(1);
    const next = engine.ask(simulate(2048));
    await vi.runAllTimersAsync();
    expect(await next).toEqual({ rays: 2048 });
  });
});

test("a worker that cannot start is not started for ever", async () => {
  vi.useRealTimers();
  let started = 0;
  const spawn = (): WorkerLike => {
    started++;
    const worker = new Fake();
    setTimeout(() => worker.onerror?.({ message: "out of memory" } as ErrorEvent), 0);
    return worker;
  };
  new Pool({ spawn, workers: 2 });
  await vi.waitFor(() => expect(started).toBeGreaterThan(20));
  await new Promise((resolve) => setTimeout(resolve, 200));
  // the two workers, the desk, and those that replaced them
  expect(started).toBeLessThanOrEqual(23);
});

import { afterEach, beforeEach, expect, test, vi } from "vitest";
import type { Request } from "../src/messages";
import { Gone, type Engine } from "../src/page";
import { Simulation } from "../src/simulation";
import { withLayer } from "../src/snow/edit";
import { History, initialState } from "../src/state";

/// An engine that takes `ms`, or `ms(rays)`, for a simulation and notes what it was asked.
function fake(ms: number | ((rays: number) => number)) {
  const asked: { rays: number; cm: unknown }[] = [];
  const channels = new Map<string, () => void>();
  const askLatest = (channel: string, request: Request) => {
    channels.get(channel)?.();
    return new Promise((resolve) => {
      channels.set(channel, () => resolve(null));
      if (request.ask !== "simulate") return resolve({});
      const cm = request.sample.layer[0]!.thickness_cm;
      asked.push({ rays: request.rays, cm });
      setTimeout(() => resolve({ rays: request.rays, cm }), typeof ms === "number" ? ms : ms(request.rays));
    });
  };
  return { asked, engine: { name: "fake", ask: askLatest, askLatest } as unknown as Engine };
}

const move = (state: History, cm: number) =>
  state.set({ sample: withLayer(state.get().sample, 0, (layer) => ({ ...layer, thickness_cm: cm })) });

beforeEach(() => void vi.useFakeTimers());
afterEach(() => vi.useRealTimers());

test("refines at rest, in three stages", async () => {
  const { asked, engine } = fake(40);
  const simulation = new Simulation(engine, new History(initialState()));
  simulation.start();
  await vi.advanceTimersByTimeAsync(100);
  expect(asked.map((a) => a.rays)).toEqual([2048]);
  await vi.advanceTimersByTimeAsync(1000);
  expect(asked.map((a) => a.rays)).toEqual([2048, 8192, 32768]);
  expect([simulation.pending.value, simulation.stale.value]).toEqual([0, false]);
});

test("shows curves while a control moves, and ends with the last value", async () => {
  const { asked, engine } = fake(100);
  const state = new History(initialState());
  const simulation = new Simulation(engine, state);
  const seen: unknown[] = [];
  simulation.shown.subscribe((shown) => shown && seen.push((shown.spectrum as unknown as { cm: number }).cm));
  for (let cm = 1; cm <= 60; cm++) {
    move(state, cm);
    await vi.advanceTimersByTimeAsync(16);
  }
  expect(seen.length).toBeGreaterThan(5);
  expect(asked.every((a) => a.rays === 2048)).toBe(true);
  await vi.advanceTimersByTimeAsync(1000);
  expect(seen.at(-1)).toBe(60);
});

test("shows slow coarse simulations while a control moves", async () => {
  const { asked, engine } = fake(4000);
  const state = new History(initialState());
  const simulation = new Simulation(engine, state);
  const seen: unknown[] = [];
  simulation.shown.subscribe((shown) => shown && seen.push((shown.spectrum as unknown as { cm: number }).cm));
  for (let cm = 1; cm <= 100; cm++) {
    move(state, cm);
    await vi.advanceTimersByTimeAsync(100);
  }
  // At 4 and 8 s, each followed by the value of that time.
  expect(asked.map((a) => a.cm)).toEqual([1, 40, 80]);
  expect(seen).toEqual([1, 40]);
  await vi.advanceTimersByTimeAsync(8000);
  expect(seen).toEqual([1, 40, 80, 100]);
});

test("makes fewer walks while they are slow", async () => {
  let perWalk = 1;
  const { asked, engine } = fake((rays) => rays * perWalk);
  const state = new History(initialState());
  const simulation = new Simulation(engine, state);
  const coarse = async (cm: number) => {
    move(state, cm);
    const { rays } = asked.at(-1)!;
    await vi.advanceTimersByTimeAsync(rays * perWalk + 1);
    expect(simulation.shown.value!.spectrum.rays).toBe(rays);
    return rays;
  };
  // 2 s, then 0.26 s; 0.5 s are neither slow nor fast
  expect([await coarse(1), await coarse(2), await coarse(3)]).toEqual([2048, 256, 2048]);
  perWalk = 2;
  expect([await coarse(4), await coarse(5)]).toEqual([256, 256]);
});

test("counts the seconds of a curve that does not come, from the last change", async () => {
  const { engine } = fake(5000);
  const state = new History(initialState());
  const simulation = new Simulation(engine, state);
  move(state, 1);
  await vi.advanceTimersByTimeAsync(3500);
  expect([simulation.waited.value, simulation.pending.value]).toEqual([3, 2048]);
  move(state, 2);
  await vi.advanceTimersByTimeAsync(1000);
  expect(simulation.waited.value).toBeLessThanOrEqual(1);
  await vi.advanceTimersByTimeAsync(6000);
  expect([simulation.stale.value, simulation.waited.value]).toEqual([false, 0]);
});

test("drops a coarse simulation that is stuck once the sample has changed", async () => {
  const { asked, engine } = fake(60_000);
  const state = new History(initialState());
  new Simulation(engine, state);
  move(state, 1);
  await vi.advanceTimersByTimeAsync(100);
  move(state, 2);
  await vi.advanceTimersByTimeAsync(19_000);
  expect(asked.map((a) => a.cm)).toEqual([1]);
  await vi.advanceTimersByTimeAsync(1000);
  expect(asked.map((a) => a.cm)).toEqual([1, 2]);
});

test("does not blame the snow when the engine is gone", async () => {
  const gone = () => Promise.reject(new Gone("The program does not answer."));
  const simulation = new Simulation({ name: "gone", ask: gone, askLatest: gone } as unknown as Engine, new History(initialState()));
  simulation.start();
  await vi.advanceTimersByTimeAsync(1000);
  expect([simulation.refused.value, simulation.pending.value]).toEqual([null, 0]);
});

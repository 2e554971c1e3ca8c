import { describe, expect, test } from "vitest";
import { accept, fromFragment, toFragment } from "../src/fragment";
import { History, initialState } from "../src/state";
import { addGrain, moveLayer, moveMean, newLayer, removeGrain, shareOut, shares, withLayer, withSizeKind } from "../src/snow/edit";
import { help } from "../src/snow/schema";

const thicker = (cm: number) => withLayer(initialState().sample, 0, (layer) => ({ ...layer, thickness_cm: cm }));

describe("undo", () => {
  test("goes back and forth", () => {
    const state = new History(initialState(), () => 0);
    state.set({ sample: thicker(20) });
    state.set({ scale: "log" });
    expect([state.canUndo, state.canRedo]).toEqual([true, false]);
    state.undo();
    expect(state.get().scale).toBe("linear");
    state.undo();
    expect(state.get()).toEqual(initialState());
    expect(state.undo()).toBe(false);
    state.redo();
    state.redo();
    expect([state.get().scale, state.get().sample.layer[0]!.thickness_cm]).toEqual(["log", 20]);
  });

  test("takes the moves of one control together, but not after a pause", () => {
    let now = 0;
    const state = new History(initialState(), () => now);
    for (const cm of [13, 14, 15]) {
      now += 100;
      state.set({ sample: thicker(cm) }, "thickness");
    }
    now += 5000;
    state.set({ sample: thicker(16) }, "thickness");
    state.undo();
    expect(state.get().sample.layer[0]!.thickness_cm).toBe(15);
    state.undo();
    expect(state.get().sample.layer[0]!.thickness_cm).toBe(12);
  });

  test("does not count the panel, and stays on it", () => {
    const state = new History(initialState());
    state.set({ panel: "colour" });
    expect(state.canUndo).toBe(false);
    state.set({ exposure_stops: 3 });
    state.set({ panel: "take" });
    state.undo();
    expect([state.get().panel, state.get().exposure_stops]).toEqual(["take", 0]);
  });

  test("tells listeners what changed", () => {
    const state = new History(initialState());
    const seen: string[] = [];
    state.subscribe((_, changed) => seen.push([...changed].join()));
    state.set({ scale: "log", range: "visible" });
    state.set({ scale: "log" });
    expect(seen).toEqual(["scale"]);
  });
});

describe("link", () => {
  test("reproduces the whole state", async () => {
    const state = {
      ...initialState(),
      sample: thicker(33.3),
      panel: "colour" as const,
      held: [{ name: "Held A", sample: initialState().sample, files: { "a.csv": "1,2\n" }, rays: 16384 }],
      measured: { name: "field µ.csv", text: "nm,r\n400,0.9\n" },
      droppedLight: { name: "lamp", wavelengths_nm: [400, 700], power: [1, 2] },
      light: "lamp",
      exposure_stops: -1.5,
      directions: { wavelength_nm: 600 },
    };
    const fragment = await toFragment(state);
    expect(fragment).toMatch(/^#z=[A-Za-z0-9_-]+$/);
    expect(await fromFragment(fragment)).toEqual(state);
  });

  test("is empty at first, and reads without compression", async () => {
    expect(await toFragment(initialState())).toBe("");
    expect(await fromFragment("")).toBeNull();
    expect((await fromFragment(`#j=${btoa('{"scale":"log"}').replaceAll("=", "")}`))?.scale).toBe("log");
  });

  test("refuses what is damaged", async () => {
    for (const bad of ["#z=AAAA", "#j=AAAA", "#hello", "#z=_-_-", `#j=${btoa("[")}`]) await expect(fromFragment(bad)).rejects.toThrow("damaged");
  });

  test("refuses a link that unpacks to far more than it is", async () => {
    const huge = { ...initialState(), measured: { name: "x", text: " ".repeat(5_000_000) } };
    await expect(fromFragment(await toFragment(huge))).rejects.toThrow("damaged");
  });

  test("leaves out what has the wrong shape", () => {
    const wrong = { sample: { version: 1, layer: [{}] }, panel: "x", held: [1], exposure_stops: "2", measured: {}, files: { a: 1 }, seed: -1, layer: 7 };
    expect(accept(wrong)).toEqual(initialState());
    for (const other of [null, 1, "x", []]) expect(accept(other)).toEqual(initialState());
  });

  test("leaves out a sample in which one field has the wrong type", () => {
    const sound = initialState().sample;
    const layer = sound.layer[0]!;
    const grain = layer.grain[0]!;
    const law = { min: 0, max: 1, mean: 0.5, sd: 0.1 };
    const withGrain = (change: object) => ({ ...sound, layer: [{ ...layer, grain: [{ ...grain, ...change }] }] });
    const withLayer = (change: object) => ({ ...sound, layer: [{ ...layer, ...change }] });
    const wrong = [
      ...["abc", null, {}].map((angle) => ({ ...sound, illumination: { incidence_angle_deg: angle } })),
      { ...sound, illumination: {} },
      { ...sound, illumination: { diffuse: false } },
      { ...sound, wavelengths: { values_nm: "all" } },
      ...["black_carbon", "brown_carbon"].flatMap((name) => [
        withLayer({ [name]: 7 }),
        withLayer({ [name]: { concentration_ng_g: 1, sedimentation: "x" } }),
        withLayer({ [name]: { concentration_ng_g: 1, concentration_per: 3 } }),
      ]),
      withLayer({ density_kg_m3: "q", wet_density_kg_m3: 300 }),
      withLayer({ temperature_c: null }),
      withGrain({ size_um: { min: "a" }, ssa_m2_kg: 20 }),
      withGrain({ optical_radius_um: "r" }),
      withGrain({ shape: {} }),
      withGrain({ sphericity: { ...law, sd: "s" } }),
      withGrain({ aspect_ratio: null }),
    ];
    for (const sample of wrong) expect(accept({ sample }).sample, JSON.stringify(sample)).toEqual(sound);
    const good = withLayer({ black_carbon: { concentration_ng_g: 5, concentration_per: "wet_mass", angstrom_exponent: 1 } });
    expect(accept({ sample: good }).sample).toEqual(good);
  });
});

describe("changes of a sample", () => {
  test("a half space that leaves the base becomes a metre", () => {
    const sample = { ...initialState().sample, layer: [{ ...newLayer(), thickness_cm: "inf" as const }, newLayer()] };
    expect(moveLayer(sample, 0, 1).layer.map((l) => l.thickness_cm)).toEqual([5, 100]);
  });

  test("shares sum to 1", () => {
    for (const value of [0, 0.123456, 0.5, 1]) {
      const all = shareOut([0.2, 0.3, 0.5], 1, value);
      expect(all[1]).toBeCloseTo(value, 6);
      expect(all.reduce((a, b) => a + b)).toBeCloseTo(1, 9);
    }
    const three = addGrain(addGrain(newLayer()));
    expect(shares(three).map((s) => s.toFixed(2))).toEqual(["0.33", "0.33", "0.33"]);
    const one = removeGrain(removeGrain(three, 0), 0);
    expect(one.grain[0]!.fraction).toBeUndefined();
  });

  test("a law moves with its mean and keeps it between its limits", () => {
    const law = { min: 0.2, max: 0.4, mean: 0.3, sd: 0.07 };
    expect(moveMean(law, 0.5, 0, 1, 0.1)).toEqual({ min: 0.4, max: 0.6, mean: 0.5, sd: 0.07 });
    const end = moveMean(law, 1, 0, 1, 0.1);
    expect(end).toEqual({ min: 0.9, max: 1, mean: 1, sd: 0.07 });
    expect(moveMean(end, 0.5, 0, 1, 0.1)).toEqual({ min: 0.4, max: 0.6, mean: 0.5, sd: 0.07 });
  });

  test("the size can be given another way", () => {
    const grain = withSizeKind(newLayer().grain[0]!, "ssa_m2_kg", { ssa_m2_kg: 20.33, optical_radius_um: 160 });
    expect([grain.ssa_m2_kg, grain.size_um]).toEqual([20.3, undefined]);
  });

  test("every control is explained by the schema", () => {
    expect(help("layer.grain.size_um")).toContain("um");
    expect(() => help("layer.nothing")).toThrow();
  });
});

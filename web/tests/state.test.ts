import { deflateRawSync } from "node:zlib";
import { describe, expect, test } from "vitest";
import { accept, fromFragment, MOST_BYTES, MOST_CHARACTERS, toLink } from "../src/fragment";
import { droppedName, History, initialState } from "../src/state";
import { MOST_POINTS, pointsOf } from "../src/spectra/points";
import { addAbsorber, addGrain, freeName, moveLayer, moveMean, newLayer, removeAbsorber, removeGrain, shareOut, shares, substance, usedFiles, withLayer, withSizeKind, withSubstance } from "../src/snow/edit";
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
      measured: { name: "field µ.csv", text: "nm,r\n400,0.9\n", notes: ["read"] },
      droppedLight: { name: droppedName("lamp"), wavelengths_nm: [400, 700], power: [1, 2] },
      light: droppedName("lamp"),
      exposure_stops: -1.5,
      directions: { wavelength_nm: 600 },
    };
    const { fragment, omitted } = await toLink(state);
    expect(omitted).toEqual([]);
    expect(fragment).toMatch(/^#z=[A-Za-z0-9_-]+$/);
    expect(await fromFragment(fragment)).toEqual(state);
  });

  test("is empty at first, and reads without compression", async () => {
    expect((await toLink(initialState())).fragment).toBe("");
    expect(await fromFragment("")).toBeNull();
    expect((await fromFragment(`#j=${btoa('{"scale":"log"}').replaceAll("=", "")}`))?.scale).toBe("log");
  });

  test("refuses what is damaged", async () => {
    for (const bad of ["#z=AAAA", "#j=AAAA", "#hello", "#z=_-_-", `#j=${btoa("[")}`]) await expect(fromFragment(bad)).rejects.toThrow("damaged");
  });

  test("refuses a link that unpacks to far more than it is", async () => {
    const huge = JSON.stringify({ measured: { name: "x", text: " ".repeat(MOST_BYTES) } });
    await expect(fromFragment(`#z=${deflateRawSync(huge).toString("base64url")}`)).rejects.toThrow("damaged");
  });

  test("is written without the measured file if it would be too long", async () => {
    const state = { ...initialState(), scale: "log" as const, measured: { name: "x", text: " ".repeat(MOST_BYTES) } };
    const noise = Array.from({ length: 300_000 }, (_, i) => String(Math.sin(i))).join("\n").slice(0, MOST_BYTES - 1000);
    for (const text of [" ".repeat(MOST_BYTES), noise]) {
      const { fragment, omitted } = await toLink({ ...state, measured: { name: "x", text } });
      expect(omitted).toEqual(["measured"]);
      expect(fragment.length).toBeLessThan(MOST_CHARACTERS);
      expect(await fromFragment(fragment)).toEqual({ ...state, measured: null });
    }
  });

  test("keeps few points of a long measured file", async () => {
    const n = 300_001;
    const nm = Array.from({ length: n }, (_, i) => 350 + (i * 2150) / (n - 1));
    const values = nm.map((x) => 0.5 + 0.4 * Math.sin(x));
    const kept = pointsOf("long.csv", { quantity: "reflectance", wavelengths_nm: nm, values, notes: ["read"], residuals: [], overall: null, bands: [] });
    const lines = kept.text.trim().split("\n");
    expect(lines[0]).toBe("wavelength_nm,reflectance");
    expect(lines.length - 1).toBeLessThanOrEqual(MOST_POINTS);
    expect(lines.length - 1).toBeGreaterThan(MOST_POINTS / 2);
    expect(kept.notes![1]).toContain("300001 points");
    // Dense at one end: the rest stays as it is.
    const uneven = [...Array.from({ length: 20_000 }, (_, i) => 400 + i / 200), ...Array.from({ length: 80 }, (_, i) => 520 + 20 * i)];
    const rows = pointsOf("uneven.csv", { quantity: "reflectance", wavelengths_nm: uneven, values: uneven, notes: [], residuals: [], overall: null, bands: [] });
    const left = rows.text.trim().split("\n").slice(1).map((line) => Number(line.split(",")[0]));
    expect(Math.max(...left.slice(1).map((x, i) => x - left[i]!))).toBeLessThanOrEqual(25);
    const { fragment, omitted } = await toLink({ ...initialState(), measured: kept });
    expect(omitted).toEqual([]);
    expect((await fromFragment(fragment))!.measured).toEqual(kept);
  });

  test("cannot put a dropped light in the place of a built-in one", () => {
    const { light, droppedLight } = accept({ light: "A", droppedLight: { name: "D65", wavelengths_nm: [400, 700], power: [1, 1] } });
    expect([light, droppedLight!.name]).toEqual(["A", "D65 (file)"]);
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
      ...[7, [7], [{ species: 1 }], [{ concentration_ug_g: "x" }], [{ mass_absorption_efficiency_m2_g: ["a"] }], Array(101).fill({})].map((absorber) => withLayer({ absorber })),
      withLayer({ density_kg_m3: "q", wet_density_kg_m3: 300 }),
      withLayer({ temperature_c: null }),
      withGrain({ size_um: { min: "a" }, ssa_m2_kg: 20 }),
      withGrain({ optical_radius_um: "r" }),
      withGrain({ shape: {} }),
      withGrain({ sphericity: { ...law, sd: "s" } }),
      withGrain({ aspect_ratio: null }),
    ];
    for (const sample of wrong) expect(accept({ sample }).sample, JSON.stringify(sample)).toEqual(sound);
    const dusty = withLayer({ absorber: [{ species: "dust_china", concentration_ug_g: 5, phase: "pores" }, { file: "a.csv", concentration_ng_g: 1 }] });
    expect(accept({ sample: dusty }).sample).toEqual(dusty);
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

  test("an absorber keeps its mass when it becomes another substance, and its file goes with it", () => {
    const dusty = addAbsorber(addAbsorber(newLayer()));
    const [dust] = dusty.absorber!;
    expect(withSubstance(withSubstance(dust!, { file: "a.csv" }), { species: "volcanic_ash" })).toEqual({ ...dust, species: "volcanic_ash" });
    expect(substance(withSubstance(dust!, "law"))).toBe("law");
    expect(removeAbsorber(removeAbsorber(dusty, 1), 0)).toEqual(newLayer());
    const sample = { ...initialState().sample, layer: [{ ...dusty, absorber: [withSubstance(dust!, { file: "a.csv" })] }], substrate: { reflectance: "b.csv" } };
    expect(usedFiles(sample, { "a.csv": "1", "b.csv": "2", "c.csv": "3" })).toEqual({ "a.csv": "1", "b.csv": "2" });
    expect([freeName("a.csv", "1", { "a.csv": "1" }), freeName("a.csv", "2", { "a.csv": "1", "a 2.csv": "0" }), freeName("a", "2", { a: "1" })]).toEqual(["a.csv", "a 3.csv", "a 2"]);
  });

  test("every control is explained by the schema", () => {
    expect(help("layer.grain.size_um")).toContain("um");
    expect(() => help("layer.nothing")).toThrow();
  });
});

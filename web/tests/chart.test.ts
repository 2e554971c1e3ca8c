// The axes of charts, on the screen and as SVG.
import { describe, expect, test } from "vitest";
import type { Curve } from "../src/curves";
import { rangeOfPlaces, rangeOfValues } from "../src/draw/chart";
import { ticks, ticksOfLog } from "../src/draw/ticks";
import { svgOf } from "../src/svg";

const names = { x: "x", y: "y" };
const curve = (y: number[], more: Partial<Curve> = {}): Curve => ({ name: "one", x: y.map((_, i) => 400 + 100 * i), y, colour: "--ink", ...more });

describe("axes", () => {
  test("hold all curves with their bands", () => {
    const curves = [curve([0.5, 0.7]), curve([0.2, 0.3, 0.4], { band: [0.1, 0.1, 0.3] })];
    expect(rangeOfPlaces(curves, names)).toEqual([400, 600]);
    const [low, high] = rangeOfValues(curves, names);
    expect([low, high]).toEqual([expect.closeTo(0.1 - 0.04 * 0.6, 12), expect.closeTo(0.7 + 0.04 * 0.6, 12)]);
    expect(rangeOfValues(curves, { ...names, low: 0, high: 1 })).toEqual([0, 1]);
    // What lies outside the range of places does not count.
    expect(rangeOfValues([curve([0.5, 0.5, 9])], { ...names, xRange: [400, 500] })).toEqual([0.23, 0.77]);
  });

  test("begin at 0 where values nearly do", () => {
    expect(rangeOfValues([curve([0.01, 1])], names)[0]).toBe(0);
    expect(rangeOfValues([curve([0.5, 1])], { ...names, low: 0 })[0]).toBe(0);
    expect(rangeOfValues([curve([-0.01, 1])], names)[0]).toBeLessThan(-0.01);
  });

  test("are there without curves and for a single value", () => {
    for (const curves of [[], [curve([])], [curve([Number.NaN])], [curve([0])], [curve([0.3])]]) {
      const [low, high] = rangeOfValues(curves, names);
      expect(high).toBeGreaterThan(low);
    }
  });

  test("logarithmic ones go from a power of ten to 1, not below a millionth", () => {
    const log = { ...names, log: true };
    expect(rangeOfValues([curve([0.003, 0.5])], log)).toEqual([0.001, 1]);
    expect(rangeOfValues([curve([0, 0.5])], log)).toEqual([1e-6, 1]);
    expect(rangeOfValues([curve([0.5, 0.9])], log)).toEqual([0.1, 1]);
    expect(ticksOfLog(0.1, 1)).toEqual([0.1, 0.2, 0.5, 1]);
    expect(ticksOfLog(1e-6, 1)).toEqual([1e-6, 1e-5, 1e-4, 0.001, 0.01, 0.1, 1]);
  });
});

test("a drawing has the ticks and the curves of the screen", () => {
  const curves = [curve([0.2, 0.9, 0.4], { band: [0.1, 0.1, 0.1] }), curve([0.1, 0.2], { name: "<two>", style: "points" })];
  const svg = svgOf(curves, { ...names, low: 0, high: 1 }, "Share", "caption", () => "#000");
  for (const tick of ticks(0, 1, 7)) expect(svg).toContain(`>${tick}</text>`);
  expect(svg.match(/<polyline/g)).toHaveLength(1);
  expect(svg.match(/<polygon/g)).toHaveLength(1);
  // Two points and the mark of the legend.
  expect(svg.match(/<circle/g)).toHaveLength(3);
  expect(svg).toContain("&lt;two&gt;");
});

import { expect, test } from "vitest";
import { parseNumber, stepped } from "../src/number";

test("numbers have a decimal point or comma", () => {
  const good: [string, number][] = [["12.5", 12.5], ["12,5", 12.5], [" -3 ", -3], ["−3", -3], [".5", 0.5], [",5", 0.5], ["7.", 7], ["1e3", 1000], ["1,5E-2", 0.015]];
  for (const [given, value] of good) expect(parseNumber(given), given).toBe(value);
  for (const bad of ["", " ", "1e999", "abc", "12,5,6", "1,234.5", "1 000", "12cm", "0x10", "Infinity", "NaN", "-", "1e"]) {
    expect(parseNumber(bad), bad).toBeNull();
  }
});

test("arrow keys keep decimal numbers short and stay within the range", () => {
  expect(stepped(0.1, 0.2, 0, 1)).toBe(0.3);
  expect(stepped(0.95, 0.1, 0, 1)).toBe(1);
  expect(stepped(0.05, -0.1, 0, 1)).toBe(0);
  // A number that was typed beyond the range stays there.
  expect(stepped(5, 0.1, 0, 1)).toBe(5.1);
});

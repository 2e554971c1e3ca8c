// Round numbers for axes and scale bars, and numbers as text.

/** About `count` round numbers from `low` to `high`, in steps of 1, 2 or 5 times a power of ten. */
export function ticks(low: number, high: number, count = 5): number[] {
  if (!(high > low) || !Number.isFinite(high - low)) return [low];
  const rough = (high - low) / Math.max(count, 1);
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = power * ([1, 2, 5].find((factor) => factor * power >= rough * 0.999) ?? 10);
  const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  const list: number[] = [];
  const first = Math.ceil(low / step - 1e-9);
  for (let i = first; i * step <= high + step * 1e-9; i++) {
    list.push(Number((i * step).toFixed(Math.min(digits, 20))));
  }
  return list;
}

/** The powers of ten from `low` to `high`, and between them where there are few. */
export function ticksOfLog(low: number, high: number): number[] {
  const factors = high / low > 150 ? [1] : [1, 2, 5];
  const list: number[] = [];
  for (let power = Math.floor(Math.log10(low) + 1e-9); 10 ** power <= high * 1.0001; power++) {
    for (const factor of factors) list.push(Number((factor * 10 ** power).toPrecision(3)));
  }
  return list.filter((tick) => tick >= low * 0.9999 && tick <= high * 1.0001);
}

/** A number with `digits` significant digits, without an exponent where it is easy to read. */
export function number(value: number, digits = 3): string {
  if (!Number.isFinite(value)) return Number.isNaN(value) ? "-" : value > 0 ? "infinite" : "-infinite";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e6 || size < 1e-4) {
    const [mantissa, exponent] = value.toExponential(digits - 1).split("e") as [string, string];
    return `${trim(mantissa)}e${Number(exponent)}`.replace("-", "\u2212").replace("e-", "e\u2212");
  }
  const rounded = size >= 10 ** digits ? Math.round(value).toString() : value.toPrecision(digits);
  return trim(Number(rounded).toFixed(decimals(rounded))).replace("-", "\u2212");
}

function decimals(text: string): number {
  return text.includes(".") ? text.split(".")[1]!.length : 0;
}

function trim(text: string): string {
  return text.includes(".") ? text.replace(/\.?0+$/, "") : text;
}

/** A share as a percentage with two significant digits. */
export function percent(share: number): string {
  return `${number(100 * share, 2)}\u00a0%`;
}

/** A number of bytes in the unit that suits it. */
export function bytes(count: number): string {
  if (count < 1000) return `${count} bytes`;
  if (count < 1e6) return `${number(count / 1000)} kB`;
  return `${number(count / 1e6)} MB`;
}

/** A whole number in groups of three digits. */
export function grouped(count: number): string {
  return String(count).replace(/\B(?=(\d{3})+(?!\d))/g, "\u202f");
}

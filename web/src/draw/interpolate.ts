// Smooth interpolation between nodes, without overshoot: cubic Hermite pieces whose slopes are
// limited as Fritsch and Carlson do, so that no hump appears that the nodes do not have.

/** Slopes at the nodes `x` (strictly increasing) with values `y`. */
export function slopes(x: readonly number[], y: readonly number[]): number[] {
  const n = x.length;
  if (n < 2) return y.map(() => 0);
  const step = (i: number) => x[i + 1]! - x[i]!;
  const chord = (i: number) => (y[i + 1]! - y[i]!) / step(i);
  return x.map((_, i) => {
    if (i === 0) return chord(0);
    if (i === n - 1) return chord(n - 2);
    const [before, after] = [chord(i - 1), chord(i)];
    if (before * after <= 0) return 0;
    // The weighted harmonic mean keeps the curve monotone between the nodes.
    const [a, b] = [2 * step(i) + step(i - 1), step(i) + 2 * step(i - 1)];
    return (a + b) / (a / before + b / after);
  });
}

/** Index of the piece of `x` that holds `at`; the outer pieces hold what lies beyond. */
export function piece(x: readonly number[], at: number): number {
  let [low, high] = [0, x.length - 1];
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (x[middle]! <= at) low = middle;
    else high = middle;
  }
  return low;
}

/** Value at `at` of the curve through `x`, `y` with `slope` at the nodes; constant beyond the ends. */
export function hermite(
  x: readonly number[],
  y: readonly number[],
  slope: readonly number[],
  at: number,
): number {
  const n = x.length;
  if (n === 1 || at <= x[0]!) return y[0]!;
  if (at >= x[n - 1]!) return y[n - 1]!;
  const i = piece(x, at);
  const width = x[i + 1]! - x[i]!;
  const t = (at - x[i]!) / width;
  const [t2, t3] = [t * t, t * t * t];
  return (
    (2 * t3 - 3 * t2 + 1) * y[i]! +
    (t3 - 2 * t2 + t) * width * slope[i]! +
    (3 * t2 - 2 * t3) * y[i + 1]! +
    (t3 - t2) * width * slope[i + 1]!
  );
}

/** The value at `at` on straight lines between the nodes; constant beyond the ends. */
export function linear(x: readonly number[], y: readonly number[], at: number): number {
  const n = x.length;
  if (n === 1 || at <= x[0]!) return y[0]!;
  if (at >= x[n - 1]!) return y[n - 1]!;
  const i = piece(x, at);
  const t = (at - x[i]!) / (x[i + 1]! - x[i]!);
  return (1 - t) * y[i]! + t * y[i + 1]!;
}

/**
 * A field over the hemisphere, even in the azimuth: given at views [0, 90) and relative azimuths
 * from 0 to 180 degrees, or at one azimuth if it does not depend on it.
 */
export class Hemisphere {
  readonly views: readonly number[];
  readonly azimuths: readonly number[];
  readonly values: readonly (readonly number[])[];
  /// Largest view that the field is given at, degrees.
  readonly edge: number;

  /** `values` is `[view][azimuth]`. */
  constructor(
    views: readonly number[],
    azimuths: readonly number[],
    values: readonly (readonly number[])[],
  ) {
    this.views = views;
    this.azimuths = azimuths;
    // All azimuths are one direction at the normal, so they share a value there.
    this.values = values.map((row, i) => {
      if (views[i] !== 0) return row;
      const mean = row.reduce((sum, value) => sum + value, 0) / row.length;
      return row.map(() => mean);
    });
    this.edge = views[views.length - 1] ?? 0;
  }

  /** Value at a view angle and any azimuth, degrees. */
  at(view: number, azimuth: number): number {
    const phi = fold(azimuth);
    // Along a diameter the field goes on smoothly through the normal: its nodes lie at both
    // azimuths, the opposite one at negative angles.
    const ahead = this.values.map((row) => this.around(row, phi));
    if (this.azimuths.length === 1 && this.views[0] !== 0) {
      return hermite(this.views, ahead, slopes(this.views, ahead), view);
    }
    const behind = this.values.map((row) => this.around(row, 180 - phi));
    const from = this.views[0] === 0 ? 1 : 0;
    const x = [...this.views.slice(from).map((v) => -v).reverse(), ...this.views];
    const y = [...behind.slice(from).reverse(), ...ahead];
    return hermite(x, y, slopes(x, y), view);
  }

  private around(row: readonly number[], phi: number): number {
    if (row.length === 1) return row[0]!;
    const slope = slopes(this.azimuths, row);
    // Mirrored at 0 and 180 degrees, the field is level there.
    if (this.azimuths[0] === 0) slope[0] = 0;
    if (this.azimuths[row.length - 1] === 180) slope[row.length - 1] = 0;
    return hermite(this.azimuths, row, slope, phi);
  }

  /** The field at every degree, `[view][azimuth]`, azimuths 0 to 180, views 0 to the edge. */
  everyDegree(): number[][] {
    const last = Math.floor(this.edge);
    const table: number[][] = Array.from({ length: last + 1 }, () => new Array<number>(181));
    const columns = Array.from({ length: 181 }, (_, phi) =>
      this.values.map((row) => this.around(row, phi)),
    );
    const from = this.views[0] === 0 ? 1 : 0;
    const x = [...this.views.slice(from).map((v) => -v).reverse(), ...this.views];
    for (let phi = 0; phi <= 180; phi++) {
      const y = [...columns[180 - phi]!.slice(from).reverse(), ...columns[phi]!];
      const slope = slopes(x, y);
      for (let view = 0; view <= last; view++) table[view]![phi] = hermite(x, y, slope, view);
    }
    return table;
  }
}

/** Any azimuth as the one of the half plane that mirrors it, 0 to 180 degrees. */
export function fold(azimuth: number): number {
  const turn = ((azimuth % 360) + 360) % 360;
  return turn > 180 ? 360 - turn : turn;
}

/** A table of every degree between its entries, linear in both angles. */
export function bilinear(table: readonly (readonly number[])[], view: number, phi: number): number {
  const i = Math.min(Math.floor(view), table.length - 1);
  const j = Math.min(Math.floor(phi), 180);
  const [i1, j1] = [Math.min(i + 1, table.length - 1), Math.min(j + 1, 180)];
  const [s, t] = [Math.min(view - i, 1), phi - j];
  const [low, high] = [table[i]!, table[i1]!];
  return (
    (1 - s) * ((1 - t) * low[j]! + t * low[j1]!) + s * ((1 - t) * high[j]! + t * high[j1]!)
  );
}

// A colour map from dark blue over grey to yellow: lightness rises evenly, and blue against yellow
// can be told apart by people with any common kind of colour blindness. It is a straight line in
// the colour space Oklab, bent a little so that its middle is not dull.

type Rgb = [number, number, number];

function encode(linear: number): number {
  const clipped = Math.min(1, Math.max(0, linear));
  const value = clipped <= 0.0031308 ? 12.92 * clipped : 1.055 * clipped ** (1 / 2.4) - 0.055;
  return Math.round(255 * value);
}

function fromOklab(lightness: number, a: number, b: number): Rgb {
  const l = (lightness + 0.3963377774 * a + 0.2158037573 * b) ** 3;
  const m = (lightness - 0.1055613458 * a - 0.0638541728 * b) ** 3;
  const s = (lightness - 0.0894841775 * a - 1.291485548 * b) ** 3;
  return [
    encode(4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s),
    encode(-1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s),
    encode(-0.0041960863 * l - 0.7034186147 * m + 1.707614701 * s),
  ];
}

const table: Rgb[] = Array.from({ length: 256 }, (_, i) => {
  const t = i / 255;
  const bend = Math.sin(Math.PI * t);
  return fromOklab(0.24 + 0.7 * t, -0.02 * t - 0.035 * bend, -0.11 + 0.25 * t);
});

/** Colour of a share from 0 to 1 of the scale, sRGB 0 to 255. */
export function colour(share: number): Rgb {
  const at = Number.isFinite(share) ? share : 0;
  return table[Math.min(255, Math.max(0, Math.round(255 * at)))]!;
}

export function css(share: number): string {
  const [r, g, b] = colour(share);
  return `rgb(${r} ${g} ${b})`;
}

// The points of a measured file, as the short text that the state and a link keep of it.
import type { Measured } from "../messages";
import type { MeasuredFile } from "../page";

/// More points than this are thinned.
export const MOST_POINTS = 5000;
/// Thinning makes no wider gaps than this; the engine interpolates across up to 30 nm.
const MOST_GAP_NM = 5;
/// Larger files are not read, bytes.
export const MOST_FILE_BYTES = 16e6;

/// What is kept of a file that the engine has read.
export function pointsOf(name: string, { quantity, wavelengths_nm, values, notes }: Measured): MeasuredFile {
  const every = Math.ceil(wavelengths_nm.length / MOST_POINTS);
  let last = -Infinity;
  const kept = wavelengths_nm.flatMap((nm, i) => {
    if (i % every !== 0 && !(wavelengths_nm[i + 1]! - last > MOST_GAP_NM)) return [];
    last = nm;
    return [`${short(nm)},${short(values[i]!)}`];
  });
  const thinned = every > 1 ? [`Of its ${wavelengths_nm.length} points one in ${every} is kept.`] : [];
  return { name, text: `wavelength_nm,${quantity}\n${kept.join("\n")}\n`, notes: [...notes, ...thinned] };
}

function short(value: number): string {
  return String(Number(value.toPrecision(7)));
}

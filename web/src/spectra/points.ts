// The points of a measured file, as the short text that the state and a link keep of it.
import type { Measured } from "../messages";
import type { MeasuredFile } from "../page";

/// More points than this are thinned.
export const MOST_POINTS = 5000;
/// Larger files are not read, bytes.
export const MOST_FILE_BYTES = 16e6;

/// What is kept of a file that the engine has read.
export function pointsOf(name: string, { quantity, wavelengths_nm, values, notes }: Measured): MeasuredFile {
  const every = Math.ceil(wavelengths_nm.length / MOST_POINTS);
  const kept = wavelengths_nm.flatMap((nm, i) => (i % every === 0 ? [`${short(nm)},${short(values[i]!)}`] : []));
  const thinned = every > 1 ? [`Of its ${wavelengths_nm.length} points one in ${every} is kept.`] : [];
  return { name, text: `wavelength_nm,${quantity}\n${kept.join("\n")}\n`, notes: [...notes, ...thinned] };
}

function short(value: number): string {
  return String(Number(value.toPrecision(7)));
}

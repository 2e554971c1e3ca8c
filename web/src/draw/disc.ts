// A field over the hemisphere as a polar disc: the normal in the middle, the horizon at the rim,
// forward to the right, back toward the light to the left.

import { fitCanvas } from "../dom";
import { type Theme } from "./canvas";
import { colour, css } from "./colourmap";
import { bilinear, fold, type Hemisphere } from "./interpolate";
import { number, ticks } from "./ticks";

export interface Disc {
  field: Hemisphere;
  /// Range of the colours.
  low: number;
  high: number;
  /// Caption of the scale bar, with the unit.
  caption: string;
  /// A direction to mark, with its name.
  mark?: { view: number; azimuth: number; name: string };
  cursor?: { view: number; azimuth: number } | null;
  /// Whether the sides are named: not if the beam comes along the normal.
  sides: boolean;
}

const MARGIN = 22;
const BAR = 62;
const picture = new WeakMap<HTMLCanvasElement, { key: string; field: Hemisphere; image: OffscreenCanvas | HTMLCanvasElement }>();

function layout(width: number) {
  const radius = (width - 2 * MARGIN) / 2;
  return { radius, x: width / 2, y: MARGIN + radius, height: width + BAR };
}

/** Direction under a point of the canvas (CSS pixels); null outside the disc. */
export function direction(
  width: number,
  x: number,
  y: number,
): { view: number; azimuth: number } | null {
  const place = layout(width);
  const [dx, dy] = [x - place.x, place.y - y];
  const view = (90 * Math.hypot(dx, dy)) / place.radius;
  if (view > 90) return null;
  const azimuth = (Math.atan2(dy, dx) * 180) / Math.PI;
  return { view, azimuth: azimuth < 0 ? azimuth + 360 : azimuth };
}

/** Place of a direction on the canvas, CSS pixels. */
export function place(width: number, view: number, azimuth: number): [number, number] {
  const { radius, x, y } = layout(width);
  const [r, phi] = [(radius * view) / 90, (azimuth * Math.PI) / 180];
  return [x + r * Math.cos(phi), y - r * Math.sin(phi)];
}

/** Levels of the contours and of the scale bar. */
export function levels(low: number, high: number): number[] {
  return ticks(low, high, 5);
}

function paint(disc: Disc, diameter: number): HTMLCanvasElement {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = diameter;
  const context = canvas.getContext("2d")!;
  const image = context.createImageData(diameter, diameter);
  const table = disc.field.everyDegree();
  const radius = diameter / 2;
  const edge = Math.floor(disc.field.edge);
  const span = disc.high - disc.low || 1;
  const contours = levels(disc.low, disc.high);
  const apart = contours.length > 1 ? contours[1]! - contours[0]! : span;
  const values = new Float64Array(diameter * diameter).fill(Number.NaN);
  for (let j = 0; j < diameter; j++) {
    for (let i = 0; i < diameter; i++) {
      const [dx, dy] = [i + 0.5 - radius, radius - j - 0.5];
      const view = (90 * Math.hypot(dx, dy)) / radius;
      if (view > edge) continue;
      values[j * diameter + i] = bilinear(table, view, fold((Math.atan2(dy, dx) * 180) / Math.PI));
    }
  }
  for (let j = 0; j < diameter; j++) {
    for (let i = 0; i < diameter; i++) {
      const k = j * diameter + i;
      const value = values[k]!;
      if (Number.isNaN(value)) continue;
      const share = (value - disc.low) / span;
      let [r, g, b] = colour(share);
      // Contours: near a level, by the distance in pixels that the slope tells.
      const right = i + 1 < diameter ? values[k + 1]! - value : Number.NaN;
      const below = j + 1 < diameter ? values[k + diameter]! - value : Number.NaN;
      const slope = Math.hypot(right || 0, below || 0);
      if (slope > 0) {
        const level = Math.round(value / apart) * apart;
        const line = 0.55 * Math.max(0, Math.min(1, 1.1 - Math.abs(value - level) / slope));
        const to = (level - disc.low) / span > 0.55 ? 0 : 255;
        [r, g, b] = [r + line * (to - r), g + line * (to - g), b + line * (to - b)];
      }
      // The rim fades within a pixel.
      const view = (90 * Math.hypot(i + 0.5 - radius, radius - j - 0.5)) / radius;
      image.data[4 * k] = r;
      image.data[4 * k + 1] = g;
      image.data[4 * k + 2] = b;
      image.data[4 * k + 3] = 255 * Math.min(1, ((edge - view) * radius) / 90);
    }
  }
  context.putImageData(image, 0, 0);
  return canvas;
}

/** Draws the disc with its scale bar; the canvas is as wide as `width` CSS pixels. */
export function drawDisc(canvas: HTMLCanvasElement, width: number, disc: Disc, look: Theme): void {
  const { radius, x, y, height } = layout(width);
  const context = fitCanvas(canvas, width, height);
  const ratio = canvas.width / width;
  const key = `${Math.round(2 * radius * ratio)} ${disc.low} ${disc.high}`;
  let kept = picture.get(canvas);
  if (!kept || kept.key !== key || kept.field !== disc.field) {
    kept = { key, field: disc.field, image: paint(disc, Math.round(2 * radius * ratio)) };
    picture.set(canvas, kept);
  }
  context.drawImage(kept.image, x - radius, y - radius, 2 * radius, 2 * radius);

  context.font = `12px ${look.font}`;
  context.textBaseline = "middle";
  // Rings of the view angle and the two planes.
  context.lineWidth = 1;
  // Dark and light dashes by turns are seen on any colour.
  for (const [style, offset] of [["rgb(0 0 0 / 0.4)", 0], ["rgb(255 255 255 / 0.7)", 4]] as const) {
    context.strokeStyle = style;
    context.setLineDash([3, 5]);
    context.lineDashOffset = offset;
    for (const view of [30, 60]) {
      context.beginPath();
      context.arc(x, y, (radius * view) / 90, 0, 2 * Math.PI);
      context.stroke();
    }
    context.beginPath();
    context.moveTo(x - radius, y);
    context.lineTo(x + radius, y);
    context.moveTo(x, y - radius);
    context.lineTo(x, y + radius);
    context.stroke();
  }
  context.setLineDash([]);
  context.strokeStyle = look.ink;
  context.beginPath();
  context.arc(x, y, radius, 0, 2 * Math.PI);
  context.stroke();
  for (const view of [30, 60]) label(context, `${view}\u00b0`, x + 14, y - (radius * view) / 90);
  context.fillStyle = look.ink;
  context.textAlign = "center";
  context.fillText("90\u00b0", x, y - radius - 11);
  if (disc.sides) {
    const below = y + radius + 10;
    context.textAlign = "left";
    context.fillText("\u2190 toward the light", 0, below);
    context.textAlign = "right";
    context.fillText("forward \u2192", width, below);
  }

  if (disc.mark) {
    const [mx, my] = place(width, disc.mark.view, disc.mark.azimuth);
    sun(context, mx, my);
    label(context, disc.mark.name, mx, my + (my > y + radius - 30 ? -20 : 20));
  }
  if (disc.cursor) {
    const [cx, cy] = place(width, disc.cursor.view, disc.cursor.azimuth);
    for (const [style, line] of [["#000", 3.5], ["#fff", 1.5]] as const) {
      context.strokeStyle = style;
      context.lineWidth = line;
      context.beginPath();
      context.moveTo(cx - 8, cy);
      context.lineTo(cx + 8, cy);
      context.moveTo(cx, cy - 8);
      context.lineTo(cx, cy + 8);
      context.stroke();
    }
  }
  scaleBar(context, MARGIN, width + 8, width - 2 * MARGIN, disc, look);
}

/** Text on a plate, readable on any colour. */
function label(context: CanvasRenderingContext2D, text: string, x: number, y: number): void {
  context.textAlign = "center";
  const half = context.measureText(text).width / 2 + 3;
  context.fillStyle = "rgb(0 0 0 / 0.55)";
  context.fillRect(x - half, y - 8, 2 * half, 16);
  context.fillStyle = "#fff";
  context.fillText(text, x, y + 0.5);
}

function sun(context: CanvasRenderingContext2D, x: number, y: number): void {
  for (const [style, line] of [["#000", 4], ["#fff", 1.8]] as const) {
    context.strokeStyle = style;
    context.lineWidth = line;
    context.beginPath();
    context.arc(x, y, 4.5, 0, 2 * Math.PI);
    for (let ray = 0; ray < 8; ray++) {
      const [c, s] = [Math.cos((ray * Math.PI) / 4), Math.sin((ray * Math.PI) / 4)];
      context.moveTo(x + 7 * c, y + 7 * s);
      context.lineTo(x + 10 * c, y + 10 * s);
    }
    context.stroke();
  }
}

function scaleBar(
  context: CanvasRenderingContext2D,
  x: number,
  y: number,
  width: number,
  disc: Disc,
  look: Theme,
): void {
  const gradient = context.createLinearGradient(x, 0, x + width, 0);
  for (let i = 0; i <= 16; i++) gradient.addColorStop(i / 16, css(i / 16));
  context.fillStyle = gradient;
  context.fillRect(x, y, width, 12);
  context.strokeStyle = look.ink;
  context.lineWidth = 1;
  context.strokeRect(x + 0.5, y + 0.5, width - 1, 11);
  context.fillStyle = look.ink;
  context.textAlign = "center";
  const span = disc.high - disc.low || 1;
  for (const level of levels(disc.low, disc.high)) {
    const at = x + (width * (level - disc.low)) / span;
    context.beginPath();
    context.moveTo(at, y + 12);
    context.lineTo(at, y + 16);
    context.stroke();
    context.fillText(number(level, 4), at, y + 24);
  }
  context.fillText(disc.caption, x + width / 2, y + 42);
}

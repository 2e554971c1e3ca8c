// Curves with their errors on a canvas: a chart with a readout under the pointer and the arrow keys.

import type { Curve } from "../curves";
import { fitCanvas, h } from "../dom";
import { redrawOnChange, theme } from "./canvas";
import { hermite, slopes } from "./interpolate";
import { number, ticks, ticksOfLog } from "./ticks";

export interface Axes {
  x: string;
  y: string;
  /// The range of the curves, if left out.
  xRange?: [number, number];
  /// Numbers on the horizontal axis, if not round ones of the range.
  xTicks?: number[];
  /// Logarithmic values, at least `FLOOR`.
  log?: boolean;
  /// Ends of the values; those that are left out follow the curves.
  low?: number;
  high?: number;
  /// Vertical lines with names.
  marks?: { x: number; name: string }[];
}

/// Smallest value on a logarithmic axis.
export const FLOOR = 1e-6;

const LEFT = 46;
const RIGHT = 10;
const TOP = 24;
const BOTTOM = 38;

export class Chart {
  readonly element = h("div", { class: "chart" });
  private readonly canvas = h("canvas", { tabIndex: 0, role: "application" });
  private curves: readonly Curve[] = [];
  private axes: Axes | null = null;
  private cursor: number | null = null;
  private xRange: [number, number] = [0, 1];
  private yRange: [number, number] = [0, 1];
  private readonly height: (width: number) => number;
  /// Called with the place under the pointer, or null when it leaves.
  onCursor: (x: number | null) => void = () => {};

  constructor(label: string, height: (width: number) => number) {
    this.height = height;
    this.canvas.setAttribute("aria-label", `${label}. Arrow keys read values.`);
    this.element.append(this.canvas);
    redrawOnChange(this.element, () => this.draw());
    this.canvas.addEventListener("pointermove", (event) => {
      if (event.pointerType === "touch" && event.buttons === 0) return;
      this.point(event);
    });
    this.canvas.addEventListener("pointerdown", (event) => this.point(event));
    this.canvas.addEventListener("pointerleave", (event) => {
      if (event.pointerType !== "touch") this.move(null);
    });
    this.canvas.addEventListener("blur", () => this.move(null));
    this.canvas.addEventListener("keydown", (event) => this.key(event));
  }

  set(curves: readonly Curve[], axes: Axes): void {
    this.curves = curves;
    this.axes = axes;
    [this.xRange, this.yRange] = [rangeOfPlaces(curves, axes), rangeOfValues(curves, axes)];
    this.draw();
  }

  private point(event: PointerEvent): void {
    if (!this.axes) return;
    const box = this.canvas.getBoundingClientRect();
    const share = (event.clientX - box.left - LEFT) / (box.width - LEFT - RIGHT);
    if (share < -0.02 || share > 1.02) return this.move(null);
    const [from, to] = this.xRange;
    this.move(this.nearest(from + share * (to - from)));
  }

  private nearest(x: number): number {
    let best = x;
    let least = Infinity;
    for (const curve of this.curves) {
      for (const at of curve.x) {
        if (Math.abs(at - x) < least) [least, best] = [Math.abs(at - x), at];
      }
    }
    return best;
  }

  private key(event: KeyboardEvent): void {
    const step = { ArrowRight: 1, ArrowLeft: -1, PageUp: 10, PageDown: -10 }[event.key];
    if (step === undefined && event.key !== "Home" && event.key !== "End") return;
    const places = [...new Set(this.curves.flatMap((curve) => [...curve.x]))].sort((a, b) => a - b);
    const inside = places.filter((x) => x >= this.xRange[0] && x <= this.xRange[1]);
    if (!inside.length) return;
    event.preventDefault();
    const last = inside.length - 1;
    let i: number;
    if (event.key === "Home") i = 0;
    else if (event.key === "End") i = last;
    else if (this.cursor === null) i = last >> 1;
    else i = Math.min(last, Math.max(0, inside.indexOf(this.cursor) + step!));
    this.move(inside[i]!);
  }

  private move(x: number | null): void {
    if (x === this.cursor) return;
    this.cursor = x;
    this.draw();
    this.onCursor(x);
  }

  private draw(): void {
    const width = this.element.clientWidth;
    if (!this.axes || width < 80) return;
    const height = this.height(width);
    const look = theme(this.element);
    const context = fitCanvas(this.canvas, width, height);
    const [from, to] = this.xRange;
    const [low, high] = this.yRange;
    const { log } = this.axes;
    const [w, h] = [width - LEFT - RIGHT, height - TOP - BOTTOM];
    const share = (y: number) => (log ? Math.log(Math.max(y, FLOOR) / low) / Math.log(high / low) : (y - low) / (high - low));
    const px = (x: number) => LEFT + (w * (x - from)) / (to - from || 1);
    const py = (y: number) => TOP + h * (1 - share(y));

    context.font = `12px ${look.font}`;
    context.lineWidth = 1;
    context.fillStyle = look.ink;
    context.strokeStyle = look.faint;
    context.textBaseline = "middle";
    context.textAlign = "right";
    for (const y of log ? ticksOfLog(low, high) : ticks(low, high, h > 300 ? 10 : 5)) {
      line(context, LEFT, py(y), LEFT + w, py(y));
      context.fillText(number(y, 4), LEFT - 6, py(y));
    }
    context.textBaseline = "top";
    context.textAlign = "center";
    for (const x of this.axes.xTicks ?? ticks(from, to, width < 420 ? 4 : 7)) {
      line(context, px(x), TOP, px(x), TOP + h + 4);
      const text = number(x, 4);
      // The last number stays on the canvas.
      context.fillText(text, Math.min(px(x), width - context.measureText(text).width / 2), TOP + h + 6);
    }
    context.fillText(this.axes.x, LEFT + w / 2, height - 15);
    context.textAlign = "left";
    context.textBaseline = "alphabetic";
    context.fillText(this.axes.y, 2, 10);

    context.save();
    context.beginPath();
    context.rect(LEFT, TOP - 4, w, h + 8);
    context.clip();
    for (const mark of this.axes.marks ?? []) {
      context.strokeStyle = look.ink;
      context.setLineDash([1, 3]);
      line(context, px(mark.x), TOP, px(mark.x), TOP + h);
      context.setLineDash([]);
      context.textAlign = mark.x > (from + to) / 2 ? "right" : "left";
      context.fillStyle = look.ink;
      context.fillText(mark.name, px(mark.x) + (mark.x > (from + to) / 2 ? -4 : 4), TOP + 12);
    }
    const style = getComputedStyle(this.element);
    for (const curve of this.curves) {
      const colour = curve.colour.startsWith("--")
        ? style.getPropertyValue(curve.colour).trim() || look.ink
        : curve.colour;
      this.curve(context, curve, colour, px, py);
    }
    if (this.cursor !== null) {
      context.strokeStyle = look.ink;
      line(context, px(this.cursor), TOP, px(this.cursor), TOP + h);
    }
    context.restore();
  }

  private curve(
    context: CanvasRenderingContext2D,
    curve: Curve,
    colour: string,
    px: (x: number) => number,
    py: (y: number) => number,
  ): void {
    const { x, y, band, style = "line" } = curve;
    const bars = style === "smooth" || style === "points";
    context.strokeStyle = context.fillStyle = colour;
    if (band && !bars) {
      context.globalAlpha = 0.22;
      context.beginPath();
      for (let i = 0; i < x.length; i++) context.lineTo(px(x[i]!), py(y[i]! + band[i]!));
      for (let i = x.length - 1; i >= 0; i--) context.lineTo(px(x[i]!), py(y[i]! - band[i]!));
      context.fill();
      context.globalAlpha = 1;
    }
    context.lineWidth = 2;
    context.setLineDash(curve.dash ?? []);
    context.beginPath();
    if (style === "smooth" && x.length > 1) {
      const slope = slopes(x, y);
      const [a, b] = [px(x[0]!), px(x[x.length - 1]!)];
      for (let at = a; at <= b; at += 2) {
        const value = x[0]! + ((at - a) / (b - a)) * (x[x.length - 1]! - x[0]!);
        context.lineTo(at, py(hermite(x, y, slope, value)));
      }
      context.lineTo(b, py(y[x.length - 1]!));
    } else if (style !== "points") {
      for (let i = 0; i < x.length; i++) context.lineTo(px(x[i]!), py(y[i]!));
    }
    context.stroke();
    context.setLineDash([]);
    if (style === "line") return;
    context.lineWidth = 1.2;
    for (let i = 0; i < x.length; i++) {
      const [cx, cy] = [px(x[i]!), py(y[i]!)];
      context.beginPath();
      context.arc(cx, cy, style === "points" ? 1.8 : 2.4, 0, 2 * Math.PI);
      context.fill();
      const error = band?.[i] ?? 0;
      if (!bars || !(error > 0)) continue;
      const [top, bottom] = [py(y[i]! + error), py(y[i]! - error)];
      line(context, cx, top, cx, bottom);
      line(context, cx - 3, top, cx + 3, top);
      line(context, cx - 3, bottom, cx + 3, bottom);
    }
  }
}

/// The ends of the horizontal axis.
export function rangeOfPlaces(curves: readonly Curve[], axes: Axes): [number, number] {
  if (axes.xRange) return axes.xRange;
  const ends = curves.filter(({ x }) => x.length > 0).flatMap(({ x }) => [x[0]!, x[x.length - 1]!]);
  return ends.length > 0 ? [Math.min(...ends), Math.max(...ends)] : [0, 1];
}

/// The ends of the vertical axis.
export function rangeOfValues(curves: readonly Curve[], axes: Axes): [number, number] {
  const [from, to] = rangeOfPlaces(curves, axes);
  let [least, most] = [Infinity, -Infinity];
  for (const { x, y, band } of curves) {
    for (const [i, value] of y.entries()) {
      if (!Number.isFinite(value) || x[i]! < from || x[i]! > to) continue;
      const error = band?.[i] ?? 0;
      least = Math.min(least, value - error);
      most = Math.max(most, value + error);
    }
  }
  if (least > most) [least, most] = [0, 1];
  if (axes.log) {
    const low = 10 ** Math.floor(Math.log10(Math.max(least, FLOOR)) + 1e-9);
    return [Math.min(low, 0.1), axes.high ?? Math.max(1, most)];
  }
  if (axes.low !== undefined) least = Math.min(least, axes.low);
  if (least === most) [least, most] = least === 0 ? [0, 1] : [least - 0.5 * Math.abs(least), most + 0.5 * Math.abs(most)];
  const spare = 0.04 * (most - least);
  // A range that nearly begins at 0 does so.
  const low = least >= 0 && least - spare < 0 ? 0 : least - spare;
  return [axes.low ?? low, axes.high ?? most + spare];
}

function line(context: CanvasRenderingContext2D, x0: number, y0: number, x1: number, y1: number): void {
  context.beginPath();
  context.moveTo(x0, y0);
  context.lineTo(x1, y1);
  context.stroke();
}

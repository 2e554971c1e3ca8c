// Curves with their errors on a canvas: a small chart with a readout under the pointer and the
// arrow keys.

import { prepare, redrawOnChange, theme } from "./canvas";
import { hermite, slopes } from "./interpolate";
import { number, ticks } from "./ticks";

export interface Curve {
  name: string;
  /// A CSS colour, or the name of a variable such as `--reflectance`.
  colour: string;
  x: readonly number[];
  y: readonly number[];
  /// Standard errors: bars at points, a band along lines.
  se?: readonly number[];
  dash?: number[];
  /// Points at the values, with a smooth curve through them; otherwise straight lines.
  points?: boolean;
  /// Small dots at the values of a line.
  dots?: boolean;
}

export interface Axes {
  x: string;
  y: string;
  xRange: [number, number];
  /// Numbers on the horizontal axis, if not round ones of the range.
  xTicks?: number[];
  xText?: (x: number) => string;
  /// The range of the values holds these.
  yHolds?: number[];
  /// Vertical lines with names.
  marks?: { x: number; name: string }[];
}

const LEFT = 46;
const RIGHT = 10;
const TOP = 24;
const BOTTOM = 38;

export class Chart {
  readonly canvas = document.createElement("canvas");
  private curves: readonly Curve[] = [];
  private axes: Axes | null = null;
  private cursor: number | null = null;
  private range: [number, number] = [0, 1];
  private readonly host: HTMLElement;
  private readonly height: number;
  /// Called with the place under the pointer, or null when it leaves.
  onCursor: (x: number | null) => void = () => {};

  constructor(host: HTMLElement, label: string, height = 260) {
    this.host = host;
    this.height = height;
    this.canvas.className = "chart";
    this.canvas.tabIndex = 0;
    this.canvas.setAttribute("role", "application");
    this.canvas.setAttribute("aria-label", `${label}. Arrow keys read values.`);
    host.append(this.canvas);
    redrawOnChange(host, () => this.draw());
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
    const all: number[] = [...(axes.yHolds ?? [])];
    for (const { x, y, se } of curves) {
      for (const [i, value] of y.entries()) {
        const at = x[i]!;
        if (!Number.isFinite(value) || at < axes.xRange[0] || at > axes.xRange[1]) continue;
        const error = se?.[i] ?? 0;
        all.push(value - error, value + error);
      }
    }
    let low = all.length ? Math.min(...all) : 0;
    let high = all.length ? Math.max(...all) : 1;
    if (!(high > low)) [low, high] = low === 0 ? [0, 1] : [low - 0.5 * Math.abs(low), high + 0.5 * Math.abs(high)];
    const spare = 0.04 * (high - low);
    this.range = [low >= 0 && low - spare < 0 ? 0 : low - spare, high + spare];
    this.draw();
  }

  private point(event: PointerEvent): void {
    if (!this.axes) return;
    const box = this.canvas.getBoundingClientRect();
    const share = (event.clientX - box.left - LEFT) / (box.width - LEFT - RIGHT);
    if (share < -0.02 || share > 1.02) return this.move(null);
    const [from, to] = this.axes.xRange;
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
    const inside = places.filter((x) => x >= this.axes!.xRange[0] && x <= this.axes!.xRange[1]);
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
    const width = this.host.clientWidth;
    if (!this.axes || width < 80) return;
    const look = theme(this.host);
    const context = prepare(this.canvas, width, this.height);
    const [from, to] = this.axes.xRange;
    const [low, high] = this.range;
    const [w, h] = [width - LEFT - RIGHT, this.height - TOP - BOTTOM];
    const px = (x: number) => LEFT + (w * (x - from)) / (to - from);
    const py = (y: number) => TOP + h * (1 - (y - low) / (high - low));

    context.font = `12px ${look.font}`;
    context.lineWidth = 1;
    context.fillStyle = look.ink;
    context.strokeStyle = look.faint;
    context.textBaseline = "middle";
    context.textAlign = "right";
    const side = ticks(low, high, 5);
    for (const y of side) {
      line(context, LEFT, py(y), LEFT + w, py(y));
      context.fillText(number(y, 4), LEFT - 6, py(y));
    }
    context.textBaseline = "top";
    context.textAlign = "center";
    for (const x of this.axes.xTicks ?? ticks(from, to, width < 420 ? 4 : 7)) {
      line(context, px(x), TOP, px(x), TOP + h + 4);
      context.fillText((this.axes.xText ?? ((v) => number(v, 4)))(x), px(x), TOP + h + 6);
    }
    context.fillText(this.axes.x, LEFT + w / 2, this.height - 15);
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
    const style = getComputedStyle(this.host);
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
    const { x, y, se } = curve;
    context.strokeStyle = context.fillStyle = colour;
    if (se && !curve.points) {
      context.globalAlpha = 0.22;
      context.beginPath();
      for (let i = 0; i < x.length; i++) context.lineTo(px(x[i]!), py(y[i]! + (se[i] ?? 0)));
      for (let i = x.length - 1; i >= 0; i--) context.lineTo(px(x[i]!), py(y[i]! - (se[i] ?? 0)));
      context.fill();
      context.globalAlpha = 1;
    }
    context.lineWidth = 2;
    context.setLineDash(curve.dash ?? []);
    context.beginPath();
    if (curve.points && x.length > 1) {
      const slope = slopes(x, y);
      const [a, b] = [px(x[0]!), px(x[x.length - 1]!)];
      for (let at = a; at <= b; at += 2) {
        const value = x[0]! + ((at - a) / (b - a)) * (x[x.length - 1]! - x[0]!);
        context.lineTo(at, py(hermite(x, y, slope, value)));
      }
      context.lineTo(b, py(y[x.length - 1]!));
    } else {
      for (let i = 0; i < x.length; i++) context.lineTo(px(x[i]!), py(y[i]!));
    }
    context.stroke();
    context.setLineDash([]);
    if (!curve.points && !curve.dots) return;
    context.lineWidth = 1.2;
    for (let i = 0; i < x.length; i++) {
      const [cx, cy] = [px(x[i]!), py(y[i]!)];
      context.beginPath();
      context.arc(cx, cy, 2.4, 0, 2 * Math.PI);
      context.fill();
      const error = se?.[i] ?? 0;
      if (!curve.points || !(error > 0)) continue;
      const [top, bottom] = [py(y[i]! + error), py(y[i]! - error)];
      line(context, cx, top, cx, bottom);
      line(context, cx - 3, top, cx + 3, top);
      line(context, cx - 3, bottom, cx + 3, bottom);
    }
  }
}

function line(context: CanvasRenderingContext2D, x0: number, y0: number, x1: number, y1: number): void {
  context.beginPath();
  context.moveTo(x0, y0);
  context.lineTo(x1, y1);
  context.stroke();
}

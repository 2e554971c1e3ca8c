// A chart of curves over wavelength, drawn by uPlot.
import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import type { Curve } from "./curves";
import { colour, h, onTheme } from "./dom";

export interface ChartOptions {
  label: string;
  height(width: number): number;
  /// Called with the wavelength under the pointer, nm, or null when the pointer leaves.
  onCursor?(nm: number | null): void;
}

export interface Axes {
  scale: "linear" | "log";
  /// Range of the values; the ends that are null follow the data.
  low: number | null;
  high: number | null;
}

/// Smallest value on a logarithmic axis.
export const FLOOR = 1e-6;

export class Chart {
  readonly element = h("div", { class: "chart" });
  readonly #options: ChartOptions;
  #plot: uPlot | null = null;
  #shape = "";
  #curves: Curve[] = [];
  #axes: Axes = { scale: "linear", low: 0, high: null };

  constructor(options: ChartOptions) {
    this.#options = options;
    this.element.setAttribute("role", "img");
    this.element.setAttribute("aria-label", options.label);
    new ResizeObserver(() => this.#resize()).observe(this.element);
    onTheme(() => {
      this.#shape = "";
      this.draw(this.#curves, this.#axes);
    });
  }

  draw(curves: Curve[], axes: Axes): void {
    this.#curves = curves;
    this.#axes = axes;
    const width = this.element.clientWidth;
    if (width === 0) return;
    const data = this.#data(curves, axes);
    const shape = JSON.stringify([axes, curves.map((c) => [c.colour, c.dash, c.points, !c.band])]);
    if (shape !== this.#shape || !this.#plot) {
      this.#shape = shape;
      this.#plot?.destroy();
      this.#plot = new uPlot(this.#uplot(curves, axes, width), data, this.element);
    } else {
      this.#plot.setData(data);
    }
  }

  #resize(): void {
    const width = this.element.clientWidth;
    if (width === 0) return;
    if (!this.#plot) this.draw(this.#curves, this.#axes);
    else if (this.#plot.width !== width) this.#plot.setSize({ width, height: this.#options.height(width) });
  }

  #data(curves: Curve[], axes: Axes): uPlot.AlignedData {
    if (curves.length === 0) return [[], []] as unknown as uPlot.AlignedData;
    const value = (y: number) => (axes.scale === "log" ? (y > FLOOR ? y : FLOOR) : y);
    const tables = curves.map((curve): uPlot.AlignedData => {
      const y = curve.y.map(value);
      if (!curve.band) return [[...curve.x], y];
      const high = curve.y.map((v, i) => value(v + curve.band![i]!));
      const low = curve.y.map((v, i) => value(v - curve.band![i]!));
      return [[...curve.x], high, low, y];
    });
    return tables.length === 1 ? tables[0]! : uPlot.join(tables);
  }

  #uplot(curves: Curve[], axes: Axes, width: number): uPlot.Options {
    const series: uPlot.Series[] = [{}];
    const bands: uPlot.Band[] = [];
    for (const curve of curves) {
      const stroke = colour(curve.colour);
      if (curve.band) {
        const at = series.length;
        series.push({ spanGaps: true, width: 0, points: { show: false } }, { spanGaps: true, width: 0, points: { show: false } });
        bands.push({ series: [at, at + 1], fill: `color-mix(in srgb, ${stroke} 28%, transparent)` });
      }
      series.push({
        label: curve.name,
        stroke,
        width: curve.points ? 0 : 2,
        spanGaps: true,
        ...(curve.dash ? { dash: curve.dash } : {}),
        points: curve.points ? { show: true, size: 4, fill: stroke, stroke, width: 0 } : { show: false },
      });
    }
    const font = `12px ${getComputedStyle(document.body).fontFamily}`;
    const axis = { stroke: colour("--ink"), font, labelFont: font, grid: { stroke: colour("--grid"), width: 1 }, ticks: { stroke: colour("--grid"), width: 1, size: 4 } };
    return {
      width,
      height: this.#options.height(width),
      legend: { show: false },
      cursor: { drag: { x: false, y: false }, points: { show: false } },
      scales: {
        x: { time: false },
        y: {
          distr: axes.scale === "log" ? 3 : 1,
          range: (_, min, max) => rangeOf(axes, min, max),
        },
      },
      axes: [
        { ...axis, label: "Wavelength (nm)", labelSize: 18, size: 34, values: (_, ticks) => ticks.map(String) },
        {
          ...axis,
          label: this.#options.label,
          labelSize: 18,
          size: 46,
          ...(axes.scale === "log"
            ? { values: (_: uPlot, ticks: number[]) => ticks.map((t) => (Math.abs(Math.log10(t) % 1) < 1e-9 || Math.abs(Math.log10(t) % 1) > 1 - 1e-9 ? String(t) : "")) }
            : {}),
        },
      ],
      series,
      bands,
      hooks: {
        setCursor: [
          (plot) => {
            const { left = -1 } = plot.cursor;
            this.#options.onCursor?.(left < 0 ? null : plot.posToVal(left, "x"));
          },
        ],
      },
    };
  }
}

/// The ends of the axis of values.
export function rangeOf(axes: Axes, min: number | null, max: number | null): [number, number] {
  const [least, most] = [min ?? 0, max ?? 1];
  if (axes.scale === "log") {
    const low = 10 ** Math.floor(Math.log10(Math.max(least, FLOOR)) + 1e-9);
    return [Math.min(low, 0.1), axes.high ?? Math.max(1, most)];
  }
  const pad = (most - least || 1) * 0.05;
  return [axes.low ?? least - pad, axes.high ?? most + pad];
}

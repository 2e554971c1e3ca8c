// A chart as SVG, the same curves as on the screen, on white.
import type { Curve } from "./curves";
import { FLOOR, rangeOfPlaces, rangeOfValues, type Axes } from "./draw/chart";
import { ticks, ticksOfLog } from "./draw/ticks";

const INK = "#1b1f24";
const WIDTH = 900;
const HEIGHT = 520;
const BOX = { left: 70, right: 20, top: 20, bottom: 90 };

/// `paint` gives the colour of a curve on white.
export function svgOf(curves: Curve[], axes: Axes, label: string, caption: string, paint: (name: string) => string): string {
  const [[x0, x1], [y0, y1]] = [rangeOfPlaces(curves, axes), rangeOfValues(curves, axes)];
  const { log } = axes;
  const inner = { width: WIDTH - BOX.left - BOX.right, height: HEIGHT - BOX.top - BOX.bottom };
  const px = (x: number) => (BOX.left + ((x - x0) / (x1 - x0 || 1)) * inner.width).toFixed(1);
  const share = (y: number) => (log ? Math.log(Math.max(y, FLOOR) / y0) / Math.log(y1 / y0) : (y - y0) / (y1 - y0));
  const py = (y: number) => (BOX.top + (1 - Math.min(1.02, Math.max(-0.02, share(y)))) * inner.height).toFixed(1);

  const parts: string[] = [];
  for (const tick of log ? ticksOfLog(y0, y1) : ticks(y0, y1, 7)) {
    parts.push(`<line x1="${BOX.left}" x2="${WIDTH - BOX.right}" y1="${py(tick)}" y2="${py(tick)}" stroke="#d8dde3"/>`);
    parts.push(`<text x="${BOX.left - 8}" y="${Number(py(tick)) + 4}" text-anchor="end">${tick}</text>`);
  }
  for (const tick of ticks(x0, x1, 7)) {
    parts.push(`<line y1="${BOX.top}" y2="${HEIGHT - BOX.bottom}" x1="${px(tick)}" x2="${px(tick)}" stroke="#d8dde3"/>`);
    parts.push(`<text x="${px(tick)}" y="${HEIGHT - BOX.bottom + 18}" text-anchor="middle">${tick}</text>`);
  }
  for (const curve of curves) {
    const stroke = paint(curve.colour);
    const points = curve.x.map((x, i) => `${px(x)},${py(curve.y[i]!)}`);
    if (curve.band) {
      const up = curve.x.map((x, i) => `${px(x)},${py(curve.y[i]! + curve.band![i]!)}`);
      const down = curve.x.map((x, i) => `${px(x)},${py(curve.y[i]! - curve.band![i]!)}`).reverse();
      parts.push(`<polygon points="${[...up, ...down].join(" ")}" fill="${stroke}" fill-opacity="0.25"/>`);
    }
    if (curve.style === "points") for (const point of points) parts.push(`<circle cx="${point.split(",")[0]}" cy="${point.split(",")[1]}" r="2" fill="${stroke}"/>`);
    else parts.push(`<polyline points="${points.join(" ")}" fill="none" stroke="${stroke}" stroke-width="2"${curve.dash ? ` stroke-dasharray="${curve.dash.join(" ")}"` : ""}/>`);
  }
  let at = BOX.left;
  const legend = curves.map((curve) => {
    const stroke = paint(curve.colour);
    const mark = curve.style === "points"
      ? `<circle cx="${at + 12}" cy="${HEIGHT - 30}" r="3" fill="${stroke}"/>`
      : `<line x1="${at}" x2="${at + 24}" y1="${HEIGHT - 30}" y2="${HEIGHT - 30}" stroke="${stroke}" stroke-width="2"${curve.dash ? ` stroke-dasharray="${curve.dash.join(" ")}"` : ""}/>`;
    const entry = `${mark}<text x="${at + 30}" y="${HEIGHT - 26}">${escape(curve.name)}</text>`;
    at += 50 + curve.name.length * 7;
    return entry;
  });
  const middle = BOX.top + inner.height / 2;
  return `<svg xmlns="http://www.w3.org/2000/svg" width="${WIDTH}" height="${HEIGHT}" viewBox="0 0 ${WIDTH} ${HEIGHT}" font-family="sans-serif" font-size="13" fill="${INK}">
<rect width="${WIDTH}" height="${HEIGHT}" fill="#ffffff"/>
${parts.join("\n")}
<rect x="${BOX.left}" y="${BOX.top}" width="${inner.width}" height="${inner.height}" fill="none" stroke="${INK}"/>
<text x="${BOX.left + inner.width / 2}" y="${HEIGHT - BOX.bottom + 40}" text-anchor="middle">Wavelength (nm)</text>
<text transform="translate(18 ${middle}) rotate(-90)" text-anchor="middle">${escape(label)}</text>
${legend.join("\n")}
<text x="${BOX.left}" y="${HEIGHT - 8}" font-size="11" fill="#59636e">${escape(caption)}</text>
</svg>
`;
}

/// The same as PNG, at twice the size.
export async function pngOf(svg: string): Promise<Blob> {
  const image = new Image();
  image.src = `data:image/svg+xml;charset=utf-8,${encodeURIComponent(svg)}`;
  await image.decode();
  const canvas = document.createElement("canvas");
  canvas.width = WIDTH * 2;
  canvas.height = HEIGHT * 2;
  canvas.getContext("2d")!.drawImage(image, 0, 0, canvas.width, canvas.height);
  return new Promise((resolve, reject) => canvas.toBlob((blob) => (blob ? resolve(blob) : reject(new Error("no picture"))), "image/png"));
}

const escape = (text: string) => text.replaceAll("&", "&amp;").replaceAll("<", "&lt;").replaceAll(">", "&gt;");

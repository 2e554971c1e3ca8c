// What all drawings share: a canvas with the pixels of the screen, and the colours of the page.

export interface Theme {
  ink: string;
  faint: string;
  font: string;
}

/** The colours of the page at `element`, as they are now (light or dark). */
export function theme(element: Element): Theme {
  const style = getComputedStyle(element);
  const get = (name: string, otherwise: string) => style.getPropertyValue(name).trim() || otherwise;
  return {
    ink: style.color,
    faint: get("--grid", "rgb(128 128 128 / 0.4)"),
    font: style.fontFamily || "sans-serif",
  };
}

/** Sizes the canvas for the screen and clears it; the context then counts in CSS pixels. */
export function prepare(
  canvas: HTMLCanvasElement,
  width: number,
  height: number,
): CanvasRenderingContext2D {
  const ratio = Math.min(3, globalThis.devicePixelRatio || 1);
  const [w, h] = [Math.round(width * ratio), Math.round(height * ratio)];
  if (canvas.width !== w || canvas.height !== h) {
    canvas.width = w;
    canvas.height = h;
    canvas.style.height = `${height}px`;
  }
  const context = canvas.getContext("2d")!;
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  return context;
}

/** Calls `draw` when the size of `host` or the colours of the page change. */
export function redrawOnChange(host: Element, draw: () => void): void {
  let width = -1;
  let waiting = false;
  const soon = () => {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => {
      waiting = false;
      if (host.isConnected && host.clientWidth > 0) draw();
    });
  };
  new ResizeObserver(() => {
    if (host.clientWidth === width) return;
    width = host.clientWidth;
    soon();
  }).observe(host);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", soon);
}

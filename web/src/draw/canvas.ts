// What drawings share: the colours of the page, and when they are drawn again.

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

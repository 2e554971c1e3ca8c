// Elements, canvases, colours of the style sheet, downloads and dropped files.

type Child = Node | string | null | undefined | false;
type Props = Record<string, unknown>;

/// `h("button", { class: "small", onclick: f }, "Add")`. Keys with a dash, `class`, `for` and
/// `role` become attributes, all others properties.
export function h<K extends keyof HTMLElementTagNameMap>(tag: K, props?: Props | null, ...children: Child[]): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  for (const [key, value] of Object.entries(props ?? {})) {
    if (value === undefined || value === null) continue;
    if (key === "class" || key === "for" || key === "role" || key.includes("-")) element.setAttribute(key, String(value));
    else (element as unknown as Record<string, unknown>)[key] = value;
  }
  for (const child of children) if (child) element.append(child);
  return element;
}

let ids = 0;
export function newId(prefix = "c"): string {
  return `${prefix}${++ids}`;
}

/// A canvas for `width` times `height` CSS pixels, sharp on any screen.
export function fitCanvas(canvas: HTMLCanvasElement, width: number, height: number): CanvasRenderingContext2D {
  const ratio = Math.min(3, window.devicePixelRatio || 1);
  canvas.width = Math.max(1, Math.round(width * ratio));
  canvas.height = Math.max(1, Math.round(height * ratio));
  const context = canvas.getContext("2d")!;
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  return context;
}

/// A colour of the style sheet: `colour("--ink")`.
export function colour(name: string): string {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

/// Calls `listener` when the colours of the style sheet change between light and dark.
export function onTheme(listener: () => void): void {
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", listener);
}

/// Saves bytes or text as a file.
export function download(name: string, content: Blob | string, type = "text/plain"): void {
  const url = URL.createObjectURL(content instanceof Blob ? content : new Blob([content], { type }));
  const link = h("a", { href: url, download: name });
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(url), 10_000);
}

/// Whether a file is a compact one, which only the panel of databases reads.
export function isCompact(file: File): boolean {
  return file.name.toLowerCase().endsWith(".safetensors");
}

/// Lets a file be dropped on `element`, or chosen with the button that is returned.
export function fileDrop(element: HTMLElement, label: string, accept: string, opened: (file: File) => void): HTMLElement {
  const input = h("input", { type: "file", accept, class: "visually-hidden", tabIndex: -1, "aria-label": label });
  input.addEventListener("change", () => {
    const file = input.files?.[0];
    if (file) opened(file);
    input.value = "";
  });
  element.addEventListener("dragover", (event) => {
    if (!event.dataTransfer?.types.includes("Files")) return;
    event.preventDefault();
    element.classList.add("dropping");
  });
  element.addEventListener("dragleave", (event) => {
    if (!element.contains(event.relatedTarget as Node | null)) element.classList.remove("dropping");
  });
  element.addEventListener("drop", (event) => {
    const file = event.dataTransfer?.files[0];
    element.classList.remove("dropping");
    if (!file || isCompact(file) || event.defaultPrevented) return;
    event.preventDefault();
    opened(file);
  });
  return h("span", null, h("button", { type: "button", onclick: () => input.click() }, label), input);
}

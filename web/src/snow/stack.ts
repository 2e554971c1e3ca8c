// The layers as a stack, the surface on top. Layers are dragged by their handle or moved with
// Alt and the arrow keys.
import { fitCanvas, h } from "../dom";
import type { Layer } from "../messages";
import type { Page } from "../page";
import { text, type Control } from "../controls";
import { absorberText } from "./absorber";
import { MOST_LAYERS, moveLayer, newLayer } from "./edit";
import { sizeText } from "./grain";
import { drawLayer } from "./texture";

export function stack(page: Page): Control {
  const list = h("ol", { class: "stack", "aria-label": "Layers, from the surface down", "data-key": "layer" });
  const ground = h("div", { class: "ground" });
  const button = (label: string, title: string, onclick: () => void) =>
    h("button", { type: "button", class: "small", title, onclick }, label);
  const add = button("Add", "Adds a layer on the surface", () => {
    const { sample } = page.state.get();
    page.state.set({ sample: { ...sample, layer: [...sample.layer, newLayer()] }, layer: sample.layer.length });
  });
  const duplicate = button("Duplicate", "Adds a copy above the selected layer", () => {
    const { sample, layer } = page.state.get();
    const copy = structuredClone(sample.layer[layer]!);
    if (copy.thickness_cm === "inf") copy.thickness_cm = 10;
    const layers = [...sample.layer];
    layers.splice(layer + 1, 0, copy);
    page.state.set({ sample: { ...sample, layer: layers }, layer: layer + 1 });
  });
  const remove = button("Remove", "Removes the selected layer", () => {
    const { sample, layer } = page.state.get();
    if (sample.layer.length < 2) return;
    page.state.set({ sample: { ...sample, layer: sample.layer.filter((_, i) => i !== layer) }, layer: Math.max(0, layer - 1) });
  });
  const up = button("▲", "Moves the selected layer up (Alt + Up)", () => move(1));
  const down = button("▼", "Moves the selected layer down (Alt + Down)", () => move(-1));
  up.setAttribute("aria-label", "Move the layer up");
  down.setAttribute("aria-label", "Move the layer down");

  function move(by: number): void {
    const { layer } = page.state.get();
    moveTo(layer, layer + by);
  }

  function moveTo(from: number, to: number): void {
    const { sample } = page.state.get();
    if (to < 0 || to >= sample.layer.length || to === from) return;
    page.state.set({ sample: moveLayer(sample, from, to), layer: to });
    page.say(`Layer moved: now number ${sample.layer.length - to} from the surface.`);
    list.querySelector<HTMLElement>('[aria-pressed="true"]')?.focus();
  }

  let drawn = "";
  const refresh = () => {
    const { sample, layer: selected, files } = page.state.get();
    const n = sample.layer.length;
    add.disabled = duplicate.disabled = n >= MOST_LAYERS;
    remove.disabled = n < 2;
    up.disabled = selected >= n - 1;
    down.disabled = selected <= 0;
    const reflectance = sample.substrate?.reflectance;
    const kind = Array.isArray(reflectance) ? "a spectrum" : typeof reflectance === "number" ? (reflectance > 0 ? `reflects ${text(reflectance)}` : "black") : reflectance;
    ground.textContent = `Substrate: ${kind ?? "black"}`;
    ground.style.setProperty("--grey", `${typeof reflectance === "number" ? Math.round(100 * Math.sqrt(reflectance)) : files && reflectance !== undefined ? 45 : 0}%`);
    const now = JSON.stringify([sample.layer, selected, list.clientWidth]);
    if (now === drawn) return;
    drawn = now;
    while (list.children.length > n) list.lastElementChild!.remove();
    while (list.children.length < n) list.append(row());
    for (let place = 0; place < n; place++) {
      const index = n - 1 - place;
      show(list.children[place] as HTMLLIElement, sample.layer[index]!, index, n, index === selected);
    }
  };

  function row(): HTMLLIElement {
    const handle = h("span", { class: "handle", "aria-hidden": "true", title: "Drag to move the layer" }, "⠿");
    const pick = h("button", { type: "button", class: "pick" }, h("span", { class: "what" }), h("span", { class: "detail" }));
    const item = h("li", null, h("canvas", { "aria-hidden": "true" }), handle, pick);
    const index = () => Number(item.dataset.index);
    pick.addEventListener("click", () => page.state.set({ layer: index() }));
    pick.addEventListener("keydown", (event) => {
      if (event.key !== "ArrowUp" && event.key !== "ArrowDown") return;
      event.preventDefault();
      const by = event.key === "ArrowUp" ? 1 : -1;
      if (event.altKey) moveTo(index(), index() + by);
      else {
        page.state.set({ layer: Math.max(0, Math.min(list.children.length - 1, index() + by)) });
        list.querySelector<HTMLElement>('[aria-pressed="true"]')?.focus();
      }
    });
    draggable(item, handle, list, (from, to) => moveTo(from, to));
    return item;
  }

  const element = h("div", { class: "stack-box" }, list, ground, h("div", { class: "row" }, add, duplicate, remove, up, down));
  new ResizeObserver(() => refresh()).observe(list);
  return { element, refresh };
}

function show(item: HTMLLIElement, layer: Layer, index: number, count: number, selected: boolean): void {
  item.dataset.index = String(index);
  item.classList.toggle("selected", selected);
  const pick = item.querySelector<HTMLButtonElement>(".pick")!;
  pick.setAttribute("aria-pressed", String(selected));
  const thickness = layer.thickness_cm === "inf" ? "endless" : `${text(layer.thickness_cm)} cm`;
  const name = count === 1 ? "" : index === count - 1 ? "Surface · " : index === 0 ? "Base · " : "";
  const density = text(layer.density_kg_m3 ?? layer.wet_density_kg_m3 ?? 0);
  pick.querySelector(".what")!.textContent = `${name}${thickness}`;
  pick.querySelector(".detail")!.textContent = `${density} kg/m³ · ${[...layer.grain.map(sizeText), ...(layer.absorber ?? []).map(absorberText)].join(", ")}`;
  // Thick layers are drawn higher, but a stack always fits.
  const cm = layer.thickness_cm === "inf" ? 100 : layer.thickness_cm;
  const height = Math.round(Math.min(110, 46 + 7 * Math.sqrt(Math.max(0, cm))) - Math.min(6, count));
  item.style.height = `${height}px`;
  const canvas = item.querySelector("canvas")!;
  const width = item.clientWidth || 300;
  // Only what has changed is drawn again.
  const picture = JSON.stringify([layer, width, height]);
  if (canvas.dataset.picture === picture) return;
  canvas.dataset.picture = picture;
  drawLayer(fitCanvas(canvas, width, height), layer, width, height);
}

/// Dragging by the handle; with a mouse also by the layer itself.
function draggable(item: HTMLLIElement, handle: HTMLElement, list: HTMLElement, drop: (from: number, to: number) => void): void {
  let start: { y: number; id: number } | null = null;
  let moved = false;
  const places = () => [...list.children] as HTMLElement[];
  item.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    if (event.pointerType !== "mouse" && event.target !== handle) return;
    start = { y: event.clientY, id: event.pointerId };
    moved = false;
  });
  item.addEventListener("pointermove", (event) => {
    if (!start || event.pointerId !== start.id) return;
    // The button was released where nobody saw it.
    if (event.buttons === 0) return cancel();
    const dy = event.clientY - start.y;
    if (!moved && Math.abs(dy) < 5) return;
    if (!moved) item.setPointerCapture(start.id);
    moved = true;
    item.classList.add("dragged");
    item.style.transform = `translateY(${dy}px)`;
    const to = target(event.clientY);
    const from = places().indexOf(item);
    // The others make room.
    places().forEach((other, place) => {
      if (other === item) return;
      const shift = place > from && place <= to ? -item.offsetHeight : place < from && place >= to ? item.offsetHeight : 0;
      other.style.transform = shift ? `translateY(${shift}px)` : "";
    });
  });
  const cancel = () => {
    start = null;
    for (const other of places()) other.style.transform = "";
    item.classList.remove("dragged");
  };
  const end = (event: PointerEvent) => {
    if (!start) return;
    const to = target(event.clientY);
    const from = places().indexOf(item);
    cancel();
    if (!moved || event.type === "pointercancel") return;
    const last = list.children.length - 1;
    if (to !== from) drop(last - from, last - to);
  };
  item.addEventListener("pointerup", end);
  item.addEventListener("pointercancel", end);
  // The click that ends a drag does not select.
  item.addEventListener(
    "click",
    (event) => {
      if (moved) event.stopPropagation();
      moved = false;
    },
    true,
  );

  /// The place that the pointer is over, by the places where the layers lie at rest.
  function target(y: number): number {
    const top = list.getBoundingClientRect().top;
    let place = 0;
    let edge = top;
    for (const other of places()) {
      edge += other.offsetHeight;
      if (y < edge) return place;
      place++;
    }
    return list.children.length - 1;
  }
}

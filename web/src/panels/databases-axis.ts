// The control of one axis of a compact file.
import { h, newId } from "../dom";
import { NumberField } from "../number";
import { amongNodes, axisName, axisTicks, fromShare, toShare, unitText, valueText, type Axis } from "./databases-data";

/// A slider with its nodes, a field for exact numbers, and where the value lies.
export function axisControl(axis: Axis, get: () => number, set: (value: number) => void): { element: HTMLElement; refresh(): void } {
  const steps = 1000;
  const whereId = newId("where");
  const unit = unitText(axis.unit);
  const slider = h("input", { type: "range", min: "0", max: String(steps), step: "1", "aria-label": `${axisName(axis.name)}, ${unit}`, "aria-describedby": whereId });
  const shares = axisTicks(axis);
  const marks = h("div", { class: "nodes", "aria-hidden": "true" });
  for (const [i, share] of shares.entries()) {
    const mark = h("button", { type: "button", class: "node", tabIndex: -1, title: `Node: ${valueText(axis, axis.values[i]!)}` });
    mark.style.setProperty("--at", String(share));
    mark.addEventListener("click", () => {
      set(axis.values[i]!);
      refresh();
    });
    marks.append(mark);
  }
  const where = h("small", { id: whereId, class: "where" });
  const move = (value: number) => {
    set(value);
    refresh();
  };
  slider.addEventListener("input", () => move(fromShare(axis, slider.valueAsNumber / steps)));
  slider.addEventListener("keydown", (event) => {
    const now = get();
    const by = { ArrowRight: 0.01, ArrowUp: 0.01, ArrowLeft: -0.01, ArrowDown: -0.01 }[event.key];
    let next: number | undefined;
    if (by !== undefined) next = fromShare(axis, Math.min(1, Math.max(0, toShare(axis, now) + by)));
    // From node to node.
    else if (event.key === "PageUp") next = axis.values.find((node) => node > now);
    else if (event.key === "PageDown") next = axis.values.findLast((node) => node < now);
    else return;
    event.preventDefault();
    if (next !== undefined) move(next);
  });
  const [low, high] = [axis.values[0]!, axis.values.at(-1)!];
  // A hundredth of the range, as a round number.
  const step = 10 ** Math.floor(Math.log10((high - low) / 20));
  const field = new NumberField({ step, low, high, describedBy: whereId, set: move });
  const refresh = () => {
    const value = get();
    slider.value = String(Math.round(toShare(axis, value) * steps));
    field.show(value);
    slider.setAttribute("aria-valuetext", valueText(axis, value));
    where.textContent = amongNodes(axis, value);
  };
  refresh();
  const element = h("div", { class: "axis" },
    h("div", { class: "head" },
      h("label", { for: field.input.id }, axisName(axis.name)),
      h("span", { class: "exact" }, field.input, h("span", { class: "unit" }, unit === "1" ? "(unit 1)" : unit))),
    h("div", { class: "track" }, slider, marks), where, field.message);
  return { element, refresh };
}

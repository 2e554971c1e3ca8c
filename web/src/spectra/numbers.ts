// All numbers of the spectrum as a table, for those who read rather than look.
import { text } from "../controls";
import { bandOf, NAMES, QUANTITIES } from "../curves";
import { h } from "../dom";
import type { Page } from "../page";

export function numbers(page: Page): HTMLElement {
  const table = h("table");
  const details = h("details", { class: "numbers" }, h("summary", null, "Table of the numbers"), h("div", { class: "scroll" }, table));
  const fill = () => {
    const spectrum = page.shown.value?.spectrum;
    if (!details.open || !spectrum) return;
    const bands = QUANTITIES.map((quantity) => bandOf(spectrum, quantity));
    table.replaceChildren(
      h("caption", null, "Shares of the incident light, with twice their uncertainty"),
      h("thead", null, h("tr", null, ...["nm", ...QUANTITIES.map((q) => NAMES[q])].map((title) => h("th", { scope: "col" }, title)))),
      h(
        "tbody",
        null,
        ...spectrum.wavelengths_nm.map((nm, i) =>
          h("tr", null, h("th", { scope: "row" }, text(nm)), ...QUANTITIES.map((q, k) => h("td", null, `${spectrum[q][i]!.toFixed(5)} ± ${bands[k]![i]!.toFixed(5)}`))),
        ),
      ),
    );
  };
  details.addEventListener("toggle", fill);
  page.shown.subscribe(fill);
  return details;
}

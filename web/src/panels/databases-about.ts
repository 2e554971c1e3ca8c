// What a compact file says about itself: certificate, compression, size, provenance.
import { h } from "../dom";
import { bytes as bytesText, grouped, number } from "../draw/ticks";
import type { CompactFile } from "../messages";
import {
  boundsWords, capital, certificate, certificateSource, certificateWords, errorTable, provenance, quantityName, size,
} from "./databases-data";

export function table(caption: string, heads: string[], rows: HTMLElement[]): HTMLElement {
  return h("div", { class: "scroll" },
    h("table", null, h("caption", null, caption),
      h("thead", null, h("tr", null, ...heads.map((head) => h("th", { scope: "col" }, head)))),
      h("tbody", null, ...rows)));
}

function triples(value: [number, number, number] | null): string[] {
  return value ? value.map((part) => number(part, 2)) : ["-", "-", "-"];
}

/// What a file says about itself.
export function aboutFile(file: CompactFile): HTMLElement[] {
  const { metadata } = file;
  const parts: HTMLElement[] = [];

  const certified = certificate(metadata);
  const section = h("section", { class: "certificate" }, h("h3", null, "Certificate"));
  if (certified) {
    section.append(
      h("p", null, certificateSource(certified)),
      h("ul", null, ...certified.quantities.flatMap(certificateWords).map((line) => h("li", null, line))),
      h("p", { class: "note" }, "Delta-E is the distance of two colours in CIELAB. RMSE is the root mean square difference over the wavelengths of a spectrum. Smaller is better; side by side, an eye sees differences from about 2 Delta-E."));
    const bounds = boundsWords(metadata);
    if (bounds.length) section.append(h("ul", null, ...bounds.map((line) => h("li", null, line))));
    for (const quantity of certified.quantities) {
      const rows = [{ name: "Total", meaning: "look-up against simulation", ...quantity.total }, ...quantity.parts];
      section.append(h("details", null, h("summary", null, `${capital(quantity.quantity)}: where the error comes from`),
        table("Mean, 95th percentile and largest",
          ["Part", "Delta-E mean", "95 %", "max", "RMSE mean", "95 %", "max"],
          rows.map((row) => h("tr", null,
            h("th", { scope: "row" }, row.name, h("small", null, row.meaning)),
            ...[...triples(row.delta_e), ...triples(row.rmse)].map((cell) => h("td", null, cell))))),
        quantity.worst.length ? h("p", null, "The worst points:") : null,
        h("ul", null, ...quantity.worst.map(({ at, delta_e, rmse: off }) => h("li", null,
          `${at}: ${[delta_e === null ? "" : `Delta-E ${number(delta_e, 2)}`, off === null ? "" : `RMSE ${number(off, 2)}`].filter(Boolean).join(", ")}`)))));
    }
  } else {
    section.append(h("p", null, "This file has no error budget: nobody has compared it with fresh simulations. `splitsnow verify` does so and writes the result into the file."));
    const bounds = boundsWords(metadata);
    if (bounds.length) section.append(h("ul", null, ...bounds.map((line) => h("li", null, line))));
  }
  parts.push(section);

  const rows = errorTable(metadata);
  if (rows.length) {
    parts.push(h("section", null, h("h3", null, "Compression"),
      table("Errors of the curves on the nodes, by number of components; the file has the rows marked *",
        ["Quantity", "Components", "Delta-E mean", "max", "RMSE mean", "max"],
        rows.map((row) => h("tr", row.chosen ? { class: "chosen" } : null,
          h("th", { scope: "row" }, quantityName(metadata, row.quantity)),
          h("td", null, `${row.components}${row.chosen ? " *" : ""}`),
          ...[row.delta_e, row.rmse].flatMap((errors) => (errors ? [errors.mean, errors.max] : [null, null]))
            .map((value) => h("td", null, value === null ? "-" : number(value, 2))))))));
  }

  const { curves, spectraBytes, metadataBytes } = size(file);
  const [first, last] = [file.wavelengths_nm[0]!, file.wavelengths_nm.at(-1)!];
  const facts: [string, string][] = [
    ["File", `${file.name}, ${bytesText(file.bytes)}, of which ${bytesText(metadataBytes)} describe it`],
    ["Curves", `${grouped(curves)}: every combination of the nodes, for each quantity`],
    ["Wavelengths", `${file.wavelengths_nm.length}, from ${number(first, 4)} to ${number(last, 4)} nm`],
    ...file.quantities.map(({ name, components }): [string, string] =>
      [quantityName(metadata, name), `${components} ${components === 1 ? "component" : "components"}`]),
    ["Basis, precision", `${file.basis}, ${file.precision}`],
    ["Spectra as float32", bytesText(spectraBytes)],
    ...(metadata.between_wavelengths ? [["Between wavelengths", metadata.between_wavelengths] as [string, string]] : []),
  ];
  parts.push(h("section", null, h("h3", null, "Size"), definitions(facts)));

  const origin = provenance(metadata);
  const rest = Object.entries(metadata).filter(([key]) =>
    !["certificate", "error_budget", "error_table", "provenance", "bounds", "scene"].includes(key));
  parts.push(h("section", null, h("h3", null, "Provenance"), definitions(origin),
    metadata.scene ? h("details", null, h("summary", null, "Scene that the file was made for"), h("pre", null, metadata.scene)) : null,
    h("details", null, h("summary", null, "Other metadata"), definitions(rest.map(([key, value]) => [key, value.slice(0, 2000)])))));
  return parts;
}

function definitions(list: readonly [string, string][]): HTMLElement {
  return h("dl", null, ...list.flatMap(([term, text]) => [h("dt", null, term), h("dd", null, text)]));
}

// The panel "directions".
import type { Page } from "../page";

export function mount(root: HTMLElement, _page: Page): void {
  root.textContent = "This panel is not there yet.";
}

// Starts the page.
import "./style.css";
import { keepOffline, startEngine } from "./engine/start";
import { fromFragment, toLink } from "./fragment";
import { HeldCurves } from "./held";
import type { About } from "./messages";
import { Value } from "./observable";
import { Gone, messageOf, PANELS, type AnswerTo, type Engine, type Observable, type Page, type PanelName } from "./page";
import { h, isCompact } from "./dom";
import { History, initialState } from "./state";
import { Simulation } from "./simulation";
import { openDropped } from "./snow/absorber";
import { mountStrip } from "./strip";
import { startTour } from "./tour";
import * as colourPanel from "./panels/colour";
import * as databases from "./panels/databases";
import * as directions from "./panels/directions";
import * as snow from "./panels/snow";
import * as spectra from "./panels/spectra";
import * as take from "./panels/take";
import type { Request } from "./messages";

const TITLES: Record<PanelName, string> = {
  snow: "Snow",
  spectra: "Spectra",
  colour: "Colour",
  directions: "Directions",
  databases: "Databases",
  take: "Take away",
};
/// The status line counts the seconds of a first curve that takes longer, s.
const PATIENCE_S = 2;
/// The address follows the state after this time without a change, ms.
const LINK_MS = 300;

const element = <T extends HTMLElement = HTMLElement>(id: string) => document.getElementById(id) as T;

async function start(): Promise<void> {
  const state = new History(initialState());
  const status = statusLine();
  try {
    const given = await fromFragment(location.hash);
    if (given) state.load(given);
  } catch (error) {
    status.say(messageOf(error));
  }
  const gone = new Value<string | null>(null);
  const engine = new LaterEngine(gone);
  const simulation = new Simulation(engine, state);
  const about = new Value<About | null>(null);
  const { shown, checked, refused } = simulation;
  const page: Page = { engine, state, about, checked, refused, shown, say: status.say };
  const held = new HeldCurves(page);
  mountPanels(page, held);
  mountTools(page, state);
  followLink(page, state);
  status.follow(page, simulation, gone);

  try {
    engine.set(await startEngine());
    about.set(await engine.ask({ ask: "about" }));
  } catch (error) {
    status.say(`The engine does not start: ${messageOf(error)}`);
    status.fix();
    return;
  }
  simulation.start();
  void held.start();
  keepOffline(() => status.say("There is a new version of this page: reload it."));
}

/// The engine, which the panels have before it is loaded. When it does not answer any more, the
/// status line says so, and what panels follow (`askLatest`) stays as it was.
class LaterEngine implements Engine {
  #engine: Engine | null = null;
  readonly #gone: Value<string | null>;
  readonly #waiting: (() => void)[] = [];

  constructor(gone: Value<string | null>) {
    this.#gone = gone;
  }

  set(engine: Engine): void {
    this.#engine = engine;
    for (const go of this.#waiting.splice(0)) go();
  }

  get name(): string {
    return this.#engine?.name ?? "loading";
  }

  get mostBytes(): number | undefined {
    return this.#engine?.mostBytes;
  }

  async #ready(): Promise<Engine> {
    if (!this.#engine) await new Promise<void>((resolve) => this.#waiting.push(resolve));
    return this.#engine!;
  }

  async ask<R extends Request>(request: R, data?: Uint8Array): Promise<AnswerTo<R>> {
    return this.#noted((this.#engine ?? (await this.#ready())).ask(request, data));
  }

  async askLatest<R extends Request>(channel: string, request: R, data?: Uint8Array): Promise<AnswerTo<R> | null> {
    try {
      return await this.#noted((this.#engine ?? (await this.#ready())).askLatest(channel, request, data));
    } catch (error) {
      if (error instanceof Gone) return null;
      throw error;
    }
  }

  async #noted<T>(answer: Promise<T>): Promise<T> {
    try {
      const got = await answer;
      if (got !== null) this.#gone.set(null);
      return got;
    } catch (error) {
      this.#gone.set(error instanceof Gone ? error.message : null);
      throw error;
    }
  }
}

function mountPanels(page: Page, held: HeldCurves): void {
  const tabs = element("tabs");
  const results = element("results");
  const roots = new Map<PanelName, HTMLElement>([["snow", element("panel-snow")]]);
  const buttons = new Map<PanelName, HTMLButtonElement>();
  const narrow = matchMedia("(max-width: 899px)");
  for (const name of PANELS) {
    const root = roots.get(name) ?? h("section", { id: `panel-${name}`, class: "panel" });
    roots.set(name, root);
    if (name !== "snow") results.append(root);
    const button = h("button", { type: "button", role: "tab", id: `tab-${name}`, "aria-controls": `panel-${name}` }, TITLES[name]);
    button.addEventListener("click", () => page.state.set({ panel: name }));
    root.setAttribute("role", "tabpanel");
    root.setAttribute("aria-labelledby", button.id);
    buttons.set(name, button);
    tabs.append(button);
  }
  tabs.addEventListener("keydown", (event) => {
    const by = event.key === "ArrowRight" ? 1 : event.key === "ArrowLeft" ? -1 : 0;
    if (by === 0) return;
    const there = PANELS.filter((name) => narrow.matches || name !== "snow");
    const at = there.indexOf(open());
    const next = there[(at + by + there.length) % there.length]!;
    page.state.set({ panel: next });
    buttons.get(next)!.focus();
  });
  /// Wide screens always show the snow, beside another panel.
  const open = (): PanelName => {
    const { panel } = page.state.get();
    return panel === "snow" && !narrow.matches ? "spectra" : panel;
  };
  const show = () => {
    const now = open();
    for (const [name, root] of roots) root.hidden = name === "snow" ? narrow.matches && now !== "snow" : name !== now;
    for (const [name, button] of buttons) {
      button.setAttribute("aria-selected", String(name === now));
      button.tabIndex = name === now ? 0 : -1;
    }
    if (narrow.matches) {
      // Only the bar of the tabs moves, not the page.
      const button = buttons.get(now)!;
      tabs.scrollTo({ left: button.offsetLeft - (tabs.clientWidth - button.offsetWidth) / 2 });
    }
    element("strip").hidden = now !== "snow";
  };
  // Before the panels themselves, so that they know whether they are seen.
  page.state.subscribe((_, changed) => {
    if (changed.has("panel")) show();
  });
  show();
  snow.mount(roots.get("snow")!, page);
  const measured = spectra.mount(roots.get("spectra")!, page, held);
  colourPanel.mount(roots.get("colour")!, page, held);
  directions.mount(roots.get("directions")!, page);
  const compact = databases.mount(roots.get("databases")!, page);
  takeDrops(page, measured, compact);
  take.mount(roots.get("take")!, page, held);
  mountStrip(element("strip"), page);
  narrow.addEventListener("change", () => {
    show();
    window.dispatchEvent(new Event("resize"));
  });
}

/// Files that no panel takes, so that the browser does not leave the page for them.
function takeDrops(page: Page, measured: (file: File) => void, compact: (files: File[]) => void): void {
  document.addEventListener("dragover", (event) => {
    if (event.dataTransfer?.types.includes("Files")) event.preventDefault();
  });
  document.addEventListener("drop", (event) => {
    const files = [...(event.dataTransfer?.files ?? [])];
    if (files.length === 0 || event.defaultPrevented) return;
    event.preventDefault();
    const databases = files.filter(isCompact);
    if (databases.length > 0) return compact(databases);
    void openDropped(page, files[0]!).then((isAbsorber) => {
      if (isAbsorber) return;
      page.state.set({ panel: "spectra" });
      measured(files[0]!);
    });
  });
}

function mountTools(page: Page, state: History): void {
  const undo = element<HTMLButtonElement>("undo");
  const redo = element<HTMLButtonElement>("redo");
  undo.addEventListener("click", () => state.undo());
  redo.addEventListener("click", () => state.redo());
  element("tour").addEventListener("click", () => startTour(page));
  document.addEventListener("keydown", (event) => {
    if (!(event.ctrlKey || event.metaKey) || event.altKey) return;
    const key = event.key.toLowerCase();
    if (key !== "z" && key !== "y") return;
    event.preventDefault();
    const back = key === "z" && !event.shiftKey;
    if (back ? state.undo() : state.redo()) page.say(back ? "Undone." : "Redone.");
    // A field that is being edited shows the number that came back.
    if (document.activeElement instanceof HTMLInputElement) document.activeElement.dispatchEvent(new Event("blur"));
  });
  const refresh = () => {
    undo.disabled = !state.canUndo;
    redo.disabled = !state.canRedo;
  };
  state.subscribe(refresh);
  refresh();
}

function followLink(page: Page, state: History): void {
  let timer: ReturnType<typeof setTimeout> | undefined;
  let own = location.hash;
  state.subscribe(() => {
    clearTimeout(timer);
    timer = setTimeout(() => {
      void toLink(state.get()).then(({ fragment }) => {
        own = fragment;
        history.replaceState(null, "", `${location.pathname}${location.search}${fragment}`);
      });
    }, LINK_MS);
  });
  window.addEventListener("hashchange", () => {
    if (location.hash === own) return;
    fromFragment(location.hash)
      .then((given) => state.load(given ?? initialState()))
      .catch((error: unknown) => page.say(messageOf(error)));
  });
}

function statusLine() {
  const line = element("status");
  let fixed = false;
  let message = "";
  let timer: ReturnType<typeof setTimeout> | undefined;
  let normal = () => "Loading the engine…";
  const refresh = () => {
    const text = message || normal();
    if (!fixed && line.textContent !== text) line.textContent = text;
  };
  return {
    say(text: string): void {
      message = text;
      clearTimeout(timer);
      timer = setTimeout(() => {
        message = "";
        refresh();
      }, 6000);
      refresh();
    },
    /// Keeps what is said now.
    fix(): void {
      fixed = true;
    },
    follow(page: Page, simulation: Simulation, gone: Observable<string | null>): void {
      normal = () => {
        const { shown, refused } = page;
        if (gone.value) return gone.value;
        if (refused.value) return "This snow cannot be simulated: see the message at its control. The last good curve stays.";
        if (!shown.value) return page.about.value ? `Simulating…${simulation.waited.value >= PATIENCE_S ? ` ${simulation.waited.value} s so far.` : ""}` : "Loading the engine…";
        const { spectrum, seconds } = shown.value;
        if (simulation.waited.value >= PATIENCE_S) {
          return `Simulating this snow with ${grouped(simulation.pending.value)} walks: ${simulation.waited.value} s so far. The curves are those of the snow before.`;
        }
        const more = simulation.pending.value > spectrum.rays ? ` Refining to ${grouped(simulation.pending.value)}…` : "";
        return `${grouped(spectrum.rays)} walks, ${seconds.toFixed(2)} s, engine ${spectrum.engine}, ${page.engine.name}.${more}`;
      };
      for (const value of [page.shown, page.refused, page.about, simulation.pending, simulation.waited, gone]) value.subscribe(refresh);
      simulation.stale.subscribe((stale) => element("results").setAttribute("data-stale", String(stale)));
      simulation.pending.subscribe((rays) => element("results").setAttribute("aria-busy", String(rays > 0)));
    },
  };
}

function grouped(value: number): string {
  return String(value).replace(/\B(?=(\d{3})+$)/g, "\u202f");
}

start().catch((error: unknown) => {
  console.error(error);
  element("status").textContent = `The page does not start: ${messageOf(error)}`;
});

// What a panel is given: the engine, the state, and the results that all panels share.
//
// A panel is a module with `export function mount(root: HTMLElement, page: Page): void`.
// It fills `root`, reads `page.state`, and redraws when the state or the results change.
import type { Answers, Files, Light, Request, Sample, SampleAnswer, About, Spectrum } from "./messages";

/// The answer to a request.
export type AnswerTo<R extends Request> = Answers[R["ask"]];

/// A request was refused. `key` names the key of the sample at fault, where there is one.
export class Refused extends Error {
  readonly key: string | undefined;
  constructor(message: string, key?: string) {
    super(message);
    this.name = "Refused";
    this.key = key;
  }
}

/// The engine does not answer any more. The page says so, once.
export class Gone extends Refused {}

export function messageOf(error: unknown): string {
  return error instanceof Error ? error.message : String(error);
}

/// A message about a file, with its name once.
export function namedMessage(name: string, error: unknown): string {
  const text = messageOf(error);
  return text.startsWith(name) ? text : `${name}: ${text}`;
}

export interface Engine {
  /// In words, for the status line: "WebAssembly, 4 workers".
  readonly name: string;
  /// The most bytes that may travel beside a request; none if it does not matter.
  readonly mostBytes?: number;
  /// Asks and waits. Throws `Refused`.
  ask<R extends Request>(request: R, data?: Uint8Array): Promise<AnswerTo<R>>;
  /// The same, but a later request on the same channel supersedes this one. The answer is then
  /// `null`, at once, and the work is dropped. A channel is any name: "spectrum", "wedge".
  askLatest<R extends Request>(channel: string, request: R, data?: Uint8Array): Promise<AnswerTo<R> | null>;
}

export const PANELS = ["snow", "spectra", "colour", "directions", "databases", "take"] as const;
export type PanelName = (typeof PANELS)[number];
export type Range = "visible" | "full" | "sample";

/// A curve that is kept for comparison. It is stored as its sample and computed again after a
/// reload, which gives the same numbers.
export interface Held {
  name: string;
  sample: Sample;
  files: Files;
  rays: number;
}

/// The points of a measured file, as text, and how the file was read.
export interface MeasuredFile {
  name: string;
  text: string;
  notes?: string[];
}

/// Everything that a link reproduces.
export interface State {
  sample: Sample;
  /// Text files that the sample names.
  files: Files;
  /// The panel that is open. "snow" counts on narrow screens only; wide ones always show it.
  panel: PanelName;
  /// Selected layer, counted from the base up.
  layer: number;
  /// Which wavelengths the page simulates: `sample` takes those of the sample.
  range: Range;
  scale: "linear" | "log";
  shown: { reflectance: boolean; transmittance: boolean; absorptance: boolean };
  held: Held[];
  measured: MeasuredFile | null;
  /// The light of the wedge, and a dropped one beside the built-in lights.
  light: string;
  droppedLight: Exclude<Light, string> | null;
  /// Exposure in stops: the luminance is multiplied by 2 to this power.
  exposure_stops: number;
  seed: number;
  /// For the panels "directions" and "databases": what they want a link to reproduce.
  directions: Record<string, unknown>;
  databases: Record<string, unknown>;
}

export interface Store {
  get(): State;
  /// Replaces the keys of `change`. Objects are replaced, never edited in place. Changes with
  /// the same `merge` in quick succession become one step of undo (a slider being dragged).
  set(change: Partial<State>, merge?: string): void;
  /// Calls `listener` after every change; returns a function that ends this.
  subscribe(listener: (state: State, changed: ReadonlySet<keyof State>) => void): () => void;
}

/// A value that changes, with listeners. A new listener is called at once.
export interface Observable<T> {
  readonly value: T;
  subscribe(listener: (value: T) => void): () => void;
}

/// The simulation of the current sample, as far as it has come.
export interface Shown {
  /// The sample that was simulated: that of the state, at the wavelengths of its `range`.
  sample: Sample;
  spectrum: Spectrum;
  /// Seconds from the request to the answer.
  seconds: number;
}

export interface Page {
  engine: Engine;
  state: Store;
  /// Null until the engine has answered.
  about: Observable<About | null>;
  /// The check of the current sample; null until it is checked or while it is refused.
  checked: Observable<SampleAnswer | null>;
  /// Why the current sample is refused, if it is.
  refused: Observable<Refused | null>;
  /// The spectrum; the last good one stays while a new one is computed.
  shown: Observable<Shown | null>;
  /// Tells the reader something, in the status line.
  say(message: string): void;
}

/// Walks per index node: while a control moves, soon after it rests, and in the end.
export const RAYS = [2048, 8192, 32768] as const;
/// The same toward views, whose walks have more noise.
export const VIEW_RAYS = [2048, 16384, 131072] as const;
/// Walks while a control moves, where a coarse simulation took longer than SLOW_MS.
export const FEW_RAYS = 256;
export const SLOW_MS = 600;
/// A coarse simulation that takes longer than this is taken to be stuck, ms.
export const STUCK_MS = 20_000;
/// A control rests after this time without a change, ms.
export const REST_MS = 150;

/// The sample with the wavelengths of 400-700 nm by 10, for colours.
export function inVisible(sample: Sample): Sample {
  return { ...sample, wavelengths: { start_nm: 400, stop_nm: 700, step_nm: 10 } };
}

/// The sample at the wavelengths that the page simulates.
export function inRange(sample: Sample, range: Range): Sample {
  if (range === "visible") return inVisible(sample);
  if (range === "full") return { ...sample, wavelengths: { start_nm: 350, stop_nm: 2500, step_nm: 10 } };
  return sample;
}

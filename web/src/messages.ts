// The messages between the page and an engine. Every engine answers them alike: the
// WebAssembly module in a worker (`web/engine`), and `splitsnow serve` over HTTP.
//
// A request is one JSON object whose `ask` names it; bytes (a compact file, a share of walks)
// travel beside it. The answer is one JSON object, or `Refusal`. Numbers are f64 in both
// directions, written so that they are read back to the bit.

/// A sample: the keys of a sample file (schema/sample.schema.json), as JSON.
export interface Sample {
  version: 1;
  illumination: { incidence_angle_deg: number } | { diffuse: true };
  wavelengths: { start_nm: number; stop_nm: number; step_nm: number } | { values_nm: number[] };
  /// From the base up, as in the file.
  layer: Layer[];
  /// A number from 0 to 1, or the name of one of the `files` of the request. Samples of `lookup`
  /// may have a list here, one number per wavelength.
  substrate?: { reflectance: number | number[] | string };
  model?: Record<string, unknown>;
}

export interface Layer {
  thickness_cm: number | "inf";
  density_kg_m3?: number;
  wet_density_kg_m3?: number;
  temperature_c?: number;
  water_saturation?: number;
  water_fraction?: number;
  grain: Grain[];
  black_carbon?: Carbon;
  brown_carbon?: Carbon;
  absorber?: Absorber[];
}

export interface Law {
  min: number;
  max: number;
  mean: number;
  sd: number;
}

export interface Grain {
  fraction?: number;
  size_um?: { min: number; max: number };
  optical_radius_um?: number;
  ssa_m2_kg?: number;
  facetness: Law;
  shape?: "spheroid" | "oblate" | "hexagonal";
  sphericity?: Law;
  aspect_ratio?: Law;
}

export interface Carbon {
  concentration_ng_g: number;
  sedimentation?: number;
  mass_absorption_efficiency_m2_g?: number;
  reference_wavelength_nm?: number;
  angstrom_exponent?: number;
  concentration_per?: "dry_mass" | "wet_mass";
}

/// Another light-absorbing substance. Its law is a `species`, a `file`, or an efficiency: a number
/// with its wavelength and exponent, or a list with one number per wavelength.
export interface Absorber {
  name?: string;
  concentration_ng_g?: number;
  concentration_ug_g?: number;
  concentration_per?: "dry_mass" | "wet_mass";
  phase?: "ice" | "pores";
  sedimentation?: number;
  species?: string;
  /// The name of one of the `files` of the request.
  file?: string;
  mass_absorption_efficiency_m2_g?: number | number[];
  reference_wavelength_nm?: number;
  angstrom_exponent?: number;
}

/// Small text files that a sample names (the spectrum of a substrate, the efficiency of an
/// absorber), by the name that it gives.
export type Files = Record<string, string>;

/// What every answer is instead, if the request is refused. `key` names the key of the sample
/// at fault, such as `layer[0].density_kg_m3`, where there is one.
export interface Refusal {
  error: string;
  key?: string;
}

/// The viewing light: one of `About.illuminants` or a spectrum of relative power.
export type Light = string | { name: string; wavelengths_nm: number[]; power: number[] };

// ---- about: what the engine is, presets, lights

export interface AboutRequest {
  ask: "about";
}
export interface About {
  version: string;
  /// "wasm" or "native"
  build: string;
  /// Threads that one request uses.
  threads: number;
  /// Names of the built-in lights: E, D50, D55, D65, A, LED-B5, FL3.15, ...
  illuminants: string[];
  presets: Preset[];
}
export interface Preset {
  /// File name without ending: `representative`.
  name: string;
  /// First sentence of the comment at the beginning of the file.
  title: string;
  sample: Sample;
  files: Files;
}

// ---- sample: checks a sample, gives its canonical text

export interface SampleRequest {
  ask: "sample";
  /// As JSON, or as the TOML text of a sample file.
  sample: Sample | string;
  files?: Files;
}
export interface SampleAnswer {
  /// The sample as it was given, as JSON (also if it came as TOML).
  sample: Sample;
  /// The same sample as a TOML file for `splitsnow simulate`.
  toml: string;
  warnings: string[];
  notes: string[];
  /// Per layer from the base up: specific surface area, m2/kg, and optical radius, um, of all
  /// its grains together.
  layers: { ssa_m2_kg: number; optical_radius_um: number }[];
  /// Number of index nodes, the units of work that workers share; fewer with few walks.
  nodes: number;
  /// Wavelengths, nm.
  wavelengths_nm: number[];
}

// ---- walk: the walks of some index nodes, for `simulate` elsewhere

export interface WalkRequest {
  ask: "walk";
  sample: Sample;
  files?: Files;
  rays: number;
  seed: number;
  /// Only the index nodes whose number is `worker` modulo `workers` are walked.
  worker: number;
  workers: number;
}
/// The answer's bytes are the walks, to be sent beside `simulate`.
export interface WalkAnswer {
  walks: number;
}

// ---- simulate: the spectrophotometer

export interface SimulateRequest {
  ask: "simulate";
  sample: Sample;
  files?: Files;
  /// Walks per index node. 2048 while dragging, 8192 and 32768 at rest.
  rays: number;
  seed: number;
}
export interface Spectrum {
  wavelengths_nm: number[];
  reflectance: number[];
  reflectance_se: number[];
  transmittance: number[];
  transmittance_se: number[];
  absorptance: number[];
  absorptance_se: number[];
  lost_share: number[];
  /// Systematic error of the engine beside the standard errors, at each wavelength: the root
  /// mean square error of reflectance and of transmittance, absolute.
  method_error: number[];
  engine: string;
  rays: number;
  seed: number;
  warnings: string[];
  notes: string[];
}

// ---- wedge: the spectra at several total thicknesses (the surface layer grows)

export interface WedgeRequest {
  ask: "wedge";
  sample: Sample;
  files?: Files;
  rays: number;
  seed: number;
  /// Total thicknesses, cm, strictly increasing. Those that the sample cannot have (thinner
  /// than the layers under the surface, or than its grains allow) are left out of the answer.
  thicknesses_cm: number[];
}
export interface Wedge {
  wavelengths_nm: number[];
  thicknesses_cm: number[];
  /// `[thickness][wavelength]`
  reflectance: number[][];
  transmittance: number[][];
}

// ---- directions: BRDF and BTDF

export interface DirectionsRequest {
  ask: "directions";
  sample: Sample;
  files?: Files;
  rays: number;
  seed: number;
  wavelength_nm: number;
  /// Angles of the views from the normal, degrees, [0, 90).
  view_deg: number[];
  /// Relative azimuths, degrees: 0 is forward, 180 back toward the light.
  relative_azimuth_deg: number[];
}
/// Arrays are `[view][azimuth]`.
export interface Directions {
  wavelength_nm: number;
  view_deg: number[];
  relative_azimuth_deg: number[];
  /// Bidirectional reflectance factor, pi times the BRDF (HDRF under diffuse light).
  brf: number[][];
  brf_se: number[][];
  /// The same for transmitted light, views below the snow.
  btf: number[][];
  btf_se: number[][];
  reflectance: number;
  reflectance_se: number;
  transmittance: number;
  transmittance_se: number;
  engine: string;
  rays: number;
}

// ---- colour

export interface ColourRequest {
  ask: "colour";
  wavelengths_nm: number[];
  /// Shares of light reflected or transmitted, one row a colour.
  spectra: number[][];
  light: Light;
  /// Factor on the luminance before display: 1 shows the true ratio to a white surface.
  exposure?: number;
}
export interface Colours {
  /// Tristimulus values; a white surface has Y = 1.
  xyz: number[][];
  /// CIELAB, relative to the light.
  lab: number[][];
  /// Linear sRGB after exposure, unclipped, adapted to white.
  linear: number[][];
  /// Encoded sRGB, 0 to 255, clipped.
  srgb: number[][];
  /// Whether a component of `linear` was more than 0.0001 below 0 or above 1.
  clipped: boolean[];
}

// ---- measured: a measured spectrum beside a simulated one

export interface MeasuredRequest {
  ask: "measured";
  name: string;
  /// The file as text (the tolerant reader takes CSV, ASD, SVC and tab-separated text).
  text: string;
  /// The simulated spectrum. The file says which of the two it measured.
  wavelengths_nm: number[];
  reflectance: number[];
  reflectance_se: number[];
  transmittance: number[];
  transmittance_se: number[];
}
export interface Measured {
  quantity: "reflectance" | "transmittance";
  /// How the file was read, in words.
  notes: string[];
  /// The measured spectrum as it is.
  wavelengths_nm: number[];
  values: number[];
  /// Residuals (simulated minus measured) at the simulated wavelengths within the file.
  /// `excluded` are those where water vapour blinds field spectrometers.
  residuals: { nm: number; measured: number; simulated: number; residual: number; excluded: boolean }[];
  overall: Statistics | null;
  bands: ({ name: string; from_nm: number; to_nm: number } & Statistics)[];
}
export interface Statistics {
  points: number;
  rmse: number;
  bias: number;
}

// ---- light: reads a dropped spectrum of a light

export interface LightRequest {
  ask: "light";
  name: string;
  text: string;
}
export interface LightAnswer {
  light: { name: string; wavelengths_nm: number[]; power: number[] };
  notes: string[];
}

// ---- open, lookup: compact files. The bytes of the file travel beside `open`.

export interface OpenRequest {
  ask: "open";
  name: string;
}
export interface CompactFile {
  /// For `lookup`.
  id: number;
  name: string;
  bytes: number;
  axes: { name: string; unit: string; values: number[] }[];
  wavelengths_nm: number[];
  quantities: { name: "reflectance" | "transmittance"; components: number }[];
  basis: string;
  precision: string;
  /// The metadata of the file, as text by name; `certificate`, `error_table`, `scene` and
  /// `provenance` hold JSON or TOML.
  metadata: Record<string, string>;
}
export interface LookupRequest {
  ask: "lookup";
  id: number;
  /// Value on every axis, by name.
  point: Record<string, number>;
}
export interface LookupAnswer {
  wavelengths_nm: number[];
  /// Null if the file does not have the quantity.
  reflectance: number[] | null;
  transmittance: number[] | null;
  /// The snow of the point as a sample, to simulate; null if the file does not say enough.
  sample: Sample | null;
}

export type Request =
  | AboutRequest
  | SampleRequest
  | WalkRequest
  | SimulateRequest
  | WedgeRequest
  | DirectionsRequest
  | ColourRequest
  | MeasuredRequest
  | LightRequest
  | OpenRequest
  | LookupRequest;

/// The answer to each request, by `ask`.
export interface Answers {
  about: About;
  sample: SampleAnswer;
  walk: WalkAnswer;
  simulate: Spectrum;
  wedge: Wedge;
  directions: Directions;
  colour: Colours;
  measured: Measured;
  light: LightAnswer;
  open: CompactFile;
  lookup: LookupAnswer;
}

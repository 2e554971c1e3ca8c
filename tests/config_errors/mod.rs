//! Valid config files, and edits that make them invalid. The text files in this folder have
//! the error messages.

/// A valid sample file.
pub(crate) const SAMPLE: &str = "\
version = 1
[illumination]
incidence_angle_deg = 62.3
[wavelengths]
start_nm = 400
stop_nm = 700
step_nm = 10
[[layer]]
thickness_cm = 25
density_kg_m3 = 275
temperature_c = -1
water_saturation = 0.05
[[layer.grain]]
fraction = 1.0
size_um = { min = 300, max = 750 }
facetness = { min = 0.2, max = 0.4, mean = 0.3, sd = 0.072 }
sphericity = { min = 0.6, max = 0.95, mean = 0.798, sd = 0.064 }
[layer.black_carbon]
concentration_ng_g = 0
[substrate]
reflectance = 0
[model]
entry = \"uniform\"
layers = \"continuous\"
carbon_law = \"power\"
impurity_mass = \"varsa2025\"
ice = \"warren_brandt_2008\"
water = \"segelstein_1981\"
";

/// A valid grid file.
pub(crate) const GRID: &str = "\
version = 1
[axes]
facetness = [0.1, 0.5, 0.9]
grain_size_um = [100, 300, 500]
density_kg_m3 = [200, 400]
thickness_cm = [1, 2, 5]
incidence_angle_deg = [0, 40, 80]
[spread]
facetness_half_width = 0.1
facetness_sd = 0.072
grain_size_half_width_um = 50
[wavelengths]
start_nm = 400
stop_nm = 700
step_nm = 10
[fixed]
sphericity = { min = 0.6, max = 0.95, mean = 0.798, sd = 0.064 }
temperature_c = -1
water_saturation = 0
[run]
engine = \"spectral\"
seed = 1
rays = 1000
[compression]
max_delta_e = 2.3
";

/// A valid scene file.
pub(crate) const SCENE: &str = "\
version = 1
[scene]
max_delta_e = 0.5
quantities = [\"transmittance\"]
illuminants = [\"D65\"]
delta_e = \"cie1976\"
max_bytes = 10000
max_seconds = 20
thickness_cm = { min = 1, max = 50 }
incidence_angle_deg = { min = 0, max = 89 }
[[snow]]
facetness = { min = 0.1, max = 0.9 }
grain_size_um = 300
density_kg_m3 = { min = 200, max = 400 }
[wavelengths]
start_nm = 400
stop_nm = 700
step_nm = 10
[spread]
grain_size_half_width_um = 50
[fixed]
water_saturation = 0
[run]
seed = 1
";

/// A valid sample file with two layers joined by a cascade, a mixture of grains, carbon and a
/// substrate.
pub(crate) const SNOWPACK: &str = "\
version = 1
[illumination]
diffuse = true
[wavelengths]
values_nm = [450, 850]
[[layer]]
thickness_cm = 15
density_kg_m3 = 375
[[layer.grain]]
size_um = { min = 900, max = 1000 }
facetness = { min = 0.05, max = 0.15, mean = 0.1, sd = 0.075 }
[layer.black_carbon]
concentration_ng_g = 6
[[layer]]
thickness_cm = 2
wet_density_kg_m3 = 300
water_fraction = 0.05
[[layer.grain]]
fraction = 0.25
size_um = { min = 100, max = 300 }
facetness = { min = 0.7, max = 0.9, mean = 0.8, sd = 0.5 }
[[layer.grain]]
fraction = 0.75
size_um = { min = 800, max = 1200 }
facetness = { min = 0.1, max = 0.3, mean = 0.2, sd = 0.1 }
[layer.brown_carbon]
concentration_ng_g = 500
concentration_per = \"wet_mass\"
[substrate]
reflectance = 0.2
[model]
layers = \"cascade\"
impurity_mass = \"conserved\"
";

/// Edits of [`SNOWPACK`]: the text to replace, and its replacement.
#[rustfmt::skip]
pub(crate) const SNOWPACK_ERRORS: &[(&str, &str)] = &[
    ("thickness_cm = 15\n", ""),
    ("thickness_cm = 2\n", ""),
    ("thickness_cm = 15", "thickness_cm = 0.9"),
    ("thickness_cm = 2", "thickness_cm = 1.1"),
    ("fraction = 0.25\n", ""),
    ("fraction = 0.75", "fraction = 0.7"),
    ("fraction = 0.75", "fraction = 1.75"),
    ("density_kg_m3 = 375", "density_kg_m3 = 375\nwet_density_kg_m3 = 380"),
    ("water_fraction = 0.05", "water_fraction = 0.05\nwater_saturation = 0.05"),
    ("water_fraction = 0.05", "water_saturation = 0.51"),
    ("water_fraction = 0.05", "water_fraction = 0.28"),
    ("water_fraction = 0.05", "water_fraction = 0.45"),
    ("concentration_ng_g = 500", "concentration_ng_g = -500"),
];

/// Edits of [`SAMPLE`]: the text to replace, and its replacement.
#[rustfmt::skip]
pub(crate) const SAMPLE_ERRORS: &[(&str, &str)] = &[
    // Invalid TOML or unknown keys.
    ("version = 1", "version = "),
    ("version = 1\n", ""),
    ("version = 1", "version = 2"),
    ("version = 1", "version = \"1\""),
    ("version = 1", "version = 1.0"),
    ("version = 1", "version = 99999999999999999999999999999999999999999999"),
    ("thickness_cm = 25", "thickness_cm = 25\nthickness_cm = 26"),
    ("min = 300, max = 750", "min = 300, min = 301, max = 750"),
    ("[model]", "[wavelengths]"),
    ("density_kg_m3 = 275", "densty_kg_m3 = 275"),
    ("[illumination]", "[ilumination]"),
    ("thickness_cm = 25", "thickness_m = 0.25"),
    ("[substrate]", "[\"odd key\"]"),
    ("[[layer]]", "[layer]"),
    ("[[layer.grain]]", "[layer.grain]"),
    ("size_um = { min = 300, max = 750 }", "size_um = [300, 750]"),
    ("size_um = { min = 300, max = 750 }", "size_um = { min = 300 }"),
    ("thickness_cm = 25", "thickness_cm = \"25\""),
    ("thickness_cm = 25", "thickness_cm = true"),
    ("thickness_cm = 25", "thickness_cm = 2025-01-01"),
    ("[[layer]]", "[other]"),
    // A single invalid number.
    ("thickness_cm = 25", "thickness_cm = nan"),
    ("thickness_cm = 25", "thickness_cm = \"infinite\""),
    ("[[layer]]", "[[layer]]\nthickness_cm = 5\ndensity_kg_m3 = 375\ngrain = [{ size_um = { min = 300, max = 400 }, facetness = { min = 0.1, max = 1, mean = 0.5, sd = 1 } }]\n[[layer]]\nthickness_cm = inf\ndensity_kg_m3 = 375\ngrain = [{ size_um = { min = 300, max = 400 }, facetness = { min = 0.1, max = 1, mean = 0.5, sd = 1 } }]\n[[layer]]"),
    ("size_um = { min = 300, max = 750 }\n", ""),
    ("size_um = { min = 300, max = 750 }", "size_um = { min = 300, max = 750 }\noptical_radius_um = 82"),
    ("size_um = { min = 300, max = 750 }", "ssa_m2_kg = 20\noptical_radius_um = 82"),
    ("size_um = { min = 300, max = 750 }", "optical_radius_um = 3"),
    ("size_um = { min = 300, max = 750 }", "ssa_m2_kg = 1"),
    ("size_um = { min = 300, max = 750 }", "ssa_m2_kg = 0"),
    ("thickness_cm = 25", "thickness_cm = -inf"),
    ("thickness_cm = 25", "thickness_cm = 1e999"),
    ("thickness_cm = 25", "thickness_cm = 0"),
    ("thickness_cm = 25", "thickness_cm = -1"),
    ("thickness_cm = 25", "thickness_cm = 10001"),
    ("density_kg_m3 = 275", "density_kg_m3 = 0"),
    ("density_kg_m3 = 275", "density_kg_m3 = 550.1"),
    ("density_kg_m3 = 275", "density_kg_m3 = 930"),
    ("temperature_c = -1", "temperature_c = 0.5"),
    ("temperature_c = -1", "temperature_c = -40.5"),
    ("water_saturation = 0.05", "water_saturation = 0.51"),
    ("incidence_angle_deg = 62.3", "incidence_angle_deg = 90"),
    ("incidence_angle_deg = 62.3", "incidence_angle_deg = -0.1"),
    ("min = 300", "min = 0"),
    ("min = 300", "min = -300"),
    ("min = 300", "min = 9.9"),
    ("max = 750", "max = 6001"),
    ("facetness = { min = 0.2", "facetness = { min = -0.2"),
    ("max = 0.4", "max = 1.4"),
    ("sd = 0.072", "sd = -0.072"),
    ("sphericity = { min = 0.6", "sphericity = { min = 0"),
    ("sphericity = { min = 0.6", "shape = \"hexagonal\"\nsphericity = { min = 0.6"),
    ("sphericity = { min = 0.6", "shape = \"oblat\"\nsphericity = { min = 0.6"),
    ("sphericity = { min = 0.6, max = 0.95, mean = 0.798, sd = 0.064 }", "shape = \"hexagonal\""),
    ("sphericity = { min = 0.6", "aspect_ratio = { min = 0.6"),
    ("sphericity = { min = 0.6, max = 0.95", "shape = \"hexagonal\"\naspect_ratio = { min = 0.01, max = 0.95"),
    ("entry = \"uniform\"", "facets = \"grooves\""),
    ("entry = \"uniform\"", "preset = \"snow\""),
    ("max = 0.95", "max = 1.05"),
    ("concentration_ng_g = 0", "concentration_ng_g = -6"),
    ("reflectance = 0", "reflectance = 1.5"),
    // Two numbers that are inconsistent.
    ("min = 300", "min = 800"),
    ("facetness = { min = 0.2", "facetness = { min = 0.5"),
    ("mean = 0.3", "mean = 0.41"),
    ("mean = 0.798", "mean = 0.5"),
    ("thickness_cm = 25", "thickness_cm = 0.7"),
    ("fraction = 1.0", "fraction = 0.5"),
    // Keys that exclude each other.
    ("incidence_angle_deg = 62.3", "incidence_angle_deg = 62.3\ndiffuse = true"),
    ("incidence_angle_deg = 62.3", "diffuse = false"),
    ("density_kg_m3 = 275", "density_kg_m3 = 275\nwet_density_kg_m3 = 300"),
    ("density_kg_m3 = 275\n", ""),
    ("density_kg_m3 = 275", "wet_density_kg_m3 = 80"),
    ("water_saturation = 0.05", "water_saturation = 0.05\nwater_fraction = 0.1"),
    ("water_saturation = 0.05", "water_fraction = 0.4"),
    ("start_nm = 400", "start_nm = 400\nvalues_nm = [500]"),
    ("start_nm = 400\nstop_nm = 700\nstep_nm = 10\n", ""),
    ("step_nm = 10\n", ""),
    // Wavelengths.
    ("start_nm = 400", "start_nm = 349"),
    ("stop_nm = 700", "stop_nm = 5001"),
    ("start_nm = 400", "start_nm = 701"),
    ("step_nm = 10", "step_nm = 0"),
    ("step_nm = 10", "step_nm = -10"),
    ("step_nm = 10", "step_nm = 1e-300"),
    ("step_nm = 10", "step_nm = 0.05"),
    ("start_nm = 400\nstop_nm = 700\nstep_nm = 10", "values_nm = []"),
    ("start_nm = 400\nstop_nm = 700\nstep_nm = 10", "values_nm = [400, 600, 500]"),
    ("start_nm = 400\nstop_nm = 700\nstep_nm = 10", "values_nm = [400, 400]"),
    ("start_nm = 400\nstop_nm = 700\nstep_nm = 10", "values_nm = [400, nan]"),
    ("start_nm = 400\nstop_nm = 700\nstep_nm = 10", "values_nm = [400, \"500\"]"),
    // Named choices and data tables.
    ("\"uniform\"", "\"unifrm\""),
    ("\"uniform\"", "\"Projected\""),
    ("\"uniform\"", "1"),
    ("\"warren_brandt_2008\"", "\"warren_brandt_1984\""),
    ("\"segelstein_1981\"", "\"segelstien_1981\""),
    ("\"segelstein_1981\"", "\"rowe_2020\""),
    ("\"segelstein_1981\"", "\"none/such.csv\""),
    // Layers, types of grain, carbon, substrate.
    ("[[layer]]", "[[layer]]\ndensity_kg_m3 = 375\ngrain = [{ size_um = { min = 900, max = 1000 }, facetness = { min = 0, max = 1, mean = 0.5, sd = 1 } }]\n[[layer]]"),
    ("[[layer]]", "[[layer]]\nthickness_cm = 5\ndensity_kg_m3 = 375\n[[layer]]"),
    ("[[layer]]", "[[layer]]\nthickness_cm = 5\ndensity_kg_m3 = 375\ngrain = []\n[[layer]]"),
    ("fraction = 1.0", "fraction = 0.5\nsize_um = { min = 100, max = 200 }\nfacetness = { min = 0.2, max = 0.4, mean = 0.3, sd = 0.072 }\n[[layer.grain]]\nfraction = 0.49"),
    ("fraction = 1.0", "fraction = 0.5\nsize_um = { min = 100, max = 200 }\nfacetness = { min = 0.2, max = 0.4, mean = 0.3, sd = 0.072 }\n[[layer.grain]]"),
    ("concentration_ng_g = 0", "concentration_ng_g = 6\nsedimentation = 1.1"),
    ("concentration_ng_g = 0", "sedimentation = 0.5"),
    ("concentration_ng_g = 0", "concentration_ng_g = 6\nangstrom_exponent = -1"),
    ("concentration_ng_g = 0", "concentration_ng_g = 6\nconcentration_per = \"wet\""),
    ("[layer.black_carbon]", "[layer.dust]"),
    ("reflectance = 0", "reflectance = -0.1"),
    ("reflectance = 0", "reflectance = true"),
    ("reflectance = 0", "reflectance = \"soil.txt\""),
    ("reflectance = 0", "reflectance = \"none/such.csv\""),
    ("reflectance = 0", "reflectance = \"tests/config_errors/ground_header.csv\""),
    ("reflectance = 0", "reflectance = \"tests/config_errors/ground_range.csv\""),
    ("reflectance = 0", "reflectance = \"tests/config_errors/ground_short.csv\""),
    ("reflectance = 0", "reflectance = \"tests/config_errors/ground_row.csv\""),
    ("reflectance = 0", "reflectance = \"tests/config_errors/ground_hole.csv\""),
    ("reflectance = 0", "reflectance = [0.1, 0.2]"),
    ("reflectance = 0", "reflectance = [0.1, 1.2]"),
    ("reflectance = 0\n", ""),
    ("\"continuous\"", "\"cascaded\""),
    ("entry = \"uniform\"", "size_law = \"consistant\""),
    ("\"power\"", "\"varsa2024\""),
    ("impurity_mass = \"varsa2025\"", "impurity_mass = \"conservd\""),
    ("carbon_law = ", "carbon_low = "),
];

/// Edits of [`GRID`]: the text to replace, and its replacement.
#[rustfmt::skip]
pub(crate) const GRID_ERRORS: &[(&str, &str)] = &[
    ("version = 1", "version = 3"),
    ("[axes]\n", ""),
    ("facetness = [0.1, 0.5, 0.9]\n", ""),
    ("facetness = [0.1, 0.5, 0.9]", "facetness = []"),
    ("facetness = [0.1, 0.5, 0.9]", "facetness = 0.1"),
    ("facetness = [0.1, 0.5, 0.9]", "facetness = [0.1, 0.5, 1.9]"),
    ("incidence_angle_deg = [0, 40, 80]", "incidence_angle_deg = [0, 40, 90]"),
    ("incidence_angle_deg = [0, 40, 80]", "incidence_angles_deg = [0, 40, 80]"),
    ("incidence_angle_deg = [0, 40, 80]", "incidence_angle_deg = [0, 40, 40]"),
    ("incidence_angle_deg = [0, 40, 80]", "incidence_angle_deg = [0, 80, 40]"),
    ("incidence_angle_deg = [0, 40, 80]", "incidence_angle_deg = [0, nan]"),
    ("density_kg_m3 = [200, 400]", "density_kg_m3 = [200, 920]"),
    ("thickness_cm = [1, 2, 5]", "thickness_cm = [0, 2, 5]"),
    ("thickness_cm = [1, 2, 5]", "thickness_cm = [0.1, 2, 5]"),
    ("thickness_cm = [1, 2, 5]", "thickness_cm = [0.2, 0.5]"),
    ("grain_size_um = [100, 300, 500]", "grain_size_um = [55, 300]"),
    ("grain_size_um = [100, 300, 500]", "grain_size_um = [300, 5990]"),
    ("grain_size_um = [100, 300, 500]\n", ""),
    ("grain_size_um = [100, 300, 500]", "grain_size_um = [100]\nssa_m2_kg = [5, 20]"),
    ("grain_size_um = [100, 300, 500]", "optical_radius_um = [100]\nssa_m2_kg = [5, 20]"),
    ("grain_size_um = [100, 300, 500]", "optical_radius_um = [100, 50]"),
    ("grain_size_um = [100, 300, 500]", "optical_radius_um = [3, 100]"),
    ("grain_size_um = [100, 300, 500]", "ssa_m2_kg = [1, 20]"),
    ("grain_size_um = [100, 300, 500]", "optical_radius_um = [50, 100]\nsphericity = [0.7, 0.8]"),
    ("thickness_cm = [1, 2, 5]", "thickness_cm = [1, \"deep\"]"),
    ("thickness_cm = [1, 2, 5]", "thickness_cm = [1, 20000]"),
    ("thickness_cm = [1, 2, 5]", "thickness_cm = [1, 3e6]"),
    ("thickness_cm = [1, 2, 5]", "thickness_cm = [1, inf, inf]"),
    ("grain_size_um = [100, 300, 500]", "grain_size_um = [5, 300]"),
    // Optional axes.
    ("incidence_angle_deg = [0, 40, 80]", "incidence_angle_deg = [0, 40, 80]\nwater_saturation = [0, 0.1]"),
    ("incidence_angle_deg = [0, 40, 80]", "incidence_angle_deg = [0, 40, 80]\nview_deg = [0, 60]"),
    ("incidence_angle_deg = [0, 40, 80]", "incidence_angle_deg = [0, 40, 80]\nrelative_azimuth_deg = [0, 180]"),
    ("incidence_angle_deg = [0, 40, 80]", "incidence_angle_deg = [0, 40, 80]\nview_deg = [0, 89]\nrelative_azimuth_deg = [0]"),
    ("incidence_angle_deg = [0, 40, 80]", "incidence_angle_deg = [0, 40, 80]\nview_deg = [0]\nrelative_azimuth_deg = [-90, 90]"),
    ("[run]\n", "[run]\nview_rays = 100\n"),
    ("incidence_angle_deg = [0, 40, 80]", "incidence_angle_deg = [0, 40, 80]\ntemperature_c = [-5]"),
    ("incidence_angle_deg = [0, 40, 80]", "incidence_angle_deg = [0, 40, 80]\nsphericity = [0.7, 0.8]"),
    ("incidence_angle_deg = [0, 40, 80]", "incidence_angle_deg = [0, 40, 80]\nsphericity = [0, 0.8]"),
    ("sphericity = { min = 0.6", "shape = \"hexagonal\"\nsphericity = { min = 0.6"),
    ("incidence_angle_deg = [0, 40, 80]", "incidence_angle_deg = [0, 40, 80]\nblack_carbon_ng_g = [100, 0]"),
    ("incidence_angle_deg = [0, 40, 80]", "incidence_angle_deg = [0, 40, 80]\nsubstrate_reflectance = [0, 1.1]"),
    ("incidence_angle_deg = [0, 40, 80]", "incidence_angle_deg = [0, 40, 80]\nblack_carbon_ng_g = []"),
    ("incidence_angle_deg = [0, 40, 80]", "incidence_angle_deg = [0, 40, 80]\nsubstrate_reflectance = [0, 0.5]\n[fixed.substrate]\nreflectance = 0.3"),
    ("incidence_angle_deg = [0, 40, 80]", "incidence_angle_deg = [0, 40, 80]\nblack_carbon_ng_g = [0, 5]\n[fixed.black_carbon]\nconcentration_ng_g = 5"),
    ("water_saturation = 0", "black_carbon = { sedimentation = 0.5 }"),
    ("facetness_half_width = 0.1", "sphericity_half_width = 1.1"),
    ("facetness_half_width = 0.1", "sphericity_half_width = 0.1"),
    ("facetness_half_width = 0.1", "facetness_half_width = -0.1"),
    ("facetness_sd = 0.072", "facetness_sd = -0.072"),
    ("sphericity = { min = 0.6", "sphericity = { min = 0.96"),
    ("mean = 0.798", "mean = 0.99"),
    ("water_saturation = 0", "water_saturation = 0\nwater_fraction = 0"),
    ("water_saturation = 0", "water_fraction = 0.1"),
    ("water_saturation = 0", "black_carbon = { concentration_ng_g = -5 }"),
    ("water_saturation = 0", "black_carbon = { concentration_ng_g = 5, sedimentation = 2 }"),
    ("water_saturation = 0", "substrate = { reflectance = 1.5 }"),
    ("water_saturation = 0", "substrate = { reflectance = \"tests/config_errors/ground_short.csv\" }"),
    ("water_saturation = 0", "below = [{ thickness_cm = 1, density_kg_m3 = 300, grain = [{ size_um = { min = 300, max = 900 }, facetness = { min = 0, max = 1, mean = 0.5, sd = 1 } }] }]"),
    ("water_saturation = 0", "below = [{ thickness_cm = 0.5, density_kg_m3 = 300, grain = [{ size_um = { min = 300, max = 2000 }, facetness = { min = 0, max = 1, mean = 0.5, sd = 1 } }] }]"),
    ("water_saturation = 0", "below = [{ density_kg_m3 = 300, grain = [{ size_um = { min = 300, max = 600 }, facetness = { min = 0, max = 1, mean = 0.5, sd = 1 } }] }]"),
    ("[run]", "[model]\nlayers = \"cascade\"\n[[fixed.below]]\nthickness_cm = 0.9\ndensity_kg_m3 = 300\ngrain = [{ size_um = { min = 300, max = 600 }, facetness = { min = 0, max = 1, mean = 0.5, sd = 1 } }]\n[run]"),
    ("[run]", "[model]\nlayers = \"cascade\"\n[[fixed.below]]\nthickness_cm = 0.5\ndensity_kg_m3 = 300\ngrain = [{ size_um = { min = 300, max = 600 }, facetness = { min = 0, max = 1, mean = 0.5, sd = 1 } }]\n[run]"),
    ("[run]", "[model]\nlayers = \"cascades\"\n[run]"),
    ("engine = \"spectral\"", "engine = \"spectrl\""),
    ("seed = 1", "seed = -1"),
    ("rays = 1000", "rays = 0"),
    ("rays = 1000", "rays = 1000000000001"),
    ("rays = 1000", "rays = 1e5"),
    ("rays = 1000\n", ""),
    ("rays = 1000\n", "rays = 1000\nmax_error = { rmse = 1e-3 }\n"),
    ("engine = \"spectral\"", "max_error = { rmse = 0 }"),
    ("engine = \"spectral\"", "max_error = { delta_e = 101 }"),
    ("engine = \"spectral\"", "max_error = { max = 1 }"),
    ("max_delta_e = 2.3", "max_delta_e = 0"),
    ("max_delta_e = 2.3", "max_delta_e = 2.3\nmax_rmse = inf"),
    ("max_delta_e = 2.3", "illuminants = [\"D65\", \"D60\"]"),
    ("max_delta_e = 2.3", "illuminants = [\"E\", \"LED-B5\", \"E\"]"),
    ("max_delta_e = 2.3", "illuminants = [\"d50\"]"),
    ("max_delta_e = 2.3", "illuminants = [5]"),
    ("max_delta_e = 2.3", "illuminants = [\"tests/config_errors/light_nan.csv\"]"),
    ("max_delta_e = 2.3", "illuminants = [\"tests/config_errors/light_short.csv\"]"),
    ("max_delta_e = 2.3", "illuminants = [{ name = \"mine\", wavelength_nm = [380, 780] }]"),
    ("max_delta_e = 2.3", "illuminants = [{ name = \"mine\", wavelength_nm = [380, 780], power = [1, -1] }]"),
    ("max_delta_e = 2.3", "illuminants = []"),
    ("max_delta_e = 2.3", "illuminants = \"D65\""),
    ("max_delta_e = 2.3", "delta_e = \"cie94\""),
];

/// Edits of [`SCENE`]: the text to replace, and its replacement.
#[rustfmt::skip]
pub(crate) const SCENE_ERRORS: &[(&str, &str)] = &[
    ("version = 1", "version = 2"),
    ("[scene]\n", "[scenes]\n"),
    ("max_delta_e = 0.5\n", ""),
    ("max_delta_e = 0.5", "max_delta_e = 0"),
    ("max_delta_e = 0.5", "max_deltae = 0.5"),
    ("\"transmittance\"", "\"transmitance\""),
    ("\"transmittance\"", "\"transmittance\", \"transmittance\""),
    ("[\"transmittance\"]", "[]"),
    ("\"D65\"", "\"D60\""),
    ("\"cie1976\"", "\"cie1994\""),
    ("max_bytes = 10000", "max_bytes = 0"),
    ("max_bytes = 10000", "max_bytes = 1e4"),
    ("max_seconds = 20", "max_seconds = 0"),
    // Ranges.
    ("thickness_cm = { min = 1, max = 50 }\n", ""),
    ("{ min = 1, max = 50 }", "[1, 50]"),
    ("{ min = 1, max = 50 }", "{ min = 1 }"),
    ("{ min = 1, max = 50 }", "{ min = 1, max = 50, step = 1 }"),
    ("{ min = 1, max = 50 }", "{ min = 1, max = \"50\" }"),
    ("{ min = 1, max = 50 }", "{ min = 50, max = 1 }"),
    ("{ min = 1, max = 50 }", "{ min = 0, max = 50 }"),
    ("{ min = 1, max = 50 }", "{ min = 1, max = 1001 }"),
    ("{ min = 1, max = 50 }", "0"),
    ("{ min = 0, max = 89 }", "{ min = 0, max = 90 }"),
    ("{ min = 0, max = 89 }", "nan"),
    ("{ min = 0.1, max = 0.9 }", "{ min = -0.1, max = 0.9 }"),
    ("{ min = 0.1, max = 0.9 }", "{ min = 0.1, max = inf }"),
    ("{ min = 0.1, max = 0.9 }", "1.1"),
    ("grain_size_um = 300", "grain_size_um = 5"),
    ("{ min = 200, max = 400 }", "{ min = 200, max = 900 }"),
    // Numbers that are inconsistent.
    ("grain_size_um = 300", "grain_size_um = { min = 55, max = 300 }"),
    ("grain_size_um = 300", "grain_size_um = { min = 300, max = 2990 }"),
    ("grain_size_um = 300", "grain_size_um = { min = 300, max = 1000 }"),
    ("grain_size_half_width_um = 50", "grain_size_half_width_um = 299"),
    ("[wavelengths]", "[[snow]]\nfacetness = 0.5\ngrain_size_um = 1000\ndensity_kg_m3 = 300\n[wavelengths]"),
    ("[[snow]]", "[snow]"),
    // Optional axes.
    ("facetness = { min = 0.1, max = 0.9 }", "facetness = 0.1\nwater_saturation = { min = 0, max = 0.1 }"),
    ("facetness = { min = 0.1, max = 0.9 }", "facetness = 0.1\nblack_carbon_ng_g = { min = 9, max = 0 }"),
    ("facetness = { min = 0.1, max = 0.9 }", "facetness = 0.1\ntemperature_c = 1"),
    ("[wavelengths]", "[[snow]]\nfacetness = 0.5\ngrain_size_um = 300\ndensity_kg_m3 = 300\nsphericity = 0.8\n[wavelengths]"),
    ("water_saturation = 0", "black_carbon = { sedimentation = 0.5 }"),
    ("water_saturation = 0", "water_fraction = 0.1"),
    ("water_saturation = 0", "water_saturation = 0\nwater_fraction = 0"),
    ("water_saturation = 0", "black_carbon = { concentration_ng_g = -5 }"),
    ("water_saturation = 0", "black_carbon = { concentration_ng_g = 5, sedimentation = 2 }"),
    ("water_saturation = 0", "substrate = { reflectance = 1.5 }"),
    ("water_saturation = 0", "substrate = { reflectance = \"tests/config_errors/ground_short.csv\" }"),
    ("water_saturation = 0", "below = [{ thickness_cm = 1, density_kg_m3 = 300, grain = [{ size_um = { min = 300, max = 900 }, facetness = { min = 0, max = 1, mean = 0.5, sd = 1 } }] }]"),
    ("water_saturation = 0", "below = [{ thickness_cm = 0.5, density_kg_m3 = 300, grain = [{ size_um = { min = 300, max = 2000 }, facetness = { min = 0, max = 1, mean = 0.5, sd = 1 } }] }]"),
    ("water_saturation = 0", "below = [{ density_kg_m3 = 300, grain = [{ size_um = { min = 300, max = 600 }, facetness = { min = 0, max = 1, mean = 0.5, sd = 1 } }] }]"),
    ("[run]", "[model]\nlayers = \"cascade\"\n[[fixed.below]]\nthickness_cm = 0.7\ndensity_kg_m3 = 300\ngrain = [{ size_um = { min = 300, max = 600 }, facetness = { min = 0, max = 1, mean = 0.5, sd = 1 } }]\n[run]"),
    ("[run]", "[model]\nlayers = \"cascade\"\n[[fixed.below]]\nthickness_cm = 0.5\ndensity_kg_m3 = 300\ngrain = [{ size_um = { min = 300, max = 600 }, facetness = { min = 0, max = 1, mean = 0.5, sd = 1 } }]\n[run]"),
    ("start_nm = 400\nstop_nm = 700", "start_nm = 800\nstop_nm = 1400"),
    ("start_nm = 400\nstop_nm = 700\nstep_nm = 10", "values_nm = [500, 600]"),
    ("seed = 1", "seed = -1"),
    ("seed = 1", "rays = 1000"),
];

/// A valid study file. It requires [`SAMPLE`] as `base.toml` in the same folder.
pub(crate) const STUDY: &str = "\
version = 1
title = \"Two samples\"
expected = \"no difference\"
sample = \"base.toml\"
[draw]
quantity = \"reflectance\"
[set]
wavelengths = { values_nm = [500, 600] }
[[variant]]
label = \"thin\"
set.\"layer[0].thickness_cm\" = 5
[[variant]]
label = \"new snow\"
set.\"layer[1]\" = { thickness_cm = 1, density_kg_m3 = 100, grain = [] }
set.\"layer[1].grain[0].size_um\" = { min = 50, max = 100 }
set.\"layer[1].grain[0].facetness\" = { min = 0, max = 1, mean = 0.5, sd = 1 }
[[published]]
label = \"measured\"
wavelength_nm = 500
value = 0.9
min = 0.8
max = 0.95
";

/// A valid study file of a BRDF.
pub(crate) const BRDF_STUDY: &str = "\
version = 1
title = \"Two directions of light\"
expected = \"a forward peak\"
sample = \"base.toml\"
[draw]
quantity = \"brdf\"
scale = \"logarithmic\"
[set]
wavelengths = { values_nm = [600] }
[[variant]]
label = \"0 degrees\"
[[variant]]
label = \"60 degrees\"
set.illumination = { incidence_angle_deg = 60 }
";

/// Edits of [`BRDF_STUDY`]: the text to replace, and its replacement.
pub(crate) const BRDF_STUDY_ERRORS: &[(&str, &str)] = &[
    ("[600]", "[600, 700]"),
    (
        "{ incidence_angle_deg = 60 }",
        "{ incidence_angle_deg = 60 }\n[[published]]\nlabel = \"a\"\nwavelength_nm = 600\nvalue = 1",
    ),
    ("{ incidence_angle_deg = 60 }", "{ diffuse = true }"),
    ("\"logarithmic\"", "\"log\""),
];

/// Edits of [`STUDY`]: the text to replace, and its replacement.
pub(crate) const STUDY_ERRORS: &[(&str, &str)] = &[
    ("title =", "titel ="),
    ("\"base.toml\"", "\"none.toml\""),
    ("\"reflectance\"", "\"btdf\""),
    ("\"reflectance\"", "\"brdf\""),
    (
        "quantity = \"reflectance\"",
        "quantity = \"reflectance\"\ndirections = \"hemisphere\"",
    ),
    (
        "quantity = \"reflectance\"",
        "quantity = \"transmittance\"\nsensors = 100",
    ),
    (
        "quantity = \"reflectance\"",
        "quantity = \"brdf\"\ndirections = \"all\"",
    ),
    (
        "quantity = \"reflectance\"",
        "quantity = \"brdf\"\nsensors = 0",
    ),
    (
        "quantity = \"reflectance\"",
        "quantity = \"brdf\"\nfrom = 0.1",
    ),
    (
        "quantity = \"reflectance\"",
        "quantity = \"brdf\"\nagainst = \"wavelength\"",
    ),
    (
        "quantity = \"reflectance\"",
        "quantity = \"reflectance\"\nagainst = \"depth\"",
    ),
    (
        "[set]\nwavelengths = { values_nm = [500, 600] }",
        "against = \"thickness\"\n[set]\nwavelengths = { values_nm = [800] }",
    ),
    ("values_nm = [500, 600]", "values_nm = [500, 200]"),
    ("thickness_cm\" = 5", "thickness_cm\" = 0.5"),
    ("layer[0].thickness_cm", "layer[0].thicknes_cm"),
    ("layer[0].thickness_cm", "layer[7].thickness_cm"),
    ("layer[0].thickness_cm", "layer.thickness_cm"),
    ("layer[0].thickness_cm", "layer[x].thickness_cm"),
    ("\"layer[0].thickness_cm\"", "\"\""),
    ("label = \"thin\"", "title = \"thin\""),
    ("value = 0.9", "value = 9"),
];

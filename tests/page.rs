//! The messages of the page, answered as the program answers.
#![allow(clippy::unwrap_used)]
use serde_json::{Value, json};
use splitsnow::Simulation;
use splitsnow::config::sample;
use splitsnow::engine::Engine;
use splitsnow::page::{Limits, PageEngine};

/// The samples that the page offers.
fn presets() -> Vec<Value> {
    let about = ask(&mut PageEngine::default(), json!({ "ask": "about" }));
    about["presets"].as_array().unwrap().clone()
}

fn preset(name: &str) -> Value {
    let presets = presets();
    let mut found = presets.into_iter().filter(|preset| preset["name"] == name);
    found.next().unwrap()
}

fn ask_with(engine: &mut PageEngine, request: &Value, data: &[u8]) -> (Value, Vec<u8>) {
    let answer = engine.answer(request.to_string().as_bytes(), data);
    (serde_json::from_str(&answer.json).unwrap(), answer.data)
}

fn ask(engine: &mut PageEngine, request: Value) -> Value {
    ask_with(engine, &request, &[]).0
}

fn numbers(list: &Value) -> Vec<f64> {
    let list = list.as_array().unwrap();
    list.iter().map(|value| value.as_f64().unwrap()).collect()
}

/// The representative sample at a few wavelengths.
fn representative() -> Value {
    let mut sample = preset("representative")["sample"].clone();
    sample["wavelengths"] = json!({ "values_nm": [420, 550, 680] });
    sample
}

#[test]
fn every_sample_of_the_project_is_a_preset() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/samples");
    let files = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path());
    let mut files: Vec<_> = files
        .filter(|path| path.extension().is_some_and(|end| end == "toml"))
        .collect();
    files.sort();
    let presets = presets();
    assert_eq!(files.len(), presets.len());
    for path in files {
        let name = path.file_stem().unwrap().to_str().unwrap();
        let preset = presets
            .iter()
            .find(|preset| preset["name"] == name)
            .unwrap();
        assert!(preset["title"].as_str().unwrap().len() > 10, "{name}");
        // the sample of the page is that of the file
        let request =
            json!({ "ask": "sample", "sample": preset["sample"], "files": preset["files"] });
        let answer = ask(&mut PageEngine::default(), request);
        let of_page = sample::parse("page.toml", answer["toml"].as_str().unwrap()).unwrap();
        let of_file = sample::read(&path).unwrap();
        assert_eq!(of_page.snowpack, of_file.snowpack, "{name}");
        assert_eq!(of_page.wavelengths_nm, of_file.wavelengths_nm, "{name}");
        assert_eq!(of_page.model, of_file.model, "{name}");
        let layers = answer["layers"].as_array().unwrap();
        assert_eq!(layers.len(), of_file.snowpack.snows().count(), "{name}");
    }
}

/// The numbers are those of the program for the file that the page gives, to the bit, whether
/// one worker computes them or several share the walks.
#[test]
fn a_spectrum_is_that_of_the_program_to_the_bit() {
    for name in ["representative", "soot_on_grass", "crust", "p18", "dusty"] {
        let preset = preset(name);
        let mut sample = preset["sample"].clone();
        sample["wavelengths"] = json!({ "values_nm": [420, 550, 680, 1030, 1300] });
        if name == "soot_on_grass" {
            sample["wavelengths"] = json!({ "values_nm": [420, 550, 680, 1000] });
        }
        let mut engine = PageEngine::default();
        let request = |ask: &str| json!({ "ask": ask, "sample": sample, "files": preset["files"], "rays": 512, "seed": 3 });
        let checked = ask(&mut engine, request("sample"));
        let file = sample::parse("page.toml", checked["toml"].as_str().unwrap()).unwrap();
        let expected = Simulation::of(&file).rays(512).seed(3).run().unwrap();
        let (mut walks, mut count) = (Vec::new(), 0);
        // few walks have few index nodes, so that a worker may be left without one
        for worker in [2, 0, 1] {
            let mut request = request("walk");
            request["worker"] = json!(worker);
            request["workers"] = json!(3);
            // a worker of its own
            let (answer, data) = ask_with(&mut PageEngine::default(), &request, &[]);
            count += answer["walks"].as_u64().unwrap();
            walks.extend(data);
        }
        assert!(count > 0, "{name}");
        for walks in [&[][..], &walks] {
            let (answer, _) = ask_with(&mut engine, &request("simulate"), walks);
            let columns = [
                ("reflectance", &expected.reflectance),
                ("transmittance", &expected.transmittance),
            ];
            for (quantity, measured) in columns {
                let values: Vec<f64> = measured.iter().map(|m| m.value).collect();
                let errors: Vec<f64> = measured.iter().map(|m| m.se).collect();
                assert_eq!(numbers(&answer[quantity]), values, "{name}");
                assert_eq!(numbers(&answer[format!("{quantity}_se")]), errors, "{name}");
            }
        }
        let (cut, _) = ask_with(&mut engine, &request("simulate"), &walks[..walks.len() - 1]);
        assert!(
            cut["error"].as_str().unwrap().contains("cut short"),
            "{cut}"
        );
    }
}

/// A table of an absorber in the message gives the file that the program makes of it on a disk.
#[test]
fn an_absorber_may_come_from_a_file() {
    const TABLE: &str = "# soil\nwavelength_nm,mac_m2_g\n350,0.2\n600,0.07\n1300,0.011\n";
    let mut sample = preset("dusty")["sample"].clone();
    let absorbers = json!([
        { "species": "volcanic_ash", "concentration_ng_g": 5000 },
        { "file": "soil.csv", "concentration_ug_g": 20, "sedimentation": 0.25 },
        { "file": "soil.csv", "name": "twice", "concentration_ug_g": 3, "phase": "pores" },
    ]);
    sample["layer"][0]["absorber"] = absorbers;
    let mut engine = PageEngine::default();
    let mut check = |sample: &Value, text: &str| {
        let files = json!({ "soil.csv": text });
        ask(
            &mut engine,
            json!({ "ask": "sample", "sample": sample, "files": files }),
        )
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sample.toml");
    std::fs::write(folder.path().join("soil.csv"), TABLE).unwrap();
    let text = toml::to_string(&serde_json::from_value::<toml::Value>(sample.clone()).unwrap());
    std::fs::write(&path, text.unwrap()).unwrap();
    let answer = check(&sample, TABLE);
    let expected = sample::read(&path).unwrap();
    assert_eq!(answer["toml"], expected.to_toml());
    let note = answer["notes"][0].as_str().unwrap();
    assert!(
        note.contains("soil.csv: mass absorption efficiency in m2/g, 3 rows"),
        "{note}"
    );

    for (table, says) in [
        (
            "wavelength_nm,mac_m2_g\n500,0.1\n600,0.1\n",
            "covers 500 to 600 nm",
        ),
        (
            "wavelength_nm,mac_m2_g\n350,0.1\n1300,2000\n",
            "allowed 0 to 1000",
        ),
        ("nm,mac\n350,0.1\n1300,0.1\n", "cannot be used"),
    ] {
        let refused = check(&sample, table);
        assert_eq!(refused["key"], "layer[0].absorber[1].file", "{refused}");
        assert!(
            refused["error"].as_str().unwrap().contains(says),
            "{refused}"
        );
    }
    let mut wrong = sample.clone();
    wrong["layer"][0]["absorber"][1]["file"] = json!("/etc/passwd");
    let refused = check(&wrong, TABLE);
    assert!(
        refused["error"]
            .as_str()
            .unwrap()
            .contains("which is not here"),
        "{refused}"
    );
    wrong["layer"][0]["absorber"][1]["species"] = json!("dust_libya");
    let refused = check(&wrong, TABLE);
    let error = refused["error"].as_str().unwrap();
    assert!(
        error.contains("file") && error.contains("species"),
        "{refused}"
    );
    wrong["layer"][0]["absorber"] = json!(vec![json!({}); 21]);
    assert!(
        check(&wrong, TABLE)["error"]
            .as_str()
            .unwrap()
            .contains("21 absorbers")
    );
}

/// Where `auto` would take many more walks, the page takes those that it was asked for, and its
/// numbers are those of the engine that it names.
#[test]
fn crowded_snow_takes_the_walks_that_were_asked_for() {
    let mut sample = representative();
    sample["layer"][0]["grain"][0]["size_um"] = json!({ "min": 50, "max": 500 });
    sample["layer"][0]["thickness_cm"] = json!(0.5);
    let mut engine = PageEngine::default();
    let request = |ask: &str| json!({ "ask": ask, "sample": sample, "rays": 512, "seed": 1 });
    let answer = ask(&mut engine, request("simulate"));
    assert_eq!(answer["engine"], "tabulated");
    let checked = ask(&mut engine, request("sample"));
    let file = sample::parse("page.toml", checked["toml"].as_str().unwrap()).unwrap();
    let simulation = Simulation::of(&file).rays(512);
    let expected = simulation.engine(Engine::Tabulated).run().unwrap();
    let values: Vec<f64> = expected.reflectance.iter().map(|m| m.value).collect();
    assert_eq!(numbers(&answer["reflectance"]), values);
}

#[test]
fn a_wedge_has_the_spectra_of_its_thicknesses() {
    let mut engine = PageEngine::default();
    let sample = representative();
    let request = json!({ "ask": "wedge", "sample": sample, "rays": 512, "seed": 1,
        "thicknesses_cm": [0.1, 2.0, 5.0, 12.0] });
    let wedge = ask(&mut engine, request);
    // a millimetre holds no grains of up to 750 um
    assert_eq!(numbers(&wedge["thicknesses_cm"]), [2.0, 5.0, 12.0]);
    for (i, cm) in [2.0, 5.0, 12.0].into_iter().enumerate() {
        let mut sample = sample.clone();
        sample["layer"][0]["thickness_cm"] = json!(cm);
        let request = json!({ "ask": "simulate", "sample": sample, "rays": 512, "seed": 1 });
        let spectrum = ask(&mut engine, request);
        assert_eq!(wedge["transmittance"][i], spectrum["transmittance"]);
        assert_eq!(wedge["reflectance"][i], spectrum["reflectance"]);
    }
}

#[test]
fn directions_add_up_to_the_reflectance() {
    let view_deg: Vec<f64> = (0..9).map(|i| 10.0 * f64::from(i)).collect();
    let azimuths: Vec<f64> = (0..13).map(|i| 15.0 * f64::from(i)).collect();
    let request = json!({ "ask": "directions", "sample": representative(), "rays": 4096, "seed": 1,
        "wavelength_nm": 600, "view_deg": view_deg, "relative_azimuth_deg": azimuths });
    let answer = ask(&mut PageEngine::default(), request);
    let brf: Vec<Vec<f64>> = answer["brf"]
        .as_array()
        .unwrap()
        .iter()
        .map(numbers)
        .collect();
    assert_eq!((brf.len(), brf[0].len()), (9, 13));
    // the trapezoidal rule over azimuth and cos^2 of the view, which ends at 80 degrees
    let mean = |row: &Vec<f64>| {
        let sum: f64 = row.windows(2).map(|pair| 0.5 * (pair[0] + pair[1])).sum();
        sum / 12.0
    };
    let power = |degrees: f64| degrees.to_radians().cos().powi(2);
    let ring = |i: usize| {
        0.5 * (mean(&brf[i]) + mean(&brf[i + 1])) * (power(view_deg[i]) - power(view_deg[i + 1]))
    };
    let sum: f64 = (0..8).map(ring).sum::<f64>() + mean(&brf[8]) * power(80.0);
    let reflectance = answer["reflectance"].as_f64().unwrap();
    // measured .0006, .0006 and .0002 with three seeds; five times the largest
    assert!(
        (sum / reflectance - 1.0).abs() < 0.003,
        "{sum} {reflectance}"
    );
}

#[test]
fn colours_are_those_of_the_library() {
    let wavelengths_nm: Vec<f64> = (0..31).map(|i| 400.0 + 10.0 * f64::from(i)).collect();
    let blue: Vec<f64> = wavelengths_nm
        .iter()
        .map(|nm| if *nm < 480.0 { 1.0 } else { 0.0 })
        .collect();
    let request = json!({ "ask": "colour", "wavelengths_nm": wavelengths_nm,
        "spectra": [vec![1.0; 31], vec![0.5; 31], blue], "light": "A" });
    let answer = ask(&mut PageEngine::default(), request.clone());
    assert_eq!(
        answer["srgb"][0],
        json!([255, 255, 255]),
        "white under any light"
    );
    assert_eq!(answer["clipped"], json!([false, false, true]));
    let half = numbers(&answer["lab"][1]);
    assert!((half[0] - 76.07).abs() < 0.01, "{half:?}");
    // a light from its table
    let mut table = request.clone();
    table["light"] = json!({ "name": "flat", "wavelengths_nm": [360, 830], "power": [2, 2] });
    let mut equal = request;
    equal["light"] = json!("E");
    let mut engine = PageEngine::default();
    let (table, equal) = (ask(&mut engine, table), ask(&mut engine, equal));
    for (a, b) in numbers(&table["lab"][2])
        .into_iter()
        .zip(numbers(&equal["lab"][2]))
    {
        assert!((a - b).abs() < 1e-9, "{table}");
    }
    let read = json!({ "ask": "light", "name": "lamp.csv", "text": "wavelength_nm,power\n360,1\n600,2\n830,3\n" });
    let read = ask(&mut engine, read);
    assert_eq!(read["light"]["name"], "lamp.csv", "{read}");
}

#[test]
fn a_measured_file_is_compared_by_its_quantity() {
    let request = |text: &str| {
        json!({ "ask": "measured", "name": "mine.csv", "text": text,
            "wavelengths_nm": [500, 600, 700],
            "reflectance": [0.9, 0.9, 0.8], "reflectance_se": [0.0, 0.0, 0.0],
            "transmittance": [0.1, 0.1, 0.1], "transmittance_se": [0.0, 0.0, 0.0] })
    };
    let mut engine = PageEngine::default();
    let text = "Wavelength (nm);Reflectance (%)\n490;88\n510;90\n590;90\n610;90\n690;90\n710;80\n";
    let answer = ask(&mut engine, request(text));
    assert_eq!(answer["quantity"], "reflectance", "{answer}");
    let residual = |i: usize| answer["residuals"][i]["residual"].as_f64().unwrap();
    let expected = [0.9 - 0.89, 0.0, 0.8 - 0.85];
    for (i, expected) in expected.into_iter().enumerate() {
        assert!((residual(i) - expected).abs() < 1e-12, "{answer}");
    }
    assert_eq!(answer["bands"][0]["name"], "visible");
    let through = ask(
        &mut engine,
        request("wavelength_nm,transmittance\n490,.1\n510,.1\n690,.1\n710,.1\n"),
    );
    assert_eq!(through["quantity"], "transmittance", "{through}");
    assert_eq!(through["overall"]["points"], 2);
    let refused = ask(&mut engine, request("\u{0}\u{1}not a table"));
    assert!(
        refused["error"].as_str().unwrap().contains("mine.csv"),
        "{refused}"
    );
}

#[test]
fn a_compact_file_answers_as_the_library_does() {
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/examples/mitsuba/snow.safetensors"
    );
    let bytes = std::fs::read(path).unwrap();
    let mut engine = PageEngine::default();
    let (file, _) = ask_with(
        &mut engine,
        &json!({ "ask": "open", "name": "snow" }),
        &bytes,
    );
    let point = json!({ "facetness": 0.3, "grain_size_um": 300, "density_kg_m3": 275,
        "thickness_cm": 9, "incidence_angle_deg": 20 });
    let found = ask(
        &mut engine,
        json!({ "ask": "lookup", "id": file["id"], "point": point }),
    );
    let database = splitsnow::Database::from_bytes(&bytes).unwrap();
    use splitsnow::{Lookup, Parameter, Point, Quantity};
    let lookup = Lookup::new(&database, Quantity::Transmittance).unwrap();
    let mut expected = vec![0.0_f32; lookup.wavelengths()];
    let at = Point::from([
        (Parameter::Facetness, 0.3),
        (Parameter::GrainSize, 300.0),
        (Parameter::Density, 275.0),
        (Parameter::Thickness, 9.0),
        (Parameter::Incidence, 20.0),
    ]);
    lookup.spectrum(at, &mut expected).unwrap();
    let answered: Vec<f32> = numbers(&found["transmittance"])
        .iter()
        .map(|v| *v as f32)
        .collect();
    assert_eq!(answered, expected);
    // "simulate here": the sample of the point has about the spectrum of the file
    let request = json!({ "ask": "simulate", "sample": found["sample"], "rays": 16384, "seed": 1 });
    let simulated = ask(&mut engine, request);
    for (a, b) in numbers(&simulated["reflectance"])
        .into_iter()
        .zip(numbers(&found["reflectance"]))
    {
        // the certificate's largest RMSE of R is .0033
        assert!((a - b).abs() < 0.01, "{a} {b}");
    }
    for hostile in [&b""[..], &[255; 64], &bytes[..bytes.len() / 2]] {
        let (refused, _) = ask_with(
            &mut engine,
            &json!({ "ask": "open", "name": "bad" }),
            hostile,
        );
        assert!(
            refused["error"].as_str().unwrap().starts_with("bad: "),
            "{refused}"
        );
    }
    // the file is still open
    let again = ask(
        &mut engine,
        json!({ "ask": "lookup", "id": file["id"], "point": point }),
    );
    assert_eq!(again, found);
}

#[test]
fn refusals_name_the_key() {
    let mut engine = PageEngine::default();
    let changes = [
        (
            "/layer/0/density_kg_m3",
            json!(900),
            "layer[0].density_kg_m3",
        ),
        (
            "/layer/0/thickness_cm",
            json!(0.01),
            "layer[0].thickness_cm",
        ),
        (
            "/illumination/incidence_angle_deg",
            json!(95),
            "illumination.incidence_angle_deg",
        ),
    ];
    for (pointer, value, key) in changes {
        let mut sample = representative();
        *sample.pointer_mut(pointer).unwrap() = value;
        let refused = ask(&mut engine, json!({ "ask": "sample", "sample": sample }));
        assert_eq!(refused["key"], key, "{refused}");
        let error = refused["error"].as_str().unwrap();
        assert!(error.starts_with(&format!("`{key}` = ")), "{error}");
    }
    let mut sample = representative();
    sample["substrate"] = json!({ "reflectance": "/etc/passwd" });
    let refused = ask(&mut engine, json!({ "ask": "sample", "sample": sample }));
    assert_eq!(refused["key"], "substrate.reflectance");
    let mut sample = representative();
    sample["model"] = json!({ "water": "/etc/shadow.csv" });
    let refused = ask(&mut engine, json!({ "ask": "sample", "sample": sample }));
    assert_eq!(refused["key"], "model.water");
    let text = "version = 1\n[illumination]\ndiffuse = tru\n";
    let refused = ask(&mut engine, json!({ "ask": "sample", "sample": text }));
    assert!(
        refused["error"].as_str().unwrap().contains(":3:"),
        "{refused}"
    );
}

#[test]
fn requests_beyond_the_limits_are_refused() {
    let limits = Limits {
        rays: 1000,
        layers: 1,
        wavelengths: 10,
        ..Limits::default()
    };
    let mut engine = PageEngine::new(limits, 1);
    let mut request =
        json!({ "ask": "simulate", "sample": representative(), "rays": 1001, "seed": 1 });
    assert!(
        ask(&mut engine, request.clone())["error"]
            .as_str()
            .unwrap()
            .contains("1001 walks")
    );
    request["rays"] = json!(8);
    request["sample"]["wavelengths"] = json!({ "start_nm": 400, "stop_nm": 700, "step_nm": 1 });
    assert!(
        ask(&mut engine, request.clone())["error"]
            .as_str()
            .unwrap()
            .contains("wavelengths")
    );
    request["sample"]["layer"] = json!([{}, {}]);
    assert!(
        ask(&mut engine, request)["error"]
            .as_str()
            .unwrap()
            .contains("2 layers")
    );
    for hostile in [
        "",
        "[]",
        "{\"ask\":\"walk\"}",
        "{\"ask\":\"lookup\",\"id\":7,\"point\":{}}",
    ] {
        let answer = engine.answer(hostile.as_bytes(), &[]);
        assert!(answer.json.starts_with("{\"error\":"), "{}", answer.json);
    }
}

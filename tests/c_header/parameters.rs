//! The blocks of the C header that are generated from the parameter records.
//! `UPDATE_GOLDEN=1 cargo test --release --test pipeline c_header::parameters` updates them.
use std::fmt::Write;

use splitsnow::parameter::{Parameter, Scale};

/// All parameters in the order of `splitsnow_axis`: core parameters first, then the optional ones,
/// then those of a view. New parameters must not change the numbers of the others.
fn ordered() -> impl Iterator<Item = Parameter> {
    let optional = Parameter::ALL.into_iter().filter(|p| p.is_optional());
    let snow = optional.filter(|p| !p.is_view());
    let core = Parameter::CORE.into_iter();
    core.chain(snow).chain(Parameter::VIEWS)
}

/// The number of an axis in `splitsnow_axis`.
pub(crate) fn number(parameter: Parameter) -> usize {
    ordered().position(|other| other == parameter).unwrap()
}

fn constant(parameter: Parameter) -> String {
    format!("SPLITSNOW_{}", parameter.name().to_uppercase())
}

fn axes() -> String {
    let mut text = String::from("typedef enum splitsnow_axis {\n");
    for (i, parameter) in ordered().enumerate() {
        let record = parameter.record();
        let first = if i == 0 { " = 0" } else { "" };
        let unit = match record.unit {
            "1" => String::new(),
            unit => format!(", {unit}"),
        };
        let _ = writeln!(
            text,
            "    {}{first}, /* {}{unit} */",
            constant(parameter),
            record.long_name
        );
    }
    text + "    SPLITSNOW_AXES /* number of axes */\n} splitsnow_axis;\n"
}

fn parameters() -> String {
    let names: Vec<_> = Parameter::CORE.map(Parameter::name).into();
    let first = ordered().find(|p| p.is_optional()).unwrap();
    let mut text = format!(
        "#define SPLITSNOW__CORE \"{}\"\n#define SPLITSNOW__FIRST_OPTIONAL {}\n#define SPLITSNOW__FIRST_VIEW {}\n\nstatic const splitsnow__parameter splitsnow__parameters[SPLITSNOW_AXES] = {{\n",
        names.join(","),
        constant(first),
        constant(Parameter::VIEWS[0])
    );
    for parameter in ordered() {
        let record = parameter.record();
        let range = record.physical;
        let [min, max] = range.open.map(u8::from);
        let (scale, s, a) = match record.scale {
            Scale::Linear => ("LINEAR", 1.0, 0.0),
            Scale::Log => ("LOG", 1.0, 0.0),
            Scale::Shifted(s) => ("SHIFTED", s, 0.0),
            Scale::Root(s) => ("ROOT", s, 0.0),
            Scale::Complement(s) => ("COMPLEMENT", s, 0.0),
            Scale::Saturating(s) => ("SATURATING", s, 0.0),
            Scale::Grazing([a, s]) => ("GRAZING", s, a),
        };
        let _ = writeln!(
            text,
            "    {{\"{}\", {:?}, {:?}, {min}, {max}, SPLITSNOW__{scale}, {s:?}, {a:?}}},",
            record.name, range.min, range.max
        );
    }
    text + "};\n"
}

#[test]
fn the_generated_blocks_are_current() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/include/splitsnow.h");
    let header = std::fs::read_to_string(path).unwrap();
    let mut expected = header.clone();
    for (mark, text) in [("axes", axes()), ("parameters", parameters())] {
        let [begin, end] = [format!("/* <{mark}> */\n"), format!("/* </{mark}> */\n")];
        let start = expected.find(&begin).unwrap() + begin.len();
        let stop = expected.find(&end).unwrap();
        expected.replace_range(start..stop, &text);
    }
    if std::env::var_os("UPDATE_GOLDEN").is_some() {
        std::fs::write(path, expected).unwrap();
    } else {
        assert!(
            expected == header,
            "include/splitsnow.h is out of date: see the top of this test file"
        );
    }
}

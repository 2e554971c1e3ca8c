//! Writes `stability.csv` and the measured parts of `stability.md`.
use std::error::Error;
use std::fmt::Write;
use std::path::Path;

use super::cases::{Case, z};
use super::judge::Answer;
use super::numerics::Check;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// Writes every value of every engine, with its difference from `spectral`.
pub(crate) fn csv(path: &Path, cases: &[Case], rows: &[(String, Vec<Answer>)]) -> Result<()> {
    let mut out = csv::Writer::from_path(path)?;
    out.write_record([
        "case",
        "engine",
        "verdict",
        "thickness_m",
        "mean_free_distances",
        "wavelength_nm",
        "reflectance",
        "reflectance_se",
        "transmittance",
        "transmittance_se",
        "lost",
        "reflectance_minus_spectral",
        "in_se",
        "transmittance_minus_spectral",
        "in_se_t",
    ])?;
    for (case, (name, answers)) in cases.iter().zip(rows) {
        let Some(spectral) = answers
            .iter()
            .find(|a| a.engine == splitsnow::engine::Engine::Spectral)
        else {
            continue;
        };
        for answer in answers {
            if answer.spectra.is_empty() {
                let row = [name.as_str(), answer.engine.name(), answer.verdict.name()];
                out.write_record(row.into_iter().chain([""; 12]))?;
            }
            for (h, a) in answer.spectra.iter().enumerate() {
                for (l, nm) in case.wavelengths_nm.iter().enumerate() {
                    let (r, t) = (a.reflectance[l], a.transmittance[l]);
                    let thickness_m = case.thicknesses_m[h];
                    let mut row = vec![
                        name.clone(),
                        answer.engine.name().into(),
                        answer.verdict.name().into(),
                    ];
                    let depth = case.depth(thickness_m);
                    row.extend(
                        [
                            thickness_m,
                            depth,
                            *nm,
                            r.value,
                            r.se,
                            t.value,
                            t.se,
                            a.lost[l],
                        ]
                        .map(six),
                    );
                    match spectral.spectra.get(h) {
                        Some(b) => {
                            let (r0, t0) = (b.reflectance[l], b.transmittance[l]);
                            row.extend(
                                [r.value - r0.value, z(r, r0), t.value - t0.value, z(t, t0)]
                                    .map(six),
                            );
                        }
                        None => row.extend(["", "", "", ""].map(String::from)),
                    }
                    out.write_record(&row)?;
                }
            }
        }
    }
    out.flush()?;
    Ok(())
}

fn six(x: f64) -> String {
    if x == 0.0 {
        "0".into()
    } else {
        format!("{x:.5e}")
    }
}

/// A table of verdicts with one row per case and one column per engine, followed by the
/// reasons for all verdicts that have one.
pub(crate) fn map(rows: &[(String, Vec<Answer>)]) -> String {
    let mut out = String::from("| case |");
    let engines = rows.first().map_or(&[][..], |(_, answers)| answers);
    engines
        .iter()
        .for_each(|a| write!(out, " {} |", a.engine.name()).unwrap());
    out += "\n|---|";
    engines.iter().for_each(|_| out += "---|");
    out += "\n";
    for (name, answers) in rows {
        write!(out, "| {name} |").unwrap();
        for answer in answers {
            let number = answer.largest.map_or(String::new(), |d| format!(" {d:.4}"));
            write!(out, " {}{number} |", answer.verdict.name()).unwrap();
        }
        out += "\n";
    }
    out += "\n";
    for (name, answers) in rows {
        for answer in answers.iter().filter(|a| !a.why.is_empty()) {
            writeln!(out, "- {name}, {}: {}.", answer.engine.name(), answer.why).unwrap();
        }
    }
    out
}

/// A table of checks.
pub(crate) fn checks(head: &str, checks: &[Check]) -> String {
    let mut out = format!("| {head} | found | |\n|---|---|---|\n");
    for check in checks {
        let holds = if check.holds { "holds" } else { "**fails**" };
        writeln!(out, "| {} | {} | {holds} |", check.what, check.found).unwrap();
    }
    out
}

/// Replaces the text between the markers `<!-- name -->` and `<!-- end -->` by `text`.
pub(crate) fn replace(page: &str, name: &str, text: &str) -> Result<String> {
    let begin = format!("<!-- {name} -->\n");
    let (head, rest) = page
        .split_once(&begin)
        .ok_or_else(|| format!("no marker {name}"))?;
    let (_, tail) = rest.split_once("<!-- end -->").ok_or("no end marker")?;
    Ok(format!("{head}{begin}{text}<!-- end -->{tail}"))
}

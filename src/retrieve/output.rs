//! A result as text, CSV and JSON.
use std::fmt::{self, Write};

use serde_json::{Value, json};
use splitsnow_retrieval::{CredibleInterval, PosteriorMethod};

use super::report::{Determined, GoodnessOfFit, Pair, Retrieval, RetrievedQuantity};
use super::residuals::FittedSpectrum;
use crate::parameter::Parameter;
use crate::units::HALF_SPACE_CM;

/// Cosine between the derivatives of two unknowns from which they act as one.
const ALIKE: f64 = 0.98;
/// Correlation from which two unknowns are known only together.
const TOGETHER: f64 = 0.95;

/// A number with three digits, at most six characters where possible.
#[must_use]
pub fn short(value: f64) -> String {
    match value.abs() {
        0.0 => "0".to_owned(),
        1e5.. | ..1e-3 => format!("{value:.2e}"),
        100.0.. => format!("{value:.0}"),
        10.0.. => format!("{value:.1}"),
        1.0.. => format!("{value:.2}"),
        _ => format!("{value:.3}"),
    }
}

impl Retrieval {
    /// The estimates of the unknowns.
    #[must_use]
    pub fn unknowns(&self) -> &[RetrievedQuantity] {
        &self.estimates[self.derived..]
    }

    /// The method of the distribution in words.
    #[must_use]
    pub fn method(&self) -> String {
        match self.posterior.method {
            PosteriorMethod::Grid { cells, sides } => {
                let sides = sides.iter().take_while(|side| **side > 0.0);
                let divisions: Vec<_> = sides.map(|side| format!("{:.0}", 1.0 / side)).collect();
                format!(
                    "distribution on a grid: {cells} of {} cells",
                    divisions.join(" x ")
                )
            }
            PosteriorMethod::Sampler {
                walkers,
                steps,
                autocorrelation,
            } => {
                let independent = walkers as f64 * steps as f64 / autocorrelation;
                format!(
                    "distribution by an affine-invariant sampler: {walkers} walkers, {steps} moves, autocorrelation {autocorrelation:.0}, {independent:.0} independent draws{}",
                    if independent >= 400.0 {
                        ""
                    } else {
                        ", which is few: the intervals are rough"
                    }
                )
            }
        }
    }

    /// What the data do not determine, in sentences.
    #[must_use]
    pub fn remarks(&self) -> Vec<String> {
        let mut remarks = Vec::new();
        for Pair {
            names: [a, b],
            correlation,
            cosine,
        } in &self.pairs
        {
            if cosine.abs() >= ALIKE {
                remarks.push(format!(
                    "{a} and {b} change these spectra in the same way (cosine {cosine:.3}): only one combination of them is determined, so read their intervals together, or fix one of them"
                ));
            } else if correlation.abs() >= TOGETHER {
                remarks.push(format!(
                    "{a} and {b} are known only together (correlation {correlation:.3})"
                ));
            }
        }
        for (estimate, u) in self.unknowns().iter().zip(&self.best) {
            if *u <= 0.0 || *u >= 1.0 {
                let end = if *u <= 0.0 { "lower" } else { "upper" };
                remarks.push(format!(
                    "{} is most probable at the {end} end of its range, {}: the snow may lie beyond it",
                    estimate.name,
                    short(estimate.best)
                ));
            }
        }
        if !self.converged {
            remarks
                .push("the search for the optimum did not end; its values are approximate".into());
        }
        remarks
    }

    /// The combinations of unknowns, the best determined first, one line each.
    #[must_use]
    pub fn combinations(&self) -> Vec<String> {
        let names: Vec<&str> = self.unknowns().iter().map(|e| e.name).collect();
        let line = |(value, direction): (&f64, &Vec<f64>)| {
            let mut text = String::new();
            for (weight, name) in direction.iter().zip(&names) {
                if weight.abs() >= 0.05 {
                    let _ = write!(text, " {weight:+.2} {name}");
                }
            }
            let sharper = (1.0 + value).sqrt();
            let verdict = match *value > 1.0 {
                true => format!("{} times narrower than before", short(sharper)),
                false => "not determined".to_owned(),
            };
            format!("{:>9}  {verdict:<32}{text}", short(*value))
        };
        let pairs = self
            .information
            .values
            .iter()
            .zip(&self.information.directions);
        pairs.map(line).collect()
    }

    /// The estimates as CSV.
    #[must_use]
    pub fn to_csv(&self) -> String {
        let mut out =
            String::from("name,unit,best,mean,sd,low_95,low_68,median,high_68,high_95,from_data\n");
        for estimate in &self.estimates {
            let RetrievedQuantity {
                name,
                unit,
                best,
                mean,
                sd,
                interval,
                from_data,
                ..
            } = estimate;
            let CredibleInterval { median, p68, p95 } = interval;
            let _ = writeln!(
                out,
                "{name},{unit},{best},{mean},{sd},{},{},{median},{},{},{from_data}",
                p95[0], p68[0], p68[1], p95[1]
            );
        }
        out
    }

    /// Everything as JSON.
    #[must_use]
    pub fn to_json(&self) -> Value {
        let estimate = |e: &RetrievedQuantity| {
            json!({
                "name": e.name, "unit": e.unit, "best": e.best, "mean": e.mean, "sd": e.sd,
                "median": e.interval.median, "p68": e.interval.p68, "p95": e.interval.p95,
                "range": e.range, "from_data": e.from_data,
                "determined": e.determined().name(),
            })
        };
        let spectrum = |s: &FittedSpectrum| {
            let list = |part: fn(&super::FittedValue) -> f64| -> Vec<f64> {
                s.values.iter().map(part).collect()
            };
            let band = |b: &super::BandResiduals| {
                json!({
                    "name": b.band.name(), "values": b.values, "bias": b.bias, "rmse": b.rmse,
                    "rms_in_sigma": b.in_sigma,
                })
            };
            json!({
                "name": s.name, "quantity": s.quantity.name(), "known": s.known,
                "wavelength_nm": list(|v| v.nm), "measured": list(|v| v.measured),
                "fitted": list(|v| v.fitted), "fitted_sd": list(|v| v.fitted_sd),
                "sigma": list(|v| v.sigma), "residual_in_sigma": list(super::FittedValue::residual),
                "bands": s.bands().iter().map(band).collect::<Value>(),
            })
        };
        let pair = |p: &Pair| json!({ "names": p.names, "correlation": p.correlation, "cosine": p.cosine });
        let known: serde_json::Map<String, Value> = self
            .known
            .iter()
            .map(|(name, value)| ((*name).to_owned(), json!(value)))
            .collect();
        let unknowns: Vec<&str> = self.unknowns().iter().map(|e| e.name).collect();
        json!({
            "estimates": self.estimates.iter().map(estimate).collect::<Value>(),
            "known": known,
            "unknowns": unknowns,
            "covariance": self.covariance,
            "pairs": self.pairs.iter().map(pair).collect::<Value>(),
            "information": {
                "values": self.information.values,
                "directions": self.information.directions,
                "determined": self.information.determined(),
            },
            "chi_square": self.goodness.chi_square,
            "values": self.goodness.values,
            "degrees_of_freedom": self.goodness.degrees_of_freedom,
            "probability": self.goodness.probability,
            "verdict": self.goodness.verdict(),
            "remarks": self.remarks(),
            "method": self.method(),
            "errors": self.errors,
            "converged": self.converged,
            "exact": self.exact.as_ref().map(|e| json!({
                "rounds": e.rounds, "rays": e.rays, "largest_in_sigma": e.largest_sigma,
                "rms_in_sigma": e.rms_sigma, "moved_sd": e.moved_sd, "settled": e.settled,
            })),
            "spectra": self.spectra.iter().map(spectrum).collect::<Value>(),
        })
    }
}

/// The result for people.
impl fmt::Display for Retrieval {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let dash = |estimate: &RetrievedQuantity, value: f64| match estimate.determined() {
            Determined::No => "-".to_owned(),
            _ => short(value),
        };
        writeln!(
            f,
            "{:<22}{:>8}{:>9}  {:<17}{:<17}from the data",
            "", "best", "median", "68 %", "95 %"
        )?;
        for estimate in &self.estimates {
            let CredibleInterval { median, p68, p95 } = estimate.interval;
            let range = |[low, high]: [f64; 2]| format!("{} to {}", short(low), short(high));
            writeln!(
                f,
                "{:<22}{:>8}{:>9}  {:<17}{:<17}{}",
                estimate.name,
                dash(estimate, estimate.best),
                dash(estimate, median),
                range(p68),
                range(p95),
                estimate.determined().name()
            )?;
        }
        if !self.known.is_empty() {
            let known = self.known.iter().map(|(name, value)| match *value {
                HALF_SPACE_CM.. if *name == Parameter::Thickness.key() => format!("{name} = inf"),
                value => format!("{name} = {}", value as f32),
            });
            writeln!(f, "known: {}", known.collect::<Vec<_>>().join(", "))?;
        }
        for remark in self.remarks() {
            writeln!(f, "note: {remark}")?;
        }
        writeln!(
            f,
            "\nThe data determine {} of {} combinations of the unknowns. Information (above 1: determined), and weights in units of what was known before:",
            self.information.determined(),
            self.information.values.len()
        )?;
        for line in self.combinations() {
            writeln!(f, "{line}")?;
        }
        let GoodnessOfFit {
            chi_square,
            degrees_of_freedom,
            probability,
            ..
        } = self.goodness;
        writeln!(
            f,
            "\nchi-square {chi_square:.1} for {degrees_of_freedom:.1} degrees of freedom (probability {probability:.3}): {}",
            self.goodness.verdict()
        )?;
        for spectrum in &self.spectra {
            let (name, quantity) = (&spectrum.name, spectrum.quantity.name());
            let known = match spectrum.known.as_str() {
                "" => String::new(),
                known => format!(" ({known})"),
            };
            writeln!(f, "{quantity}, {name}{known}; fitted - measured:")?;
            for band in spectrum.bands() {
                writeln!(
                    f,
                    "  {:<8} {:>4} values, mean {:+.4}, rms {:.4}, {:.2} of the stated errors",
                    band.band.name(),
                    band.values,
                    band.bias,
                    band.rmse,
                    band.in_sigma
                )?;
            }
        }
        for line in &self.errors {
            writeln!(f, "errors, {line}")?;
        }
        if let Some(exact) = &self.exact {
            writeln!(
                f,
                "engine at the optimum: {:.2} of the stated errors from the look-up at most, {:.2} rms; {} simulations moved the optimum by {:.2} standard deviations{}",
                exact.largest_sigma,
                exact.rms_sigma,
                exact.rounds,
                exact.moved_sd,
                if exact.settled {
                    ""
                } else {
                    "; it still moves"
                }
            )?;
        }
        writeln!(f, "{}", self.method())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        assert_eq!(
            [0.0, 0.31234, 2.345, 26.14, 312.4, 2e6, 1e-5].map(short),
            ["0", "0.312", "2.35", "26.1", "312", "2.00e6", "1.00e-5"]
        );
    }
}

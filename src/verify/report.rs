//! The results of a verification, as text and as JSON.
use std::fmt;

use serde::Serialize;
use serde::ser::SerializeStruct;

use crate::measurement::Quantity;

/// A value that a check measured, with the bound that it must stay below.
#[derive(Debug, Clone, PartialEq)]
pub struct CheckedValue {
    /// The quantity that was checked.
    pub quantity: Quantity,
    /// Name of the measure, such as `RMSE max`.
    pub measure: &'static str,
    /// The measured value.
    pub value: f64,
    /// The value must be below this bound; `None` for no bound.
    pub bound: Option<f64>,
    /// The point of the grid with this value; empty for a mean.
    pub at: String,
}

impl CheckedValue {
    /// Whether the value is below its bound, or has no bound.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.bound.is_none_or(|bound| self.value < bound)
    }
}

/// One of the checks.
#[derive(Debug, Clone, PartialEq)]
pub struct Check {
    /// Name of the check.
    pub name: &'static str,
    /// Notes on the method and the number of samples.
    pub notes: Vec<String>,
    /// The measured values.
    pub figures: Vec<CheckedValue>,
    /// Problems other than bounds that do not hold.
    pub problems: Vec<String>,
}

impl Check {
    pub(super) fn new(name: &'static str) -> Self {
        Self {
            name,
            notes: Vec::new(),
            figures: Vec::new(),
            problems: Vec::new(),
        }
    }

    /// Whether there is no problem and every bound holds.
    #[must_use]
    pub fn passed(&self) -> bool {
        self.problems.is_empty() && self.figures.iter().all(CheckedValue::holds)
    }
}

/// The results of all checks.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct VerifyReport {
    /// The checks in the order in which they ran, without those that depend on a failed
    /// check.
    pub checks: Vec<Check>,
    /// Checks that the time limit did not allow.
    pub not_checked: Vec<String>,
}

impl VerifyReport {
    /// Whether every check passed.
    #[must_use]
    pub fn passed(&self) -> bool {
        self.checks.iter().all(Check::passed)
    }

    /// Names of the checks that failed.
    #[must_use]
    pub fn failed(&self) -> Vec<&'static str> {
        let failed = self.checks.iter().filter(|check| !check.passed());
        failed.map(|check| check.name).collect()
    }
}

/// `value` with four digits, as a decimal if that is short.
fn short(value: f64) -> String {
    if value == 0.0 || (1e-3..1e4).contains(&value.abs()) {
        format!("{value:.4}")
    } else {
        format!("{value:.3e}")
    }
}

/// The verdict as printed.
fn verdict(passed: bool) -> &'static str {
    if passed { "PASS" } else { "FAIL" }
}

impl fmt::Display for VerifyReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for check in &self.checks {
            writeln!(f, "{}  {}", verdict(check.passed()), check.name)?;
            for note in &check.notes {
                writeln!(f, "      {note}")?;
            }
            for figure in &check.figures {
                writeln!(f, "      {figure}")?;
            }
            for problem in &check.problems {
                writeln!(f, "      problem: {problem}")?;
            }
        }
        if self.not_checked.is_empty() {
            return write!(f, "{}", verdict(self.passed()));
        }
        write!(
            f,
            "{}  of what was checked; not checked, because the CPU time of --seconds ran out:",
            verdict(self.passed())
        )?;
        for skipped in &self.not_checked {
            write!(f, "\n      {skipped}")?;
        }
        Ok(())
    }
}

impl fmt::Display for CheckedValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (quantity, measure) = (self.quantity.name(), self.measure);
        write!(f, "{quantity:<13}  {measure:<24}  {:>9}", short(self.value))?;
        if let Some(bound) = self.bound {
            let relation = if self.holds() { "<" } else { "is not below" };
            write!(f, " {relation} {}", short(bound))?;
        }
        if !self.at.is_empty() {
            write!(f, "  at {}", self.at)?;
        }
        Ok(())
    }
}

impl Serialize for CheckedValue {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut out = serializer.serialize_struct("Figure", 6)?;
        out.serialize_field("quantity", self.quantity.name())?;
        out.serialize_field("measure", self.measure)?;
        out.serialize_field("value", &self.value)?;
        out.serialize_field("bound", &self.bound)?;
        out.serialize_field("holds", &self.holds())?;
        out.serialize_field("at", &self.at)?;
        out.end()
    }
}

impl Serialize for Check {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut out = serializer.serialize_struct("Check", 5)?;
        out.serialize_field("name", self.name)?;
        out.serialize_field("passed", &self.passed())?;
        out.serialize_field("notes", &self.notes)?;
        out.serialize_field("figures", &self.figures)?;
        out.serialize_field("problems", &self.problems)?;
        out.end()
    }
}

//! What a verification found, for people and as JSON.
use std::fmt;

use serde::Serialize;
use serde::ser::SerializeStruct;

use crate::measurement::Quantity;

/// One number a check came to, and the bound it must stay below.
#[derive(Debug, Clone, PartialEq)]
pub struct Figure {
    /// Of which quantity.
    pub quantity: Quantity,
    /// What was measured.
    pub measure: &'static str,
    /// The number.
    pub value: f64,
    /// It must be below this.
    pub bound: Option<f64>,
    /// The point of the grid it is from; empty for a mean.
    pub at: String,
}

impl Figure {
    /// Whether it stays below its bound; without one, always.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.bound.is_none_or(|bound| self.value < bound)
    }
}

/// One of the checks.
#[derive(Debug, Clone, PartialEq)]
pub struct Check {
    /// What was checked.
    pub name: &'static str,
    /// How, and on how much.
    pub notes: Vec<String>,
    /// What was measured.
    pub figures: Vec<Figure>,
    /// What is wrong, apart from bounds that are broken.
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

    /// Whether nothing is wrong.
    #[must_use]
    pub fn passed(&self) -> bool {
        self.problems.is_empty() && self.figures.iter().all(Figure::holds)
    }
}

/// All checks that were done.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    /// In the order in which they were done; what depends on a check that
    /// failed is left out.
    pub checks: Vec<Check>,
    /// What there was no time for.
    pub not_checked: Vec<String>,
}

impl Report {
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

/// Four digits, as a decimal where that is short.
fn short(value: f64) -> String {
    if value == 0.0 || (1e-3..1e4).contains(&value.abs()) {
        format!("{value:.4}")
    } else {
        format!("{value:.3e}")
    }
}

fn verdict(passed: bool) -> &'static str {
    if passed { "PASS" } else { "FAIL" }
}

impl fmt::Display for Report {
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
            "{}  of what was checked; not checked, for the budget of --seconds is spent:",
            verdict(self.passed())
        )?;
        for left in &self.not_checked {
            write!(f, "\n      {left}")?;
        }
        Ok(())
    }
}

impl fmt::Display for Figure {
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

impl Serialize for Figure {
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

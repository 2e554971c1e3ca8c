//! Makes docs/quoted.csv: the numbers that the documentation quotes and that no other
//! program computes.
//!
//!     cargo run --release --example quoted -- out/quoted docs/quoted.csv
//!
//! writes the file from the files below `out/quoted` (made by `just quoted`) and from some
//! minutes of simulations. With `check` as a third argument, nothing is written. Instead,
//! simulations with other random numbers must agree with the file within the standard
//! errors, and numbers without a standard error must be unchanged.
#![allow(
    dead_code,
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::print_stderr
)]
#[path = "../stability/cases.rs"]
mod cases;
mod exact;
mod files;
mod measured;
mod row;

use std::error::Error;
use std::path::Path;

use row::{Quoted, read};

/// Largest difference of two runs, in joint standard errors. Among a few hundred numbers,
/// it is exceeded by chance in less than one run in a thousand.
const Z: f64 = 5.0;
/// Seeds of the file and of the check.
const SEEDS: [u64; 2] = [1, 2];

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let (files_dir, file, check) = match &args[..] {
        [files_dir, file] => (files_dir, file, false),
        [files_dir, file, word] if word == "check" => (files_dir, file, true),
        _ => {
            return Err(
                "give the directory made by `just quoted`, docs/quoted.csv and optionally `check`"
                    .into(),
            );
        }
    };
    let mut rows = exact::exact();
    rows.extend(files::files(Path::new(files_dir))?);
    rows.extend(measured::measured(SEEDS[usize::from(check)]));
    if check {
        return compare(&read(Path::new(file))?, &rows);
    }
    let mut out = csv::Writer::from_path(file)?;
    out.write_record(["name", "value", "standard_error", "setting"])?;
    for row in &rows {
        let [value, se] = [row.value, row.standard_error].map(|x| format!("{x:.6e}"));
        out.write_record([&row.name, &value, &se, &row.setting])?;
    }
    Ok(out.flush()?)
}

/// Prints the differences between the file and a new run.
///
/// # Errors
/// If any number differs.
fn compare(file: &[Quoted], new: &[Quoted]) -> Result<(), Box<dyn Error>> {
    let key = |row: &Quoted| (row.name.clone(), row.setting.clone());
    if file.len() != new.len() {
        return Err(format!("{} numbers instead of {}", new.len(), file.len()).into());
    }
    let mut differing = 0;
    for (a, b) in file.iter().zip(new) {
        let joint = a.standard_error.hypot(b.standard_error);
        let allowed = Z * joint + 1e-5 * a.value.abs();
        // the setting of the largest of several values may differ between runs
        let is_same_row = a.name == b.name && (key(a) == key(b) || joint > 0.0);
        let difference = (a.value - b.value).abs();
        if !is_same_row || difference > allowed {
            differing += 1;
            println!(
                "{}, {}: {} in the file, {} now; allowed difference {allowed:.1e}",
                a.name, a.setting, a.value, b.value
            );
        }
    }
    println!("{} numbers compared, {differing} differ", new.len());
    if differing > 0 {
        Err("some numbers differ: make docs/quoted.csv anew (just quoted)".into())
    } else {
        Ok(())
    }
}

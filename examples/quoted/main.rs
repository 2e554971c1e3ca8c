//! Numbers that pages quote and that no other program makes: docs/quoted.csv.
//!
//!     cargo run --release --example quoted -- out/quoted docs/quoted.csv
//!
//! makes it, from the files below `out/quoted` (`just quoted` makes these, too) and from
//! some minutes of simulations. With `check` behind it nothing is written: other random
//! numbers must give the same within the standard errors, and files and what has no
//! standard error must be as they were.
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

/// How many joint standard errors two runs may differ: a few hundred numbers stray no
/// further but for one run in a thousand.
const Z: f64 = 5.0;
/// Seeds of the file and of what is held against it.
const SEEDS: [u64; 2] = [1, 2];

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let (files_dir, file, check) = match &args[..] {
        [files_dir, file] => (files_dir, file, false),
        [files_dir, file, word] if word == "check" => (files_dir, file, true),
        _ => return Err("give a directory that `just quoted` made, and docs/quoted.csv".into()),
    };
    let mut all = exact::exact();
    all.extend(files::files(Path::new(files_dir))?);
    all.extend(measured::measured(SEEDS[usize::from(check)]));
    if check {
        return compare(&read(Path::new(file))?, &all);
    }
    let mut out = csv::Writer::from_path(file)?;
    out.write_record(["name", "value", "standard_error", "setting"])?;
    for one in &all {
        let [value, se] = [one.value, one.standard_error].map(|x| format!("{x:.6e}"));
        out.write_record([&one.name, &value, &se, &one.setting])?;
    }
    Ok(out.flush()?)
}

/// Whether two runs say the same.
fn compare(before: &[Quoted], now: &[Quoted]) -> Result<(), Box<dyn Error>> {
    let key = |one: &Quoted| (one.name.clone(), one.setting.clone());
    if before.len() != now.len() {
        return Err(format!("{} numbers instead of {}", now.len(), before.len()).into());
    }
    let mut wrong = 0;
    for (a, b) in before.iter().zip(now) {
        let joint = a.standard_error.hypot(b.standard_error);
        let most = Z * joint + 1e-5 * a.value.abs();
        // where the largest of several was at another place, only that is compared
        let same = a.name == b.name && (key(a) == key(b) || joint > 0.0);
        let off = (a.value - b.value).abs();
        if !same || off > most {
            wrong += 1;
            println!(
                "{}, {}: {} now {}, {most:.1e} apart at most",
                a.name, a.setting, a.value, b.value
            );
        }
    }
    println!("{} numbers compared, {wrong} differ", now.len());
    if wrong > 0 {
        Err("make docs/quoted.csv anew (just quoted)".into())
    } else {
        Ok(())
    }
}

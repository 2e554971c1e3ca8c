//! Any bytes: a measured spectrum is refused with a message, or read with values
//! that are finite wherever it has some.
#![no_main]
use libfuzzer_sys::fuzz_target;
use splitsnow::comparison::{Exclusion, MeasuredSpectrum};
use splitsnow::measurement::Quantity;

fuzz_target!(|bytes: &[u8]| {
    let quantity = Some(Quantity::Reflectance);
    match MeasuredSpectrum::parse("fuzz.csv", bytes, quantity, &Exclusion::FIELD) {
        Ok(spectrum) => {
            let wavelengths: Vec<f64> = (70..=500).map(|i| 5.0 * f64::from(i)).collect();
            for matched in spectrum.at(&wavelengths).unwrap_or_default() {
                assert!(matched.value.is_finite());
            }
        }
        Err(error) => assert!(!error.to_string().is_empty()),
    }
});

//! Any bytes: the compact file's reader returns an error, or a database of
//! which every look-up on a node answers with finite numbers.
#![no_main]
use libfuzzer_sys::fuzz_target;
use splitsnow::lookup::Database;
use splitsnow::measurement::Quantity;

fuzz_target!(|bytes: &[u8]| {
    let Ok(database) = Database::from_bytes(bytes) else {
        return;
    };
    for row in [0, database.curves() / 2, database.curves() - 1] {
        let point = database.point(row).expect("a row of the database");
        for quantity in Quantity::ALL.into_iter().filter(|&q| database.has(q)) {
            let spectrum = database.spectrum(point, quantity).expect("a node");
            assert_eq!(spectrum.len(), database.wavelengths_nm().len());
            assert!(spectrum.iter().all(|value| value.is_finite()));
        }
    }
});

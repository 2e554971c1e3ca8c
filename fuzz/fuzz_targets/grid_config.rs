//! Any text: a grid file is refused with a message, or read and, written
//! canonically, read again as the same.
#![no_main]
use libfuzzer_sys::fuzz_target;
use splitsnow::config::grid;

fuzz_target!(|text: &str| match grid::parse("configs/fuzz.toml", text) {
    Ok(file) => {
        let again = grid::parse("configs/fuzz.toml", &file.to_toml()).expect("canonical");
        assert_eq!(again.to_toml(), file.to_toml());
        assert_eq!(again.grid, file.grid);
    }
    Err(error) => assert!(!error.to_string().is_empty()),
});

//! For any text, a grid file is refused with a message, or its canonical form reads back as
//! the same grid.
#![no_main]
use libfuzzer_sys::fuzz_target;
use splitsnow::config::grid;

fuzz_target!(|text: &str| match grid::parse("configs/fuzz.toml", text) {
    Ok(file) => {
        let text = file.grid.to_config();
        let mut again = grid::parse("configs/fuzz.toml", &text)
            .expect("canonical")
            .grid;
        assert_eq!(again.to_config(), text);
        again.compression = file.grid.compression;
        // The path of a user's water table loses its folder.
        again.fixed.model.water = file.grid.fixed.model.water.clone();
        assert_eq!(again, file.grid);
    }
    Err(error) => assert!(!error.to_string().is_empty()),
});

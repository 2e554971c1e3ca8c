//! For any text, a scene file is refused with a message, or read with ranges whose ends are
//! in order.
#![no_main]
use libfuzzer_sys::fuzz_target;
use splitsnow::config::scene;

fuzz_target!(
    |text: &str| match scene::parse("configs/scenes/fuzz.toml", text) {
        Ok(file) => {
            let scene = file.scene;
            assert!(!scene.regions.is_empty() && !scene.quantities.is_empty());
            for region in scene.regions {
                assert!(region.iter().all(|(_, [min, max])| min <= max));
            }
        }
        Err(error) => assert!(!error.to_string().is_empty()),
    }
);

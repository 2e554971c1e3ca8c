//! Any text: a scene file is refused with a message, or read with ranges whose
//! ends are in order.
#![no_main]
use libfuzzer_sys::fuzz_target;
use splitsnow::config::scene;

fuzz_target!(
    |text: &str| match scene::parse("configs/scenes/fuzz.toml", text) {
        Ok(file) => {
            let scene = file.scene;
            assert!(scene.thickness_cm.min <= scene.thickness_cm.max);
            assert!(scene.angle_deg.min <= scene.angle_deg.max);
            assert!(!scene.snow.is_empty() && !scene.quantities.is_empty());
        }
        Err(error) => assert!(!error.to_string().is_empty()),
    }
);

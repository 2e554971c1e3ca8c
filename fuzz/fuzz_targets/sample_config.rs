//! For any text, a sample file is refused with a message, or its canonical form reads back
//! as the same sample.
#![no_main]
use libfuzzer_sys::fuzz_target;
use splitsnow::config::sample;

fuzz_target!(
    |text: &str| match sample::parse("configs/samples/fuzz.toml", text) {
        Ok(file) => {
            let again =
                sample::parse("configs/samples/fuzz.toml", file.to_toml()).expect("canonical");
            assert_eq!(again.to_toml(), file.to_toml());
            assert_eq!(again.snowpack, file.snowpack);
        }
        Err(error) => assert!(!error.to_string().is_empty()),
    }
);

//! For any bytes, a measured spectrum is refused with a message, or read with possible
//! values at increasing wavelengths. The same for responses of a sensor.
#![no_main]
use libfuzzer_sys::fuzz_target;
use splitsnow::comparison::{Exclusion, Hints, MeasuredSpectrum, VALUES};
use splitsnow::sensor::Sensor;
use splitsnow::spectrum::measured::{Content, ReadOptions, parse};

fuzz_target!(|bytes: &[u8]| {
    match MeasuredSpectrum::parse("fuzz.csv", bytes, &Hints::default(), &Exclusion::FIELD) {
        Ok(spectrum) => {
            assert!(!spectrum.report().to_string().contains('\n'));
            let wavelengths: Vec<f64> = (70..=500).map(|i| 5.0 * f64::from(i)).collect();
            for matched in spectrum.at(&wavelengths).unwrap_or_default() {
                assert!(matched.value.is_finite());
                let possible = (VALUES.0..=VALUES.1).contains(&matched.value);
                assert!(possible || matched.excluded);
            }
        }
        Err(error) => assert!(!error.to_string().is_empty()),
    }
    let request = ReadOptions::new(Some(Content::Power), (0.0, f64::MAX));
    if let Ok(curve) = parse("fuzz.csv", bytes, &request) {
        let mut pairs = curve.samples.windows(2);
        assert!(pairs.all(|pair| pair[0].nm < pair[1].nm));
        assert!(curve.samples.iter().all(|s| s.nm > 0.0 && s.value >= 0.0));
    }
    if let Ok(sensor) = Sensor::parse("fuzz.csv", bytes) {
        for band in sensor.bands() {
            let (from, to) = band.range_nm();
            assert!(0.0 < from && from < to && to.is_finite());
            assert!((from - 1e-6..=to + 1e-6).contains(&band.centre_nm()));
        }
        assert!(sensor.wavelengths_nm(5.0, (350.0, 2500.0)).len() <= 431);
    }
});

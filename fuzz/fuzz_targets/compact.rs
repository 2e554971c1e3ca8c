//! For any bytes, the reader of compact files returns an error, or a database. Look-ups at
//! its nodes give finite numbers, and interpolated look-ups numbers in [0, 1], unless the
//! table would be too large. Interpolated anisotropy factors are finite numbers.
#![no_main]
use libfuzzer_sys::fuzz_target;
use splitsnow::lookup::{Anisotropy, Database, Lookup, LookupError, Varsa2025};
use splitsnow::measurement::Quantity;
use splitsnow::parameter::{Parameter, Point};

fuzz_target!(|bytes: &[u8]| {
    let Ok(database) = Database::from_bytes(bytes) else {
        return;
    };
    let first = database.point(0).expect("a row of the database");
    let halfway = |(parameter, [low, high]): (_, [f64; 2])| (parameter, 0.5 * (low + high));
    let middle: Point = database.axes().region().iter().map(halfway).collect();
    let rows = [0, database.curves() / 2, database.curves() - 1];
    for quantity in Quantity::ALL.into_iter().filter(|&q| database.has(q)) {
        for row in rows {
            let point = database.point(row).expect("a row of the database");
            let spectrum = database.spectrum(point, quantity).expect("a node");
            assert_eq!(spectrum.len(), database.wavelengths_nm().len());
            assert!(spectrum.iter().all(|value| value.is_finite()));
        }
    }
    let database = match database.at(middle.optional()) {
        Err(LookupError::TooLarge { .. }) => return,
        database => database.expect("between nodes"),
    };
    if database.holds_anisotropy() {
        toward_views(&database, [first, middle]);
        return;
    }
    for quantity in Quantity::ALL.into_iter().filter(|&q| database.has(q)) {
        // its spline is unbounded, and it answers at nodes of the snow only
        let published = Varsa2025::new(&database, quantity).expect("a quantity it has");
        published.spectrum(first).ok();
        published.spectrum(middle).ok();
        let lookup = match Lookup::new(&database, quantity) {
            Err(LookupError::TooLarge { .. }) => continue,
            lookup => lookup.expect("a quantity it has"),
        };
        let mut spectrum = vec![0.0; lookup.wavelengths()];
        for point in [first, middle] {
            // axes may have any numbers; not all are allowed as coordinates
            if lookup.spectrum(point, &mut spectrum).is_ok() {
                let inside = |value: &f32| (0.0..=1.0).contains(value);
                assert!(spectrum.iter().all(inside), "{point}: {spectrum:?}");
            }
        }
    }
});

/// Anisotropy factors at `points`, on both sides of the normal and beyond both ends of the
/// thickness.
fn toward_views(database: &Database, points: [Point; 2]) {
    for quantity in Quantity::ALL.into_iter().filter(|&q| database.has(q)) {
        let anisotropy = Anisotropy::new(database, quantity).expect("a quantity it has");
        let mut spectrum = vec![0.0; anisotropy.wavelengths()];
        for point in points {
            let azimuth = point[Parameter::RelativeAzimuth];
            let others = [
                point,
                point.with(Parameter::RelativeAzimuth, azimuth + 180.0),
                point.with(Parameter::View, 0.5),
                point.with(Parameter::Thickness, 0.0),
                point.with(Parameter::Thickness, 1e9),
            ];
            let material = anisotropy.material(point).expect("a snow within the axes");
            for point in others {
                for prepared in [&anisotropy, &material] {
                    // a curve may be absent
                    if prepared.spectrum(point, &mut spectrum).is_ok() {
                        let finite = spectrum.iter().all(|value| value.is_finite());
                        assert!(finite, "{point}: {spectrum:?}");
                    }
                }
            }
        }
    }
}

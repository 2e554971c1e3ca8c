//! The solver compared with itself.
use splitsnow::slab::{Light, Matrix, Medium, Streams};

use super::{
    PAGE, assert_rounding_says, collimated, entries, henyey_greenstein, largest_difference, stacked,
};
use crate::quoted::assert_says;

/// Columns of R + T sum to 1 within rounding, which increases with 1/mu of the most oblique
/// stream.
#[test]
fn energy_is_conserved() {
    let mut error_of_8_streams = 0.0_f64;
    for (n, tolerance) in [
        (2, 1e-14),
        (8, 2e-14),
        (12, 4e-14),
        (16, 1e-13),
        (32, 1e-12),
        (64, 1e-10),
    ] {
        let streams = Streams::new(n).unwrap();
        for g in [0.0, 0.5, 0.89, 0.99, 0.9999] {
            let chi = henyey_greenstein(1.0, g, 2 * n + 1);
            let medium = Medium::delta_m(&streams, &chi).unwrap();
            for thickness in [
                0.0,
                1e-12,
                1e-3,
                0.1,
                1.0,
                10.0,
                1e3,
                1e5,
                1e8,
                f64::INFINITY,
            ] {
                let operators = medium.operators(thickness).unwrap();
                let sum = &operators.reflection + &operators.transmission;
                for j in 0..n {
                    let total: f64 = (0..n).map(|i| sum[(i, j)]).sum();
                    if n == 8 {
                        error_of_8_streams = error_of_8_streams.max((total - 1.0).abs());
                    }
                    assert!(
                        (total - 1.0).abs() < tolerance,
                        "{n} {g} {thickness} {j}: {total}"
                    );
                }
                for cosine in [1e-3, 0.3, 1.0] {
                    let fluxes = medium.fluxes(thickness, collimated(cosine)).unwrap();
                    let total = fluxes.reflectance + fluxes.transmittance;
                    assert!(
                        (total - 1.0).abs() < tolerance.max(1e-12),
                        "{n} {g} {thickness} {cosine}: {total}"
                    );
                }
            }
        }
    }
    assert_rounding_says("energy of the solver", [error_of_8_streams]);
}

#[test]
fn a_slab_of_zero_thickness_changes_nothing() {
    let streams = Streams::new(8).unwrap();
    let medium = Medium::new(&streams, &henyey_greenstein(0.9, 0.7, 16)).unwrap();
    let none = medium.operators(0.0).unwrap();
    assert_eq!(none.transmission, Matrix::identity(8));
    assert_eq!(none.reflection, Matrix::zeros(8, 8));
    let thin = medium.operators(1e-12).unwrap();
    let slant_thickness = 1e-12 / streams.cosines()[0];
    assert!(largest_difference(&thin.transmission, &none.transmission) < slant_thickness);
    assert!(largest_difference(&thin.reflection, &none.reflection) < slant_thickness);
}

#[test]
fn stacked_slabs_equal_a_thicker_slab() {
    let (mut least, mut most) = (1.0_f64, [0.0_f64; 2]);
    for n in [8, 12] {
        let streams = Streams::new(n).unwrap();
        let mut worst = [0.0_f64; 2];
        for albedo in [0.1, 0.5, 0.9, 0.999, 0.999_99, 1.0] {
            for g in [0.0, 0.5, 0.85] {
                let chi = henyey_greenstein(albedo, g, 2 * n);
                let medium = Medium::new(&streams, &chi).unwrap();
                for (a, b) in [
                    (1e-6, 2e-6),
                    (0.1, 0.2),
                    (1.0, 3.0),
                    (9.0, 4.0),
                    (40.0, 77.0),
                    (300.0, 100.0),
                    (350.0, 250.0),
                    (4e4, 1e3),
                ] {
                    let whole = medium.operators(a + b).unwrap();
                    let parts = [a, b].map(|thickness| medium.operators(thickness).unwrap());
                    let sum = stacked(&parts[0], &parts[1]);
                    worst[0] = worst[0].max(largest_difference(&sum.reflection, &whole.reflection));
                    // relative errors if the slab is thick, so that all entries are of similar size
                    let thick = a > 5.0;
                    for (x, y) in entries(&sum.transmission).zip(entries(&whole.transmission)) {
                        if y > 1e-290 && thick {
                            least = least.min(y);
                            worst[1] = worst[1].max((x / y - 1.0).abs());
                        } else {
                            worst[0] = worst[0].max((x - y).abs());
                        }
                    }
                }
            }
        }
        assert!(worst[0] < 1e-12 && worst[1] < 1e-9, "{worst:?}");
        most = [0, 1].map(|i| most[i].max(worst[i]));
    }
    assert_rounding_says("slabs on each other", most);
    assert!(least < 1e-240, "{least:e}");
}

/// A beam along a stream gives the same fluxes as the stream.
#[test]
fn beams_along_streams_match_the_streams() {
    for n in [3, 8, 16] {
        let streams = Streams::new(n).unwrap();
        for (albedo, g) in [(1.0, 0.8), (0.97, 0.5), (0.2, -0.4)] {
            let medium =
                Medium::delta_m(&streams, &henyey_greenstein(albedo, g, 2 * n + 1)).unwrap();
            for thickness in [1e-6, 0.3, 4.0, 100.0, 1e6, f64::INFINITY] {
                let operators = medium.operators(thickness).unwrap();
                for (j, &cosine) in streams.cosines().iter().enumerate() {
                    let fluxes = medium.fluxes(thickness, collimated(cosine)).unwrap();
                    let total = |m: &Matrix| (0..n).map(|i| m[(i, j)]).sum::<f64>();
                    assert!((fluxes.reflectance - total(&operators.reflection)).abs() < 1e-12);
                    let t = total(&operators.transmission);
                    assert!(
                        (fluxes.transmittance - t).abs() <= 1e-10 * t,
                        "{n} {albedo} {thickness} {cosine} {fluxes:?} {t}"
                    );
                }
            }
        }
    }
}

#[test]
fn no_entry_is_negative() {
    let streams = Streams::new(8).unwrap();
    for albedo in [1e-3, 0.1, 0.9, 1.0] {
        for g in [0.0, 0.5] {
            let medium = Medium::delta_m(&streams, &henyey_greenstein(albedo, g, 17)).unwrap();
            for thickness in [1e-6, 1e-3, 0.1, 1.0, 10.0, 100.0, 600.0, 1e4] {
                let operators = medium.operators(thickness).unwrap();
                for matrix in [&operators.reflection, &operators.transmission] {
                    for value in entries(matrix) {
                        assert!(value >= 0.0, "{albedo} {g} {thickness}: {value:e}");
                    }
                }
            }
        }
    }
}

#[test]
fn fluxes_converge_with_the_number_of_streams() {
    let mut quoted = [0.0; 4];
    for (albedo, g) in [(1.0, 0.85), (0.98, 0.75), (0.6, 0.0)] {
        let lights = [
            collimated(1.0),
            collimated(0.5),
            collimated(0.05),
            Light::Diffuse,
        ];
        for (quoted, light) in quoted.iter_mut().zip(lights) {
            let fluxes = |n: usize| {
                let streams = Streams::new(n).unwrap();
                let medium =
                    Medium::delta_m(&streams, &henyey_greenstein(albedo, g, 2 * n + 1)).unwrap();
                medium.fluxes(3.0, light).unwrap()
            };
            let best = fluxes(64);
            let [few, many] = [8, 32].map(|n| {
                let fluxes = fluxes(n);
                let r = (fluxes.reflectance - best.reflectance).abs();
                r.max((fluxes.transmittance - best.transmittance).abs())
            });
            // at least as n^-4
            assert!(
                256.0 * many < few && many < 1e-7,
                "{albedo} {g} {light:?}: {few:e} {many:e}"
            );
            if albedo == 1.0 {
                *quoted = few;
            }
        }
    }
    let [normal, oblique, grazing, _] = quoted;
    assert_says(PAGE, "8 against 64 streams", [normal, oblique, grazing]);
}

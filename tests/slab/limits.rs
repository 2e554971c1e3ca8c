//! Phase functions and arguments that the solver accepts or rejects.
use splitsnow::slab::{Light, Medium, SlabError, Streams};

use super::{collimated, henyey_greenstein};

/// All scattered light is deflected by the same angle, the narrowest possible peak.
#[test]
fn delta_m_handles_narrow_peaks() {
    let legendre = |x: f64| {
        let mut p = vec![1.0, x];
        for l in 2..25 {
            let m = f64::from(l);
            let next = ((2.0 * m - 1.0) * x * p[p.len() - 1] - (m - 1.0) * p[p.len() - 2]) / m;
            p.push(next);
        }
        p
    };
    let streams = Streams::new(12).unwrap();
    for degrees in 0..=180 {
        let peak = legendre(f64::from(degrees).to_radians().cos());
        let smooth = henyey_greenstein(1.0, 0.5, 25);
        let chi: Vec<f64> = peak
            .iter()
            .zip(smooth)
            .map(|(p, s)| 0.9 * p + 0.1 * s)
            .collect();
        let medium = Medium::delta_m(&streams, &chi).unwrap();
        let fluxes = medium.fluxes(2.0, Light::Diffuse).unwrap();
        assert!(
            fluxes.reflectance > 0.0 && fluxes.transmittance > 0.0,
            "{degrees}"
        );
        if degrees == 0 {
            let plain = Medium::new(&streams, &chi);
            assert_eq!(plain.err(), Some(SlabError::Peaked));
        }
    }
    // forward scattering does not change the light
    for (albedo, through) in [(1.0, 1.0), (0.75, (-0.5_f64).exp())] {
        let medium = Medium::delta_m(&streams, &[albedo; 25]).unwrap();
        let fluxes = medium.fluxes(2.0, collimated(1.0)).unwrap();
        assert_eq!(fluxes.reflectance, 0.0);
        assert!((fluxes.transmittance - through).abs() < 1e-15);
    }
}

#[test]
fn invalid_arguments_are_rejected() {
    let streams = Streams::new(4).unwrap();
    for (chi, degree) in [
        (vec![1.1], 0),
        (vec![-0.1], 0),
        (vec![0.5, 0.2, 0.6], 2),
        (vec![0.5, -0.6], 1),
        (vec![0.5, f64::NAN], 1),
    ] {
        for medium in [Medium::new(&streams, &chi), Medium::delta_m(&streams, &chi)] {
            let error = medium.err().unwrap();
            assert!(
                matches!(error, SlabError::Moment { l, .. } if l == degree),
                "{error}"
            );
        }
    }
    let medium = Medium::new(&streams, &[0.9]).unwrap();
    for thickness in [-1e-9, f64::NAN] {
        let error = medium.operators(thickness).err().unwrap();
        assert!(matches!(error, SlabError::Thickness { .. }));
    }
    for cosine in [0.0, 1.1, -0.5, f64::NAN] {
        let error = medium.fluxes(1.0, collimated(cosine)).err().unwrap();
        assert!(matches!(error, SlabError::Cosine { .. }));
    }
}

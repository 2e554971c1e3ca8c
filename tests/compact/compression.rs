//! Choice of the number of components, and compression errors.
use ndarray::Array2;
use splitsnow::compress::{Choice, CompressError, CurveError};
use splitsnow::grid::Compression;

use super::{BOUNDS, colour, compress, compressed, curves};

#[test]
fn errors_decrease_with_components_and_match_a_direct_sum() {
    let compressed = compressed(Choice::Components(3));
    let rms = |row: usize| compressed.table.rows[row].rmse.mean;
    assert!(
        (1..compressed.table.rows.len()).all(|row| rms(row) <= rms(row - 1) * (1.0 + 1e-6) + 1e-8)
    );
    let rebuilt = compressed
        .coefficients
        .decoded()
        .dot(&compressed.basis.t())
        .mapv(f64::from);
    let worst = compressed.table.rows[2].rmse.worst_curve;
    let original = curves().row(worst).to_vec();
    let error = CurveError::between(&original, &rebuilt.row(worst).to_vec(), Some(&colour()));
    assert!((error.rmse - compressed.table.rows[2].rmse.max).abs() < 1e-6);
}

#[test]
fn degenerate_matrices_compress() {
    let cases = [
        (Array2::zeros((20, 31)), 1),
        (Array2::from_elem((20, 31), 0.4), 1),
        (Array2::from_shape_fn((1, 31), |(_, j)| j as f64 / 31.0), 1),
        (
            Array2::from_shape_fn((20, 31), |(i, j)| (i * j) as f64 / 600.0),
            1,
        ),
    ];
    for (curves, components) in cases {
        let compressed = compress(curves.view(), Some(&colour()), BOUNDS).unwrap();
        assert_eq!(compressed.components(), components);
        assert!(compressed.table.rows[0].rmse.max < 1e-6);
    }
    let one_wavelength = Array2::from_shape_fn((9, 1), |(i, _)| i as f64 / 9.0);
    assert_eq!(
        compress(one_wavelength.view(), None, BOUNDS)
            .unwrap()
            .components(),
        1
    );
}

#[test]
fn a_tight_bound_extends_the_table() {
    // All components of noise are equally important, so all are needed.
    let mut state = 1_u64;
    let noise = Array2::from_shape_fn((200, 31), |_| {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    });
    let bounds = |max_rmse| {
        Choice::Bounds(Compression {
            max_delta_e: 2.3,
            max_rmse: Some(max_rmse),
        })
    };
    let compressed = compress(noise.view(), Some(&colour()), bounds(1e-4)).unwrap();
    assert_eq!(compressed.components(), 31);
    assert_eq!(compressed.table.rows.len(), 31);
    let error = compress(noise.view(), Some(&colour()), bounds(1e-12)).unwrap_err();
    assert!(
        matches!(error, CompressError::Unreachable { components: 31, .. }),
        "{error}"
    );
    for components in [0, 32] {
        let error = compress(noise.view(), None, Choice::Components(components)).unwrap_err();
        assert_eq!(
            error,
            CompressError::Components {
                components,
                limit: 31
            }
        );
    }
}

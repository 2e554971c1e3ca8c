//! The choice of a file's wavelengths from the scene's. Spectra are linear between them, and a
//! few wavelengths suffice for an accurate colour.
use rayon::prelude::*;

use super::training::Score;
use crate::colour::Colorimeter;
use crate::spectrum::Resampling;

/// A subset of a scene's wavelengths.
pub(super) struct Wavelengths {
    /// Indices in the scene's list, increasing.
    pub(super) positions: Vec<usize>,
    /// The wavelengths, nm.
    pub(super) nm: Vec<f64>,
    /// Colorimeter for spectra at these wavelengths that are linear in between.
    pub(super) colour: Colorimeter,
}

impl Wavelengths {
    /// The subset with these indices in `scene_nm`.
    fn of(scene_nm: &[f64], colour: &Colorimeter, positions: Vec<usize>) -> Self {
        let nm: Vec<f64> = positions.iter().map(|i| scene_nm[*i]).collect();
        let colour = colour.resampled(&Resampling::new(&nm, scene_nm));
        Self {
            positions,
            nm,
            colour,
        }
    }

    /// The colour differences between `curves` at all wavelengths and at this subset.
    fn score(&self, scene_colour: &Colorimeter, curves: &[Vec<f64>]) -> Score {
        let error = |curve: &Vec<f64>| {
            let sampled: Vec<f64> = self.positions.iter().map(|i| curve[*i]).collect();
            scene_colour.difference_across(curve, &self.colour, &sampled)
        };
        Score::of(curves.iter().map(error))
    }

    /// The fewest wavelengths found in `scene_nm` that keep the colours of `curves`, measured
    /// by `colour`, within `bound`. The search repeatedly inserts the wavelength that helps
    /// most, then exchanges some and drops those that are not needed. The first and last
    /// wavelengths and all invisible wavelengths are kept, because no colour difference
    /// shows whether they are needed.
    pub(super) fn choose(
        scene_nm: &[f64],
        colour: &Colorimeter,
        curves: &[Vec<f64>],
        bound: f64,
    ) -> Self {
        let last = scene_nm.len() - 1;
        let is_free = |i: &usize| *i != 0 && *i != last && colour.sees(*i);
        let (fixed, free): (Vec<usize>, Vec<usize>) = (0..=last).partition(|i| !is_free(i));
        let scored = |positions| {
            let subset = Self::of(scene_nm, colour, positions);
            let score = subset.score(colour, curves);
            (subset, score)
        };
        let best = |candidates: Vec<Vec<usize>>| {
            let subsets: Vec<_> = candidates.into_par_iter().map(scored).collect();
            let typical = |step: &(Self, Score)| step.1.typical;
            let subsets = subsets.into_iter();
            subsets.min_by(|a, b| typical(a).total_cmp(&typical(b)))
        };
        let (mut chosen, mut score) = scored(fixed);
        while score.max >= bound {
            let Some(better) = best(inserted(&chosen.positions, &free)) else {
                return chosen;
            };
            (chosen, score) = better;
        }
        loop {
            match best(exchanged(&chosen.positions, &free)) {
                Some(better) if better.1.typical < 0.98 * score.typical && better.1.max < bound => {
                    (chosen, score) = better;
                    continue;
                }
                _ => {}
            }
            match best(dropped(&chosen.positions, &free)) {
                Some(fewer) if fewer.1.max < bound => (chosen, score) = fewer,
                _ => return chosen,
            }
        }
    }
}

/// All subsets with one more wavelength.
fn inserted(positions: &[usize], free: &[usize]) -> Vec<Vec<usize>> {
    let others = free.iter().filter(|i| !positions.contains(i));
    let with = |new: &usize| {
        let mut positions = [positions, &[*new]].concat();
        positions.sort_unstable();
        positions
    };
    others.map(with).collect()
}

/// All subsets with one less wavelength.
fn dropped(positions: &[usize], free: &[usize]) -> Vec<Vec<usize>> {
    let present = free.iter().filter(|i| positions.contains(i));
    let without = |old: &usize| positions.iter().copied().filter(|i| i != old).collect();
    present.map(without).collect()
}

/// All subsets with one wavelength exchanged for another between the same two neighbours.
fn exchanged(positions: &[usize], free: &[usize]) -> Vec<Vec<usize>> {
    let mut subsets = Vec::new();
    for i in (1..positions.len().max(1) - 1).filter(|i| free.contains(&positions[*i])) {
        let between = free
            .iter()
            .filter(|to| (positions[i - 1] + 1..positions[i + 1]).contains(to));
        for to in between.filter(|to| **to != positions[i]) {
            let mut positions = positions.to_vec();
            positions[i] = *to;
            subsets.push(positions);
        }
    }
    subsets
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn every_10_nm(last: i32) -> Vec<f64> {
        (40..=last).map(|i| f64::from(i) * 10.0).collect()
    }

    fn kept(nm: &[f64], bound: f64, curve: impl Fn(f64) -> f64) -> Vec<usize> {
        let colour = Colorimeter::new(nm).unwrap().unwrap();
        let curve = nm.iter().map(|nm| curve(*nm)).collect();
        Wavelengths::choose(nm, &colour, &[curve], bound).positions
    }

    #[test]
    fn bends_are_kept_and_lines_are_not() {
        let nm = every_10_nm(70);
        assert_eq!(kept(&nm, 0.1, |nm| 0.001 * nm), [0, 30]);
        let bend = |nm: f64| 0.8 - 0.002 * (nm - 530.0).max(0.0);
        assert_eq!(kept(&nm, 0.001, bend), [0, 13, 30]);
        // with a bound that the zigzag breaks if any wavelength is missing
        let zigzag = |nm: f64| 0.5 + 0.2 * (0.1 * std::f64::consts::PI * nm).cos();
        assert_eq!(kept(&nm, 1e-9, zigzag).len(), 31);
        assert_eq!(kept(&[450.0, 550.0, 650.0], 0.1, bend), [0, 1, 2]);
    }

    #[test]
    fn what_is_kept_leaves_the_colour_within_the_bound() {
        let nm = every_10_nm(70);
        let curve = |nm: f64| (-(nm / 550.0).powi(6)).exp();
        let all = Colorimeter::new(&nm).unwrap().unwrap();
        let truth: Vec<f64> = nm.iter().map(|nm| curve(*nm)).collect();
        let mut before = 2;
        for bound in [1.0, 0.1, 0.01] {
            let chosen = Wavelengths::choose(&nm, &all, std::slice::from_ref(&truth), bound);
            let values: Vec<f64> = chosen.nm.iter().map(|nm| curve(*nm)).collect();
            let lines = Resampling::new(&chosen.nm, &nm).apply(&values);
            assert!(all.difference(&truth, &lines) < bound);
            assert!(
                (before + 1..31).contains(&chosen.positions.len()),
                "{bound} {:?}",
                chosen.nm
            );
            before = chosen.positions.len();
        }
    }

    #[test]
    fn invisible_wavelengths_are_kept() {
        let found = kept(&every_10_nm(100), 0.1, |nm| 0.001 * nm);
        let expected: Vec<usize> = [0].into_iter().chain(39..=60).collect();
        assert_eq!(found, expected);
    }
}

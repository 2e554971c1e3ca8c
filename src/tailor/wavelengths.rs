//! Which of a scene's wavelengths a file keeps: values between them are linear, and
//! few are missed by the eye.
use rayon::prelude::*;

use super::training::Score;
use crate::colour::Colorimeter;
use crate::spectrum::Resampling;

/// Some of a scene's wavelengths.
pub(super) struct Wavelengths {
    /// Their positions in the scene's list, increasing.
    pub(super) kept: Vec<usize>,
    /// Themselves, nm.
    pub(super) nm: Vec<f64>,
    /// Sees spectra at them as the lines through their values are seen at all.
    pub(super) colour: Colorimeter,
}

impl Wavelengths {
    fn of(all_nm: &[f64], colour: &Colorimeter, kept: Vec<usize>) -> Self {
        let nm: Vec<f64> = kept.iter().map(|i| all_nm[*i]).collect();
        let colour = colour.resampled(&Resampling::new(&nm, all_nm));
        Self { kept, nm, colour }
    }

    /// What becomes of `curves` at all wavelengths.
    fn judge(&self, all: &Colorimeter, curves: &[Vec<f64>]) -> Score {
        let error = |curve: &Vec<f64>| {
            let sampled: Vec<f64> = self.kept.iter().map(|i| curve[*i]).collect();
            all.difference_across(curve, &self.colour, &sampled)
        };
        Score::of(curves.iter().map(error))
    }

    /// The fewest found of `all_nm` that leave the colours of `curves`, seen by
    /// `colour`, within `bound`: always the one more that helps most; then some are
    /// exchanged, and those that prove needless are dropped. The ends are kept, and
    /// what the eye does not see: no colour can say what of that is needed.
    pub(super) fn choose(
        all_nm: &[f64],
        colour: &Colorimeter,
        curves: &[Vec<f64>],
        bound: f64,
    ) -> Self {
        let last = all_nm.len() - 1;
        let free = |i: &usize| *i != 0 && *i != last && colour.sees(*i);
        let (fixed, free): (Vec<usize>, Vec<usize>) = (0..=last).partition(|i| !free(i));
        let tried = |kept| {
            let tried = Self::of(all_nm, colour, kept);
            let judgement = tried.judge(colour, curves);
            (tried, judgement)
        };
        let best = |all: Vec<Vec<usize>>| {
            let all: Vec<_> = all.into_par_iter().map(tried).collect();
            let typical = |step: &(Self, Score)| step.1.typical;
            let all = all.into_iter();
            all.min_by(|a, b| typical(a).total_cmp(&typical(b)))
        };
        let (mut chosen, mut here) = tried(fixed);
        while here.max >= bound {
            let Some(better) = best(inserted(&chosen.kept, &free)) else {
                return chosen;
            };
            (chosen, here) = better;
        }
        loop {
            match best(exchanged(&chosen.kept, &free)) {
                Some(better) if better.1.typical < 0.98 * here.typical && better.1.max < bound => {
                    (chosen, here) = better;
                    continue;
                }
                _ => {}
            }
            match best(dropped(&chosen.kept, &free)) {
                Some(fewer) if fewer.1.max < bound => (chosen, here) = fewer,
                _ => return chosen,
            }
        }
    }
}

/// One more.
fn inserted(kept: &[usize], free: &[usize]) -> Vec<Vec<usize>> {
    let others = free.iter().filter(|i| !kept.contains(i));
    let with = |new: &usize| {
        let mut kept = [kept, &[*new]].concat();
        kept.sort_unstable();
        kept
    };
    others.map(with).collect()
}

/// One less.
fn dropped(kept: &[usize], free: &[usize]) -> Vec<Vec<usize>> {
    let there = free.iter().filter(|i| kept.contains(i));
    let without = |old: &usize| kept.iter().copied().filter(|i| i != old).collect();
    there.map(without).collect()
}

/// Another instead of one, between the same two.
fn exchanged(kept: &[usize], free: &[usize]) -> Vec<Vec<usize>> {
    let mut all = Vec::new();
    for i in (1..kept.len().max(1) - 1).filter(|i| free.contains(&kept[*i])) {
        let between = free
            .iter()
            .filter(|to| (kept[i - 1] + 1..kept[i + 1]).contains(to));
        for to in between.filter(|to| **to != kept[i]) {
            let mut kept = kept.to_vec();
            kept[i] = *to;
            all.push(kept);
        }
    }
    all
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
        Wavelengths::choose(nm, &colour, &[curve], bound).kept
    }

    #[test]
    fn bends_are_kept_and_lines_are_not() {
        let nm = every_10_nm(70);
        assert_eq!(kept(&nm, 0.1, |nm| 0.001 * nm), [0, 30]);
        let bend = |nm: f64| 0.8 - 0.002 * (nm - 530.0).max(0.0);
        assert_eq!(kept(&nm, 0.001, bend), [0, 13, 30]);
        // with a bound that its zigzag breaks wherever a wavelength is missing
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
                (before + 1..31).contains(&chosen.kept.len()),
                "{bound} {:?}",
                chosen.nm
            );
            before = chosen.kept.len();
        }
    }

    #[test]
    fn what_the_eye_does_not_see_is_kept() {
        let found = kept(&every_10_nm(100), 0.1, |nm| 0.001 * nm);
        let expected: Vec<usize> = [0].into_iter().chain(39..=60).collect();
        assert_eq!(found, expected);
    }
}

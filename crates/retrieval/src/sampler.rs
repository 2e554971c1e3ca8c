//! The affine-invariant sampler of Goodman and Weare (2010): each walker moves on the line
//! through another one. It needs no scales, so that narrow ridges do not stop it.
use rand::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use rayon::prelude::*;

use crate::{Inverse, Optimum, Posterior, PosteriorMethod, Scratch};

/// Walkers per unknown.
const WALKERS: usize = 16;
/// Moves of each walker, of which the first quarter is left out.
const STEPS: usize = 3000;
/// The scale of the moves, a in Goodman and Weare.
const STRETCH: f64 = 2.0;

/// A uniform number in 0 to 1.
fn uniform(random: &mut Xoshiro256PlusPlus) -> f64 {
    (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
}

/// Samples the distribution of the places, from walkers spread around `optimum` by its
/// covariance. The same for the same `seed`, on any number of threads.
pub(crate) fn sample(inverse: &Inverse<'_>, optimum: &Optimum, seed: u64) -> Posterior {
    let unknowns = inverse.unknowns().len();
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let walkers = (WALKERS * unknowns).max(64);
    let sd = optimum.covariance(inverse).diagonal().map(f64::sqrt);
    let cost = |u: &[f64], memory: &mut (Scratch, Vec<f64>)| match u
        .iter()
        .all(|u| (0.0..=1.0).contains(u))
    {
        true => inverse.cost(u, &mut memory.0, &mut memory.1),
        false => f64::INFINITY,
    };
    let memory = || (Scratch::default(), vec![0.0; inverse.values()]);
    let mut here: Vec<(Vec<f64>, f64)> = (0..walkers)
        .map(|_| {
            let near = |(i, u): (usize, &f64)| {
                let away = (uniform(&mut random) - 0.5) * sd[i].min(0.5);
                (u + away).clamp(1e-6, 1.0 - 1e-6)
            };
            let u: Vec<f64> = optimum.u.iter().enumerate().map(near).collect();
            let cost = cost(&u, &mut memory());
            (u, cost)
        })
        .collect();
    let burned = STEPS / 4;
    let mut chain: Vec<Vec<Vec<f64>>> = Vec::with_capacity(STEPS - burned);
    for number in 0..STEPS {
        for half in 0..2 {
            // the walkers of one half move along lines through those of the other
            let (mine, others) = (half * walkers / 2, (1 - half) * walkers / 2);
            let moves: Vec<(usize, Vec<f64>, f64, f64)> = (mine..mine + walkers / 2)
                .map(|walker| {
                    let other = others + (uniform(&mut random) * (walkers / 2) as f64) as usize;
                    let z = (1.0 + (STRETCH - 1.0) * uniform(&mut random)).powi(2) / STRETCH;
                    let pairs = here[other].0.iter().zip(&here[walker].0);
                    let u = pairs
                        .map(|(other, own)| other + z * (own - other))
                        .collect();
                    (walker, u, z, uniform(&mut random))
                })
                .collect();
            let found: Vec<f64> = moves
                .par_iter()
                .map_init(memory, |memory, (_, u, _, _)| cost(u, memory))
                .collect();
            for ((walker, u, z, chance), cost) in moves.into_iter().zip(found) {
                let gain = 0.5 * (here[walker].1 - cost);
                let ratio = (unknowns as f64 - 1.0) * libm::log(z) + gain;
                if ratio > libm::log(chance) {
                    here[walker] = (u, cost);
                }
            }
        }
        if number >= burned {
            chain.push(here.iter().map(|(u, _)| u.clone()).collect());
        }
    }
    let autocorrelation = autocorrelation(&chain, unknowns);
    let steps = chain.len();
    // every third move is enough: neighbours are nearly the same
    let points: Vec<Vec<f64>> = chain.into_iter().step_by(3).flatten().collect();
    let weight = 1.0 / points.len() as f64;
    Posterior {
        weights: vec![weight; points.len()],
        points,
        method: PosteriorMethod::Sampler {
            walkers,
            steps,
            autocorrelation,
        },
    }
}

/// The integrated autocorrelation time of the mean of the walkers, in moves, of the unknown for
/// which it is longest; summed over a window of five times (Sokal).
fn autocorrelation(chain: &[Vec<Vec<f64>>], unknowns: usize) -> f64 {
    let time = |i: usize| {
        let means: Vec<f64> = chain
            .iter()
            .map(|walkers| walkers.iter().map(|u| u[i]).sum::<f64>() / walkers.len() as f64)
            .collect();
        let mean = means.iter().sum::<f64>() / means.len() as f64;
        let product = |lag: usize| -> f64 {
            let pairs = means.iter().zip(&means[lag..]);
            pairs.map(|(a, b)| (a - mean) * (b - mean)).sum()
        };
        let variance = product(0);
        let mut time = 1.0;
        for lag in 1..means.len() / 2 {
            time += 2.0 * product(lag) / variance;
            if lag as f64 >= 5.0 * time {
                break;
            }
        }
        time
    };
    (0..unknowns).map(time).fold(1.0, f64::max)
}

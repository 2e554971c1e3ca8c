//! Random streams. A stream depends only on its key (seed, cell, purpose, batch), never on
//! thread or schedule. So any distribution of the work over threads, shards and interrupted
//! runs draws the same numbers.
use rand::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use sha2::{Digest, Sha256};
use splitsnow_spectra::simd::{F64x8, Portable, Simd, U64x8};

use crate::math::{Vec3x8, ln, sincos_eighth};

/// Identifies a stream. Different keys give independent streams.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Key {
    /// Seed of the whole run.
    pub seed: u64,
    /// Cell of the database, 0 for a single measurement.
    pub cell: u64,
    /// Purpose within the cell: engine, wavelength or node, thickness.
    pub purpose: [u32; 3],
    /// Batch of rays.
    pub batch: u64,
}

/// 64 bits computed from numbers alone: the first 8 bytes (little-endian) of the SHA-256 of
/// a kind and the binary64 bits of the numbers. Quantities computed from parameters take
/// their random numbers from these bits, so the random numbers do not depend on the position
/// of the parameters in a list or on the other entries.
#[derive(Debug, Clone)]
pub struct Fingerprint(Sha256);

impl Fingerprint {
    /// Starts the fingerprint of an item of this kind. Kinds with the same numbers differ.
    #[must_use]
    pub fn of(kind: &str) -> Self {
        Self(Sha256::new()).and_text(kind)
    }

    /// Adds a text.
    #[must_use]
    pub fn and_text(mut self, text: &str) -> Self {
        // the length first, so that the boundaries between items are unambiguous
        self.0.update((text.len() as u64).to_le_bytes());
        self.0.update(text);
        self
    }

    /// Adds these numbers and their count; -0 counts as 0.
    #[must_use]
    pub fn and(mut self, values: &[f64]) -> Self {
        self.0.update((values.len() as u64).to_le_bytes());
        for value in values {
            self.0.update((value + 0.0).to_bits().to_le_bytes());
        }
        self
    }

    /// Adds an integer.
    #[must_use]
    pub fn and_bits(mut self, bits: u64) -> Self {
        self.0.update(bits.to_le_bytes());
        self
    }

    /// The bits.
    #[must_use]
    pub fn finish(self) -> u64 {
        let digest: [u8; 32] = self.0.finalize().into();
        let [a, b, c, d, e, f, g, h, ..] = digest;
        u64::from_le_bytes([a, b, c, d, e, f, g, h])
    }
}

/// Eight xoshiro256++ generators (Blackman and Vigna 2021) side by side.
#[derive(Debug, Clone)]
pub struct Stream<S: Simd = Portable> {
    state: [U64x8<S>; 4],
    /// The second of a pair of normal variates, if not yet used.
    spare: Option<F64x8<S>>,
}

/// A single generator for `key`, seeded with its SHA-256.
fn generator(key: Key) -> Xoshiro256PlusPlus {
    let mut hash = Sha256::new();
    hash.update(b"splitsnow stream 1");
    hash.update(key.seed.to_le_bytes());
    hash.update(key.cell.to_le_bytes());
    for part in key.purpose {
        hash.update(part.to_le_bytes());
    }
    hash.update(key.batch.to_le_bytes());
    Xoshiro256PlusPlus::from_seed(hash.finalize().into())
}

#[inline(always)]
fn rotate<S: Simd>(x: U64x8<S>, k: u32) -> U64x8<S> {
    (x << k) | (x >> (64 - k))
}

/// `v` with its sign flipped where the `bit` is set.
#[inline(always)]
fn flip<S: Simd>(v: F64x8<S>, bits: U64x8<S>, bit: u32) -> F64x8<S> {
    v ^ F64x8::from_bits((bits >> bit) << 63)
}

/// 52 random bits as a uniform variate in [0, 1).
#[inline(always)]
fn unit_interval<S: Simd>(bits: U64x8<S>) -> F64x8<S> {
    let one_to_two = F64x8::from_bits((bits >> 12) | U64x8::splat(0x3ff0_0000_0000_0000));
    one_to_two - F64x8::ONE
}

/// (sin, cos) of 2 pi `u` - pi / 4, for `u` in [0, 1), with an absolute error below 3e-14.
#[inline(always)]
#[must_use]
pub fn azimuth<S: Simd>(u: F64x8<S>) -> (F64x8<S>, F64x8<S>) {
    // the angle is `quarter` right angles plus an offset within a quarter, -45 to 45 degrees
    let four = u * F64x8::splat(4.0);
    let mut quarter = F64x8::ZERO;
    for k in [1.0, 2.0, 3.0] {
        quarter += F64x8::ONE & four.ge(F64x8::splat(k));
    }
    let t = four - quarter;
    let (s, c) = sincos_eighth(t + t - F64x8::ONE);
    let half = quarter.ge(F64x8::splat(2.0));
    let odd = (quarter - (F64x8::splat(2.0) & half)).gt(F64x8::splat(0.5));
    let (s, c) = (odd.select(c, s), odd.select(-s, c));
    let sign = F64x8::splat(-0.0) & half;
    (s ^ sign, c ^ sign)
}

impl Stream {
    /// The stream of `key`. A generator seeded from it draws the states of the eight.
    #[must_use]
    pub fn new(key: Key) -> Self {
        let mut seeds = generator(key);
        let state = std::array::from_fn(|_| U64x8::new(std::array::from_fn(|_| seeds.next_u64())));
        Self { state, spare: None }
    }
}

impl<S: Simd> Stream<S> {
    /// The same stream for another instruction set.
    #[inline(always)]
    #[must_use]
    pub fn on<T: Simd>(self) -> Stream<T> {
        Stream {
            state: self.state.map(U64x8::on),
            spare: self.spare.map(F64x8::on),
        }
    }

    /// 64 random bits per lane.
    #[inline(always)]
    fn bits(&mut self) -> U64x8<S> {
        let [s0, s1, s2, s3] = &mut self.state;
        let result = rotate(*s0 + *s3, 23) + *s0;
        let t = *s1 << 17;
        *s2 ^= *s0;
        *s3 ^= *s1;
        *s1 ^= *s2;
        *s0 ^= *s3;
        *s2 ^= t;
        *s3 = rotate(*s3, 45);
        result
    }

    /// Uniform in [0, 1), a multiple of 2^-52.
    #[inline(always)]
    pub fn uniform(&mut self) -> F64x8<S> {
        unit_interval(self.bits())
    }

    /// Exponential with mean 1 (truncated at 36, beyond which the probability is 2e-16).
    #[inline(always)]
    pub fn exponential(&mut self) -> F64x8<S> {
        -ln(F64x8::ONE - self.uniform())
    }

    /// Normal with mean 0 and standard deviation 1 (Box and Muller 1958).
    #[inline(always)]
    pub fn normal(&mut self) -> F64x8<S> {
        if let Some(spare) = self.spare.take() {
            return spare;
        }
        let r = (self.exponential() * F64x8::splat(2.0)).sqrt();
        let (s, c) = self.azimuth();
        self.spare = Some(r * s);
        r * c
    }

    /// (sin, cos) of an angle uniform on the circle.
    #[inline(always)]
    pub fn azimuth(&mut self) -> (F64x8<S>, F64x8<S>) {
        let bits = self.bits();
        // 52 bits choose an angle within 45 degrees of the x axis, three others swap and flip
        let t = unit_interval(bits);
        let (s, c) = sincos_eighth(t + t - F64x8::ONE);
        let swap = F64x8::from_bits(U64x8::ZERO - (bits & U64x8::ONE));
        let (s, c) = (swap.select(c, s), swap.select(s, c));
        (flip(s, bits, 1), flip(c, bits, 2))
    }

    /// Directions uniform on the unit sphere.
    #[inline(always)]
    pub fn direction(&mut self) -> Vec3x8<S> {
        let u = self.uniform();
        let z = u + u - F64x8::ONE;
        let r = (F64x8::ONE - z * z).sqrt();
        let (s, c) = self.azimuth();
        Vec3x8::new(r * c, r * s, z)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const KEY: Key = Key {
        seed: 1,
        cell: 2,
        purpose: [3, 4, 5],
        batch: 6,
    };

    #[test]
    fn every_part_of_the_key_changes_the_stream() {
        let keys = [
            KEY,
            Key { seed: 2, ..KEY },
            Key { cell: 3, ..KEY },
            Key {
                purpose: [4, 3, 5],
                ..KEY
            },
            Key {
                purpose: [3, 4, 6],
                ..KEY
            },
            Key { batch: 7, ..KEY },
        ];
        let mut first: Vec<u64> = keys
            .iter()
            .flat_map(|k| Stream::new(*k).bits().to_array())
            .collect();
        first.sort_unstable();
        first.dedup();
        assert_eq!(first.len(), 8 * keys.len());
    }

    /// The digest is part of the format: it determines the bytes of databases.
    #[test]
    fn digests_depend_on_kind_values_and_boundaries() {
        let digest = |kind: &str, values: &[f64]| Fingerprint::of(kind).and(values).finish();
        assert_eq!(digest("snow", &[0.0]), digest("snow", &[-0.0]));
        let digests = [
            digest("snow", &[]),
            digest("snow", &[0.0]),
            digest("snow", &[1.0]),
            digest("light", &[1.0]),
            digest("snow", &[1.0, 2.0]),
            Fingerprint::of("snow").and(&[1.0]).and(&[2.0]).finish(),
            Fingerprint::of("snow").and_text("").and(&[1.0]).finish(),
            Fingerprint::of("snow").and_bits(1).finish(),
        ];
        for (i, digest) in digests.iter().enumerate() {
            assert!(!digests[..i].contains(digest), "{i}");
        }
    }

    #[test]
    fn every_lane_matches_the_published_generator() {
        let mut stream = Stream::new(KEY);
        let states = stream.state.map(U64x8::to_array);
        for lane in 0..8 {
            let mut seed = [0; 32];
            for (bytes, word) in seed.chunks_mut(8).zip(states) {
                bytes.copy_from_slice(&word[lane].to_le_bytes());
            }
            let mut published = Xoshiro256PlusPlus::from_seed(seed);
            let mut ours = stream.clone();
            for _ in 0..100 {
                assert_eq!(ours.bits().to_array()[lane], published.next_u64());
            }
        }
        assert_ne!(stream.bits(), stream.bits());
    }
}

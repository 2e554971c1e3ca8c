//! Random streams that choose where a database is tested. They depend on a seed and a purpose;
//! their hashes differ from those of the streams that made the database.
use rand::SeedableRng;
use rand_xoshiro::Xoshiro256PlusPlus;
use sha2::{Digest, Sha256};

/// The check that a stream belongs to.
#[derive(Debug, Clone, Copy)]
pub(crate) enum CheckStream {
    ErrorBudget,
    Verify,
}

impl CheckStream {
    /// The random stream of this check for `purpose`.
    pub(crate) fn stream(self, purpose: &str, seed: u64) -> Xoshiro256PlusPlus {
        let name = match self {
            // the former name of error budgets, which determines their points
            Self::ErrorBudget => "certificate",
            Self::Verify => "verify",
        };
        let hash = Sha256::new()
            .chain_update(format!("splitsnow {name} 1 {purpose}"))
            .chain_update(seed.to_le_bytes())
            .finalize();
        Xoshiro256PlusPlus::from_seed(hash.into())
    }
}

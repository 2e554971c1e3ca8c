//! Storage of tables outside the process, so that several processes (and threads) share the work
//! of drawing them.
//!
//! The unit is one part of a table. Whoever needs a part reads it or, if nobody else is drawing
//! it, draws and writes it. Parts that others are drawing are left for later, so that processes
//! that start at the same moment share out the parts. A part is the same to the bit, whether it is
//! drawn or read.
//!
//! Nothing that is read is believed unseen. A part begins with the SHA-256 over its name and its
//! bytes, and its name is a hash of all inputs that determine it. A damaged, truncated or foreign
//! part is drawn and written again.
use std::fmt::Debug;
use std::sync::atomic::Ordering;
use std::thread::sleep;
use std::time::{Duration, Instant};

use sha2::{Digest, Sha256};

use super::{Control, EngineError, batches};

/// Version of the tables. Raise it with every change that draws other tables from the same inputs
/// or stores them in another way: in the random streams, the grain events, the choice of the
/// entries, the kernel or the bytes. The test `tables_have_not_changed` tells.
const VERSION: u32 = 1;
/// Bytes of a digest.
const DIGEST: usize = 32;
/// Pause between two looks at the parts that others are drawing.
const PAUSE: Duration = Duration::from_millis(10);
/// Longest time to wait for them. A part takes a tenth of a second; a process that was stopped
/// would never end.
const PATIENCE: Duration = Duration::from_secs(30);

/// Storage of parts of tables under names, for several threads and processes at the same time.
/// What fails is the store's own matter: parts that it does not have are drawn.
pub trait TableStore: Debug + Send + Sync {
    /// The bytes stored under `name`, if there are any. They may be damaged.
    fn read(&self, name: &str) -> Option<Vec<u8>>;
    /// Stores `bytes` under `name`. Replaces older ones at once.
    fn write(&self, name: &str, bytes: &[u8]);
    /// Claims the part `name` for the caller, until it calls [`release`](Self::release); false if
    /// somebody else has claimed it. The claims of a process end with it. Two may get the same
    /// claim, which costs time only.
    fn claim(&self, name: &str) -> bool;
    /// Ends a claim.
    fn release(&self, name: &str);
}

/// A claim on a part, until dropped.
struct PartClaim<'a>(&'a dyn TableStore, &'a str);

impl Drop for PartClaim<'_> {
    fn drop(&mut self) {
        self.0.release(self.1);
    }
}

/// The name of part `number` of the table whose inputs are `inputs`.
pub(super) fn name(inputs: &str, number: usize) -> String {
    let crate_version = env!("CARGO_PKG_VERSION");
    let text = format!("splitsnow table {VERSION} {crate_version}: {inputs}: part {number}");
    hex(&Sha256::digest(text))
}

pub(super) fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// The digest of the part `name` with these `bytes`, and the bytes.
fn sealed(name: &str, bytes: &[u8]) -> Vec<u8> {
    [&digest(name, bytes), bytes].concat()
}

/// The bytes of the part `name`, if their digest is right.
fn opened<'a>(name: &str, sealed: &'a [u8]) -> Option<&'a [u8]> {
    let (found, bytes) = sealed.split_at_checked(DIGEST)?;
    (digest(name, bytes) == found).then_some(bytes)
}

fn digest(name: &str, bytes: &[u8]) -> [u8; DIGEST] {
    Sha256::new()
        .chain_update(name)
        .chain_update(bytes)
        .finalize()
        .into()
}

/// A part of a table.
pub(super) trait TablePart: Sized + Send {
    fn to_bytes(&self) -> Vec<u8>;
    /// The inverse of [`to_bytes`](Self::to_bytes), to the bit.
    fn from_bytes(bytes: &[u8]) -> Option<Self>;
}

/// The parts with these `names`, in order: read from `store`, or drawn by `draw` and stored.
///
/// `draw` gets a control for one thread. It must not wait for a pool of threads: while a thread
/// that holds a claim waits, it may take up work that waits for this claim.
pub(super) fn parts<P: TablePart>(
    store: &dyn TableStore,
    names: &[String],
    control: &Control,
    draw: impl Fn(usize, &Control) -> Result<P, EngineError> + Sync + Send,
) -> Result<Vec<P>, EngineError> {
    let alone = Control {
        parallel: false,
        ..*control
    };
    let read = |name: &String| {
        let part = P::from_bytes(opened(name, &store.read(name)?)?)?;
        control.cache.tables.count_read();
        Some(part)
    };
    let draw = |number: usize| {
        let part = draw(number, &alone)?;
        store.write(&names[number], &sealed(&names[number], &part.to_bytes()));
        Ok(part)
    };
    let attempt = |number: usize| {
        let name = &names[number];
        if let Some(part) = read(name) {
            return Ok(Some(part));
        }
        if !store.claim(name) {
            return Ok(None);
        }
        let _claim = PartClaim(store, name);
        // it may have been written meanwhile
        match read(name) {
            Some(part) => Ok(Some(part)),
            None => draw(number).map(Some),
        }
    };
    let mut parts = batches::map(control, (0..names.len()).collect(), attempt)?;
    let begin = Instant::now();
    loop {
        for (number, part) in parts.iter_mut().enumerate() {
            if part.is_none() {
                *part = match begin.elapsed() < PATIENCE {
                    true => attempt(number)?,
                    false => Some(draw(number)?),
                };
            }
        }
        if parts.iter().all(Option::is_some) {
            return Ok(parts.into_iter().flatten().collect());
        }
        if control.cancel.load(Ordering::Relaxed) {
            return Err(EngineError::Cancelled);
        }
        sleep(PAUSE);
    }
}

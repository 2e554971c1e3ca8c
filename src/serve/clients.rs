//! The pages that are open, each with an engine of its own.
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, PoisonError};

use rayon::ThreadPool;
use tokio::sync::Mutex;

use crate::page::{Limits, PageEngine};

/// Engines kept, each with up to 160 MiB of tables. The least recently used one is dropped for a
/// new client; the files of its page are then closed, and the page opens them again.
const MOST_CLIENTS: usize = 8;

/// The clients by name, the one used last at the end.
#[derive(Debug)]
pub(super) struct Clients {
    limits: Limits,
    pool: Arc<ThreadPool>,
    engines: std::sync::Mutex<Vec<(String, Arc<Mutex<PageEngine>>)>>,
}

/// Cancels a message when the client hangs up and its answer is dropped.
struct Hangup(Arc<AtomicBool>);

impl Drop for Hangup {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

impl Clients {
    pub(super) fn new(limits: Limits, pool: ThreadPool) -> Self {
        Self {
            limits,
            pool: Arc::new(pool),
            engines: std::sync::Mutex::default(),
        }
    }

    /// Answers a `message` with the `data` beside it, after the earlier ones of `client`; `None`
    /// if the engine panicked, which is then replaced.
    pub(super) async fn answer(
        &self,
        client: &str,
        message: Vec<u8>,
        data: Vec<u8>,
    ) -> Option<String> {
        let hangup = Hangup(Arc::default());
        let cancel = Arc::clone(&hangup.0);
        let own = self.engine(client);
        let mut engine = Arc::clone(&own).lock_owned().await;
        let pool = Arc::clone(&self.pool);
        let work = move || {
            if cancel.load(Ordering::Relaxed) {
                return String::new();
            }
            pool.install(|| engine.answer_unless(&cancel, &message, &data))
                .json
        };
        match tokio::task::spawn_blocking(work).await {
            Ok(answer) => Some(answer),
            Err(_) => {
                self.lock().retain(|(_, engine)| !Arc::ptr_eq(engine, &own));
                None
            }
        }
    }

    fn engine(&self, client: &str) -> Arc<Mutex<PageEngine>> {
        let mut engines = self.lock();
        let known = engines.iter().position(|(name, _)| name == client);
        let (name, engine) = match known {
            Some(position) => engines.remove(position),
            None => {
                if engines.len() >= MOST_CLIENTS {
                    engines.remove(0);
                }
                let threads = self.pool.current_num_threads();
                let engine = PageEngine::new(self.limits, threads);
                (client.to_owned(), Arc::new(Mutex::new(engine)))
            }
        };
        engines.push((name, Arc::clone(&engine)));
        engine
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, Vec<(String, Arc<Mutex<PageEngine>>)>> {
        self.engines.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

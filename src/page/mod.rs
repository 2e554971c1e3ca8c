//! Answers the messages of the web page (`web/src/messages.ts`), for WebAssembly in a worker of
//! the browser and for `splitsnow serve` alike.
//!
//! A request is a JSON object whose `ask` names it, with bytes beside it where the message says
//! so. The answer is a JSON object, also if the request is refused: `{"error": ..., "key": ...}`.
//! Numbers are written so that they are read back to the bit. Keys name their units; reflectance,
//! transmittance and absorptance are shares of the incident light, and wavelengths are in nm.
//!
//! The physics and its range are those of [`crate::engine`]; [`Limits`] bounds what is answered.
//!
//! ```
//! use splitsnow::page::PageEngine;
//!
//! let mut engine = PageEngine::default();
//! let answer = engine.answer(br#"{"ask": "about"}"#, &[]);
//! assert!(answer.json.contains("representative"));
//! let refused = engine.answer(br#"{"ask": "the time"}"#, &[]);
//! assert!(refused.json.starts_with(r#"{"error":"#));
//! ```
mod about;
mod colour;
mod compact;
mod directions;
mod limits;
mod measured;
mod refused;
mod sample;
mod simulate;

use crate::engine::Cache;
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

pub use limits::Limits;
use refused::{Refused, Reply};

/// Memory for tables of grain events, bytes. Those of one grain shape at one index node take
/// 4 MB with 16,384 walks and 8 MB from 32,768 on.
const TABLES: usize = 160 << 20;

/// What the page asks.
#[derive(Debug, Deserialize)]
#[serde(tag = "ask", rename_all = "lowercase")]
enum Request {
    About,
    Sample(sample::SampleRequest),
    Walk(simulate::WalkRequest),
    Simulate(simulate::SimulateRequest),
    Wedge(simulate::WedgeRequest),
    Directions(directions::DirectionsRequest),
    Colour(colour::ColourRequest),
    Light(colour::LightRequest),
    Measured(measured::MeasuredRequest),
    Open(compact::OpenRequest),
    Lookup(compact::LookupRequest),
}

/// The answer to a request.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Answer {
    /// The JSON object.
    pub json: String,
    /// Bytes beside it: those of `walk`; empty otherwise.
    pub data: Vec<u8>,
}

/// An engine with the compact files that the page opened.
#[derive(Debug)]
pub struct PageEngine {
    cache: Cache,
    limits: Limits,
    threads: usize,
    cancel: Arc<AtomicBool>,
    files: compact::OpenFiles,
}

impl Default for PageEngine {
    /// An engine on one thread, with the limits of a browser.
    fn default() -> Self {
        Self::new(Limits::default(), 1)
    }
}

impl PageEngine {
    /// An engine that refuses requests beyond `limits` and uses all threads of the current rayon
    /// pool if `threads` is above 1.
    #[must_use]
    pub fn new(limits: Limits, threads: usize) -> Self {
        Self {
            cache: Cache::of_tables(TABLES),
            limits,
            threads,
            cancel: Arc::default(),
            files: compact::OpenFiles::default(),
        }
    }

    /// The same engine, with `bytes` of memory for tables of grain events (160 MiB by default).
    #[must_use]
    pub fn with_tables(self, bytes: usize) -> Self {
        Self {
            cache: Cache::of_tables(bytes),
            ..self
        }
    }

    /// Like [`answer`](Self::answer), but gives up when `cancel` becomes true.
    pub fn answer_unless(
        &mut self,
        cancel: &Arc<AtomicBool>,
        request: &[u8],
        data: &[u8],
    ) -> Answer {
        self.cancel = Arc::clone(cancel);
        let answer = self.answer(request, data);
        self.cancel = Arc::default();
        answer
    }

    /// Answers one request, JSON, with the `data` beside it.
    pub fn answer(&mut self, request: &[u8], data: &[u8]) -> Answer {
        let request = serde_json::from_slice(request);
        let answer = match request {
            Ok(request) => self.reply(request, data),
            Err(error) => Err(Refused::new(format!(
                "the request is not one of this version: {error}; reload the page"
            ))),
        };
        let reply = answer.unwrap_or_else(|refusal| Reply::of(&refusal));
        Answer {
            json: reply.json,
            data: reply.data,
        }
    }

    fn reply(&mut self, request: Request, data: &[u8]) -> Result<Reply, Refused> {
        match request {
            Request::About => about::answer(self.threads).map(|about| Reply::of(&about)),
            Request::Sample(request) => request.answer(self).map(|sample| Reply::of(&sample)),
            Request::Walk(request) => request.answer(self),
            Request::Simulate(request) => request.answer(self, data).map(|s| Reply::of(&s)),
            Request::Wedge(request) => request.answer(self).map(|wedge| Reply::of(&wedge)),
            Request::Directions(request) => request.answer(self).map(|views| Reply::of(&views)),
            Request::Colour(request) => request.answer(self).map(|colours| Reply::of(&colours)),
            Request::Light(request) => request.answer().map(|light| Reply::of(&light)),
            Request::Measured(request) => request.answer().map(|measured| Reply::of(&measured)),
            Request::Open(request) => self.files.open(request, data).map(|file| Reply::of(&file)),
            Request::Lookup(request) => self.files.lookup(&request).map(|found| Reply::of(&found)),
        }
    }
}

impl Reply {
    fn of<T: Serialize>(answer: &T) -> Self {
        let json = serde_json::to_string(answer);
        Self {
            json: json.unwrap_or_else(|error| json!({ "error": error.to_string() }).to_string()),
            data: Vec::new(),
        }
    }
}

//! The web page with the engine of this machine: a small server for the browser of the same user.
//!
//! The page and its messages are those of the browser's own engine ([`crate::page`]); only the
//! engine is another. The server listens on 127.0.0.1 alone. All addresses begin with a random
//! token, so that other users of the machine and other pages of the browser cannot guess them:
//!
//! | request | answer |
//! |---|---|
//! | `GET /TOKEN/` and the files of the page | the page |
//! | `POST /TOKEN/ask`, `application/json` | the answer to one message |
//!
//! A browser names the host and the origin of every request. Requests for another host (DNS
//! rebinding) or from another origin are refused, and no answer allows other origins to read it.
//! A request names no files: what it needs is in it. A message may carry bytes as base64 in its
//! field `data`. Each client, a page that is open, has one engine, which answers one message at a
//! time; a message whose client hangs up is cancelled. A connection takes one request.
mod clients;
mod connections;
mod guard;

use std::io;
use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use axum::body::{Body, Bytes, to_bytes};
use axum::extract::{Request, State};
use axum::http::{HeaderMap, Method, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::{Router, middleware};
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD as BASE64;
use include_dir::{Dir, include_dir};
use rand::TryRng;
use rand::rngs::SysRng;
use serde_json::{Value, json};
use thiserror::Error;

use crate::page::Limits;
use clients::Clients;

/// The page, as `npm run build` in `web` makes it.
static PAGE: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/web/dist");

/// Longest body of a request, bytes: a compact file of 16 MB as base64.
pub const MOST_BYTES: usize = 24 << 20;

/// Numbers, texts, lists and objects of a message, so that it takes little memory.
const MOST_VALUES: usize = 500_000;

/// Between two looks at whether the server is to stop.
const LOOK: Duration = Duration::from_millis(50);

/// Header in which a page names itself, so that each has an engine of its own.
pub const CLIENT: &str = "x-splitsnow-client";

/// The server could not start.
#[derive(Debug, Error)]
pub enum ServeError {
    /// The port cannot be used.
    #[error(
        "cannot listen on port {port} of 127.0.0.1: {source}; choose another with --port, or leave it out"
    )]
    Port {
        /// The port.
        port: u16,
        /// What the system said.
        source: io::Error,
    },
    /// The threads could not be started.
    #[error("cannot start the threads of the server: {0}; ask for fewer")]
    Threads(String),
    /// The system has no random numbers.
    #[error("the system gives no random numbers for the token: {0}")]
    Random(String),
    /// The server failed.
    #[error("the server stopped: {0}")]
    Stopped(io::Error),
}

/// A server that listens and answers once it runs.
#[derive(Debug)]
pub struct Server {
    listener: TcpListener,
    address: SocketAddr,
    token: String,
    threads: usize,
}

/// What every request needs.
#[derive(Debug)]
struct Shared {
    address: SocketAddr,
    token: String,
    clients: Clients,
}

impl Server {
    /// Listens on `port` of 127.0.0.1, 0 for any free one, and simulates on `threads` threads.
    ///
    /// # Errors
    /// [`ServeError::Port`] if the port is taken, [`ServeError::Random`] without random numbers.
    pub fn bind(port: u16, threads: usize) -> Result<Self, ServeError> {
        let refuse = |source| ServeError::Port { port, source };
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port)).map_err(refuse)?;
        listener.set_nonblocking(true).map_err(refuse)?;
        let mut bytes = [0; 16];
        let random = SysRng.try_fill_bytes(&mut bytes);
        random.map_err(|error| ServeError::Random(error.to_string()))?;
        Ok(Self {
            address: listener.local_addr().map_err(refuse)?,
            listener,
            token: bytes.iter().map(|byte| format!("{byte:02x}")).collect(),
            threads,
        })
    }

    /// The address of the page.
    #[must_use]
    pub fn url(&self) -> String {
        format!("http://{}/{}/", self.address, self.token)
    }

    /// Answers requests until `stop` becomes true.
    ///
    /// # Errors
    /// [`ServeError::Threads`] or [`ServeError::Stopped`].
    pub fn run(self, stop: &AtomicBool) -> Result<(), ServeError> {
        let threads = |error: &dyn std::fmt::Display| ServeError::Threads(error.to_string());
        let pool = rayon::ThreadPoolBuilder::new().num_threads(self.threads);
        let pool = pool.build().map_err(|error| threads(&error))?;
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(2)
            .enable_all()
            .build()
            .map_err(|error| threads(&error))?;
        let shared = Arc::new(Shared {
            address: self.address,
            token: self.token,
            clients: Clients::new(Limits::default(), pool),
        });
        let guarded = middleware::from_fn_with_state(Arc::clone(&shared), guard::check);
        let router = Router::new()
            .fallback(route)
            .layer(guarded)
            .with_state(shared);
        let served = runtime.block_on(async {
            let listener = tokio::net::TcpListener::from_std(self.listener)?;
            let stopped = async {
                let mut looks = tokio::time::interval(LOOK);
                while !stop.load(Ordering::Relaxed) {
                    looks.tick().await;
                }
            };
            tokio::select! {
                () = connections::serve(listener, router) => {}
                () = stopped => {}
            }
            Ok(())
        });
        runtime.shutdown_background();
        served.map_err(ServeError::Stopped)
    }
}

/// A refusal as the messages of the page have it.
fn refusal(status: StatusCode, error: &str) -> Response {
    let body = json!({ "error": error }).to_string();
    (status, [(header::CONTENT_TYPE, "application/json")], body).into_response()
}

/// Answers one request whose host and origin are right.
async fn route(State(shared): State<Arc<Shared>>, request: Request) -> Response {
    let not_found = || {
        let help = "nothing is here; open the address that `splitsnow serve` printed";
        refusal(StatusCode::NOT_FOUND, help)
    };
    let path = request.uri().path().to_owned();
    let Some(path) = guard::within(&shared.token, &path) else {
        return not_found();
    };
    match (request.method(), path) {
        (&Method::POST, "ask") => ask(&shared, request).await,
        (&Method::GET | &Method::HEAD, "") => file("index.html").unwrap_or_else(not_found),
        (&Method::GET | &Method::HEAD, path) => file(path).unwrap_or_else(not_found),
        _ => refusal(
            StatusCode::METHOD_NOT_ALLOWED,
            "the page is read with GET, and messages are sent with POST to `ask`",
        ),
    }
}

/// A file of the page.
fn file(path: &str) -> Option<Response> {
    let file = PAGE.get_file(path)?;
    let kind = match path.rsplit('.').next() {
        Some("html") => "text/html; charset=utf-8",
        Some("js") => "text/javascript; charset=utf-8",
        Some("css") => "text/css; charset=utf-8",
        Some("svg") => "image/svg+xml",
        Some("png") => "image/png",
        Some("json" | "webmanifest") => "application/json",
        Some("wasm") => "application/wasm",
        _ => "application/octet-stream",
    };
    let body = match path {
        // the page asks this server instead of its own engine
        "index.html" => {
            let text = file.contents_utf8()?;
            Body::from(text.replacen(r#"content="wasm""#, r#"content="server""#, 1))
        }
        _ => Body::from(file.contents()),
    };
    Some(([(header::CONTENT_TYPE, kind)], body).into_response())
}

/// Answers one message.
async fn ask(shared: &Shared, request: Request) -> Response {
    let (parts, body) = request.into_parts();
    if !is_json(&parts.headers) {
        let help = "send the message as JSON, with the content type application/json";
        return refusal(StatusCode::UNSUPPORTED_MEDIA_TYPE, help);
    }
    let client = parts.headers.get(CLIENT);
    let client = client.and_then(|name| name.to_str().ok()).unwrap_or("");
    if client.len() > 64 {
        let help = "the name of the client is longer than 64 characters";
        return refusal(StatusCode::BAD_REQUEST, help);
    }
    let body = tokio::time::timeout(connections::PATIENCE, to_bytes(body, MOST_BYTES));
    let Ok(body) = body.await else {
        let help = "the message did not arrive in time; send it again";
        return refusal(StatusCode::REQUEST_TIMEOUT, help);
    };
    let Ok(body) = body else {
        let help = format!("a message may have {MOST_BYTES} bytes at most");
        return refusal(StatusCode::PAYLOAD_TOO_LARGE, &help);
    };
    if values(&body) > MOST_VALUES {
        let help = format!("a message may have {MOST_VALUES} values at most");
        return refusal(StatusCode::PAYLOAD_TOO_LARGE, &help);
    }
    match message(&body) {
        Ok((message, data)) => {
            let answer = shared.clients.answer(client, message, data).await;
            match answer {
                Some(answer) => {
                    ([(header::CONTENT_TYPE, "application/json")], answer).into_response()
                }
                None => refusal(
                    StatusCode::INTERNAL_SERVER_ERROR,
                    "the engine failed on this message; please report it with the sample file (panel Take away)",
                ),
            }
        }
        Err(error) => refusal(StatusCode::BAD_REQUEST, &error),
    }
}

fn is_json(headers: &HeaderMap) -> bool {
    let kind = headers.get(header::CONTENT_TYPE);
    let kind = kind.and_then(|kind| kind.to_str().ok()).unwrap_or("");
    kind.split(';')
        .next()
        .is_some_and(|kind| kind.trim() == "application/json")
}

/// At least as many values as the JSON has: each follows a comma or a bracket outside of text.
fn values(json: &[u8]) -> usize {
    let (mut count, mut in_text, mut escaped) = (0, false, false);
    for byte in json {
        match byte {
            _ if escaped => escaped = false,
            b'\\' => escaped = in_text,
            b'"' => in_text = !in_text,
            b',' | b'[' | b'{' if !in_text => count += 1,
            _ => {}
        }
    }
    count
}

/// The message in `body` and the bytes beside it.
fn message(body: &Bytes) -> Result<(Vec<u8>, Vec<u8>), String> {
    let mut value: Value = serde_json::from_slice(body)
        .map_err(|error| format!("the message is not JSON: {error}"))?;
    let data = value.as_object_mut().and_then(|keys| keys.remove("data"));
    let data = match data {
        None => Vec::new(),
        Some(Value::String(text)) => BASE64
            .decode(text)
            .map_err(|error| format!("the field `data` is not base64: {error}"))?,
        Some(_) => return Err("the field `data` is not base64 text".to_owned()),
    };
    Ok((value.to_string().into_bytes(), data))
}

//! Connections: how many there are, and how long one may say nothing.
use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use axum::serve::Listener;
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use tokio::net::TcpListener;
use tokio::sync::Semaphore;

/// Connections at once; the system keeps further ones waiting. A page has six.
const MOST_CONNECTIONS: usize = 128;

/// The head of a request, and then its body, must arrive in this time.
pub(super) const PATIENCE: Duration = Duration::from_secs(10);

/// Answers the connections that `listener` gets, one request each.
pub(super) async fn serve(mut listener: TcpListener, router: Router) {
    let places = Arc::new(Semaphore::new(MOST_CONNECTIONS));
    // nobody closes the semaphore
    while let Ok(place) = Arc::clone(&places).acquire_owned().await {
        // waits while there are no descriptors
        let (stream, _) = Listener::accept(&mut listener).await;
        let service = TowerToHyperService::new(router.clone());
        let connection = http1::Builder::new()
            .timer(TokioTimer::new())
            .header_read_timeout(PATIENCE)
            .keep_alive(false)
            .serve_connection(TokioIo::new(stream), service);
        tokio::spawn(async move {
            // its end, of whatever kind, concerns no other connection
            let _ = connection.await;
            drop(place);
        });
    }
}

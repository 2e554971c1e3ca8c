//! Which requests are answered: those of the page of this server.
use std::sync::Arc;

use axum::extract::{Request, State};
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header};
use axum::middleware::Next;
use axum::response::Response;

use super::{Shared, refusal};

/// Headers of every answer: the page loads nothing from elsewhere, no page frames it, its
/// address goes nowhere, and nothing is kept.
const HEADERS: [(HeaderName, &str); 6] = [
    (
        header::CONTENT_SECURITY_POLICY,
        "default-src 'self'; img-src 'self' data: blob:; object-src 'none'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'",
    ),
    (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
    (header::X_FRAME_OPTIONS, "DENY"),
    (header::REFERRER_POLICY, "no-referrer"),
    (header::CACHE_CONTROL, "no-store"),
    (
        HeaderName::from_static("cross-origin-resource-policy"),
        "same-origin",
    ),
];

/// Refuses requests for another host or from another origin, and adds [`HEADERS`].
pub(super) async fn check(
    State(shared): State<Arc<Shared>>,
    request: Request,
    next: Next,
) -> Response {
    let port = shared.address.port();
    let mut response = match refused(request.headers(), port) {
        Some(reason) => refusal(StatusCode::FORBIDDEN, reason),
        None => next.run(request).await,
    };
    for (name, value) in HEADERS {
        let value = HeaderValue::from_static(value);
        response.headers_mut().insert(name, value);
    }
    response
}

/// The reason for which a request with these headers is refused.
fn refused(headers: &HeaderMap, port: u16) -> Option<&'static str> {
    let mut hosts = vec![format!("127.0.0.1:{port}"), format!("localhost:{port}")];
    if port == 80 {
        // browsers leave out the port of the scheme
        hosts.extend(["127.0.0.1".to_owned(), "localhost".to_owned()]);
    }
    let text = |name| match headers.get_all(name).iter().collect::<Vec<_>>()[..] {
        [] => Some(None),
        [value] => Some(Some(value.to_str().ok()?)),
        _ => None,
    };
    match text(header::HOST) {
        Some(Some(host)) if hosts.iter().any(|own| own == host) => {}
        _ => {
            return Some(
                "the request is for another host; open the address that `splitsnow serve` printed",
            );
        }
    }
    let is_own = |origin: &str| {
        let host = origin.strip_prefix("http://");
        host.is_some_and(|host| hosts.iter().any(|own| own == host))
    };
    match text(header::ORIGIN) {
        Some(None) => {}
        Some(Some(origin)) if is_own(origin) => {}
        _ => return Some("the request comes from another page"),
    }
    match text(HeaderName::from_static("sec-fetch-site")) {
        Some(None | Some("same-origin" | "none")) => None,
        _ => Some("the request comes from another page"),
    }
}

/// The rest of `path` within `/TOKEN/`. Takes the same time for any wrong token of one length.
pub(super) fn within<'p>(token: &str, path: &'p str) -> Option<&'p str> {
    let (given, rest) = path.strip_prefix('/')?.split_once('/')?;
    if given.len() != token.len() {
        return None;
    }
    let pairs = given.bytes().zip(token.bytes());
    let difference = pairs.fold(0, |difference, (a, b)| difference | (a ^ b));
    (difference == 0).then_some(rest)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn headers(list: &[(&str, &str)]) -> HeaderMap {
        let header = |(name, value): &(&str, &str)| {
            (name.parse::<HeaderName>().unwrap(), value.parse().unwrap())
        };
        let mut headers = HeaderMap::new();
        for (name, value) in list.iter().map(header) {
            headers.append(name, value);
        }
        headers
    }

    #[test]
    fn only_requests_of_the_own_page_pass() {
        let own = ("host", "127.0.0.1:8080");
        for passes in [
            vec![own],
            vec![("host", "localhost:8080")],
            vec![
                own,
                ("origin", "http://127.0.0.1:8080"),
                ("sec-fetch-site", "same-origin"),
            ],
            vec![own, ("sec-fetch-site", "none")],
        ] {
            assert_eq!(refused(&headers(&passes), 8080), None, "{passes:?}");
        }
        for fails in [
            vec![],
            vec![own, own],
            vec![("host", "127.0.0.1")],
            vec![("host", "127.0.0.1:8081")],
            vec![("host", "evil.example:8080")],
            vec![("host", "127.0.0.1.evil.example:8080")],
            vec![own, ("origin", "null")],
            vec![own, ("origin", "https://127.0.0.1:8080")],
            vec![own, ("origin", "http://evil.example")],
            vec![
                own,
                ("origin", "http://127.0.0.1:8080"),
                ("origin", "http://evil.example"),
            ],
            vec![own, ("sec-fetch-site", "cross-site")],
            vec![own, ("sec-fetch-site", "same-site")],
        ] {
            assert!(refused(&headers(&fails), 8080).is_some(), "{fails:?}");
        }
        assert_eq!(refused(&headers(&[("host", "127.0.0.1")]), 80), None);
    }

    #[test]
    fn the_token_opens_its_own_folder_only() {
        assert_eq!(within("abc", "/abc/"), Some(""));
        assert_eq!(within("abc", "/abc/ask"), Some("ask"));
        for wrong in [
            "/",
            "/abc",
            "/abd/ask",
            "/ab/ask",
            "/abcd/ask",
            "abc/ask",
            "//abc/",
        ] {
            assert_eq!(within("abc", wrong), None, "{wrong}");
        }
    }
}

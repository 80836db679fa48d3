//! Responses and their common headers.

use http_body_util::Full;
use hyper::body::Bytes;
use hyper::header::{self, HeaderName, HeaderValue};
use hyper::{Response, StatusCode};

pub type HttpResponse = Response<Full<Bytes>>;

/// Headers that forbid guessing the type, caching, and framing or use by other sites.
const ALWAYS: [(HeaderName, &str); 6] = [
    (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
    (header::REFERRER_POLICY, "no-referrer"),
    (header::CACHE_CONTROL, "no-store"),
    (HeaderName::from_static("cross-origin-opener-policy"), "same-origin"),
    (HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
    (header::CONTENT_SECURITY_POLICY, "default-src 'none'; frame-ancestors 'none'"),
];

/// A response with bytes of a media type.
pub fn bytes(kind: &'static str, bytes: Bytes) -> HttpResponse {
    let mut answer = Response::new(Full::new(bytes));
    let headers = answer.headers_mut();
    headers.insert(header::CONTENT_TYPE, HeaderValue::from_static(kind));
    ALWAYS.into_iter().for_each(|(name, value)| drop(headers.insert(name, HeaderValue::from_static(value))));
    answer
}

/// A response with one line that says why the request failed.
pub fn refusal(status: StatusCode, why: &str) -> HttpResponse {
    let line: String = why.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
    let mut answer = bytes("text/plain; charset=utf-8", Bytes::from(line + "\n"));
    *answer.status_mut() = status;
    answer
}

/// Sets a header.
pub fn with(mut answer: HttpResponse, name: HeaderName, value: HeaderValue) -> HttpResponse {
    answer.headers_mut().insert(name, value);
    answer
}

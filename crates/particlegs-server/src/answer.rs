//! Responses and their common headers.

use http_body_util::Full;
use hyper::body::Bytes;
use hyper::header::{self, HeaderMap, HeaderName, HeaderValue};
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

/// A file, or the part of it that the request's header `Range` names. Several ranges at once are not served: the answer is
/// the whole file, as the protocol allows.
pub fn part(file: &Bytes, headers: &HeaderMap) -> HttpResponse {
    const KIND: &str = "application/octet-stream";
    let requested_range = headers.get(header::RANGE).and_then(|v| v.to_str().ok()).and_then(byte_range);
    let length = file.len() as u64;
    let answer = match requested_range.map(|range| range(length)) {
        None => bytes(KIND, file.clone()),
        Some((first, end)) if first < end => {
            let mut answer = bytes(KIND, file.slice(first as usize..end as usize));
            *answer.status_mut() = StatusCode::PARTIAL_CONTENT;
            content_range(answer, &format!("bytes {first}-{}/{length}", end - 1))
        }
        Some(_) => {
            let answer = refusal(StatusCode::RANGE_NOT_SATISFIABLE, &format!("the file has {length} bytes"));
            content_range(answer, &format!("bytes */{length}"))
        }
    };
    with(answer, header::ACCEPT_RANGES, HeaderValue::from_static("bytes"))
}

fn content_range(answer: HttpResponse, value: &str) -> HttpResponse {
    match HeaderValue::from_str(value) {
        Ok(value) => with(answer, header::CONTENT_RANGE, value),
        Err(_) => answer,
    }
}

/// The first byte and the end of a range such as `bytes=0-99`, `bytes=100-` or `bytes=-10`, by the length of the file;
/// `None` if the text is something else, which the protocol tells servers to ignore.
fn byte_range(text: &str) -> Option<impl Fn(u64) -> (u64, u64)> {
    let (first, last) = text.strip_prefix("bytes=")?.split_once('-')?;
    let number = |text: &str| if text.is_empty() { Some(None) } else { text.trim().parse::<u64>().ok().map(Some) };
    let (first, last) = (number(first)?, number(last)?);
    let ordered = match (first, last) {
        (Some(first), Some(last)) => first <= last,
        (None, None) => false,
        _ => true,
    };
    ordered.then_some(move |length: u64| match (first, last) {
        (Some(first), last) => (first, last.map_or(length, |last| last.saturating_add(1)).min(length)),
        (None, last) => (length.saturating_sub(last.unwrap_or(0)), length),
    })
}

/// A response with one line that says why the request failed.
pub fn refusal(status: StatusCode, why: &str) -> HttpResponse {
    // Words of the request may be in it, and must not break the line.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_as_the_protocol_has_them() {
        let file = Bytes::from_static(b"0123456789");
        let answer = |range: &'static str| {
            let headers = HeaderMap::from_iter([(header::RANGE, HeaderValue::from_static(range))]);
            let answer = part(&file, &headers);
            let range = answer.headers().get(header::CONTENT_RANGE).map(|v| v.to_str().unwrap_or("").to_string());
            (answer.status().as_u16(), range.unwrap_or_default())
        };
        let is = |range, status, text: &str| assert_eq!(answer(range), (status, text.to_string()), "{range}");
        is("bytes=0-3", 206, "bytes 0-3/10");
        is("bytes=8-", 206, "bytes 8-9/10");
        is("bytes=-3", 206, "bytes 7-9/10");
        is("bytes=-30", 206, "bytes 0-9/10");
        is("bytes=9-18446744073709551615", 206, "bytes 9-9/10");
        is("bytes=10-12", 416, "bytes */10");
        is("bytes=-0", 416, "bytes */10");
        for ignored in ["bytes=3-1", "bytes=-", "bytes=0-1,4-5", "bytes=x-2", "lines=0-3", "bytes=-1-2"] {
            is(ignored, 200, "");
        }
    }
}

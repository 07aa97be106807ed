//! A recording, whole or a range of it, in pieces.

use super::body::{Body, Pieces};
use hyper::http::{HeaderValue, Method, Response, StatusCode, header, request::Parts};
use std::ops::Range;
use std::path::Path;
use storage::{Reader, is_url};

/// The file or the object at `path`, if it is one.
pub(super) fn open(path: &Path) -> Option<Reader> {
    let is_one = is_url(path) || path.is_file();
    is_one.then(|| Reader::open(path).ok())?
}

/// The answer to a request for a file.
#[expect(clippy::unnecessary_wraps, reason = "as its neighbours")]
pub(super) fn answer(mut file: Reader, parts: &Parts) -> Option<Response<Body>> {
    let size = file.size();
    let asked = match parts.headers.get(header::RANGE) {
        Some(value) => match value.to_str().ok().and_then(|value| value.strip_prefix("bytes=")) {
            // several ranges may be answered by the whole
            Some(one) if !one.contains(',') => range(one, size),
            _ => Some(0..size),
        },
        None => Some(0..size),
    };
    let mut response = Response::new(Body::empty());
    let headers = response.headers_mut();
    headers.insert(header::CONTENT_TYPE, HeaderValue::from_static("application/vnd.mcap"));
    headers.insert(header::ACCEPT_RANGES, HeaderValue::from_static("bytes"));
    let Some(range) = asked else {
        headers.insert(header::CONTENT_RANGE, value(&format!("bytes */{size}")));
        *response.status_mut() = StatusCode::RANGE_NOT_SATISFIABLE;
        return Some(response);
    };
    headers.insert(header::CONTENT_LENGTH, HeaderValue::from(range.end - range.start));
    if range != (0..size) || parts.headers.contains_key(header::RANGE) {
        let (first, last) = (range.start, range.end.saturating_sub(1));
        headers.insert(header::CONTENT_RANGE, value(&format!("bytes {first}-{last}/{size}")));
        *response.status_mut() = StatusCode::PARTIAL_CONTENT;
    }
    if parts.method != Method::HEAD {
        file.expect(range.clone(), false);
        *response.body_mut() = Body::Pieces(Pieces::new(file, range));
    }
    Some(response)
}

/// Numbers and signs are always fit for a header.
fn value(text: &str) -> HeaderValue {
    HeaderValue::from_str(text).unwrap_or_else(|_| HeaderValue::from_static(""))
}

/// The bytes of `FIRST-LAST`, `FIRST-` or `-COUNT`; none if there are none.
fn range(asked: &str, size: u64) -> Option<Range<u64>> {
    let (first, last) = asked.split_once('-')?;
    let number =
        |text: &str| text.bytes().all(|byte| byte.is_ascii_digit()).then(|| text.parse::<u64>().ok())?;
    let range = match (first, last) {
        ("", count) => size.saturating_sub(number(count)?)..size,
        (first, "") => number(first)?..size,
        (first, last) => number(first)?..number(last)?.saturating_add(1).min(size),
    };
    (range.start < range.end).then_some(range)
}

#[cfg(test)]
mod tests {
    use super::range;

    #[test]
    fn ranges_are_those_of_rfc_9110() {
        for (asked, expected) in [
            ("0-0", Some(0..1)),
            ("2-4", Some(2..5)),
            ("2-", Some(2..10)),
            ("9-99", Some(9..10)),
            ("-3", Some(7..10)),
            ("-99", Some(0..10)),
            ("0-18446744073709551615", Some(0..10)),
            ("10-", None),
            ("5-4", None),
            ("-0", None),
            ("-", None),
            ("a-b", None),
            ("+1-2", None),
            ("1", None),
            ("0-18446744073709551616", None),
        ] {
            assert_eq!(range(asked, 10), expected, "{asked}");
        }
    }
}

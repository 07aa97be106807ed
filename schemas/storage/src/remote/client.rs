//! The HTTP client of all stores. It bounds redirects, the length of answers, and the texts of errors.
//!
//! `object_store` takes whole answers into memory, but for objects, follows redirects with the headers that it was given, and prints
//! the bodies of errors. All its requests go through here.

use super::{options, xml};
use crate::secrets::Secrets;
use futures_util::TryStreamExt as _;
use object_store::client::{
    HttpClient, HttpConnector, HttpError, HttpErrorKind, HttpRequest, HttpResponse, HttpResponseBody,
    HttpService,
};
use object_store::{ClientOptions, HeaderMap};
use reqwest::header::{CONTENT_LENGTH, CONTENT_RANGE, HeaderName, LOCATION, RANGE};
use reqwest::{Method, StatusCode, Url};
use std::future::Future;
use std::pin::Pin;
use std::sync::{Arc, Mutex, PoisonError};

/// Bytes of the body of an error that are read.
const MOST_ERROR_BYTES: usize = 64 << 10;

/// Bytes of any other answer but an object's: Azure's pages of 5,000 names of 1,024 characters fit.
const MOST_ANSWER_BYTES: usize = 32 << 20;

/// Characters of an error's body that are told.
const MOST_TOLD: usize = 300;

/// Names of skipped objects that are kept.
const MOST_SKIPPED: usize = 100;

/// Headers of requests whose values are secrets.
const SECRET_HEADERS: [&str; 10] = [
    "authorization",
    "proxy-authorization",
    "cookie",
    "x-amz-security-token",
    "x-amz-s3session-token",
    "x-amz-server-side-encryption-customer-key",
    "x-aws-ec2-metadata-token",
    "x-ms-encryption-key",
    "x-ms-copy-source-authorization",
    "x-goog-encryption-key",
];

/// Makes clients.
#[derive(Debug, Clone, Default)]
pub(super) struct Connector {
    /// No keys are sent, so that another host may answer.
    pub(super) is_public: bool,
    pub(super) skipped: Arc<Mutex<Skips>>,
}

/// Objects of listings whose names are no plain paths.
#[derive(Debug, Default)]
pub(super) struct Skips {
    /// The first of them.
    pub(super) names: Vec<String>,
    pub(super) count: u64,
}

/// An answer of a server that is not accepted.
#[derive(Debug, thiserror::Error)]
enum Refused {
    #[error(
        "the store sends us to another host, {0}, and keys are not sent there; if that is where the objects are, name it \
         (AWS_REGION, or AWS_ENDPOINT_URL and its like)"
    )]
    Elsewhere(String),
    #[error("the server sends us on and on, or from https:// to http://, to {0}")]
    Redirects(String),
    #[error("the answer is larger than {0} bytes, the most that is read of it")]
    Large(u64),
    // as `object_store` says it
    #[error("received non-partial response when range requested")]
    Whole,
    #[error("the answer is of bytes that no object has: {0}")]
    Range(String),
}

impl HttpConnector for Connector {
    fn connect(&self, options: &ClientOptions) -> object_store::Result<HttpClient> {
        let client = options::client(options, self.is_public)?;
        Ok(HttpClient::new(Guard { client, connector: self.clone() }))
    }
}

/// A client that believes no server.
#[derive(Debug)]
struct Guard {
    client: reqwest::Client,
    connector: Connector,
}

impl HttpService for Guard {
    // as `async fn call(&self, request: HttpRequest)` is written out
    fn call<'s, 'f>(
        &'s self,
        request: HttpRequest,
    ) -> Pin<Box<dyn Future<Output = Result<HttpResponse, HttpError>> + Send + 'f>>
    where
        's: 'f,
        Self: 'f,
    {
        Box::pin(self.answer(request))
    }
}

impl Guard {
    async fn answer(&self, request: HttpRequest) -> Result<HttpResponse, HttpError> {
        let secrets = secrets_of(request.headers());
        let range = request.headers().get(RANGE).and_then(|range| length_of(range.to_str().ok()?));
        let is_listing = is_listing(request.method(), request.uri().query().unwrap_or_default());
        let (mut parts, body) = HttpService::call(&self.client, request).await?.into_parts();
        if parts.status.is_redirection()
            && let Some(to) = parts.headers.get(LOCATION)
        {
            let host = to.to_str().ok().and_then(|to| Some(Url::parse(to).ok()?.host_str()?.to_owned()));
            let host = host.unwrap_or_else(|| "which cannot be read".to_owned());
            let why =
                if self.connector.is_public { Refused::Redirects(host) } else { Refused::Elsewhere(host) };
            return Err(refused(why));
        }
        if !parts.status.is_success() {
            let (bytes, is_whole) = collected(body, MOST_ERROR_BYTES).await?;
            let told = told(&String::from_utf8_lossy(&bytes), is_whole, &secrets);
            return Ok(HttpResponse::from_parts(parts, told.into()));
        }
        if parts.status == StatusCode::PARTIAL_CONTENT {
            check_range(&parts.headers, range)?;
            // whoever asked counts the bytes
            return Ok(HttpResponse::from_parts(parts, body));
        }
        if range.is_some() {
            // nothing of it is read
            return Err(refused(Refused::Whole));
        }
        let (mut bytes, is_whole) = collected(body, MOST_ANSWER_BYTES).await?;
        if !is_whole {
            return Err(refused(Refused::Large(MOST_ANSWER_BYTES as u64)));
        }
        if is_listing {
            let mut skipped = self.connector.skipped.lock().unwrap_or_else(PoisonError::into_inner);
            bytes = plain_names_of(bytes, &mut skipped);
            parts.headers.remove(CONTENT_LENGTH);
        }
        Ok(HttpResponse::from_parts(parts, bytes.into()))
    }
}

fn refused(why: Refused) -> HttpError {
    // a kind that is not tried again
    HttpError::new(HttpErrorKind::Unknown, why)
}

/// As many bytes of `body` as may be, and whether that is all.
async fn collected(body: HttpResponseBody, most: usize) -> Result<(Vec<u8>, bool), HttpError> {
    let (mut pieces, mut bytes) = (body.bytes_stream(), Vec::new());
    while let Some(piece) = pieces.try_next().await? {
        let room = most - bytes.len();
        bytes.extend_from_slice(piece.get(..room).unwrap_or(&piece));
        if piece.len() > room {
            return Ok((bytes, false));
        }
    }
    Ok((bytes, true))
}

/// Secrets that an answer may hold: those of the environment, and of the headers of its request.
fn secrets_of(headers: &HeaderMap) -> Secrets {
    let mut secrets = Secrets::of_environment();
    for name in SECRET_HEADERS {
        headers
            .get_all(name)
            .iter()
            .filter_map(|value| value.to_str().ok())
            .for_each(|value| secrets.add(value));
    }
    secrets
}

/// The number of bytes that `bytes=FROM-TO` or `bytes=-COUNT` asks for.
fn length_of(range: &str) -> Option<u64> {
    let (from, to) = range.strip_prefix("bytes=")?.split_once('-')?;
    let to: u64 = to.parse().ok()?;
    if from.is_empty() { Some(to) } else { to.checked_sub(from.parse().ok()?)?.checked_add(1) }
}

/// Refuses a part that is longer than its request, or lies where no object reaches.
fn check_range(headers: &HeaderMap, asked: Option<u64>) -> Result<(), HttpError> {
    let text = |name: HeaderName| headers.get(name).and_then(|value| value.to_str().ok());
    let length = text(CONTENT_LENGTH).and_then(|length| length.parse::<u64>().ok());
    if let (Some(asked), Some(length)) = (asked, length)
        && length > asked
    {
        return Err(refused(Refused::Large(asked)));
    }
    let most = u64::MAX.to_string();
    match text(CONTENT_RANGE) {
        Some(range) if range.contains(&most) => Err(refused(Refused::Range(range.to_owned()))),
        _ => Ok(()),
    }
}

/// The body of an error: its code and message if it has them, in one line, without secrets.
fn told(body: &str, is_whole: bool, secrets: &Secrets) -> String {
    let shown = secrets.mask(body);
    // where it was cut half a secret may stand
    let end = if is_whole { shown.len() } else { shown.floor_char_boundary(shown.len() / 2) };
    let shown = &shown[..end];
    let parts = ["Code", "Message"].map(|name| xml::text_of(shown, name));
    let text = match parts {
        [Some(code), Some(message)] => format!("{code}: {message}"),
        [Some(only), None] | [None, Some(only)] => only,
        [None, None] => shown.to_owned(),
    };
    // resolving entities may have made one whole
    let text = secrets.mask(&text.split_whitespace().collect::<Vec<_>>().join(" "));
    let cut = text.char_indices().nth(MOST_TOLD).map_or(text.len(), |(at, _)| at);
    let more = if cut < text.len() { "…" } else { "" };
    let rest = if is_whole { "" } else { " (the body is larger than 64 kB; the rest of it was not read)" };
    format!("{}{more}{rest}", &text[..cut])
}

/// True of a request whose answer names objects.
fn is_listing(method: &Method, query: &str) -> bool {
    let is_of = |word: &str| query.split('&').any(|found| found == word);
    method.as_str() == "PROPFIND" || is_of("list-type=2") || is_of("comp=list")
}

/// A listing without the objects whose names are no plain paths. `object_store` refuses the whole listing for any such
/// name that this misses.
fn plain_names_of(bytes: Vec<u8>, skipped: &mut Skips) -> Vec<u8> {
    let Ok(text) = str::from_utf8(&bytes) else { return bytes };
    let (mut kept, mut from) = (String::new(), 0);
    for (item, name) in [("Contents", "Key"), ("Blob", "Name"), ("response", "href")] {
        for found in xml::elements(text, item) {
            let Some(key) = xml::text_of(&text[found.content], name) else { continue };
            let is_plain = if name == "href" { is_plain_reference(&key) } else { is_plain(&key) };
            if !is_plain {
                kept.push_str(&text[from..found.all.start]);
                from = found.all.end;
                skipped.count += 1;
                if skipped.names.len() < MOST_SKIPPED {
                    skipped.names.push(key.chars().take(MOST_TOLD).collect());
                }
            }
        }
    }
    if from == 0 {
        return bytes;
    }
    kept.push_str(&text[from..]);
    kept.into_bytes()
}

/// True of a key that is a plain path: relative, of whole names, without `.`, `..` and control characters. It may end like a folder.
fn is_plain(key: &str) -> bool {
    let names = key.strip_suffix('/').unwrap_or(key);
    let is_name = |name: &str| !matches!(name, "" | "." | "..") && !name.contains(char::is_control);
    names.split('/').all(is_name)
}

/// The same of the address that `WebDAV` gives: a path of the server or a whole URL, in either case percent-encoded.
fn is_plain_reference(href: &str) -> bool {
    let path =
        href.split_once("://").map_or(href, |(_, rest)| rest.split_once('/').map_or("", |(_, path)| path));
    let path = path.strip_prefix('/').unwrap_or(path);
    let lower = path.to_ascii_lowercase();
    path.is_empty() || (is_plain(path) && !lower.contains("%2f") && is_plain(&lower.replace("%2e", ".")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_an_error_its_code_and_message_are_told_without_what_was_sent() {
        let mut secrets = Secrets::default();
        secrets.add("0123456789abcdef");
        let tell = |body: &str, is_whole| told(body, is_whole, &secrets);
        let body =
            "<Error><Code>Denied</Code><Message>not\n0123456789abcdef &lt;x&gt;</Message><T>y</T></Error>";
        assert_eq!(tell(body, true), "Denied: not [hidden] <x>");
        assert_eq!(tell("no\n such  page", true), "no such page");
        assert_eq!(tell(&"x".repeat(1000), true), format!("{}…", "x".repeat(MOST_TOLD)));
        let cut = format!("{}0123456789", "x".repeat(20));
        assert!(
            tell(&cut, false).starts_with("xxxxxxxxxxxxxxx (the body is larger"),
            "{}",
            tell(&cut, false)
        );
        // an entity within an entity within a secret
        assert_eq!(tell("<Code>0123456789&amp;#97;bcdef</Code>", true), "[hidden]");
    }

    #[test]
    fn names_that_are_no_plain_paths_are_left_out_of_a_listing() {
        let names = [
            "a/b.mcap",
            "../x.mcap",
            "/x",
            "a//b",
            "a/./b",
            "a/..",
            "b\u{7}",
            "c/",
            "x&amp;y",
            "..",
            "...",
            "",
        ];
        let items: String =
            names.map(|name| format!("<Contents><Key>{name}</Key><Size>1</Size></Contents>")).concat();
        let mut skipped = Skips::default();
        let found = plain_names_of(format!("<L>{items}</L>").into_bytes(), &mut skipped);
        let found = String::from_utf8(found).expect("text");
        let kept: Vec<_> = xml::elements(&found, "Key").map(|key| &found[key.content]).collect();
        assert_eq!(kept, ["a/b.mcap", "c/", "x&amp;y", "..."]);
        assert_eq!((skipped.count, skipped.names.len()), (8, 8));
        for (href, is_so) in [
            ("/a/b.mcap", true),
            ("http://h/a/", true),
            ("/", true),
            ("/a%2f..%2fb", false),
            ("/a/%2E%2e/b", false),
            ("//x", false),
        ] {
            assert_eq!(is_plain_reference(href), is_so, "{href}");
        }
    }

    #[test]
    fn more_than_was_asked_for_is_refused_by_its_headers() {
        assert_eq!(
            ["bytes=0-9", "bytes=-7", "bytes=5-", "x"].map(length_of),
            [Some(10), Some(7), None, None]
        );
        let headers = |range: &'static str, length: &'static str| {
            HeaderMap::from_iter([
                (CONTENT_RANGE, range.parse().unwrap()),
                (CONTENT_LENGTH, length.parse().unwrap()),
            ])
        };
        assert!(check_range(&headers("bytes 0-9/20", "10"), Some(10)).is_ok());
        let large = check_range(&headers("bytes 0-9/20", "11"), Some(10)).expect_err("larger");
        assert!(large.to_string().contains("larger than 10 bytes"), "{large}");
        check_range(&headers("bytes 0-18446744073709551615/20", "10"), Some(10)).expect_err("no such bytes");
    }
}

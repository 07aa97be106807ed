//! A server of objects over HTTP on loopback, as S3 and web servers answer, that counts requests and makes faults.

use crate::harness::{Place, Running};
use std::collections::{BTreeMap, VecDeque};
use std::fmt::Write as _;
use std::io::{BufRead as _, BufReader, Write as _};
use std::net::{TcpListener, TcpStream};
use std::ops::Range;
use std::path::Path;
use std::sync::{Arc, Mutex};

/// What happens to one request.
#[derive(Debug, Clone, Copy)]
pub(super) enum Fault {
    None,
    /// This answer, and no body that is asked for.
    Status(u16, &'static str),
    /// The connection ends after this many bytes of the body.
    Cut(usize),
    /// The object is another one from now on.
    Change,
}

/// A request that was answered with bytes of an object.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Asked {
    pub(super) key: String,
    pub(super) bytes: Range<u64>,
}

#[derive(Default)]
struct State {
    /// By bucket and key; and how often it was changed.
    objects: BTreeMap<String, (Vec<u8>, u64)>,
    asked: Vec<Asked>,
    /// All requests, whatever became of them.
    requests: u64,
    faults: VecDeque<Fault>,
    /// What happens when there are no more of them.
    always: Option<Fault>,
    has_no_ranges: bool,
}

/// It ends with the test's process.
pub(super) struct Server {
    pub(super) address: String,
    state: Arc<Mutex<State>>,
}

impl Server {
    pub(super) fn start() -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap().to_string();
        let state = Arc::<Mutex<State>>::default();
        let shared = Arc::clone(&state);
        std::thread::spawn(move || {
            for stream in listener.incoming().map_while(Result::ok) {
                let state = Arc::clone(&shared);
                std::thread::spawn(move || serve(&stream, &state));
            }
        });
        Self { address, state }
    }

    /// Has the file `path` as `bucket/key`.
    pub(super) fn put(&self, key: &str, path: &Path) {
        let bytes = std::fs::read(path).unwrap();
        self.state.lock().unwrap().objects.insert(format!("/{key}"), (bytes, 0));
    }

    /// What happens to the next requests, one after the other.
    pub(super) fn faults(&self, faults: impl IntoIterator<Item = Fault>) {
        self.state.lock().unwrap().faults = faults.into_iter().collect();
    }

    /// What happens to every request from now on.
    pub(super) fn always(&self, fault: Option<Fault>) {
        self.state.lock().unwrap().always = fault;
    }

    /// Sends only whole objects from now on.
    pub(super) fn without_ranges(&self) {
        self.state.lock().unwrap().has_no_ranges = true;
    }

    /// Which parts were sent since the last call.
    pub(super) fn asked(&self) -> Vec<Asked> {
        let mut state = self.state.lock().unwrap();
        state.requests = 0;
        std::mem::take(&mut state.asked)
    }

    /// How many requests came since then.
    pub(super) fn requests(&self) -> u64 {
        self.state.lock().unwrap().requests
    }

    /// Starts `beadline` with these words, for which this is S3.
    pub(super) fn start_s3(&self, place: &Place, words: &str) -> Running {
        let mut command = place.command(words.split_whitespace());
        command
            .env("AWS_ENDPOINT_URL", format!("http://{}", self.address))
            .env("AWS_ALLOW_HTTP", "true")
            .env("AWS_ACCESS_KEY_ID", "tester")
            .env("AWS_SECRET_ACCESS_KEY", "secret")
            .env("AWS_REGION", "us-east-1");
        Running::start(words, command)
    }
}

fn serve(stream: &TcpStream, state: &Mutex<State>) {
    stream.set_nodelay(true).unwrap();
    let mut lines = BufReader::new(stream).lines().map_while(Result::ok);
    while let Some(first) = lines.next() {
        let headers: BTreeMap<String, String> = lines
            .by_ref()
            .take_while(|line| !line.is_empty())
            .filter_map(|line| line.split_once(": ").map(|(name, value)| (name.to_lowercase(), value.into())))
            .collect();
        let mut words = first.split(' ');
        let (method, target) = (words.next().unwrap(), words.next().unwrap_or_default());
        if answer(stream, state, method, target, &headers).is_none() {
            return;
        }
    }
}

/// Answers a request; none if the connection ends.
fn answer(
    stream: &TcpStream,
    state: &Mutex<State>,
    method: &str,
    target: &str,
    headers: &BTreeMap<String, String>,
) -> Option<()> {
    let mut state = state.lock().unwrap();
    state.requests += 1;
    let fault = state.faults.pop_front().or(state.always).unwrap_or(Fault::None);
    let (path, query) = target.split_once('?').unwrap_or((target, ""));
    if let Fault::Status(status, body) = fault {
        return send(stream, status, "", body.as_bytes(), body.len());
    }
    if let Fault::Change = fault {
        state.objects.get_mut(path).unwrap().1 += 1;
    }
    if query.contains("list-type=2") {
        let listed = listing(&state, path, query);
        return send(stream, 200, "Content-Type: application/xml\r\n", listed.as_bytes(), listed.len());
    }
    let Some((bytes, changes)) = state.objects.get(path) else {
        let body = b"<Error><Code>NoSuchKey</Code></Error>";
        return send(stream, 404, "", body, body.len());
    };
    let tag = format!("\"{changes}\"");
    if headers.get("if-match").is_some_and(|wanted| *wanted != tag) {
        return send(stream, 412, "", b"", 0);
    }
    let size = bytes.len() as u64;
    let wanted = headers.get("range").filter(|_| !state.has_no_ranges);
    let range = wanted.map_or(0..size, |range| part(range, size));
    if range.is_empty() && wanted.is_some() {
        return send(stream, 416, "", b"", 0);
    }
    let (status, place) = match wanted {
        Some(_) => (206, format!("Content-Range: bytes {}-{}/{size}\r\n", range.start, range.end - 1)),
        None => (200, String::new()),
    };
    let head = format!("ETag: {tag}\r\nLast-Modified: Mon, 23 Nov 2026 10:00:00 GMT\r\n{place}");
    let place = |at: u64| usize::try_from(at).unwrap();
    let body = bytes[place(range.start)..place(range.end)].to_vec();
    let end = if let Fault::Cut(end) = fault { end.min(body.len()) } else { body.len() };
    let sent = if method == "HEAD" { 0 } else { end };
    state.asked.push(Asked { key: path.to_owned(), bytes: range });
    drop(state);
    send(stream, status, &head, &body[..sent], body.len())?;
    (end == body.len()).then_some(())
}

fn part(range: &str, size: u64) -> Range<u64> {
    let (from, to) = range.strip_prefix("bytes=").unwrap().split_once('-').unwrap();
    match (from.parse::<u64>(), to.parse::<u64>()) {
        (Ok(from), Ok(to)) => from..(to + 1).min(size),
        (Ok(from), Err(_)) => from..size,
        (Err(_), Ok(last)) => size.saturating_sub(last)..size,
        (Err(_), Err(_)) => 0..size,
    }
}

/// The objects of a bucket that have a prefix, as S3 lists them.
fn listing(state: &State, bucket: &str, query: &str) -> String {
    let prefix = query.split('&').find_map(|word| word.strip_prefix("prefix=")).unwrap_or_default();
    let prefix = prefix.replace("%2F", "/");
    let bucket = format!("{}/", bucket.trim_end_matches('/'));
    let mut text = String::from("<ListBucketResult><IsTruncated>false</IsTruncated>");
    for (path, (bytes, tag)) in &state.objects {
        if let Some(key) = path.strip_prefix(&bucket).filter(|key| key.starts_with(&prefix)) {
            write!(
                text,
                "<Contents><Key>{key}</Key><LastModified>2026-11-23T10:00:00.000Z</LastModified>\
                 <ETag>\"{tag}\"</ETag><Size>{}</Size></Contents>",
                bytes.len()
            )
            .unwrap();
        }
    }
    text + "</ListBucketResult>"
}

/// Sends `body` as the beginning of one of `length` bytes.
fn send(mut stream: &TcpStream, status: u16, head: &str, body: &[u8], length: usize) -> Option<()> {
    let head = format!("HTTP/1.1 {status} OK\r\nContent-Length: {length}\r\n{head}\r\n");
    stream.write_all(&[head.as_bytes(), body].concat()).ok()
}

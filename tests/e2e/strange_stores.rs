//! Stores that do what no honest store does: echo what they are sent, send us elsewhere, answer without end, name files of ours, say
//! nothing.

use crate::harness::{Ended, Place, Running, SILENCE, wait_until};
use std::collections::BTreeMap;
use std::fs;
use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::Instant;

const TOKEN: &str = "FwoGZXIvYXdzEBYaDK/t0+Session==&'Token";
const SECRET: &str = "wJalrXUtnFEMI/K7MDENG+bPxRfiCYKEY";

/// More than any message needs, and less than what a server that does not end sends in the time of a test.
const MOST_ERROR_BYTES: u64 = 16 << 20;
const MOST_LISTED_BYTES: u64 = 64 << 20;

/// The purpose of a request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Op {
    Get,
    Head,
    List,
    Begin,
    Part,
    Parts,
    Complete,
    Abort,
}

#[derive(Debug, Clone)]
struct Asked {
    op: Op,
    target: String,
    headers: BTreeMap<String, String>,
}

enum Answer {
    /// Status, further headers, body.
    Text(u16, String, Vec<u8>),
    /// The same, and the last part of the body again and again.
    Endless(u16, String, &'static str),
    /// The connection stays open, and that is all.
    Silence,
}

fn text(status: u16, body: &str) -> Answer {
    Answer::Text(status, String::new(), body.into())
}

/// A server on loopback; it ends with the test's process.
struct Stranger {
    port: u16,
    asked: Arc<Mutex<Vec<Asked>>>,
    sent_bytes: Arc<AtomicU64>,
}

impl Stranger {
    fn start(answer: impl Fn(&Asked) -> Answer + Send + Sync + 'static) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let stranger = Self {
            port: listener.local_addr().unwrap().port(),
            asked: Arc::default(),
            sent_bytes: Arc::default(),
        };
        let (asked, sent_bytes) = (Arc::clone(&stranger.asked), Arc::clone(&stranger.sent_bytes));
        let answer = Arc::new(answer);
        thread::spawn(move || {
            for stream in listener.incoming().map_while(Result::ok) {
                let (asked, sent_bytes, answer) = (asked.clone(), sent_bytes.clone(), answer.clone());
                // a client that goes away is its own affair
                thread::spawn(move || serve(&stream, &asked, &sent_bytes, &*answer));
            }
        });
        stranger
    }

    /// `beadline WORDS`, for which this is S3.
    fn start_s3(&self, place: &Place, words: &str) -> Running {
        // a shell that runs tests in the background has them ignore SIGINT
        let words_of_env = ["--default-signal=INT", env!("CARGO_BIN_EXE_beadline")];
        let mut command = place.foreign("env", words_of_env);
        command
            .args(words.split_whitespace())
            .env("AWS_ENDPOINT_URL", format!("http://127.0.0.1:{}", self.port))
            .env("AWS_ALLOW_HTTP", "true")
            .env("AWS_ACCESS_KEY_ID", "AKIATESTER")
            .env("AWS_SECRET_ACCESS_KEY", SECRET)
            .env("AWS_SESSION_TOKEN", TOKEN)
            .env("AWS_REGION", "us-east-1")
            .env("RUST_LOG", "trace");
        Running::start(words, command)
    }

    fn run_s3(&self, place: &Place, words: &str) -> Ended {
        self.start_s3(place, words).wait()
    }

    fn was_asked(&self, op: Op) -> bool {
        self.asked.lock().unwrap().iter().any(|asked| asked.op == op)
    }
}

fn serve(
    mut stream: &TcpStream,
    asked: &Mutex<Vec<Asked>>,
    sent_bytes: &AtomicU64,
    answer: &dyn Fn(&Asked) -> Answer,
) -> Option<()> {
    let mut reader = BufReader::new(stream);
    loop {
        let mut lines = reader.by_ref().lines().map_while(Result::ok);
        let first = lines.next()?;
        let lines = lines.take_while(|line| !line.is_empty());
        let headers: BTreeMap<String, String> = lines
            .filter_map(|line| line.split_once(": ").map(|(name, value)| (name.to_lowercase(), value.into())))
            .collect();
        let length = headers.get("content-length").map_or(0, |length| length.parse().unwrap());
        std::io::copy(&mut reader.by_ref().take(length), &mut std::io::sink()).ok()?;
        let (method, target) = first.split_once(' ')?;
        let target = target.split(' ').next()?.to_owned();
        let op = match method {
            "GET" if target.contains("list-type=2") => Op::List,
            "GET" if target.contains("uploadId=") => Op::Parts,
            "GET" => Op::Get,
            "HEAD" => Op::Head,
            "POST" if target.contains("uploadId=") => Op::Complete,
            "POST" => Op::Begin,
            "PUT" => Op::Part,
            _ => Op::Abort,
        };
        let request = Asked { op, target, headers };
        asked.lock().unwrap().push(request.clone());
        match answer(&request) {
            Answer::Text(status, headers, body) => {
                let length = body.len();
                let head = format!("HTTP/1.1 {status} X\r\nContent-Length: {length}\r\n{headers}\r\n");
                let body = if op == Op::Head { Vec::new() } else { body };
                stream.write_all(&[head.as_bytes(), &body].concat()).ok()?;
            }
            Answer::Endless(status, headers, again) => {
                let is_chunked = !headers.contains("Content-Length");
                let chunked = if is_chunked { "Transfer-Encoding: chunked\r\n" } else { "" };
                stream.write_all(format!("HTTP/1.1 {status} X\r\n{chunked}{headers}\r\n").as_bytes()).ok()?;
                let again = again.repeat((64 << 10) / again.len());
                let chunk =
                    if is_chunked { format!("{:x}\r\n{again}\r\n", again.len()) } else { again.clone() };
                loop {
                    stream.write_all(chunk.as_bytes()).ok()?;
                    sent_bytes.fetch_add(again.len() as u64, Ordering::Relaxed);
                }
            }
            Answer::Silence => loop {
                thread::park();
            },
        }
    }
}

/// The answers of an honest store when there is no object and a part is sent.
fn honest(asked: &Asked) -> Answer {
    match asked.op {
        Op::Get | Op::Head => text(404, "<Error><Code>NoSuchKey</Code></Error>"),
        Op::List => text(200, "<ListBucketResult></ListBucketResult>"),
        Op::Begin => text(200, "<R><UploadId>the-id</UploadId></R>"),
        Op::Part => Answer::Text(200, "ETag: \"1\"\r\n".into(), Vec::new()),
        Op::Parts => text(200, "<R><IsTruncated>false</IsTruncated></R>"),
        Op::Complete => text(200, "<R><ETag>\"1\"</ETag></R>"),
        Op::Abort => text(204, ""),
    }
}

/// A place with a small recording.
fn place_with_recording() -> Place {
    let place = Place::new();
    place.run("run --preset striker-3g --duration 1e-3 --record-every-steps 100 --out run.mcap").exits(0);
    place
}

fn percent(text: &str) -> String {
    text.bytes().fold(String::new(), |escaped, byte| format!("{escaped}%{byte:02X}"))
}

#[test]
fn no_message_has_a_secret_that_a_store_echoes() {
    let place = place_with_recording();
    let upload = "upload run.mcap s3://bucket/run.mcap";
    let (info, ls) = ("info s3://bucket/run.mcap", "ls s3://bucket/");
    for (op, words) in [
        (Op::Get, info),
        (Op::Get, "info s3://bucket/run.mcap --json"),
        (Op::List, ls),
        (Op::List, "catalog s3://bucket --out catalog.csv --json"),
        (Op::Head, upload),
        (Op::Begin, upload),
        (Op::Part, upload),
        (Op::Complete, "upload run.mcap s3://bucket/run.mcap --json"),
        // the upload that the one before has left
        (Op::Parts, upload),
        (Op::Abort, "upload run.mcap s3://bucket/other.mcap"),
        (
            Op::Begin,
            "run --preset striker-3g --duration 1e-4 --out s3://bucket/new.mcap --spool spool --json",
        ),
    ] {
        for status in [400, 403] {
            let store = Stranger::start(move |asked| {
                if asked.op != op {
                    return honest(asked);
                }
                let all: Vec<_> = asked.headers.values().map(String::as_str).chain([SECRET, TOKEN]).collect();
                let all = all.join(" ");
                let escaped = all.replace('&', "&amp;").replace('\'', "&#39;");
                let json = serde_json::to_string(&all).unwrap().replace('/', "\\/");
                let encoded = percent(&all);
                text(
                    status,
                    &format!("<Error><Code>No</Code><Message>{escaped} {json} {encoded}</Message></Error>"),
                )
            });
            let ended = store.run_s3(&place, words);
            assert!(ended.code() != Some(0) && store.was_asked(op), "{op:?} {words}: {}", ended.stderr());
            let said = ended.stdout() + &ended.stderr();
            if status == 403 && op != Op::Abort && op != Op::Head {
                assert!(said.contains("[hidden]"), "{op:?} {words}: {said}");
            }
            let parts = [TOKEN, SECRET].map(|secret| &secret[4..20]);
            for secret in parts.into_iter().chain([&percent(TOKEN)[12..60], "Signature=0", "U2Vzc2lvbj0"]) {
                assert!(!said.contains(secret), "{op:?} {words}: {said}");
            }
        }
    }
}

#[test]
fn keys_are_sent_to_no_other_host() {
    let place = place_with_recording();
    for words in [
        "info s3://bucket/run.mcap",
        "ls s3://bucket/",
        "upload run.mcap s3://bucket/run.mcap",
        "run --preset striker-3g --duration 1e-4 --out s3://bucket/new.mcap --spool spool",
    ] {
        let other = Stranger::start(honest);
        let port = other.port;
        let store = Stranger::start(move |asked| {
            let place = format!("Location: http://localhost:{port}{}\r\n", asked.target);
            Answer::Text(307, place, Vec::new())
        });
        let ended = store.run_s3(&place, words);
        assert!(matches!(ended.code(), Some(1 | 2)), "{words}: {:?} {}", ended.code(), ended.stderr());
        ended.says(&["another host, localhost", "keys are not sent there", "AWS_ENDPOINT_URL"]);
        assert!(other.asked.lock().unwrap().is_empty(), "{words}");
    }
    // without keys there is nothing to lose: a web server may send us elsewhere, but not on and on
    let other = Stranger::start(honest);
    let port = other.port;
    let web = Stranger::start(move |asked| {
        let (port, target) = if asked.target == "/on" { (0, "/on") } else { (port, asked.target.as_str()) };
        let host = if port == 0 { String::new() } else { format!("http://localhost:{port}") };
        Answer::Text(302, format!("Location: {host}{target}\r\n"), Vec::new())
    });
    let info = |path: &str| web.run_s3(&place, &format!("info http://127.0.0.1:{}{path}", web.port));
    info("/run.mcap").exits(2).says(&["no such object"]);
    {
        let asked = other.asked.lock().unwrap();
        assert!(asked.len() == 1 && !asked[0].headers.contains_key("authorization"), "{asked:?}");
    }
    info("/on").exits(2).says(&["on and on"]);
}

#[test]
fn an_answer_without_end_takes_no_memory() {
    let place = place_with_recording();
    let (info, ls) = ("info s3://bucket/run.mcap", "ls s3://bucket/");
    let upload = "upload run.mcap s3://bucket/run.mcap";
    let chunk = "<Contents><Key>k</Key><Size>1</Size><LastModified>2026-11-23T10:00:00.000Z</LastModified></Contents>";
    for (op, status, words, most_bytes, said) in [
        (Op::Get, 400, info, MOST_ERROR_BYTES, "64 kB"),
        (Op::List, 400, ls, MOST_ERROR_BYTES, "64 kB"),
        (Op::List, 200, ls, MOST_LISTED_BYTES, "larger than 33554432 bytes"),
        (Op::Begin, 400, upload, MOST_ERROR_BYTES, "64 kB"),
        (Op::Begin, 200, upload, MOST_LISTED_BYTES, "larger than 33554432 bytes"),
        (Op::Part, 400, upload, MOST_ERROR_BYTES, "64 kB"),
        (Op::Complete, 400, upload, MOST_ERROR_BYTES, "64 kB"),
        // the range was not heard
        (Op::Get, 200, info, MOST_ERROR_BYTES, "range requests"),
        // more than the range
        (Op::Get, 206, info, MOST_ERROR_BYTES, "larger than 262144 bytes"),
    ] {
        let store = Stranger::start(move |asked| {
            if asked.op != op {
                return honest(asked);
            }
            let range = "Content-Range: bytes 999738112-1000000255/1000000256\r\nETag: \"1\"\r\nContent-Length: 900000000\r\n";
            Answer::Endless(status, if status == 206 { range.into() } else { String::new() }, chunk)
        });
        let ended = store.run_s3(&place, words);
        assert!(matches!(ended.code(), Some(1..=3)), "{op:?} {status}: {}", ended.stderr());
        ended.says(&[said]);
        let sent = store.sent_bytes.load(Ordering::Relaxed);
        assert!(sent <= most_bytes, "{op:?} {status}: {sent} bytes");
        let _ = fs::remove_file(place.path("run.mcap.upload"));
    }
}

#[test]
fn a_listing_without_end_is_given_up() {
    let place = Place::new();
    let page = |objects: &str, token: &str| {
        text(
            200,
            &format!(
                "<L><IsTruncated>true</IsTruncated>{objects}<NextContinuationToken>{token}</NextContinuationToken></L>"
            ),
        )
    };
    let object = "<Contents><Key>k.txt</Key><Size>1</Size><LastModified>2026-11-23T10:00:00.000Z</LastModified></Contents>";
    let again = Stranger::start(move |_| page(object, "the same"));
    again
        .run_s3(&place, "ls s3://bucket/")
        .exits(2)
        .says(&["given up after 2 objects", "repeats a continuation token"]);
    assert_eq!(again.asked.lock().unwrap().len(), 2);
    let count = AtomicU64::new(0);
    let empty = Stranger::start(move |_| page("", &count.fetch_add(1, Ordering::Relaxed).to_string()));
    empty
        .run_s3(&place, "catalog s3://bucket/ --out c.csv")
        .exits(2)
        .says(&["100 pages in a row were empty"]);
    let many: &str = object.repeat(100_000).leak();
    let count = AtomicU64::new(0);
    let endless = Stranger::start(move |_| page(many, &count.fetch_add(1, Ordering::Relaxed).to_string()));
    endless.run_s3(&place, "ls s3://bucket/").exits(2).says(&["at most 1000000 are listed", "fewer objects"]);
}

#[test]
fn an_object_whose_name_is_no_path_has_a_row_that_says_so() {
    let place = place_with_recording();
    let bytes = fs::read(place.path("run.mcap")).unwrap();
    let size = bytes.len();
    let store = Stranger::start(move |asked| {
        let keys = [
            "runs/a.mcap",
            "runs/../../x.mcap",
            "/etc/y.mcap",
            "runs//z.mcap",
            "runs/&#27;[2J.mcap",
            "elsewhere/v.mcap",
        ];
        let date = "<LastModified>2026-11-23T10:00:00.000Z</LastModified>";
        match asked.op {
            Op::List => {
                let objects =
                    keys.map(|key| format!("<Contents><Key>{key}</Key><Size>{size}</Size>{date}</Contents>"));
                text(200, &format!("<L>{}</L>", objects.concat()))
            }
            Op::Get => {
                let range = asked.headers["range"].strip_prefix("bytes=").unwrap();
                let (from, to) = range.split_once('-').unwrap();
                let to: usize = to.parse().unwrap();
                let range =
                    from.parse().map_or(size.saturating_sub(to)..size, |from: usize| from..size.min(to + 1));
                let place = format!(
                    "Content-Range: bytes {}-{}/{size}\r\nETag: \"1\"\r\n",
                    range.start,
                    range.end - 1
                );
                Answer::Text(206, place, bytes[range].to_vec())
            }
            _ => honest(asked),
        }
    });
    let ended = store.run_s3(&place, "ls s3://bucket/runs --json").exits(3);
    assert_eq!(ended.json().as_array().unwrap().len(), 1);
    ended.says(&[
        "s3://bucket/runs/../../x.mcap is left out: its name is no plain path",
        "s3://bucket//etc/y.mcap",
        "s3://bucket/runs//z.mcap",
        "s3://bucket/runs/\\u{1b}[2J.mcap",
        "elsewhere/v.mcap is left out: it is not below",
    ]);
    let made = store.run_s3(&place, "catalog s3://bucket/runs --out catalog.csv --json").exits(3).json();
    assert_eq!((&made["recordings"], &made["errors"]), (&6.into(), &5.into()));
    let table = place.read("catalog.csv");
    assert!(table.lines().any(|line| line.starts_with("s3://bucket/runs/../../x.mcap,,") && line.contains("no plain path")), "{table}");
    let asked = store.asked.lock().unwrap();
    assert!(
        asked.iter().all(|asked| asked.op == Op::List || asked.target == "/bucket/runs/a.mcap"),
        "{asked:?}"
    );
}

#[test]
fn nobody_waits_for_a_store_that_says_nothing() {
    let place = place_with_recording();
    let upload = "upload run.mcap s3://bucket/run.mcap";
    let object = "s3://bucket/run.mcap";
    let mut failed = Vec::new();
    for (op, words) in [
        (Op::Head, upload.to_owned()),
        (Op::Begin, upload.to_owned()),
        (Op::Part, upload.to_owned()),
        (Op::Complete, upload.to_owned()),
        (Op::Head, format!("run --preset striker-3g --duration 1e-4 --out {object} --spool spool")),
        (Op::List, "catalog s3://bucket --out catalog.csv".to_owned()),
        (Op::List, "ls s3://bucket".to_owned()),
        (Op::Get, format!("info {object}")),
        (Op::Get, format!("verify {object}")),
        (Op::Get, format!("energies {object} --out energies.csv")),
        (Op::Get, format!("pulses {object} --out pulses.csv")),
        (Op::Get, format!("plot {object} --what velocity --out plot.png")),
        (Op::Get, format!("share {object} --out share.html")),
        (Op::Get, format!("thin {object} --every-steps 1000 --out thin.mcap")),
        (Op::Get, format!("recover {object} --out recovered.mcap")),
        (Op::Get, format!("replay {object} --wait-for 0")),
        (Op::Get, format!("view {object}")),
    ] {
        let store =
            Stranger::start(move |asked| if asked.op == op { Answer::Silence } else { honest(asked) });
        let mut running = store.start_s3(&place, &words);
        wait_until("the request", || (store.was_asked(op) || !running.is_running()).then_some(()));
        let asked = Instant::now();
        running.signal("INT");
        let ended = running.wait();
        let time = asked.elapsed();
        // what has nothing to put in order ends by the signal
        let is_stopped = ended.code() == Some(3) || ended.killed_by() == Some(2);
        if !is_stopped || time >= SILENCE {
            failed.push(format!("{words} at {op:?}: {:?} after {time:?}\n{}", ended.code(), ended.stderr()));
        }
        println!("{words} at {op:?}: {:?} {time:?}", ended.code());
        let _ = fs::remove_file(place.path("run.mcap.upload"));
    }
    assert!(failed.is_empty(), "{}", failed.join("\n"));
}

#[test]
fn a_password_in_a_url_is_not_told() {
    let place = Place::new();
    for url in ["https://me:hunter22@host/x.mcap", "https://host/x.mcap?X-Amz-Signature=hunter22&part=1"] {
        for words in [format!("info {url}"), format!("info {url} --json"), format!("energies {url}")] {
            let ended = place.run(&words).exits(2).says(&["[hidden]"]);
            assert!(!ended.stderr().contains("hunter22"), "{}", ended.stderr());
        }
    }
}

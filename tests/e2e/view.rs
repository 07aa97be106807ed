//! The page: what the server hands out and to whom, live runs, and one file for anybody.

mod crowd;
mod folders;

use crate::harness::{Place, Running, wait_until};
use base64::{Engine as _, prelude::BASE64_STANDARD};
use flate2::read::GzDecoder;
use recording::RecordingSource;
use schemas::frame::{FrameSource, Received};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::Path;

const SMALL: &str = "run --beads 60 --impurity 30=0.6e-3 --duration 0.006 --name small";

/// `beadline view` at work.
struct Server {
    running: Running,
    host: String,
    token: String,
}

struct Answer {
    status: u16,
    /// In lower case.
    head: String,
    body: Vec<u8>,
}

impl Server {
    fn start(place: &Place, words: &str) -> Self {
        Self::of(place.start(words), words)
    }

    /// The server that a process becomes.
    fn of(mut running: Running, words: &str) -> Self {
        let url = running.line();
        let rest = url.strip_prefix("http://").unwrap_or_else(|| panic!("{words}: {url:?}"));
        let (host, token) = rest.split_once('/').unwrap();
        let token = token.trim_end_matches('/').to_owned();
        assert_eq!(token.len(), 32);
        Self { running, host: host.to_owned(), token }
    }

    /// Sends a request for `path` with these headers beside `Connection`.
    fn send(&self, method: &str, path: &str, headers: &[(&str, &str)]) -> TcpStream {
        let mut stream = TcpStream::connect(&self.host).unwrap();
        let mut request = format!("{method} {path} HTTP/1.1\r\n");
        for (name, value) in headers {
            request.extend([name, ": ", value, "\r\n"]);
        }
        stream.write_all((request + "\r\n").as_bytes()).unwrap();
        stream
    }

    fn ask(&self, method: &str, path: &str, headers: &[(&str, &str)]) -> Answer {
        let headers = [headers, &[("Connection", "close")]].concat();
        let mut bytes = Vec::new();
        self.send(method, path, &headers).read_to_end(&mut bytes).unwrap();
        let end = bytes.windows(4).position(|four| four == b"\r\n\r\n").unwrap();
        let head = String::from_utf8(bytes[..end].to_vec()).unwrap().to_ascii_lowercase();
        let status = head.split(' ').nth(1).unwrap().parse().unwrap();
        Answer { status, head, body: bytes[end + 4..].to_vec() }
    }

    /// What is below the token, with a header.
    fn get(&self, path: &str, headers: &[(&str, &str)]) -> Answer {
        let headers = [&[("Host", self.host.as_str())], headers].concat();
        self.ask("GET", &format!("/{}/{path}", self.token), &headers)
    }

    fn json(&self, path: &str) -> Value {
        let answer = self.get(path, &[]);
        assert_eq!(answer.status, 200, "{path}: {}", String::from_utf8_lossy(&answer.body));
        serde_json::from_slice(&answer.body).unwrap()
    }

    /// Ctrl-C ends it at once, and in order.
    fn end(self) {
        self.running.signal("INT");
        self.running.wait().exits(0);
    }

    fn viewer(&self, run: &str) -> Viewer {
        let origin = format!("http://{}", self.host);
        let path = format!("/{}/live/{run}", self.token);
        let mut stream =
            self.send("GET", &path, &[&[("Origin", origin.as_str())], &self.upgrade()[..]].concat());
        let mut head = Vec::new();
        while !head.ends_with(b"\r\n\r\n") {
            let mut byte = [0];
            stream.read_exact(&mut byte).unwrap();
            head.push(byte[0]);
        }
        let head = String::from_utf8(head).unwrap().to_ascii_lowercase();
        assert!(head.starts_with("http/1.1 101"), "{head}");
        Viewer(stream)
    }

    fn upgrade(&self) -> [(&str, &str); 5] {
        [
            ("Host", &self.host),
            ("Connection", "Upgrade"),
            ("Upgrade", "websocket"),
            ("Sec-WebSocket-Version", "13"),
            ("Sec-WebSocket-Key", "dGhlIHNhbXBsZSBub25jZQ=="),
        ]
    }
}

/// A page that looks at a live run.
struct Viewer(TcpStream);

#[derive(Debug)]
enum Message {
    Text(Value),
    State(Vec<f64>),
    Close,
}

impl Viewer {
    fn receive(&mut self) -> Message {
        let mut head = [0; 2];
        self.0.read_exact(&mut head).unwrap();
        assert_eq!(head[0] & 0xf0, 0x80, "whole messages");
        let mut longer = [0; 8];
        let length = match head[1] {
            127 => {
                self.0.read_exact(&mut longer).unwrap();
                u64::from_be_bytes(longer)
            }
            126 => {
                self.0.read_exact(&mut longer[6..]).unwrap();
                u64::from_be_bytes(longer)
            }
            short => short.into(),
        };
        let mut bytes = vec![0; usize::try_from(length).unwrap()];
        self.0.read_exact(&mut bytes).unwrap();
        match head[0] & 0xf {
            1 => Message::Text(serde_json::from_slice(&bytes).unwrap()),
            2 => Message::State(bytes.chunks(8).map(|b| f64::from_le_bytes(b.try_into().unwrap())).collect()),
            8 => Message::Close,
            other => panic!("opcode {other}"),
        }
    }

    fn acknowledge(&mut self) {
        // masked with zeros
        self.0.write_all(&[0x81, 0x80 | 3, 0, 0, 0, 0, b'a', b'c', b'k']).unwrap();
    }
}

/// The bits of each state of a recording, by step.
fn states(path: &Path) -> BTreeMap<u64, Vec<u64>> {
    let mut source = RecordingSource::open(path).unwrap();
    let mut states = BTreeMap::new();
    while let Received::Frame(frame) = source.receive().unwrap() {
        let values = [&[frame.time_s], frame.u_m, frame.v_m_s, frame.extra].concat();
        states.insert(frame.step, values.iter().map(|value| value.to_bits()).collect());
    }
    states
}

/// What a page carries.
fn inside(page: &str, id: &str) -> Vec<u8> {
    let text = page.split_once(&format!("id=\"{id}\">")).unwrap().1.split_once('<').unwrap().0;
    let mut bytes = Vec::new();
    GzDecoder::new(BASE64_STANDARD.decode(text).unwrap().as_slice()).read_to_end(&mut bytes).unwrap();
    bytes
}

#[test]
fn who_does_not_know_the_token_or_comes_from_elsewhere_gets_nothing() {
    let place = Place::new();
    place.run(&format!("{SMALL} --out small.mcap")).exits(0);
    let server = Server::start(&place, "view small.mcap");
    let (home, host) = (format!("/{}/", server.token), server.host.as_str());
    let ours = [("Host", host)];

    let page = server.get("", &[]);
    assert_eq!(page.status, 200);
    for header in [
        "content-security-policy: default-src 'none'; script-src 'sha256-",
        "x-content-type-options: nosniff",
        "referrer-policy: no-referrer",
        "cross-origin-resource-policy: same-origin",
        "cache-control: no-store",
    ] {
        assert!(page.head.contains(header), "{header}: {}", page.head);
    }
    assert!(!page.head.contains("unsafe") && !page.head.contains("access-control"));
    assert!(String::from_utf8(page.body).unwrap().contains("\"kind\":\"server\""));

    let port = host.rsplit_once(':').unwrap().1;
    let (local, elsewhere) = (format!("localhost:{port}"), format!("evil.example:{port}"));
    assert_eq!(server.ask("GET", &home, &[("Host", &local)]).status, 200);
    for headers in [
        &[][..],
        &[("Host", &*elsewhere)],
        &[("Host", "localhost")],
        &[("Host", host), ("Origin", "http://evil.example")],
        &[("Host", host), ("Origin", "null")],
    ] {
        let answer = server.ask("GET", &home, headers);
        assert!(answer.status >= 400 && answer.body.is_empty(), "{headers:?}");
    }
    assert_eq!(server.ask("GET", &format!("{home}live/small"), &server.upgrade()).status, 404, "no Origin");
    for path in ["/", "/list", "/recording/0", &format!("/{}/list", "0".repeat(32))] {
        assert_eq!(server.ask("GET", path, &ours).status, 404, "{path}");
    }
    fs::write(place.path("secret.mcap"), "no").unwrap();
    for path in [
        "recording/secret.mcap",
        "recording/../secret.mcap",
        "recording/%2e%2e%2fsecret.mcap",
        "recording/1",
        "etc",
    ] {
        assert_eq!(server.get(path, &[]).status, 404, "{path}");
    }
    assert_eq!(server.ask("POST", &format!("{home}list"), &ours).status, 404);
    server.end();
}

#[test]
fn a_folder_is_listed_and_ranges_are_the_files_bytes() {
    let place = Place::new();
    place.run(&format!("{SMALL} --out a.mcap")).exits(0);
    place.run("thin a.mcap --every-steps 100 --out b.mcap").exits(0);
    place.write("c.mcap", "<script>alert(1)</script>");
    let server = Server::start(&place, "view .");
    let listing = server.json("list");
    assert_eq!(listing["kind"], "folder");
    let entries = listing["entries"].as_array().unwrap();
    let names: Vec<_> = entries.iter().map(|entry| entry["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["a.mcap", "b.mcap", "c.mcap"]);
    assert!(entries[2]["error"].as_str().unwrap().contains("c.mcap") && entries[2].get("results").is_none());
    assert_eq!(entries[0]["manifest"]["physics"]["beads"], 60);

    let bytes = fs::read(place.path("a.mcap")).unwrap();
    let url = entries[0]["url"].as_str().unwrap();
    let whole = server.get(url, &[]);
    assert!(whole.status == 200 && whole.body == bytes && whole.head.contains("application/vnd.mcap"));
    let size = bytes.len();
    for (asked, range) in [
        ("bytes=0-0".to_owned(), 0..1),
        ("bytes=1000-300000".to_owned(), 1000..300_001),
        (format!("bytes={}-", size - 10), size - 10..size),
        ("bytes=-7".to_owned(), size - 7..size),
    ] {
        let answer = server.get(url, &[("Range", &asked)]);
        assert_eq!((answer.status, answer.body.as_slice()), (206, &bytes[range.clone()]), "{asked}");
        let told = format!("content-range: bytes {}-{}/{size}", range.start, range.end - 1);
        assert!(answer.head.contains(&told), "{}", answer.head);
    }
    assert_eq!(server.get(url, &[("Range", &format!("bytes={size}-"))]).status, 416);
    let head = server.ask("HEAD", &format!("/{}/{url}", server.token), &[("Host", &server.host)]);
    assert!(head.body.is_empty() && head.head.contains(&format!("content-length: {size}")));

    // the sparse recording has the same pulses: the steps between are recomputed
    let of = |entry: usize| server.json(entries[entry]["results"].as_str().unwrap());
    let pulses = of(0)["pulses"].as_array().unwrap().len();
    let found = place.run("pulses a.mcap --json").exits(0).json();
    assert_eq!(found["results"]["pulse_count"], pulses);
    assert!(pulses > 0 && of(1) == of(0));
    server.end();
}

#[test]
fn a_sweep_is_listed_and_points_can_be_started() {
    let place = Place::new();
    let sweep = "[base]\npreset = \"homogeneous\"\nchain.beads = 30\ntime.duration_s = 0.001\n[grid]\nchain.alpha = [1.5, 2.0]\n";
    place.write("s.toml", sweep);
    place.run("sweep s.toml --out done").exits(0);
    let server = Server::start(&place, "view done");
    let listing = server.json("list");
    assert_eq!((&listing["kind"], listing["entries"].as_array().unwrap().len()), (&"sweep".into(), 2));
    let entry = &listing["entries"][1];
    assert_eq!((&entry["kind"], &entry["values"]["chain.alpha"]), (&"start".into(), &2.0.into()));
    let start = server.json(entry["url"].as_str().unwrap());
    assert_eq!(start["manifest"]["physics"]["alpha"], 2.0);
    assert_eq!(start["chain"]["mass"].as_array().unwrap().len(), 30);
    server.end();
}

/// States of a live run have the recording's bits; two are in flight, and the newest comes next.
#[test]
fn a_live_run_is_shown_as_it_goes() {
    let place = Place::new();
    // one viewer comes before the run
    let waiting = place.start("view live:small");
    let run = place.start(&format!("{SMALL} --out small.mcap --pace 0.003"));
    let server = Server::of(waiting, "view live:small");
    assert_eq!(server.json("list")["entries"][0]["url"], "live/small");
    let mut viewer = server.viewer("small");
    let Message::Text(begin) = viewer.receive() else { panic!("the run comes first") };
    assert_eq!(begin["run"]["chain"]["mass"].as_array().unwrap().len(), 60);
    assert_eq!(begin["run"]["manifest"]["provenance"]["name"], "small");

    // unacknowledged: no more than two, however long
    let (mut seen, mut statuses) = (Vec::new(), 0);
    while statuses < 4 || seen.len() < 2 {
        match viewer.receive() {
            Message::State(state) => seen.push(state),
            Message::Text(text) => {
                let status = &text["status"];
                assert!(status["steps_per_s"].is_f64(), "{text}");
                let ours = |consumer: &Value| consumer["label"] == "view" && consumer["delivery"] == "latest";
                let consumers = status["consumers"].as_array().unwrap();
                statuses += u32::from(seen.len() == 2 && consumers.iter().any(ours));
            }
            Message::Close => panic!("closed"),
        }
    }
    assert_eq!(seen.len(), 2);
    viewer.acknowledge();
    viewer.acknowledge();
    let mut end = None;
    loop {
        match viewer.receive() {
            Message::State(state) => {
                seen.push(state);
                viewer.acknowledge();
            }
            Message::Text(text) => end = text.get("end").map(|_| text.clone()).or(end),
            Message::Close => break,
        }
    }
    run.wait().exits(0);
    let recorded = states(&place.path("small.mcap"));
    let last_step = recorded.keys().next_back().copied();
    assert_eq!(end, Some(serde_json::json!({ "end": "complete", "step": last_step })));

    let mut last = None;
    for state in &seen {
        let head: [f64; 8] = state[..8].try_into().unwrap();
        assert_eq!(head[..3], [1.0, 60.0, 0.0]);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a whole number")]
        let step = head[4] as u64;
        assert!(Some(step) > last, "the newest comes next");
        last = Some(step);
        let bits: Vec<_> = head[5..6].iter().chain(&state[8..]).map(|value| value.to_bits()).collect();
        assert_eq!(Some(&bits), recorded.get(&step), "step {step}");
    }
    let counts = seen.last().unwrap();
    assert!(counts[6] + counts[7] <= recorded.len() as f64 && counts[7] > 0.0);
    server.end();
}

#[test]
fn a_stuck_viewer_holds_nobody_back_and_a_lost_one_is_let_go_of() {
    let place = Place::new();
    let run = place.start(&format!("{SMALL} --no-record --wait-for 1 --json"));
    place.wait_for_run("small", |_| true);
    let server = Server::start(&place, "view");
    // it reads nothing, not even the first message
    let stuck = server.viewer("small");
    let (lost, kept) = (server.viewer("small"), server.viewer("small"));
    let viewers = |wanted: usize| {
        place.wait_for_run("small", |run| {
            run.consumers.iter().filter(|consumer| consumer.label == "view").count() == wanted
        });
    };
    viewers(1); // they share a consumer
    drop((lost, kept, stuck));
    viewers(0);
    let stuck = server.viewer("small");
    viewers(1);
    place.run("energies live:small --json").exits(0);
    let summary = run.wait().exits(0).json();
    assert_eq!(summary["consumers_dropped"].as_array().unwrap().len(), 0);
    drop(stuck);
    server.end();
}

#[test]
fn a_shared_page_is_small_and_carries_states_that_lead_to_every_step() {
    let place = Place::new();
    place.run(&format!("{SMALL} --out small.mcap")).exits(0);
    let made = place.run("share small.mcap --json").exits(0).json();
    let page = place.read("small.html");
    assert!(page.len() <= 2_000_000 && made["bytes"] == page.len() && made["recomputes"] == true);
    assert_eq!(made["steps"], states(&place.path("small.mcap")).len());

    place.run("share small.mcap --every-steps 50 --out fifty.html").exits(0);
    place.run("thin small.mcap --every-steps 50 --out fifty.mcap").exits(0);
    let page = place.read("fifty.html");
    fs::write(place.path("inside.mcap"), inside(&page, "recording")).unwrap();
    assert_eq!(states(&place.path("inside.mcap")), states(&place.path("fifty.mcap")));
    place.run("verify inside.mcap").exits(0);
    let file = mcap::Summary::read(&fs::read(place.path("inside.mcap")).unwrap()).unwrap().unwrap();
    assert!(file.chunk_indexes.iter().all(|chunk| chunk.compression.is_empty()), "browsers know no zstd");
    let results: Value = serde_json::from_slice(&inside(&page, "results")).unwrap();
    assert!(!results["pulses"].as_array().unwrap().is_empty());

    place.run("share small.mcap").exits(2).says(&["small.html exists", "--force"]);
    place
        .run("share small.mcap --every-steps 50 --out small.mcap --force")
        .exits(2)
        .says(&["the source itself"]);
    place.run("share").exits(0);
    assert!(place.read("beadline.html").contains("\"kind\":\"empty\""));
    // nothing of what it made on the way is left
    let is_recording = |path: &Path| path.extension().is_some_and(|end| end == "mcap");
    let files = fs::read_dir(place.path(".")).unwrap().map(|entry| entry.unwrap().path());
    assert_eq!(files.filter(|path| is_recording(path)).count(), 3, "small, fifty, inside");
}

#[test]
fn a_recording_of_another_kernel_is_shared_with_what_it_holds() {
    let place = Place::new();
    let golden = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/1.0-kernel-1");
    fs::copy(golden.join("full.mcap"), place.path("old.mcap")).unwrap();
    let shared = place.run("share old.mcap --json").exits(0).says(&["kernel", "none between"]).json();
    assert_eq!(shared["recomputes"], false);
    fs::write(place.path("inside.mcap"), inside(&place.read("old.html"), "recording")).unwrap();
    assert_eq!(states(&place.path("inside.mcap")), states(&place.path("old.mcap")));
}

#[test]
fn a_view_that_cannot_be_is_refused() {
    let place = Place::new();
    place.run("view missing.mcap").exits(2).says(&["missing.mcap"]);
    place.run("view . --host 0.0.0.0").exits(2).says(&["one address"]);
    let waiting = place.start("view");
    wait_until("the signal's handler", || {
        let status = fs::read_to_string(format!("/proc/{}/status", waiting.id())).unwrap();
        let caught = status.lines().find_map(|line| line.strip_prefix("SigCgt:")).unwrap().trim().to_owned();
        (u64::from_str_radix(&caught, 16).unwrap() & 2 != 0).then_some(())
    });
    waiting.signal("INT");
    waiting.wait().exits(0);
}

//! An S3 server for tests, and a proxy before it that counts requests and does to them what a test wants.
//!
//! The server is one process for all tests; each test has a bucket and a proxy of its own.

use crate::harness::{self, Place, skip};
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, LazyLock, Mutex};
use std::thread;
use std::time::Duration;

/// The server, whose stdin is kept open: it ends with the tests.
static SERVER: LazyLock<Option<(Child, SocketAddr)>> = LazyLock::new(start_server);

/// Objects are shown to nobody without a signature, which the server does not check.
const SIGNED: &str = "Authorization: AWS4-HMAC-SHA256 Credential=test/20260101/us-east-1/s3/aws4_request, \
                      SignedHeaders=host, Signature=0";

static BUCKETS: AtomicU64 = AtomicU64::new(1);

/// A request as it came to the proxy.
#[derive(Debug, Clone)]
pub(crate) struct Request {
    pub(crate) method: String,
    /// Path and query.
    pub(crate) target: String,
    /// In lower case.
    pub(crate) headers: BTreeMap<String, String>,
    /// Bytes that were sent with it.
    pub(crate) sent_bytes: u64,
    /// Bytes of the answer's body that were passed on.
    pub(crate) received_bytes: u64,
    /// Of the answer; 0 if there was none.
    pub(crate) status: u16,
}

impl Request {
    /// Of bytes, as `bytes=0-9`; empty if it is for all.
    pub(crate) fn range(&self) -> &str {
        self.headers.get("range").map_or("", String::as_str)
    }

    /// Whether it sends a part of an upload.
    pub(crate) fn is_part(&self) -> bool {
        self.method == "PUT" && self.target.contains("partNumber=")
    }

    /// Whether it completes an upload.
    pub(crate) fn is_completion(&self) -> bool {
        self.method == "POST" && self.target.contains("uploadId=")
    }
}

/// What the proxy does with a request.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Act {
    Pass,
    /// Passes it on that much later.
    Delay(Duration),
    /// Answers with a status and the code of an S3 error, without asking the server.
    Refuse(u16, &'static str),
    /// Reads that much of the body, then closes the connection.
    CutRequest(u64),
    /// Passes that much of the answer's body on, then closes the connection.
    CutAnswer(u64),
}

type Behaviour = Box<dyn FnMut(&Request) -> Act + Send>;

/// A bucket behind a proxy.
pub(crate) struct Bucket {
    pub(crate) name: String,
    server: SocketAddr,
    proxy: SocketAddr,
    seen: Arc<Mutex<Vec<Request>>>,
    behaviour: Arc<Mutex<Behaviour>>,
}

impl Bucket {
    /// A new bucket; none, and said so, where the server is not installed.
    pub(crate) fn new() -> Option<Self> {
        let (_, server) = SERVER.as_ref().or_else(|| {
            skip("an S3 server needs BEADLINE_CHECK_PYTHON, the Python that `tests/setup` makes, with moto");
            None
        })?;
        let name = format!("bucket-{}", BUCKETS.fetch_add(1, Ordering::Relaxed));
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
        let bucket = Self {
            name,
            server: *server,
            proxy: listener.local_addr().unwrap(),
            seen: Arc::default(),
            behaviour: Arc::new(Mutex::new(Box::new(|_| Act::Pass))),
        };
        let (server, seen, behaviour) = (bucket.server, bucket.seen.clone(), bucket.behaviour.clone());
        thread::spawn(move || {
            for client in listener.incoming().map_while(Result::ok) {
                let (seen, behaviour) = (seen.clone(), behaviour.clone());
                // a client that goes away is its own affair
                thread::spawn(move || {
                    pass_on(&client, server, &seen, &behaviour);
                });
            }
        });
        assert_eq!(bucket.ask("PUT", "", b"").0, 200);
        Some(bucket)
    }

    /// `s3://…` of an object in it.
    pub(crate) fn url(&self, key: &str) -> String {
        format!("s3://{}/{key}", self.name)
    }

    /// What `beadline` needs in its environment to find it through the proxy, with few and quick retries.
    pub(crate) fn environment(&self) -> [(&'static str, String); 5] {
        [
            ("AWS_ENDPOINT_URL", format!("http://{}", self.proxy)),
            ("AWS_ALLOW_HTTP", "true".into()),
            ("AWS_ACCESS_KEY_ID", "test".into()),
            ("AWS_SECRET_ACCESS_KEY", "test".into()),
            ("AWS_REGION", "us-east-1".into()),
        ]
    }

    /// `beadline WORDS` that finds the bucket.
    pub(crate) fn command(&self, place: &Place, words: &str) -> Command {
        let mut command = place.command(words.split_whitespace());
        command.envs(self.environment());
        command
    }

    /// Starts `beadline` with these words.
    pub(crate) fn start(&self, place: &Place, words: &str) -> harness::Running {
        harness::Running::start(words, self.command(place, words))
    }

    /// Runs `beadline` with these words to its end.
    pub(crate) fn run(&self, place: &Place, words: &str) -> harness::Ended {
        self.start(place, words).wait()
    }

    /// What the proxy does from now on with each request.
    pub(crate) fn behave(&self, behaviour: impl FnMut(&Request) -> Act + Send + 'static) {
        *self.behaviour.lock().unwrap() = Box::new(behaviour);
    }

    /// The requests since the last call, in the order of their ends.
    pub(crate) fn take_requests(&self) -> Vec<Request> {
        std::mem::take(&mut self.seen.lock().unwrap())
    }

    /// The requests so far.
    pub(crate) fn requests(&self) -> Vec<Request> {
        self.seen.lock().unwrap().clone()
    }

    /// Puts an object there, past the proxy.
    pub(crate) fn put(&self, key: &str, bytes: &[u8]) {
        assert_eq!(self.ask("PUT", &format!("/{key}"), bytes).0, 200);
    }

    /// The bytes of an object, past the proxy; none if there is none.
    pub(crate) fn get(&self, key: &str) -> Option<Vec<u8>> {
        let (status, bytes) = self.ask("GET", &format!("/{key}"), b"");
        (status == 200).then_some(bytes)
    }

    /// Uploads that were begun, and neither completed nor given up.
    pub(crate) fn open_uploads(&self) -> usize {
        let (status, bytes) = self.ask("GET", "?uploads", b"");
        assert_eq!(status, 200);
        String::from_utf8(bytes).unwrap().matches("<UploadId>").count()
    }

    /// Has the server take `bytes` as a part of the upload of an object that is under way, past the proxy.
    pub(crate) fn put_part(&self, key: &str, number: u64, bytes: &[u8]) {
        let (_, uploads) = self.ask("GET", "?uploads", b"");
        let uploads = String::from_utf8(uploads).unwrap();
        let (_, rest) = uploads.split_once("<UploadId>").unwrap();
        let (id, _) = rest.split_once("</UploadId>").unwrap();
        assert_eq!(self.ask("PUT", &format!("/{key}?partNumber={number}&uploadId={id}"), bytes).0, 200);
    }

    /// Asks the server, past the proxy; gives the status and the body of its answer.
    fn ask(&self, method: &str, target: &str, body: &[u8]) -> (u16, Vec<u8>) {
        let (name, server, length) = (&self.name, self.server, body.len());
        let text = format!(
            "{method} /{name}{target} HTTP/1.1\r\nHost: {server}\r\nContent-Length: {length}\r\n{SIGNED}\r\n"
        );
        let (head, bytes) = ask_server(server, &Head { text, headers: BTreeMap::new() }, body).unwrap();
        (head.status(), bytes)
    }
}

/// The first line and the headers of a request or an answer.
struct Head {
    text: String,
    headers: BTreeMap<String, String>,
}

impl Head {
    /// The next one; none at the end.
    fn read(from: &mut impl BufRead) -> Option<Self> {
        let mut head = Self { text: String::new(), headers: BTreeMap::new() };
        loop {
            let mut line = String::new();
            if from.read_line(&mut line).ok()? == 0 {
                return None;
            }
            if line == "\r\n" {
                return Some(head);
            }
            if let Some((name, value)) = line.split_once(": ") {
                head.headers.insert(name.to_ascii_lowercase(), value.trim().to_owned());
            }
            if !line.to_ascii_lowercase().starts_with("connection:") {
                head.text.push_str(&line);
            }
        }
    }

    fn word(&self, index: usize) -> &str {
        self.text.split_whitespace().nth(index).unwrap_or_default()
    }

    fn status(&self) -> u16 {
        self.word(1).parse().unwrap()
    }

    /// Bytes of the body; all that follow if it does not say.
    fn length(&self) -> u64 {
        self.headers.get("content-length").map_or(u64::MAX, |length| length.parse().unwrap())
    }

    /// Sends it with a body; the connection ends after it.
    fn send(&self, mut to: &TcpStream, body: &[u8]) -> Option<()> {
        to.write_all(format!("{}Connection: close\r\n\r\n", self.text).as_bytes()).ok()?;
        to.write_all(body).ok()
    }
}

/// Passes one request on, and its answer back. None if one of the two sides went away.
fn pass_on(
    client: &TcpStream,
    server: SocketAddr,
    seen: &Mutex<Vec<Request>>,
    behaviour: &Mutex<Behaviour>,
) -> Option<()> {
    let mut from_client = BufReader::new(client);
    let head = Head::read(&mut from_client)?;
    let length = head.headers.get("content-length").map_or(0, |_| head.length());
    let mut request = Request {
        method: head.word(0).to_owned(),
        target: head.word(1).to_owned(),
        headers: head.headers.clone(),
        sent_bytes: length,
        received_bytes: 0,
        status: 0,
    };
    let act = behaviour.lock().unwrap()(&request);
    let mut body = Vec::new();
    let read_bytes = if let Act::CutRequest(bytes) = act { bytes.min(length) } else { length };
    from_client.take(read_bytes).read_to_end(&mut body).ok()?;
    let mut answered = match act {
        Act::CutRequest(_) => None,
        Act::Refuse(status, code) => Some(refusal(status, code)),
        Act::Delay(time) => {
            thread::sleep(time);
            ask_server(server, &head, &body)
        }
        Act::Pass | Act::CutAnswer(_) => ask_server(server, &head, &body),
    };
    if let Some((head, body)) = &mut answered {
        if let Act::CutAnswer(bytes) = act {
            body.truncate(usize::try_from(bytes).unwrap());
        }
        if request.method == "HEAD" {
            body.clear();
        }
        request.status = head.status();
        request.received_bytes = body.len() as u64;
    }
    // noted first, so that whoever has the answer finds the request
    seen.lock().unwrap().push(request);
    let (head, body) = answered?;
    head.send(client, &body)
}

/// What the server answers.
fn ask_server(server: SocketAddr, head: &Head, body: &[u8]) -> Option<(Head, Vec<u8>)> {
    let server = TcpStream::connect(server).ok()?;
    head.send(&server, body)?;
    let mut server = BufReader::new(server);
    let head = Head::read(&mut server)?;
    let mut body = Vec::new();
    // the server says how much there is, or closes the connection
    server.take(head.length()).read_to_end(&mut body).ok()?;
    Some((head, body))
}

fn refusal(status: u16, code: &str) -> (Head, Vec<u8>) {
    let body = format!("<Error><Code>{code}</Code><Message>by the test</Message></Error>");
    let length = body.len();
    let text =
        format!("HTTP/1.1 {status} No\r\nContent-Type: application/xml\r\nContent-Length: {length}\r\n");
    (Head { text, headers: BTreeMap::new() }, body.into_bytes())
}

fn start_server() -> Option<(Child, SocketAddr)> {
    let python = harness::python()?;
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/python/s3_server.py");
    let mut child = Command::new(python)
        .arg(script)
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut said = BufReader::new(child.stderr.take().unwrap()).lines().map_while(Result::ok);
    let address = said.find_map(|line| line.split_once("http://").map(|(_, rest)| rest.trim().to_owned()));
    // what it says of each request must not fill the pipe
    thread::spawn(move || said.for_each(drop));
    address.map(|address| (child, address.parse().unwrap()))
}

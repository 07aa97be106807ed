//! The server: the page, recordings by ranges, results, and live runs by web socket.
//!
//! Architecture invariants: whoever does not know the token gets 404 and nothing else, and so does who names another host
//! or comes from another page; no path of a file comes from an address; requests have no body that is read.

mod body;
mod file;
mod guard;
pub(crate) mod live;
mod rooms;
mod socket;
mod works;

use crate::carried::{Carried, page, policy};
use body::Body;
use guard::Guard;
use hyper::body::Bytes;
use hyper::http::{HeaderName, HeaderValue, Request, Response, StatusCode, header, request::Parts};
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper_util::rt::{TokioIo, TokioTimer};
use live::LiveFeed;
use rooms::{Guest, Line, Room, Rooms};
use socket::Socket;
use std::convert::Infallible;
use std::io;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use tokio::net::{TcpListener, TcpSocket, TcpStream};
use tokio::runtime::{Builder, Runtime};
use works::Works;

/// Threads that open and read files: some for each connection, because reading for one that is gone ends when it ends.
const MAX_READERS: usize = 256;
/// Connections that wait to be accepted; where there are more, new ones are delayed by a second.
const BACKLOG: u32 = 4096;
/// Time for a client to send the head of a request, also of the next one of a connection.
const HEAD_TIMEOUT: Duration = Duration::from_secs(15);
/// Largest head of a request (bytes).
const MAX_HEAD_BYTES: usize = 64 << 10;
/// Connections that are accepted before those that are open have their turn: half of the room for strangers.
const ACCEPTED_AT_ONCE: usize = 16;
/// Interval at which we check if we are to stop.
const STOP_PERIOD: Duration = Duration::from_millis(50);
/// Time for dropped connections to end, when there are too many open files.
const WAY_TIME: Duration = Duration::from_millis(5);

/// Shelf of the server: the runs that it shows. Its functions may block.
pub trait Shelf: Send + Sync + 'static {
    /// Title of the page.
    fn title(&self) -> String;
    /// `Listing` as JSON; ends soon after `stop` is set.
    fn list(&self, stop: &Arc<AtomicBool>) -> Served;
    /// The recording of an entry.
    fn recording(&self, id: &str) -> Option<PathBuf>;
    /// `Results` of an entry as JSON; ends soon after `stop` is set.
    fn results(&self, id: &str, stop: &Arc<AtomicBool>) -> Served;
    /// `{manifest, chain}` of an entry as JSON.
    fn start(&self, id: &str) -> Served;
    /// The live run of this name.
    fn live(&self, name: &str) -> Option<LiveFeed>;
}

/// JSON; none if there is nothing of that name, and a sentence for the user where it went wrong.
pub type Served = Option<Result<String, String>>;

/// A server that listens.
pub struct Server {
    runtime: Runtime,
    listener: TcpListener,
    guard: Guard,
}

impl Server {
    /// Listens at `address`; port 0 takes one that is free.
    ///
    /// # Errors
    /// When the address cannot be had, or the system grants no runtime.
    pub fn bind(address: SocketAddr) -> io::Result<Self> {
        let runtime = Builder::new_current_thread()
            .enable_io()
            .enable_time()
            .max_blocking_threads(MAX_READERS)
            .build()?;
        let entered = runtime.enter();
        let socket = if address.is_ipv4() { TcpSocket::new_v4()? } else { TcpSocket::new_v6()? };
        // a port that was left a moment ago is free
        socket.set_reuseaddr(true)?;
        socket.bind(address)?;
        let listener = socket.listen(BACKLOG)?;
        let guard = Guard::new(listener.local_addr()?)?;
        drop(entered);
        Ok(Self { runtime, listener, guard })
    }

    /// Address of the page: everybody who knows it may see everything.
    pub fn url(&self) -> String {
        self.guard.url()
    }

    /// Serves until `stop` is set.
    ///
    /// # Errors
    /// When what the page may do cannot be said in a header.
    pub fn run(self, shelf: Arc<dyn Shelf>, stop: &AtomicBool) -> io::Result<()> {
        let Self { runtime, listener, guard } = self;
        let policy = HeaderValue::from_str(&format!("{}; frame-ancestors 'none'", policy(true)));
        let policy = policy.map_err(io::Error::other)?;
        let page = page(Carried::Server { title: &shelf.title() }).into();
        let desk = Arc::new(Desk { guard, shelf, page, policy, works: Arc::default() });
        runtime.block_on(accept(&listener, &desk, stop));
        // nobody waits any more for what still computes, and its flag tells it so
        runtime.shutdown_background();
        Ok(())
    }
}

async fn accept(listener: &TcpListener, desk: &Arc<Desk>, stop: &AtomicBool) {
    let (rooms, mut turn) = (Rooms::default(), 0);
    while !stop.load(Ordering::Relaxed) {
        let Ok(accepted) = tokio::time::timeout(STOP_PERIOD, listener.accept()).await else { continue };
        if let Ok((stream, _)) = accepted {
            // small messages are not kept back for larger ones
            let _ = stream.set_nodelay(true);
            tokio::spawn(serve(stream, Arc::clone(desk), Arc::new(rooms.enter())));
            turn = (turn + 1) % ACCEPTED_AT_ONCE;
            if turn == 0 {
                // who came before may have sent the token, and be a stranger no more
                tokio::task::yield_now().await;
            }
        } else {
            // a client that is gone, or too many open files
            rooms.make_way();
            tokio::time::sleep(WAY_TIME).await;
        }
    }
}

/// Answers the requests of a connection, until its time is over.
async fn serve(stream: TcpStream, desk: Arc<Desk>, guest: Arc<Guest>) {
    let asking = Arc::clone(&guest);
    let answer = service_fn(move |request: Request<hyper::body::Incoming>| {
        let (desk, guest) = (Arc::clone(&desk), Arc::clone(&asking));
        async move {
            guest.waits(true);
            let answer = desk.answer(request.into_parts().0, &guest).await;
            guest.waits(false);
            Ok::<_, Infallible>(answer)
        }
    });
    let mut connection = http1::Builder::new();
    connection.timer(TokioTimer::new()).header_read_timeout(HEAD_TIMEOUT).max_buf_size(MAX_HEAD_BYTES);
    let stream = Arc::new(stream);
    let line = TokioIo::new(Line::new(Arc::clone(&stream), Arc::clone(&guest)));
    tokio::select! {
        // a client that breaks off is no news
        _ = connection.serve_connection(line, answer).with_upgrades() => {}
        () = guest.dismissed() => {}
        () = guest.left(&stream) => {}
    }
}

/// Desk at which requests are answered.
struct Desk {
    guard: Guard,
    shelf: Arc<dyn Shelf>,
    /// The same for all who ask.
    page: Bytes,
    policy: HeaderValue,
    works: Arc<Works>,
}

impl Desk {
    async fn answer(&self, parts: Parts, guest: &Arc<Guest>) -> Response<Body> {
        let mut response = if let Some(path) = self.guard.admit(&parts) {
            guest.goes_to(Room::Known);
            let path = path.to_owned();
            self.found(&path, parts, guest).await.unwrap_or_else(not_found)
        } else {
            // a stranger is answered once
            let mut response = not_found();
            response.headers_mut().insert(header::CONNECTION, HeaderValue::from_static("close"));
            response
        };
        let headers = response.headers_mut();
        headers.insert(header::CONTENT_SECURITY_POLICY, self.policy.clone());
        for (name, value) in [
            (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
            (header::REFERRER_POLICY, "no-referrer"),
            (HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
            (header::CACHE_CONTROL, "no-store"),
        ] {
            headers.insert(name, HeaderValue::from_static(value));
        }
        response
    }

    async fn found(&self, path: &str, mut parts: Parts, guest: &Arc<Guest>) -> Option<Response<Body>> {
        let shelf = Arc::clone(&self.shelf);
        let (kind, id) = path.split_once('/').map_or((path, None), |(kind, id)| (kind, Some(id.to_owned())));
        match (kind, id) {
            ("", None) => Some(with_type("text/html; charset=utf-8", self.page.clone())),
            ("list", None) => json(self.works.answer(path, move |stop| shelf.list(stop)).await?),
            ("results", Some(id)) => {
                json(self.works.answer(path, move |stop| shelf.results(&id, stop)).await?)
            }
            ("start", Some(id)) => json(self.works.answer(path, move |_| shelf.start(&id)).await?),
            ("recording", Some(id)) => {
                let file = blocking(move || file::open(&shelf.recording(&id)?)).await??;
                file::answer(file, &parts)
            }
            ("live", Some(id)) => {
                let (response, follows) = socket::upgrade(&mut parts)?;
                let feed = blocking(move || shelf.live(&id)).await??;
                let guest = Arc::clone(guest);
                guest.goes_to(Room::Viewers);
                tokio::spawn(async move {
                    // a client that breaks off is no news
                    let Ok(upgraded) = follows.await else { return };
                    tokio::select! {
                        () = live::show(Socket::new(upgraded), feed) => {}
                        () = guest.dismissed() => {}
                    }
                });
                Some(response)
            }
            _ => None,
        }
    }
}

/// Result of `work`, which may block.
async fn blocking<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> Option<T> {
    tokio::task::spawn_blocking(work).await.ok()
}

fn not_found() -> Response<Body> {
    let mut response = Response::new(Body::empty());
    *response.status_mut() = StatusCode::NOT_FOUND;
    response
}

fn with_type(media_type: &'static str, body: impl Into<Bytes>) -> Response<Body> {
    let mut response = Response::new(Body::Whole(body.into()));
    response.headers_mut().insert(header::CONTENT_TYPE, HeaderValue::from_static(media_type));
    response
}

/// JSON, or what went wrong as JSON.
#[expect(clippy::unnecessary_wraps, reason = "as its neighbours")]
fn json(served: Result<String, String>) -> Option<Response<Body>> {
    Some(match served {
        Ok(text) => with_type("application/json", text),
        Err(error) => {
            let text = serde_json::json!({ "error": error }).to_string();
            let mut response = with_type("application/json", text);
            *response.status_mut() = StatusCode::INTERNAL_SERVER_ERROR;
            response
        }
    })
}

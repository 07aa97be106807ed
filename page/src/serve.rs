//! The server: the page, recordings by ranges, results, and live runs by web socket.
//!
//! Architecture invariants: whoever does not know the token gets 404 and nothing else, and so does who names another host
//! or comes from another page; no path of a file comes from an address; requests have no body that is read.

mod file;
mod guard;
pub(crate) mod live;

use crate::carried::{Carried, page, policy};
use axum::body::{Body, Bytes};
use axum::extract::{FromRequestParts, WebSocketUpgrade};
use axum::http::{HeaderName, HeaderValue, Request, Response, StatusCode, header, request::Parts};
use axum::response::IntoResponse;
use guard::Guard;
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper_util::rt::{TokioIo, TokioTimer};
use live::LiveFeed;
use std::convert::Infallible;
use std::io;
use std::net::{SocketAddr, TcpListener};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use tokio::sync::Semaphore;

/// Most connections that wait for answers at the same time; others wait until one of them ends.
const MAX_CLIENTS: usize = 64;
/// Most viewers of live runs.
pub const MAX_LIVE_CLIENTS: usize = 16;
/// How long a client may take for the head of a request, also for the next one of a connection.
const HEAD_TIMEOUT: Duration = Duration::from_secs(15);
/// Largest head of a request (bytes).
const MAX_HEAD_BYTES: usize = 64 << 10;
/// How often we look whether to stop.
const STOP_PERIOD: Duration = Duration::from_millis(50);

/// What the server has. Its functions may block.
pub trait Shelf: Send + Sync + 'static {
    /// What the page is called.
    fn title(&self) -> String;
    /// `Listing` as JSON.
    fn list(&self) -> Served;
    /// The recording of an entry.
    fn recording(&self, id: &str) -> Option<PathBuf>;
    /// `Results` of an entry as JSON.
    fn results(&self, id: &str) -> Served;
    /// `{manifest, chain}` of an entry as JSON.
    fn start(&self, id: &str) -> Served;
    /// The live run of this name.
    fn live(&self, name: &str) -> Option<LiveFeed>;
}

/// JSON; none if there is nothing of that name, and a sentence for the user where it went wrong.
pub type Served = Option<Result<String, String>>;

/// A server that listens.
pub struct Server {
    listener: TcpListener,
    guard: Guard,
}

impl Server {
    /// Listens at `address`; port 0 takes one that is free.
    ///
    /// # Errors
    /// When the address cannot be had.
    pub fn bind(address: SocketAddr) -> io::Result<Self> {
        let listener = TcpListener::bind(address)?;
        listener.set_nonblocking(true)?;
        let guard = Guard::new(listener.local_addr()?)?;
        Ok(Self { listener, guard })
    }

    /// Where the page is: whoever knows it may see everything.
    pub fn url(&self) -> String {
        self.guard.url()
    }

    /// Serves until `stop` is set.
    ///
    /// # Errors
    /// When the system grants no runtime, or takes the address away.
    pub fn run(self, shelf: Arc<dyn Shelf>, stop: &AtomicBool) -> io::Result<()> {
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_io()
            .enable_time()
            .max_blocking_threads(MAX_CLIENTS)
            .build()?;
        let served = runtime.block_on(self.accept(shelf, stop));
        // what still computes looks at flags of its own
        runtime.shutdown_background();
        served
    }

    async fn accept(self, shelf: Arc<dyn Shelf>, stop: &AtomicBool) -> io::Result<()> {
        let listener = tokio::net::TcpListener::from_std(self.listener)?;
        let clients = Arc::new(Semaphore::new(MAX_CLIENTS));
        let desk = Arc::new(Desk {
            guard: self.guard,
            shelf,
            policy: HeaderValue::from_str(&format!("{}; frame-ancestors 'none'", policy(true)))
                .map_err(io::Error::other)?,
            viewers: Arc::new(Semaphore::new(MAX_LIVE_CLIENTS)),
        });
        while !stop.load(Ordering::Relaxed) {
            let accepted = async {
                // closed never
                let permit = Arc::clone(&clients).acquire_owned().await.ok();
                (permit, listener.accept().await)
            };
            let Ok((permit, accepted)) = tokio::time::timeout(STOP_PERIOD, accepted).await else { continue };
            let Ok((stream, _)) = accepted else {
                // of a client that is gone, or because there are too many open files
                tokio::time::sleep(STOP_PERIOD).await;
                continue;
            };
            // small messages are not kept back for larger ones
            let _ = stream.set_nodelay(true);
            let desk = Arc::clone(&desk);
            tokio::spawn(async move {
                let answer = service_fn(move |request: Request<hyper::body::Incoming>| {
                    let desk = Arc::clone(&desk);
                    async move { Ok::<_, Infallible>(desk.answer(request.into_parts().0).await) }
                });
                let mut connection = http1::Builder::new();
                connection
                    .timer(TokioTimer::new())
                    .header_read_timeout(HEAD_TIMEOUT)
                    .max_buf_size(MAX_HEAD_BYTES);
                // a client that breaks off is no news
                let _ = connection.serve_connection(TokioIo::new(stream), answer).with_upgrades().await;
                drop(permit);
            });
        }
        Ok(())
    }
}

/// Where requests are answered.
struct Desk {
    guard: Guard,
    shelf: Arc<dyn Shelf>,
    policy: HeaderValue,
    viewers: Arc<Semaphore>,
}

impl Desk {
    async fn answer(&self, parts: Parts) -> Response<Body> {
        let mut response = match self.guard.admit(&parts) {
            Some(path) => {
                let path = path.to_owned();
                self.found(&path, parts).await.unwrap_or_else(not_found)
            }
            None => not_found(),
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

    async fn found(&self, path: &str, mut parts: Parts) -> Option<Response<Body>> {
        let shelf = Arc::clone(&self.shelf);
        let (kind, id) = path.split_once('/').map_or((path, None), |(kind, id)| (kind, Some(id.to_owned())));
        match (kind, id) {
            ("", None) => {
                let page = blocking(move || page(Carried::Server { title: &shelf.title() })).await?;
                Some(with_type("text/html; charset=utf-8", page))
            }
            ("list", None) => json(blocking(move || shelf.list()).await??),
            ("results", Some(id)) => json(blocking(move || shelf.results(&id)).await??),
            ("start", Some(id)) => json(blocking(move || shelf.start(&id)).await??),
            ("recording", Some(id)) => {
                let file = blocking(move || file::open(&shelf.recording(&id)?)).await??;
                file::answer(file, &parts)
            }
            ("live", Some(id)) => {
                let viewer = Arc::clone(&self.viewers).try_acquire_owned();
                let upgrade = WebSocketUpgrade::from_request_parts(&mut parts, &()).await.ok()?;
                let Ok(viewer) = viewer else { return Some(StatusCode::SERVICE_UNAVAILABLE.into_response()) };
                let feed = blocking(move || shelf.live(&id)).await??;
                let upgrade = upgrade.max_message_size(live::MAX_MESSAGE_BYTES).write_buffer_size(0);
                Some(upgrade.on_upgrade(async move |socket| {
                    live::show(socket, feed).await;
                    drop(viewer);
                }))
            }
            _ => None,
        }
    }
}

/// What `work` gives, which may block.
async fn blocking<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> Option<T> {
    tokio::task::spawn_blocking(work).await.ok()
}

fn not_found() -> Response<Body> {
    StatusCode::NOT_FOUND.into_response()
}

fn with_type(media_type: &'static str, body: impl Into<Bytes>) -> Response<Body> {
    ([(header::CONTENT_TYPE, media_type)], body.into()).into_response()
}

/// JSON, or what went wrong as JSON.
#[expect(clippy::unnecessary_wraps, reason = "as its neighbours")]
fn json(served: Result<String, String>) -> Option<Response<Body>> {
    Some(match served {
        Ok(text) => with_type("application/json", text),
        Err(error) => {
            let text = serde_json::json!({ "error": error }).to_string();
            (StatusCode::INTERNAL_SERVER_ERROR, with_type("application/json", text)).into_response()
        }
    })
}

//! The two sides over Zenoh.
//!
//! Architecture invariant: nothing outside this module names zenoh. The far side asks (a query), and the near side
//! answers with one reply after the other, no more than a window ahead of what the far side says it has done with. So no
//! queue of Zenoh's ever fills, whoever is slow, and after a cut the far side just asks again for what it does not have.

mod answers;
mod fetching;
mod room;
mod serving;

pub use fetching::{Arrival, Fetching, Waiting, Wanted};
pub use serving::Serving;
#[doc(hidden)] // for tests that speak as strangers do
pub use zenoh;

use crate::message::{MOST_REQUEST_BYTES, MessageError};
use schemas::manifest::{ManifestError, RunId};
use std::fmt;
use std::net::{TcpStream, ToSocketAddrs as _};
use std::ops::Deref;
use std::panic;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::thread;
use std::time::Duration;
use zenoh::{Config, Session, Wait as _};

/// Bytes of a message in the near side's log.
pub type Payload = zenoh::bytes::ZBytes;

/// Key under which runs are offered: `beadline/relay/RUN`.
const KEY: &str = "beadline/relay";
/// Key under which far sides report the messages that they have done with.
const DONE_KEY: &str = "beadline/relay-done";
/// Time for which a request is answered before the far side asks anew; an idle near side also shows within this time
/// that it lives.
const ANSWER_TIME: Duration = Duration::from_millis(500);
/// Time after which an answer is asked for again.
const ANSWER_PATIENCE: Duration = Duration::from_secs(4);
/// Time in which a connection must come about when we look for a listener.
const PROBE_TIME: Duration = Duration::from_secs(2);
/// Interval at which a waiting thread checks if it is to stop.
const LOOK_PERIOD: Duration = Duration::from_millis(10);
/// Time for the connections to close in order; after that the system closes them.
const CLOSE_TIME: Duration = Duration::from_millis(100);
/// Time in which a connecting peer must introduce itself, twice a round trip of half a second and more; after a longer
/// silence it loses its place.
const FIRST_WORDS_MS: &str = "2000";
/// Most connections that have not said yet who they are: silent ones go after [`FIRST_WORDS_MS`], so that only more than a
/// thousand new ones in every second would keep others out.
const MOST_SILENT: &str = "2048";

/// Address of the near side, in Zenoh's notation: `tcp/HOST:PORT`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Endpoint(String);

impl FromStr for Endpoint {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let allowed = || format!("`{text}` is no endpoint; allowed: tcp/HOST:PORT or tls/HOST:PORT");
        let (protocol, address) = text.split_once('/').ok_or_else(allowed)?;
        let (host, port) = address.rsplit_once(':').ok_or_else(allowed)?;
        // no metadata and no configuration of a link: those are the file's business
        let is_plain = !host.is_empty() && !host.contains(['?', '#', '/', ' ', '"', '\\']);
        if !matches!(protocol, "tcp" | "tls") || !is_plain || port.parse::<u16>().is_err() {
            return Err(allowed());
        }
        Ok(Self(text.to_owned()))
    }
}

impl fmt::Display for Endpoint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl Endpoint {
    /// True if anything listens there.
    fn answers(&self) -> bool {
        let address = self.0.split_once('/').map_or("", |(_, address)| address);
        let Ok(mut addresses) = address.to_socket_addrs() else { return false };
        addresses.any(|address| TcpStream::connect_timeout(&address, PROBE_TIME).is_ok())
    }
}

/// Why there is no connection.
#[derive(Debug, thiserror::Error)]
pub enum WireError {
    /// The user's configuration.
    #[error("{path}: no configuration of Zenoh: {cause}")]
    Config {
        /// The file.
        path: PathBuf,
        /// Zenoh's message.
        cause: String,
    },
    /// Nobody can be met there.
    #[error("cannot listen at {endpoint}: {cause}")]
    Listen {
        /// The address.
        endpoint: String,
        /// Zenoh's message.
        cause: String,
    },
    /// Something listens there, but does not let us in.
    #[error(
        "what listens at {endpoint} is no Zenoh 1.x, or does not let us in: {cause}; expected a `beadline relay --listen` \
         there, with the same protocol (tcp or tls), certificates and password"
    )]
    Refused {
        /// The address.
        endpoint: String,
        /// Zenoh's message.
        cause: String,
    },
    /// Zenoh.
    #[error("the connection failed: {0}")]
    Zenoh(String),
    /// The other side does not want us.
    #[error("the other side refuses: {0}")]
    Turned(String),
    /// An error of the other side's message.
    #[error(transparent)]
    Message(#[from] MessageError),
    /// The run that is offered is none.
    #[error("the other side offers a run that cannot be")]
    Manifest(#[from] ManifestError),
    /// After a near side that went came one with another run.
    #[error(
        "the other side came back with another run: expected {expected}, found {found}{differs}; what was published of the first \
         one cannot go on"
    )]
    OtherRun {
        /// The run that was published.
        expected: RunId,
        /// The one that is offered now.
        found: RunId,
        /// An addition to the message.
        differs: &'static str,
    },
}

fn zenoh_error(error: impl fmt::Display) -> WireError {
    WireError::Zenoh(error.to_string())
}

/// Does `work`, which nothing can interrupt, in a thread of its own until it is done; none if `stop` is set before, which leaves
/// the thread to itself.
fn unless_stopped<R: Send + 'static>(
    stop: &AtomicBool,
    work: impl FnOnce() -> R + Send + 'static,
) -> Option<R> {
    let (found, finding) = sync_channel(1);
    let thread = thread::spawn(move || drop(found.send(work())));
    loop {
        match finding.recv_timeout(LOOK_PERIOD) {
            Ok(found) => return Some(found),
            Err(RecvTimeoutError::Timeout) if stop.load(Ordering::Relaxed) => return None,
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => match thread.join() {
                Err(panicked) => panic::resume_unwind(panicked),
                Ok(()) => return None,
            },
        }
    }
}

/// The connections of one side. Dropped, they are closed in order if that is soon done: Zenoh would take up to ten seconds, also
/// where nobody listens any more.
struct Connections(Session);

impl Deref for Connections {
    type Target = Session;

    fn deref(&self) -> &Session {
        &self.0
    }
}

impl Drop for Connections {
    fn drop(&mut self) {
        let (session, (closed, closing)) = (self.0.clone(), sync_channel(1));
        // whatever is left open the system closes with this process
        thread::spawn(move || {
            let _ = session.close().wait();
            let _ = closed.send(());
        });
        let _ = closing.recv_timeout(CLOSE_TIME);
    }
}

/// Zenoh's configuration: the user's as it is, in which nothing finds anybody by itself unless it says so.
fn config(path: Option<&Path>) -> Result<Config, WireError> {
    let mut config = match path {
        None => Config::default(),
        Some(path) => Config::from_file(path)
            .map_err(|cause| WireError::Config { path: path.to_owned(), cause: cause.to_string() })?,
    };
    for (key, value) in [
        ("mode", "\"peer\""),
        ("scouting/multicast/enabled", "false"),
        ("scouting/gossip/enabled", "false"),
        ("connect/retry", "{ period_init_ms: 100, period_max_ms: 1000, period_increase_factor: 2 }"),
    ] {
        if config.get_json(key).is_ok_and(|found| found == "null") {
            config.insert_json5(key, value).map_err(zenoh_error)?;
        }
    }
    Ok(config)
}

fn set(config: &mut Config, key: &str, value: &str) -> Result<(), WireError> {
    config.insert_json5(key, value).map_err(zenoh_error)
}

/// Replaces defaults of Zenoh, but no value of the user's file.
fn bound(config: &mut Config, key: &str, zenohs: &str, ours: &str) -> Result<(), WireError> {
    if config.get_json(key).is_ok_and(|found| found == zenohs) { set(config, key, ours) } else { Ok(()) }
}

/// Takes no message that is longer.
fn bound_messages(config: &mut Config, most_bytes: usize) -> Result<(), WireError> {
    bound(config, "transport/link/rx/max_message_size", "1073741824", &most_bytes.to_string())
}

/// The near side's session, which listens at `endpoint` and connects to nobody.
fn listen(endpoint: &Endpoint, file: Option<&Path>) -> Result<Connections, WireError> {
    let mut config = config(file)?;
    set(&mut config, "listen/endpoints", &format!("[\"{endpoint}\"]"))?;
    bound(&mut config, "transport/unicast/accept_timeout", "10000", FIRST_WORDS_MS)?;
    bound(&mut config, "transport/unicast/accept_pending", "100", MOST_SILENT)?;
    // room for what is no request, which is answered, too
    bound_messages(&mut config, 32 * MOST_REQUEST_BYTES)?;
    zenoh::open(config)
        .wait()
        .map(Connections)
        .map_err(|cause| WireError::Listen { endpoint: endpoint.to_string(), cause: cause.to_string() })
}

/// The far side's session, which listens nowhere and takes no message longer than `most_bytes`; none if nobody listens at
/// `endpoint`.
fn connect(
    endpoint: &Endpoint,
    file: Option<&Path>,
    most_bytes: usize,
) -> Result<Option<Connections>, WireError> {
    let mut config = config(file)?;
    bound_messages(&mut config, most_bytes)?;
    // one kind of priority is all that is used: the others would have as much memory each
    bound(&mut config, "transport/unicast/qos/enabled", "true", "false")?;
    set(&mut config, "connect/endpoints", &format!("[\"{endpoint}\"]"))?;
    set(&mut config, "connect/timeout_ms", "0")?;
    set(&mut config, "connect/exit_on_failure", "true")?;
    if file.is_none() {
        set(&mut config, "listen/endpoints", "[]")?;
    }
    if !endpoint.answers() {
        return Ok(None);
    }
    let opened = zenoh::open(config).wait();
    opened
        .map(|session| Some(Connections(session)))
        .map_err(|cause| WireError::Refused { endpoint: endpoint.to_string(), cause: cause.to_string() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn endpoints_are_tcp_or_tls_with_a_port() {
        for text in ["tcp/127.0.0.1:7447", "tls/host.example:1", "tcp/[::1]:7447"] {
            assert_eq!(text.parse::<Endpoint>().unwrap().to_string(), text);
        }
        for text in
            ["", "host:7447", "udp/h:1", "tcp/h", "tcp/:1", "tcp/h:70000", "tcp/h\"],[:1", "tcp/h:1?x=y"]
        {
            assert!(text.parse::<Endpoint>().is_err(), "{text}");
        }
    }

    #[test]
    fn nothing_is_found_or_listened_to_without_being_told() {
        let config = config(None).unwrap();
        for (key, expected) in [
            ("scouting/multicast/enabled", "false"),
            ("scouting/gossip/enabled", "false"),
            ("mode", "\"peer\""),
        ] {
            assert_eq!(config.get_json(key).unwrap(), expected, "{key}");
        }
    }

    #[test]
    fn our_bounds_stand_in_the_place_of_zenohs() {
        let mut config = config(None).unwrap();
        for (key, zenohs) in [
            ("transport/unicast/accept_timeout", "10000"),
            ("transport/unicast/accept_pending", "100"),
            ("transport/unicast/qos/enabled", "true"),
            ("transport/link/rx/max_message_size", "1073741824"),
        ] {
            assert_eq!(config.get_json(key).unwrap(), zenohs, "{key}: Zenoh has another default now");
        }
        bound_messages(&mut config, 5).unwrap();
        bound_messages(&mut config, 6).unwrap();
        let found = config.get_json("transport/link/rx/max_message_size").unwrap();
        assert_eq!(found, "5", "what was set stays");
    }

    #[test]
    fn a_stop_ends_the_wait_for_what_nothing_can_interrupt() {
        let stop = AtomicBool::new(true);
        let (hold, held) = std::sync::mpsc::channel::<()>();
        assert!(unless_stopped(&stop, move || held.recv()).is_none());
        drop(hold);
        assert_eq!(unless_stopped(&AtomicBool::new(false), || 7), Some(7));
    }

    #[test]
    fn what_the_users_file_says_stays() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("zenoh.json5");
        std::fs::write(&path, "{ scouting: { gossip: { enabled: true } }, mode: 'client' }").unwrap();
        let found = config(Some(&path)).unwrap();
        assert_eq!(found.get_json("scouting/gossip/enabled").unwrap(), "true");
        assert_eq!(found.get_json("scouting/multicast/enabled").unwrap(), "false");
        assert_eq!(found.get_json("mode").unwrap(), "\"client\"");
        std::fs::write(&path, "{ no_such_key: 1 }").unwrap();
        let refused = config(Some(&path)).unwrap_err().to_string();
        assert!(refused.contains("zenoh.json5"), "{refused}");
    }
}

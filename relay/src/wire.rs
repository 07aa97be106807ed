//! The two sides over Zenoh.
//!
//! Architecture invariant: nothing outside this module names zenoh. The far side asks (a query), and the near side
//! answers with one reply after the other, no more than a window ahead of what the far side says it has done with. So no
//! queue of Zenoh's ever fills, whoever is slow, and after a cut the far side just asks again for what it does not have.

mod fetching;
mod serving;

pub use fetching::{Arrival, Fetching, Waiting};
pub use serving::Serving;
#[doc(hidden)] // for tests that speak as strangers do
pub use zenoh;

use crate::message::MessageError;
use std::fmt;
use std::net::{TcpStream, ToSocketAddrs as _};
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::Duration;
use zenoh::{Config, Session, Wait as _};

/// What a message of the near side's log is made of.
pub type Payload = zenoh::bytes::ZBytes;

/// Where runs are offered: `beadline/relay/RUN`.
const KEY: &str = "beadline/relay";
/// Where far sides say what they have done with.
const DONE_KEY: &str = "beadline/relay-done";
/// How long a request is answered before the far side asks anew; also how soon an idle near side shows that it lives.
const ANSWER_TIME: Duration = Duration::from_millis(500);
/// How long an answer may take before it is asked for again.
const ANSWER_PATIENCE: Duration = Duration::from_secs(4);
/// How long a connection may take to come about when we look whether anybody listens.
const PROBE_TIME: Duration = Duration::from_secs(2);

/// Where the near side is met, as Zenoh writes it: `tcp/HOST:PORT`.
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
    /// Whether anything listens there.
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
        /// What Zenoh says.
        cause: String,
    },
    /// Nobody can be met there.
    #[error("cannot listen at {endpoint}: {cause}")]
    Listen {
        /// Where.
        endpoint: String,
        /// What Zenoh says.
        cause: String,
    },
    /// Something listens there, but does not let us in.
    #[error(
        "what listens at {endpoint} is no Zenoh 1.x, or does not let us in: {cause}; expected a `beadline relay --listen` \
         there, with the same protocol (tcp or tls), certificates and password"
    )]
    Refused {
        /// Where.
        endpoint: String,
        /// What Zenoh says.
        cause: String,
    },
    /// Zenoh.
    #[error("the connection failed: {0}")]
    Zenoh(String),
    /// The other side does not want us.
    #[error("the other side refuses: {0}")]
    Turned(String),
    /// What came from the other side.
    #[error(transparent)]
    Message(#[from] MessageError),
}

fn zenoh_error(error: impl fmt::Display) -> WireError {
    WireError::Zenoh(error.to_string())
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

/// The near side's session, which listens at `endpoint` and connects to nobody.
fn listen(endpoint: &Endpoint, file: Option<&Path>) -> Result<Session, WireError> {
    let mut config = config(file)?;
    set(&mut config, "listen/endpoints", &format!("[\"{endpoint}\"]"))?;
    zenoh::open(config)
        .wait()
        .map_err(|cause| WireError::Listen { endpoint: endpoint.to_string(), cause: cause.to_string() })
}

/// The far side's session, which listens nowhere; none if nobody listens at `endpoint`.
fn connect(endpoint: &Endpoint, file: Option<&Path>) -> Result<Option<Session>, WireError> {
    let mut config = config(file)?;
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
        .map(Some)
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

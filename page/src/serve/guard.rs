//! Guard of the server: a request must have the token, name this server, and come from no other page.

use hyper::http::header::{self, HeaderName};
use hyper::http::{Method, request::Parts};
use std::io;
use std::net::SocketAddr;

/// 128 bits.
const TOKEN_BYTES: usize = 16;

pub(super) struct Guard {
    token: String,
    address: SocketAddr,
    /// Names of this server in browsers, with the port.
    hosts: Vec<String>,
}

impl Guard {
    /// A guard with a token of its own for the server at `address`.
    pub(super) fn new(address: SocketAddr) -> io::Result<Self> {
        let mut token = [0; TOKEN_BYTES];
        getrandom::fill(&mut token).map_err(io::Error::other)?;
        let port = address.port();
        let names = ["127.0.0.1", "localhost", "[::1]"].map(str::to_owned);
        let mut hosts: Vec<_> = names.iter().map(|host| format!("{host}:{port}")).collect();
        if port == 80 {
            // browsers leave it out
            hosts.extend(names);
        }
        hosts.push(address.to_string());
        Ok(Self { token: format!("{:032x}", u128::from_be_bytes(token)), address, hosts })
    }

    pub(super) fn url(&self) -> String {
        format!("http://{}/{}/", self.address, self.token)
    }

    /// The path below the token; none for a stranger.
    ///
    /// A page of another site can make a browser send requests here, also by a name of its own that it points at
    /// this machine: then Host or Origin is not ours.
    pub(super) fn admit<'a>(&self, parts: &'a Parts) -> Option<&'a str> {
        let is_ours = |host: &str| self.hosts.iter().any(|known| known.eq_ignore_ascii_case(host));
        let host = only(parts, &header::HOST)??;
        let origin = only(parts, &header::ORIGIN)?;
        let is_socket = parts.headers.contains_key(header::UPGRADE);
        let is_same = match origin {
            Some(origin) => {
                origin.strip_prefix("http://").is_some_and(|from| from.eq_ignore_ascii_case(host))
            }
            None => !is_socket,
        };
        let is_read = parts.method == Method::GET || parts.method == Method::HEAD;
        let (token, path) = parts.uri.path().strip_prefix('/')?.split_once('/')?;
        (is_ours(host) && is_same && is_read && is_same_text(token, &self.token)).then_some(path)
    }
}

/// The value of a header that may be there once; none where it is there in another way.
#[expect(clippy::option_option, reason = "whether it is acceptable, and whether it is there")]
fn only<'a>(parts: &'a Parts, name: &HeaderName) -> Option<Option<&'a str>> {
    let mut values = parts.headers.get_all(name).iter();
    let first = values.next();
    match (first.map(|value| value.to_str()), values.next()) {
        (None, _) => Some(None),
        (Some(Ok(text)), None) => Some(Some(text)),
        _ => None,
    }
}

/// Compares in a time that does not tell where texts differ.
fn is_same_text(one: &str, other: &str) -> bool {
    let pairs = one.bytes().zip(other.bytes());
    one.len() == other.len() && pairs.fold(0, |differing, (a, b)| differing | (a ^ b)) == 0
}

#[cfg(test)]
mod tests {
    use super::*;
    use hyper::http::Request;

    #[test]
    fn strangers_are_not_admitted() {
        let guard = Guard::new("127.0.0.1:4711".parse().expect("an address")).expect("random bytes");
        let other = Guard::new("127.0.0.1:4711".parse().expect("an address")).expect("random bytes");
        assert!(guard.token != other.token && guard.token.len() == 32);
        let home = format!("/{}/", guard.token);
        let asks = |path: &str, headers: &[(&str, &str)]| {
            let mut request = Request::builder().uri(path);
            for (name, value) in headers {
                request = request.header(*name, *value);
            }
            guard.admit(&request.body(()).expect("a request").into_parts().0).map(str::to_owned)
        };
        let host = ("host", "localhost:4711");
        assert_eq!(asks(&format!("{home}list"), &[host]).as_deref(), Some("list"));
        assert_eq!(
            asks(&home, &[("host", "127.0.0.1:4711"), ("origin", "http://127.0.0.1:4711")]).as_deref(),
            Some("")
        );
        for headers in [
            &[][..],
            &[("host", "localhost")],
            &[("host", "localhost:4712")],
            &[("host", "evil.example:4711")],
            &[host, ("host", "evil.example:4711")],
            &[host, ("origin", "http://evil.example")],
            &[host, ("origin", "null")],
            &[host, ("origin", "https://localhost:4711")],
            &[host, ("origin", "http://127.0.0.1:4711")],
            &[host, ("upgrade", "websocket")],
        ] {
            assert_eq!(asks(&home, headers), None, "{headers:?}");
        }
        for path in
            ["/", "/list", &home[..33], &format!("/{}/", other.token), &format!("/{}0/", guard.token), "//"]
        {
            assert_eq!(asks(path, &[host]), None, "{path}");
        }
    }

    #[test]
    fn browsers_leave_the_usual_port_out() {
        let guard = Guard::new("127.0.0.1:80".parse().expect("an address")).expect("random bytes");
        let admits = |host: &str| {
            let request = Request::builder().uri(format!("/{}/", guard.token)).header("host", host);
            guard.admit(&request.body(()).expect("a request").into_parts().0).is_some()
        };
        let found = ["127.0.0.1", "localhost:80", "evil.example"].map(admits);
        assert_eq!(found, [true, true, false]);
    }
}

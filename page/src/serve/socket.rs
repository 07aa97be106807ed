//! Web sockets as far as the page uses them: messages of any length to a client, short ones from it.
//!
//! # Source
//! I. Fette, A. Melnikov, The WebSocket Protocol, RFC 6455 (2011).

use super::body::Body;
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use hyper::body::Bytes;
use hyper::http::{HeaderValue, Method, Response, StatusCode, header, request::Parts};
use hyper::upgrade::{OnUpgrade, Upgraded};
use hyper_util::rt::TokioIo;
use sha1_smol::Sha1;
use std::io;
use tokio::io::{AsyncRead, AsyncReadExt as _, AsyncWrite, AsyncWriteExt as _};

/// Appended to the key of a client, by which it knows that we speak the protocol.
const GUID: &str = "258EAFA5-E914-47DA-95CA-C5AB0DC85B11";
/// Longest message of a client (bytes), as long as that of a control frame may be.
const MAX_RECEIVED_BYTES: u8 = 125;
/// The first byte of a frame that is a whole message.
const WHOLE: u8 = 0x80;

/// A message, or a control frame.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Message {
    Text(Bytes),
    Binary(Bytes),
    Close,
    Ping(Bytes),
    Pong(Bytes),
}

impl Message {
    fn opcode(&self) -> u8 {
        match self {
            Self::Text(_) => 1,
            Self::Binary(_) => 2,
            Self::Close => 8,
            Self::Ping(_) => 9,
            Self::Pong(_) => 10,
        }
    }

    /// Its bytes.
    pub(super) fn payload(&self) -> &[u8] {
        match self {
            Self::Text(bytes) | Self::Binary(bytes) | Self::Ping(bytes) | Self::Pong(bytes) => bytes,
            Self::Close => &[],
        }
    }
}

/// A client that asks for a web socket: the answer to it, and the connection that follows.
pub(super) fn upgrade(parts: &mut Parts) -> Option<(Response<Body>, OnUpgrade)> {
    let has = |name: header::HeaderName, word: &str| {
        let value = parts.headers.get(name).and_then(|value| value.to_str().ok());
        value.is_some_and(|value| value.split(',').any(|part| part.trim().eq_ignore_ascii_case(word)))
    };
    let is_asked = parts.method == Method::GET
        && has(header::CONNECTION, "upgrade")
        && has(header::UPGRADE, "websocket")
        && has(header::SEC_WEBSOCKET_VERSION, "13");
    let key = parts.headers.get(header::SEC_WEBSOCKET_KEY).filter(|_| is_asked)?;
    let mut hash = Sha1::from(key.as_bytes());
    hash.update(GUID.as_bytes());
    let accept = HeaderValue::from_str(&STANDARD.encode(hash.digest().bytes())).ok()?;
    let follows = parts.extensions.remove::<OnUpgrade>()?;
    let mut response = Response::new(Body::empty());
    *response.status_mut() = StatusCode::SWITCHING_PROTOCOLS;
    for (name, value) in [
        (header::CONNECTION, HeaderValue::from_static("upgrade")),
        (header::UPGRADE, HeaderValue::from_static("websocket")),
        (header::SEC_WEBSOCKET_ACCEPT, accept),
    ] {
        response.headers_mut().insert(name, value);
    }
    Some((response, follows))
}

/// The connection after its upgrade.
pub(super) struct Socket<S = TokioIo<Upgraded>> {
    stream: S,
    /// Received, and not taken yet.
    received: Vec<u8>,
}

impl Socket {
    pub(super) fn new(upgraded: Upgraded) -> Self {
        Self { stream: TokioIo::new(upgraded), received: Vec::new() }
    }
}

impl<S: AsyncRead + AsyncWrite + Unpin> Socket<S> {
    /// Sends a message in one frame.
    pub(super) async fn send(&mut self, message: &Message) -> io::Result<()> {
        let payload = message.payload();
        let mut head = vec![WHOLE | message.opcode()];
        match (u8::try_from(payload.len()), u16::try_from(payload.len())) {
            (Ok(length @ ..126), _) => head.push(length),
            (_, Ok(length)) => {
                head.push(126);
                head.extend(length.to_be_bytes());
            }
            _ => {
                head.push(127);
                head.extend((payload.len() as u64).to_be_bytes());
            }
        }
        self.stream.write_all(&head).await?;
        self.stream.write_all(payload).await?;
        self.stream.flush().await
    }

    /// The next message; none when the client has gone, or does not keep to what we take. If it is dropped before it is done,
    /// nothing is lost.
    pub(super) async fn receive(&mut self) -> Option<Message> {
        loop {
            if let Some(message) = self.taken()? {
                return Some(message);
            }
            let mut piece = [0; 256];
            match self.stream.read(&mut piece).await {
                Ok(count @ 1..) => self.received.extend_from_slice(&piece[..count]),
                _ => return None,
            }
        }
    }

    /// The first message that was received, if it is whole; the outer none is a client that does not keep to what we take.
    #[expect(clippy::option_option, reason = "the outer one ends the connection")]
    fn taken(&mut self) -> Option<Option<Message>> {
        let [first, second, rest @ ..] = &self.received[..] else { return Some(None) };
        // what a client sends is masked; nothing that it sends here is long, or in parts
        let length = second.checked_sub(0x80).filter(|length| *length <= MAX_RECEIVED_BYTES)?;
        let opcode = first.checked_sub(WHOLE).filter(|opcode| [1, 2, 8, 9, 10].contains(opcode))?;
        let Some((mask, rest)) = rest.split_first_chunk::<4>() else { return Some(None) };
        let Some(masked) = rest.get(..length.into()) else { return Some(None) };
        let payload: Bytes = masked.iter().zip(mask.iter().cycle()).map(|(byte, mask)| byte ^ mask).collect();
        self.received.drain(..6 + usize::from(length));
        Some(Some(match opcode {
            1 => Message::Text(payload),
            2 => Message::Binary(payload),
            8 => Message::Close,
            9 => Message::Ping(payload),
            _ => Message::Pong(payload),
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hyper::http::Request;
    use tokio::io::duplex;

    fn run<T>(work: impl Future<Output = T>) -> T {
        tokio::runtime::Builder::new_current_thread().build().expect("a runtime").block_on(work)
    }

    /// RFC 6455, sections 1.3 and 5.7.
    #[test]
    fn the_examples_of_the_standard_hold() {
        let mut hash = Sha1::from("dGhlIHNhbXBsZSBub25jZQ==");
        hash.update(GUID.as_bytes());
        assert_eq!(STANDARD.encode(hash.digest().bytes()), "s3pPLMBiTxaQ9kYGzzhZRbK+xOo=");
        let request = Request::get("/").header("Upgrade", "websocket").body(()).expect("a request");
        assert!(upgrade(&mut request.into_parts().0).is_none(), "half of what is needed");
        run(async {
            let (ours, mut client) = duplex(1 << 20);
            let mut socket = Socket { stream: ours, received: Vec::new() };
            socket.send(&Message::Text(Bytes::from_static(b"Hello"))).await.expect("taken");
            let mut sent = [0; 7];
            client.read_exact(&mut sent).await.expect("sent");
            assert_eq!(sent, [0x81, 0x05, 0x48, 0x65, 0x6c, 0x6c, 0x6f]);
            for (length, head) in
                [(256, &[0x82, 0x7e, 1, 0][..]), (65536, &[0x82, 0x7f, 0, 0, 0, 0, 0, 1, 0, 0])]
            {
                socket.send(&Message::Binary(vec![7; length].into())).await.expect("taken");
                let mut sent = vec![0; head.len() + length];
                client.read_exact(&mut sent).await.expect("sent");
                assert_eq!(&sent[..head.len()], head);
            }
            let hello = [0x81, 0x85, 0x37, 0xfa, 0x21, 0x3d, 0x7f, 0x9f, 0x4d, 0x51, 0x58];
            // in two pieces, and two at once
            client.write_all(&hello[..4]).await.expect("taken");
            client.write_all(&[&hello[4..], &hello[..]].concat()).await.expect("taken");
            for _ in 0..2 {
                assert_eq!(socket.receive().await, Some(Message::Text(Bytes::from_static(b"Hello"))));
            }
        });
    }

    #[test]
    fn what_is_not_taken_ends_the_connection() {
        let bad: [&[u8]; 5] = [
            // not masked, too long, in parts, the rest of parts, a bit that nobody has agreed on
            &[0x81, 0x05, 0x48, 0x65, 0x6c, 0x6c, 0x6f],
            &[0x81, 0xfe, 0, 200],
            &[0x01, 0x81, 0, 0, 0, 0, 7],
            &[0x80, 0x81, 0, 0, 0, 0, 7],
            &[0xc1, 0x81, 0, 0, 0, 0, 7],
        ];
        for bytes in bad {
            run(async {
                let (ours, mut client) = duplex(64);
                let mut socket = Socket { stream: ours, received: Vec::new() };
                client.write_all(bytes).await.expect("taken");
                assert_eq!(socket.receive().await, None, "{bytes:?}");
            });
        }
    }
}

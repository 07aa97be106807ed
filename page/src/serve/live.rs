//! A live run's states, from the thread that takes them to the clients that show them: the newest one wins.
//!
//! Each client has at most two states that it has not acknowledged, so a slow one skips states, and holds nobody back.

use super::socket::{Message, Socket};
use hyper::body::Bytes;
use schemas::frame::Frame;
use serde_json::{Value, json};
use std::time::Duration;
use tokio::sync::watch;
use tokio::time::{Instant, sleep_until, timeout};

/// States that a client has not acknowledged.
const MAX_IN_FLIGHT: usize = 2;
/// A client that takes nothing, or acknowledges nothing, for so long is let go.
const PATIENCE: Duration = Duration::from_secs(30);
/// Version of the binary messages.
const VERSION: f64 = 1.0;

/// State of a live run for clients; numbers tell them the parts that they have seen.
#[derive(Default)]
struct Shown {
    run: Option<Bytes>,
    status: (u64, Bytes),
    state: (u64, Bytes),
    end: Option<Bytes>,
}

/// Shows a live run to its clients.
pub struct LiveWriter(watch::Sender<Shown>);

/// Latest state of a live run for a client.
#[derive(Clone)]
pub struct LiveFeed(watch::Receiver<Shown>);

impl LiveWriter {
    /// A run of which nothing is known yet, and a feed of it.
    pub fn new() -> (Self, LiveFeed) {
        let (sender, receiver) = watch::channel(Shown::default());
        (Self(sender), LiveFeed(receiver))
    }

    /// Number of feeds.
    pub fn feed_count(&self) -> usize {
        self.0.receiver_count()
    }

    /// Shows which run it is: manifest and chain.
    pub fn begin(&self, run: &Value) {
        let text = json!({ "run": run }).to_string().into();
        self.0.send_modify(|shown| shown.run = Some(text));
    }

    /// Shows how the run is doing.
    pub fn status(&self, status: &Value) {
        let text: Bytes = json!({ "status": status }).to_string().into();
        self.0.send_modify(|shown| shown.status = (shown.status.0 + 1, text));
    }

    /// Shows a state: `[1, N, E, frame, step, time_s, seen, skipped | u | v | extra]`, little-endian doubles. `seen` and
    /// `skipped` count frames, this one among them.
    pub fn state(&self, frame: &Frame<'_>, seen: u64, skipped: u64) {
        let beads = frame.u_m.len();
        let extra = frame.extra.len().checked_div(beads).unwrap_or(0);
        let head = [VERSION, beads as f64, extra as f64, frame.frame as f64, frame.step as f64, frame.time_s];
        let mut bytes = Vec::with_capacity(8 * (8 + (2 + extra) * beads));
        for values in [&head[..], &[seen as f64, skipped as f64], frame.u_m, frame.v_m_s, frame.extra] {
            for value in values {
                bytes.extend_from_slice(&value.to_le_bytes());
            }
        }
        let bytes = Bytes::from(bytes);
        self.0.send_modify(|shown| shown.state = (shown.state.0 + 1, bytes));
    }

    /// Ends the feed, with the reason and the run's last step, if that is known: a client that never holds a run back
    /// may have missed it.
    pub fn end(&self, reason: &str, last_step: Option<u64>) {
        let text = json!({ "end": reason, "step": last_step }).to_string().into();
        self.0.send_modify(|shown| shown.end = Some(text));
    }
}

/// Progress of a client.
#[derive(Default)]
struct Seen {
    run: bool,
    status: u64,
    state: u64,
    in_flight: usize,
}

impl Seen {
    /// The next message that is due; none until something new comes, or an acknowledgement.
    fn next(&mut self, shown: &Shown) -> Option<(Message, IsLast)> {
        let text = |text: &Bytes| Message::Text(text.clone());
        let message = if let (Some(run), false) = (&shown.run, self.run) {
            self.run = true;
            text(run)
        } else if self.run && shown.state.0 > self.state && self.in_flight < MAX_IN_FLIGHT {
            self.state = shown.state.0;
            self.in_flight += 1;
            Message::Binary(shown.state.1.clone())
        } else if self.run && shown.status.0 > self.status {
            self.status = shown.status.0;
            text(&shown.status.1)
        } else if let (Some(end), true) = (&shown.end, shown.state.0 == self.state) {
            return Some((text(end), true));
        } else {
            return None;
        };
        Some((message, false))
    }
}

type IsLast = bool;

/// Shows a run to a client until one of them ends.
pub(super) async fn show(mut socket: Socket, mut feed: LiveFeed) {
    let mut seen = Seen::default();
    let (mut heard_at, mut is_open) = (Instant::now(), true);
    loop {
        loop {
            if seen.in_flight == 0 {
                heard_at = Instant::now();
            }
            let next = seen.next(&feed.0.borrow_and_update());
            let Some((message, is_last)) = next else { break };
            let is_sent = matches!(timeout(PATIENCE, socket.send(&message)).await, Ok(Ok(())));
            if !is_sent || is_last {
                // the close is answered by the client, or not
                let _ = timeout(PATIENCE, socket.send(&Message::Close)).await;
                return;
            }
        }
        tokio::select! {
            // the end stays to be told when the thread that took the states is gone
            changed = feed.0.changed(), if is_open => {
                is_open = changed.is_ok();
                if !is_open && feed.0.borrow().end.is_none() {
                    return;
                }
            }
            received = socket.receive() => match received {
                Some(Message::Text(text)) if text == "ack" && seen.in_flight > 0 => {
                    seen.in_flight -= 1;
                    heard_at = Instant::now();
                }
                Some(Message::Ping(bytes)) => {
                    let _ = timeout(PATIENCE, socket.send(&Message::Pong(bytes))).await;
                }
                Some(Message::Pong(_)) => {}
                _ => return,
            },
            () = sleep_until(heard_at + PATIENCE), if seen.in_flight > 0 => return,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn due(seen: &mut Seen, feed: &LiveFeed) -> Vec<String> {
        let mut due = Vec::new();
        while let Some((message, is_last)) = seen.next(&feed.0.borrow()) {
            due.push(match message {
                Message::Text(text) => String::from_utf8_lossy(&text).into_owned(),
                message => format!("{} bytes", message.payload().len()),
            });
            if is_last {
                break;
            }
        }
        due
    }

    #[test]
    fn two_states_are_in_flight_and_the_newest_wins() {
        let (writer, feed) = LiveWriter::new();
        let mut seen = Seen::default();
        let frame =
            Frame { frame: 7, step: 70, time_s: 0.5, u_m: &[1.0], v_m_s: &[2.0], extra: &[], active: None };
        writer.state(&frame, 1, 0);
        assert_eq!(due(&mut seen, &feed), [""; 0], "the run comes first");
        writer.begin(&json!(1));
        assert_eq!(due(&mut seen, &feed), [r#"{"run":1}"#, "80 bytes"]);
        for seen_count in 2..9 {
            writer.state(&frame, seen_count, 0);
            writer.status(&json!(seen_count));
            let expected: &[&str] = if seen_count == 2 { &["80 bytes"] } else { &[] };
            let due = due(&mut seen, &feed);
            assert_eq!(due[..due.len() - 1], *expected);
        }
        writer.end("complete", Some(70));
        assert_eq!(due(&mut seen, &feed), [""; 0], "the last state has not been seen");
        seen.in_flight -= 1;
        let last = feed.0.borrow().state.1.clone();
        let doubles: Vec<f64> =
            last.chunks(8).map(|bytes| f64::from_le_bytes(bytes.try_into().expect("8 bytes"))).collect();
        assert_eq!(doubles, [1.0, 1.0, 0.0, 7.0, 70.0, 0.5, 8.0, 0.0, 1.0, 2.0]);
        assert_eq!(due(&mut seen, &feed), ["80 bytes", r#"{"end":"complete","step":70}"#]);
    }
}

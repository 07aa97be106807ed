//! Rooms of connections: three, of bounded size. If a room is full, a newcomer takes the place of an idle connection.
//!
//! Architecture invariant: accepting a connection waits for no client. A connection begins among the strangers, who
//! have little room and little time. The token leads to the known clients, and a web socket to the viewers.

use std::collections::BTreeMap;
use std::io;
use std::pin::Pin;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll, ready};
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncWrite, Interest, ReadBuf};
use tokio::net::TcpStream;
use tokio::sync::Notify;
use tokio::time::{Instant, sleep, timeout};

/// Most connections that have not shown the token: a browser opens six at once, and some in advance.
const MAX_STRANGERS: usize = 32;
/// Most connections that have: ten tabs with six each.
const MAX_KNOWN: usize = 64;
/// Most viewers of live runs.
const MAX_VIEWERS: usize = 16;
/// Time for a stranger to send a request with the token.
const STRANGER_TIME: Duration = Duration::from_secs(10);
/// A client that takes nothing of an answer for so long is let go of.
const PATIENCE: Duration = Duration::from_secs(30);
/// Interval at which each connection is checked.
const LOOK_PERIOD: Duration = Duration::from_millis(500);
/// Bytes that a connection is sent before others have their turn: some microseconds.
const TURN_BYTES: usize = 64 << 10;
/// Connections that go where the system grants no more files: recordings need some, too.
const MADE_WAY: usize = 8;

/// Room of a connection, in the order in which they make way for others.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Room {
    Strangers,
    Known,
    Viewers,
}

impl Room {
    fn size(self) -> usize {
        match self {
            Self::Strangers => MAX_STRANGERS,
            Self::Known => MAX_KNOWN,
            Self::Viewers => MAX_VIEWERS,
        }
    }
}

#[derive(Debug)]
struct Visit {
    room: Room,
    /// When it came to the room, or was last heard of there; strangers are not heard.
    since: Instant,
    /// Since when it takes nothing of an answer.
    stuck: Option<Instant>,
    /// True if we have not answered yet.
    waits: bool,
    dismissed: Arc<Notify>,
}

impl Visit {
    /// The smallest one goes first.
    fn precedence(&self) -> (bool, Instant) {
        (self.waits && self.stuck.is_none(), self.stuck.unwrap_or(self.since))
    }

    fn is_overdue(&self) -> bool {
        let stuck = self.stuck.is_some_and(|since| since.elapsed() >= PATIENCE);
        stuck || (self.room == Room::Strangers && self.since.elapsed() >= STRANGER_TIME)
    }
}

#[derive(Debug, Default)]
struct Visits {
    next: u64,
    all: BTreeMap<u64, Visit>,
}

impl Visits {
    /// Makes room for one more.
    fn make_way(&mut self, room: Room) {
        let others = || self.all.iter().filter(|(_, visit)| visit.room == room);
        if others().count() >= room.size() {
            let first = others().min_by_key(|(_, visit)| visit.precedence());
            self.dismiss(first.map(|(number, _)| *number));
        }
    }

    fn dismiss(&mut self, number: Option<u64>) {
        if let Some(visit) = number.and_then(|number| self.all.remove(&number)) {
            visit.dismissed.notify_one();
        }
    }
}

/// All who are connected.
#[derive(Debug, Clone, Default)]
pub(super) struct Rooms(Arc<Mutex<Visits>>);

impl Rooms {
    fn lock(&self) -> MutexGuard<'_, Visits> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A stranger comes.
    pub(super) fn enter(&self) -> Guest {
        let dismissed = Arc::new(Notify::new());
        let mut visits = self.lock();
        visits.make_way(Room::Strangers);
        let number = visits.next;
        visits.next += 1;
        let (room, since) = (Room::Strangers, Instant::now());
        let visit = Visit { room, since, stuck: None, waits: false, dismissed: Arc::clone(&dismissed) };
        visits.all.insert(number, visit);
        Guest { rooms: self.clone(), number, dismissed }
    }

    /// Some go, because there are too many open files: strangers first.
    pub(super) fn make_way(&self) {
        let mut visits = self.lock();
        for _ in 0..MADE_WAY {
            let first = visits.all.iter().min_by_key(|(_, visit)| (visit.room, visit.precedence()));
            let number = first.map(|(number, _)| *number);
            visits.dismiss(number);
        }
    }
}

/// A connection, for as long as it is open.
#[derive(Debug)]
pub(super) struct Guest {
    rooms: Rooms,
    number: u64,
    dismissed: Arc<Notify>,
}

impl Guest {
    fn with<T>(&self, look: impl FnOnce(&mut Visit) -> T) -> Option<T> {
        self.rooms.lock().all.get_mut(&self.number).map(look)
    }

    /// Goes to another room, unless it is there, or farther.
    pub(super) fn goes_to(&self, room: Room) {
        let mut visits = self.rooms.lock();
        let comes = visits.all.get(&self.number).is_some_and(|visit| visit.room < room);
        if comes {
            visits.make_way(room);
            if let Some(visit) = visits.all.get_mut(&self.number) {
                (visit.room, visit.since) = (room, Instant::now());
            }
        }
    }

    /// Notes if an answer is being found.
    pub(super) fn waits(&self, waits: bool) {
        self.with(|visit| visit.waits = waits);
    }

    fn sent(&self) {
        self.with(|visit| {
            if visit.room != Room::Strangers {
                visit.since = Instant::now();
            }
        });
    }

    fn took(&self, is_taken: bool) {
        self.with(|visit| {
            visit.stuck = (!is_taken).then(|| visit.stuck.unwrap_or_else(Instant::now));
            // viewers are shown more whether they look or not
            if is_taken && visit.room == Room::Known {
                visit.since = Instant::now();
            }
        });
    }

    /// Returns when another takes its place, or its time is over.
    pub(super) async fn dismissed(&self) {
        while timeout(LOOK_PERIOD, self.dismissed.notified()).await.is_err() {
            if self.with(|visit| visit.is_overdue()).unwrap_or(true) {
                return;
            }
        }
    }

    /// Returns when it has left the connection `stream` and waits for an answer. Its next request may already be there
    /// to be read, and hides the end from the answering task.
    pub(super) async fn left(&self, stream: &TcpStream) {
        loop {
            sleep(LOOK_PERIOD).await;
            let ready = timeout(Duration::ZERO, stream.ready(Interest::READABLE)).await;
            let is_closed = matches!(ready, Ok(Ok(ready)) if ready.is_read_closed());
            if is_closed && self.with(|visit| visit.waits).unwrap_or(true) {
                return;
            }
        }
    }
}

impl Drop for Guest {
    fn drop(&mut self) {
        self.rooms.lock().all.remove(&self.number);
    }
}

/// A connection whose guest is known by the bytes that pass.
#[derive(Debug)]
pub(super) struct Line {
    stream: Arc<TcpStream>,
    guest: Arc<Guest>,
    sent_bytes: usize,
}

impl Line {
    pub(super) fn new(stream: Arc<TcpStream>, guest: Arc<Guest>) -> Self {
        Self { stream, guest, sent_bytes: 0 }
    }

    /// Writes some of `bytes`, unless it is the turn of others.
    fn write(&mut self, context: &mut Context<'_>, bytes: &[u8]) -> Poll<io::Result<usize>> {
        if self.sent_bytes >= TURN_BYTES {
            self.sent_bytes = 0;
            context.waker().wake_by_ref();
            return Poll::Pending;
        }
        let bytes = &bytes[..bytes.len().min(TURN_BYTES)];
        loop {
            let ready = self.stream.poll_write_ready(context);
            self.guest.took(ready.is_ready());
            ready!(ready)?;
            match self.stream.try_write(bytes) {
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
                written => {
                    self.sent_bytes += written.as_ref().map_or(0, |count| *count);
                    return Poll::Ready(written);
                }
            }
        }
    }
}

impl AsyncRead for Line {
    fn poll_read(
        self: Pin<&mut Self>,
        context: &mut Context<'_>,
        into: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        loop {
            ready!(self.stream.poll_read_ready(context))?;
            match self.stream.try_read(into.initialize_unfilled()) {
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
                read => {
                    self.guest.sent();
                    return Poll::Ready(read.map(|count| into.advance(count)));
                }
            }
        }
    }
}

impl AsyncWrite for Line {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        self.write(context, bytes)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        pieces: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        let first = pieces.iter().find(|piece| !piece.is_empty());
        self.write(context, first.map_or(&[], |first| first))
    }

    fn is_write_vectored(&self) -> bool {
        true // else a page would be copied to stand behind its head
    }

    fn poll_flush(self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<io::Result<()>> {
        Poll::Ready(Ok(())) // nothing is kept back here
    }

    fn poll_shutdown(self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<io::Result<()>> {
        Poll::Ready(Ok(())) // a connection ends for both sides when it is dropped, which comes next
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers(rooms: &Rooms, room: Room) -> Vec<u64> {
        rooms.lock().all.iter().filter(|(_, visit)| visit.room == room).map(|(number, _)| *number).collect()
    }

    #[test]
    fn who_is_in_a_full_room_for_nothing_makes_way() {
        let rooms = Rooms::default();
        let mut guests: Vec<_> = (0..=MAX_STRANGERS).map(|_| rooms.enter()).collect();
        assert_eq!(numbers(&rooms, Room::Strangers), (1..=MAX_STRANGERS as u64).collect::<Vec<_>>());
        // what a stranger sends gains no time
        guests[1].sent();
        guests.push(rooms.enter());
        assert!(guests[1].with(|_| ()).is_none() && guests[2].with(|_| ()).is_some());

        guests.clear();
        let comes = || {
            let guest = rooms.enter();
            guest.goes_to(Room::Known);
            guest
        };
        let known: Vec<_> = (0..MAX_KNOWN).map(|_| comes()).collect();
        let stays = |guest: usize| known[guest].with(|_| ()).is_some();
        known[0].waits(true); // for us
        known[1].sent();
        known[3].took(false);
        known[3].with(|visit| visit.stuck = Some(visit.since - PATIENCE));
        for gone in [3, 2, 4] {
            assert!(stays(gone));
            guests.push(comes());
            assert!(!stays(gone) && stays(0) && stays(1), "{gone}");
        }
        // whoever goes where files are missing is a stranger, if there is one
        guests.extend((0..=MADE_WAY).map(|_| rooms.enter()));
        rooms.make_way();
        assert_eq!(numbers(&rooms, Room::Strangers).len(), 1);
        assert_eq!(numbers(&rooms, Room::Known).len(), MAX_KNOWN);
    }
    #[test]
    fn a_stranger_has_little_time_and_nobody_reads_nothing_for_ever() {
        let rooms = Rooms::default();
        let (stranger, known) = (rooms.enter(), rooms.enter());
        known.goes_to(Room::Known);
        let is_overdue = |guest: &Guest, by: Duration| {
            guest.with(|visit| {
                visit.since -= by;
                visit.stuck = visit.stuck.map(|since| since - by);
                visit.is_overdue()
            })
        };
        assert_eq!(is_overdue(&stranger, Duration::ZERO), Some(false));
        assert_eq!(is_overdue(&stranger, STRANGER_TIME), Some(true));
        // one who is known may be silent, but not take nothing
        assert_eq!(is_overdue(&known, PATIENCE), Some(false));
        known.took(false);
        assert_eq!(is_overdue(&known, PATIENCE), Some(true));
        known.took(true);
        assert_eq!(is_overdue(&known, PATIENCE), Some(false));
    }
}

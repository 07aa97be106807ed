//! The blackboard of a run: its manifest and its progress.

use super::creating::{Wanted, root_of};
use super::manifest_file::{self, ManifestFile};
use super::services::{BoardService, MAX_SUBSCRIBERS, attributes, open, service_name, text_of};
use super::wire::{MANIFEST_BYTES, ManifestText, RunStatus};
use super::{Bus, Ipc};
use crate::{BusError, StreamId};
use iceoryx2::node::Node;
use iceoryx2::port::reader::{EntryHandle, Reader};
use iceoryx2::port::writer::{EntryHandleMut, Writer};
use iceoryx2::prelude::{MessagingPattern, ZeroCopySend};
use schemas::results::Topic;
use schemas::run_name::RunName;
use std::path::PathBuf;
use std::time::{Duration, Instant, SystemTime};

const KEY_MANIFEST: u64 = 0;
const KEY_STATUS: u64 = 1;
const KEY_PREVIOUS: u64 = 2;
const MAX_READERS: usize = 4 * MAX_SUBSCRIBERS;
/// Longest time that the writer of a producer that is going away may stay registered.
const PATIENCE: Duration = Duration::from_secs(2);

/// The producer's side of the blackboard.
///
/// An entry is held for no longer than one update: a producer that is killed while it holds one leaves it
/// locked for as long as any consumer keeps the blackboard open, and the next producer could not take it over.
pub(super) struct BoardWriter {
    writer: Writer<Ipc, u64>,
    service: BoardService,
    text: String,
    held: Option<EntryHandleMut<Ipc, u64, RunStatus>>,
    /// The manifest, if it is long.
    _file: Option<ManifestFile>,
}

impl BoardWriter {
    /// Creates the blackboard, or takes over the one that an earlier producer left.
    pub(super) fn create(
        bus: &Bus,
        node: &Node<Ipc>,
        run: &RunName,
        manifest: &[u8],
        status: RunStatus,
    ) -> Result<Self, BusError> {
        let (text, name, attributes) =
            (text_of(run, Topic::Manifest), service_name(run, Topic::Manifest)?, attributes(&[])?);
        let is_long = manifest.len() > MANIFEST_BYTES;
        let file = is_long.then(|| ManifestFile::write(bus, node, manifest)).transpose()?;
        let written = file.as_ref().map_or(manifest, |file| file.name().as_bytes());
        let entry = manifest_text(written, manifest.len(), status.stream());
        let create = || {
            let creator = node.service_builder(&name).blackboard_creator::<u64>();
            let creator = creator.max_readers(MAX_READERS).max_nodes(MAX_READERS);
            let creator = creator.add(KEY_MANIFEST, *entry).add(KEY_STATUS, status);
            let creator = creator.add(KEY_PREVIOUS, RunStatus::default());
            creator.create_with_attributes(&attributes)
        };
        let wanted = Wanted { node, text: &text, name: &name, pattern: MessagingPattern::Blackboard };
        let opener = || node.service_builder(&name).blackboard_opener::<u64>().open();
        let (service, new) = wanted.open_or_create(opener, create)?;
        let start = Instant::now();
        let writer = loop {
            match service.writer_builder().create() {
                Ok(writer) => break writer,
                Err(e) if start.elapsed() >= PATIENCE => return Err(BusError::service(&text, "write", &e)),
                Err(_) => {
                    node.try_cleanup_dead_nodes();
                    std::thread::sleep(Duration::from_millis(2));
                }
            }
        };
        let board = Self { writer, service, text, held: None, _file: file };
        if !new {
            board.take_over(&entry, status)?;
        }
        Ok(board)
    }

    fn take_over(&self, manifest: &ManifestText, status: RunStatus) -> Result<(), BusError> {
        let readable = self.service.reader_builder().create();
        let reader = readable.map_err(|e| BusError::service(&self.text, "read", &e))?;
        if let Ok(old) = reader.entry::<RunStatus>(&KEY_STATUS) {
            self.put(KEY_PREVIOUS, *old.get())?;
        }
        // readers check that manifest and status are of one stream, so the order does not matter to them
        self.put(KEY_MANIFEST, *manifest)?;
        self.put(KEY_STATUS, status)
    }

    fn put<T: Copy + ZeroCopySend + 'static>(&self, key: u64, value: T) -> Result<(), BusError> {
        let entry = self.writer.entry::<T>(&key);
        let entry = entry.map_err(|e| BusError::Service {
            service: self.text.clone(),
            doing: "take over",
            cause: format!(
                "{e:?}: its producer was killed while it wrote, and consumers still hold it; \
                 end those consumers, or use another run name"
            ),
        })?;
        entry.update_with_copy(value);
        Ok(())
    }

    /// Writes `status`, the progress of the run, and fills in the time of writing.
    pub(super) fn write(&self, status: &mut RunStatus) -> Result<(), BusError> {
        status.written_unix_ns = unix_ns();
        match &self.held {
            Some(entry) => entry.update_with_copy(*status),
            None => self.put(KEY_STATUS, *status)?,
        }
        Ok(())
    }

    /// Holds the entry, as a simpler program would; for tests.
    pub(super) fn hold(&mut self) -> Result<(), BusError> {
        let entry = self.writer.entry::<RunStatus>(&KEY_STATUS);
        self.held = Some(entry.map_err(|e| BusError::service(&self.text, "hold", &e))?);
        Ok(())
    }
}

pub(super) fn unix_ns() -> u64 {
    let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    u64::try_from(since.as_nanos()).unwrap_or(u64::MAX)
}

#[expect(clippy::large_stack_arrays, reason = "once a run; 64 KiB fit any stack")]
fn manifest_text(written: &[u8], length: usize, stream: StreamId) -> Box<ManifestText> {
    let mut json = [0; MANIFEST_BYTES];
    json[..written.len()].copy_from_slice(written);
    Box::new(ManifestText {
        run_id: stream.run_id.0,
        stream_id: stream.stream_id,
        length_bytes: length as u64,
        json,
    })
}

/// A consumer's side of the blackboard.
pub(super) struct BoardReader {
    manifest: EntryHandle<Ipc, u64, ManifestText>,
    status: EntryHandle<Ipc, u64, RunStatus>,
    previous: EntryHandle<Ipc, u64, RunStatus>,
    root: PathBuf,
    _reader: Reader<Ipc, u64>,
    _service: BoardService,
}

impl BoardReader {
    /// Opens the blackboard of `run`, if it is there.
    pub(super) fn find(node: &Node<Ipc>, run: &RunName) -> Result<Option<Self>, BusError> {
        let (text, name) = (text_of(run, Topic::Manifest), service_name(run, Topic::Manifest)?);
        let opener = || node.service_builder(&name).blackboard_opener::<u64>().open();
        let Some(service) = open(&text, opener)? else { return Ok(None) };
        let unreadable = |e: &dyn std::fmt::Debug| BusError::service(&text, "read", e);
        let reader = service.reader_builder().create().map_err(|e| unreadable(&e))?;
        Ok(Some(Self {
            manifest: reader.entry(&KEY_MANIFEST).map_err(|e| unreadable(&e))?,
            status: reader.entry(&KEY_STATUS).map_err(|e| unreadable(&e))?,
            previous: reader.entry(&KEY_PREVIOUS).map_err(|e| unreadable(&e))?,
            root: root_of(node.config()),
            _reader: reader,
            _service: service,
        }))
    }

    /// Progress of the stream that was published last.
    pub(super) fn status(&self) -> RunStatus {
        *self.status.get()
    }

    /// Progress of `stream`, if it is the present stream or the one before.
    pub(super) fn status_of(&self, stream: StreamId) -> Option<RunStatus> {
        let (now, before) = (self.status(), *self.previous.get());
        [now, before].into_iter().find(|status| status.stream() == stream)
    }

    /// Bytes of the manifest, if it belongs to `stream`; the file of a long manifest goes with its producer.
    pub(super) fn manifest(&self, stream: StreamId) -> Option<Vec<u8>> {
        let text = self.manifest.get();
        let same = text.run_id == stream.run_id.0 && text.stream_id == stream.stream_id;
        let length = usize::try_from(text.length_bytes).ok()?;
        let long = || manifest_file::read(&self.root, &text.json, length);
        same.then(|| text.json.get(..length).map(<[u8]>::to_vec).or_else(long)).flatten()
    }
}

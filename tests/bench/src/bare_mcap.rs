//! Measure for recordings: the same bytes through the bare mcap crate.

use mcap::records::MessageHeader;
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use recording::{Compression, PROFILE};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufWriter, Read};
use std::path::Path;

/// Writes messages of one channel to a new MCAP file, by nothing but mcap's writer in this thread: chunks of a
/// MiB, no syncing, no checks of ours.
pub(crate) struct BareWriter {
    writer: mcap::Writer<BufWriter<File>>,
    channel_id: u16,
    sequence: u32,
}

impl BareWriter {
    /// Creates the file `path`, or empties it.
    pub(crate) fn create(path: &Path, compression: Compression) -> io::Result<Self> {
        let (compression, level) = match compression {
            Compression::None => (None, 0),
            Compression::Zstd { level } => (Some(mcap::Compression::Zstd), level),
        };
        let options = mcap::WriteOptions::new()
            .profile(PROFILE)
            .compression(compression)
            .compression_level(level)
            .compression_threads(0)
            .chunk_size(Some(1 << 20));
        let mut writer = options.create(BufWriter::new(File::create(path)?)).map_err(io::Error::other)?;
        let channel_id = writer.add_channel(0, "/bytes", "", &BTreeMap::new()).map_err(io::Error::other)?;
        Ok(Self { writer, channel_id, sequence: 0 })
    }

    /// Writes a message.
    pub(crate) fn write(&mut self, message: &[u8]) -> io::Result<()> {
        let (channel_id, sequence) = (self.channel_id, self.sequence);
        self.sequence += 1;
        let header = MessageHeader { channel_id, sequence, log_time: 0, publish_time: 0 };
        self.writer.write_to_known_channel(&header, message).map_err(io::Error::other)
    }

    /// Ends the file.
    pub(crate) fn finish(mut self) -> io::Result<()> {
        self.writer.finish().map(drop).map_err(io::Error::other)
    }
}

/// Reads all messages of the MCAP file `path` by nothing but mcap's streaming reader, with every CRC checked, and
/// returns how many bytes they have.
pub(crate) fn read_all(path: &Path) -> io::Result<u64> {
    let options = LinearReaderOptions::default()
        .with_validate_chunk_crcs(true)
        .with_validate_data_section_crc(true)
        .with_validate_summary_section_crc(true);
    let mut reader = LinearReader::new_with_options(options);
    let (mut file, mut message_bytes) = (File::open(path)?, 0);
    while let Some(event) = reader.next_event() {
        match event.map_err(io::Error::other)? {
            LinearReadEvent::ReadRequest(need) => {
                let read = file.read(reader.insert(need))?;
                reader.notify_read(read);
            }
            LinearReadEvent::Record { opcode: mcap::records::op::MESSAGE, data } => {
                message_bytes += data.len() as u64;
            }
            LinearReadEvent::Record { .. } => {}
        }
    }
    Ok(message_bytes)
}

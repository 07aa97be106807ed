//! Rows of results, read back.

use crate::error::ReadError;
use crate::read::messages::MessageReader;
use crate::results::contacts::widths;
use crate::results::row_messages::{RecordedRow, RowMessages};
use std::path::Path;

/// Reads the rows of one topic, in the order of the file.
pub struct RecordedRows {
    messages: MessageReader,
    topic: String,
    /// The number of the channel read last, and the layout of its rows.
    channel: Option<(u16, RowMessages)>,
}

impl RecordedRows {
    /// The rows of `topic` in the recording `path`.
    ///
    /// # Errors
    /// When it cannot be read, or is no recording.
    pub fn open(path: &Path, topic: &str) -> Result<Self, ReadError> {
        Ok(Self { messages: MessageReader::open(path)?, topic: topic.to_owned(), channel: None })
    }

    /// The topic.
    pub fn topic(&self) -> &str {
        &self.topic
    }

    /// Names of the values of the row that was read last: of all values, or of the values of each thing.
    pub fn names(&self) -> Vec<&str> {
        self.channel.as_ref().map(|(_, rows)| rows.names()).unwrap_or_default()
    }

    /// The next row; none after the last.
    ///
    /// # Errors
    /// When the file is damaged, or a message is not of the topic.
    pub fn next_row(&mut self) -> Result<Option<RecordedRow>, ReadError> {
        let widths = widths(self.messages.manifest());
        while let Some(message) = self.messages.next()? {
            if message.channel.topic != self.topic {
                continue;
            }
            let id = message.head.channel_id;
            if self.channel.as_ref().is_none_or(|(known, _)| *known != id) {
                self.channel = RowMessages::of_channel(message.channel).map(|rows| (id, rows));
            }
            let unknown = || format!("its schema {} describes no rows", message.channel.schema.name);
            let rows = self.channel.as_ref().ok_or_else(unknown);
            let (offset, row) =
                (message.offset, rows.and_then(|(_, rows)| rows.decode(message.data, &widths)));
            return row.map(Some).map_err(|what| ReadError::damaged(self.messages.path(), offset, what));
        }
        Ok(None)
    }
}

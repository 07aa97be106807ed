//! Comparisons of an audit after everything has been read: the end, the summary section, the definitions of channels.

use super::Audit;
use crate::proto;
use crate::read::contents::Channel;
use crate::read::records::RecordReader;
use crate::repair::layout::SummarySection;
use crate::results::row_messages::{RowMessages, name_of_results};
use schemas::frame::EndReason;
use schemas::manifest::SCHEMA_VERSION;

impl Audit {
    /// Checks that the record of the end agrees with that of the beginning and with the states.
    pub(super) fn check_end(&mut self) {
        let (begin, Some(end)) = (self.begin().clone(), self.end().cloned()) else { return };
        let mut wrong = Vec::new();
        if end.part != begin.part || end.previous_state_hash != begin.previous_state_hash {
            wrong.push(format!(
                "it ends as part {} and begins as part {}, or with another hash of the part before",
                end.part, begin.part
            ));
        }
        if matches!(end.reason, EndReason::Stopped | EndReason::Unfinished) {
            wrong.push(format!("its end has the reason `{}`, with which no recording ends", end.reason));
        }
        if self.messages.loss_count() == 0 && self.last_step.is_some() {
            let ends = [("first", end.first_step, self.first_step), ("last", end.last_step, self.last_step)];
            for (which, said, found) in ends.into_iter().filter(|(_, said, found)| said != found) {
                let text = |step: Option<u64>| step.map_or("none".to_owned(), |step| step.to_string());
                wrong.push(format!(
                    "its end says that the {which} state is of step {}, but it is of step {}",
                    text(said),
                    text(found),
                ));
            }
            if end.last_state_hash.is_none() {
                wrong.push("its end has no hash of the last state".to_owned());
            }
            let is_last = self.last_step == Some(self.manifest.physics.step_count);
            if is_last && matches!(end.reason, EndReason::Interrupted | EndReason::Continued) {
                wrong.push(format!(
                    "it ends with the last step of the run, but its end says `{}`",
                    end.reason
                ));
            }
        }
        for what in wrong {
            self.messages.note_about_file(what);
        }
    }

    /// Checks that the summary section describes the file correctly.
    pub(super) fn check_summary_section(&mut self) {
        if self.messages.loss_count() > 0 {
            return;
        }
        let Ok(mut records) = RecordReader::open(self.messages.path()) else { return };
        let Some(salvage) = self.messages.salvage() else { return };
        let layout = std::mem::take(&mut salvage.layout);
        match layout.compare(&mut records, self.messages.contents(), &self.counts, self.times_ns) {
            SummarySection::Absent => {}
            SummarySection::Compared(wrong) => {
                self.has_summary_section = true;
                self.messages.note_descriptions(wrong);
            }
        }
    }

    /// Checks that our channels have the right schemas.
    pub(super) fn check_definitions(&mut self) {
        if self.manifest.is_newer_minor() {
            return;
        }
        // an older version said less of a channel
        let is_ours = self.manifest.schema_version == SCHEMA_VERSION;
        let channels = self.messages.contents().channels.values().filter(|_| is_ours);
        let wrong: Vec<_> = channels.filter_map(wrong_definition).collect();
        for what in wrong {
            self.messages.note_about_file(what);
        }
        let is_whole = self.messages.loss_count() == 0 && self.last_step.is_some();
        if is_whole && self.chain_count == 0 {
            self.messages.note_about_file("there is no message of `/chain`".to_owned());
        }
    }
}

/// The fault in the definition of a channel, if it has a schema of ours.
fn wrong_definition(channel: &Channel) -> Option<String> {
    let by_topic = proto::ALL.iter().take(proto::OF_FRAMES.len()).find(|known| known.topic == channel.topic);
    let by_name = || proto::ALL.iter().find(|known| known.message == channel.schema.name);
    let (message, descriptor) = match by_topic.or_else(by_name) {
        Some(known) => (known.message, known.descriptor.to_vec()),
        None if name_of_results(channel).is_some_and(|name| !name.is_own()) => {
            let rows = RowMessages::of_channel(channel);
            (channel.schema.name.as_str(), rows.map(|rows| rows.descriptor()).unwrap_or_default())
        }
        None => return None,
    };
    let is_right = channel.schema.name == message
        && channel.message_encoding == "protobuf"
        && channel.schema.encoding == "protobuf"
        && *channel.schema.text == *descriptor;
    (!is_right)
        .then(|| format!("the channel `{}` has not the schema of {message} that we know", channel.topic))
}

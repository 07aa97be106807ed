//! Lists of things that were proven, that were compared, and that cannot be known.

use super::Verified;
use super::run_toml::RunToml;
use crate::display::{count, counted};
use producer::verification::Follows;
use schemas::frame::EndReason;
use serde::Serialize;

/// Records of others that are listed by name; more are only counted.
const MOST_RECORDS: usize = 100;

/// One sentence for each thing.
#[derive(Debug, Default, Serialize)]
pub(super) struct Lists {
    /// Made again, with the same bits.
    pub(super) proven: Vec<String>,
    /// Agrees with other places of the file.
    pub(super) compared: Vec<String>,
    /// Believed, or not looked at.
    #[serde(rename = "not_known")]
    pub(super) unknown: Vec<String>,
}

impl Lists {
    pub(super) fn of(file: &Verified) -> Self {
        let mut lists = Self::default();
        lists.states(file);
        lists.file(file);
        lists.rows(file);
        lists.toml(&file.toml);
        lists.unknown.push("who made it, where and when: name, run id, program, host and start".to_owned());
        if matches!(file.toml, RunToml::Absent | RunToml::NotResolved(_)) {
            lists.unknown.push("whose it is: author, ORCID, licence and DOI".to_owned());
        }
        lists
    }

    fn states(&mut self, file: &Verified) {
        let found = &file.found;
        let every = found.manifest.provenance.record_every_steps;
        let most = |(first, last): (u64, u64)| (last.div_ceil(every) + 1).saturating_sub(first / every);
        if found.step_range().is_some_and(|range| found.state_count > most(range)) {
            self.unknown.push(format!(
                "why there are more states than one every {}, the manifest's `record_every_steps`",
                counted(every, "step")
            ));
        }
        if found.other_kernel.is_some() || found.state_count == 0 {
            self.unknown.push("the states: nothing was recomputed".to_owned());
            return;
        }
        if found.difference_count + found.summary_difference_count == 0 && found.stopped_after.is_none() {
            let states = counted(found.state_count, "state");
            self.proven.push(format!("{states}: each is what the one before leads to"));
            let summaries = count(found.summary_count);
            self.proven.push(format!("summaries: {summaries}, each what its state gives"));
        }
        let first = found.step_range().map_or(0, |(first, _)| first);
        match &file.follows {
            _ if first == 0 => {
                self.proven.push("the first state: the manifest's initial condition".to_owned());
            }
            Some(Follows::Proven) if file.is_later_part => {
                self.proven.push("the first state: what the part before leads to".to_owned());
            }
            Some(Follows::Proven) => {
                let steps = counted(first, "step");
                self.proven.push(format!("the first state: what the initial condition leads to in {steps}"));
            }
            _ => self.unknown.push(format!(
                "how the chain came to the first state, of step {}: it is taken as it is",
                count(first)
            )),
        }
    }

    fn file(&mut self, file: &Verified) {
        let found = &file.found;
        if found.damage_count > 0 {
            return;
        }
        self.compared.push("checksums, message indexes, times and numbers of all messages".to_owned());
        self.compared.push("`/chain` and the schemas of our channels, by the manifest".to_owned());
        let physics = &found.manifest.physics;
        if physics.spheres.is_some() {
            self.compared.push("mass, α and stiffness in the manifest, with its spheres".to_owned());
        } else if physics.bonds.is_some() {
            let what = "`alpha` and `stiffness` in the manifest, which beside bonds move no bead, and only set the scales L and T";
            self.unknown.push(what.to_owned());
        }
        if let Some(end) = &found.end_record {
            match end.reason {
                EndReason::Complete => self.compared.push("its end, the last step of the run".to_owned()),
                reason => self.unknown.push(format!("why it ended before the run did: `{reason}`")),
            }
        }
        match (&found.end_record, found.has_summary_section) {
            (Some(_), true) => self.compared.push(
                "`beadline.end`, and the summary section: schemas, channels, statistics, indexes, offsets"
                    .to_owned(),
            ),
            (Some(_), false) => {
                self.compared.push("`beadline.end`".to_owned());
                self.unknown
                    .push("there is no summary section: readers go through the whole file".to_owned());
            }
            (None, _) => self.unknown.push(
                "the library in the header: an unfinished file has no checksum over its data section"
                    .to_owned(),
            ),
        }
    }

    fn rows(&mut self, file: &Verified) {
        let found = &file.found;
        for rows in &file.rows {
            if rows.proven_count > 0 && rows.difference_count == 0 {
                let count = counted(rows.proven_count, "row");
                self.proven.push(format!("{count} of `{}`, by the states", rows.topic));
            }
            self.unknown.extend(rows.not_checked.iter().map(|what| format!("not checked: {what}")));
        }
        let frame = |step: u64| found.manifest.frame_at(step);
        let range = found.step_range().map(|(first, last)| (frame(first), frame(last)));
        for (topic, rows) in &found.rows {
            let Some((first, last)) = range else { continue };
            if rows.first_frame > first || rows.last_frame < last {
                self.unknown.push(format!(
                    "whether `{topic}` had rows before frame {} or after frame {}",
                    count(rows.first_frame),
                    count(rows.last_frame)
                ));
            }
        }
        for (topic, messages) in &found.foreign {
            let messages = counted(*messages, "message");
            self.unknown.push(format!("not checked: {messages} of `{topic}`, of which we know nothing"));
        }
        let records = &found.other_records;
        self.unknown.extend(records.iter().take(MOST_RECORDS).map(|what| format!("not checked: {what}")));
        if let Some(more @ 1..) = records.len().checked_sub(MOST_RECORDS) {
            self.unknown.push(format!("not checked: {} like these", counted(more as u64, "more record")));
        }
    }

    fn toml(&mut self, toml: &RunToml) {
        match toml {
            RunToml::Agrees { has_dt: true } => {
                self.compared.push("`run.toml`, resolved, with the manifest's physics and credit".to_owned());
            }
            RunToml::Agrees { has_dt: false } => {
                let what = "`run.toml`, resolved, with the manifest's physics and credit, but for the time step, which it leaves open";
                self.compared.push(what.to_owned());
            }
            RunToml::Absent => self.unknown.push("there is no `run.toml`".to_owned()),
            RunToml::NotResolved(why) => {
                self.unknown
                    .push(format!("not checked: `run.toml`, of which this version makes no run: {why}"));
            }
            RunToml::Differs(_) => {}
        }
    }
}

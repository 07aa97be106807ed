//! For ROS 2, and what reads its bags: an MCAP file of profile `ros2`, CDR messages, `ros2msg` definitions.

mod cdr;

use super::{Excerpt, Export, ExportError, Written};
use cdr::Cdr;
use recording::ros2::MessageType;
use recording::{ForeignChannel, ForeignSchema, ForeignTopic, ForeignWriter, WriteOptions, log_time_ns};
use schemas::frame::Frame;
use schemas::summary::{Summarizer, Summary};
use std::path::{Path, PathBuf};

/// Every state as one message of arrays, with a summary of scalars; the chain and the manifest once.
pub(super) struct Ros2 {
    file: ForeignWriter,
    state: ForeignChannel,
    summary: ForeignChannel,
    excerpt: Excerpt,
    summarizer: Summarizer,
    cdr: Cdr,
    written: Written,
}

impl Ros2 {
    /// Begins the bag `path`.
    pub(super) fn create(path: &Path, excerpt: &Excerpt, replace: bool) -> Result<Self, ExportError> {
        let manifest = &excerpt.manifest;
        let options = WriteOptions { force: replace, ..WriteOptions::default() };
        let mut file = ForeignWriter::create(path, "ros2", manifest, &options)?;
        let manifest_channel = add(&mut file, "/manifest", MessageType::String)?;
        let chain_channel = add(&mut file, "/chain", MessageType::Chain)?;
        let state = add(&mut file, "/state", MessageType::ChainState)?;
        let summary = add(&mut file, "/summary", MessageType::Summary)?;
        let mut cdr = Cdr::default();
        let begin_s = excerpt.begin_s();
        cdr.begin().string(&manifest.to_json());
        file.write(manifest_channel, 0, begin_s, cdr.bytes())?;
        encode_chain(&mut cdr, excerpt, begin_s);
        file.write(chain_channel, 0, begin_s, cdr.bytes())?;
        let summarizer = Summarizer::new(&manifest.physics);
        Ok(Self {
            file,
            state,
            summary,
            excerpt: excerpt.clone(),
            summarizer,
            cdr,
            written: Written::default(),
        })
    }
}

impl Export for Ros2 {
    fn frame(&mut self, frame: &Frame<'_>) -> Result<(), ExportError> {
        encode_state(&mut self.cdr, &self.excerpt, frame);
        self.file.write(self.state, self.written.states, frame.time_s, self.cdr.bytes())?;
        encode_summary(&mut self.cdr, frame, &self.summarizer.summarize(frame));
        self.file.write(self.summary, self.written.states, frame.time_s, self.cdr.bytes())?;
        self.written.count(frame);
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<Vec<PathBuf>, ExportError> {
        let about = self.written.about(&self.excerpt);
        Ok(vec![self.file.finish(&about)?.path])
    }
}

fn add(file: &mut ForeignWriter, topic: &str, message: MessageType) -> Result<ForeignChannel, ExportError> {
    let text = message.definition();
    let schema = ForeignSchema { name: message.name(), encoding: "ros2msg", text: text.as_bytes() };
    // players of bags look for the key; empty is the default quality of service
    let metadata = &[("offered_qos_profiles", "")];
    Ok(file.add_channel(&ForeignTopic { topic, schema, message_encoding: "cdr", metadata })?)
}

/// A `std_msgs/Header` of the simulated time.
fn encode_header(cdr: &mut Cdr, time_s: f64) {
    let time_ns = log_time_ns(time_s);
    let seconds = i32::try_from(time_ns / 1_000_000_000).unwrap_or(i32::MAX);
    // less than 1e9
    let nanoseconds = u32::try_from(time_ns % 1_000_000_000).unwrap_or(0);
    cdr.begin().i32(seconds).u32(nanoseconds).string("chain");
}

fn encode_chain(cdr: &mut Cdr, excerpt: &Excerpt, begin_s: f64) {
    let chain = excerpt.manifest.physics.chain();
    let contacts = excerpt.contacts();
    encode_header(cdr, begin_s);
    cdr.u64(excerpt.beads.start as u64)
        .f64(excerpt.manifest.physics.alpha)
        .f64s(chain.mass_kg[excerpt.beads.clone()].iter().copied())
        .f64s(chain.stiffness[contacts.clone()].iter().copied())
        .f64s(chain.rest_overlap_m[contacts].iter().copied());
}

fn encode_state(cdr: &mut Cdr, excerpt: &Excerpt, frame: &Frame<'_>) {
    let (u_m, v_m_s) = excerpt.of(frame);
    let number = excerpt.frame_at(frame.step).map_or(-1, |number| i64::try_from(number).unwrap_or(i64::MAX));
    encode_header(cdr, frame.time_s);
    cdr.u64(frame.step)
        .i64(number)
        .f64(frame.time_s)
        .u64(excerpt.beads.start as u64)
        .f64s(u_m.iter().copied())
        .f64s(v_m_s.iter().copied());
}

fn encode_summary(cdr: &mut Cdr, frame: &Frame<'_>, summary: &Summary) {
    let Summary { energy, dissipated_j, relative_drift, front_bead, impurities, .. } = summary;
    encode_header(cdr, frame.time_s);
    cdr.u64(frame.step)
        .f64(frame.time_s)
        .f64(energy.kinetic_j)
        .f64(energy.potential_j)
        .f64(energy.total_j())
        .f64(*dissipated_j)
        .f64(*relative_drift)
        .u64(*front_bead)
        .u64s(impurities.iter().map(|impurity| impurity.bead))
        .f64s(impurities.iter().map(|impurity| impurity.u_m))
        .f64s(impurities.iter().map(|impurity| impurity.v_m_s));
}

//! Export for Foxglove, Lichtblick and Rerun: an MCAP file with messages that they show without any setting.

mod cloud;
mod colour;
mod map;

use super::{Excerpt, Export, ExportError};
use consumers::energies::default_split_bead;
use consumers::impurity::{Event, EventKind, Followed};
use map::SpaceTime;
use recording::foxglove::{FoxgloveMessage, Level, Log, PointCloud, RawImage, timestamp};
use recording::{ForeignChannel, ForeignWriter, Scalars, WriteOptions, log_time_ns};
use schemas::amounts::quantity;
use schemas::frame::Frame;
use schemas::manifest::RunManifest;
use schemas::summary::Summarizer;
use std::path::{Path, PathBuf};

/// Most beads whose motion and events are exported.
const MOST_FOLLOWED: usize = 16;

/// Scalars of every state; events; clouds at a rate of their own; one map of it all.
pub(super) struct Foxglove {
    file: ForeignWriter,
    channels: Channels,
    excerpt: Excerpt,
    /// The velocity (m/s) that counts as large.
    scale_m_s: f64,
    space_time: SpaceTime,
    followed: Followed,
    /// The beads that it follows, in its order.
    beads: Vec<u64>,
    summarizer: Summarizer,
    scalars: Scalars,
    message: Vec<u8>,
    written: Written,
    clouds: u64,
    events: u64,
}

/// The states in the file, as its metadata names them.
#[derive(Debug, Default)]
struct Written {
    states: u64,
    /// Steps of the first state and of the last one.
    steps: (u64, u64),
}

impl Written {
    fn count(&mut self, frame: &Frame<'_>) {
        let first = if self.states == 0 { frame.step } else { self.steps.0 };
        self.steps = (first, frame.step);
        self.states += 1;
    }

    fn about(&self, excerpt: &Excerpt) -> [(&'static str, String); 5] {
        [
            ("states", self.states.to_string()),
            ("first_step", self.steps.0.to_string()),
            ("last_step", self.steps.1.to_string()),
            ("first_bead", excerpt.beads.start.to_string()),
            ("bead_count", excerpt.beads.len().to_string()),
        ]
    }
}

/// Channels of each kind of message.
struct Channels {
    summary: ForeignChannel,
    motions: Vec<ForeignChannel>,
    events: ForeignChannel,
    cloud: ForeignChannel,
    /// The velocities, and the picture of them.
    maps: [ForeignChannel; 2],
}

impl Foxglove {
    /// Begins the file `path`.
    pub(super) fn create(path: &Path, excerpt: &Excerpt, replace: bool) -> Result<Self, ExportError> {
        let manifest = &excerpt.manifest;
        let options = WriteOptions { force: replace, ..WriteOptions::default() };
        let mut file = ForeignWriter::create(path, manifest, &options)?;
        let beads = beads_to_follow(manifest);
        let channels = Channels::add(&mut file, &beads)?;
        let scale_m_s = manifest.physics.scales().speed_m_s();
        let mut export = Self {
            file,
            channels,
            scale_m_s,
            space_time: SpaceTime::new(excerpt, scale_m_s),
            followed: Followed::new(manifest, &beads),
            beads,
            summarizer: Summarizer::new(&manifest.physics),
            excerpt: excerpt.clone(),
            scalars: Scalars::default(),
            message: Vec::new(),
            written: Written::default(),
            clouds: 0,
            events: 0,
        };
        export.log(excerpt.begin_s(), manifest.provenance.name.as_str(), about(manifest))?;
        Ok(export)
    }

    fn scalars(&mut self, frame: &Frame<'_>) -> Result<(), ExportError> {
        let summary = self.summarizer.summarize(frame);
        let message = self.scalars.summary(frame, &summary);
        self.file.write(self.channels.summary, self.written.states, frame.time_s, message)?;
        let (motions, events) = self.followed.observe(frame);
        for ((bead, channel), motion) in self.beads.iter().zip(&self.channels.motions).zip(motions) {
            let message = self.scalars.motion(frame, *bead, motion.values());
            self.file.write(*channel, self.written.states, frame.time_s, message)?;
        }
        let events = events.to_vec();
        for event in events {
            self.log(event.time_s, &format!("bead {}", event.bead), text_of(&event))?;
        }
        Ok(())
    }

    fn log(&mut self, time_s: f64, name: &str, message: String) -> Result<(), ExportError> {
        let log = Log {
            timestamp: Some(timestamp(log_time_ns(time_s))),
            level: Level::Info.into(),
            message,
            name: name.into(),
            ..Log::default()
        };
        self.events += 1;
        self.write(self.channels.events, self.events - 1, time_s, &log)
    }

    /// Adds a cloud, if the next one is due: as many as were asked for are spread over the steps.
    fn cloud(&mut self, frame: &Frame<'_>) -> Result<(), ExportError> {
        let (first, last) = self.excerpt.steps();
        let gaps = u128::from(self.excerpt.clouds.saturating_sub(1).max(1));
        let (at, steps) = (u128::from(frame.step - first), u128::from(last - first));
        // cloud c is due at step c·steps/gaps, rounded down
        if self.clouds >= self.excerpt.clouds || at < u128::from(self.clouds) * steps / gaps {
            return Ok(());
        }
        let cloud = cloud::of(&self.excerpt, frame, self.scale_m_s);
        self.write(self.channels.cloud, self.clouds, frame.time_s, &cloud)?;
        // the first that is due later: where states are rarer than clouds some are passed over
        let next = ((at + 1) * gaps).div_ceil(steps.max(1));
        self.clouds = u64::try_from(next).unwrap_or(u64::MAX).min(self.excerpt.clouds); // integers
        Ok(())
    }

    fn write(
        &mut self,
        channel: ForeignChannel,
        sequence: u64,
        time_s: f64,
        message: &impl FoxgloveMessage,
    ) -> Result<(), ExportError> {
        self.message.clear();
        message.encode_raw(&mut self.message);
        Ok(self.file.write(channel, sequence, time_s, &self.message)?)
    }
}

impl Export for Foxglove {
    fn frame(&mut self, frame: &Frame<'_>) -> Result<(), ExportError> {
        self.scalars(frame)?;
        self.cloud(frame)?;
        self.space_time.push(frame);
        self.written.count(frame);
        Ok(())
    }

    fn gap(&mut self) {
        self.followed.gap();
        self.space_time.gap();
    }

    /// The map, known only now, is stamped with the first time, so that it is there at every moment that is shown.
    fn finish(mut self: Box<Self>) -> Result<Vec<PathBuf>, ExportError> {
        let begin_s = self.excerpt.begin_s();
        // in chunks of their own: those before keep to the order of time
        self.file.flush()?;
        for (channel, image) in self.channels.maps.into_iter().zip(self.space_time.images()) {
            self.write(channel, 0, begin_s, &image)?;
        }
        let about = self.written.about(&self.excerpt);
        Ok(vec![self.file.finish(&about)?.path])
    }
}

impl Channels {
    fn add(file: &mut ForeignWriter, beads: &[u64]) -> Result<Self, ExportError> {
        let summary = file.add_channel(&Scalars::SUMMARY)?;
        let motions = beads.iter().map(|bead| {
            let topic = format!("/bead/{bead}");
            Ok(file.add_channel(&Scalars::motion_topic(&topic))?)
        });
        let motions = motions.collect::<Result<_, ExportError>>()?;
        let events = file.add_channel(&Log::topic("/events"))?;
        let cloud = file.add_channel(&PointCloud::topic("/cloud"))?;
        let values = file.add_channel(&RawImage::topic("/velocity_map"))?;
        let picture = file.add_channel(&RawImage::topic("/velocity_picture"))?;
        Ok(Self { summary, motions, events, cloud, maps: [values, picture] })
    }
}

/// The impurities, or the bead that analyses divide the chain at.
fn beads_to_follow(manifest: &RunManifest) -> Vec<u64> {
    let impurities = manifest.physics.impurities.iter().map(|impurity| impurity.bead);
    let beads: Vec<_> = impurities.take(MOST_FOLLOWED).collect();
    if beads.is_empty() { vec![default_split_bead(manifest)] } else { beads }
}

fn about(manifest: &RunManifest) -> String {
    let RunManifest { physics, provenance, .. } = manifest;
    let law = if physics.bonds.is_some() { "bonds".to_owned() } else { format!("alpha {}", physics.alpha) };
    format!("run {} ({}): {} beads, {law}", provenance.name, provenance.run_id, physics.beads)
}

fn text_of(event: &Event) -> String {
    let happens = match event.kind {
        EventKind::LeftCloses => "left contact closes",
        EventKind::LeftOpens => "left contact opens",
        EventKind::RightCloses => "right contact closes",
        EventKind::RightOpens => "right contact opens",
        EventKind::Turns => "turns",
    };
    format!("{happens} at u = {}", quantity(event.u_m, "m"))
}

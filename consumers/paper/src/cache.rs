//! Recordings of the paper's runs, made once.

use crate::{Observed, Observer, Run};
use anyhow::{Context as _, Error};
use consumers::follow::{Tally, follow};
use experiments::recorded::record;
use recording::hex;
use recording::{RecordingInfo, RecordingSource};
use schemas::frame::EndReason;
use schemas::manifest::{Origin, RunManifest};
use schemas::whole_file::create_directory;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// A run with its place in the cache.
#[derive(Debug)]
pub struct Cached {
    /// The simulation, and the things to observe.
    pub run: Run,
    /// The run, resolved.
    pub manifest: RunManifest,
    path: PathBuf,
    /// A whole recording of it is there.
    pub recorded: bool,
}

impl Cached {
    /// Looks for the recording of `run` in `directory`. It is used only if it is finished, complete and has
    /// the same physics and the same frames.
    ///
    /// # Errors
    /// When the run is none.
    pub fn look(run: Run, directory: &Path, origin: Origin) -> Result<Self, Error> {
        let manifest = RunManifest::new(&run.config, "paper", origin)?;
        let hash = manifest.physics.hash();
        let prefix = hex(&hash[..6]);
        let path = directory.join(format!("{}-{prefix}.mcap", run.name()));
        let recorded = RecordingInfo::read(&path).is_ok_and(|info| {
            let frames = |manifest: &RunManifest| {
                (manifest.provenance.publish_every_steps, manifest.provenance.record_every_steps)
            };
            info.is_complete()
                && info.damage.is_none()
                && info.manifest.physics.hash() == hash
                && frames(&info.manifest) == frames(&manifest)
        });
        Ok(Self { run, manifest, path, recorded })
    }

    /// Simulates and records the run, telling `progress` each step that it has reached. `false` if `stop`
    /// ended it early; nothing is kept then.
    ///
    /// # Errors
    /// When a state leaves the range of doubles, or the recording cannot be written.
    pub fn simulate(&self, stop: &AtomicBool, progress: impl Fn(u64)) -> Result<bool, Error> {
        // what stands there is of no use, see `look`
        record(&self.manifest, &self.run.config.to_toml(), &self.path, stop, progress)
            .map_err(|error| Error::new(error).context(self.run.name().to_owned()))
    }

    /// Looks at every frame of the recording; nothing if it is damaged.
    pub fn observe(&self) -> Option<Observed> {
        let mut source = RecordingSource::open(&self.path).ok()?;
        let mut observer = Observer::new(&self.run, &self.manifest);
        let mut tally = Tally::default();
        let followed = follow(&mut source, &mut observer, &mut tally, |_| {});
        let whole = followed.is_ok() && tally.missed_count == 0 && tally.end == EndReason::Complete;
        whole.then(|| observer.finish())
    }

    /// Path of the recording, for messages.
    pub fn path(&self) -> &Path {
        &self.path
    }
}

/// Creates the directory of the cache.
///
/// # Errors
/// When the operating system refuses.
pub fn create(directory: &Path) -> Result<(), Error> {
    create_directory(directory).with_context(|| format!("{} cannot be created", directory.display()))
}

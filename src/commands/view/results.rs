//! Results that the page shows beside a recording: the pulses, as `beadline pulses` finds them, and the linear modes, as
//! `beadline modes` does.

use crate::failure::{BadInput, Failure};
use crate::frames::Frames;
use consumers::follow::{FrameObserver, Tally, follow};
use consumers::pulses::{Path, Pulse, Pulses, Strongest};
use producer::resimulation::{Lend, check_kernel};
use recording::RecordingInfo;
use schemas::frame::{Frame, FrameSource as _};
use schemas::manifest::RunManifest;
use serde::Serialize;
use serde_json::{Value, json};
use source::Source;
use std::convert::Infallible;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use waves::linear::LinearChain;
use waves::modes::Modes;

/// Points of a track.
const TRACK_POINTS: usize = 200;

/// Beads of a chain whose modes are found unasked: the time grows with the third power.
const MOST_MODE_BEADS: u64 = 400;

/// `Results` of the page.
#[derive(Debug, Default, Serialize)]
pub(crate) struct Results {
    /// The strongest ones.
    pub(crate) pulses: Vec<Value>,
    /// Number of further ones.
    more: u64,
    /// The modes of a chain that has some, and at most [`MOST_MODE_BEADS`].
    modes: Vec<Value>,
}

/// True where steps are recomputed to find pulses.
fn recomputes(manifest: &RunManifest) -> bool {
    let longest = Pulses::longest_fine_interval_steps(manifest);
    let is_coarse = longest.is_some_and(|longest| manifest.provenance.record_every_steps > longest);
    is_coarse && check_kernel(manifest).is_ok()
}

/// States that are looked at to find the pulses of a recording.
pub(crate) fn states_looked_at(info: &RecordingInfo) -> u64 {
    if recomputes(&info.manifest) { info.covered_steps() } else { info.frames() }
}

/// The pulses of the recording at `path`; steps are recomputed where it has too few, and can be. `watch` sees each frame's tally.
pub(crate) fn of_recording(
    path: &std::path::Path,
    stop: &Arc<AtomicBool>,
    watch: impl FnMut(&Tally),
) -> Result<Results, Failure> {
    let source = Source::recording(path, stop).bad_input()?;
    let manifest = source.manifest().clone();
    let mut frames = if recomputes(&manifest) {
        Frames::recomputed(Source::all_states(path, stop).bad_input()?, Lend::Steps, false, 0, None)?
    } else {
        Frames::as_they_come(source)
    };
    let threshold_m_s = Pulses::DEFAULT_THRESHOLD * Pulses::velocity_scale_m_s(&manifest);
    let mut tracks =
        Tracks { pulses: Pulses::new(&manifest, threshold_m_s), strongest: Strongest::new(true) };
    // as for `beadline pulses`, results before a damage are kept
    let _ = follow(&mut frames, &mut tracks, &mut Tally::default(), watch);
    if stop.load(Ordering::Relaxed) {
        return Err(Failure::stopped());
    }
    let Tracks { mut pulses, mut strongest } = tracks;
    pulses.finish().iter().for_each(|happening| strongest.take(happening));
    let shown = strongest.pulses().to_vec();
    let more = pulses.counts().pulses.saturating_sub(shown.len() as u64);
    let pulses = shown.iter().map(|pulse| told(pulse, &strongest)).collect();
    Ok(Results { pulses, more, modes: modes(&manifest) })
}

/// The linear modes; none of a chain without, or with too many beads.
fn modes(manifest: &RunManifest) -> Vec<Value> {
    if manifest.physics.beads > MOST_MODE_BEADS {
        return Vec::new();
    }
    let modes = LinearChain::of(&manifest.physics.chain()).ok().and_then(|chain| Modes::of(&chain).ok());
    let told = |modes: &Modes, mode: usize| {
        json!({
            "mode": mode + 1,
            "frequency_hz": modes.frequency_hz(mode),
            "participation_beads": modes.participation_beads(mode),
            "centre_bead": modes.centre_bead(mode),
        })
    };
    modes.map_or_else(Vec::new, |modes| (0..modes.count()).map(|mode| told(&modes, mode)).collect())
}

struct Tracks {
    pulses: Pulses,
    strongest: Strongest,
}

impl FrameObserver for Tracks {
    type Error = Infallible;

    fn observe(&mut self, frame: &Frame<'_>) -> Result<(), Infallible> {
        self.pulses.observe(frame).iter().for_each(|happening| self.strongest.take(happening));
        Ok(())
    }

    fn gap(&mut self) {
        self.pulses.gap();
    }
}

fn told(pulse: &Pulse, strongest: &Strongest) -> Value {
    let point = &pulse.measured.point;
    let points: Vec<_> = strongest.path(pulse.number).into_iter().flat_map(Path::points).collect();
    let kept = points.len().min(TRACK_POINTS);
    // the first and the last one, and others evenly between
    let index = |kept_point: usize| kept_point * (points.len() - 1) / kept.saturating_sub(1).max(1);
    let track: Vec<Value> = (0..kept)
        .map(|kept_point| points[index(kept_point)])
        .flat_map(|point| [json!(point.time_s), json!(point.bead)])
        .collect();
    // where it was not measured at the bead of the peak, the mean over its way
    let way_s = (pulse.end_time_s - pulse.birth_time_s).max(f64::MIN_POSITIVE);
    let mean = (pulse.end_bead as f64 - pulse.birth_bead as f64).abs() / way_s;
    let speed = point.speed_beads_per_s.map_or(mean, f64::abs);
    json!({
        "pulse": pulse.number,
        "direction": pulse.direction.as_str(),
        "birth": pulse.birth.as_str(),
        "birth_time_s": pulse.birth_time_s,
        "birth_bead": pulse.birth_bead,
        "end_time_s": pulse.end_time_s,
        "end_bead": pulse.end_bead,
        "fate": pulse.fate.as_str(),
        "v_peak_m_s": point.v_peak_m_s,
        "velocity_beads_per_s": pulse.direction.sign() as f64 * speed,
        "fwhm_beads": point.shape.map(|shape| shape.fwhm_beads),
        "track": track,
    })
}

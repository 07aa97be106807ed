//! `beadline share`: a recording as one HTML file that anyone can open.

use super::thin::thin_for_page;
use super::view::results::{self, Results};
use crate::args::ShareArgs;
use crate::display::{self, bytes, count, counted};
use crate::failure::{BadInput, Done, Failure};
use crate::outputs::check_place;
use crate::progress::Progress;
use crate::report::{Rows, report};
use crate::signals;
use page::{Carried, Packed, page};
use producer::resimulation::check_kernel;
use recording::{RecordingInfo, RecordingSource};
use schemas::frame::{FrameSource, Received};
use schemas::whole_file;
use serde::Serialize;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use storage::is_url;

/// A page that may be sent to anybody (bytes).
const SMALL_BYTES: usize = 2_000_000;
/// A page that browsers still open (bytes).
const MOST_BYTES: usize = 200_000_000;
/// Most that the states of a page take unpacked: memory of the browser, and disk on the way (bytes).
const UNPACKED_BYTES: u64 = 64_000_000;
/// Numbers of beads that are looked at for pulses unasked: a matter of seconds.
const FEW_BEADS_LOOKED_AT: u64 = 200_000_000;
/// States that are measured, to know how many fit.
const SAMPLES: u64 = 16;
/// Bytes in the page of a state besides its doubles: its summary, and its place in the index.
const BESIDE_A_STATE: usize = 150;
/// Number of times the states are thinned anew because the measured ones were smaller than the others.
const MAX_ATTEMPTS: u32 = 5;

/// Result of the command.
#[derive(Debug, Default, Serialize)]
pub(crate) struct Shared {
    path: String,
    pub(crate) bytes: usize,
    /// Steps between two states; none of an empty page.
    every_steps: Option<u64>,
    /// States that it carries.
    states: u64,
    /// States that it shows: every step, if they can be recomputed.
    pub(crate) steps: u64,
    /// None where they were not looked for.
    pulses: Option<usize>,
    recomputes: bool,
}

/// The way in which a recording is shared.
#[derive(Debug, Default)]
pub(crate) struct Sharing {
    /// Every K-th state, or as many as a small page holds.
    pub(crate) every_steps: Option<u64>,
    /// Pulses are found however long it takes.
    pub(crate) pulses: bool,
    pub(crate) force: bool,
}

pub(crate) fn share(args: &ShareArgs) -> Result<Done, Failure> {
    let default = || args.file.as_deref().map_or("beadline.html".into(), default_out);
    let out = args.out.clone().unwrap_or_else(default);
    let shared = match &args.file {
        Some(file) => {
            let ShareArgs { every_steps, pulses, force, .. } = *args;
            share_recording(file, &out, &Sharing { every_steps, pulses, force }, &signals::stop_flag()?)?
        }
        None => share_nothing(&out, args.force)?,
    };
    report(args.json, &shared, || words(&shared))?;
    Ok(Done::Whole)
}

/// `run.html` beside `run.mcap`, or in the current directory if that is behind a URL.
fn default_out(file: &Path) -> PathBuf {
    let page = file.with_extension("html");
    if is_url(file) { page.file_name().unwrap_or_default().into() } else { page }
}

/// The page that waits for a recording.
fn share_nothing(out: &Path, force: bool) -> Result<Shared, Failure> {
    check_place(out, None, force)?;
    let page = page(Carried::Empty);
    whole_file::write(out, page.as_bytes(), force)?;
    Ok(Shared { path: out.display().to_string(), bytes: page.len(), ..Shared::default() })
}

/// The page with the recording `file` inside.
pub(crate) fn share_recording(
    file: &Path,
    out: &Path,
    sharing: &Sharing,
    stop: &Arc<AtomicBool>,
) -> Result<Shared, Failure> {
    let Sharing { every_steps, force, .. } = *sharing;
    check_place(out, Some(file), force)?;
    let info = RecordingInfo::read(file).bad_input()?;
    display::notice_of_version(&info.manifest);
    let recomputes = check_kernel(&info.manifest);
    if let Err(error) = &recomputes {
        notice!("{}: {error}; the page shows the states that it carries, and none between", file.display());
    }
    let found = pulses(&info, sharing, stop)?;
    let results = packed(&serde_json::to_vec(&found.as_ref().unwrap_or(&Results::default()))?, "", stop)?;
    let size = Sizes::measure(&info, &results, stop)?;
    let mut every = every_steps.unwrap_or_else(|| size.fitting_steps(&info));
    if size.page_bytes(&info, every) > MOST_BYTES && !force {
        return Err(too_large(size.page_bytes(&info, every)));
    }
    let title = info.manifest.provenance.name.as_str();
    // beside the page, where there is room for it
    let thinned = out.with_extension(format!("{}.mcap", std::process::id()));
    let mut attempts = 1;
    let (page, states) = loop {
        let told = if attempts > 1 { format!("smaller page, attempt {attempts}") } else { String::new() };
        let finished = thin_for_page(&info, &thinned, every, &told, stop)?;
        let (thinned, states) = (Scratch(finished.path), finished.frames);
        let recording = packed(&fs::read(&thinned.0)?, &told, stop)?;
        let page = page(Carried::Embedded { title, recording: &recording, results: &results });
        let is_small = page.len() <= SMALL_BYTES || states <= 2;
        if every_steps.is_some() || is_small || attempts == MAX_ATTEMPTS {
            break (page, states);
        }
        let excess = page.len().div_ceil(SMALL_BYTES / 100) as u64 + 5; // percent
        every = rounded_up(every.saturating_mul(excess) / 100, &info);
        attempts += 1;
    };
    if page.len() > MOST_BYTES && !force {
        return Err(too_large(page.len()));
    }
    go_on(stop)?;
    whole_file::write(out, page.as_bytes(), force)?;
    if every_steps.is_none() && page.len() > SMALL_BYTES {
        notice!(
            "one state of this chain takes so much that the page is larger than {}",
            bytes(SMALL_BYTES as u64)
        );
    }
    Ok(Shared {
        path: out.display().to_string(),
        bytes: page.len(),
        // the last state is there, however early it comes
        every_steps: Some(every.min(info.covered_steps().max(1))), // integers
        states,
        steps: if recomputes.is_ok() { info.covered_steps() + 1 } else { states },
        pulses: found.map(|found| found.pulses.len()),
        recomputes: recomputes.is_ok(),
    })
}

/// The pulses, unless it takes long to find them and nobody insists.
fn pulses(
    info: &RecordingInfo,
    sharing: &Sharing,
    stop: &Arc<AtomicBool>,
) -> Result<Option<Results>, Failure> {
    let (beads, states) = (info.manifest.physics.beads, results::states_looked_at(info));
    if !sharing.pulses && states.saturating_mul(beads) > FEW_BEADS_LOOKED_AT {
        notice!(
            "pulses are not looked for, because that takes a look at {} states of {} beads: --pulses does it",
            count(states),
            count(beads)
        );
        return Ok(None);
    }
    let mut progress = Progress::of_run(&info.manifest);
    let found = results::of_recording(&info.path, stop, |tally| {
        progress.at(info.manifest.step_of_frame(tally.last_frame.unwrap_or(0)));
    });
    progress.finish();
    found.map(Some)
}

/// `bytes` as the page carries them, with a bar where there are many, and words behind it.
fn packed(bytes: &[u8], told: &str, stop: &AtomicBool) -> Result<Packed, Failure> {
    let mut progress = Progress::new(bytes.len() as u64, "packing");
    progress.tell(&[told]);
    let packed = Packed::new(bytes, |done| {
        progress.at(done as u64);
        !stop.load(Ordering::Relaxed)
    });
    progress.finish();
    packed.ok_or_else(Failure::stopped)
}

/// An error once the user has asked for an end.
fn go_on(stop: &AtomicBool) -> Result<(), Failure> {
    if stop.load(Ordering::Relaxed) { Err(Failure::stopped()) } else { Ok(()) }
}

fn too_large(page_bytes: usize) -> Failure {
    bad_input!(
        "the page would have {}, more than browsers like to open; keep fewer states with a larger --every-steps, or make \
         it with --force",
        bytes(page_bytes as u64)
    )
}

/// Estimates of the sizes of pages (bytes).
struct Sizes {
    without_states: usize,
    of_a_state: usize,
    /// The bytes of a state, before it is packed.
    unpacked: u64,
}

impl Sizes {
    /// Packs some states of the recording one by one.
    fn measure(info: &RecordingInfo, results: &Packed, stop: &AtomicBool) -> Result<Self, Failure> {
        let without_states =
            page(Carried::Embedded { title: "", recording: &Packed::default(), results }).len();
        let (Some(first), Some(last)) = (info.first_step, info.last_step) else {
            return Err(bad_input!("{} holds no state", info.path.display()));
        };
        let mut source = RecordingSource::open_all(&info.path).bad_input()?;
        let (mut all, mut count, mut largest) = (0, 0, 0);
        for sample in 0..SAMPLES {
            go_on(stop)?;
            source
                .seek_to_step(first + (last - first) / SAMPLES * sample + (last - first) / SAMPLES / 2)
                .bad_input()?;
            if let Received::Frame(frame) = source.receive().bad_input()? {
                let values = [frame.u_m, frame.v_m_s, frame.extra].into_iter().flatten();
                let unpacked: Vec<_> = values.flat_map(|value| value.to_le_bytes()).collect();
                largest = largest.max(unpacked.len());
                all += packed(&unpacked, "", stop)?.page_bytes();
                count += 1;
            }
        }
        let of_a_state = all / count.max(1) + BESIDE_A_STATE;
        Ok(Self { without_states, of_a_state, unpacked: largest as u64 })
    }

    /// The steps between two states of a small page.
    fn fitting_steps(&self, info: &RecordingInfo) -> u64 {
        let room = (SMALL_BYTES / 100 * 97).saturating_sub(self.without_states);
        let most = ((room / self.of_a_state) as u64).min(UNPACKED_BYTES / self.unpacked.max(1));
        // the first and the last one are always there
        let most = most.saturating_sub(2).max(1);
        let steps = info.covered_steps().div_ceil(most);
        rounded_up(steps, info)
    }

    /// A page with every `every_steps`-th state.
    fn page_bytes(&self, info: &RecordingInfo, every_steps: u64) -> usize {
        let states = usize::try_from(info.covered_steps() / every_steps.max(1)).unwrap_or(usize::MAX);
        self.without_states.saturating_add(states.saturating_mul(self.of_a_state))
    }
}

/// A number of steps after which the recording holds a state.
fn rounded_up(steps: u64, info: &RecordingInfo) -> u64 {
    let recorded = info.manifest.provenance.record_every_steps;
    steps.div_ceil(recorded).max(1).saturating_mul(recorded)
}

/// A file that goes away.
struct Scratch(PathBuf);

impl Drop for Scratch {
    fn drop(&mut self) {
        // at best
        let _ = fs::remove_file(&self.0);
    }
}

fn words(shared: &Shared) -> String {
    let mut rows = Rows::default();
    rows.add("size", bytes(shared.bytes as u64));
    if let Some(every) = shared.every_steps {
        rows.add("states", format_args!("{}, one every {}", count(shared.states), counted(every, "step")));
        let how = if shared.recomputes {
            "all of them: those between are recomputed"
        } else {
            "recorded ones only"
        };
        rows.add("steps to look at", format_args!("{}, {how}", count(shared.steps)));
        let pulses = shared.pulses.map(|pulses| count(pulses as u64).to_string());
        rows.add("pulses", pulses.unwrap_or_else(|| "not looked for; --pulses finds them".to_owned()));
    } else {
        rows.add("to look at", "what is dropped onto it");
    }
    rows.under(&shared.path)
}

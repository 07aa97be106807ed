//! `beadline record`: a live run, its states and the results that analyses publish, into a recording.

use crate::args::RecordArgs;
use crate::display::{self, bytes, count, counted};
use crate::failure::{Done, Failure};
use crate::frames::{self, Frames, tell};
use crate::outputs::{check_directory, check_free};
use crate::progress::Progress;
use crate::report::{Rows, report};
use crate::signals;
use crate::uploading::{Spool, Uploaded};
use anyhow::anyhow;
use bus::{AttachNotice, Bus, LiveSource};
use producer::resimulation::Lend;
use recorder::{DueFrames, Recorder, RowTally, RowThreads};
use recording::{DiskWatch, Finished, PartsWriter, SpaceNeeded, Split, WriteOptions, part_path};
use schemas::frame::{EndReason, FrameSource, Received};
use schemas::manifest::RunManifest;
use serde_json::{Value, json};
use source::{Named, Source};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

/// Longest silence of a living publisher of results once the run is over.
const PATIENCE: Duration = Duration::from_secs(10);

/// The same when it is we who leave.
const PATIENCE_WHEN_LEAVING: Duration = Duration::from_secs(1);

pub(crate) fn record(args: &RecordArgs) -> Result<Done, Failure> {
    let Named::Live(name) = &args.source else {
        return Err(bad_input!(
            "{}: expected `live` or `live:RUN`; what is in a file is recorded",
            args.source
        ));
    };
    let split = Split { bytes: args.split_size, duration_s: args.split_duration };
    let spool = Spool::of(Some(&args.out), args.spool.as_deref(), split.is_split())?;
    // what waits in the spool is not in the store yet
    let force = args.force && spool.is_none();
    spool.as_ref().map_or(Ok(()), Spool::prepare)?;
    let out = spool.as_ref().map_or(&args.out, |spool| &spool.file).as_path();
    let reserve_bytes = check_output(args, out, &split, force)?;
    let stop = signals::stop_flag()?;
    let bus = Bus::from_env()?;
    let recorder = Arc::new(Recorder::default());
    let rows = Arc::new(RowThreads::default());
    let live = attach(args, &bus, name.as_ref(), &stop, (&recorder, &rows))?;
    display::notice_of_bus(&bus);
    let manifest = manifest(args, live.manifest())?;
    display::notice_of_version(&manifest);
    let begins_at = if args.from_start { 0 } else { live.first_frame() };
    let options = WriteOptions {
        force,
        flush_period: Duration::from_secs_f64(args.flush_period),
        sync_period: Duration::from_secs_f64(args.sync_period),
        ..WriteOptions::default()
    };
    let first_step = manifest.step_of_frame(begins_at);
    let at_most_bytes = SpaceNeeded::new(&manifest, options.compression).at_most_bytes;
    let expected_bytes = split.bytes.map_or(at_most_bytes, |bytes| bytes.min(at_most_bytes));
    let upload =
        spool.as_ref().map(|spool| spool.begin(&manifest, expected_bytes, args.force)).transpose()?;
    let parts = PartsWriter::create(out, &manifest, None, first_step, &options, &split)?;
    recorder.begin(parts, &manifest, live.stream(), (begins_at, live.first_frame()));

    signals::would_leave(what_stays(out, &split, spool.as_ref()));
    let sending = spool.clone().zip(upload).map(|(spool, upload)| spool.send(upload)).transpose()?;
    let mut source = frames(args, live)?;
    let mut due = DueFrames::new(&recorder, &manifest, DiskWatch::new(out, reserve_bytes));
    let followed = follow(&mut source, &mut due, &recorder, &manifest);
    drop(source);
    let range = due.finish();
    let (end, patience) = match &followed {
        Ok(Followed { end, disk_is_short: true, .. }) => (*end, Duration::ZERO),
        Ok(Followed { end: EndReason::Detached, .. }) => (EndReason::Detached, PATIENCE_WHEN_LEAVING),
        Ok(Followed { end, .. }) => (*end, PATIENCE),
        Err(_) => (EndReason::Detached, Duration::ZERO),
    };
    recorder.end_frames(range.as_ref().ok().copied().flatten().map(|(_, last)| last), patience);
    let (results, trouble) = rows.finish();
    let mut parts = recorder.finish(end);
    let finished = parts.as_deref_mut().unwrap_or_default();
    let uploaded = sending.map(|sending| sending.finish(finished, &stop));
    if parts.is_err() || range.is_err() {
        display::notice(what_stays(out, &split, spool.as_ref()));
    }
    let summary = Summary {
        manifest: &manifest,
        followed: followed?,
        range: range?,
        begins_at,
        results: results.into_iter().filter(RowTally::is_worth_telling).collect(),
        parts: parts?,
        uploaded,
    };
    if let Some(error) = trouble {
        notice!("results were not recorded: {error}");
    }
    summary.report(args.json)
}

/// Refuses an output that could not be written in the end. Returns how much of its disk must stay free.
fn check_output(args: &RecordArgs, out: &Path, split: &Split, force: bool) -> Result<u64, Failure> {
    if out.extension().is_none_or(|end| end != "mcap") {
        return Err(bad_input!("--out {}: a recording is written as .mcap", args.out.display()));
    }
    if split.is_split() {
        check_directory(out)?;
        PartsWriter::check(out, split, force)?;
    } else {
        check_free(out, force)?;
    }
    let disk = recording::room_for(out)?;
    // by default 100 MB, or 1 % of a disk below 10 GB
    let reserve_bytes = args.min_free.unwrap_or_else(|| (disk.total_bytes / 100).min(100_000_000)); // integers
    if disk.free_bytes < reserve_bytes {
        let (free, reserve) = (bytes(disk.free_bytes), bytes(reserve_bytes));
        return Err(Failure::Failed(anyhow!(
            "{}: only {free} are free there, and {reserve} are to be left; choose another disk, or a smaller --min-free",
            out.display()
        )));
    }
    Ok(reserve_bytes)
}

/// Attaches to the run. Its results are listened to before the handshake, so that none is missed.
fn attach(
    args: &RecordArgs,
    bus: &Bus,
    name: Option<&schemas::run_name::RunName>,
    stop: &Arc<AtomicBool>,
    (recorder, rows): (&Arc<Recorder>, &Arc<RowThreads>),
) -> Result<LiveSource, Failure> {
    let (own_bus, recorder, rows) = (bus.clone(), Arc::clone(recorder), Arc::clone(rows));
    let results = !args.no_results;
    let notice = move |notice: &AttachNotice| match notice {
        AttachNotice::Joining { name } if results => rows.start(&own_bus, name, &recorder),
        notice => tell(notice),
    };
    frames::attach(bus, name, "record", (args.latest, args.timeout), stop, notice)
}

/// The manifest of the recording: the run's, perhaps with other recorded steps.
fn manifest(args: &RecordArgs, manifest: &RunManifest) -> Result<RunManifest, Failure> {
    let Some(steps) = args.record_every_steps else { return Ok(manifest.clone()) };
    let published = manifest.provenance.publish_every_steps;
    manifest.clone().recorded_every(steps).map_err(|_| {
        bad_input!(
            "--record-every-steps {steps}: expected a multiple of {published}, the steps between two frames of this run"
        )
    })
}

/// The frames as they come, with missing ones recomputed if asked.
fn frames(args: &RecordArgs, live: LiveSource) -> Result<Frames, Failure> {
    let source = Source::Live(Box::new(live));
    if args.from_start || args.fill_gaps {
        return Frames::recomputed(source, Lend::Frames, args.from_start, 0, None);
    }
    Ok(Frames::as_they_come(source))
}

/// After a write error, or an end at once: where everything before it is.
fn what_stays(out: &Path, split: &Split, spool: Option<&Spool>) -> String {
    let path = if split.is_split() { part_path(out, 1) } else { out.to_owned() };
    let parts =
        if split.is_split() { " and the parts after it, the last one as .partial" } else { ".partial" };
    format!(
        "what was recorded before stays in {}{parts}, which every analysis reads; `beadline recover` makes a finished \
         recording of it{}",
        path.display(),
        spool.map_or_else(String::new, |spool| format!(", and {}", spool.advice()))
    )
}

/// Account of the frames that came.
struct Followed {
    end: EndReason,
    frame_count: u64,
    missed_count: u64,
    disk_is_short: bool,
}

/// Records frames until they end, or the disk is nearly full.
fn follow(
    source: &mut Frames,
    due: &mut DueFrames<'_>,
    recorder: &Recorder,
    manifest: &RunManifest,
) -> Result<Followed, Failure> {
    let mut progress = Progress::of_run(manifest);
    let (mut frame_count, mut missed_count, mut disk_is_short) = (0, 0, false);
    let end = loop {
        match source.receive()? {
            Received::Frame(frame) => {
                frame_count += 1;
                if !due.take(&frame)? {
                    disk_is_short = true;
                    break EndReason::Detached;
                }
                if progress.at(frame.step) {
                    let (written_bytes, finished_parts) = recorder.size();
                    let missed = format!("{} missed", count(missed_count));
                    let (size, part) = (bytes(written_bytes).to_string(), finished_parts + 1);
                    let said = [&counted(frame_count, "frame"), &missed, &size, &format!("part {part}")];
                    progress.tell(&said.map(String::as_str));
                }
            }
            Received::Missed { from, to } => missed_count += to - from + 1,
            // the run goes on without us
            Received::End(EndReason::Stopped) => break EndReason::Detached,
            Received::End(reason) => break reason,
        }
    };
    progress.finish();
    Ok(Followed { end, frame_count, missed_count, disk_is_short })
}

/// Summary of a recording, in numbers.
struct Summary<'a> {
    manifest: &'a RunManifest,
    followed: Followed,
    /// The first and the last frame.
    range: Option<(u64, u64)>,
    /// The first frame that was to be recorded.
    begins_at: u64,
    results: Vec<RowTally>,
    parts: Vec<Finished>,
    /// Result of sending the files, if they go to a URL.
    uploaded: Option<Uploaded>,
}

impl Summary<'_> {
    fn report(&self, as_json: bool) -> Result<Done, Failure> {
        report(as_json, &self.json(), || self.text())?;
        self.warn();
        // a part that is continued is not the end
        let ended_well = self.followed.end.is_orderly() && self.followed.end != EndReason::Detached;
        let rows_are_whole = self.results.iter().all(RowTally::is_whole);
        let is_sent = self.uploaded.as_ref().is_none_or(Uploaded::is_whole);
        Ok(Done::whole_if(ended_well && rows_are_whole && self.followed.missed_count == 0 && is_sent))
    }

    fn total(&self, number: impl Fn(&Finished) -> u64) -> u64 {
        self.parts.iter().map(number).sum()
    }

    fn text(&self) -> String {
        let mut rows = Rows::default();
        let Followed { frame_count, missed_count, .. } = self.followed;
        rows.add("frames", display::received(count(frame_count), self.range, missed_count));
        rows.add("states recorded", count(self.total(|part| part.frames)));
        for tally in &self.results {
            let (found, range) = (counted(tally.count, "row"), tally.first_frame.zip(tally.last_frame));
            rows.add(tally.topic.to_string(), display::received(found, range, tally.missed_count()));
        }
        let size = |part: &Finished| format!("{}, {}", part.path.display(), bytes(part.bytes));
        match self.parts.as_slice() {
            [] => rows.add("recording", "none: no frame came"),
            [part] => rows.add("recording", size(part)),
            [first, .., last] => {
                let total = bytes(self.total(|part| part.bytes));
                rows.add("recording", format_args!("{total} in {} parts", self.parts.len()));
                rows.add("first part", size(first));
                rows.add("last part", size(last));
            }
        }
        self.uploaded.iter().for_each(|uploaded| uploaded.add_to(&mut rows));
        rows.under(format_args!("{} {}", self.manifest.provenance.name, self.followed.end))
    }

    fn json(&self) -> Value {
        let provenance = &self.manifest.provenance;
        let part = |part: &Finished| json!({ "path": part.path.to_string_lossy(), "bytes": part.bytes, "states": part.frames });
        let rows = |tally: &RowTally| {
            let rows = json!({
                "rows": tally.count,
                "first_frame": tally.first_frame,
                "last_frame": tally.last_frame,
                "missed": tally.missed,
                "trouble": tally.trouble,
            });
            (tally.topic.to_string(), rows)
        };
        json!({
            "run": provenance.name,
            "run_id": provenance.run_id,
            "end": self.followed.end.as_str(),
            "frames_received": self.followed.frame_count,
            "frames_missed": self.followed.missed_count,
            "first_frame": self.range.map(|(first, _)| first),
            "last_frame": self.range.map(|(_, last)| last),
            "states": self.total(|part| part.frames),
            "disk_is_short": self.followed.disk_is_short,
            "results": self.results.iter().map(rows).collect::<BTreeMap<_, _>>(),
            "upload": self.uploaded.as_ref().map(Uploaded::json),
            "parts": self.parts.iter().map(part).collect::<Vec<_>>(),
        })
    }

    fn warn(&self) {
        self.uploaded.iter().for_each(Uploaded::tell);
        if self.begins_at > 0 && self.range.is_some() {
            let (first, last) = (count(self.begins_at), count(self.begins_at - 1));
            notice!(
                "attached to a run under way: frames 0 to {last} are not recorded, the recording begins with frame \
                 {first}; with --from-start they are recomputed"
            );
        }
        if self.followed.missed_count > 0 {
            let missed = counted(self.followed.missed_count, "published frame");
            notice!("{missed} did not arrive");
        }
        for tally in &self.results {
            for (from, to) in tally.missed.iter().take(5) {
                let (from, to) = (count(*from), count(*to));
                notice!("{}: no rows of frames {from} to {to}", tally.topic);
            }
            if let Some(trouble) = &tally.trouble {
                let last =
                    tally.last_frame.map_or("none".to_owned(), |last| format!("frame {}", count(last)));
                notice!("{}: {trouble}; the last row is of {last}", tally.topic);
            }
        }
        match self.followed.end {
            EndReason::Detached if self.followed.disk_is_short => {
                notice!("the disk is nearly full: the recording ends here, the run goes on");
            }
            EndReason::Detached => notice!("stopped: the recording ends here, the run goes on"),
            EndReason::ProducerLost => {
                let none = "; no state up to the last published one is missing";
                let none = if self.followed.missed_count == 0 { none } else { "" };
                notice!("the producer is gone without a word{none}");
            }
            EndReason::Dropped => display::notice(
                "the producer dropped this recorder because it held the run back for too long; \
                 use --latest, a faster disk, or a longer --stall-timeout of `beadline run`",
            ),
            EndReason::Failed => notice!("the run failed; the recording ends at its last frame"),
            _ => {}
        }
    }
}

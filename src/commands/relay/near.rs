//! The near side of a relay: the side of the run.

use super::{endpoint, of_wire};
use crate::args::RelayArgs;
use crate::display::{self, bytes, count, counted, per_second};
use crate::failure::{Done, Failure};
use crate::frames::{attach, tell};
use crate::progress::Progress;
use crate::report::{Rows, report};
use crate::signals;
use bus::{AttachNotice, Bus, LiveSource, StreamId};
use producer::resimulation::check_kernel;
use relay::log::SharedLog;
use relay::near::{Ended, RowSenders, Sender, Sending, Sent};
use relay::wire::{Payload, Serving};
use schemas::frame::{EndReason, FrameSource as _};
use schemas::manifest::RunManifest;
use serde_json::json;
use source::Named;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Interval at which requests are looked for.
const LOOK_PERIOD: Duration = Duration::from_millis(20);

/// Longest time from a signal until the end reaches the far sides. The person who pressed Ctrl-C waits for it.
const LAST_WORDS: Duration = Duration::from_millis(150);

type Log = Arc<SharedLog<Payload>>;

pub(super) fn near(args: &RelayArgs) -> Result<Done, Failure> {
    let Some(Named::Live(name)) = &args.from else {
        return Err(bad_input!(
            "--from: expected `live` or `live:RUN`; `beadline replay` makes a live run of a recording"
        ));
    };
    let stop = signals::stop_flag()?;
    let log: Log = Arc::new(SharedLog::new(Duration::from_secs_f64(args.silence)));
    let listen = endpoint("--listen", &args.listen)?;
    let serving = Serving::start(&listen, args.config.as_deref(), name.as_ref(), Arc::clone(&log), &stop);
    let Some(serving) = serving.map_err(of_wire)? else {
        notice!("stopped before it listened");
        return Ok(Done::Lossy);
    };
    notice!("listening at {listen}; the run is joined when the other side asks for it");
    while !serving.is_asked() {
        if stop.load(Ordering::Relaxed) {
            notice!("stopped before anybody asked for the run");
            return Ok(Done::Lossy);
        }
        std::thread::sleep(LOOK_PERIOD);
        warn(&serving);
    }
    let relayed = Near {
        args,
        stop: &stop,
        log: &log,
        serving: &serving,
        rows: Arc::new(RowSenders::new(Arc::clone(&log), Arc::clone(&stop))),
    };
    let summary = relayed.relay(name.as_ref())?;
    warn(&serving);
    serving.stop(&stop);
    summary.report(args.json)
}

/// Prints a notice about each peer that was turned away.
fn warn(serving: &Serving) {
    for trouble in serving.take_troubles() {
        notice!("turned somebody away: {trouble}");
    }
}

struct Near<'a> {
    args: &'a RelayArgs,
    stop: &'a Arc<AtomicBool>,
    log: &'a Log,
    serving: &'a Serving,
    rows: Arc<RowSenders<Payload>>,
}

impl Near<'_> {
    fn relay(&self, name: Option<&schemas::run_name::RunName>) -> Result<Relayed, Failure> {
        let bus = Bus::from_env()?;
        let mut frames = self.args.frames || self.serving.wants_frames();
        let mut live = self.attach(&bus, name, frames)?;
        display::notice_of_bus(&bus);
        let manifest = live.manifest().clone();
        display::notice_of_version(&manifest);
        if let Err(other) = check_kernel(&manifest)
            && !std::mem::replace(&mut frames, true)
        {
            notice!("{other}; its frames are sent themselves");
        }
        let stream = live.stream();
        self.rows.joined(stream);
        // another number for each near side: messages are counted anew
        self.serving.offer(manifest.to_json(), StreamId::new(stream.run_id).stream_id, !frames);
        let start = Instant::now();
        let mut progress = Progress::of_run(&manifest);
        let sending = Sending { frames, hold: self.args.hold, every: self.args.every };
        let mut sender = Sender::new(self.log, sending, manifest.frame_doubles(), self.stop);
        let first_frame = live.first_frame();
        let reason = loop {
            let ended = sender.follow(&mut live, |sent| {
                self.look(&manifest, sent, &mut progress);
                frames || !self.serving.wants_frames()
            })?;
            match ended {
                Ended::Run(reason) => break reason,
                Ended::Left => {
                    notice!(
                        "the far side is too slow to recompute, or asks: from here on frames are sent themselves"
                    );
                    frames = true;
                    sender.send_frames();
                    live = self.attach(&bus, Some(&manifest.provenance.name), true)?;
                    if live.stream() != stream {
                        break EndReason::ProducerLost;
                    }
                }
            }
        };
        drop(live);
        let seconds = start.elapsed().as_secs_f64();
        for trouble in self.rows.finish(sender.last_frame()) {
            notice!("results were not sent: {trouble}");
        }
        sender.end(reason);
        let all_have_it = self.wait_for_far_sides();
        progress.finish();
        let log = self.log.look();
        Ok(Relayed {
            run: manifest.provenance.name.to_string(),
            reason,
            first_frame,
            sent: sender.sent(),
            frame_bytes: 8 * manifest.frame_doubles() as u64,
            seconds,
            rows_lost: log.rows_lost(),
            given_up: log.given_up(),
            all_have_it,
        })
    }

    fn attach(
        &self,
        bus: &Bus,
        name: Option<&schemas::run_name::RunName>,
        frames: bool,
    ) -> Result<LiveSource, Failure> {
        let (own_bus, rows) = (bus.clone(), Arc::clone(&self.rows));
        let notice = move |notice: &AttachNotice| match notice {
            AttachNotice::Joining { name } => {
                if let Err(error) = rows.start(&own_bus, name) {
                    notice!("results are not sent: {error}");
                }
            }
            notice => tell(notice),
        };
        // with every frame to be sent none is left out, and they are taken as fast as they come
        let latest = !self.args.hold && !frames;
        attach(bus, name, "relay", (latest, None), self.stop, notice)
    }

    fn look(&self, manifest: &RunManifest, sent: &Sent, progress: &mut Progress) {
        if progress.is_due() {
            warn(self.serving);
            let receivers = self.log.look().receiver_count() as u64;
            let size = 8 * manifest.frame_doubles() as u64 * sent.frames;
            let parts = [
                counted(sent.frames, "frame"),
                format!("{} of {} sent", bytes(sent.bytes), bytes(size)),
                counted(receivers, "far side"),
            ];
            progress.tell(&parts.each_ref().map(String::as_str));
        }
    }

    /// Waits until every far side has the end, or is given up; false if a signal ended that, a moment later.
    fn wait_for_far_sides(&self) -> bool {
        let mut stopped = None;
        while self.log.wait_for(LOOK_PERIOD, |log| log.is_over(Instant::now()).then_some(())).is_none() {
            warn(self.serving);
            if self.stop.load(Ordering::Relaxed)
                && stopped.get_or_insert_with(Instant::now).elapsed() >= LAST_WORDS
            {
                notice!("stopped before the other side had everything");
                return false;
            }
        }
        true
    }
}

/// Numbers about a run that was sent.
struct Relayed {
    run: String,
    reason: EndReason,
    first_frame: u64,
    sent: Sent,
    frame_bytes: u64,
    seconds: f64,
    rows_lost: u64,
    given_up: u64,
    all_have_it: bool,
}

impl Relayed {
    fn report(&self, as_json: bool) -> Result<Done, Failure> {
        let frames_bytes = self.frame_bytes * self.sent.frames;
        let json = json!({
            "run": self.run,
            "end": self.reason.as_str(),
            "first_frame": self.first_frame,
            "frames": self.sent.frames,
            "frames_bytes": frames_bytes,
            "messages": self.sent.messages,
            "sent_bytes": self.sent.bytes,
            "seconds": self.seconds,
            "rows_lost": self.rows_lost,
            "far_sides_given_up": self.given_up,
        });
        report(as_json, &json, || {
            let mut rows = Rows::default();
            let rate = per_second(self.sent.frames as f64 / self.seconds, "frames");
            let (frames, first) = (count(self.sent.frames), count(self.first_frame));
            rows.add("frames", format_args!("{frames} from {first} on, {rate}"));
            let part = 100.0 * self.sent.bytes as f64 / frames_bytes.max(1) as f64; // integers
            let (sent, messages) = (bytes(self.sent.bytes), counted(self.sent.messages, "message"));
            let all = bytes(frames_bytes);
            rows.add("sent", format_args!("{sent} in {messages}: {part:.2} % of the frames' {all}"));
            rows.under(format_args!("{} {}", self.run, self.reason))
        })?;
        if self.rows_lost > 0 {
            notice!(
                "{} of results were lost: they came or were fetched too late",
                counted(self.rows_lost, "row")
            );
        }
        if self.given_up > 0 {
            notice!("{} fell silent and was given up", counted(self.given_up, "far side"));
        }
        let all_have_it = self.all_have_it && self.given_up == 0;
        Ok(Done::whole_if(self.reason.is_orderly() && self.rows_lost == 0 && all_have_it))
    }
}

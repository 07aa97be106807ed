//! `beadline demo`: the whole pipeline once, each part a process of its own.

use crate::args::DemoArgs;
use crate::child::Process;
use crate::commands::share::{Sharing, share_recording};
use crate::commands::thin::thin_quietly;
use crate::configuration::preset;
use crate::display::{self, bytes, count, seconds};
use crate::failure::{BadInput, Done, Failure};
use crate::report::Rows;
use crate::signals;
use anyhow::{Context, anyhow};
use bus::{Bus, list_runs};
use consumers::follow::{FrameObserver, Tally, follow};
use consumers::pulses::{Passage, Probes};
use consumers::uncertain::Uncertain;
use recording::{Finished, RecordingSource};
use schemas::frame::{Frame, FrameSource, HeldFrame};
use schemas::manifest::Physics;
use schemas::run_name::RunName;
use schemas::whole_file::create_directory;
use serde_json::Value;
use std::convert::Infallible;
use std::ffi::OsString;
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

/// The run that the demo shows.
const PRESET: &str = "light-impurity";

/// The recording of this run.
const RECORDING: &str = "light-impurity.mcap";
/// Every [`SPARSE_EVERY_STEPS`]-th state of the recording, from which the others can be recomputed.
const SPARSE: &str = "light-impurity-sparse.mcap";
/// The page that holds every step.
const PAGE: &str = "light-impurity.html";
/// Independent numbers for the leading pulses: direction, order, `v_peak_m_s`, `speed_beads_per_s`.
const REFERENCE: &str = include_str!("../../tests/reference/light-impurity-pulses.csv");
/// The beads at which these were taken.
const BACKWARD_PROBE: u64 = 300;
const FORWARD_PROBE: u64 = 700;

/// The consumers, with the outputs of each.
const CONSUMERS: [(&str, &[(&str, &str)]); 3] = [
    ("energies", &[("--out", "energies.csv"), ("--figure", "energies.svg"), ("--figure", "energies.png")]),
    (
        "impurity",
        &[
            ("--out", "impurity.csv"),
            ("--events", "impurity-events.csv"),
            ("--figure", "impurity.svg"),
            ("--figure", "impurity.png"),
        ],
    ),
    (
        "contacts",
        &[
            ("--out", "contacts.csv"),
            ("--out", "contacts.mcap"),
            ("--figure", "contacts.svg"),
            ("--figure", "contacts.png"),
        ],
    ),
];

/// Steps between two states of the thinned recording.
const SPARSE_EVERY_STEPS: u64 = 100;

/// Drawn from the recording's last frame.
const PROFILES: [&str; 2] = ["profiles.svg", "profiles.png"];

pub(crate) fn demo(args: &DemoArgs) -> Result<Done, Failure> {
    let start = Instant::now();
    let dir = &args.out;
    create_directory(dir).with_context(|| format!("{} cannot be created", dir.display())).bad_input()?;
    check_free(dir, args.force)?;
    let name = free_name()?;

    let stop = signals::bounded_stop_flag()?;
    let mut processes = Processes::start(args, &name)?;
    processes.watch(&name, step_count()?, &stop)?;
    let [run, consumers @ ..] = processes.finish()?;
    let passages = look_at_recording(args)?;
    let sparse = thin_quietly(&dir.join(RECORDING), &dir.join(SPARSE), SPARSE_EVERY_STEPS, args.force)?;

    let sharing = Sharing { force: args.force, ..Sharing::default() };
    share_recording(&dir.join(RECORDING), &dir.join(PAGE), &sharing, &stop)?;

    let mut text = summary(&run, &consumers);
    text.push_str(&sizes(dir, &sparse)?);
    text.push_str(&pulses_table(&passages));
    text.push_str(&files_table(dir)?);
    let (page, recording) = (dir.join(PAGE), dir.join(RECORDING));
    let _ = writeln!(
        text,
        "\nto look at every step of it, without a network and without Beadline: open {}",
        page.display()
    );
    let _ = writeln!(text, "the same in a browser from here: beadline view {}", recording.display());
    let _ = writeln!(text, "\nall of it in {}", display::duration(start.elapsed()));
    display::print(text)?;
    let published = run["frames_published"].as_u64();
    let whole = consumers.iter().all(|consumer| consumer["frames_received"].as_u64() == published);
    Ok(Done::whole_if(whole && published == run["frames_recorded"].as_u64()))
}

/// The preset's name, or another if a run of that name is on the bus.
fn free_name() -> Result<RunName, Failure> {
    let taken = list_runs(&Bus::from_env()?)?.iter().any(|run| run.name.as_str() == PRESET);
    let name = if taken { format!("{PRESET}-{}", std::process::id()) } else { PRESET.to_owned() };
    Ok(name.parse().map_err(|error: String| anyhow!(error))?)
}

/// Steps of the demo's run.
fn step_count() -> Result<u64, Failure> {
    Ok(Physics::resolve(&preset(PRESET)?.config())?.step_count)
}

/// The tables and figures.
fn outputs(dir: &Path) -> impl Iterator<Item = PathBuf> {
    let of_consumers = CONSUMERS.iter().flat_map(|(_, outputs)| outputs.iter().map(|(_, file)| *file));
    of_consumers.chain(PROFILES).map(|file| dir.join(file))
}

/// Refuses to start when earlier results are in the way.
fn check_free(dir: &Path, force: bool) -> Result<(), Failure> {
    let partial = dir.join(RECORDING).with_extension("mcap.partial");
    let others = [dir.join(RECORDING), partial, dir.join(SPARSE), dir.join(PAGE)];
    let taken = outputs(dir).chain(others).find(|path| path.exists());
    match taken {
        Some(path) if !force => {
            Err(bad_input!("{} exists already; choose another --out or pass --force", path.display()))
        }
        _ => Ok(()),
    }
}

/// The producer and its consumers. Those that still run when this is dropped are asked to end, and do so in
/// order.
struct Processes {
    running: Vec<Process>,
}

impl Processes {
    fn start(args: &DemoArgs, name: &RunName) -> Result<Self, Failure> {
        let dir = &args.out;
        let mut processes = Self { running: Vec::new() };
        let mut start = |role: &str, mut words: Vec<OsString>| -> Result<(), Failure> {
            words.push("--json".into());
            words.extend(args.force.then(|| "--force".into()));
            processes.running.push(Process::start(role, &words)?);
            Ok(())
        };
        let run = ["run", "--preset", PRESET, "--name", name.as_str(), "--wait-for", "3", "--out"];
        start("run", run.map(OsString::from).into_iter().chain([dir.join(RECORDING).into()]).collect())?;
        for (role, outputs) in CONSUMERS {
            let mut words = [role, &format!("live:{name}"), "--timeout", "60"].map(OsString::from).to_vec();
            words.extend(outputs.iter().flat_map(|(flag, file)| [flag.into(), dir.join(file).into()]));
            words.extend(args.look.flags().into_iter().map(Into::into));
            start(role, words)?;
        }
        Ok(processes)
    }

    /// Shows how far the run is until every process has ended, or one has failed.
    fn watch(&mut self, name: &RunName, step_count: u64, stop: &AtomicBool) -> Result<(), Failure> {
        let bus = Bus::from_env()?;
        let bar = display::progress_bar(step_count, PRESET);
        while self.is_under_way()? {
            if stop.load(Ordering::Relaxed) {
                bar.finish_and_clear();
                return Err(Failure::Stopped(anyhow!(
                    "stopped; the processes end in order and keep what they have"
                )));
            }
            if let Some(run) = list_runs(&bus)?.iter().find(|run| run.name == *name) {
                let (state, time) = (run.state, seconds(run.time_s));
                bar.set_position(run.step);
                let consumers = display::counted(run.lossless, "consumer");
                display::tell(&bar, &[state.as_str(), &format!("t = {time}"), &consumers]);
            }
            thread::sleep(Duration::from_millis(50));
        }
        bar.finish_and_clear();
        Ok(())
    }

    /// True if processes run and none has failed. A failed one comes first from then on: the others may be waiting for it.
    fn is_under_way(&mut self) -> Result<bool, Failure> {
        let mut runs = false;
        for index in 0..self.running.len() {
            match self.running[index].ended()? {
                None => runs = true,
                Some(status) if status.success() => {}
                Some(_) => {
                    self.running.swap(0, index);
                    return Ok(false);
                }
            }
        }
        Ok(runs)
    }

    /// The summaries of all processes, the producer's first.
    fn finish(mut self) -> Result<[Value; 4], Failure> {
        let mut summaries = Vec::new();
        while !self.running.is_empty() {
            summaries.push(self.running.remove(0).finish_json()?);
        }
        summaries.try_into().map_err(|_| Failure::Failed(anyhow!("a process is missing")))
    }
}

impl Drop for Processes {
    fn drop(&mut self) {
        self.running.iter_mut().for_each(Process::stop);
        for process in self.running.drain(..) {
            // what they said no longer matters
            let _ = process.finish_json();
        }
    }
}

/// The demo's results from the recording: pulses, and the last frame.
struct Look {
    probes: Probes,
    last: HeldFrame,
}

impl FrameObserver for Look {
    type Error = Infallible;

    fn observe(&mut self, frame: &Frame<'_>) -> Result<(), Infallible> {
        self.probes.observe(frame);
        self.last.hold(frame);
        Ok(())
    }
}

/// Reads the recording from beginning to end: draws its last frame, finds its pulses.
fn look_at_recording(args: &DemoArgs) -> Result<Vec<Passage>, Failure> {
    let dir = &args.out;
    let mut source = RecordingSource::open(&dir.join(RECORDING))?;
    let manifest = source.manifest().clone();
    let mut look =
        Look { probes: Probes::new(&manifest, &[BACKWARD_PROBE, FORWARD_PROBE]), last: HeldFrame::default() };
    follow(&mut source, &mut look, &mut Tally::default(), |_| {})?;
    let figure = plots::profiles(&manifest, &look.last.frame());
    for file in PROFILES {
        figure.write(&dir.join(file), args.look.options(), args.force)?;
    }
    Ok(look.probes.passages())
}

/// Frames sent, recorded and received, and how exact the run was.
fn summary(run: &Value, consumers: &[Value; 3]) -> String {
    let number = |value: &Value| value.as_u64().map_or("?".to_owned(), |number| count(number).to_string());
    let float = |value: &Value| value.as_f64().unwrap_or(f64::NAN);
    let received = |consumer: &Value| {
        format!("{}, {} missed", number(&consumer["frames_received"]), number(&consumer["frames_missed"]))
    };
    let energies = &consumers[0]["results"];
    let ratio = |name: &str| {
        let found = &energies["reflection"]["energies"][format!("{name}_uncertainty")];
        Uncertain::new(float(&energies[name]), float(found)).to_string()
    };
    let wall_s = float(&run["wall_s"]);
    let mut rows = Rows::default();
    rows.add("frames sent", number(&run["frames_published"]));
    rows.add("frames recorded", number(&run["frames_recorded"]));
    rows.add("received by energies", received(&consumers[0]));
    rows.add("received by impurity", received(&consumers[1]));
    rows.add("received by contacts", received(&consumers[2]));
    let drift = float(&energies["max_abs_relative_drift"]);
    rows.add("largest energy drift |ΔE/E|", format_args!("{drift:.1e}"));
    rows.add("reflected/total energy", ratio("reflected_over_total"));
    rows.add("reflected/transmitted energy", ratio("reflected_over_transmitted"));
    let (wall, k_steps_per_s) = (seconds(wall_s), float(&run["steps"]) / wall_s / 1e3);
    rows.add("run, with everything attached", format_args!("{wall} ({k_steps_per_s:.0} k steps/s)"));
    rows.under(format_args!("{PRESET}: {} steps", number(&run["steps"])))
}

/// The recording and the thinned one, which holds the same steps.
fn sizes(dir: &Path, sparse: &Finished) -> Result<String, Failure> {
    let path = dir.join(RECORDING);
    let full = fs::metadata(&path).with_context(|| format!("{} cannot be read", path.display()))?.len();
    let ratio = full as f64 / sparse.bytes as f64;
    let mut rows = Rows::default();
    rows.add("every state", bytes(full));
    let size = bytes(sparse.bytes);
    rows.add("every 100th", format_args!("{size}, {ratio:.0} times smaller: the others are recomputed"));
    Ok(format!("\n{}", rows.under("recordings")))
}

/// The leading pulses beside independent numbers.
fn pulses_table(passages: &[Passage]) -> String {
    let mut text =
        String::from("\nleading pulses     v_peak (m/s)      reference  difference    speed (beads/s)\n");
    for line in REFERENCE.lines().skip(1) {
        let fields: Vec<&str> = line.split(',').collect();
        let [direction, order, v_peak, _] = fields[..] else { continue };
        let forward = direction == "forward";
        let (Ok(order), Ok(v_reference)) = (order.parse::<usize>(), v_peak.parse::<f64>()) else { continue };
        let probe = if forward { FORWARD_PROBE } else { BACKWARD_PROBE };
        let ours = |p: &&Passage| p.bead == probe && (p.v_peak_m_s > 0.0) == forward;
        // pulses that pass the probe after the end of the run are in the reference only
        let Some(passage) = passages.iter().filter(ours).nth(order - 1) else { continue };
        let difference = passage.v_peak_m_s / v_reference - 1.0;
        // writing to a String cannot fail
        let _ = writeln!(
            text,
            "  {direction:8} {order}   {:14.6} {v_reference:14.6}  {difference:10.1e}  {:17.2}",
            passage.v_peak_m_s, passage.speed_beads_per_s
        );
    }
    text
}

/// The files that the demo left, with their sizes.
fn files_table(dir: &Path) -> Result<String, Failure> {
    let mut text = String::from("\nfiles\n");
    for path in [dir.join(RECORDING), dir.join(SPARSE), dir.join(PAGE)].into_iter().chain(outputs(dir)) {
        let size = fs::metadata(&path).with_context(|| format!("{} is missing", path.display()))?.len();
        let _ = writeln!(text, "  {:>10}  {}", bytes(size).to_string(), path.display());
    }
    Ok(text)
}

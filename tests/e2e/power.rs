//! Power failures: what may be on the disk after one at each moment of a command, made from a trace of what the command
//! wrote and synced, and what can be read of it.
//!
//! `BEADLINE_POWER_FAILURES=1000` tries so many states after each operation; see CONTRIBUTING.

mod disk;
mod trace;

use crate::harness::{Place, skip};
use consumers::journal::{self, JournalError, JournalHead};
use consumers::table::{Column, Kind};
use disk::{Disk, Image, Luck};
use hostile::random::Random;
use recording::{RecordingInfo, RecordingSource, state_hash};
use schemas::frame::{FrameSource, Received};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet, HashSet};
use std::fs;
use std::hash::{BuildHasher, BuildHasherDefault, DefaultHasher};
use std::path::{Path, PathBuf};
use std::process::Command;
use trace::{Operation, trace};

const CHAIN: &str = "run --preset homogeneous --beads 20 --duration 4e-4 --name z";

/// Ten chunks, and a sync after some of them.
const SLOWLY: &str = "--flush-period 0.01 --sync-period 0.03 --pace 2e-3";

/// What is in a directory, each as a sentence: a state of a recording, a row of a journal, a whole file.
type Facts = BTreeSet<String>;

/// A command, and what its files hold when nothing fails.
struct Scene {
    place: Place,
    before: Image,
    operations: Vec<Operation>,
    /// What a finished file of a name may hold.
    whole: BTreeMap<PathBuf, Vec<Vec<u8>>>,
    /// Of the journal, if there is one.
    head: Option<JournalHead>,
    /// All that there was before the command, or is after it; none while that is found out.
    all: Option<Facts>,
}

/// How a campaign went.
#[derive(Debug, Default)]
struct Outcome {
    states: usize,
    failures: Vec<String>,
}

/// What is done with some of the states, given what must be in them.
type More<'a> = &'a dyn Fn(&Scene, &Facts) -> Result<(), String>;

impl Scene {
    /// Runs the words in a directory of which `prepare` made the contents; none if there is no strace.
    fn new(words: &str, prepare: impl FnOnce(&Place)) -> Option<Self> {
        let there = Command::new("strace").args(["-o", "/dev/null", "true"]).output();
        if !there.is_ok_and(|output| output.status.success()) {
            skip("no strace here: what a power failure leaves is not known (see tests/setup)");
            return None;
        }
        let place = Place::new();
        fs::create_dir(place.path("d")).unwrap();
        prepare(&place);
        let before = read_directory(&place.path("d"));
        let operations = trace(&place, words, &place.path("d"));
        let mut scene = Self { place, before, operations, whole: BTreeMap::new(), head: None, all: None };
        scene.learn();
        Some(scene)
    }

    /// Learns from what happened what may be there.
    fn learn(&mut self) {
        let after = read_directory(&self.place.path("d"));
        let mut disk = Disk::of(self.before.clone());
        for (path, content) in &self.before {
            self.whole.entry(path.clone()).or_default().extend(content.clone());
        }
        for operation in &self.operations {
            disk.apply(operation);
            if let Operation::Rename { to, .. } = operation {
                let image = disk.after_failure(Luck::Everything, &mut Random::new(0));
                self.whole.entry(to.clone()).or_default().extend(image[to].clone());
            }
        }
        let replayed = disk.after_failure(Luck::Everything, &mut Random::new(0));
        assert!(replayed == after, "the trace tells another story");
        let journal = after.iter().find(|(path, content)| is(path, "rows") && content.is_some());
        self.head = journal.and_then(|(_, content)| content.as_deref()).map(head_of);
        let [before, after] = [&self.before, &after].map(|image| self.facts(image).unwrap());
        self.all = Some(before.into_iter().chain(after).collect());
    }

    /// Makes `image` the contents of the directory.
    fn put(&self, image: &Image) {
        let directory = self.place.path("d");
        let there = read_directory(&directory);
        // what is below a directory is after it
        for (path, content) in there.iter().rev().filter(|(path, _)| !image.contains_key(*path)) {
            let path = directory.join(path);
            if content.is_some() { fs::remove_file(path).unwrap() } else { fs::remove_dir(path).unwrap() }
        }
        for (path, content) in image.iter().filter(|(path, content)| there.get(*path) != Some(*content)) {
            let path = directory.join(path);
            match content {
                Some(bytes) => fs::write(path, bytes).unwrap(),
                None => fs::create_dir(path).unwrap(),
            }
        }
    }

    /// What is in `image`, which is in the directory then; or what must not be: a finished name with torn contents, a state
    /// or a row that nobody wrote.
    fn facts(&self, image: &Image) -> Result<Facts, String> {
        self.put(image);
        let mut facts = Facts::new();
        for (path, content) in image.iter().filter_map(|(path, content)| Some((path, content.as_ref()?))) {
            let (name, at) = (path.display(), self.place.path("d").join(path));
            if is(path, "rows") {
                let read = self.head.as_ref().map(|head| {
                    journal::read(&at, head, |_, json| {
                        facts.extend(
                            journal::entry(json, &head.columns).map(|entry| format!("row {entry:?}")),
                        );
                        Ok::<_, JournalError>(())
                    })
                });
                read.transpose().map_err(|error| error.to_string())?;
            } else if !is(path, "partial") && !is(path, "interrupted") {
                if !self.whole.get(path).is_some_and(|whole| whole.contains(content)) {
                    return Err(format!("{name} is torn"));
                }
                facts.insert(format!("file {name}"));
            }
            if name.to_string().contains(".mcap") {
                facts.extend(states(&at));
            }
        }
        match self.all.as_ref().and_then(|all| facts.difference(all).next()) {
            Some(stranger) => Err(format!("nobody wrote this: {stranger}")),
            None => Ok(facts),
        }
    }

    /// What is on the disk for certain, and was not taken away again.
    fn promised(&self, disk: &Disk, random: &mut Random) -> Result<Facts, String> {
        let [certain, seen] = [Luck::Nothing, Luck::Everything].map(|luck| disk.after_failure(luck, random));
        Ok(&self.facts(&certain)? & &self.facts(&seen)?)
    }

    fn check(&self, image: &Image, promised: &Facts, more: Option<More>) -> Result<(), String> {
        let found = self.facts(image)?;
        match promised.difference(&found).next() {
            Some(lost) => Err(format!("synced and lost: {lost}")),
            None => more.map_or(Ok(()), |more| more(self, promised)),
        }
    }

    /// Has the power fail after each operation, `lucky` times with something else on the disk; each state is tried once, and
    /// `samples` of them with `more` as well.
    fn campaign(&self, lucky: usize, samples: usize, more: More) -> Outcome {
        let (mut random, mut seen, mut outcome) = (Random::new(1), HashSet::new(), Outcome::default());
        let stride = (self.operations.len() * lucky / samples / 2).max(1);
        let mut disk = Disk::of(self.before.clone());
        for number in 0..=self.operations.len() {
            let promised = self.promised(&disk, &mut random);
            let lucks = [Luck::Nothing, Luck::Everything, Luck::Zeros, Luck::Torn, Luck::Torn, Luck::Torn];
            for luck in lucks.into_iter().chain(std::iter::repeat_n(Luck::Any, lucky)) {
                let image = disk.after_failure(luck, &mut random);
                let hasher = BuildHasherDefault::<DefaultHasher>::default();
                if !seen.insert(hasher.hash_one(&image)) {
                    continue;
                }
                outcome.states += 1;
                let more = outcome.states.is_multiple_of(stride).then_some(more);
                let checked = promised.clone().and_then(|promised| self.check(&image, &promised, more));
                if let Err(what) = checked {
                    outcome.failures.push(format!("after operation {number}, {luck:?}: {what}"));
                }
            }
            if let Some(operation) = self.operations.get(number) {
                disk.apply(operation);
            }
        }
        let [certain, all] =
            [Luck::Nothing, Luck::Everything].map(|luck| disk.after_failure(luck, &mut random));
        if certain != all {
            outcome.failures.push("the command has ended, and not everything is on the disk".to_owned());
        }
        outcome
    }

    /// The same if nothing had ever been synced, which must go wrong.
    fn without_syncs(mut self) -> Self {
        self.operations.retain(|operation| !matches!(operation, Operation::Sync { .. }));
        self
    }
}

fn is(path: &Path, ending: &str) -> bool {
    path.extension().is_some_and(|found| found == ending)
}

fn read_directory(directory: &Path) -> Image {
    let mut image = Image::new();
    let mut left = vec![PathBuf::new()];
    while let Some(below) = left.pop() {
        for entry in fs::read_dir(directory.join(&below)).unwrap() {
            let path = below.join(entry.unwrap().file_name());
            let content = fs::read(directory.join(&path)).ok();
            if content.is_none() {
                left.push(path.clone());
            }
            image.insert(path, content);
        }
    }
    image
}

/// The states of a recording, as far as it can be read.
fn states(path: &Path) -> Facts {
    let mut facts = Facts::new();
    let Ok(mut source) = RecordingSource::open_all(path) else { return facts };
    while let Ok(Received::Frame(frame)) = source.receive() {
        let doubles = [frame.u_m, frame.v_m_s, frame.extra].concat();
        facts.insert(format!("state {} {}", frame.step, state_hash(frame.step, &doubles)));
    }
    facts
}

/// What a journal begins with, and the kinds of its columns by what is in them.
fn head_of(journal: &[u8]) -> JournalHead {
    let lines = std::str::from_utf8(journal).unwrap().lines();
    let mut lines = lines.map(|line| serde_json::from_str::<Value>(&line[9..]).unwrap());
    let head = lines.next().unwrap();
    let names = head["columns"].as_array().unwrap().iter().map(|name| name.as_str().unwrap().to_owned());
    let mut columns: Vec<_> = names.map(|name| Column::new(name, Kind::Word)).collect();
    for row in lines {
        for (column, cell) in columns.iter_mut().zip(row["cells"].as_array().unwrap()) {
            match cell {
                Value::Number(number) if number.is_u64() => column.kind = Some(Kind::Integer),
                Value::Number(_) => column.kind = Some(Kind::Double),
                _ => {}
            }
        }
    }
    JournalHead { identity: head["identity"].as_str().unwrap().to_owned(), columns }
}

/// Asserts that nothing goes wrong, and that much does if nothing is ever synced.
#[track_caller]
fn survives(scene: Scene, more: More) {
    let tries = std::env::var("BEADLINE_POWER_FAILURES").ok().and_then(|tries| tries.parse().ok());
    let Outcome { states, failures } = scene.campaign(tries.unwrap_or(150), 20, more);
    let shown: Vec<_> = failures.iter().take(10).collect();
    assert!(failures.is_empty(), "{states} states, {} failures, such as {shown:#?}", failures.len());
    let Outcome { states, failures } = scene.without_syncs().campaign(3, 1, &|_, _| Ok(()));
    assert!(!failures.is_empty(), "{states} states without a sync, and nothing is lost");
}

#[test]
fn what_was_synced_of_a_recording_is_there_after_a_power_failure() {
    let words = format!("{CHAIN} --out d/z.mcap {SLOWLY}");
    let Some(scene) = Scene::new(&words, |_| ()) else { return };
    survives(scene, &|scene, promised| {
        let place = &scene.place;
        if place.path("d/z.mcap").exists() {
            place.run("verify d/z.mcap").exits(0);
        } else if !promised.is_empty() {
            let said = place.run("recover d/z.mcap.partial --out r.mcap --force");
            if !promised.is_subset(&states(&place.path("r.mcap"))) {
                return Err(format!("recovered less: {}{}", said.stdout(), said.stderr()));
            }
            place.run("run --resume r.mcap").exits(0);
        }
        Ok(())
    });
}

/// Of a `.partial`, and of a finished recording whose last state no other run has.
#[test]
fn a_power_failure_while_a_run_is_resumed_costs_nothing() {
    let killed = |place: &Place| {
        place.run(&format!("{CHAIN} --out d/z.mcap {SLOWLY}")).exits(0);
        let bytes = fs::read(place.path("d/z.mcap")).unwrap();
        fs::remove_file(place.path("d/z.mcap")).unwrap();
        fs::write(place.path("d/z.mcap.partial"), &bytes[..bytes.len() * 2 / 3]).unwrap();
    };
    let ended = |place: &Place| {
        let run = place.start(&format!("{CHAIN} --out d/z.mcap --record-every-steps 7 --pace 5e-4"));
        place.wait_for_run("z", |run| run.step > 100);
        run.signal("INT");
        run.wait().exits(3);
    };
    let Some(scene) = Scene::new(&format!("run --resume d/z.mcap.partial {SLOWLY}"), killed) else { return };
    survives(scene, &resumes);
    let Some(scene) = Scene::new(&format!("run --resume d/z.mcap {SLOWLY}"), ended) else { return };
    survives(scene, &resumes);
}

/// Whether the run can be gone on with.
fn resumes(scene: &Scene, _: &Facts) -> Result<(), String> {
    let place = &scene.place;
    let names = ["d/z.mcap.partial", "d/z.mcap.interrupted", "d/z.mcap"];
    let name = names.into_iter().find(|name| place.path(name).exists()).unwrap();
    let mut resumed = place.run(&format!("run --resume {name}"));
    let said = resumed.stderr();
    // the disk has made something else than zeros of a head, or the run has gone on beside a state that is not due
    let is_unknown = RecordingInfo::read(&place.path(names[0])).is_err();
    if said.contains("with --out") && (is_unknown || scene.before.contains_key(Path::new("z.mcap"))) {
        resumed = place.run(&format!("run --resume {} --out r.mcap --force", names[1]));
    } else if said.contains("`beadline recover") && !place.path(names[1]).exists() {
        // what was recorded after the last sync has holes, and nobody has more
        place.run(&format!("recover {name} --out r.mcap --force"));
        resumed = place.run("run --resume r.mcap");
    }
    if resumed.code() == Some(0) { Ok(()) } else { Err(said + &resumed.stderr()) }
}

/// Two points at a time.
const SWEEP: &str = "\
[base]
preset = \"homogeneous\"
chain.beads = 20
[grid]
time.duration_s = { from = 1e-4, to = 2e-4, count = 8 }
";

#[test]
fn a_power_failure_costs_a_sweep_no_row_that_was_synced() {
    let words = "sweep s.toml --out d/s --jobs 2 --record";
    let Some(scene) = Scene::new(words, |place| drop(place.write("s.toml", SWEEP))) else { return };
    survives(scene, &|scene, _| {
        let place = &scene.place;
        let said = place.run(words);
        let results = fs::read(place.path("d/s/results.csv")).ok();
        if said.code() != Some(0)
            || !scene.whole[Path::new("s/results.csv")].contains(&results.unwrap_or_default())
        {
            return Err(format!("the sweep does not go on: {}", said.stderr()));
        }
        Ok(())
    });
}

#[test]
fn a_file_has_its_name_only_when_all_of_it_is_on_the_disk() {
    let prepare = |place: &Place| {
        place.run(&format!("{CHAIN} --out z.mcap")).exits(0);
        place.write("d/e.csv", "what was there before");
    };
    for words in [
        "energies z.mcap --force --out d/e.csv --figure d/e.svg",
        "energies z.mcap --out d/e.parquet --figure d/e.png",
        "contacts z.mcap --out d/c.mcap",
        "export z.mcap --out d/x.csv",
        "export z.mcap --out d/x.npz",
        "thin z.mcap --every-steps 9 --out d/t.mcap",
    ] {
        let Some(scene) = Scene::new(words, prepare) else { return };
        survives(scene, &|_, _| Ok(()));
    }
}

//! `beadline orbit`: periodic orbits, their multipliers, branches and maps of orbits.

mod map;
mod words;

use crate::args::OrbitArgs;
use crate::configuration::origin;
use crate::display::{count, counted};
use crate::failure::{BadInput, Done, Failure};
use crate::outputs::check_figures;
use crate::progress::Progress;
use crate::report::{Rows, report};
use crate::signals;
use anyhow::{Context, anyhow};
use consumers::journal::{self, Entry, Journal, JournalError, JournalHead};
use consumers::table::{Cell, Column, Kind, Table};
use experiments::recorded::record;
use figure::Figure;
use orbits::branch::{Change, End, Step};
use orbits::file::File;
use orbits::multipliers::Multipliers;
use orbits::shown::Mark;
use orbits::switching::Beginning;
use orbits::{MapError, NoOrbit, Orbit, Search, shown};
use schemas::amounts::{number, quantity};
use schemas::manifest::RunManifest;
use schemas::whole_file::{self, create_directory};
use serde_json::{Value, json};
use std::fs;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use words::{add_rows, tell_residual, told, words};

/// Orbit files to begin with.
const EXAMPLES: [(&str, &str); 5] = [
    ("breather", include_str!("orbit/breather.toml")),
    ("diode", include_str!("orbit/diode.toml")),
    ("fput", include_str!("orbit/fput.toml")),
    ("map", include_str!("orbit/map.toml")),
    ("pair", include_str!("orbit/pair.toml")),
];

/// The file in a directory of results that says of which orbit file they are, and the journal of a branch.
const SIGN: &str = "orbit.toml";
const JOURNAL: &str = "branch.journal";
/// The summary, which is written last.
const REPORT: &str = "orbit.json";

/// Columns of a journal behind those of a branch, as JSON: the place on the branch, the change of stability before it, the branches born there.
const KEPT: [&str; 3] = ["step", "change", "born"];

pub(crate) fn orbit(args: &OrbitArgs) -> Result<Done, Failure> {
    if let Some(asked) = &args.example {
        return super::print_example("orbit", &EXAMPLES, asked);
    }
    let (Some(path), Some(out)) = (&args.file, &args.out) else {
        return Err(bad_input!("an orbit needs ORBIT.toml and --out DIR; see --help"));
    };
    check_figures(&[out.join("figure.png")], args.look)?;
    let text = schemas::text::read(path)
        .with_context(|| format!("{} cannot be read", path.display()))
        .bad_input()?;
    let file = File::read(path, &text, experiments::prepared).bad_input()?;
    let place = Place { out, text: &text, args };
    place.check()?;
    let stop = signals::stop_flag()?;
    let family = |parameter: f64| file.problem(parameter);
    let search = Search::begin(&family, file.from(), file.options(), &stop).map_err(failure)?;
    match (file.grid(), file.stretch()) {
        (Some(grid), _) => map::map(&place, grid, &stop),
        (None, None) => one(&place, &file, &search, &stop),
        (None, Some(_)) => Branch::of(&place, &file, search)?.follow(&stop),
    }
}

/// An orbit that is not found: the input, or that there is none.
fn failure(why: NoOrbit) -> Failure {
    match why {
        NoOrbit::Chain(_) | NoOrbit::Config(_) | NoOrbit::Map(MapError::NoTangent(_)) => {
            Failure::BadInput(why.into())
        }
        NoOrbit::Map(_) | NoOrbit::Stuck { .. } | NoOrbit::NotUnique { .. } | NoOrbit::Branch(_) => {
            Failure::Stopped(why.into())
        }
    }
}

/// A directory of results.
struct Place<'a> {
    out: &'a Path,
    text: &'a str,
    args: &'a OrbitArgs,
}

impl Place<'_> {
    /// Refuses a directory that is used for something else.
    fn check(&self) -> Result<(), Failure> {
        let sign = self.out.join(SIGN);
        let found = fs::read_to_string(&sign).ok();
        let is_empty = fs::read_dir(self.out).map_or(true, |mut entries| entries.next().is_none());
        let is_ours = found.as_deref() == Some(self.text);
        // a branch or a map that has ended is told again
        let goes_on = [JOURNAL, map::JOURNAL].iter().any(|journal| self.out.join(journal).exists());
        let is_unfinished = goes_on || !self.out.join(REPORT).exists();
        if is_empty || self.args.force && found.is_some() || is_ours && is_unfinished {
            return Ok(());
        }
        let why = match found {
            Some(_) if is_ours => "holds the results already",
            Some(_) => "holds the results of another orbit file",
            None => "holds something else",
        };
        let out = self.out.display();
        Err(bad_input!("{out} {why}; choose another directory, or replace results with --force"))
    }

    /// Makes the directory, for results of this orbit file alone.
    fn make(&self) -> Result<(), Failure> {
        create_directory(self.out)?;
        let sign = self.out.join(SIGN);
        if self.args.force || fs::read_to_string(&sign).ok().as_deref() != Some(self.text) {
            let entries = fs::read_dir(self.out)?.flatten();
            for entry in entries.filter(|entry| is_result(&entry.file_name().to_string_lossy())) {
                let _ = fs::remove_file(entry.path());
            }
        }
        Ok(whole_file::write(&sign, self.text.as_bytes(), true)?)
    }

    fn path(&self, name: &str) -> PathBuf {
        self.out.join(name)
    }

    fn draw(&self, name: &str, figure: &Figure) -> Result<(), Failure> {
        Ok(figure.write(&self.path(name), self.args.look.options(), true)?)
    }

    /// Records one period of `orbit`.
    fn record(&self, file: &File, orbit: &Orbit, name: &str, stop: &AtomicBool) -> Result<(), Failure> {
        let config = file.config_of(orbit).bad_input()?;
        let manifest = RunManifest::new(&config, "orbit", origin()).bad_input()?;
        record(&manifest, &config.to_toml(), &self.path(name), stop, |_| ())?;
        Ok(())
    }

    fn write_report(&self, told: &Value) -> Result<(), Failure> {
        Ok(whole_file::write(&self.path(REPORT), format!("{told:#}\n").as_bytes(), true)?)
    }

    /// The results `names` that are there.
    fn results(&self, names: &[&str]) -> impl Iterator<Item = String> {
        let paths: Vec<PathBuf> = names.iter().map(|name| self.path(name)).collect();
        paths.into_iter().filter(|path| path.exists()).map(|path| path.display().to_string())
    }

    fn write_multipliers(&self, found: &Multipliers) -> Result<(), Failure> {
        let columns = ["re", "im", "size", "angle_rad"].map(|name| Column::new(name, Kind::Double));
        let mut table = Table::create(&self.path("multipliers.csv"), &columns, true)?;
        for one in found.found() {
            table.double(one.re).double(one.im).double(one.size()).double(one.angle_rad());
            table.end_row()?;
        }
        table.finish()?;
        Ok(())
    }
}

/// True for the file names of the results of any orbit file, of which none stay beside those of another.
fn is_result(name: &str) -> bool {
    let Some((stem, end)) = name.rsplit_once('.') else { return false };
    match end {
        "mcap" => match stem.strip_prefix("change-").or(stem.strip_prefix("last-")) {
            Some(number) => !number.is_empty() && number.bytes().all(|byte| byte.is_ascii_digit()),
            None => ["orbit", "last"].contains(&stem),
        },
        "png" => ["branch", "map", "multipliers", "spectra"].contains(&stem),
        "csv" => ["branch", "map", "multipliers"].contains(&stem),
        _ => [REPORT, JOURNAL, map::JOURNAL].contains(&name),
    }
}

/// Finds one orbit and writes its results.
fn one(place: &Place<'_>, file: &File, search: &Search<'_>, stop: &AtomicBool) -> Result<Done, Failure> {
    let orbit = search.find().map_err(failure)?;
    place.make()?;
    place.record(file, &orbit, "orbit.mcap", stop)?;
    place.write_multipliers(&orbit.multipliers)?;
    place.draw("multipliers.png", &shown::multipliers(words(&orbit), &orbit.multipliers))?;
    let told = told(&orbit);
    place.write_report(&told)?;
    report(place.args.json, &told, || {
        let mut rows = Rows::default();
        add_rows(&mut rows, &orbit);
        rows.each("results", place.results(&["orbit.mcap", "multipliers.csv", "multipliers.png", REPORT]));
        rows.under(format_args!("orbit of {}", place.args.file.as_deref().unwrap_or(place.out).display()))
    })?;
    tell_residual(&orbit);
    Ok(Done::Whole)
}

/// A branch of orbits, in a directory.
struct Branch<'a> {
    place: &'a Place<'a>,
    file: &'a File,
    search: Search<'a>,
    key: String,
    head: JournalHead,
    stretch: orbits::branch::Stretch,
}

/// A branch as far as it has come.
#[derive(Default)]
struct Come {
    /// Rows of the table.
    rows: Vec<Vec<Cell>>,
    /// Changes of stability as they are told.
    changes: Vec<Value>,
    /// Beginnings of the branches after the first one.
    born: Vec<Beginning>,
    /// The last orbit of each branch.
    lasts: Vec<(Step, Orbit)>,
}

impl<'a> Branch<'a> {
    fn of(place: &'a Place<'a>, file: &'a File, search: Search<'a>) -> Result<Self, Failure> {
        let (key, stretch) = file.stretch().ok_or_else(|| anyhow!("nothing is followed"))?;
        let kept = KEPT.map(|name| Column::new(name, Kind::Word));
        let columns = shown::branch_columns(key).into_iter().chain(kept).collect();
        // the orbit file lies beside it
        let identity = concat!("orbit, beadline ", env!("CARGO_PKG_VERSION")).to_owned();
        let head = JournalHead { identity, columns };
        Ok(Self { place, file, search: search.along(&stretch), key: key.to_owned(), head, stretch })
    }

    fn follow(&self, stop: &AtomicBool) -> Result<Done, Failure> {
        let mut come = self.come()?;
        // nothing is written before there is an orbit
        let mut journal = None;
        signals::would_leave(format!(
            "the orbits found are kept in {}, the same command goes on",
            self.place.out.display()
        ));
        let mut progress = Progress::new(1000, "branch");
        let (mut failed, mut ends) = (None, Vec::new());
        while ends.len() <= come.born.len() && !ends.contains(&End::Stopped) {
            let branch = ends.len();
            let search = self.search_of(branch, &come);
            let begun = come.lasts.get(branch).map(|(step, _)| step.clone());
            let end = search.follow(&self.stretch, begun, |step, orbit| {
                let found = self.add(&mut come, branch, &search, (step, orbit), &mut journal, stop);
                let way =
                    (step.unknown.parameter - self.stretch.from) / (self.stretch.to - self.stretch.from);
                #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "from 0 to 1000")]
                if progress.at((way.clamp(0.0, 1.0) * 1000.0) as u64) {
                    progress.tell(&[
                        &format!("{} = {}", self.key, number(step.unknown.parameter)),
                        &counted(come.rows.len() as u64, "orbit"),
                    ]);
                }
                failed = found.err();
                if failed.is_some() || stop.load(Ordering::Relaxed) {
                    ControlFlow::Break(())
                } else {
                    ControlFlow::Continue(())
                }
            });
            ends.push(end.map_err(failure)?);
        }
        progress.finish();
        journal.map_or(Ok(()), |journal: Journal| journal.sync())?;
        failed.map_or(Ok(()), Err)?;
        if !ends.contains(&End::Stopped) {
            // as after an interruption: with the same residuals
            come.lasts = self.again(&come, come.lasts.iter().map(|(step, _)| step.clone()).collect())?;
        }
        self.finish(&come, &ends, stop)
    }

    /// The search along branch `branch`, of which the first one is 0.
    fn search_of(&self, branch: usize, come: &Come) -> Search<'a> {
        let born = branch.checked_sub(1).and_then(|place| come.born.get(place));
        born.map_or_else(|| self.search.clone(), |beginning| self.search.of_branch(beginning))
    }

    /// The branches as far as their journal has them.
    fn come(&self) -> Result<Come, Failure> {
        let path = self.place.path(JOURNAL);
        let mut come = Come::default();
        if self.place.args.force || !path.exists() {
            return Ok(come);
        }
        let (mut lasts, mut written): (Vec<Step>, u64) = (Vec::new(), 0);
        journal::read::<JournalError>(&path, &self.head, |index, line| {
            written = written.max(index + 1);
            // none behind one that is missing: each is found from the one before, and added again behind these
            let entry = journal::entry(line, &self.head.columns).filter(|_| index == come.rows.len() as u64);
            if let Some(Entry { mut cells, .. }) = entry {
                let kept = cells.split_off(cells.len() - KEPT.len());
                let mut kept =
                    kept.iter().map(|cell| if let Cell::Word(word) = cell { word.as_str() } else { "" });
                lasts.truncate(shown::branch_of(&cells));
                lasts.extend(kept.next().and_then(|step| serde_json::from_str::<Step>(step).ok()));
                come.changes.extend(kept.next().and_then(|change| serde_json::from_str(change).ok()));
                let born = kept.next().and_then(|born| serde_json::from_str::<Vec<Beginning>>(born).ok());
                come.born.extend(born.into_iter().flatten());
                come.rows.push(cells);
            }
            Ok(())
        })
        .bad_input()?;
        let kept = come.rows.len() as u64;
        if kept < written {
            let kept = counted(kept, "orbit");
            notice!(
                "a row of {} is damaged: {kept} before it kept, those behind it are computed again",
                path.display()
            );
        }
        come.lasts = self.again(&come, lasts)?;
        Ok(come)
    }

    /// The orbits at a place on each branch.
    fn again(&self, come: &Come, steps: Vec<Step>) -> Result<Vec<(Step, Orbit)>, Failure> {
        let again = |(branch, step): (usize, Step)| {
            let orbit = self.search_of(branch, come).again(&step.unknown).map_err(failure)?;
            Ok((step, orbit))
        };
        steps.into_iter().enumerate().map(again).collect()
    }

    /// Adds an orbit of `branch`, which `search` finds, and the change of stability before it.
    fn add(
        &self,
        come: &mut Come,
        branch: usize,
        search: &Search<'_>,
        (step, orbit): (&Step, &Orbit),
        journal: &mut Option<Journal>,
        stop: &AtomicBool,
    ) -> Result<(), Failure> {
        let (mut told, mut born) = (None, Vec::new());
        if let Some((before, last)) = come.lasts.get(branch) {
            match search.change(last, orbit, before.turns(step)) {
                Ok(Some(change)) => {
                    let name = format!("change-{}.mcap", come.changes.len() + 1);
                    self.place.record(self.file, &change.orbit, &name, stop)?;
                    let mut change_told = told_change(&change, come.rows.len());
                    if branch == 0 && self.file.has_branches() && change.may_bear() {
                        match search.born(&change, &self.stretch) {
                            Ok(found) => born = found,
                            Err(why) => change_told["bears_none"] = why.to_string().into(),
                        }
                    }
                    let first = come.born.len() + 1;
                    change_told["bears"] = (first..first + born.len()).collect();
                    told = Some(change_told);
                }
                Ok(None) => {}
                Err(why) => told = Some(told_lost(&why, orbit, come.rows.len())),
            }
        }
        if stop.load(Ordering::Relaxed) {
            // the change may not be whole: the same command finds this orbit again
            return Ok(());
        }
        let journal = if let Some(journal) = journal {
            journal
        } else {
            self.place.make()?;
            journal.insert(Journal::open(&self.place.path(JOURNAL), &self.head, |_| ())?)
        };
        let word = |is_there: bool, json: String| if is_there { Cell::Word(json) } else { Cell::Empty };
        if let Some(told) = &mut told {
            told["branch"] = branch.into();
        }
        let change = told.as_ref().map_or(Cell::Empty, |told| Cell::Word(told.to_string()));
        let kept = [
            Cell::Word(serde_json::to_string(step)?),
            change,
            word(!born.is_empty(), serde_json::to_string(&born)?),
        ];
        come.changes.extend(told);
        come.born.extend(born);
        let row: Vec<Cell> = shown::row(orbit).into_iter().chain([Cell::Integer(branch as u64)]).collect();
        let cells = row.iter().cloned().chain(kept).collect();
        journal.append(&Entry { index: come.rows.len() as u64, wall_s: 0.0, cells })?;
        come.rows.push(row);
        come.lasts.truncate(branch);
        come.lasts.push((step.clone(), orbit.clone()));
        Ok(())
    }

    /// Writes the results of the branches, which have these ends.
    fn finish(&self, come: &Come, ends: &[End], stop: &AtomicBool) -> Result<Done, Failure> {
        let place = self.place;
        let Some((_, last)) = come.lasts.first() else { return Err(failure(MapError::Stopped.into())) };
        let mut table = Table::create(&place.path("branch.csv"), &shown::branch_columns(&self.key), true)?;
        come.rows.iter().try_for_each(|row| table.add_row(row))?;
        table.finish()?;
        let marks: Vec<Mark> = come.changes.iter().filter_map(mark).collect();
        place.draw(
            "branch.png",
            &shown::branch(format!("branch along {}", self.key), &self.key, &come.rows, &marks),
        )?;
        let mut spectra = Vec::new();
        if !ends.contains(&End::Stopped) {
            place.record(self.file, last, "last.mcap", stop)?;
            for (branch, (_, last)) in come.lasts.iter().enumerate().skip(1) {
                place.record(self.file, last, &format!("last-{branch}.mcap"), stop)?;
            }
            spectra = self.file.spectra(stop).map_err(|why| failure(why.into()))?;
        }
        if !spectra.is_empty() {
            let caption = format!("branch along {}, and runs beside it from the seed", self.key);
            let figure = shown::beside_spectra(caption, &self.key, &come.rows, &marks, &spectra);
            place.draw("spectra.png", &figure)?;
        }
        let runs: Vec<Value> = spectra
            .iter()
            .map(|one| json!({ "parameter": one.parameter, "bead": one.bead, "rms_m_s": one.rms_m_s() }))
            .collect();
        place.write_multipliers(&last.multipliers)?;
        place.draw("multipliers.png", &shown::multipliers(words(last), &last.multipliers))?;
        let branches = told_branches(come, ends);
        let told = json!({
            "key": self.key, "orbits": come.rows.len(), "end": ends[0].as_str(), "changes": come.changes, "branches": branches,
            "last": told(last), "runs": runs,
        });
        place.write_report(&told)?;
        report(place.args.json, &told, || {
            let mut rows = Rows::default();
            rows.add("orbits", count(come.rows.len() as u64));
            rows.each("change", come.changes.iter().map(told_words));
            rows.each(
                "branch",
                branches.iter().map(|one| one["words"].as_str().unwrap_or_default().to_owned()),
            );
            rows.each(
                "run",
                spectra.iter().map(|one| {
                    let rms = quantity(one.rms_m_s(), "m/s");
                    format!("at {}: bead {} moves at {rms} (rms)", number(one.parameter), one.bead)
                }),
            );
            add_rows(&mut rows, last);
            let files = [
                "branch.csv",
                "branch.png",
                "spectra.png",
                "multipliers.csv",
                "multipliers.png",
                "last.mcap",
                REPORT,
            ];
            rows.each("results", place.results(&files));
            rows.under(format_args!("branch along {}, to {}", self.key, number(last.unknown.parameter)))
        })?;
        for (branch, ((step, _), end)) in come.lasts.iter().zip(ends).enumerate() {
            self.tell_end(branch, step, end);
        }
        let are_located = come.changes.iter().all(|change| change["is_located"] == true);
        let are_born = come.changes.iter().all(|change| change["bears_none"].is_null());
        let is_whole = |end: &End| matches!(end, End::Reached | End::CameBack | End::Closed);
        let are_whole = ends[0] == End::Reached && ends.len() > come.born.len() && ends.iter().all(is_whole);
        Ok(Done::whole_if(are_whole && are_located && are_born))
    }

    /// Tells why branch `branch` ends before its last value, at `step`.
    fn tell_end(&self, branch: usize, step: &Step, end: &End) {
        let name = if branch == 0 { "the branch".to_owned() } else { format!("branch {branch}") };
        let at = format!("{} = {}", self.key, number(step.unknown.parameter));
        match end {
            End::Reached | End::Closed => {}
            End::CameBack => notice!("{name} turns and comes back to the first value of the key"),
            End::Most => notice!("{name} was followed up to {at}; continue.most allows more orbits"),
            End::Lost(why) => notice!("{name} ends at {at}: {why}"),
            End::Stopped => notice!("stopped: the orbits found are kept, the same command goes on"),
        }
    }
}

/// The branches after the first one, as JSON.
fn told_branches(come: &Come, ends: &[End]) -> Vec<Value> {
    let branches = come.born.iter().zip(come.lasts.iter().zip(ends).skip(1)).enumerate();
    let told = branches.map(|(place, (beginning, ((step, last), end)))| {
        let branch = place + 1;
        let orbits = come.rows.iter().filter(|row| shown::branch_of(row) == branch).count() as u64;
        let (periods, to) = (beginning.periods, step.unknown.parameter);
        let from = beginning.step.unknown.parameter;
        let of = if periods == 2 { " of twice the period" } else { "" };
        let (from_word, to_word) = (number(from), number(to));
        let words = format!("{branch}: {}{of}, from {from_word} to {to_word}", counted(orbits, "orbit"));
        json!({
            "branch": branch, "words": words, "orbits": orbits, "periods": periods, "from": from, "to": to, "end": end.as_str(),
            "last": told(last),
        })
    });
    told.collect()
}

/// A change of stability in words, from JSON.
fn told_words(change: &Value) -> String {
    let at = change["row"][0].as_f64().map_or_else(String::new, number);
    let none = change["bears_none"].as_str().map_or_else(String::new, |why| format!("; {why}"));
    format!("at {at}: {}{none}", change["words"].as_str().unwrap_or_default())
}

/// A change of stability before row `before` as JSON.
fn told_change(change: &Change, before: usize) -> Value {
    let orbit = &change.orbit;
    json!({
        "name": change.name,
        "words": shown::words(change),
        "is_located": change.is_located,
        "begins": change.begins,
        "before": before,
        "row": shown::values(orbit),
        "parameter": orbit.unknown.parameter,
        "period_s": orbit.period_s(),
        "energy_j": orbit.energy_j,
        "amplitude_m": orbit.amplitude_m(),
        "multiplier": { "re": change.multiplier.re, "im": change.multiplier.im },
    })
}

/// The same of one that could not be located, because of `why`, in the step to `orbit`.
fn told_lost(why: &NoOrbit, orbit: &Orbit, before: usize) -> Value {
    let words = format!("stability changes somewhere in the step before: {why}");
    let row = shown::values(orbit);
    json!({ "name": "not located", "words": words, "is_located": false, "before": before, "row": row })
}

/// The mark of a change in a figure.
fn mark(change: &Value) -> Option<Mark> {
    let name = change["name"].as_str()?.to_owned();
    let row = change["row"].as_array()?.iter().map(|value| value.as_f64().unwrap_or(f64::NAN)).collect();
    Some(Mark { name, before: usize::try_from(change["before"].as_u64()?).ok()?, row })
}

//! Things that the server shows: runs of the bus, a recording, a folder of recordings, a sweep.

use super::live::{Watches, chain};
use super::results;
use crate::commands::ls::glance;
use crate::configuration::origin;
use crate::failure::{BadInput, Failure};
use crate::frames;
use crate::limits;
use crate::links::{NOT_FOLLOWED, check_inside, leads_out};
use crate::sweep::{self, Shown};
use bus::{AttachNotice, Bus, list_runs};
use page::{LiveFeed, Served, Shelf};
use producer::sweep::Sweep;
use recording::RecordingInfo;
use schemas::manifest::RunManifest;
use schemas::run_name::RunName;
use schemas::text::{shown, shown_within};
use schemas::whole_file::is_being_written;
use serde::Serialize;
use serde_json::{Map, Value, json};
use source::Named;
use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::{Duration, SystemTime};

/// Rows of a table that a page is sent: some 6 MB.
const MAX_ENTRIES: usize = 10_000;
/// Longest text of a row (bytes); `info` shows more.
const ROW_TEXT_BYTES: usize = 1 << 10;
/// Longest list of a manifest in a row: a table compares numbers and words.
const ROW_LIST: usize = 16;
/// Interval at which we look for a run while there is none.
const SEARCH_PERIOD: Duration = Duration::from_millis(100);

/// All runs that the server shows.
pub(super) struct Runs {
    kind: Kind,
    /// Recordings by their ids: the numbers of their places here, so that no address names a path.
    files: Mutex<Files>,
    /// Results by recordings, with the state of the file when they were computed.
    results: Mutex<HashMap<PathBuf, (Stamp, String)>>,
}

/// Recordings by their numbers, and the numbers by the recordings: a folder may have thousands.
#[derive(Default)]
struct Files {
    paths: Vec<PathBuf>,
    numbers: HashMap<PathBuf, usize>,
}

enum Kind {
    Live(Arc<Watches>, Option<RunName>),
    /// One or several, in the order in which they were named.
    Recordings(Vec<PathBuf>),
    Folder(PathBuf),
    Sweep(PathBuf, Box<Sweep>),
}

/// Size and time of the last change of a file.
type Stamp = Option<(u64, Option<SystemTime>)>;

/// One entry of the page's list.
#[derive(Default, Serialize)]
struct Shelved {
    id: String,
    name: String,
    kind: &'static str,
    url: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    results: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    manifest: Option<Value>,
    #[serde(skip_serializing_if = "Option::is_none")]
    bytes: Option<u64>,
    values: Map<String, Value>,
    #[serde(skip_serializing_if = "Option::is_none")]
    damage: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    error: Option<String>,
}

impl Runs {
    /// The sources that are named, one or several recordings; waits for a live run until `stop` is set.
    pub(super) fn open(named: &[Named], stop: &Arc<AtomicBool>) -> Result<Self, Failure> {
        let kind = match named {
            [only] => Self::kind(only, stop)?,
            several => Kind::Recordings(several.iter().map(recording).collect::<Result<_, _>>()?),
        };
        let runs = Self { kind, files: Mutex::default(), results: Mutex::default() };
        // what cannot be listed is told before anything is served
        runs.entries(stop)?;
        Ok(runs)
    }

    fn kind(named: &Named, stop: &Arc<AtomicBool>) -> Result<Kind, Failure> {
        Ok(match named {
            Named::Live(name) => {
                let bus = Bus::from_env()?;
                wait_for_run(&bus, name.as_ref(), stop)?;
                Kind::Live(Arc::new(Watches::new(bus, stop)), name.clone())
            }
            Named::File(path) if path.is_dir() => match sweep::file_in(path) {
                Some(file) => {
                    check_inside(&file, path)?;
                    Kind::Sweep(path.clone(), Box::new(Sweep::read(&file, experiments::HOOKS).bad_input()?))
                }
                None => Kind::Folder(path.clone()),
            },
            file @ Named::File(_) => Kind::Recordings(vec![recording(file)?]),
        })
    }

    /// Waits until nothing runs any more, after the stop flag was set.
    pub(super) fn wait(&self) {
        if let Kind::Live(watches, ..) = &self.kind {
            watches.wait();
        }
    }

    /// The rows of the table, and how many more there are; ends early once `stop` is set.
    fn entries(&self, stop: &AtomicBool) -> Result<(Vec<Shelved>, usize), Failure> {
        let mut more = 0;
        let entries = match &self.kind {
            Kind::Live(watches, name) => {
                let is_meant = |run: &RunName| name.as_ref().is_none_or(|name| name == run);
                let live =
                    list_runs(watches.bus())?.into_iter().filter(|run| run.is_live() && is_meant(&run.name));
                let mut names: Vec<_> = live.map(|run| run.name).collect();
                if let (Some(name), true) = (name, names.is_empty()) {
                    names.push(name.clone()); // the page waits for it
                }
                names.iter().map(live_entry).collect()
            }
            Kind::Recordings(paths) => paths.iter().map(|path| self.recording_entry(path)).collect(),
            Kind::Folder(folder) => {
                let found =
                    fs::read_dir(folder).bad_input()?.filter_map(Result::ok).map(|found| found.path());
                let mut paths: Vec<_> = found.filter(|path| is_recording(path)).collect();
                paths.sort();
                more = paths.len().saturating_sub(MAX_ENTRIES);
                paths.truncate(MAX_ENTRIES);
                let paths = paths.iter().take_while(|_| !stop.load(Ordering::Relaxed));
                paths.map(|path| self.recording_entry(path)).collect()
            }
            Kind::Sweep(folder, sweep) => {
                let points = sweep::shown(sweep, folder, MAX_ENTRIES)?;
                more =
                    usize::try_from(sweep.point_count()).unwrap_or(usize::MAX).saturating_sub(points.len());
                points.into_iter().map(|point| self.point_entry(point)).collect()
            }
        };
        Ok((entries, more))
    }

    /// True if `path` may be shown: a file that was named, or one in a folder to which no link leads.
    fn is_inside(&self, path: &Path) -> bool {
        match &self.kind {
            Kind::Folder(folder) | Kind::Sweep(folder, _) => !leads_out(path, folder),
            Kind::Live(..) | Kind::Recordings(_) => true,
        }
    }

    /// The id of a recording.
    fn id(&self, path: &Path) -> String {
        let mut files = self.files.lock().unwrap_or_else(PoisonError::into_inner);
        let Files { paths, numbers } = &mut *files;
        let number = numbers.get(path).copied().unwrap_or_else(|| {
            paths.push(path.to_owned());
            numbers.insert(path.to_owned(), paths.len() - 1);
            paths.len() - 1
        });
        number.to_string()
    }

    fn recording_entry(&self, path: &Path) -> Shelved {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if !self.is_inside(path) {
            return refused(name, NOT_FOLLOWED);
        }
        match glance(path, RecordingInfo::glance) {
            Ok(info) => Shelved {
                damage: damage(&info, path).map(|damage| shown_within(&damage, ROW_TEXT_BYTES).into_owned()),
                manifest: serde_json::to_value(&info.manifest).ok().map(of_a_row),
                bytes: Some(info.file_bytes),
                ..self.opened(name, path)
            },
            Err(error) => refused(name, &error),
        }
    }

    /// An entry that opens the recording at `path`.
    fn opened(&self, name: String, path: &Path) -> Shelved {
        let id = self.id(path);
        let (url, results) = (format!("recording/{id}"), Some(format!("results/{id}")));
        Shelved { id, name, kind: "recording", url, results, ..Shelved::default() }
    }

    fn point_entry(&self, point: Shown) -> Shelved {
        let Shown { index, values, recording } = point;
        let name = format!("point {index}");
        match recording {
            Some(path) if !self.is_inside(&path) => Shelved { values, ..refused(name, NOT_FOLLOWED) },
            Some(path) => {
                let bytes = fs::metadata(&path).ok().map(|found| found.len());
                Shelved { bytes, values, ..self.opened(name, &path) }
            }
            None => {
                let (id, url) = (format!("start-{index}"), format!("start/{index}"));
                Shelved { id, name, kind: "start", url, values, ..Shelved::default() }
            }
        }
    }

    /// The results of the recording at `path`, of each file by one thread at a time.
    fn results_of(&self, path: &Path, stop: &Arc<AtomicBool>) -> Result<String, Failure> {
        let stamp = |found: fs::Metadata| (found.len(), found.modified().ok());
        // an object behind a URL is read once: it may not change
        let stamp = fs::metadata(path).map(stamp).ok();
        let kept = || self.results.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, text)) = kept().get(path).filter(|(known, _)| *known == stamp) {
            return Ok(text.clone());
        }
        limits::compute_beside_others();
        let text = serde_json::to_string(&results::of_recording(path, stop, |_| {})?)?;
        kept().insert(path.to_owned(), (stamp, text.clone()));
        Ok(text)
    }
}

impl Shelf for Runs {
    fn title(&self) -> String {
        match &self.kind {
            Kind::Live(_, Some(name)) => name.to_string(),
            Kind::Live(_, None) => "live runs".to_owned(),
            Kind::Folder(path) | Kind::Sweep(path, _) => name(path),
            Kind::Recordings(paths) => paths.iter().map(|path| name(path)).collect::<Vec<_>>().join(", "),
        }
    }

    fn list(&self, stop: &Arc<AtomicBool>) -> Served {
        let listing = self.entries(stop).map(|(entries, more)| {
            let kind = match &self.kind {
                Kind::Sweep(..) => "sweep",
                Kind::Recordings(paths) if paths.len() == 2 => "pair",
                Kind::Live(..) | Kind::Recordings(_) if entries.len() == 1 => "one",
                _ => "folder",
            };
            let keys: Vec<_> = match &self.kind {
                Kind::Sweep(_, sweep) => {
                    sweep.parameters().iter().map(|parameter| parameter.key.clone()).collect()
                }
                _ => Vec::new(),
            };
            json!({ "title": self.title(), "kind": kind, "keys": keys, "entries": entries, "more": more })
                .to_string()
        });
        Some(listing.map_err(said))
    }

    fn recording(&self, id: &str) -> Option<PathBuf> {
        let place = usize::try_from(number(id)?).ok()?;
        let path = self.files.lock().unwrap_or_else(PoisonError::into_inner).paths.get(place).cloned()?;
        // it may have become a link since it was listed
        self.is_inside(&path).then_some(path)
    }

    fn results(&self, id: &str, stop: &Arc<AtomicBool>) -> Served {
        let path = self.recording(id)?;
        Some(self.results_of(&path, stop).map_err(said))
    }

    fn start(&self, id: &str) -> Served {
        let Kind::Sweep(_, sweep) = &self.kind else { return None };
        let point = sweep.point(number(id)?).ok()?;
        let manifest = RunManifest::new(&point.config, "point", origin());
        let start = manifest.map(|manifest| {
            json!({ "chain": chain(&manifest.physics.chain()), "manifest": manifest }).to_string()
        });
        Some(start.map_err(|error| error.to_string()))
    }

    fn live(&self, name: &str) -> Option<LiveFeed> {
        let Kind::Live(watches, meant) = &self.kind else { return None };
        let name: RunName = name.parse().ok()?;
        meant.as_ref().is_none_or(|meant| *meant == name).then(|| watches.feed(&name))
    }
}

fn live_entry(name: &RunName) -> Shelved {
    let (id, url) = (format!("live-{name}"), format!("live/{name}"));
    Shelved { id, name: name.to_string(), kind: "live", url, ..Shelved::default() }
}

/// An entry that opens nothing, and says why.
fn refused(name: String, error: &str) -> Shelved {
    let error = Some(shown_within(error, ROW_TEXT_BYTES).into_owned());
    Shelved { id: format!("refused-{name}"), name, kind: "recording", error, ..Shelved::default() }
}

/// A manifest without the parts that no table shows: long lists, and the ends of long texts.
fn of_a_row(mut manifest: Value) -> Value {
    fn shorten(value: &mut Value) {
        match value {
            Value::String(text) => *text = shown_within(text, ROW_TEXT_BYTES).into_owned(),
            Value::Array(list) => {
                list.truncate(if list.len() > ROW_LIST { 0 } else { ROW_LIST });
                list.iter_mut().for_each(shorten);
            }
            Value::Object(entries) => entries.values_mut().for_each(shorten),
            Value::Null | Value::Bool(_) | Value::Number(_) => {}
        }
    }
    shorten(&mut manifest);
    manifest
}

/// A number as an address writes it, which is one way.
fn number(text: &str) -> Option<u64> {
    text.parse().ok().filter(|number: &u64| number.to_string() == text)
}

/// The path of one of several sources, which is a recording.
fn recording(named: &Named) -> Result<PathBuf, Failure> {
    match named {
        Named::File(path) if !path.is_dir() => {
            let info = RecordingInfo::glance(path).bad_input()?;
            if let Some(damage) = damage(&info, path) {
                notice!("{damage}");
            }
            Ok(path.clone())
        }
        other => Err(bad_input!(
            "{other}: of several sources each is a recording; a folder or a live run is viewed alone"
        )),
    }
}

fn name(path: &Path) -> String {
    let path = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// Damage of a recording as a sentence; none of one that is being written.
fn damage(info: &RecordingInfo, path: &Path) -> Option<String> {
    let shown = path.display();
    match &info.damage {
        Some(damage) => Some(format!("{shown} is damaged: {damage}; what is whole in it is shown")),
        None if !info.finished && !is_being_written(path) => {
            Some(format!("{shown} was not closed; what is whole in it is shown"))
        }
        None => None,
    }
}

/// True if `path` has the name of a recording; anything else but a file there, and any link, has an entry with the reason.
fn is_recording(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension == "mcap") && !path.is_dir()
}

/// Waits until such a run is there, or `stop` is set.
fn wait_for_run(bus: &Bus, name: Option<&RunName>, stop: &AtomicBool) -> Result<(), Failure> {
    let mut is_told = false;
    while !stop.load(Ordering::Relaxed) {
        let is_meant = |run: &RunName| name.is_none_or(|name| name == run);
        if list_runs(bus)?.iter().any(|run| run.is_live() && is_meant(&run.name)) {
            break;
        }
        if !is_told {
            is_told = true;
            frames::tell(&AttachNotice::WaitingForRun { name: name.cloned() });
        }
        thread::sleep(SEARCH_PERIOD);
    }
    Ok(())
}

/// A failure as a sentence for the page.
fn said(failure: Failure) -> String {
    let (Failure::BadInput(error) | Failure::Stopped(error) | Failure::Failed(error)) = failure;
    shown(&format!("{error:#}")).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io;

    #[test]
    fn a_reader_that_fails_or_panics_is_a_sentence() {
        let path = Path::new("a.mcap");
        assert_eq!(glance(path, |_| Ok::<_, io::Error>(7)), Ok(7));
        assert_eq!(glance(path, |_| Err::<(), _>(io::Error::other("torn"))), Err("torn".to_owned()));
        let error = glance(path, |_| -> Result<(), io::Error> { panic!("index {} of 3", 4) });
        let said = error.expect_err("a panic");
        assert!(
            said.contains("a.mcap") && said.contains("(index 4 of 3)") && said.contains("report it"),
            "{said}"
        );
    }

    #[test]
    fn rows_are_small_whatever_files_say() {
        let row =
            of_a_row(json!({ "a": "b".repeat(5_000_000), "c": { "d": vec![1; 17], "e": vec![2; 16] } }));
        assert!(row["a"].as_str().is_some_and(|text| text.ends_with("b… (5,000,000 bytes)")));
        assert_eq!(row["c"], json!({ "d": [], "e": vec![2; 16] }));
        let entry = refused("a".to_owned(), &"é".repeat(5_000));
        assert!(entry.error.is_some_and(|text| text.ends_with("é… (10,000 bytes)") && text.len() < 1100));
    }

    #[test]
    fn a_number_is_written_in_one_way() {
        let found = ["0", "7", "10", "00", "+7", "07", "-1", "", "1e1", "18446744073709551616"].map(number);
        assert_eq!(found[..3], [Some(0), Some(7), Some(10)]);
        assert!(found[3..].iter().all(Option::is_none));
    }
}

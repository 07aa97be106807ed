//! What is served: runs of the bus, a recording, a folder of recordings, a sweep.

use super::live::{Watches, chain};
use super::results;
use crate::configuration::origin;
use crate::failure::{BadInput, Failure};
use crate::frames;
use crate::sweep::{self, Shown};
use bus::{AttachNotice, Bus, list_runs};
use page::{LiveFeed, Served, Shelf};
use producer::sweep::Sweep;
use recording::RecordingInfo;
use schemas::manifest::RunManifest;
use schemas::run_name::RunName;
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

/// Rows of a table that a page shows.
const MAX_ENTRIES: usize = 10_000;
/// How often we look for a run while there is none.
const SEARCH_PERIOD: Duration = Duration::from_millis(100);

/// What is served.
pub(super) struct Runs {
    kind: Kind,
    /// Recordings by their ids: the numbers of their places here, so that no address names a path.
    files: Mutex<Vec<PathBuf>>,
    /// Results by recordings, with what the file was like when they were computed.
    results: Mutex<HashMap<PathBuf, (Stamp, String)>>,
    stop: Arc<AtomicBool>,
}

enum Kind {
    Live(Arc<Watches>, Option<RunName>),
    Recording(PathBuf),
    /// Several, in the order in which they were named.
    Recordings(Vec<PathBuf>),
    Folder(PathBuf),
    Sweep(PathBuf, Box<Sweep>),
}

/// Size and time of the last change of a file.
type Stamp = Option<(u64, Option<SystemTime>)>;

/// `Entry` of the page.
#[derive(Serialize)]
struct Entry {
    id: String,
    name: String,
    kind: &'static str,
    url: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    results: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    manifest: Option<RunManifest>,
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
        let runs = Self { kind, files: Mutex::default(), results: Mutex::default(), stop: Arc::clone(stop) };
        // what cannot be listed is told before anything is served
        runs.entries()?;
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
                    Kind::Sweep(path.clone(), Box::new(Sweep::read(&file, experiments::HOOKS).bad_input()?))
                }
                None => Kind::Folder(path.clone()),
            },
            file @ Named::File(_) => Kind::Recording(recording(file)?),
        })
    }

    /// Waits until nothing runs any more, after the stop flag was set.
    pub(super) fn wait(&self) {
        if let Kind::Live(watches, ..) = &self.kind {
            watches.wait();
        }
    }

    fn entries(&self) -> Result<Vec<Entry>, Failure> {
        match &self.kind {
            Kind::Live(watches, name) => {
                let is_meant = |run: &RunName| name.as_ref().is_none_or(|name| name == run);
                let live =
                    list_runs(watches.bus())?.into_iter().filter(|run| run.is_live() && is_meant(&run.name));
                let mut names: Vec<_> = live.map(|run| run.name).collect();
                if let (Some(name), true) = (name, names.is_empty()) {
                    names.push(name.clone()); // the page waits for it
                }
                Ok(names.iter().map(live_entry).collect())
            }
            Kind::Recording(path) => Ok(vec![self.recording_entry(path)]),
            Kind::Recordings(paths) => Ok(paths.iter().map(|path| self.recording_entry(path)).collect()),
            Kind::Folder(folder) => {
                let found =
                    fs::read_dir(folder).bad_input()?.filter_map(Result::ok).map(|found| found.path());
                let mut paths: Vec<_> = found.filter(|path| is_recording(path)).collect();
                paths.sort();
                paths.truncate(MAX_ENTRIES);
                Ok(paths.iter().map(|path| self.recording_entry(path)).collect())
            }
            Kind::Sweep(folder, sweep) => {
                let points = sweep::shown(sweep, folder, MAX_ENTRIES)?;
                Ok(points.into_iter().map(|point| self.point_entry(point)).collect())
            }
        }
    }

    /// The id of a recording.
    fn id(&self, path: &Path) -> String {
        let mut files = self.files.lock().unwrap_or_else(PoisonError::into_inner);
        let place = files.iter().position(|known| known == path).unwrap_or_else(|| {
            files.push(path.to_owned());
            files.len() - 1
        });
        place.to_string()
    }

    fn recording_entry(&self, path: &Path) -> Entry {
        let id = self.id(path);
        let info = RecordingInfo::glance(path);
        let (manifest, bytes, damage, error) = match info {
            Ok(info) => {
                let damage = damage(&info, path);
                (Some(info.manifest), Some(info.file_bytes), damage, None)
            }
            Err(error) => (None, None, None, Some(format!("{:#}", anyhow::Error::new(error)))),
        };
        Entry {
            name: path.file_name().unwrap_or_default().to_string_lossy().into_owned(),
            kind: "recording",
            url: format!("recording/{id}"),
            results: error.is_none().then(|| format!("results/{id}")),
            manifest,
            bytes,
            values: Map::new(),
            damage,
            error,
            id,
        }
    }

    fn point_entry(&self, point: Shown) -> Entry {
        let Shown { index, values, recording } = point;
        let name = format!("point {index}");
        let start = format!("start/{index}");
        match recording {
            Some(path) => {
                let id = self.id(&path);
                let (url, results) = (format!("recording/{id}"), Some(format!("results/{id}")));
                let bytes = fs::metadata(&path).ok().map(|found| found.len());
                Entry {
                    id,
                    name,
                    kind: "recording",
                    url,
                    results,
                    manifest: None,
                    bytes,
                    values,
                    damage: None,
                    error: None,
                }
            }
            None => Entry {
                id: format!("start-{index}"),
                name,
                kind: "start",
                url: start,
                results: None,
                manifest: None,
                bytes: None,
                values,
                damage: None,
                error: None,
            },
        }
    }

    fn results_of(&self, path: &Path) -> Result<String, Failure> {
        let stamp = |found: fs::Metadata| (found.len(), found.modified().ok());
        // an object behind a URL is read once: it may not change
        let stamp = fs::metadata(path).map(stamp).ok();
        // one at a time: each takes all cores
        let mut kept = self.results.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, text)) = kept.get(path).filter(|(known, _)| *known == stamp) {
            return Ok(text.clone());
        }
        let text = serde_json::to_string(&results::of_recording(path, &self.stop, |_| {})?)?;
        kept.insert(path.to_owned(), (stamp, text.clone()));
        Ok(text)
    }
}

impl Shelf for Runs {
    fn title(&self) -> String {
        match &self.kind {
            Kind::Live(_, Some(name)) => name.to_string(),
            Kind::Live(_, None) => "live runs".to_owned(),
            Kind::Recording(path) | Kind::Folder(path) | Kind::Sweep(path, _) => name(path),
            Kind::Recordings(paths) => paths.iter().map(|path| name(path)).collect::<Vec<_>>().join(", "),
        }
    }

    fn list(&self) -> Served {
        let listing = self.entries().map(|entries| {
            let kind = match &self.kind {
                Kind::Sweep(..) => "sweep",
                Kind::Recordings(paths) if paths.len() == 2 => "pair",
                Kind::Live(..) | Kind::Recording(_) if entries.len() == 1 => "one",
                _ => "folder",
            };
            let keys: Vec<_> = match &self.kind {
                Kind::Sweep(_, sweep) => {
                    sweep.parameters().iter().map(|parameter| parameter.key.clone()).collect()
                }
                _ => Vec::new(),
            };
            json!({ "title": self.title(), "kind": kind, "keys": keys, "entries": entries }).to_string()
        });
        Some(listing.map_err(said))
    }

    fn recording(&self, id: &str) -> Option<PathBuf> {
        let files = self.files.lock().unwrap_or_else(PoisonError::into_inner);
        files.get(id.parse::<usize>().ok()?).cloned()
    }

    fn results(&self, id: &str) -> Served {
        let path = self.recording(id)?;
        Some(self.results_of(&path).map_err(said))
    }

    fn start(&self, id: &str) -> Served {
        let Kind::Sweep(_, sweep) = &self.kind else { return None };
        let point = sweep.point(id.parse().ok()?).ok()?;
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

fn live_entry(name: &RunName) -> Entry {
    Entry {
        id: format!("live-{name}"),
        name: name.to_string(),
        kind: "live",
        url: format!("live/{name}"),
        results: None,
        manifest: None,
        bytes: None,
        values: Map::new(),
        damage: None,
        error: None,
    }
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

/// Whether `path` has the name of a recording; what is no file there has an entry with the reason.
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

/// A failure as a sentence for who looks at the page.
fn said(failure: Failure) -> String {
    let (Failure::BadInput(error) | Failure::Stopped(error) | Failure::Failed(error)) = failure;
    format!("{error:#}")
}

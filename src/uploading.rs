//! Recordings that go to a URL: they are written into a local file first, which is sent meanwhile.

use crate::display::{bytes, counted};
use crate::failure::{BadInput, Failure};
use crate::progress::{Progress, REFRESH};
use crate::report::Rows;
use anyhow::{Context, Error};
use recording::{Finished, part_path};
use schemas::manifest::RunManifest;
use schemas::whole_file::Names;
use serde_json::{Value, json};
use std::env;
use std::error::Error as _;
use std::fs;
use std::path::{Component, Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use storage::{Begun, Errand, Outcome, Reader, SendError, SendOptions, Sender, Sent, StorageError, is_url};

/// Place of a recording until it is behind its URL.
#[derive(Debug, Clone)]
pub(crate) struct Spool {
    directory: PathBuf,
    /// The recording, as long as it is here.
    pub(crate) file: PathBuf,
    url: PathBuf,
    /// True if it is written in parts.
    is_split: bool,
}

impl Spool {
    /// Makes one for a recording `out` that goes to a URL; none for one that goes to a file.
    pub(crate) fn of(
        out: Option<&Path>,
        directory: Option<&Path>,
        is_split: bool,
    ) -> Result<Option<Self>, Failure> {
        let Some(url) = out.filter(|out| is_url(out)) else {
            if directory.is_some() {
                return Err(bad_input!("--spool is for a recording that goes to a URL; name one with --out"));
            }
            return Ok(None);
        };
        let directory = directory.map_or_else(default_directory, Path::to_owned);
        let name = PathBuf::from(url.display().to_string().replacen("://", "/", 1));
        if !name.components().all(|part| matches!(part, Component::Normal(_))) {
            return Err(bad_input!("{}: an object's name has no `.` or `..` in it", url.display()));
        }
        let file = directory.join(name);
        Ok(Some(Self { directory, file, url: url.to_owned(), is_split }))
    }

    /// Makes the directory of the file, and says where that is.
    pub(crate) fn prepare(&self) -> Result<(), Failure> {
        let directory = self.file.parent().unwrap_or(&self.directory);
        fs::create_dir_all(directory).with_context(|| directory.display().to_string()).bad_input()?;
        let (url, file) = (self.url.display(), self.file.display());
        notice!("{url} is there when the recording is finished; until then that is {file}");
        Ok(())
    }

    /// Begins the object: a store that refuses does it here.
    pub(crate) fn begin(
        &self,
        manifest: &RunManifest,
        expected_bytes: u64,
        replace: bool,
    ) -> Result<Begun, Failure> {
        let run = manifest.provenance.run_id.to_string();
        // a shorter recording would leave the later parts of the one before
        let replace = replace && !self.is_split;
        let options = SendOptions { run, expected_bytes, replace, keep: false };
        let exists = |number| {
            let [url, first] = [number, 1].map(|number| self.errand(number).url.display().to_string());
            let all = first.replace("-part-0001", "-part-*");
            bad_input!(
                "{url} exists already, and parts in a store are not replaced; choose another name, or delete {all} first"
            )
        };
        let begun = Begun::new(self.errand(1), options).map_err(|error| match error {
            SendError::Store { source: StorageError::Exists, .. } if self.is_split => exists(1),
            error => error.into(),
        })?;
        if self.is_split && Reader::open(&self.errand(2).url).is_ok() {
            begun.give_up();
            return Err(exists(2));
        }
        Ok(begun)
    }

    /// Sends what is written from now on.
    pub(crate) fn send(self, begun: Begun) -> Result<Sending, Error> {
        let next = self.clone();
        let notice = |error: &SendError| {
            notice!("{}; it is tried again, and the recording goes on meanwhile", in_words(error));
        };
        let sender = begun.send(move |number| next.is_split.then(|| next.errand(number)), notice)?;
        Ok(Sending { sender, spool: self })
    }

    fn errand(&self, number: u64) -> Errand {
        let of = |path: &Path| if self.is_split { part_path(path, number) } else { path.to_owned() };
        let names = Names::of_whole(&of(&self.file));
        Errand { growing: names.partial, file: names.whole, url: of(&self.url) }
    }

    /// Advice on how to send an unfinished recording that stays here.
    pub(crate) fn advice(&self) -> String {
        let Errand { growing, url, .. } = self.errand(1);
        format!("`beadline upload {} {}` recovers and sends it", growing.display(), url.display())
    }

    /// Removes directories that were made for the file, if nothing else is in them.
    fn clear(&self) {
        let made = self.file.ancestors().skip(1).take_while(|path| *path != self.directory);
        // the first one that is in use ends it
        let _ = made.map(fs::remove_dir).take_while(Result::is_ok).count();
    }
}

/// Default directory of waiting recordings: in the user's cache.
fn default_directory() -> PathBuf {
    let cache = env::var_os("XDG_CACHE_HOME").map(PathBuf::from).filter(|path| path.is_absolute());
    let cache = cache.or_else(|| Some(PathBuf::from(env::var_os("HOME")?).join(".cache")));
    cache.unwrap_or_else(env::temp_dir).join("beadline").join("spool")
}

/// A recording on its way.
pub(crate) struct Sending {
    sender: Sender,
    spool: Spool,
}

impl Sending {
    /// Sends the rest of the recordings that are `finished`, which are then where they went to. Gives up when `stop` is set
    /// meanwhile.
    pub(crate) fn finish(self, finished: &mut [Finished], stop: &AtomicBool) -> Uploaded {
        let Self { sender, spool } = self;
        let all_bytes = finished.iter().map(|file| file.bytes).sum();
        // the signal that ended a run does not end this, too; one that comes after the last part is sent does
        let was_stopped = stop.load(Ordering::Relaxed);
        sender.end(finished.len() as u64);
        let outcome = wait(sender, all_bytes, || !was_stopped && stop.load(Ordering::Relaxed));
        for (file, sent) in finished.iter_mut().zip(&outcome.sent) {
            sent.url.clone_into(&mut file.path);
        }
        if outcome.error.is_none() {
            spool.clear();
        }
        let left = (outcome.sent.len()..finished.len()).map(|index| spool.errand(index as u64 + 1)).collect();
        Uploaded { outcome, left }
    }
}

/// Waits until everything is sent, or it is to stop.
pub(crate) fn wait(sender: Sender, all_bytes: u64, is_to_stop: impl Fn() -> bool) -> Outcome {
    let mut progress = Progress::new(all_bytes, "sending");
    while !sender.is_done() {
        if is_to_stop() {
            progress.finish();
            return sender.leave();
        }
        progress.at(sender.sent_bytes());
        thread::sleep(REFRESH / 10); // of a thread that is waited for
    }
    progress.finish();
    sender.finish()
}

/// Outcome of sending a recording.
pub(crate) struct Uploaded {
    outcome: Outcome,
    /// Files that were not sent.
    left: Vec<Errand>,
}

impl Uploaded {
    /// True if every file is at its destination.
    pub(crate) fn is_whole(&self) -> bool {
        self.outcome.error.is_none() && self.left.is_empty()
    }

    pub(crate) fn add_to(&self, rows: &mut Rows) {
        rows.each("sent", self.outcome.sent.iter().map(sent_in_words));
        rows.each("NOT SENT", self.left.iter().map(|errand| errand.file.display().to_string()));
    }

    pub(crate) fn json(&self) -> Value {
        json!({
            "sent": self.outcome.sent.iter().map(sent_json).collect::<Vec<_>>(),
            "not_sent": self.left.iter().map(|errand| errand.file.to_string_lossy()).collect::<Vec<_>>(),
            "error": self.outcome.error.as_ref().map(in_words),
        })
    }

    /// Prints a notice about each file that was not sent: the reason, and what to do.
    pub(crate) fn tell(&self) {
        if let Some(error) = &self.outcome.error {
            notice!("{}", in_words(error));
        }
        for Errand { file, url, .. } in &self.left {
            let (file, url) = (file.display(), url.display());
            notice!("the recording stays in {file}: `beadline upload {file} {url}` sends it");
        }
    }
}

pub(crate) fn sent_in_words(Sent { url, bytes: size, parts, kept_bytes }: &Sent) -> String {
    let kept = match kept_bytes {
        0 => String::new(),
        kept => format!(", {} of it by an earlier attempt", bytes(*kept)),
    };
    format!("{}, {} in {}{kept}", url.display(), bytes(*size), counted(*parts as u64, "part"))
}

pub(crate) fn sent_json(sent: &Sent) -> Value {
    let Sent { url, bytes, parts, kept_bytes } = sent;
    let url = url.to_string_lossy();
    json!({ "url": url, "bytes": bytes, "parts": parts, "bytes_of_earlier_attempts": kept_bytes })
}

/// An error with its causes.
fn in_words(error: &SendError) -> String {
    let causes = std::iter::successors(error.source(), |cause| (*cause).source());
    causes.fold(error.to_string(), |text, cause| format!("{text}: {cause}"))
}

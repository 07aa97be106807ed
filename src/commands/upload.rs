//! `beadline upload FILE URL`: a recording, whole, to a store.

use crate::args::UploadArgs;
use crate::commands::recover::recover_file;
use crate::display;
use crate::failure::{BadInput, Done, Failure};
use crate::outputs::check_free;
use crate::report::{Rows, report};
use crate::signals;
use crate::uploading::{sent_in_words, sent_json, wait};
use anyhow::Context as _;
use recording::RecordingInfo;
use schemas::whole_file::{Names, is_being_written};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use storage::{Begun, Errand, Outcome, SendError, SendOptions};

pub(crate) fn upload(args: &UploadArgs) -> Result<Done, Failure> {
    let stop = signals::stop_flag()?;
    let (info, is_whole) = whole(&args.file, &stop)?;
    display::notice_of_version(&info.manifest);
    // the file that a link leads to: the note of the upload lies beside it
    let file = info.path.canonicalize().with_context(|| info.path.display().to_string()).bad_input()?;
    let errand = Errand { growing: file.clone(), file, url: args.url.clone() };
    let provenance = &info.manifest.provenance;
    let run = provenance.run_id.to_string();
    let options = SendOptions { run, expected_bytes: info.file_bytes, replace: args.force, keep: true };
    let sender = Begun::new(errand, options)?.send(|_| None, |_| {})?;
    sender.end(1);
    let Outcome { sent, error } = wait(sender, info.file_bytes, || stop.load(Ordering::Relaxed));
    match error {
        None => {}
        Some(error @ SendError::Stopped) => return Err(Failure::Stopped(error.into())),
        Some(error) => return Err(error.into()),
    }
    let text = || {
        let mut rows = Rows::default();
        rows.each("sent", sent.iter().map(sent_in_words));
        rows.under(format_args!("{} {}", provenance.name, provenance.run_id))
    };
    report(args.json, &sent.iter().map(sent_json).collect::<Vec<_>>(), text)?;
    Ok(Done::whole_if(is_whole))
}

/// The recording `path`, or its recoverable part, and whether that is all.
fn whole(path: &Path, stop: &Arc<AtomicBool>) -> Result<(RecordingInfo, bool), Failure> {
    if is_being_written(path) {
        return Err(bad_input!("{} is being written by a running process; wait for its end", path.display()));
    }
    let info = RecordingInfo::glance(path).bad_input()?;
    if info.finished {
        return Ok((info, true));
    }
    let target = Names::of(path).whole;
    if target == path {
        return Err(bad_input!(
            "{path} was not closed; `beadline recover {path} --out OTHER.mcap` keeps what is whole, and that can be sent",
            path = path.display()
        ));
    }
    check_free(&target, false)?;
    notice!("{} was not closed: {} is made of it first", path.display(), target.display());
    let outcome = recover_file(path, &target, true, false, stop)?;
    Ok((RecordingInfo::glance(&target)?, outcome.is_whole()))
}

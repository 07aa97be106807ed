//! `beadline view`: the page, served on this machine for a live run, a recording, a folder or a sweep.

mod live;
pub(crate) mod results;
mod shelf;

use crate::args::ViewArgs;
use crate::display;
use crate::failure::{BadInput, Done, Failure};
use crate::signals;
use anyhow::Context as _;
use page::Server;
use shelf::Runs;
use std::io::Write as _;
use std::net::SocketAddr;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use tempfile::NamedTempFile;

/// Programs that open a page in the user's browser.
const BROWSERS: [&str; 3] = ["xdg-open", "open", "sensible-browser"];

pub(crate) fn view(args: &ViewArgs) -> Result<Done, Failure> {
    if args.host.is_unspecified() || args.host.is_multicast() {
        return Err(bad_input!("--host {}: expected one address of this machine", args.host));
    }
    let stop = signals::patient_stop_flag()?;
    let runs = Arc::new(Runs::open(&args.sources, &stop)?);
    if stop.load(Ordering::Relaxed) {
        return Ok(Done::Whole); // while it waited for a run
    }
    let address = SocketAddr::new(args.host, args.port);
    let server = Server::bind(address).with_context(|| format!("cannot listen at {address}")).bad_input()?;
    if !args.host.is_loopback() {
        notice!(
            "{} can be reached from other machines: what is served is not encrypted, and the random part of its address \
             is all that protects it",
            args.host
        );
    }
    display::print(format_args!("{}\n", server.url()))?;
    notice!("Ctrl-C ends it");
    let opened = if args.open { open_browser(&server.url()) } else { None };
    let served = server.run(Arc::clone(&runs) as Arc<_>, &stop);
    stop.store(true, Ordering::Relaxed);
    runs.wait();
    drop(opened);
    Ok(served.map(|()| Done::Whole)?)
}

/// Opens the address in a browser, by a file that is removed when it is dropped: every user of the machine sees the words of
/// a command line, and this file is ours alone.
fn open_browser(url: &str) -> Option<NamedTempFile> {
    let page = format!("<!doctype html><meta http-equiv=\"refresh\" content=\"0;url={url}\">\n");
    let made = tempfile::Builder::new().prefix("beadline-view-").suffix(".html").tempfile();
    let made = made.and_then(|mut file| file.write_all(page.as_bytes()).map(|()| file)).ok();
    let open = |file: &NamedTempFile, program: &str| {
        let mut command = Command::new(program);
        command.arg(file.path()).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
        command.spawn().is_ok()
    };
    let opened = made.filter(|file| BROWSERS.iter().any(|program| open(file, program)));
    if opened.is_none() {
        notice!("no browser could be opened; open the address above");
    }
    opened
}

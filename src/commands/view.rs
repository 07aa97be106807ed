//! `beadline view`: the page, served on this machine for a live run, a recording, a folder or a sweep.

mod live;
pub(crate) mod results;
mod shelf;

use crate::args::ViewArgs;
use crate::display;
use crate::failure::{BadInput, Done, Failure};
use crate::signals;
use anyhow::Context as _;
use bus::Bus;
use page::Server;
use shelf::Runs;
use std::fs;
use std::io::Write as _;
use std::net::SocketAddr;
use std::os::unix::fs::OpenOptionsExt as _;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::Ordering;

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
    let opened = if args.open { Opened::browser(&server.url()) } else { None };
    let served = server.run(Arc::clone(&runs) as Arc<_>, &stop);
    stop.store(true, Ordering::Relaxed);
    runs.wait();
    drop(opened);
    Ok(served.map(|()| Done::Whole)?)
}

/// A file that sends a browser to the address: every user of the machine sees the words of a command line, and this file
/// is ours alone.
struct Opened(PathBuf);

impl Opened {
    fn browser(url: &str) -> Option<Self> {
        let told = || notice!("no browser could be opened; open the address above");
        let root = Bus::from_env().ok()?.root().to_owned();
        let file = Self(root.join(format!("view-{}.html", std::process::id())));
        let page = format!("<!doctype html><meta http-equiv=\"refresh\" content=\"0;url={url}\">\n");
        let made = fs::OpenOptions::new().write(true).create(true).truncate(true).mode(0o600).open(&file.0);
        if made.and_then(|mut made| made.write_all(page.as_bytes())).is_err() {
            told();
            return None;
        }
        let open = |program: &&str| {
            let mut command = Command::new(program);
            command.arg(&file.0).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
            command.spawn().is_ok()
        };
        if !["xdg-open", "open", "sensible-browser"].iter().any(open) {
            told();
        }
        Some(file)
    }
}

impl Drop for Opened {
    fn drop(&mut self) {
        // at best: its token is of no use any more
        let _ = fs::remove_file(&self.0);
    }
}

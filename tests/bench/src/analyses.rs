//! The analyses, receiving apart, against copying the frame once.

use super::recordings::Frames;
use super::{Bench, Floor, Rounds, Row, timed};
use crate::report::Report;
use anyhow::Error;
use consumers::contacts::{Contacts, default_tolerance_m};
use consumers::energies::{Energies, default_split_bead};
use consumers::impurity::Followed;
use schemas::frame::Frame;
use std::hint::black_box;

/// Energies, impurity and contacts of each frame.
pub(super) fn rows(bench: &Bench, report: &mut Report) -> Result<(), Error> {
    let (frames, rounds) = (bench.frames()?, bench.rounds);
    let manifest = frames.manifest();
    let split_bead = default_split_bead(manifest);
    report.row(row("energies of a frame", 2.3, frames, rounds, || {
        let mut energies = Energies::new(manifest, split_bead);
        move |frame: &Frame<'_>| {
            black_box(energies.observe(frame));
        }
    })?)?;
    report.row(row("impurity of a frame", 0.3, frames, rounds, || {
        let mut followed = Followed::new(manifest, &[split_bead]);
        move |frame: &Frame<'_>| {
            black_box(followed.observe(frame));
        }
    })?)?;
    report.row(row("contacts of a frame", 2.0, frames, rounds, || {
        let mut contacts = Contacts::new(manifest, default_tolerance_m(manifest));
        move |frame: &Frame<'_>| {
            black_box(contacts.observe(frame));
        }
    })?)
}

fn row<O: FnMut(&Frame<'_>)>(
    what: &'static str,
    floor: f64,
    frames: &Frames,
    rounds: u32,
    analysis: impl Fn() -> O,
) -> Result<Row, Error> {
    let analyse = || {
        let mut observe = analysis();
        timed(|| {
            frames.each(|frame| observe(frame));
            Ok(())
        })
    };
    let mut copy = vec![0.0; frames.manifest().frame_doubles()];
    let copying = || {
        timed(|| {
            for doubles in frames.in_one_piece() {
                copy.copy_from_slice(doubles);
                black_box(&copy);
            }
            Ok(())
        })
    };
    let rounds = Rounds::alternate(rounds, analyse, copying)?;
    let figure = format!("{:.0} ns a frame", rounds.ours_s() / frames.count() as f64 * 1e9);
    Ok(rounds.row(what, "one memcpy of the frame", Floor::AtMost(floor), figure))
}

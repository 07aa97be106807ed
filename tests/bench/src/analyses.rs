//! The analyses, receiving apart, against copying the frame once.

use super::recordings::{Frames, manifest};
use super::{Bench, Floor, Rounds, Row, timed};
use crate::report::Report;
use anyhow::{Context as _, Error};
use consumers::analysis::{Beginning, LastRow, Settings};
use consumers::contacts::{Contacts, default_tolerance_m};
use consumers::energies::{Energies, default_split_bead};
use consumers::impurity::Followed;
use producer::state::ChainState;
use schemas::config::End;
use schemas::frame::Frame;
use schemas::presets::PRESETS;
use schemas::term::{Spring, TermLaw};
use std::hint::black_box;
use std::time::Duration;

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
    })?)?;
    modal(rounds, report)
}

/// Frames of a measurement of [`modal`].
const FRAMES: u32 = 2000;

/// The energies of all modes of equal beads, and their entropy, against the time that they may take.
fn modal(rounds: u32, report: &mut Report) -> Result<(), Error> {
    let offer = analyses::named("modal").context("an analysis of this name")?;
    for (what, end) in [
        ("modal of a frame, N = 1024, a ring", End::Periodic),
        ("modal of a frame, N = 1024, walls", End::Fixed),
    ] {
        let mut config = PRESETS[0].config();
        config.chain.impurities.clear();
        (config.chain.beads, config.ends.left, config.ends.right) = (1024, end, end);
        config.chain.alpha = Some(1.0);
        config.chain.bonds = Some([(TermLaw::Spring(Spring(1)), 1e5)].into_iter().collect());
        let manifest = manifest(&config)?;
        let v_m_s: Vec<f64> = (0..1024).map(|i| 1e-3 * f64::from(i * i % 7)).collect();
        let state = ChainState::starting_at(&manifest.physics, &vec![0.0; v_m_s.len()], &v_m_s);
        let settings = Settings::default();
        let begun = (offer.begin)(&Beginning::whole(offer.name, &manifest, &settings));
        let mut analysis = begun.map_err(|refusal| Error::msg(refusal.why))?;
        let frame = state.as_frame(&manifest, 0);
        let observe = || {
            timed(|| {
                let mut last = LastRow::default();
                (0..FRAMES).for_each(|_| analysis.observe(&frame, &mut last));
                Ok(())
            })
        };
        let rounds = Rounds::alternate(rounds, observe, || Ok(FRAMES * Duration::from_micros(20)))?;
        let figure = format!("{:.1} µs a frame", rounds.ours_s() / f64::from(FRAMES) * 1e6);
        report.row(rounds.row(what, "20 µs", Floor::AtMost(1.0), figure))?;
    }
    Ok(())
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

//! The command `beadline` with an analysis of one's own: `cargo run --example own_analysis -- momentum SOURCE`.
//!
//! It is in the list like ours: live, on recordings and in sweeps, with tables, figures, and rows that `beadline record` keeps
//! as `/own/momentum`.

use beadline::own::{Analysis, Frame, Meaning, Offer, Outlet};
use std::process::ExitCode;

static MOMENTUM: Offer = Offer {
    name: "momentum",
    about: "Momentum of the chain, and its fastest bead",
    help: "Examples:\n  own_analysis momentum run.mcap --out momentum.csv --figure momentum.svg",
    columns: &[
        Meaning::number("momentum_n_s", "momentum of all beads"),
        Meaning::number("fastest_m_s", "largest speed of a bead"),
    ],
    begin: |run| Ok(Box::new(Momentum { mass_kg: run.manifest.physics.chain().mass_kg })),
    ..Offer::PLAIN
};

struct Momentum {
    mass_kg: Vec<f64>,
}

impl Analysis for Momentum {
    fn observe(&mut self, frame: &Frame<'_>, out: &mut dyn Outlet) {
        let momentum_n_s: f64 = self.mass_kg.iter().zip(frame.v_m_s).map(|(m, v)| m * v).sum();
        let fastest_m_s = frame.v_m_s.iter().fold(0.0, |most: f64, v| most.max(v.abs()));
        out.row(frame, &[momentum_n_s, fastest_m_s]);
    }
}

fn main() -> ExitCode {
    beadline::main_with(&[&MOMENTUM])
}

//! A consumer of one's own: momentum and fastest bead of each frame, printed and published.
//!
//! `cargo run --example own_consumer -- SOURCE`, with `live`, `live:RUN` or a recording as SOURCE. What it publishes
//! `beadline record` records as `/own/motion`. `docs/python/4-live.md` has the same in Python.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "what this program is for")]

use anyhow::{Result, ensure};
use bus::AttachOptions;
use schemas::frame::{FrameSource as _, Received};
use schemas::results::ResultColumns;
use source::Source;

fn main() -> Result<()> {
    let name = std::env::args().nth(1).unwrap_or_else(|| "live".to_owned());
    // waits for the run, and gets every frame of it
    let mut source = Source::open(&name, &AttachOptions::default())?;
    let mass_kg = source.manifest().physics.chain().mass_kg;
    // nobody listens to results of a recording
    let columns = ResultColumns::named(&["momentum_n_s", "fastest_m_s"]);
    let mut results = source.results("motion", &columns)?;
    println!("frame,{}", columns.names);
    let end = loop {
        match source.receive()? {
            Received::Frame(frame) => {
                let momentum_n_s: f64 = mass_kg.iter().zip(frame.v_m_s).map(|(m, v)| m * v).sum();
                let fastest_m_s = frame.v_m_s.iter().fold(0.0, |most: f64, v| most.max(v.abs()));
                println!("{},{momentum_n_s},{fastest_m_s}", frame.frame);
                if let Some(results) = &mut results {
                    results.publish_for(&frame, &[momentum_n_s, fastest_m_s])?;
                }
            }
            Received::Missed { from, to } => eprintln!("frames {from} to {to} did not come"),
            Received::End(end) => break end,
        }
    };
    if let Some(results) = results {
        results.finish()?;
    }
    ensure!(end.is_orderly(), "that is not all of it: {end}");
    Ok(())
}

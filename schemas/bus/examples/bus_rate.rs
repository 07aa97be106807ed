//! Frames per second over the bus between processes, and a small program to try a bus with.
//!
//! In two terminals (with the same `BEADLINE_ROOT`, if any):
//!
//!     cargo run --release -p beadline-bus --example bus_rate -- publish 1000 200000 1
//!     cargo run --release -p beadline-bus --example bus_rate -- read
//!
//! `publish BEADS FRAMES CONSUMERS` waits for so many lossless consumers, publishes frames that no physics
//! made, and prints µs a frame; `read` attaches to the only run, sums every value, and says how many frames
//! it got; `ls` lists the runs.
#![allow(clippy::print_stdout, reason = "a program of its own")]

use bus::{AttachOptions, Bus, Delivery, LiveSource, PublishOptions, StatePublisher, list_runs};
use schemas::frame::{EndReason, Frame, FrameSink as _, FrameSource as _, Received};
use schemas::manifest::{Origin, RunManifest};
use schemas::presets::PRESETS;
use std::error::Error;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let bus = Bus::from_env()?;
    println!("root {} prefix {}", bus.root().display(), bus.prefix());
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["publish", beads, frames, consumers] => {
            publish(&bus, beads.parse()?, frames.parse()?, consumers.parse()?)
        }
        ["read"] => read(&bus),
        ["ls"] => {
            for run in list_runs(&bus)? {
                println!("{run:?}");
            }
            Ok(())
        }
        _ => Err("publish BEADS FRAMES CONSUMERS, read, or ls".into()),
    }
}

fn publish(bus: &Bus, beads: u64, frames: u64, consumers: usize) -> Result<(), Box<dyn Error>> {
    let mut config = PRESETS[2].config();
    config.chain.beads = beads;
    let origin = Origin { program: "bus_rate".into(), host: String::new(), started_unix_ns: 0 };
    let manifest = RunManifest::new(&config, "rate", origin)?;
    let chain = manifest.physics.chain();
    let mut publisher = StatePublisher::create(bus, &manifest, &chain, &PublishOptions::default())?;
    publisher.wait_for(consumers, &AtomicBool::new(false), None)?;
    let (u_m, v_m_s) = (vec![1.0; chain.bead_count()], vec![2.0; chain.bead_count()]);
    let start = Instant::now();
    for frame in 0..frames {
        publisher.accept(&Frame {
            frame,
            step: frame,
            time_s: 0.0,
            u_m: &u_m,
            v_m_s: &v_m_s,
            extra: &[],
            active: None,
        })?;
    }
    let seconds = start.elapsed().as_secs_f64();
    let counts = publisher.finish(EndReason::Complete)?;
    println!(
        "{:.3} µs a frame, {:.0} frames/s, {counts:?}",
        1e6 * seconds / frames as f64,
        frames as f64 / seconds
    );
    Ok(())
}

fn read(bus: &Bus) -> Result<(), Box<dyn Error>> {
    let mut source = LiveSource::attach(bus, None, Delivery::Lossless, &AttachOptions::default())?;
    let (mut frames, mut sum) = (0_u64, 0.0);
    loop {
        match source.receive()? {
            Received::Frame(frame) => {
                frames += 1;
                sum += sum_of(frame.u_m) + sum_of(frame.v_m_s);
            }
            other => {
                println!("{frames} frames, sum {sum}, {other:?}");
                return Ok(());
            }
        }
    }
}

/// Four sums side by side, so that reading memory is what takes the time.
fn sum_of(values: &[f64]) -> f64 {
    let mut sums = [0.0; 4];
    for four in values.chunks_exact(4) {
        for (sum, value) in sums.iter_mut().zip(four) {
            *sum += value;
        }
    }
    sums.iter().sum()
}

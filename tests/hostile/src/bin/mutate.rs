//! Runs the command on random mutations of recordings, and sees whether it survives.
//!
//! ```text
//! cargo build --release
//! cargo run --release -p beadline-hostile --bin mutate -- \
//!     --program target/release/beadline --count 100000 tests/golden/*/{sparse,contacts,partial}.mcap*
//! ```
//!
//! `--commands "info,thin --every-steps 9 --force --out thin.mcap"` replaces the commands, `--seed S` is the number of the
//! first mutation, `--jobs N` how many processes run at a time, `--keep DIR` gets the mutations that failed. Exit code 1 if
//! anything panicked, crashed, hung or took too much memory.

use hostile::campaign::Campaign;
use std::error::Error;
use std::fs;
use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;

struct Arguments {
    program: PathBuf,
    commands: Vec<String>,
    count: u64,
    seed: u64,
    jobs: usize,
    keep: Option<PathBuf>,
    recordings: Vec<Vec<u8>>,
}

impl Arguments {
    fn read() -> Result<Self, Box<dyn Error>> {
        let commands = ["info", "verify", "recover --force --out recovered.mcap", "energies"];
        let commands = commands.map(str::to_owned).to_vec();
        let mut read = Self {
            program: PathBuf::from("target/release/beadline"),
            commands,
            count: 1000,
            seed: 1,
            jobs: 2,
            keep: None,
            recordings: Vec::new(),
        };
        let mut arguments = std::env::args().skip(1);
        while let Some(argument) = arguments.next() {
            let mut value = || arguments.next().ok_or_else(|| format!("{argument} needs a value"));
            match argument.as_str() {
                "--program" => read.program = PathBuf::from(value()?),
                "--commands" => read.commands = value()?.split(',').map(str::to_owned).collect(),
                "--count" => read.count = value()?.parse()?,
                "--seed" => read.seed = value()?.parse()?,
                "--jobs" => read.jobs = value()?.parse()?,
                "--keep" => read.keep = Some(PathBuf::from(value()?)),
                path => read.recordings.push(fs::read(path)?),
            }
        }
        if read.recordings.is_empty() {
            return Err("name the recordings to change".into());
        }
        read.program = read.program.canonicalize()?;
        Ok(read)
    }
}

fn main() -> Result<ExitCode, Box<dyn Error>> {
    let arguments = Arguments::read()?;
    let memory = PathBuf::from("/dev/shm");
    let place = if memory.is_dir() { memory } else { std::env::temp_dir() };
    let directory = tempfile::Builder::new().prefix("beadline-mutate").tempdir_in(place)?;
    let campaign = Campaign {
        program: &arguments.program,
        commands: &arguments.commands,
        recordings: &arguments.recordings,
        seed: arguments.seed,
        count: arguments.count,
        jobs: arguments.jobs,
        directory: directory.path(),
    };
    let mut out = std::io::stdout();
    let outcome = campaign.run(|done| {
        if done.is_multiple_of(1000) {
            let _ = writeln!(std::io::stdout(), "{done} of {}", arguments.count);
        }
    })?;
    for (command, [whole, failed, refused, lossy]) in arguments.commands.iter().zip(&outcome.exits) {
        let total = whole + failed + refused + lossy;
        writeln!(out, "{command}: {total} ended: exit 0 {whole}, 1 {failed}, 2 {refused}, 3 {lossy}")?;
    }
    for (seed, command, what) in &outcome.failures {
        writeln!(out, "FAILED: {command}, seed {seed}: {what}")?;
        if let Some(keep) = &arguments.keep {
            fs::create_dir_all(keep)?;
            fs::write(keep.join(format!("{seed}.mcap")), campaign.mutation(*seed))?;
        }
    }
    writeln!(out, "{} failures", outcome.failures.len())?;
    Ok(if outcome.failures.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

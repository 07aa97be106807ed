//! Many mutations of some recordings, each given to some commands.

use crate::mutation::{Checksums, mutate};
use crate::random::Random;
use crate::trial::Trial;
use std::fs;
use std::io;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

/// What to run.
#[derive(Debug)]
pub struct Campaign<'a> {
    /// The command under test.
    pub program: &'a Path,
    /// Its modes with their flags, such as `info`.
    pub commands: &'a [String],
    /// The recordings to change.
    pub recordings: &'a [Vec<u8>],
    /// The number of the first mutation; each number is another one.
    pub seed: u64,
    /// How many.
    pub count: u64,
    /// How many processes run at a time.
    pub jobs: usize,
    /// An empty directory.
    pub directory: &'a Path,
}

/// What came of it.
#[derive(Debug, Default, Clone, PartialEq, Eq)]
pub struct Outcome {
    /// For each command how often it ended with exit code 0, 1, 2 and 3.
    pub exits: Vec<[u64; 4]>,
    /// What may not be: seed, command, and what happened.
    pub failures: Vec<(u64, String, String)>,
}

impl Campaign<'_> {
    /// Mutation number `seed`: of which recording, and how, is in the number, too.
    pub fn mutation(&self, seed: u64) -> Vec<u8> {
        let mut random = Random::new(seed);
        let checksums = if random.one_in(2) { Checksums::Right } else { Checksums::Stale };
        let recording = &self.recordings[random.below(self.recordings.len())];
        mutate(recording, &mut random, checksums)
    }

    /// Runs it; `watch` sees how many mutations are done.
    ///
    /// # Errors
    /// When files cannot be written.
    pub fn run(&self, watch: impl Fn(u64) + Sync) -> io::Result<Outcome> {
        let outcome = Outcome { exits: vec![[0; 4]; self.commands.len()], ..Outcome::default() };
        let (outcome, next) = (Mutex::new(outcome), AtomicU64::new(0));
        std::thread::scope(|scope| {
            let workers: Vec<_> = (0..self.jobs)
                .map(|worker| {
                    let (outcome, next, watch) = (&outcome, &next, &watch);
                    scope.spawn(move || {
                        let directory = self.directory.join(worker.to_string());
                        fs::create_dir_all(&directory)?;
                        let trial = Trial::new(self.program, &directory);
                        loop {
                            let number = next.fetch_add(1, Ordering::Relaxed);
                            if number >= self.count {
                                return Ok(());
                            }
                            self.one(self.seed + number, &trial, &directory, outcome)?;
                            watch(number + 1);
                        }
                    })
                })
                .collect();
            workers
                .into_iter()
                .try_for_each(|worker| worker.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
        })
        .map(|()| outcome.into_inner().unwrap_or_else(PoisonError::into_inner))
    }

    fn one(&self, seed: u64, trial: &Trial, directory: &Path, outcome: &Mutex<Outcome>) -> io::Result<()> {
        let file = directory.join("mutated.mcap");
        fs::write(&file, self.mutation(seed))?;
        for (number, command) in self.commands.iter().enumerate() {
            let ended = trial.run(command, &file);
            let mut outcome = outcome.lock().unwrap_or_else(PoisonError::into_inner);
            match ended {
                Ok(code) => outcome.exits[number][code] += 1,
                Err(what) => outcome.failures.push((seed, command.clone(), what)),
            }
        }
        Ok(())
    }
}

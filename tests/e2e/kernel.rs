//! Recordings recomputed by programs that were written from `docs/KERNEL.md`: in Python with `NumPy`, and in JavaScript.

use crate::golden::RETIRED;
use crate::harness::{Place, Running, node, python};
use crate::lying;
use recording::BeginRecord;
use schemas::frame::EndReason;
use schemas::manifest::Physics;
use schemas::method::Method;
use schemas::presets::PRESETS;
use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};

fn in_project(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

/// A program that recomputes recordings: what runs it, and its source.
pub(crate) struct Program {
    interpreter: PathBuf,
    source: PathBuf,
}

impl Program {
    /// Both of them, unless this machine has not what they need.
    pub(crate) fn all() -> Vec<Self> {
        let with = |interpreter: Option<PathBuf>, source| {
            interpreter.map(|interpreter| Self { interpreter, source: in_project(source) })
        };
        let programs =
            [with(python(), "tests/python/kernel.py"), with(node(), "tests/node/check_kernel.mjs")];
        programs.into_iter().flatten().collect()
    }

    /// Runs it to its end with this exit code, and it prints `says`.
    #[track_caller]
    pub(crate) fn run<A: AsRef<OsStr>>(
        &self,
        place: &Place,
        arguments: impl IntoIterator<Item = A>,
        code: i32,
        says: &str,
    ) {
        let mut words = vec![self.source.as_os_str().to_owned()];
        words.extend(arguments.into_iter().map(|word| word.as_ref().to_owned()));
        let name = self.source.display().to_string();
        let ended = Running::start(&name, place.foreign(&self.interpreter, words)).wait();
        let (stdout, ended) = (ended.stdout(), ended.exits(code));
        assert!(stdout.contains(says), "{name}: {stdout}{}", ended.stderr());
    }
}

/// Golden recordings of kernels 2 and 3 that a kernel still computes: loads, walls, parts, thinned, drives, rings.
fn golden() -> Vec<PathBuf> {
    let mut files: Vec<_> = (["1.0-kernel-2", "1.1-kernel-2", "1.1-kernel-3"].iter())
        .flat_map(|version| fs::read_dir(in_project(&format!("tests/golden/{version}"))).unwrap())
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|end| end == "mcap"))
        .filter(|path| !path.ends_with("contacts.mcap"))
        .filter(|path| !RETIRED.iter().any(|name| path.ends_with(format!("1.0-kernel-2/{name}"))))
        .collect();
    files.sort();
    files
}

#[test]
fn the_test_vectors_of_the_page_are_found_from_the_page() {
    for program in Program::all() {
        let place = Place::new();
        program.run(&place, ["--page".into(), in_project("docs/KERNEL.md")], 0, "equal");
    }
}

#[test]
fn every_preset_and_golden_recording_is_recomputed() {
    for program in Program::all() {
        let place = Place::new();
        let mut files = golden();
        for preset in PRESETS {
            let physics = Physics::resolve(&preset.config()).unwrap();
            // the first tenth: NumPy takes half a millisecond a step
            let duration_s = physics.dt_s * (physics.step_count / 10) as f64;
            let out = format!("{}.mcap", preset.name);
            let flags = format!("--duration {duration_s:e} --publish-every-steps 1 --record-every-steps 50");
            place.run(&format!("run --preset {} {flags} --out {out}", preset.name)).exits(0);
            files.push(place.path(&out));
        }
        program.run(&place, &files, 0, "equal");
    }
}

#[test]
fn every_method_and_exponent_is_recomputed() {
    for program in Program::all() {
        let place = Place::new();
        let mut files = Vec::new();
        for method in Method::ALL {
            for alpha in ["1", "1.01", "1.1", "1.3", "1.5", "1.7", "2", "2.5", "3", "5", "5.5", "10"] {
                let out = format!("{method}-{alpha}.mcap");
                // what a power is does not depend on the method
                let duration_s = if method == Method::Rkn4 { 1e-3 } else { 2e-4 };
                let chain = format!("--beads 60 --impurity 20=0.6e-3 --method {method} --alpha {alpha}");
                let flags = format!("--duration {duration_s:e} --record-every-steps 40 --out {out}");
                let run = format!("run --preset homogeneous {chain} {flags}");
                place.run(&run).exits(0);
                files.push(place.path(&out));
            }
        }
        program.run(&place, &files, 0, "equal");
    }
}

/// The last bit of one velocity in the middle of a run.
#[test]
fn one_wrong_bit_is_found() {
    for program in Program::all() {
        let place = Place::new();
        let (manifest, mut states) = lying::run(&place);
        let wrong = &mut states[7].1;
        let last = wrong.len() - 1;
        wrong[last] = f64::from_bits(wrong[last].to_bits() ^ 1);
        lying::write(&place, "wrong.mcap", &manifest, &BeginRecord::default(), &states, EndReason::Complete);
        program.run(&place, ["run.mcap"], 0, "equal");
        program.run(&place, ["wrong.mcap"], 1, "step 7");
    }
}

#[test]
fn another_kernel_is_said() {
    for program in Program::all() {
        let place = Place::new();
        for old in ["1.0-kernel-1/full.mcap", "1.0-kernel-2/damped.mcap"] {
            program.run(&place, [in_project(&format!("tests/golden/{old}"))], 3, "kernel");
        }
    }
}

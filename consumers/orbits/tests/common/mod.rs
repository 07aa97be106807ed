//! Orbit files as text, and what is found.
#![allow(dead_code, clippy::panic, reason = "each test file uses a part; a test may panic")]

use orbits::branch::{Change, End};
use orbits::file::File;
use orbits::{NoOrbit, Options, Orbit, Search};
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::atomic::AtomicBool;

static STOP: AtomicBool = AtomicBool::new(false);

pub(crate) struct Branch {
    pub(crate) last: Orbit,
    pub(crate) changes: Vec<Change>,
}

/// A list in TOML.
pub(crate) fn list(numbers: impl IntoIterator<Item = f64>) -> String {
    format!("{:?}", numbers.into_iter().collect::<Vec<_>>())
}

pub(crate) fn read(toml: &str) -> File {
    File::read(Path::new("orbit.toml"), toml, experiments::prepared)
        .unwrap_or_else(|error| panic!("{error}\n{toml}"))
}

/// The orbit that a file asks for, or the reason why there is none.
pub(crate) fn tried(toml: &str) -> Result<Orbit, NoOrbit> {
    tried_by(toml, None)
}

/// The same, by matrices of up to so many coordinates.
pub(crate) fn tried_by(toml: &str, most_dense: Option<usize>) -> Result<Orbit, NoOrbit> {
    let file = read(toml);
    let family = |parameter: f64| file.problem(parameter);
    let options = Options { most_dense, ..file.options() };
    Search::begin(&family, file.from(), options, &STOP)?.find()
}

pub(crate) fn find(toml: &str) -> Orbit {
    tried(toml).unwrap_or_else(|error| panic!("{error}\n{toml}"))
}

/// The end of the branch that a file asks for, and its changes of stability.
pub(crate) fn follow(toml: &str) -> Branch {
    with_born(toml).0
}

/// The same, and the orbits of each branch that is born at the first of these changes.
pub(crate) fn with_born(toml: &str) -> (Branch, Vec<Vec<Orbit>>) {
    let (branch, born) = with_born_by(toml, None);
    (branch, born.unwrap_or_else(|error| panic!("{error}\n{toml}")))
}

/// The same by matrices of up to so many coordinates, or the reason why no branches are found.
pub(crate) fn with_born_by(
    toml: &str,
    most_dense: Option<usize>,
) -> (Branch, Result<Vec<Vec<Orbit>>, NoOrbit>) {
    let file = read(toml);
    let family = |parameter: f64| file.problem(parameter);
    let options = Options { most_dense, ..file.options() };
    let (_, stretch) = file.stretch().expect("a branch");
    let search =
        Search::begin(&family, file.from(), options, &STOP).unwrap_or_else(|error| panic!("{error}"));
    let search = search.along(&stretch);
    let (mut last, mut changes) = (None, Vec::new());
    let end = search.follow(&stretch, None, |step, orbit| {
        if let Some((before, one)) = &last {
            let before: &orbits::branch::Step = before;
            changes.extend(
                search.change(one, orbit, before.turns(step)).unwrap_or_else(|error| panic!("{error}")),
            );
        }
        last = Some((step.clone(), orbit.clone()));
        ControlFlow::Continue(())
    });
    assert_eq!(end, Ok(End::Reached), "{toml}");
    let mut born = Vec::new();
    if file.has_branches() {
        let beginnings = match search.born(&changes[0], &stretch) {
            Ok(beginnings) => beginnings,
            Err(why) => return (Branch { last: last.expect("an orbit").1, changes }, Err(why)),
        };
        for beginning in &beginnings {
            let mut orbits = Vec::new();
            let end = search.of_branch(beginning).follow(&stretch, None, |_, orbit| {
                orbits.push(orbit.clone());
                ControlFlow::Continue(())
            });
            assert_eq!(end, Ok(End::Reached), "{toml}");
            born.push(orbits);
        }
    }
    (Branch { last: last.expect("an orbit").1, changes }, Ok(born))
}

//! Numbers on screens: known digits only, prefixes instead of powers, one form for all.

use crate::harness::Place;

const SMALL: &str =
    "run --beads 300 --impurity 150=0.6e-3 --duration 0.02 --name small --publish-every-steps 2";

/// Digits of a number from the first that is not zero on, if it is one with a point.
fn digits(word: &str) -> Option<usize> {
    let word = word.trim_matches(|character: char| !character.is_ascii_digit());
    let is_number = word.contains('.') && word.chars().all(|c| c.is_ascii_digit() || c == '.');
    is_number.then(|| word.replace('.', "").trim_start_matches('0').len())
}

#[test]
fn numbers_have_as_many_digits_as_are_known_and_a_prefix() {
    let place = Place::new();
    place.run(SMALL).exits(0);
    for command in [
        "energies small.mcap",
        "impurity small.mcap",
        "contacts small.mcap",
        "deformation small.mcap --contact 40",
        "forces small.mcap --at bead:40",
        "spectrum small.mcap --at bead:40",
        "plot small.mcap --what velocity --at 0.01 --out v.svg",
        "plot small.mcap --what displacement --out u.svg",
        "info small.mcap",
    ] {
        let said = place.run(command).exits(0).stdout();
        for word in said.split_whitespace() {
            assert!(!word.starts_with("-0.000"), "{command}: a zero with a sign\n{said}");
            // numbers that come with what they may be off by have the digits that this leaves
            let is_known = command.starts_with("energies") || command.starts_with("deformation");
            let most = if is_known { 10 } else { 7 };
            assert!(digits(word).is_none_or(|digits| digits <= most), "{command}: {word}\n{said}");
        }
        let with_unit = [" J", " m", " s", " m/s"];
        let powers = said.lines().filter(|line| line.contains("e-"));
        for line in powers {
            let is_small_quantity = with_unit.iter().any(|unit| line.ends_with(unit));
            assert!(!is_small_quantity, "{command}: {line}");
        }
    }
}

/// A pulse that an impurity reflects is first seen at a bead beside it; what is named is the impurity.
#[test]
fn impurities_are_named_by_their_bead() {
    let place = Place::new();
    place.run(SMALL).exits(0);
    let pulses = place.run("pulses small.mcap").exits(0).stdout();
    assert!(pulses.contains("impurity 150 at"), "{pulses}");
    for other in ["impurity 148", "impurity 149", "impurity 151", "impurity 152"] {
        assert!(!pulses.contains(other), "{pulses}");
    }
    let turns = place.run("impurity small.mcap --bead 150 --bead 100").exits(0).stdout();
    assert!(turns.lines().any(|line| line.contains("turns ") && line.contains("bead 150 at ")), "{turns}");
}

//! Places of a chain as settings.

use consumers::analysis::{Beginning, Refusal, Takes};
use schemas::chain::Chain;
use waves::place::{Place, Side};

/// Words for the places that `measure` of a sweep may name.
pub(crate) const ALLOWED: &str = "@12 for a bead, @contact:7, @left or @right for a wall";

/// A place.
pub(crate) const TAKES_PLACE: Takes = Takes::Text("PLACE", |text| place(text).map(drop));

/// Two places, between them a comma.
pub(crate) const TAKES_PAIR: Takes = Takes::Text("PLACE,PLACE", |text| pair(text).map(drop));

/// A place as it is written: also `12` for a bead, `left` and `right` for the walls.
fn place(text: &str) -> Result<Place, String> {
    match text {
        "left" => Ok(Place::Wall(Side::Left)),
        "right" => Ok(Place::Wall(Side::Right)),
        _ => text.parse().map(Place::Bead).or_else(|_| text.parse()),
    }
}

fn pair(text: &str) -> Result<[Place; 2], String> {
    let (from, to) = text.split_once(',').ok_or("expected two places, such as bead:10,bead:90")?;
    Ok([place(from)?, place(to)?])
}

/// The places that `setting` names, each once.
///
/// # Errors
/// When one does not exist in `chain`.
pub(crate) fn places(
    beginning: &Beginning<'_>,
    setting: &'static str,
    chain: &Chain,
) -> Result<Vec<Place>, Refusal> {
    let texts: Vec<String> = beginning.settings.all(setting);
    once(texts.iter().map(|text| checked(place(text)?, chain)))
}

/// The pairs of places that `setting` names, each once.
///
/// # Errors
/// When one does not exist in `chain`.
pub(crate) fn pairs(
    beginning: &Beginning<'_>,
    setting: &'static str,
    chain: &Chain,
) -> Result<Vec<[Place; 2]>, Refusal> {
    let texts: Vec<String> = beginning.settings.all(setting);
    let pairs = texts.iter().map(|text| {
        let [from, to] = pair(text)?;
        Ok([checked(from, chain)?, checked(to, chain)?])
    });
    once(pairs)
}

/// All of these in their order, without those that were there before.
fn once<T: PartialEq>(all: impl Iterator<Item = Result<T, Refusal>>) -> Result<Vec<T>, Refusal> {
    let mut found = Vec::new();
    for next in all {
        let next = next?;
        if !found.contains(&next) {
            found.push(next);
        }
    }
    Ok(found)
}

fn checked(place: Place, chain: &Chain) -> Result<Place, Refusal> {
    place.check(chain).map_err(|error| error.to_string().into())
}

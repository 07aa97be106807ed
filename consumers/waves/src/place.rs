//! Places of a chain where a sensor may be, and what it reads there.

use schemas::chain::Chain;
pub use schemas::drive::Side;
use schemas::frame::Frame;
use std::fmt;
use std::str::FromStr;

/// A place of a chain: `bead:20`, `contact:7`, `wall:right`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// A bead.
    Bead(usize),
    /// The contact between this bead and the next one; that of the last bead closes a ring.
    Contact(usize),
    /// The contact of an end bead with its wall.
    Wall(Side),
}

/// A quantity at a place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// Velocity of a bead, or the rate at which the overlap of a contact grows (m/s).
    Velocity,
    /// Force of a contact; at a bead the mean of the forces on its two sides, as a sensor embedded in it reads (N).
    Force,
    /// Displacement of a bead, or the overlap of a contact (m).
    Displacement,
}

/// Reason why a place does not exist in a chain.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum PlaceError {
    /// No such bead.
    #[error("{place}: the chain has beads 0 to {last}")]
    Bead {
        /// The place asked for.
        place: Place,
        /// The last bead.
        last: usize,
    },
    /// No such contact.
    #[error("{place}: the chain has contacts 0 to {last}")]
    Contact {
        /// The place asked for.
        place: Place,
        /// The last contact.
        last: usize,
    },
    /// That end has no wall.
    #[error("{0}: this end of the chain is free; a wall is one that [ends] of the configuration calls fixed")]
    Wall(Place),
    /// A ring has no ends.
    #[error(
        "{place}: a ring has no walls; allowed: contact:{closing}, which closes it, other contacts, beads"
    )]
    Ring {
        /// The place asked for.
        place: Place,
        /// The contact that closes the ring.
        closing: usize,
    },
}

impl Place {
    /// Refuses a place that `chain` does not have.
    ///
    /// # Errors
    /// When there is no such bead, contact or wall.
    pub fn check(self, chain: &Chain) -> Result<Self, PlaceError> {
        match self {
            Self::Bead(bead) if bead >= chain.bead_count() => {
                Err(PlaceError::Bead { place: self, last: chain.bead_count() - 1 })
            }
            Self::Contact(contact) if contact >= chain.all_contact_count() => {
                Err(PlaceError::Contact { place: self, last: chain.all_contact_count() - 1 })
            }
            Self::Wall(_) if chain.is_ring => {
                Err(PlaceError::Ring { place: self, closing: chain.contact_count() })
            }
            Self::Wall(side) if !chain.wall(side as usize).is_there => Err(PlaceError::Wall(self)),
            _ => Ok(self),
        }
    }

    /// The place as a part of a column's name: `bead_20`, `wall_right`.
    pub fn column(self) -> String {
        self.to_string().replace(':', "_")
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Bead(bead) => write!(f, "bead:{bead}"),
            Self::Contact(contact) => write!(f, "contact:{contact}"),
            Self::Wall(side) => write!(f, "wall:{side}"),
        }
    }
}

impl FromStr for Place {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let expected = || "expected bead:N, contact:N, wall:left or wall:right".to_owned();
        let number = |text: &str| text.parse().map_err(|_| expected());
        match text.split_once(':').ok_or_else(expected)? {
            ("bead", bead) => number(bead).map(Self::Bead),
            ("contact", contact) => number(contact).map(Self::Contact),
            ("wall", "left") => Ok(Self::Wall(Side::Left)),
            ("wall", "right") => Ok(Self::Wall(Side::Right)),
            _ => Err(expected()),
        }
    }
}

impl Quantity {
    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Velocity => "velocity",
            Self::Force => "force",
            Self::Displacement => "displacement",
        }
    }

    /// Its unit.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Velocity => "m/s",
            Self::Force => "N",
            Self::Displacement => "m",
        }
    }

    /// The unit of its square.
    pub fn squared(self) -> &'static str {
        match self {
            Self::Velocity => "(m/s)²",
            Self::Force => "N²",
            Self::Displacement => "m²",
        }
    }

    /// The unit of its power spectral density, as the name of a column ends.
    pub fn density_column(self) -> &'static str {
        match self {
            Self::Velocity => "m2_s2_hz",
            Self::Force => "n2_hz",
            Self::Displacement => "m2_hz",
        }
    }
}

/// The values that a sensor there reads. The place [exists](Place::check) in the chain.
impl Place {
    /// The value of `quantity`.
    pub fn value(self, chain: &Chain, frame: &Frame<'_>, quantity: Quantity) -> f64 {
        match (quantity, self) {
            (Quantity::Velocity, Self::Bead(bead)) => frame.v_m_s[bead],
            (Quantity::Displacement, Self::Bead(bead)) => frame.u_m[bead],
            (Quantity::Velocity, _) => self.touch(chain, frame).1,
            (Quantity::Displacement, _) => self.touch(chain, frame).0,
            (Quantity::Force, _) => self.force_n(chain, frame),
        }
    }

    /// The overlap (m) at a contact or a wall; none at a bead.
    pub fn overlap_m(self, chain: &Chain, frame: &Frame<'_>) -> Option<f64> {
        (!matches!(self, Self::Bead(_))).then(|| self.touch(chain, frame).0)
    }

    /// The force (N): of a contact with its damping, at a bead the mean of the forces on its two sides, of which a free
    /// one has none.
    pub fn force_n(self, chain: &Chain, frame: &Frame<'_>) -> f64 {
        let (state, time_s) = (frame.state(), frame.time_s);
        match self {
            Self::Bead(bead) => {
                let [left, right] = sides(chain, bead);
                0.5 * (left.force_n(chain, frame) + right.force_n(chain, frame))
            }
            Self::Contact(contact) => chain.whole_force_n(state, time_s, contact),
            Self::Wall(side) => chain.whole_wall_forces_n(state, time_s)[side as usize],
        }
    }

    /// The force (N) when the chain is at rest.
    pub fn rest_force_n(self, chain: &Chain) -> f64 {
        match self {
            Self::Bead(bead) => {
                let [left, right] = sides(chain, bead);
                0.5 * (left.rest_force_n(chain) + right.rest_force_n(chain))
            }
            Self::Contact(contact) => chain.rest_n(contact),
            Self::Wall(side) => chain.wall(side as usize).rest_force_n,
        }
    }

    /// The overlap (m) of a contact or a wall, and the rate at which it grows (m/s).
    fn touch(self, chain: &Chain, frame: &Frame<'_>) -> (f64, f64) {
        let (u, v) = (frame.u_m, frame.v_m_s);
        match self {
            Self::Contact(contact) | Self::Bead(contact) => {
                (chain.overlap_m(u, contact), chain.across(v, contact))
            }
            Self::Wall(side) => {
                let approach_m = chain.wall_approaches_m(u, frame.extra)[side as usize];
                let rate_m_s = chain.wall_approach_rates_m_s(v, frame.time_s)[side as usize];
                (chain.wall(side as usize).overlap_m(approach_m), rate_m_s)
            }
        }
    }
}

/// The contacts on both sides of a bead.
fn sides(chain: &Chain, bead: usize) -> [Place; 2] {
    let has_next = bead < chain.all_contact_count();
    [
        bead.checked_sub(1).map_or(Place::Wall(Side::Left), Place::Contact),
        if has_next { Place::Contact(bead) } else { Place::Wall(Side::Right) },
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use schemas::chain::{Wall, Walls};
    use schemas::contact::ContactLaw;

    /// k = 4, α = 1 between walls: overlaps −0.5 (left wall, open), 1 and 0.25 (contacts), −0.75 (right wall, open).
    #[test]
    fn a_bead_reads_the_mean_of_its_two_sides() {
        let law = ContactLaw::new(1.0);
        let end = Wall::new(&law, 4.0, 0.0);
        let walls = Walls { left: end, right: end };
        let chain = Chain::new(vec![1.0; 3], vec![4.0; 2], vec![0.0; 2], walls, law);
        let (u_m, v_m_s) = ([0.5, -0.5, -0.75], [1.0, 0.0, 3.0]);
        let frame =
            Frame { frame: 0, step: 0, time_s: 0.0, u_m: &u_m, v_m_s: &v_m_s, extra: &[], active: None };
        let force = |place: Place| place.force_n(&chain, &frame);
        assert_eq!(force(Place::Contact(0)), 4.0);
        assert_eq!(force(Place::Bead(1)), 2.5);
        assert_eq!(force(Place::Bead(0)), 2.0); // the left wall is open: bead 0 has moved away from it
        assert_eq!(force(Place::Wall(Side::Right)), 0.0);
        assert_eq!(Place::Contact(1).value(&chain, &frame, Quantity::Velocity), -3.0);
        assert_eq!(Place::Wall(Side::Left).value(&chain, &frame, Quantity::Displacement), -0.5);
        assert!(Place::Bead(3).check(&chain).is_err() && Place::Wall(Side::Left).check(&chain).is_ok());
    }

    /// A ring has no first place: turned by a bead, it reads the same a place further, at the contact that closes it and beside it, too.
    #[test]
    fn a_ring_reads_the_same_wherever_it_begins() {
        let law = ContactLaw::new(1.5);
        let walls = Walls { left: Wall::new(&law, 4.0, 0.25), right: Wall::default() };
        let mut ring = Chain::new(vec![1.0; 3], vec![4.0; 2], vec![0.25; 2], walls, law);
        ring.is_ring = true;
        assert!(Place::Contact(2).check(&ring).is_ok() && Place::Contact(3).check(&ring).is_err());
        // the contact that closes it is no wall, on either side
        for side in [Side::Left, Side::Right] {
            let refused = Place::Wall(side).check(&ring).expect_err("no wall").to_string();
            assert!(refused.contains("no walls; allowed: contact:2"), "{refused}");
        }
        let read = |[u_m, v_m_s]: [[f64; 3]; 2], place: Place, quantity| {
            let frame =
                Frame { frame: 0, step: 0, time_s: 0.0, u_m: &u_m, v_m_s: &v_m_s, extra: &[], active: None };
            place.value(&ring, &frame, quantity)
        };
        let state = [[0.5, -0.5, 0.375], [1.0, 0.0, 3.0]];
        let turned = state.map(|[a, b, c]| [c, a, b]);
        for (place, next) in [(0, 1), (1, 2), (2, 0)] {
            for quantity in [Quantity::Velocity, Quantity::Force, Quantity::Displacement] {
                for of in [Place::Bead, Place::Contact] {
                    let found = read(state, of(place), quantity);
                    assert_eq!(found, read(turned, of(next), quantity), "{} {quantity:?}", of(place));
                }
            }
        }
        assert_eq!(read(state, Place::Contact(2), Quantity::Velocity), 2.0);
    }

    #[test]
    fn places_read_back() {
        for text in ["bead:20", "contact:7", "wall:left", "wall:right"] {
            assert_eq!(text.parse::<Place>().map(|place| place.to_string()), Ok(text.to_owned()));
        }
        for text in ["20", "wall:top", "bead:-1", "bead:"] {
            assert!(text.parse::<Place>().is_err(), "{text}");
        }
    }
}

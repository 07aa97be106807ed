//! Constants of beads and contacts, in the order in which loops read them.

use super::layout::GROUP;
use crate::aligned::Aligned;
use pulp::Arch;
use schemas::term::{Spring, TermLaw};

/// Numbers of beads and contacts that never change, in groups: of each group `1/m` (1/kg) of its beads, the stiffnesses of the contacts on
/// their left, in loaded chains their overlaps (m) and forces (N) at rest, their stiffnesses in each term, and the constants of the springs
/// that hold the beads.
#[derive(Debug, Clone)]
pub(super) struct Constants {
    /// One of the numbers below, or a sum of those of springs.
    pub(super) kind: u8,
    /// True if a contact has a stiffness of the law.
    pub(super) has_law: bool,
    /// True if a contact has an overlap or a force at rest.
    pub(super) are_loaded: bool,
    /// Numbers of a bead.
    pub(super) rows: usize,
    pub(super) numbers: Aligned,
    pub(super) terms: Vec<TermLaw>,
    pub(super) springs: Springs,
}

/// Springs that hold each bead at its place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Springs {
    None,
    Linear,
    /// Linear and cubic ones.
    Cubic,
}

/// Contacts that are no more than a power of the overlap.
pub(super) const BARE: u8 = 0;
/// The same, with overlaps and forces at rest.
pub(super) const LOADED: u8 = 1;
/// Bonds that are springs, in this order, and no other force.
pub(super) const SPRINGS: u8 = LINEAR | QUADRATIC | CUBIC;
pub(super) const LINEAR: u8 = 2;
pub(super) const QUADRATIC: u8 = 4;
pub(super) const CUBIC: u8 = 8;
/// Chains of any kind, with overlaps and forces at rest, terms, and springs that hold the beads.
pub(super) const ANY: u8 = 16;

/// The contacts of a chain, and `1/m` (1/kg) of its beads, each in an array of whole groups.
#[derive(Clone, Copy)]
pub(super) struct Contacts<'a> {
    pub(super) arch: Arch,
    pub(super) inverse_mass: &'a [f64],
    pub(super) stiffness: &'a [f64],
    /// Overlaps (m) and forces (N) at rest.
    pub(super) rest: [&'a [f64]; 2],
    pub(super) terms: &'a [(TermLaw, Aligned)],
    /// Linear (N/m) and cubic (N/m³) constants of the springs that hold the beads.
    pub(super) springs: (Springs, [&'a [f64]; 2]),
}

impl Constants {
    pub(super) fn of(contacts: Contacts<'_>) -> Self {
        let Contacts { arch, inverse_mass, stiffness, rest, terms, springs: (springs, of_springs) } =
            contacts;
        let has = |numbers: &[f64]| numbers.iter().any(|x| *x != 0.0);
        let (has_law, are_loaded) = (has(stiffness), rest.map(has) != [false; 2]);
        let bonds: Option<Vec<_>> = terms
            .iter()
            .map(|(law, _)| if let TermLaw::Spring(Spring(n)) = law { Some(*n) } else { None })
            .collect();
        let kind = match bonds.as_deref() {
            // of loops for machines without wide vectors there is one copy
            _ if matches!(arch, Arch::Scalar) => ANY,
            Some([]) if springs == Springs::None => {
                if are_loaded {
                    LOADED
                } else {
                    BARE
                }
            }
            _ if are_loaded || springs != Springs::None => ANY,
            Some([1]) if !has_law => LINEAR,
            Some([1, 2]) if !has_law => LINEAR | QUADRATIC,
            Some([1, 3]) if !has_law => LINEAR | CUBIC,
            Some([1, 2, 3]) if !has_law => SPRINGS,
            _ => ANY,
        };
        let rest = if has_rest(kind) { &rest[..] } else { &[] };
        let of_terms = terms.iter().map(|(_, stiffness)| &stiffness[..]);
        let of_springs = if springs == Springs::None { &[][..] } else { &of_springs };
        let of_contacts = [inverse_mass, stiffness];
        let rows = of_contacts.iter().chain(rest).copied().chain(of_terms).chain(of_springs.iter().copied());
        let rows: Vec<_> = rows.collect();
        let of_group = |start: usize| rows.iter().flat_map(move |row| &row[start..start + GROUP]);
        let numbers: Vec<_> = (0..inverse_mass.len()).step_by(GROUP).flat_map(of_group).copied().collect();
        let numbers = Aligned::of(&numbers);
        let terms = terms.iter().map(|(law, _)| law.clone()).collect();
        Self { kind, has_law, are_loaded, rows: rows.len(), numbers, terms, springs }
    }
}

/// True if there are overlaps and forces at rest among the constants.
pub(super) const fn has_rest(kind: u8) -> bool {
    kind == LOADED || kind == ANY
}

/// Numbers of a bead before those of its terms.
pub(super) const fn before_terms(kind: u8) -> usize {
    if has_rest(kind) { 4 } else { 2 }
}

/// Numbers of a bead among the constants.
#[inline(always)]
pub(super) fn rows<const KIND: u8>(constants: &Constants) -> usize {
    if KIND == ANY { constants.rows } else { before_terms(KIND) + (KIND & SPRINGS).count_ones() as usize }
}

//! Constants of beads and contacts, in the order in which loops read them.

use super::layout::GROUP;
use aligned_vec::{AVec, CACHELINE_ALIGN};
use schemas::term::{Spring, TermLaw};

/// Numbers of beads and contacts that never change, in groups: of each group `1/m` (1/kg) of its beads, the stiffnesses of the contacts on
/// their left, in loaded chains their overlaps (m) and forces (N) at rest, and their stiffnesses in each term.
#[derive(Debug, Clone)]
pub(super) struct Constants {
    /// A sum of the numbers below.
    pub(super) kind: u8,
    /// True if a contact has a stiffness of the law.
    pub(super) has_law: bool,
    /// Numbers of a bead.
    pub(super) rows: usize,
    pub(super) numbers: AVec<f64>,
    pub(super) terms: Vec<TermLaw>,
}

/// Contacts, and which of their parts there are.
pub(super) const LOADED: u8 = 1;
/// Terms of any kind; the rows of loaded chains are there, too.
pub(super) const TERMS: u8 = 2;
/// Springs, in this order, and no other force.
pub(super) const SPRINGS: u8 = LINEAR | QUADRATIC | CUBIC;
pub(super) const LINEAR: u8 = 4;
pub(super) const QUADRATIC: u8 = 8;
pub(super) const CUBIC: u8 = 16;

/// The contacts of a chain, and `1/m` (1/kg) of its beads, each in an array of whole groups.
#[derive(Clone, Copy)]
pub(super) struct Contacts<'a> {
    pub(super) inverse_mass: &'a [f64],
    pub(super) stiffness: &'a [f64],
    /// Overlaps (m) and forces (N) at rest.
    pub(super) rest: [&'a [f64]; 2],
    pub(super) terms: &'a [(TermLaw, AVec<f64>)],
}

impl Constants {
    pub(super) fn of(contacts: Contacts<'_>) -> Self {
        let Contacts { inverse_mass, stiffness, rest, terms } = contacts;
        let has = |numbers: &[f64]| numbers.iter().any(|x| *x != 0.0);
        let (has_law, loaded) = (has(stiffness), if rest.map(has) == [false; 2] { 0 } else { LOADED });
        let springs: Option<Vec<_>> = terms
            .iter()
            .map(|(law, _)| if let TermLaw::Spring(Spring(n)) = law { Some(*n) } else { None })
            .collect();
        let kind = loaded
            | match springs.as_deref() {
                Some([]) => 0,
                Some([1]) if !has_law => LINEAR,
                Some([1, 2]) if !has_law => LINEAR | QUADRATIC,
                Some([1, 3]) if !has_law => LINEAR | CUBIC,
                Some([1, 2, 3]) if !has_law => LINEAR | QUADRATIC | CUBIC,
                _ => TERMS | LOADED,
            };
        let rest = if kind & LOADED == 0 { &[][..] } else { &rest };
        let of_terms = terms.iter().map(|(_, stiffness)| &stiffness[..]);
        let rows: Vec<_> = [inverse_mass, stiffness].iter().chain(rest).copied().chain(of_terms).collect();
        let of_group = |start: usize| rows.iter().flat_map(move |row| &row[start..start + GROUP]);
        let numbers = (0..inverse_mass.len()).step_by(GROUP).flat_map(of_group).copied();
        let numbers = AVec::from_iter(CACHELINE_ALIGN, numbers);
        let terms = terms.iter().map(|(law, _)| law.clone()).collect();
        Self { kind, has_law, rows: rows.len(), numbers, terms }
    }
}

/// Numbers of a bead among the constants.
#[inline(always)]
pub(super) fn rows<const KIND: u8>(terms: &[TermLaw]) -> usize {
    let rest = if KIND & LOADED == 0 { 0 } else { 2 };
    if KIND & (SPRINGS | TERMS) == 0 { 2 + rest } else { 2 + rest + terms.len() }
}

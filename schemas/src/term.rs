//! Further terms of the force of a contact. A law is one file under `term/`, and one line in the list of laws.

mod power;
mod spring;
mod toda;

use crate::simd::Group;
use pulp::Simd;
use std::fmt::Debug;
use std::ops::Deref;

pub use spring::Spring;
pub use toda::Toda;

/// The interface of a law.
pub trait Law: Debug {
    /// The forms in which a configuration writes it under `chain.bonds`.
    fn forms() -> &'static [BondForm]
    where
        Self: Sized,
    {
        &[]
    }

    /// Its name in files, and its parameter there.
    fn named(&self) -> (&'static str, f64);

    /// Force (N) at the overlap `overlap_m` (m).
    fn force(&self, stiffness: f64, overlap_m: f64) -> f64;

    /// Slope dF/dδ (N/m).
    fn tangent(&self, stiffness: f64, overlap_m: f64) -> f64;

    /// Energy (J) beyond that at rest, less the work of the force at rest, of a contact whose beads are `approach_m` nearer than
    /// at the rest overlap `rest_m`. `is_loaded` is true if any contact of the chain has a rest overlap.
    fn excess_j(&self, stiffness: f64, rest_m: f64, approach_m: f64, is_loaded: bool) -> f64;

    /// The exponent of a law that is 0 in open contacts, and a power of the overlap in closed ones.
    fn exponent(&self) -> Option<f64> {
        None
    }

    /// The largest slope (N/m) of a bond with the overlap `rest_m` (m) at rest whose energy is `energy_j`, where that grows less than the
    /// slope at an overlap to be expected.
    fn tangent_by_energy(&self, _stiffness: f64, _rest_m: f64, _energy_j: f64) -> Option<f64> {
        None
    }
}

/// A form in which `chain.bonds` has a law: `key = stiffness`, or `key = { stiffness = …, parameter = … }`.
#[derive(Debug)]
pub struct BondForm {
    /// Its key.
    pub key: &'static str,
    /// Its words in a listing.
    pub words: &'static str,
    /// Key and unit of the parameter.
    pub parameter: Option<(&'static str, &'static str)>,
    /// True if the stiffness may be negative, too.
    pub has_either_sign: bool,
    /// The stiffnesses that may be.
    pub allowed: &'static str,
    /// True if the stiffness is the slope at rest (N/m), which the scales are made of.
    pub is_slope: bool,
    /// The pulls that its energy holds.
    pub holds: Holds,
    /// The law with a parameter, if it has one.
    pub law: fn(f64) -> TermLaw,
}

/// The pulls of a bond that the energy of a law holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Holds {
    /// None: alone it has no bottom.
    None,
    /// Those up to an edge, beside a law that holds none.
    Weak,
    /// All.
    All,
}

impl PartialEq for BondForm {
    fn eq(&self, other: &Self) -> bool {
        self.key == other.key
    }
}

/// The part of a law that kernels compute in vectors.
pub trait InGroups: Law {
    /// Adds the forces (N) of a group of contacts to `sum_n`.
    fn add_to<S: Simd, const G: usize>(
        &self,
        simd: S,
        stiffness: &[f64; G],
        overlap_m: &Group<G>,
        sum_n: &mut Group<G>,
    );

    /// Adds the slopes dF/dδ (N/m) of groups of contacts to `sums`.
    #[inline(always)]
    fn add_slopes<S: Simd, const G: usize>(
        &self,
        _: S,
        [stiffness, overlap_m]: [&[[f64; G]]; 2],
        sums: &mut [[f64; G]],
    ) {
        let contacts = stiffness.as_flattened().iter().zip(overlap_m.as_flattened());
        for (sum, (stiffness, overlap_m)) in sums.as_flattened_mut().iter_mut().zip(contacts) {
            *sum += self.tangent(*stiffness, *overlap_m);
        }
    }
}

/// Makes one type of the list of laws.
macro_rules! laws {
    ($($law:ident($of:path)),+ $(,)?) => {
        /// A law by which the force of a term depends on the overlap δ.
        #[derive(Debug, Clone, PartialEq)]
        pub enum TermLaw {
            $(#[doc = concat!("[`", stringify!($of), "`]")] $law($of)),+
        }

        /// The forms of all laws under `chain.bonds`, in their order.
        pub fn bond_forms() -> impl Iterator<Item = &'static BondForm> {
            [$(<$of as Law>::forms()),+].into_iter().flatten()
        }

        impl Deref for TermLaw {
            type Target = dyn Law;

            fn deref(&self) -> &(dyn Law + 'static) {
                match self { $(Self::$law(law) => law),+ }
            }
        }

        impl TermLaw {
            /// Adds the forces (N) of a group of contacts to `sum_n`.
            #[inline(always)]
            pub fn add_to<S: Simd, const G: usize>(
                &self,
                simd: S,
                stiffness: &[f64; G],
                overlap_m: &Group<G>,
                sum_n: &mut Group<G>,
            ) {
                match self { $(Self::$law(law) => law.add_to(simd, stiffness, overlap_m, sum_n)),+ }
            }

            /// Adds the slopes dF/dδ (N/m) of groups of contacts, by their stiffnesses and overlaps (m), to `sums`.
            #[inline(always)]
            pub fn add_slopes<S: Simd, const G: usize>(
                &self,
                simd: S,
                contacts: [&[[f64; G]]; 2],
                sums: &mut [[f64; G]],
            ) {
                match self { $(Self::$law(law) => law.add_slopes(simd, contacts, sums)),+ }
            }
        }
    };
}

laws! {
    Power(crate::contact::ContactLaw),
    Spring(Spring),
    Toda(Toda),
}

/// A term of the forces of all contacts.
#[derive(Debug, Clone, PartialEq)]
pub struct Term {
    /// Its law.
    pub law: TermLaw,
    /// Stiffness of each contact (N over the unit of what the law gives), N − 1 values; 0 where a contact has no such term.
    pub stiffness: Vec<f64>,
    /// The same of the contacts with the left and the right wall; in a ring the first is that of its last contact.
    pub wall_stiffness: [f64; 2],
}

impl Term {
    /// Its stiffness at contact `contact`; contact N − 1 closes a ring.
    pub fn stiffness_of(&self, contact: usize) -> f64 {
        self.stiffness.get(contact).copied().unwrap_or(self.wall_stiffness[0])
    }
}

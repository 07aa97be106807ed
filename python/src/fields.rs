//! What states hold: fields along the chain, and parts of them.

use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use schemas::chain::Chain;
use schemas::damping::{Damping, damped_force};
use schemas::frame::Frame;
use schemas::manifest::RunManifest;

/// An array along the chain.
#[derive(Clone, Copy)]
pub(crate) enum Field {
    Displacement,
    Velocity,
    Overlap,
    Force,
}

impl Field {
    pub(crate) fn named(name: &str) -> PyResult<Self> {
        match name {
            "displacement" => Ok(Self::Displacement),
            "velocity" => Ok(Self::Velocity),
            "overlap" => Ok(Self::Overlap),
            "force" => Ok(Self::Force),
            _ => Err(PyValueError::new_err(format!("there is no field {name}"))),
        }
    }

    pub(crate) fn places(self, chain: &Chain) -> usize {
        match self {
            Self::Displacement | Self::Velocity => chain.bead_count(),
            Self::Overlap | Self::Force => chain.contact_count(),
        }
    }

    /// Its value at bead or contact `place`.
    fn value(self, chain: &Chain, frame: &Frame<'_>, place: usize) -> f64 {
        match self {
            Self::Displacement => frame.u_m[place],
            Self::Velocity => frame.v_m_s[place],
            Self::Overlap => chain.overlap_m(frame.u_m, place),
            Self::Force => force_n(chain, frame, place),
        }
    }
}

/// The force of a contact (N), with damping, also that at rest.
fn force_n(chain: &Chain, frame: &Frame<'_>, contact: usize) -> f64 {
    let overlap_m = chain.overlap_m(frame.u_m, contact);
    let stiffness = chain.stiffness[contact];
    let elastic_n = chain.law.force(stiffness, overlap_m);
    let Some(damping) = chain.damping.as_ref().filter(|_| overlap_m > chain.law.zero_up_to_m()) else {
        return elastic_n;
    };
    let (coefficient, rate_m_s) =
        (damping.coefficient[contact], frame.v_m_s[contact] - frame.v_m_s[contact + 1]);
    let power = elastic_n / stiffness;
    match damping.kind {
        Damping::ViscousNSPerM(_) => {
            damped_force::<false>(elastic_n, power, overlap_m, coefficient, rate_m_s)
        }
        Damping::Restitution(_) => damped_force::<true>(elastic_n, power, overlap_m, coefficient, rate_m_s),
    }
}

/// What is asked for.
pub(crate) enum Wanted<'a> {
    /// All doubles of a state: displacements, velocities, what else the method needs.
    States(&'a RunManifest),
    /// Places (beads or contacts) of a field.
    Part { chain: &'a Chain, field: Field, places: Places<'a> },
}

/// Beads or contacts.
pub(crate) enum Places<'a> {
    Range(usize, usize),
    List(&'a [usize]),
}

impl Wanted<'_> {
    /// Values of a step.
    pub(crate) fn width(&self) -> usize {
        match self {
            Self::States(run) => run.frame_doubles(),
            Self::Part { places: Places::Range(from, to), .. } => to - from,
            Self::Part { places: Places::List(list), .. } => list.len(),
        }
    }

    pub(crate) fn write(&self, frame: &Frame<'_>, row: &mut [f64]) {
        let Self::Part { chain, field, places } = self else {
            let mut rest = row;
            for part in [frame.u_m, frame.v_m_s, frame.extra] {
                let (to, others) = rest.split_at_mut(part.len());
                to.copy_from_slice(part);
                rest = others;
            }
            return;
        };
        let whole = match field {
            Field::Displacement => Some(frame.u_m),
            Field::Velocity => Some(frame.v_m_s),
            Field::Overlap | Field::Force => None,
        };
        let value = |place| field.value(chain, frame, place);
        match (places, whole) {
            (Places::Range(from, to), Some(values)) => row.copy_from_slice(&values[*from..*to]),
            (Places::Range(from, to), None) => {
                row.iter_mut().zip(*from..*to).for_each(|(to, place)| *to = value(place));
            }
            (Places::List(list), _) => row.iter_mut().zip(*list).for_each(|(to, place)| *to = value(*place)),
        }
    }
}

/// The values of `field` in a state.
pub(crate) fn field_of<'py>(
    py: Python<'py>,
    chain: &Chain,
    field: &str,
    u_m: &PyReadonlyArray1<'_, f64>,
    v_m_s: &PyReadonlyArray1<'_, f64>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let field = Field::named(field)?;
    let (u_m, v_m_s) = (u_m.as_slice()?, v_m_s.as_slice()?);
    if u_m.len() != chain.bead_count() || v_m_s.len() != chain.bead_count() {
        return Err(PyValueError::new_err(format!("the chain has {} beads", chain.bead_count())));
    }
    let frame = Frame { frame: 0, step: 0, time_s: 0.0, u_m, v_m_s, extra: &[] };
    let values = (0..field.places(chain)).map(|place| field.value(chain, &frame, place));
    Ok(PyArray1::from_iter(py, values))
}

//! Contents of states: fields along the chain, and parts of them.

use numpy::{PyArray1, PyReadonlyArray1, ToPyArray as _};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use schemas::chain::Chain;
use schemas::frame::Frame;
use schemas::manifest::RunManifest;

/// An array along the chain.
#[derive(Clone, Copy)]
pub(crate) enum Field {
    Displacement,
    Velocity,
    Overlap,
    Force,
    ResonatorDisplacement,
    ResonatorVelocity,
}

impl Field {
    pub(crate) fn named(name: &str) -> PyResult<Self> {
        match name {
            "displacement" => Ok(Self::Displacement),
            "velocity" => Ok(Self::Velocity),
            "overlap" => Ok(Self::Overlap),
            "force" => Ok(Self::Force),
            "resonator_displacement" => Ok(Self::ResonatorDisplacement),
            "resonator_velocity" => Ok(Self::ResonatorVelocity),
            _ => Err(PyValueError::new_err(format!("there is no field {name}"))),
        }
    }

    pub(crate) fn places(self, chain: &Chain) -> usize {
        match self {
            Self::ResonatorDisplacement | Self::ResonatorVelocity if !chain.rows.resonators => 0,
            Self::Displacement | Self::Velocity | Self::ResonatorDisplacement | Self::ResonatorVelocity => {
                chain.bead_count()
            }
            Self::Overlap | Self::Force => chain.all_contact_count(),
        }
    }

    /// Its value at bead or contact `place`.
    fn value(self, chain: &Chain, frame: &Frame<'_>, place: usize) -> f64 {
        match self {
            Self::Displacement => frame.u_m[place],
            Self::Velocity => frame.v_m_s[place],
            Self::Overlap => chain.overlap_m(frame.u_m, place),
            Self::Force => chain.whole_force_n(frame.state(), frame.time_s, place),
            Self::ResonatorDisplacement => chain.rows.resonators_of(frame.extra)[0][place],
            Self::ResonatorVelocity => chain.rows.resonators_of(frame.extra)[1][place],
        }
    }
}

/// Values that are asked for.
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
            Field::ResonatorDisplacement => Some(chain.rows.resonators_of(frame.extra)[0]),
            Field::ResonatorVelocity => Some(chain.rows.resonators_of(frame.extra)[1]),
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

/// A number of each contact, in a ring with the one that closes it.
pub(crate) fn of_contacts<'py>(
    py: Python<'py>,
    chain: &Chain,
    number: fn(&Chain, usize) -> f64,
) -> Bound<'py, PyArray1<f64>> {
    PyArray1::from_iter(py, (0..chain.all_contact_count()).map(|contact| number(chain, contact)))
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
    if matches!(field, Field::ResonatorDisplacement | Field::ResonatorVelocity) {
        return Err(PyValueError::new_err("resonators are parts of extra"));
    }
    let (u_m, v_m_s) = (u_m.as_slice()?, v_m_s.as_slice()?);
    if u_m.len() != chain.bead_count() || v_m_s.len() != chain.bead_count() {
        return Err(PyValueError::new_err(format!("the chain has {} beads", chain.bead_count())));
    }
    let frame = Frame { frame: 0, step: 0, time_s: 0.0, u_m, v_m_s, extra: &[], active: None };
    let values = (0..field.places(chain)).map(|place| field.value(chain, &frame, place));
    Ok(PyArray1::from_iter(py, values))
}

/// Displacements and velocities of resonators, dissipated work, works and displacements of drives, heat of baths.
pub(crate) type Parts<'py> = [Bound<'py, PyArray1<f64>>; 6];

/// The parts of a state's `extra`, which are none where the run has none.
pub(crate) fn parts_of<'py>(
    py: Python<'py>,
    chain: &Chain,
    drives: usize,
    extra: &PyReadonlyArray1<'_, f64>,
) -> PyResult<Parts<'py>> {
    let (extra, rows) = (extra.as_slice()?, chain.rows);
    check_extra(chain, extra)?;
    let [w_m, w_m_s] = rows.resonators_of(extra).map(|values| values.to_pyarray(py));
    let row = rows.drives_of(extra);
    let of_drives =
        |which: usize| PyArray1::from_iter(py, row.iter().take(2 * drives).skip(which).step_by(2).copied());
    let heat_j = rows.heat_of(extra).to_pyarray(py);
    Ok([w_m, w_m_s, rows.work_of(extra).to_pyarray(py), of_drives(0), of_drives(1), heat_j])
}

/// Forces (N) of the contacts with the left and the right wall, with damping and those at rest, at the time `time_s` in the state
/// `[u_m, v_m_s, extra]`; 0 at a free end. In a ring the first is that of the contact that closes it.
pub(crate) fn wall_forces_n<'py>(
    py: Python<'py>,
    chain: &Chain,
    time_s: f64,
    state: [&PyReadonlyArray1<'_, f64>; 3],
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    Ok(chain.whole_wall_forces_n(slices_of(chain, &state)?, time_s).to_pyarray(py))
}

/// Kinetic and potential energy (J) of `[u_m, v_m_s, extra]`.
pub(crate) fn energy_j(chain: &Chain, state: [&PyReadonlyArray1<'_, f64>; 3]) -> PyResult<(f64, f64)> {
    let [u_m, v_m_s, extra] = slices_of(chain, &state)?;
    let energy = chain.energy(u_m, v_m_s, extra, &mut vec![0.0; chain.contact_count()]);
    Ok((energy.kinetic_j, energy.potential_j))
}

/// The parts of a state of this chain.
fn slices_of<'a>(chain: &Chain, state: &[&'a PyReadonlyArray1<'_, f64>; 3]) -> PyResult<[&'a [f64]; 3]> {
    let [u_m, v_m_s, extra] = [state[0].as_slice()?, state[1].as_slice()?, state[2].as_slice()?];
    check_extra(chain, extra)?;
    if u_m.len() != chain.bead_count() || v_m_s.len() != chain.bead_count() {
        return Err(PyValueError::new_err(format!("the chain has {} beads", chain.bead_count())));
    }
    Ok([u_m, v_m_s, extra])
}

fn check_extra(chain: &Chain, extra: &[f64]) -> PyResult<()> {
    let count = chain.rows.count() * chain.bead_count();
    if extra.len() == count {
        return Ok(());
    }
    Err(PyValueError::new_err(format!("extra: found {} values; expected {count}", extra.len())))
}

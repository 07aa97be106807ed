//! The map of a period: a state, one period later, and the derivative of this map.

use nalgebra::DMatrix;
use producer::integrator::Integrator;
use producer::state::ChainState;
use producer::tangents::NoTangent;
use schemas::amounts::quantity;
use schemas::config::ConfigError;
use schemas::manifest::Physics;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{ScopedJoinHandle, available_parallelism, scope};

/// Tangents that one thread carries at least.
const FEWEST_TANGENTS: usize = 16;

/// Numbers of a chain that are free to differ: those of a state but for what drives prescribe. All are counted in units in which the seed
/// has norm 1: displacements and velocities times √m, displacements over the collision time T.
#[derive(Debug, Clone)]
pub(crate) struct Coordinates {
    /// Places among the numbers of a tangent.
    free: Vec<usize>,
    /// Unit (m or m/s) of each of these.
    unit: Vec<f64>,
    beads: usize,
}

/// A map: a state, some steps later, displaced along the chain.
#[derive(Debug, Clone)]
pub(crate) struct Map<'a> {
    /// The run; its step is that of a state, in place of this one.
    pub(crate) physics: &'a Physics,
    pub(crate) coordinates: &'a Coordinates,
    pub(crate) steps: u64,
    /// Beads by which the state is displaced at the end, against the direction of their numbers.
    pub(crate) shift_beads: u64,
    /// Set when the search is to be given up.
    pub(crate) stop: &'a AtomicBool,
}

/// States at the beginnings and the ends of parts of a period, and the derivatives of these by those, if they were asked for.
#[derive(Debug)]
pub(crate) struct Carried {
    physics: Physics,
    starts: Vec<ChainState>,
    pub(crate) ends: Vec<Vec<f64>>,
    pub(crate) derivatives: Vec<DMatrix<f64>>,
}

/// Reason why a state cannot be carried over a period.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MapError {
    /// The run leaves the range of doubles.
    #[error(
        "the state is not finite after {steps} steps: the seed is too far from an orbit, or the step too long"
    )]
    NotFinite {
        /// Steps since the beginning of the period.
        steps: u64,
    },
    /// A drive is elsewhere after a period.
    #[error(
        "what drives move is elsewhere after a period: the period is no multiple of that of the drives, or a velocity has a mean"
    )]
    DriveMoves,
    /// A damped contact closed or opened, whose force has no bounded slope there.
    #[error(
        "a damped contact opens and closes, where its force jumps (dashpots), or has a slope without bound (δ^p with p below 1: restitution and \
         kuwabara_kono_s of spheres), and multipliers are off by chance; press the chain ([load] precompression_n), or choose another \
         damping (on_site.drag_n_s_per_m, or damping.power with an exponent of 1 or more)"
    )]
    Jumps,
    /// Somebody gave it up.
    #[error("stopped before an orbit was found")]
    Stopped,
    /// The method has no tangents.
    #[error(transparent)]
    NoTangent(#[from] NoTangent),
}

impl Coordinates {
    /// Those of runs of `physics`, in which `start` has norm 1.
    pub(crate) fn of(physics: &Physics, start: &ChainState) -> Result<Self, NoTangent> {
        let mut integrator = Integrator::with_tangents(physics, 0)?;
        let (mut free, mut unit) = (Vec::new(), Vec::new());
        if let Some(tangents) = integrator.tangents() {
            let weights = tangents.weights(physics.scales().time_s);
            free =
                (0..weights.len()).zip(tangents.free()).filter(|(_, free)| *free).map(|(i, _)| i).collect();
            unit = free.iter().map(|place| 1.0 / weights[*place].sqrt()).collect();
        }
        let mut these = Self { free, unit, beads: start.u_m.len() };
        let size = norm(&these.of_state(start));
        these.rescale(size);
        Ok(these)
    }

    /// Gives states that have the norm `size` the norm 1, if it is not 0.
    pub(crate) fn rescale(&mut self, size: f64) {
        if size > 0.0 {
            self.unit.iter_mut().for_each(|unit| *unit *= size);
        }
    }

    /// Number of coordinates.
    pub(crate) fn count(&self) -> usize {
        self.free.len()
    }

    /// The coordinates of `state`.
    pub(crate) fn of_state(&self, state: &ChainState) -> Vec<f64> {
        self.of_numbers(|place| {
            let (row, bead) = (place / self.beads, place % self.beads);
            match row {
                0 => state.u_m[bead],
                1 => state.v_m_s[bead],
                _ => state.extra[(row - 2) * self.beads + bead],
            }
        })
    }

    fn of_numbers(&self, number: impl Fn(usize) -> f64) -> Vec<f64> {
        self.free.iter().zip(&self.unit).map(|(place, unit)| number(*place) / unit).collect()
    }

    /// Puts `state` at `point`.
    pub(crate) fn put(&self, point: &[f64], state: &mut ChainState) {
        for ((place, unit), x) in self.free.iter().zip(&self.unit).zip(point) {
            let (row, bead) = (place / self.beads, place % self.beads);
            *match row {
                0 => &mut state.u_m[bead],
                1 => &mut state.v_m_s[bead],
                _ => &mut state.extra[(row - 2) * self.beads + bead],
            } = x * unit;
        }
    }

    /// Places of displacements, and of velocities, among the coordinates.
    pub(crate) fn displacements_and_velocities(&self) -> (Vec<usize>, Vec<usize>) {
        (0..self.count()).partition(|place| (self.free[*place] / self.beads).is_multiple_of(2))
    }

    /// For each coordinate, the velocity that belongs to a displacement, and the other way round.
    pub(crate) fn others(&self) -> Vec<usize> {
        let (u, v) = self.displacements_and_velocities();
        let mut others = vec![0; self.count()];
        u.iter().zip(&v).for_each(|(u, v)| (others[*u], others[*v]) = (*v, *u));
        others
    }

    /// Kind (displacement, velocity, those of resonators) and bead of each coordinate.
    pub(crate) fn kinds_and_beads(&self) -> Vec<[usize; 2]> {
        self.free.iter().map(|place| [place / self.beads, place % self.beads]).collect()
    }

    /// The change of a chain that is displaced as a whole.
    pub(crate) fn displacement_of_all(&self) -> Vec<f64> {
        self.of_numbers(|place| if (place / self.beads).is_multiple_of(2) { 1.0 } else { 0.0 })
    }

    /// Place of the displacement of `bead` among the coordinates, and its unit (m).
    pub(crate) fn displacement(&self, bead: usize) -> Option<(usize, f64)> {
        let place = self.free.iter().position(|place| *place == bead)?;
        Some((place, self.unit[place]))
    }

    /// For each coordinate, the place of the one that takes its value where a chain is displaced by `beads`, or none at its end.
    fn displaced(&self, beads: u64, is_ring: bool) -> Vec<Option<usize>> {
        let of = |place: &usize| {
            let (row, bead) = (place / self.beads, place % self.beads);
            let from = bead + usize::try_from(beads).unwrap_or(usize::MAX);
            let from = if is_ring { from % self.beads } else { from };
            (from < self.beads).then(|| self.free.binary_search(&(row * self.beads + from)).ok()).flatten()
        };
        self.free.iter().map(of).collect()
    }
}

impl Map<'_> {
    /// Carries the states `points`, each the beginning of one of so many equal parts of a period, with steps of `dt_s`; with the derivatives if
    /// these are asked for.
    pub(crate) fn carry(&self, dt_s: f64, points: &[Vec<f64>], derive: bool) -> Result<Carried, MapError> {
        let physics = Physics { dt_s, ..self.physics.clone() };
        let count = self.coordinates.count();
        let start = ChainState::initial(&physics);
        let mut state = start.clone();
        let mut carried = Carried { physics, starts: Vec::new(), ends: Vec::new(), derivatives: Vec::new() };
        for (part, point) in points.iter().enumerate() {
            self.coordinates.put(point, &mut state);
            carried.starts.push(state.clone());
            let each = self.steps / points.len() as u64;
            if derive {
                let unit = |column| (0..count).map(|place| f64::from(u8::from(place == column))).collect();
                let units: Vec<Vec<f64>> = (0..count).map(unit).collect();
                let (end, mut columns) = self.changed(&carried.physics, &state, each, &units)?;
                self.displace(&mut columns, part + 1 == points.len());
                let derivative = DMatrix::from_iterator(count, count, columns.into_iter().flatten());
                carried.derivatives.push(derivative);
                state = end;
            } else {
                self.advance(&mut Integrator::new(&carried.physics), &mut state, each)?;
            }
            carried.ends.push(self.coordinates.of_state(&state));
        }
        if self.moved(&start, &state) > 1e-9 {
            return Err(MapError::DriveMoves);
        }
        let last = carried.ends.len() - 1;
        self.displace(&mut carried.ends[last..], true);
        Ok(carried)
    }

    /// Changes at the end of a part that was carried, of `changes` at its beginning.
    pub(crate) fn change(
        &self,
        carried: &Carried,
        part: usize,
        changes: &[Vec<f64>],
    ) -> Result<Vec<Vec<f64>>, MapError> {
        let Carried { physics, starts, .. } = carried;
        let each = self.steps / starts.len() as u64;
        let mut changed = self.changed(physics, &starts[part], each, changes)?.1;
        self.displace(&mut changed, part + 1 == starts.len());
        Ok(changed)
    }

    /// The state after the parts of a period that begin at `points`, each of [`steps`](Self::steps) steps.
    pub(crate) fn along(&self, dt_s: f64, points: &[Vec<f64>]) -> Result<Vec<f64>, MapError> {
        let physics = Physics { dt_s, ..self.physics.clone() };
        let mut state = ChainState::initial(&physics);
        self.coordinates.put(&points[0], &mut state);
        self.advance(&mut Integrator::new(&physics), &mut state, self.steps * points.len() as u64)?;
        Ok(self.coordinates.of_state(&state))
    }

    /// Carries `state` over `steps` steps, and `changes` of it, on several threads.
    fn changed(
        &self,
        physics: &Physics,
        state: &ChainState,
        steps: u64,
        changes: &[Vec<f64>],
    ) -> Result<(ChainState, Vec<Vec<f64>>), MapError> {
        let threads = available_parallelism().map_or(1, usize::from);
        let each = changes.len().div_ceil(threads).next_multiple_of(8).max(FEWEST_TANGENTS);
        let parts = scope(|threads| {
            let part = |changes| threads.spawn(move || self.part(physics, state.clone(), steps, changes));
            let begun: Vec<_> = changes.chunks(each).map(part).collect();
            begun.into_iter().map(ScopedJoinHandle::join).collect::<Vec<_>>()
        });
        let (mut end, mut changed) = (state.clone(), Vec::with_capacity(changes.len()));
        for part in parts {
            let part = part.unwrap_or_else(|panic| std::panic::resume_unwind(panic))?;
            end = part.0;
            changed.extend(part.1);
        }
        Ok((end, changed))
    }

    /// Carries `state` over `steps` steps, and `changes` of it.
    fn part(
        &self,
        physics: &Physics,
        mut state: ChainState,
        steps: u64,
        changes: &[Vec<f64>],
    ) -> Result<(ChainState, Vec<Vec<f64>>), MapError> {
        let Coordinates { free, unit, .. } = self.coordinates;
        let mut integrator = Integrator::with_tangents(physics, changes.len())?;
        if let Some(tangents) = integrator.tangents() {
            for (number, change) in changes.iter().enumerate() {
                let mut numbers = vec![0.0; tangents.dimension()];
                free.iter().zip(unit).zip(change).for_each(|((place, unit), x)| numbers[*place] = x * unit);
                tangents.set(number, &numbers);
            }
        }
        self.advance(&mut integrator, &mut state, steps)?;
        let mut found = Vec::new();
        if let Some(tangents) = integrator.tangents() {
            if tangents.has_jumped() {
                return Err(MapError::Jumps);
            }
            for number in 0..changes.len() {
                let change = tangents.tangent(number);
                found.push(self.coordinates.of_numbers(|place| change[place]));
            }
        }
        Ok((state, found))
    }

    /// Advances `state` by so many steps.
    fn advance(
        &self,
        integrator: &mut Integrator,
        state: &mut ChainState,
        steps: u64,
    ) -> Result<(), MapError> {
        let (start, last) = (state.step, state.step + steps);
        while state.step < last {
            integrator.advance(state, last);
            if integrator.first_non_finite(state).is_some() {
                return Err(MapError::NotFinite { steps: state.step - start });
            }
            if self.stop.load(Ordering::Relaxed) {
                return Err(MapError::Stopped);
            }
        }
        Ok(())
    }

    /// Largest distance, in the units of the coordinates, by which what drives prescribe has moved.
    fn moved(&self, start: &ChainState, end: &ChainState) -> f64 {
        let Coordinates { free, unit, beads } = self.coordinates;
        let prescribed = (0..*beads).filter(|bead| free.binary_search(bead).is_err());
        let of_beads = prescribed.map(|bead| (end.u_m[bead] - start.u_m[bead]).abs());
        let rows = self.physics.rows();
        let [at_start, at_end] = [start, end].map(|state| rows.drives_of(&state.extra));
        let of_drives =
            at_start.chunks_exact(2).zip(at_end.chunks_exact(2)).map(|(a, b)| (a[1] - b[1]).abs());
        of_beads.chain(of_drives).fold(0.0, f64::max) / unit.first().copied().unwrap_or(1.0)
    }

    /// Displaces states or changes along the chain, if they are those at the end of the period.
    fn displace(&self, all: &mut [Vec<f64>], is_at_end: bool) {
        if self.shift_beads == 0 || !is_at_end {
            return;
        }
        let from = self.coordinates.displaced(self.shift_beads, self.physics.chain().is_ring);
        // beads of other masses have other units
        let unit = &self.coordinates.unit;
        for numbers in all {
            let at = |to: usize| from[to].map_or(0.0, |from| numbers[from] * (unit[from] / unit[to]));
            *numbers = (0..from.len()).map(at).collect();
        }
    }
}

/// The key of an error about steps that are too long.
pub(crate) const STEPS: &str = "orbit.steps";

/// Refuses a period of `steps` steps of `dt_s`, if no run of `physics` may have such steps.
pub(crate) fn check_steps(physics: &Physics, steps: u64, dt_s: f64) -> Result<(), ConfigError> {
    let longest_s = physics.longest_dt_s();
    if dt_s > longest_s {
        let found = format!("{steps}, of {}", quantity(dt_s, "s"));
        let (longest, fewest) = (quantity(longest_s, "s"), (steps as f64 * dt_s / longest_s).ceil());
        let allowed =
            format!("steps of at most {longest}, as in any run: {fewest} or more in a period of this length");
        return Err(ConfigError::value(STEPS, found, &allowed));
    }
    Ok(())
}

/// √(Σ x²).
pub(crate) fn norm(numbers: &[f64]) -> f64 {
    numbers.iter().map(|x| x * x).sum::<f64>().sqrt()
}

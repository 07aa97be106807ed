//! Periodic orbits of chains: states that come back after a period, found by Newton's method on the map of the run's own steps, with the exact
//! derivative of this map; their multipliers; branches of orbits along a parameter.
//!
//! ```
//! use orbits::{Asked, Options, Problem, Search};
//! use schemas::{config::RunConfig, manifest::Physics};
//!
//! // two beads on springs: they swing against each other with ω² = 3
//! let config = RunConfig::from_toml("
//!     chain = { beads = 2, bead_mass_kg = 1.0, bonds = { linear = 1.0, cubic = 1.0 } }
//!     ends = { left = 'fixed', right = 'fixed' }
//!     initial = { displacements_m = [0.001, -0.001] }
//!     time = { duration_s = 1.0, dt_s = 0.01 }").unwrap();
//! let physics = Physics::resolve(&config).unwrap();
//! let family = |_| Ok(Problem { physics: physics.clone(), asked: Asked::AmplitudeM(0.001) });
//! let options = Options { period_s: Some(3.63), ..Options::default() };
//! let stop = std::sync::atomic::AtomicBool::new(false);
//! let orbit = Search::begin(&family, 0.0, options, &stop).unwrap().find().unwrap();
//! assert!((orbit.period_s() - std::f64::consts::TAU / 3.0_f64.sqrt()).abs() < 1e-4);
//! assert!(orbit.multipliers.unstable().next().is_none());
//! ```

pub mod branch;
mod eigenvalues;
pub mod file;
mod krylov;
mod map;
pub mod multipliers;
pub mod newton;
pub mod shown;
pub mod spectra;
pub mod switching;

pub use map::MapError;
pub use newton::{Asked, Family, NoOrbit, Problem};

use map::{Coordinates, Map, check_steps, norm};
use multipliers::Multipliers;
use newton::{Found, Newton, Unknown};
use producer::state::ChainState;
use schemas::chain::Chain;
use schemas::config::Initial;
use schemas::drive::{Place, Quantity};
use schemas::manifest::Physics;
use std::sync::atomic::AtomicBool;

/// The most coordinates, 2N or 4N with resonators, for which matrices are made, with all multipliers.
pub const MOST_DENSE: usize = 2000;

/// Settings of a search, beside the problem.
#[derive(Debug, Clone, Copy, Default)]
pub struct Options {
    /// Steps of a period; by default those that the run takes for it, or a few more.
    pub steps: Option<u64>,
    /// Parts into which a period is divided, each with a beginning of its own.
    pub segments: Option<u64>,
    /// Beads by which the state is displaced after a period.
    pub shift_beads: u64,
    /// A first guess of a period (s) that is not asked for.
    pub period_s: Option<f64>,
    /// The most coordinates for which matrices are made [default: [`MOST_DENSE`]].
    pub most_dense: Option<usize>,
}

/// A search for orbits of a family of chains.
#[derive(Clone)]
pub struct Search<'a> {
    newton: Newton<'a>,
    start: Unknown,
    /// The place from which a branch is followed; by default the orbit near the seed.
    begun: Option<branch::Step>,
    /// Multipliers that are 1 by symmetry.
    trivial: usize,
    is_conservative: bool,
}

/// A periodic orbit.
#[derive(Debug, Clone)]
pub struct Orbit {
    /// The run that makes it: with its time step, and its period as the duration.
    pub physics: Physics,
    /// The state at its beginning.
    pub state: ChainState,
    /// The orbit as the search knows it.
    pub unknown: Unknown,
    /// Its multipliers.
    pub multipliers: Multipliers,
    /// Energy (J) at its beginning.
    pub energy_j: f64,
    /// Residual at each step of Newton's method.
    pub residuals: Vec<f64>,
    /// Distance between the state and that a period later, over its size.
    pub returns: f64,
    /// The bead whose displacement at the beginning was asked for, if one was.
    pub asked_bead: Option<usize>,
    /// Beads by which the state is further on after the period.
    pub shift_beads: u64,
}

impl Orbit {
    /// Its period (s).
    pub fn period_s(&self) -> f64 {
        self.physics.dt_s * self.physics.step_count as f64
    }

    /// The largest displacement (m) at its beginning.
    pub fn amplitude_m(&self) -> f64 {
        self.state.u_m.iter().fold(0.0, |most: f64, u| most.max(u.abs()))
    }

    /// The initial state of a run that makes it.
    pub fn initial(&self) -> Initial {
        let [w_m, w_m_s] = self.physics.rows().resonators_of(&self.state.extra);
        Initial {
            displacements_m: self.state.u_m.to_vec(),
            velocities_m_s: self.state.v_m_s.to_vec(),
            resonator_displacements_m: w_m.to_vec(),
            resonator_velocities_m_s: w_m_s.to_vec(),
            ..Initial::default()
        }
    }

    /// The bead whose displacement was asked for and the size (m) of that, if another bead has a larger one: so it is where Newton's method
    /// went from the seed to a mode of the same frequency.
    pub fn surpassed(&self) -> Option<(usize, f64)> {
        let asked = self.asked_bead?;
        let size_m = self.state.u_m[asked].abs();
        (self.amplitude_m() > size_m * (1.0 + 1e-6)).then_some((asked, size_m))
    }
}

impl<'a> Search<'a> {
    /// Begins at the initial state of the problem at `parameter`; it is given up when `stop` is set.
    ///
    /// # Errors
    /// When the seed is at rest, or the chain has no orbits, or none that are found in this way.
    pub fn begin(
        family: &'a Family<'a>,
        parameter: f64,
        options: Options,
        stop: &'a AtomicBool,
    ) -> Result<Self, NoOrbit> {
        let Problem { physics, asked } = family(parameter)?;
        let chain = physics.chain();
        if !physics.baths.is_empty() {
            return Err(NoOrbit::Chain("baths shake the chain, and nothing comes back: leave [[bath]] out"));
        }
        let is_driven = !physics.drives.is_empty();
        if options.shift_beads > 0 && (is_driven || !is_alike(&chain, options.shift_beads)) {
            return Err(NoOrbit::Chain(
                "orbit.shift_beads: the chain is not the same so many beads further; beads, contacts and sites have to repeat, without a \
                 [[drive]]: leave it out",
            ));
        }
        let is_conservative = physics.is_without_loss();
        if !is_driven && !is_conservative {
            return Err(NoOrbit::Chain(
                "the chain loses energy and nothing drives it: it comes to rest; add a [[drive]]",
            ));
        }
        let period_s = match asked {
            Asked::PeriodS(period_s) => Some(period_s),
            Asked::EnergyJ(_) | Asked::AmplitudeM(_) if is_driven => {
                let why = "the drive gives the period: leave energy_j and amplitude_m out";
                return Err(NoOrbit::Chain(why));
            }
            Asked::EnergyJ(_) | Asked::AmplitudeM(_) => options.period_s,
        };
        let no_period =
            NoOrbit::Chain("no first guess of the period: give orbit.period_s, or a mode as the seed");
        let period_s = period_s.filter(|period_s| *period_s > 0.0).ok_or(no_period)?;
        let segments = options.segments.unwrap_or(1).max(1);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a number of steps, checked below"
        )]
        let steps = options
            .steps
            .unwrap_or((period_s / physics.dt_s).ceil() as u64)
            .max(1)
            .next_multiple_of(2 * segments);
        if steps > 100_000_000 {
            return Err(NoOrbit::Chain(
                "a period of more than 1e8 steps: the period is too long for the time step",
            ));
        }
        let physics = Physics { dt_s: period_s / steps as f64, ..physics };
        if let Asked::PeriodS(_) = asked {
            check_steps(&physics, steps, physics.dt_s)?;
        }
        let begun = ChainState::initial(&physics);
        let mut coordinates = Coordinates::of(&physics, &begun).map_err(MapError::from)?;
        let mut points = vec![coordinates.of_state(&begun)];
        let shift_beads = options.shift_beads;
        if norm(&points[0]) == 0.0 {
            // a chain at rest that is driven: the size of its motion is that after a period
            let map = Map { physics: &physics, coordinates: &coordinates, steps, shift_beads, stop };
            let end = map.along(physics.dt_s, &points)?;
            coordinates.rescale(norm(&end));
            if norm(&end) == 0.0 {
                return Err(NoOrbit::Chain("the seed is at rest: give [initial], a striker, or orbit.mode"));
            }
        }
        let bead = most_displaced(&begun.u_m, &asked)?;
        let symmetries = usize::from(!is_driven) + usize::from(is_loose(&physics, &chain, shift_beads));
        points.resize(usize::try_from(segments).unwrap_or(1), Vec::new());
        let mut start = Unknown { points, dt_s: physics.dt_s, parameter };
        let all: Vec<usize> = (0..coordinates.count()).collect();
        let (displacements, velocities) = coordinates.displacements_and_velocities();
        let is_still = velocities.iter().all(|place| start.points[0][*place] == 0.0);
        let turns = is_still && is_conservative && !is_driven && shift_beads == 0;
        let newton = Newton {
            is_dense: coordinates.count() <= options.most_dense.unwrap_or(MOST_DENSE),
            unknown: if turns { displacements } else { all.clone() },
            turns,
            moves_by_itself: !is_driven,
            closed: if turns { velocities } else { all },
            family,
            coordinates,
            steps,
            periods: 1,
            shift_beads,
            stop,
            symmetries: symmetries - usize::from(turns),
            bead,
            units: [physics.dt_s, if parameter == 0.0 { 1.0 } else { parameter.abs() }],
        };
        newton.flow(&mut start)?;
        let trivial = if is_conservative { 2 * symmetries } else { symmetries };
        Ok(Self { newton, start, begun: None, trivial, is_conservative })
    }

    /// Finds the orbit near the seed.
    ///
    /// # Errors
    /// When there is none.
    pub fn find(&self) -> Result<Orbit, NoOrbit> {
        self.orbit(self.near_seed()?)
    }

    /// The orbit near the seed, over a period that is no multiple of its own.
    fn near_seed(&self) -> Result<Found, NoOrbit> {
        let found = self.newton.find(&self.start, None)?;
        if self.newton.is_repeated(&found.unknown)? {
            let why = "Newton's method came to an orbit that comes back after a part of the period already; begin with a smaller \
                       amplitude, or give a first guess of the period (orbit.period_s)";
            return Err(NoOrbit::Chain(why));
        }
        Ok(found)
    }

    /// The orbit that has been found.
    fn orbit(&self, found: Found) -> Result<Orbit, NoOrbit> {
        let Found { unknown, monodromy, residuals } = found;
        if self.newton.is_at_rest(&unknown) {
            let why = "Newton's method came to rest: rest is an orbit of any period; begin with a larger amplitude, or ask for one (amplitude_m)";
            return Err(NoOrbit::Chain(why));
        }
        let problem = (self.newton.family)(unknown.parameter)?;
        let asked_bead = matches!(problem.asked, Asked::AmplitudeM(_)).then_some(self.newton.bead);
        let multipliers = if let Some(monodromy) = &monodromy {
            Multipliers::of(monodromy, self.trivial, self.is_conservative)
        } else {
            let found = self.newton.largest(&unknown)?;
            found.map(|found| Multipliers::largest_of(&found, self.trivial, self.is_conservative))
        };
        let multipliers = multipliers
            .ok_or(NoOrbit::Chain("the multipliers could not be computed: they are too far apart"))?;
        let energy_j = self.newton.energy_j(&problem, &unknown);
        let state = self.newton.state(&problem, &unknown);
        let physics = Physics { dt_s: unknown.dt_s, step_count: self.newton.steps, ..problem.physics };
        let returns = self.newton.returns(&unknown)?;
        let shift_beads = self.newton.shift_beads;
        let orbit = Orbit {
            physics,
            state,
            unknown,
            multipliers,
            energy_j,
            residuals,
            returns,
            asked_bead,
            shift_beads,
        };
        // not by the size of the seed
        let begun_there = Physics { initial: orbit.initial(), ..orbit.physics.clone() };
        check_steps(&begun_there, self.newton.steps, begun_there.dt_s)?;
        Ok(orbit)
    }
}

/// The bead that `u_m` displaces most, of those that do so equally one with the sign of the amplitude that is asked for.
fn most_displaced(u_m: &[f64], asked: &Asked) -> Result<usize, NoOrbit> {
    let sign = if let Asked::AmplitudeM(amplitude_m) = asked { amplitude_m.signum() } else { 1.0 };
    let most = u_m.iter().fold(0.0, |most: f64, u| most.max(u.abs()));
    let mut equal = (0..u_m.len()).filter(|bead| u_m[*bead].abs() >= most * (1.0 - 1e-9));
    let bead = equal.clone().find(|bead| u_m[*bead] * sign > 0.0).or_else(|| equal.next()).unwrap_or(0);
    match asked {
        Asked::AmplitudeM(amplitude_m) if u_m[bead] * sign < 0.0 => {
            let allowed = format!(
                "a number of the sign of the seed, which displaces bead {bead} most, by {} m",
                u_m[bead]
            );
            Err(schemas::config::ConfigError::value("orbit.amplitude_m", amplitude_m.to_string(), &allowed)
                .into())
        }
        _ => Ok(bead),
    }
}

/// True if each bead of `chain`, with its contact on the right, is like that so many beads further on, where there is one.
fn is_alike(chain: &Chain, shift_beads: u64) -> bool {
    let (beads, shift) = (chain.bead_count(), usize::try_from(shift_beads).unwrap_or(usize::MAX));
    let repeats = |values: &[f64], closing: Option<f64>| {
        let values: Vec<f64> = values.iter().copied().chain(closing.filter(|_| chain.is_ring)).collect();
        let last = if chain.is_ring { values.len() } else { values.len().saturating_sub(shift) };
        (0..last).all(|at| values[at] == values[(at + shift % beads) % values.len()])
    };
    let seam = &chain.walls.left;
    let sites = &chain.sites;
    let of_beads = [
        &chain.mass_kg,
        &sites.linear_n_per_m,
        &sites.cubic_n_per_m3,
        &sites.drag_n_s_per_m,
        &sites.resonator_kg,
        &sites.resonator_n_per_m,
    ];
    of_beads.into_iter().all(|values| repeats(values, None))
        && repeats(&chain.stiffness, Some(seam.stiffness))
        && repeats(&chain.rest_overlap_m, Some(seam.rest_overlap_m))
        && chain.terms.iter().all(|term| repeats(&term.stiffness, Some(term.wall_stiffness[0])))
}

/// True if nothing holds the chain in its place.
fn is_loose(physics: &Physics, chain: &Chain, shift_beads: u64) -> bool {
    let has_walls = !chain.is_ring && (chain.walls.left.is_there || chain.walls.right.is_there);
    let is_held = |drive: &schemas::drive::Drive| {
        matches!(drive.at, Place::Wall(_)) || drive.prescribes != Quantity::Force
    };
    let is_fed = shift_beads > 0 && !chain.is_ring;
    !has_walls && !is_fed && !chain.sites.has_springs() && !physics.drives.iter().any(is_held)
}

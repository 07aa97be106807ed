//! Heat in a chain: the current along it, the temperature of each bead, and the conductivity, with errors.

mod green_kubo;

use consumers::analysis::{
    Allowed, Analysis, Beginning, Meaning, Needs, Number, Offer, Outlet, Refusal, Remake, Report, Setting,
    TableFlag, Takes,
};
use consumers::blocks::{Blocks, Estimate};
use consumers::table::{Cell, Column};
use consumers::uncertain::Uncertain;
use figure::{Axis, Curve, Figure, FigureError, Panel};
use green_kubo::{GreenKubo, Point, panel};
use schemas::amounts::{quantity, unit};
use schemas::chain::Chain;
use schemas::drive::{Place, Quantity};
use schemas::frame::Frame;
use schemas::manifest::RunManifest;
use serde_json::json;

/// The analysis, before it looks at a run.
pub static OFFER: Offer = Offer {
    name: "heat",
    about: "Heat: current along the chain, temperature of each bead, conductivity between baths, with errors",
    help: "Examples:\n  \
        beadline heat run.mcap --from 200 --figure heat.png\n  \
        beadline heat run.mcap --from 200 --profile profile.csv --out current.csv\n  \
        beadline heat ring.mcap --from 200 --lag 100 --green-kubo kappa.csv --figure heat.png\n  \
        beadline heat live:hot --figure heat.svg             while the run goes on\n\n\
        The current from bead i to bead i + 1 is J = ½·F·(v_i + v_(i+1)) with the force F of their contact beyond that at rest: the power that \
        moves energy across, if each bead has half of the energy of its contacts (S. Lepri, R. Livi and A. Politi, Phys. Rep. 377 (2003) 1, \
        doi:10.1016/S0370-1573(02)00558-6). The temperature of a bead is <m·v²>, as k_B·T in joule. Where nothing \
        takes momentum (free ends or a ring, without drives, springs at sites, drag, or baths but those of pairs) velocities are those about the centre of mass, and <m·v²> is divided by 1 − m/M, \
        with the mass M of the chain. Beads that a drive moves have no temperature. The conductivity is κ = J·N/ΔT between \
        two baths, with the N beads from the one to the other, per lattice unit. Averages are over all frames that are looked at, so leave out the beginning (--from). Standard \
        errors are from the scatter of 32 to 63 blocks of frames, or of longer ones, down to two, where these tell significantly larger ones. They hold if the memory of a quantity is shorter than a block of \
        these 32. A notice says where an error still grows with the length of the blocks: the run is too short, and runs with other seeds tell. \
        Baths of different temperatures in a ring, or more than two of them, drive no one current along the chain, nor is there one with damping or drag, \
        or where drives act on beads on its way: --profile has that of each contact.\n\n\
        In equilibrium, without drives, damping, drag, or baths but those of one temperature above 0, the fluctuations of the current give a conductivity, too (Green and Kubo): κ(τ) = ∫_0^τ <J(0)·J(t)> dt/(n·T²), with J the \
        current of all n contacts less its mean, whose own scatter from run to run, 2·κ·n·T² over the time, is allowed for, and T the temperature of the chain, from its mean kinetic energy. It is shown over τ: where it stays level it is the conductivity; \
        where it goes on growing the chain has none, as long chains that conserve momentum. Take a ring, or baths on all beads: between ends κ(τ) comes back to 0. Frames have to be evenly spaced, and \
        closer than the current changes; no pair of them has a gap between.",
    settings: &[Setting::new(
        "lag",
        Takes::number("s", Allowed::AboveZero),
        "Longest lag of the conductivity from fluctuations (s) [default: a twentieth of the time that is looked at, at most 16384 frames]",
    )],
    tables: &[
        TableFlag { name: "out", help: "Table of the numbers in each frame" },
        TableFlag {
            name: "profile",
            help: "Table of the beads: temperature, current to the next bead, errors",
        },
        TableFlag {
            name: "green-kubo",
            help: "Table of the lags: autocorrelation of the current of all contacts, conductivity up to the lag, errors",
        },
    ],
    columns: &[
        Meaning::number(
            "mean_current_w",
            "current, averaged over the contacts that do not lie within a bath, nor beyond two that drive it",
        ),
        Meaning::number("kinetic_temperature_j", "temperature m·v², averaged over the beads"),
    ],
    summary: &[
        Meaning::number("current_w", "current along the chain"),
        Meaning::number("current_error_w", "its standard error"),
        Meaning::number(
            "memory_s",
            "time in which the current forgets itself, if the run is long enough to tell: the integral of its autocorrelation",
        ),
        Meaning::number("temperature_j", "temperature of the chain"),
        Meaning::number("temperature_error_j", "its standard error"),
        Meaning::number("conductivity_per_s", "conductivity between two baths"),
        Meaning::number("conductivity_error_per_s", "its standard error"),
        Meaning::number("green_kubo_per_s", "conductivity from fluctuations, up to the longest lag"),
        Meaning::number("green_kubo_error_per_s", "its standard error"),
        Meaning::number("green_kubo_lag_s", "that lag"),
    ],
    needs: Needs { remake: Remake::OfFrame, ..Needs::FRAMES },
    begin: |beginning| Ok(Box::new(Heat::begin(beginning)?)),
    ..Offer::PLAIN
};

/// The most beads: each takes a hundred numbers.
const MOST_BEADS: usize = 100_000;

/// An estimate of nothing.
const NONE: Estimate = Estimate { mean: f64::NAN, error: f64::NAN, memory_frames: f64::NAN };

struct Heat {
    manifest: RunManifest,
    chain: Chain,
    /// Contacts between beads, in a ring with the last one to bead 0.
    contacts: usize,
    /// Mass (kg) of the chain; infinite where something outside of it takes momentum.
    loose_kg: f64,
    /// Mass m (kg) of each bead over 1 − m/M, with the mass M above; 0 for beads that a drive moves.
    thermal_kg: Vec<f64>,
    /// Those that do not lie within a bath; where two baths drive a current, between them. All if there are none.
    inner: Vec<usize>,
    /// True if there is no equilibrium: energy comes from elsewhere than baths of one temperature, or goes elsewhere.
    is_driven: bool,
    /// The reason why the contacts have no one current, if there is one.
    no_current: Option<&'static str>,
    /// True if the conductivity from fluctuations was asked for.
    wants_fluctuations: bool,
    green_kubo: GreenKubo,
    /// Its outcome, once no more frames come.
    points: Vec<Point>,
    /// Temperature (J) of each bead, current (W) through each contact between beads.
    places: Blocks,
    /// The row of each frame.
    rows: Blocks,
    /// The first and the last time (s).
    times_s: Option<[f64; 2]>,
    /// The conductivity (1/s) over the current (W): the beads between two baths of constant temperatures over the difference of these (J).
    conductivity_per_j: Option<f64>,
}

impl Heat {
    fn begin(beginning: &Beginning<'_>) -> Result<Self, Refusal> {
        let manifest = beginning.manifest.clone();
        let chain = manifest.physics.chain();
        let beads = chain.bead_count();
        if beads > MOST_BEADS {
            return Err(format!("{beads} beads; allowed: chains of at most {MOST_BEADS} beads").into());
        }
        let mut baths: Vec<_> = manifest.physics.baths.iter().collect();
        baths.sort_by_key(|bath| bath.beads.from);
        let start = schemas::functions::Moment::new(0, 0.0, 0.0);
        let temperatures: Vec<Option<f64>> =
            baths.iter().map(|bath| bath.is_steady().then(|| bath.temperature_j(start))).collect();
        let is_heated = temperatures.iter().any(|found| found.is_none() || *found != temperatures[0]);
        let no_current = match baths.len() {
            _ if !is_heated => None,
            _ if chain.is_ring => Some("in a ring heat goes both ways round, and its currents cancel"),
            3.. => Some("baths between the first and the last one give or take heat, and currents differ"),
            _ => None,
        };
        let contacts = if chain.is_ring { beads } else { beads - 1 };
        let between = match baths[..] {
            [first, last] if is_heated && no_current.is_none() => {
                first.beads.range().start..last.beads.range().end - 1
            }
            _ => 0..contacts,
        };
        let within = |c: &usize| {
            baths.iter().any(|bath| {
                let of_bath = bath.beads.range();
                of_bath.contains(c) && of_bath.contains(&((c + 1) % beads))
            })
        };
        let inner: Vec<usize> = between.clone().filter(|c| !within(c)).collect();
        let inner = if inner.is_empty() { (0..contacts).collect() } else { inner };
        // beads between two contacts of the current
        let on_the_way = if chain.is_ring { 0..beads } else { inner[0] + 1..inner[inner.len() - 1] + 1 };
        let (drives, sites) = (&manifest.physics.drives, &chain.sites);
        let acts = |values: &Vec<f64>| values.iter().any(|value| *value != 0.0);
        let is_lossy = !manifest.physics.is_without_loss();
        let is_held = !drives.is_empty()
            || baths.iter().any(|bath| !bath.pairs)
            || (!chain.is_ring && (0..2).any(|side| chain.wall(side).is_there))
            || [&sites.drag_n_s_per_m, &sites.linear_n_per_m, &sites.cubic_n_per_m3].into_iter().any(acts);
        let whole_kg: f64 = chain.mass_kg.iter().chain(&sites.resonator_kg).sum();
        let loose_kg = if is_held { f64::INFINITY } else { whole_kg };
        let moves =
            |at: Place| drives.iter().any(|drive| drive.at == at && drive.prescribes != Quantity::Force);
        let thermal_kg = (0..).zip(&chain.mass_kg).map(|(bead, mass_kg)| {
            if moves(Place::Bead(bead)) { 0.0 } else { mass_kg / (1.0 - mass_kg / loose_kg) }
        });
        let is_driven_at = |bead: usize| drives.iter().any(|drive| drive.at == Place::Bead(bead as u64));
        let is_open = is_lossy || on_the_way.into_iter().any(is_driven_at);
        let why = "drives, damping or drag give or take energy on the way, and currents differ";
        let no_current = no_current.or_else(|| is_open.then_some(why));
        let last_step = manifest.physics.step_count.min(*beginning.steps.end());
        let lag_s: Option<f64> = beginning.settings.one("lag");
        let conductivity_per_j = match temperatures[..] {
            [Some(first_j), Some(last_j)] if is_heated && no_current.is_none() => {
                Some((between.len() + 1) as f64 / (first_j - last_j))
            }
            _ => None,
        };
        Ok(Self {
            conductivity_per_j,
            inner,
            loose_kg,
            thermal_kg: thermal_kg.collect(),
            is_driven: is_heated || is_lossy || !drives.is_empty() || temperatures.contains(&Some(0.0)),
            no_current,
            green_kubo: GreenKubo::new(lag_s, manifest.physics.dt_s, last_step),
            wants_fluctuations: lag_s.is_some(),
            points: Vec::new(),
            places: Blocks::new(beads + contacts),
            contacts,
            rows: Blocks::new(2),
            times_s: None,
            chain,
            manifest,
        })
    }

    /// The velocity (m/s) of the centre of mass; 0 where something outside of the chain takes momentum.
    fn drift_m_s(&self, frame: &Frame<'_>) -> f64 {
        let [_, w_m_s] = self.chain.rows.resonators_of(frame.extra);
        let masses = self.chain.mass_kg.iter().chain(&self.chain.sites.resonator_kg);
        let parts = masses.zip(frame.v_m_s.iter().chain(w_m_s));
        parts.fold(0.0, |sum, (mass_kg, v)| sum + mass_kg * v) / self.loose_kg
    }

    /// The current (W) through contact `c` between two beads, in a chain that drifts at `drift_m_s`.
    fn current_w(&self, c: usize, frame: &Frame<'_>, drift_m_s: f64) -> f64 {
        let rest_n = self.chain.rest_force_n.get(c).copied().unwrap_or(self.chain.walls.left.rest_force_n);
        let force_n = self.chain.whole_force_n(frame.state(), frame.time_s, c) - rest_n;
        force_n * (0.5 * (frame.v_m_s[c] + frame.v_m_s[(c + 1) % self.chain.bead_count()]) - drift_m_s)
    }

    /// The conductivity over the lag from fluctuations, and the current's autocorrelation; none out of equilibrium.
    fn fluctuations(&self) -> Vec<Point> {
        if self.is_driven {
            return Vec::new();
        }
        self.green_kubo.points(self.inner.len(), self.rows.estimate(1))
    }

    /// Current (W), temperature (J) and conductivity (1/s).
    fn found(&self) -> [Estimate; 3] {
        let [current, temperature] = [0, 1].map(|quantity| self.rows.estimate(quantity));
        let current = if self.no_current.is_some() { NONE } else { current };
        let factor = self.conductivity_per_j.unwrap_or(f64::NAN);
        let conductivity = Estimate {
            mean: factor * current.mean,
            error: factor.abs() * current.error,
            memory_frames: f64::NAN,
        };
        [current, temperature, conductivity]
    }

    /// The numbers of the summary.
    fn numbers(&self) -> [(&'static str, f64); 10] {
        let [current, temperature, conductivity] = self.found();
        let none = (f64::NAN, [f64::NAN; 2], [f64::NAN; 2]);
        let (lag_s, _, [kubo, kubo_error]) = self.points.last().copied().unwrap_or(none);
        [
            ("current_w", current.mean),
            ("current_error_w", current.error),
            ("memory_s", self.memory_s()),
            ("temperature_j", temperature.mean),
            ("temperature_error_j", temperature.error),
            ("conductivity_per_s", conductivity.mean),
            ("conductivity_error_per_s", conductivity.error),
            ("green_kubo_per_s", kubo),
            ("green_kubo_error_per_s", kubo_error),
            ("green_kubo_lag_s", lag_s),
        ]
    }

    /// The memory of the current (s); NaN where it is too long to be told.
    fn memory_s(&self) -> f64 {
        let [first_s, last_s] = self.times_s.unwrap_or_default();
        let steps = self.rows.frames().saturating_sub(1) as f64;
        let memory_s = self.found()[0].memory_frames * (last_s - first_s) / steps;
        if memory_s.is_finite() { memory_s } else { f64::NAN }
    }

    fn temperature(&self, bead: usize) -> Estimate {
        if self.thermal_kg[bead] > 0.0 { self.places.estimate(bead) } else { NONE }
    }

    fn current(&self, contact: usize) -> Estimate {
        self.places.estimate(self.chain.bead_count() + contact)
    }
}

impl Analysis for Heat {
    fn columns(&self, table: usize) -> Vec<Column> {
        let names: &[&str] = match table {
            1 => &["bead", "temperature_j", "temperature_error_j", "current_w", "current_error_w"],
            2 => &[
                "lag_s",
                "autocorrelation_w2",
                "autocorrelation_error_w2",
                "conductivity_per_s",
                "conductivity_error_per_s",
            ],
            _ => &[],
        };
        names.iter().map(|name| (*name).to_owned().into()).collect()
    }

    fn observe(&mut self, frame: &Frame<'_>, out: &mut dyn Outlet) {
        let beads = self.chain.bead_count();
        let drift_m_s = self.drift_m_s(frame);
        let temperatures =
            self.thermal_kg.iter().zip(frame.v_m_s).map(|(mass_kg, v)| mass_kg * (v - drift_m_s).powi(2));
        let currents = (0..self.contacts).map(|c| self.current_w(c, frame, drift_m_s));
        let all: Vec<f64> = temperatures.chain(currents).collect();
        let sum = |values: &[f64]| values.iter().fold(0.0, |sum, x| sum + x);
        let flowing_w = self.inner.iter().fold(0.0, |sum, c| sum + all[beads + c]);
        let warm = self.thermal_kg.iter().filter(|mass_kg| **mass_kg > 0.0).count();
        let row = [flowing_w / self.inner.len() as f64, sum(&all[..beads]) / warm as f64];
        self.green_kubo.push(frame.step, flowing_w);
        self.places.push(all);
        self.rows.push(row);
        self.times_s = Some([self.times_s.map_or(frame.time_s, |[first_s, _]| first_s), frame.time_s]);
        out.row(frame, &row);
    }

    fn finish(&mut self, out: &mut dyn Outlet) -> Result<(), Refusal> {
        self.green_kubo.check()?;
        self.wants_fluctuations |= out.wants(2);
        self.points = self.fluctuations();
        let cell = |value: f64| Cell::from(Number::Double(value));
        for bead in 0..if out.wants(1) { self.chain.bead_count() } else { 0 } {
            let temperature = self.temperature(bead);
            let current = if bead < self.contacts { self.current(bead) } else { NONE };
            let values = [temperature.mean, temperature.error, current.mean, current.error].map(cell);
            let line: Vec<Cell> = [Cell::Integer(bead as u64)].into_iter().chain(values).collect();
            out.line(1, &line);
        }
        for (lag_s, product, conductivity) in self.points.iter().filter(|_| out.wants(2)).collect::<Vec<_>>()
        {
            let line = [&[*lag_s][..], product, conductivity].concat();
            out.line(2, &line.into_iter().map(cell).collect::<Vec<_>>());
        }
        Ok(())
    }

    fn report(&mut self) -> Option<Report> {
        self.times_s?;
        let [current, temperature, conductivity] = self.found();
        let memory_s = self.memory_s();
        let told = |Estimate { mean, error, .. }: Estimate, of: &str| {
            if error.is_nan() {
                return quantity(mean, of);
            }
            let (unit, one) = unit(if error > mean.abs() { error } else { mean }, of);
            format!("{} {unit}", Uncertain::new(mean, error) / one)
        };
        let per_s = |mean: f64, error: f64| format!("{} 1/s", Uncertain::new(mean, error));
        let mut report = Report { title: "heat", ..Report::default() };
        let words = &mut report.words;
        if self.no_current.is_none() {
            words.add("current", told(current, "W"));
        }
        if memory_s.is_finite() {
            words.add("memory", format_args!("{} of the current", quantity(memory_s, "s")));
        }
        words.add("temperature", told(temperature, "J"));
        if self.conductivity_per_j.is_some() {
            words.add("conductivity", per_s(conductivity.mean, conductivity.error));
        }
        if let Some((lag_s, _, kubo)) = self.points.last() {
            let ([kappa, error], up_to) = (*kubo, quantity(*lag_s, "s"));
            words.add("Green-Kubo", format_args!("{} from lags up to {up_to}", per_s(kappa, error)));
        }
        report.results = self.numbers().map(|(name, number)| (name, json!(number))).into_iter().collect();
        report.notices.extend(self.no_current.map(|why| {
            format!("no current along the chain and no conductivity: {why}; --profile has the current of each contact")
        }));
        if self.is_driven && self.wants_fluctuations {
            report.notices.push(
                "no conductivity from fluctuations, which need equilibrium: leave out drives, damping and drag, and baths, or give \
                 all of them one temperature above 0"
                    .to_owned(),
            );
        }
        for (name, found) in [("current", current), ("temperature", temperature)] {
            if found.memory_frames.is_infinite() {
                report.notices.push(format!(
                    "the run is too short for the memory of the {name}: its error still grows with the length of the blocks and may be several times \
                     too small; run longer, or leave out the beginning (--from)"
                ));
            }
        }
        if temperature.error.is_nan() {
            report
                .notices
                .push("too few frames for errors: at least 8 blocks of frames are needed".to_owned());
        }
        Some(report)
    }

    /// Temperature and current along the chain.
    fn figure(&mut self) -> Result<Option<Figure>, FigureError> {
        let curve = |found: Vec<Estimate>, offset: f64| {
            let at = |i: usize| i as f64 + offset;
            let band: Vec<_> = found
                .iter()
                .enumerate()
                .map(|(i, found)| (at(i), found.mean - 2.0 * found.error, found.mean + 2.0 * found.error))
                .collect();
            Curve::line("", found.iter().enumerate().map(|(i, found)| (at(i), found.mean))).band(band)
        };
        let beads = self.chain.bead_count();
        let temperatures = curve((0..beads).map(|bead| self.temperature(bead)).collect(), 0.0);
        let currents = curve((0..self.contacts).map(|contact| self.current(contact)).collect(), 0.5);
        let of_beads =
            |label: &str, curve| Panel::new().x_axis(Axis::new("bead")).y_axis(Axis::new(label)).curve(curve);
        let figure = Figure::new()
            .caption(plots::caption(&self.manifest))
            .panel(of_beads("temperature m<v^{2}> (J)", temperatures).note("bands: two standard errors"))
            .panel(of_beads("current (W)", currents));
        let is_even = self.points.len() > 1;
        Ok(Some(if is_even { figure.panel(panel(&self.points)) } else { figure.shared_x() }))
    }

    fn value(&self, name: &str, _: Option<&str>) -> Option<Number> {
        let found = self.numbers().into_iter().find(|(number, _)| *number == name);
        found.map(|(_, number)| Number::Double(number))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use consumers::analysis::{LastRow, Settings};
    use consumers::local_energy::bead_energies_j;
    use producer::integrator::Integrator;
    use producer::state::ChainState;
    use schemas::config::RunConfig;
    use schemas::manifest::Origin;

    fn manifest(toml: &str) -> RunManifest {
        let origin = Origin { program: "test".into(), host: "here".into(), started_unix_ns: 1 };
        RunManifest::new(&RunConfig::from_toml(toml).unwrap(), "run", origin).unwrap()
    }

    /// The energy of the beads up to a contact changes by the current through it: to the second order of the step, since currents of
    /// neighbouring frames are averaged.
    #[test]
    fn currents_are_the_changes_of_energy_on_either_side() {
        for laws in ["alpha = 1.5\nstiffness = 1.0", "bonds = { linear = 1.0, quadratic = 0.5, cubic = 1.0 }"]
        {
            let load = if laws.contains("alpha") { "[load]\nprecompression_n = 1.0\n" } else { "" };
            let manifest = manifest(&format!(
                "[chain]\nbeads = 10\nbead_mass_kg = 1.0\nmasses = {{ pattern_kg = [1.0, 2.0] }}\n{laws}\n[ends]\nleft = \"fixed\"\n\
                 {load}[striker]\nbead = 4\nvelocity_m_s = 0.3\n[time]\nduration_s = 20\ndt_s = 0.001\n"
            ));
            let settings = Settings::default();
            let heat = Heat::begin(&Beginning::whole("heat", &manifest, &settings)).unwrap();
            let mut state = ChainState::initial(&manifest.physics);
            let mut integrator = Integrator::new(&manifest.physics);
            let look = |state: &ChainState| {
                let frame = state.as_frame(&manifest, 0);
                let energies_j = bead_energies_j(&heat.chain, &frame);
                let left_j = |c: usize| energies_j[..=c].iter().sum::<f64>();
                (0..9).map(|c| [left_j(c), heat.current_w(c, &frame, 0.0)]).collect::<Vec<_>>()
            };
            let (mut before, mut worst, mut largest) = (look(&state), 0.0_f64, 0.0_f64);
            for _ in 0..4_000 {
                integrator.step(&mut state);
                let after = look(&state);
                for (before, after) in before.iter().zip(&after) {
                    let lost_w = (before[0] - after[0]) / 0.001;
                    worst = worst.max((lost_w - 0.5 * (before[1] + after[1])).abs());
                    largest = largest.max(lost_w.abs());
                }
                before = after;
            }
            assert!(worst < 2e-6 * largest, "{laws}: {worst:e} of {largest:e}");
        }
    }

    /// The heat of a run, of which some steps are looked at.
    fn of_run(manifest: &RunManifest, settings: &Settings, is_looked_at: impl Fn(u64) -> bool) -> Heat {
        let mut heat = Heat::begin(&Beginning::whole("heat", manifest, settings)).unwrap();
        let mut state = ChainState::initial(&manifest.physics);
        let mut integrator = Integrator::new(&manifest.physics);
        while state.step < manifest.physics.step_count {
            integrator.step(&mut state);
            if is_looked_at(state.step) {
                heat.observe(&state.as_frame(manifest, state.step), &mut LastRow::default());
            }
        }
        heat
    }

    /// The chain of Rieder, Lebowitz and Lieb: its exact current lies within four errors, and the profile, too.
    #[test]
    fn a_harmonic_chain_between_baths_has_its_current() {
        let bath = |bead: i32, t: f64| {
            format!("[[bath]]\nbeads = {bead}\ntemperature_j = {t:?}\nfriction_per_s = 0.5\n")
        };
        let manifest = manifest(&format!(
            "seed = 3\n[chain]\nbeads = 8\nbead_mass_kg = 1.0\nbonds = {{ linear = 1.0 }}\n[ends]\nleft = \"fixed\"\nright = \"fixed\"\n\
             {}{}[time]\nduration_s = 200000\ndt_s = 0.1\n",
            bath(0, 1.5),
            bath(-1, 0.5)
        ));
        let heat = of_run(&manifest, &Settings::default(), |step| step > 10_000 && step.is_multiple_of(10));
        let [current, temperature, conductivity] = heat.found();
        let is_near = |found: Estimate, exact: f64| (found.mean - exact).abs() < 4.0 * found.error;
        assert!(is_near(current, 0.171_572_875) && current.error < 0.01, "{current:?}");
        assert!(
            is_near(temperature, 1.0) && is_near(conductivity, 8.0 * 0.171_572_875),
            "{temperature:?} {conductivity:?}"
        );
        assert!(is_near(heat.temperature(0), 1.156_854_249) && is_near(heat.temperature(7), 0.843_145_750));
        let currents: Vec<f64> = (0..7).map(|contact| heat.current(contact).mean).collect();
        assert!(currents.iter().all(|found| (found / current.mean - 1.0).abs() < 0.02), "{currents:?}");
        assert!(heat.memory_s() > 0.1 && heat.memory_s() < 50.0, "{}", heat.memory_s());
    }

    /// In a harmonic ring with baths on all beads, all waves forget their phases at one rate γ: `<J(0)·J(t)> = e^(−γ·t)·T²·Σ v²` with the group velocities
    /// v = c·cos(q/2) of all waves but that of the whole ring, whose sum of squares is c²·(N/2 − 1).
    #[test]
    fn a_harmonic_ring_in_baths_has_the_conductivity_of_its_waves() {
        let (gamma, beads) = (0.5, 12.0);
        let manifest = manifest(
            "seed = 8\n[chain]\nbeads = 12\nbead_mass_kg = 1.0\nbonds = { linear = 1.0 }\n[ends]\nleft = \"periodic\"\nright = \"periodic\"\n\
             [[bath]]\nbeads = \"..\"\ntemperature_j = 0.7\nfriction_per_s = 0.5\n[time]\nduration_s = 40000\ndt_s = 0.1\n",
        );
        let mut settings = Settings::default();
        settings.set(&OFFER.settings[0], vec!["10".to_owned()]).unwrap();
        let heat = of_run(&manifest, &settings, |step| step > 1_000 && step.is_multiple_of(2));
        let points = heat.fluctuations();
        assert_eq!(points.len(), 51);
        for (lag_s, product, conductivity) in &points {
            let factor = 0.5 - 1.0 / beads;
            let exact = factor * (1.0 - (-gamma * lag_s).exp()) / gamma;
            // trapezia are too large by γ²·Δ²/12, a thousandth
            let room = |found: &[f64; 2], exact: f64| 4.0 * found[1] + 2e-3 * exact;
            assert!(
                (conductivity[0] - exact).abs() <= room(conductivity, exact),
                "{lag_s} {conductivity:?} {exact}"
            );
            let exact = factor * beads * 0.49 * (-gamma * lag_s).exp();
            assert!((product[0] - exact).abs() < room(product, exact), "{lag_s} {product:?} {exact}");
        }
        let last = points[50].2;
        assert!(last[1] < 0.1 * last[0], "{last:?}");
    }

    /// A wave that runs around a ring carries its energy at its group velocity, and the current of all contacts does not change.
    #[test]
    fn the_current_of_a_harmonic_ring_is_energy_times_group_velocity() {
        let manifest = manifest(
            "[chain]\nbeads = 9\nbead_mass_kg = 1.0\nbonds = { linear = 1.0 }\n[ends]\nleft = \"periodic\"\nright = \"periodic\"\n\
             [initial]\nplane_wave = { cycles = 2, displacement_m = 0.1, velocity_m_s = 0.12855752193730785 }\n[time]\nduration_s = 20\ndt_s = 0.01\n",
        );
        let settings = Settings::default();
        let heat = Heat::begin(&Beginning::whole("heat", &manifest, &settings)).unwrap();
        let q = std::f64::consts::TAU * 2.0 / 9.0;
        let energy_j = 0.5 * 9.0 * (0.1 * 2.0 * (0.5 * q).sin()).powi(2);
        let mut state = ChainState::initial(&manifest.physics);
        let mut integrator = Integrator::new(&manifest.physics);
        for _ in 0..2_000 {
            integrator.step(&mut state);
            let frame = state.as_frame(&manifest, 0);
            let current_w: f64 = (0..9).map(|c| heat.current_w(c, &frame, 0.0)).sum();
            assert!((current_w.abs() - energy_j * (0.5 * q).cos()).abs() < 1e-4 * energy_j, "{current_w}");
        }
    }

    /// Two beads that nothing holds have one temperature, p²·(1/m₁ + 1/m₂) with their momenta ±p about the centre of mass, however fast that moves.
    #[test]
    fn a_drift_is_no_heat() {
        for drift_m_s in [0.0, 3.0] {
            let manifest = manifest(&format!(
                "[chain]\nbeads = 2\nbead_mass_kg = 1.0\nmasses = {{ list_kg = [1.0, 4.0] }}\nbonds = {{ linear = 1.0 }}\n\
                 [on_site]\ndrag_n_s_per_m = 0.0\n[initial]\ndisplacements_m = [0.5, 0.0]\n\
                 velocities_m_s = [{:?}, {:?}]\n[time]\nduration_s = 0.1\ndt_s = 0.1\n",
                drift_m_s + 0.8,
                drift_m_s - 0.2
            ));
            let mut heat = of_run(&manifest, &Settings::default(), |_| false);
            let state = ChainState::initial(&manifest.physics);
            heat.observe(&state.as_frame(&manifest, 0), &mut LastRow::default());
            let found = [heat.temperature(0), heat.temperature(1), heat.current(0)].map(|found| found.mean);
            for (found, exact) in found.into_iter().zip([0.8, 0.8, 0.15]) {
                assert!((found - exact).abs() < 1e-14, "{drift_m_s}: {found} {exact}");
            }
            assert!(!heat.is_driven);
        }
    }

    /// A bead that a drive moves has no temperature, and does not count in that of the chain.
    #[test]
    fn a_bead_that_is_moved_is_neither_hot_nor_cold() {
        let manifest = manifest(
            "[chain]\nbeads = 3\nbead_mass_kg = 1.0\nbonds = { linear = 1.0 }\n[initial]\nvelocities_m_s = [0.0, 1.0, 2.0]\n\
             [[drive]]\nbead = 0\nvelocity_m_s = 5.0\n[time]\nduration_s = 0.1\ndt_s = 0.1\n",
        );
        let mut heat = of_run(&manifest, &Settings::default(), |_| false);
        heat.observe(&ChainState::initial(&manifest.physics).as_frame(&manifest, 0), &mut LastRow::default());
        assert_eq!(heat.rows.estimate(1).mean, 2.5);
        assert!(heat.temperature(0).mean.is_nan() && heat.temperature(1).mean == 1.0);
    }

    /// One number is told where there is one: in an open chain between two baths with nothing else between them, and in equilibrium.
    #[test]
    fn a_ring_and_several_baths_have_no_one_current() {
        let bath = |beads: &str, t: f64| {
            format!("[[bath]]\nbeads = \"{beads}\"\ntemperature_j = {t:?}\nfriction_per_s = 0.5\n")
        };
        let (hot, middle, cold) = (bath("0..2", 1.5), bath("3..5", 1.0), bath("-2..", 0.5));
        let (ring, open) = ("periodic", "fixed");
        let sine = "{ sine = { amplitude = 0.1, frequency_hz = 0.2 } }\n";
        let force = format!("[[drive]]\nbead = 4\nforce_n = {sine}");
        let wall = format!("[[drive]]\nwall = \"left\"\ndisplacement_m = {sine}");
        let drag = "[on_site]\ndrag_n_s_per_m = 0.1\n[initial]\nthermal = { energy_j = 1.0 }\n";
        let frozen = bath("..", 0.0) + "[striker]\nbead = 0\nvelocity_m_s = 1.0\n";
        for (ends, baths, has_current, has_fluctuations) in [
            (ring, [&*hot, &*cold].concat(), false, false),
            (open, [&*hot, &*middle, &*cold].concat(), false, false),
            (open, [&*hot, &*cold].concat(), true, false),
            (ring, [&*hot, &*cold.replace("0.5\nf", "1.5\nf")].concat(), true, true),
            (ring, bath("..", 1.0), true, true),
            (open, [&*hot, &*cold, &*force].concat(), false, false),
            (open, drag.to_owned(), false, false),
            (open, [&*hot, &*cold, &*wall].concat(), true, false),
            (open, bath("..", 1.0) + &wall, true, false),
            (open, drag.replace("on_site]\ndrag", "damping]\nviscous"), false, false),
            (open, frozen, true, false),
        ] {
            let manifest = manifest(&format!(
                "[chain]\nbeads = 8\nbead_mass_kg = 1.0\nbonds = {{ linear = 1.0 }}\n[ends]\nleft = \"{ends}\"\nright = \"{ends}\"\n\
                 {baths}[time]\nduration_s = 40\ndt_s = 0.1\n"
            ));
            let mut heat = of_run(&manifest, &Settings::default(), |_| true);
            heat.wants_fluctuations = true;
            heat.finish(&mut LastRow::default()).unwrap();
            let told = heat.report().unwrap();
            let is_told = |name: &str| told.results[name].is_f64();
            let has_conductivity = has_current && !has_fluctuations && baths.contains(&*cold);
            assert_eq!(is_told("current_w"), has_current, "{ends} {baths}");
            assert_eq!(is_told("conductivity_per_s"), has_conductivity, "{ends} {baths}");
            assert_eq!(is_told("green_kubo_per_s"), has_fluctuations, "{ends} {baths}");
            let says = |text: &str| told.notices.iter().any(|notice| notice.contains(text));
            assert_eq!(says("--profile"), !has_current, "{:?}", told.notices);
            assert_eq!(says("equilibrium"), !has_fluctuations, "{:?}", told.notices);
            assert!(is_told("temperature_j") && !says("too few frames"), "{:?}", told.notices);
        }
    }

    /// A chain that warms up for longer than it is looked at has not forgotten its beginning: this is told, and has no number.
    #[test]
    fn a_run_that_is_too_short_says_so() {
        let manifest = manifest(
            "[chain]\nbeads = 4\nbead_mass_kg = 1.0\nbonds = { linear = 1.0 }\n[ends]\nleft = \"fixed\"\n\
             [[bath]]\ntemperature_j = 1.0\nfriction_per_s = 0.005\n[time]\nduration_s = 200\ndt_s = 0.1\n",
        );
        let mut heat = of_run(&manifest, &Settings::default(), |_| true);
        assert!(heat.rows.estimate(1).memory_frames.is_infinite(), "{:?}", heat.rows.estimate(1));
        let notices = heat.report().unwrap().notices;
        assert!(notices.iter().any(|notice| notice.contains("memory of the temperature")), "{notices:?}");
    }

    /// Beads outside of both baths have no current, and do not count.
    #[test]
    fn the_current_is_that_between_the_baths() {
        let manifest = manifest(
            "[chain]\nbeads = 8\nbead_mass_kg = 1.0\nbonds = { linear = 1.0 }\n[time]\nduration_s = 1.0\n\
             [[bath]]\nbeads = 2\ntemperature_j = 1.5\nfriction_per_s = 0.5\n\
             [[bath]]\nbeads = \"5..7\"\ntemperature_j = 0.5\nfriction_per_s = 0.5\n",
        );
        let settings = Settings::default();
        let heat = Heat::begin(&Beginning::whole("heat", &manifest, &settings)).unwrap();
        assert_eq!((&heat.inner[..], heat.conductivity_per_j), (&[2, 3, 4][..], Some(5.0)));
    }
}

//! The numbers of `tests/reference` about the paper's runs.

use crate::chains::{final_state, physics};
use crate::table::Table;
use producer::integrator::Integrator;
use producer::state::ChainState;
use schemas::config::Impurity;
use schemas::manifest::Physics;

/// A quantity at every step with its rate of change, both exact to the method, and the cubic between.
#[derive(Debug, Default)]
struct History {
    value: Vec<f64>,
    rate: Vec<f64>,
}

impl History {
    fn push(&mut self, value: f64, rate: f64) {
        self.value.push(value);
        self.rate.push(rate);
    }

    /// The value at `steps` steps, by Hermite's cubic: good to `(dt/T)⁴/384` of the scale of the fourth
    /// derivative.
    fn at(&self, dt_s: f64, steps: f64) -> f64 {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a step number")]
        let step = (steps as usize).min(self.value.len() - 2);
        let s = steps - step as f64;
        let (left, right) = (self.value[step], self.value[step + 1]);
        let (left_rise, right_rise) = (self.rate[step] * dt_s, self.rate[step + 1] * dt_s);
        let rest = 1.0 - s;
        left * rest * rest * (1.0 + 2.0 * s) + right * s * s * (3.0 - 2.0 * s) + left_rise * s * rest * rest
            - right_rise * s * s * rest
    }

    /// The largest value and its time in steps, where the parabola through three rates crosses zero.
    fn peak(&self, dt_s: f64) -> (f64, f64) {
        let largest = self.value.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1)).unwrap().0;
        let [before, here, after] = [-1, 0, 1].map(|k| self.rate[largest.checked_add_signed(k).unwrap()]);
        let (slope, curvature) = (0.5 * (after - before), after - 2.0 * here + before);
        let mut offset = 0.0;
        for _ in 0..5 {
            offset = -(here + 0.5 * curvature * offset * offset) / slope;
        }
        let steps = largest as f64 + offset;
        (self.at(dt_s, steps), steps)
    }

    /// The time in steps between the crossings of half the largest value, before and after it.
    fn full_width_at_half_maximum(&self, dt_s: f64) -> f64 {
        let (peak, peak_steps) = self.peak(dt_s);
        let crossing = |mut above: f64, mut below: f64| {
            for _ in 0..60 {
                let middle = 0.5 * (above + below);
                if self.at(dt_s, middle) > 0.5 * peak { above = middle } else { below = middle }
            }
            above
        };
        crossing(peak_steps, (self.value.len() - 1) as f64) - crossing(peak_steps, 0.0)
    }
}

/// The solitary wave of a homogeneous chain as contact 100 feels it.
#[test]
fn solitary_wave_passes_contact_100_as_the_reference_says() {
    for row in Table::read("homogeneous-contact-100").rows() {
        let alpha = row.number("alpha");
        // 0.005 T: the interpolation and the method are then both good to 1e-8
        let fraction = 0.005;
        let physics = physics(200, alpha, fraction, 1, |_| {});
        let chain = physics.chain();
        let mut integrator = Integrator::new(&physics);
        let mut state = ChainState::initial(&physics);
        let mut contacts = [94, 100, 105].map(|contact| (contact, History::default()));
        let mut bead = History::default();
        // until the wave, faster than 0.7 beads in T whatever α is, has long passed contact 105
        while state.step < 35_000 && state.v_m_s[115] < 0.05 * physics.striker.velocity_m_s {
            integrator.step(&mut state);
            for (contact, history) in &mut contacts {
                let rate = state.v_m_s[*contact] - state.v_m_s[*contact + 1];
                history.push(chain.overlap_m(&state.u_m, *contact), rate);
            }
            let force = |c: usize| chain.law.force(chain.stiffness[c], chain.overlap_m(&state.u_m, c));
            bead.push(state.v_m_s[100], (force(99) - force(100)) / chain.mass_kg[100]);
        }
        let dt_s = physics.dt_s;
        let [at_94, at_100, at_105] = contacts.map(|(_, history)| history);
        let (peak_m, peak_steps) = at_100.peak(dt_s);
        let found = [
            // the first value is that of step 1
            ("t_peak_s", (peak_steps + 1.0) * dt_s),
            ("overlap_peak_m", peak_m),
            ("overlap_fwhm_s", at_100.full_width_at_half_maximum(dt_s) * dt_s),
            ("speed_beads_per_s", 11.0 / ((at_105.peak(dt_s).1 - at_94.peak(dt_s).1) * dt_s)),
            ("v_max_m_s", bead.peak(dt_s).0),
        ];
        // what the reference claims for itself
        let tolerance = if alpha == 1.01 { 1e-5 } else { 1e-6 };
        for (name, value) in found {
            let error = value / row.number(name) - 1.0;
            assert!(error.abs() < tolerance, "α = {alpha}: {name} is {value:e}, off by {error:e}");
        }
    }
}

/// The energy (J) left of bead 500 and right of it. That of each contact beside it belongs half to its side
/// and half to the bead, whose own energy belongs to neither side.
fn energy_beside_bead_500(physics: &Physics, state: &ChainState) -> (f64, f64) {
    let chain = physics.chain();
    let mut contact_energy_j = vec![0.0; chain.contact_count()];
    chain.contact_energies_j(&state.u_m, &mut contact_energy_j);
    let left = contact_energy_j[..499].iter().sum::<f64>() + 0.5 * contact_energy_j[499];
    let right = contact_energy_j[501..].iter().sum::<f64>() + 0.5 * contact_energy_j[500];
    (left + chain.kinetic_j(&state.v_m_s, 0..500), right + chain.kinetic_j(&state.v_m_s, 501..1000))
}

/// After 1000 T the impurity has passed on what it had, and the transmitted wave is still in the chain.
#[test]
fn an_impurity_reflects_as_much_energy_as_the_reference_says() {
    for row in Table::read("reflected-energy").rows() {
        let (alpha, mass_g) = (row.number("alpha"), row.number("impurity_mass_g"));
        let physics = physics(1000, alpha, 0.02, 50_000, |config| {
            config.chain.impurities = vec![Impurity { bead: 500, mass_kg: mass_g * 1e-3 }];
        });
        let (left, right) = energy_beside_bead_500(&physics, &final_state(&physics));
        let total = physics.initial_energy().total_j();
        let (over_total, over_transmitted) = (left / total, left / right);
        // what the reference claims for itself: the last of the energy leaves the impurity slowly
        let off = (over_total - row.number("reflected_over_total"))
            .abs()
            .max((over_transmitted - row.number("reflected_over_transmitted")).abs());
        assert!(off < 3e-5, "α = {alpha}, {mass_g} g: {over_total}, {over_transmitted}, off by {off:e}");
    }
}

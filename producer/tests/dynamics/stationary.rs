//! Harmonic chains between two heat baths, and the stationary state of their steps. The figure of these averages is drawn by the same lines.
#![allow(clippy::unwrap_used, reason = "tests")]

use producer::integrator::Integrator;
use producer::state::ChainState;
use schemas::config::RunConfig;
use schemas::manifest::Physics;

pub(crate) fn physics(toml: &str) -> Physics {
    Physics::resolve(&RunConfig::from_toml(toml).unwrap()).unwrap()
}

/// Eight beads of 1 kg with bonds of 1 N/m between walls; `baths` at their ends.
pub(crate) fn harmonic(method: &str, dt_s: f64, seed: u64, baths: &str) -> Physics {
    physics(&format!(
        "seed = {seed}\n[chain]\nbeads = 8\nbead_mass_kg = 1.0\nbonds = {{ linear = 1.0 }}\n[ends]\nleft = \"fixed\"\nright = \"fixed\"\n\
         [integrator]\nmethod = \"{method}\"\n[initial]\nmode = {{ number = 1, displacement_m = 1.0 }}\n\
         [time]\nduration_s = 8000\ndt_s = {dt_s}\n{baths}"
    ))
}

pub(crate) fn between(friction: f64) -> String {
    let bath = |bead: i64, temperature: f64| {
        format!("[[bath]]\nbeads = {bead}\ntemperature_j = {temperature:?}\nfriction_per_s = {friction:?}\n")
    };
    bath(0, 1.5) + &bath(-1, 0.5)
}

/// A square matrix, row after row.
#[derive(Debug, Clone)]
pub(crate) struct Matrix(pub(crate) Vec<[f64; 16]>);

impl Matrix {
    fn of(entry: impl Fn(usize, usize) -> f64) -> Self {
        Self((0..16).map(|i| std::array::from_fn(|j| entry(i, j))).collect())
    }

    fn times(&self, other: &Self) -> Self {
        Self::of(|i, j| (0..16).map(|k| self.0[i][k] * other.0[k][j]).sum())
    }

    fn turned(&self) -> Self {
        Self::of(|i, j| self.0[j][i])
    }

    fn plus(&self, other: &Self) -> Self {
        Self::of(|i, j| self.0[i][j] + other.0[i][j])
    }
}

/// One step of a run from a displacement or velocity of 1 of each bead: the matrix of a linear step.
fn matrix_of_step(physics: &Physics) -> Matrix {
    let columns: Vec<Vec<f64>> = (0..16)
        .map(|column| {
            let unit: Vec<f64> = (0..16).map(|i| f64::from(u8::from(i == column))).collect();
            let mut state = ChainState::starting_at(physics, &unit[..8], &unit[8..]);
            Integrator::new(physics).step(&mut state);
            [&state.u_m[..], &state.v_m_s[..]].concat()
        })
        .collect();
    Matrix::of(|i, j| columns[j][i])
}

/// The covariances of the stationary state of steps with baths of these temperatures at both ends: no sampling, so no error but that of the steps.
pub(crate) fn stationary(method: &str, dt_s: f64, friction: f64, [hot, cold]: [f64; 2]) -> Matrix {
    let alone = matrix_of_step(&harmonic(method, dt_s, 0, ""));
    let decay = (-0.5 * friction * dt_s).exp();
    let at_bath = |i: usize| i == 8 || i == 15;
    let slowed = Matrix::of(|i, j| {
        if i != j {
            0.0
        } else if at_bath(i) {
            decay
        } else {
            1.0
        }
    });
    let noise = Matrix::of(|i, j| {
        let variance = 1.0 - decay * decay;
        if i != j || !at_bath(i) { 0.0 } else { variance * if i == 8 { hot } else { cold } }
    });
    let late = slowed.times(&alone);
    let mut map = late.times(&slowed);
    // without temperature the run's own step is this matrix
    let cold = between(friction).replace("1.5", "0.0").replace("0.5\nf", "0.0\nf");
    let own = matrix_of_step(&harmonic(method, dt_s, 0, &cold));
    assert!((0..256).all(|at| (own.0[at / 16][at % 16] - map.0[at / 16][at % 16]).abs() < 1e-14));
    let mut sum = late.times(&noise).times(&late.turned()).plus(&noise);
    for _ in 0..24 {
        sum = map.times(&sum).times(&map.turned()).plus(&sum);
        map = map.times(&map);
    }
    sum
}

//! How much work the methods take for how small an error, and what their default steps give.
//!
//! ```text
//! cargo run --release -p beadline-bench --example work_precision -- figure docs/img    # work-precision.svg and .png, and the numbers
//! cargo run --release -p beadline-bench --example work_precision -- defaults           # max|ΔE/E| at the default steps
//! cargo run --release -p beadline-bench --example work_precision -- times              # the time of a step, against each other
//! ```
#![expect(clippy::print_stdout, reason = "its results go to stdout")]

use anyhow::{Context, Result, bail};
use figure::{Axis, Colour, Curve, Figure, Options, Panel, Size, Stroke};
use producer::energy_error::energy_error;
use producer::integrator::Integrator;
use producer::state::ChainState;
use schemas::config::{Impurity, RunConfig};
use schemas::manifest::Physics;
use schemas::method::Method;
use schemas::presets::{PRESETS, Preset};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// How the methods are drawn.
const LOOKS: [(Method, Colour, Stroke); 3] = [
    (Method::VelocityVerlet, Colour::Blue, Stroke::Solid),
    (Method::Rkn4, Colour::Vermillion, Stroke::Solid),
    (Method::Gear5, Colour::Black, Stroke::Dashed),
];

/// Length of the runs of the figure (T).
const DURATION_T: f64 = 40.0;

fn main() -> Result<()> {
    let mut arguments = std::env::args_os().skip(1);
    match arguments.next().as_deref().and_then(|word| word.to_str()) {
        Some("figure") => figure(&arguments.next().map_or_else(|| PathBuf::from("."), PathBuf::from)),
        Some("defaults") => defaults(),
        Some("times") => times(),
        _ => bail!("say `figure DIR`, `defaults` or `times`"),
    }
}

/// 40 beads of 1 g, k = 1e7 N·m^−α, bead 0 at 5 m/s, bead 20 of 0.6 g.
fn chain(alpha: f64, method: Method) -> Result<RunConfig> {
    let mut config = Preset::find("homogeneous").context("a preset")?.config();
    config.chain.beads = 40;
    config.chain.impurities = vec![Impurity { bead: 20, mass_kg: 0.6e-3 }];
    config.chain.alpha = Some(alpha);
    config.integrator.method = method;
    Ok(config)
}

/// The run of `config` over `duration_t` T in steps of `dt_t` T, both made to fit.
fn in_collision_times(mut config: RunConfig, duration_t: f64, dt_t: f64) -> Result<Physics> {
    let time_s = Physics::resolve(&config)?.scales().time_s;
    let steps = (duration_t / dt_t).round();
    config.time.dt_s = Some(duration_t / steps * time_s);
    config.time.duration_s = duration_t * time_s;
    Ok(Physics::resolve(&config)?)
}

fn final_state(physics: &Physics) -> ChainState {
    let mut state = ChainState::initial(physics);
    let mut integrator = Integrator::new(physics);
    while state.step < physics.step_count {
        integrator.step(&mut state);
    }
    state
}

/// The largest difference of two states: of displacements in L, of velocities in v0.
fn difference(physics: &Physics, state: &ChainState, reference: &ChainState) -> f64 {
    let scales = physics.scales();
    let largest = |a: &[f64], b: &[f64], unit: f64| {
        a.iter().zip(b).fold(0.0_f64, |largest, (a, b)| largest.max((a - b).abs() / unit))
    };
    let of_u = largest(&state.u_m, &reference.u_m, scales.length_m);
    of_u.max(largest(&state.v_m_s, &reference.v_m_s, scales.speed_m_s()))
}

/// One method at one cost: root mean squares over eight steps of nearly that length, because where in a step
/// a contact opens is a matter of luck.
struct Measured {
    evaluations_per_t: f64,
    energy: f64,
    state: f64,
}

fn measure(alpha: f64, method: Method, dt_t: f64, reference: &ChainState) -> Result<Measured> {
    let (mut energy, mut state) = (0.0, 0.0);
    for phase in 0..8 {
        let physics =
            in_collision_times(chain(alpha, method)?, DURATION_T, dt_t * (1.0 + 0.01 * f64::from(phase)))?;
        energy += energy_error(&physics, u64::MAX, 1, |_| {}).largest.powi(2);
        state += difference(&physics, &final_state(&physics), reference).powi(2);
    }
    let evaluations_per_t = f64::from(method.force_evaluations_per_step()) / dt_t;
    Ok(Measured { evaluations_per_t, energy: (energy / 8.0).sqrt(), state: (state / 8.0).sqrt() })
}

fn figure(folder: &Path) -> Result<()> {
    let mut figure = Figure::new()
        .caption(format!(
            "40 beads, bead 20 of 0.6 m, over {DURATION_T} T; root mean square of 8 runs; errors of the state \
             against rkn4 at T/8192: displacements in L, velocities in v₀"
        ))
        .shared_x();
    println!("alpha method evaluations_per_T dt_T max_energy_error state_error");
    for alpha in [1.1, 1.5, 3.0] {
        let reference =
            final_state(&in_collision_times(chain(alpha, Method::Rkn4)?, DURATION_T, 1.0 / 8192.0)?);
        let mut energies = panel("max |ΔE/E|").note(format!("α = {alpha}"));
        let mut states = panel("error of the state").note(format!("α = {alpha}"));
        for (method, colour, stroke) in LOOKS {
            let mut rows = Vec::new();
            for halvings in 0..8 {
                let dt_t = f64::from(method.force_evaluations_per_step()) / (40.0 * f64::from(1 << halvings));
                let row = measure(alpha, method, dt_t, &reference)?;
                let (cost, energy, state) = (row.evaluations_per_t, row.energy, row.state);
                println!("{alpha} {method} {cost} {dt_t:.6} {energy:.2e} {state:.2e}");
                rows.push(row);
            }
            // one legend is enough
            let label = if alpha == 1.1 { method.as_str() } else { "" };
            let curve = |value: fn(&Measured) -> f64| {
                let points: Vec<_> = rows.iter().map(|row| (row.evaluations_per_t, value(row))).collect();
                Curve::line(label, points).colour(colour).stroke(stroke)
            };
            energies = energies.curve(curve(|row| row.energy));
            states = states.curve(curve(|row| row.state));
        }
        figure = figure.panel(energies);
        if alpha == 1.5 {
            figure = figure.panel(states);
        }
    }
    for name in ["work-precision.svg", "work-precision.png"] {
        figure.write(&folder.join(name), Options { size: Size::Page, dpi: 150.0 }, true)?;
    }
    Ok(())
}

fn panel(quantity: &str) -> Panel {
    Panel::new()
        .x_axis(Axis::new("force evaluations per T").log())
        .y_axis(Axis::new(quantity).log())
        .height(0.7)
}

/// max|ΔE/E| at the default steps: the presets over the collision times they have at α = 1.5, at most 220, with at
/// most 100 beads before the impurity and 100 after it.
fn defaults() -> Result<()> {
    println!("method alpha {}", PRESETS.map(|preset| preset.name).join(" "));
    for method in Method::ALL {
        for alpha in [1.0, 1.1, 1.2, 1.3, 1.4, 1.5, 1.75, 2.0, 2.5, 3.0, 5.0, 10.0] {
            print!("{method} {alpha}");
            for preset in PRESETS {
                let mut config = preset.config();
                let duration_t = config.time.duration_s / Physics::resolve(&config)?.scales().time_s;
                config.integrator.method = method;
                config.chain.alpha = Some(alpha);
                config.chain.beads = config.chain.beads.min(200);
                config
                    .chain
                    .impurities
                    .iter_mut()
                    .for_each(|impurity| impurity.bead = impurity.bead.min(100));
                config.time.duration_s = duration_t.min(220.0) * Physics::resolve(&config)?.scales().time_s;
                let physics = Physics::resolve(&config)?;
                print!(" {:.1e}", energy_error(&physics, u64::MAX, 4, |_| {}).largest);
            }
            println!();
        }
    }
    Ok(())
}

/// The time of a step of 1000 beads in motion, the best of ten tries, in units of velocity Verlet's.
fn times() -> Result<()> {
    for alpha in [1.5, 1.3] {
        let mut first = None;
        for method in Method::ALL {
            let mut config = PRESETS[0].config();
            config.chain.alpha = Some(alpha);
            config.integrator.method = method;
            let physics = in_collision_times(config, 1e4, 0.02)?;
            let (mut state, mut integrator) = (ChainState::initial(&physics), Integrator::new(&physics));
            let mut best = f64::INFINITY;
            while state.step < 50_000 {
                integrator.step(&mut state);
            }
            for _ in 0..10 {
                let start = Instant::now();
                for _ in 0..1000 {
                    integrator.step(&mut state);
                }
                best = best.min(start.elapsed().as_secs_f64());
            }
            let unit = *first.get_or_insert(best);
            println!("alpha = {alpha}, {method}: {:.2}", best / unit);
        }
    }
    Ok(())
}

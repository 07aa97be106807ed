//! Draws figures of `docs/guide`: what the dynamics does with loads, unequal beads, damping and heat baths, and what theory says.
//!
//! `cargo run -p beadline-bench --example beyond_the_paper -- docs/img/examples`

#[path = "../../../producer/tests/dynamics/stationary.rs"]
mod stationary;

use anyhow::Context;
use figure::{Axis, Colour, Curve, Figure, Options, Panel, Stroke};
use producer::integrator::Integrator;
use producer::state::ChainState;
use schemas::config::{MassRule, RunConfig};
use schemas::manifest::{Origin, Physics, RunManifest};
use schemas::presets::Preset;
use stationary::stationary;
use std::f64::consts::PI;
use std::path::PathBuf;

fn main() -> anyhow::Result<()> {
    let folder = std::env::args_os().nth(1).map_or_else(std::env::temp_dir, PathBuf::from);
    std::fs::create_dir_all(&folder).with_context(|| folder.display().to_string())?;
    for (name, figure) in [
        ("gravity", gravity()?),
        ("precompressed", precompressed()?),
        ("dimer", dimer()?),
        ("tapered", tapered()?),
        ("damped", damped()?),
        ("averages", averages()),
    ] {
        figure.write(&folder.join(format!("{name}.png")), Options::default(), true)?;
    }
    Ok(())
}

fn preset(name: &str) -> anyhow::Result<RunConfig> {
    Ok(Preset::find(name).with_context(|| format!("no preset {name}"))?.config())
}

fn manifest(config: &RunConfig) -> anyhow::Result<RunManifest> {
    let origin = Origin { program: "beadline".to_owned(), host: String::new(), started_unix_ns: 0 };
    Ok(RunManifest::new(config, "run", origin)?)
}

/// When each bead moved fastest for the first time (s), and how fast (m/s); without beads that the front did not reach.
fn crests(physics: &Physics) -> Vec<(f64, f64)> {
    let mut crests = vec![None; usize::try_from(physics.beads).unwrap_or(0)];
    let mut integrator = Integrator::new(physics);
    let mut state = ChainState::initial(physics);
    let mut before = state.v_m_s.clone();
    let threshold = 1e-3 * physics.striker.velocity_m_s;
    for _ in 0..physics.step_count {
        integrator.step(&mut state);
        for ((crest, before), v) in crests.iter_mut().zip(before.iter_mut()).zip(state.v_m_s.iter()) {
            if crest.is_none() && *before > threshold && v < before {
                *crest = Some((physics.time_s(state.step - 1), *before));
            }
            *before = *v;
        }
    }
    crests.into_iter().map_while(|crest| crest).collect()
}

/// The front of a weak kick under gravity, with the local speed of sound and the Airy function's lag.
fn gravity() -> anyhow::Result<Figure> {
    let config = preset("gravity")?;
    let manifest = manifest(&config)?;
    let physics = &manifest.physics;
    let chain = physics.chain();
    let crests = crests(physics);
    let (mut sound_s, mut cubes) = (0.0, 0.0_f64);
    let (mut expected, mut falling) = (Vec::new(), Vec::new());
    for (depth, (k, rest_m)) in chain.stiffness.iter().zip(&chain.rest_overlap_m).enumerate() {
        let depth = depth as f64 + 1.0;
        expected.push(((sound_s + 0.5094 * cubes.cbrt()) * 1e3, depth));
        let speed = (1.5 * k * rest_m.sqrt() / physics.bead_mass_kg).sqrt();
        sound_s += 1.0 / speed;
        cubes += speed.powi(-3);
        falling.push((depth, depth.powf(-0.25)));
    }
    let depths = || crests.iter().enumerate().map(|(bead, crest)| (bead as f64 + 1.0, crest));
    let v0 = physics.striker.velocity_m_s;
    // at the tenth bead the crest is as wide as it is deep
    let level = crests[99].1 / v0 / 100.0_f64.powf(-0.25);
    let front = Panel::new()
        .x_axis("time (ms)")
        .y_axis(Axis::new("depth (beads)").reversed())
        .line("crest", depths().step_by(10).map(|(depth, crest)| (crest.0 * 1e3, depth)))
        .curve(
            Curve::line("Σ 1/c + lag, c(z) ~ z^{1/6}", expected).stroke(Stroke::Dashed).colour(Colour::Black),
        );
    let height = Panel::new()
        .x_axis(Axis::new("depth z (beads)").log())
        .y_axis(Axis::new("crest, v/v_{0}").log())
        .line("crest", depths().map(|(depth, crest)| (depth, crest.1 / v0)))
        .curve(
            Curve::line("z^{−1/4}", falling.into_iter().skip(9).map(|(z, law)| (z, level * law)))
                .stroke(Stroke::Dashed)
                .colour(Colour::Black),
        );
    Ok(Figure::new().caption(plots::caption(&manifest)).panel(front).panel(height))
}

/// `J_order(x)` by the trapezoidal rule.
fn bessel(order: f64, x: f64) -> f64 {
    let points = 1000;
    let angles = (0..points).map(|i| PI * (f64::from(i) + 0.5) / f64::from(points));
    angles.map(|t| (order * t - x * t.sin()).cos()).sum::<f64>() / f64::from(points)
}

/// A pulse in a pressed chain beside that of the lattice of springs.
fn precompressed() -> anyhow::Result<Figure> {
    let config = preset("precompressed")?;
    let manifest = manifest(&config)?;
    let physics = &manifest.physics;
    let rest_m = physics.chain().rest_overlap_m[0];
    let speed = (1.5 * physics.stiffness * rest_m.sqrt() / physics.bead_mass_kg).sqrt();
    let mut integrator = Integrator::new(physics);
    let mut state = ChainState::initial(physics);
    while physics.time_s(state.step) * speed < 150.0 {
        integrator.step(&mut state);
    }
    let (v0, argument) = (physics.striker.velocity_m_s, 2.0 * speed * physics.time_s(state.step));
    let theory = (0..170).map(|bead| {
        let order = 2.0 * f64::from(bead);
        (f64::from(bead), bessel(order, argument) + bessel(order + 2.0, argument))
    });
    let panel = Panel::new()
        .x_axis(Axis::new("bead").limits(0.0, 170.0))
        .y_axis("v/v_{0}")
        .line("beads", state.v_m_s.iter().enumerate().map(|(bead, v)| (bead as f64, v / v0)))
        .curve(Curve::points("J_{2n}(2ct) + J_{2n+2}(2ct)", theory).colour(Colour::Black))
        .vertical("ct", speed * physics.time_s(state.step));
    Ok(Figure::new().caption(plots::caption(&manifest)).panel(panel))
}

/// How much a pulse loses over 20 pairs, for many mass ratios.
fn dimer() -> anyhow::Result<Figure> {
    let mut config = preset("dimer")?;
    config.chain.beads = 84;
    let mut losses = Vec::new();
    for step in 0..=368_u32 {
        let ratio = 0.0801 + 0.0025 * f64::from(step);
        config.chain.masses = MassRule::PatternKg(vec![1e-3, ratio * 1e-3]);
        config.time.duration_s = 0.011;
        let crests = crests(&Physics::resolve(&config)?);
        losses.push((ratio, 1.0 - (crests[80].1 / crests[40].1).powi(2)));
    }
    let mut panel = Panel::new()
        .x_axis("mass of light over heavy bead")
        .y_axis(Axis::new("energy lost over 20 pairs").log().limits(1e-5, 1.0))
        .line("", losses);
    for (i, ratio) in [0.0901, 0.1548, 0.3428].into_iter().enumerate() {
        panel = panel.vertical(if i == 0 { "published solitary waves" } else { "" }, ratio);
    }
    let caption = "dimer: N = 84, masses of 1 g and of this ratio to it in turn, α = 1.5, k = 10^{7} N m^{−α}, \
                   v_{0} = 5 m/s on bead 0; from pair 20 to pair 40; rkn4, default step";
    Ok(Figure::new().caption(caption).panel(panel))
}

/// The largest velocity of each bead of a tapered chain.
fn tapered() -> anyhow::Result<Figure> {
    let config = preset("tapered")?;
    let manifest = manifest(&config)?;
    let physics = &manifest.physics;
    let mass_kg = physics.chain().mass_kg;
    let crests = crests(physics);
    let level = crests[20].1 * mass_kg[20].sqrt();
    let theory = mass_kg.iter().map(|mass_kg| (mass_kg * 1e3, level / mass_kg.sqrt()));
    let panel = Panel::new()
        .x_axis(Axis::new("mass of the bead (g)").log().reversed())
        .y_axis(Axis::new("largest velocity (m/s)").log())
        .curve(Curve::line("crest", mass_kg.iter().zip(&crests).skip(1).map(|(m, crest)| (m * 1e3, crest.1))))
        .curve(Curve::line("m^{−1/2}", theory).stroke(Stroke::Dashed).colour(Colour::Black));
    Ok(Figure::new().caption(plots::caption(&manifest)).panel(panel))
}

/// The energy of a damped chain, and what its contacts have dissipated.
fn damped() -> anyhow::Result<Figure> {
    let config = preset("damped")?;
    let manifest = manifest(&config)?;
    let physics = &manifest.physics;
    let chain = physics.chain();
    let initial_j = physics.initial_energy().total_j();
    let mut contact_j = vec![0.0; chain.contact_count()];
    let mut integrator = Integrator::new(physics);
    let mut state = ChainState::initial(physics);
    let (mut left, mut lost, mut balance) = (Vec::new(), Vec::new(), Vec::new());
    for _ in 0..physics.step_count {
        integrator.step(&mut state);
        let time_ms = physics.time_s(state.step) * 1e3;
        let energy_j = chain.energy(&state.u_m, &state.v_m_s, &state.extra, &mut contact_j).total_j();
        let dissipated_j = physics.dissipated_j(&state.extra);
        left.push((time_ms, energy_j * 1e3));
        lost.push((time_ms, dissipated_j * 1e3));
        balance.push((time_ms, (energy_j + dissipated_j) / initial_j - 1.0));
    }
    let parts = Panel::new()
        .x_axis("time (ms)")
        .y_axis("energy (mJ)")
        .line("kinetic and potential E", left)
        .line("dissipated W", lost);
    let drift = Panel::new()
        .x_axis("time (ms)")
        .y_axis("(E + W)/E_{0} − 1")
        .curve(Curve::line("", balance).colour(Colour::Black))
        .height(0.6);
    Ok(Figure::new().shared_x().caption(plots::caption(&manifest)).panel(parts).panel(drift))
}

/// The errors of averages of a harmonic chain of 8 beads between two baths against the step: exact on both sides, since nothing is sampled.
fn averages() -> Figure {
    let steps_s: Vec<f64> = (0..13).map(|i| 0.24 * f64::powf(2.0, -0.25 * f64::from(i))).collect();
    let mut panel = Panel::new()
        .x_axis(Axis::new("time step over √(m/k)").log().limits(0.025, 0.3))
        .y_axis(Axis::new("largest error of an average").log().limits(1e-12, 0.1));
    for (name, temperatures_j, stroke) in
        [("one temperature", [1.0; 2], Stroke::Solid), ("two temperatures", [1.5, 0.5], Stroke::Dashed)]
    {
        for (method, colour) in [("velocity-verlet", Colour::Sky), ("rkn4", Colour::Black)] {
            let error = |dt_s: &f64| (*dt_s, error_of_averages(method, *dt_s, temperatures_j));
            let errors: Vec<_> = steps_s.iter().map(error).collect();
            let [(long_s, most), .., (short_s, least)] = errors[..] else { continue };
            let order = (most / least).ln() / (long_s / short_s).ln();
            let curve = Curve::line(format!("{method}, {name}: order {order:.1}"), errors);
            panel = panel.curve(curve.stroke(stroke).colour(colour));
        }
    }
    let caption = "8 masses on springs between walls, baths at both ends, γ = 0.5 √(k/m); covariances of displacements and temperatures of \
                   the stationary state of the steps, against those of the motion";
    Figure::new().caption(caption).panel(panel)
}

/// The largest error of a covariance of displacements or a temperature.
fn error_of_averages(method: &str, dt_s: f64, temperatures_j: [f64; 2]) -> f64 {
    let found = stationary(method, dt_s, 0.5, temperatures_j).0;
    let exact = |kind: &str, i: usize, j: usize| {
        if temperatures_j[0] == temperatures_j[1] {
            let (low, high) = (i.min(j), i.max(j));
            return if kind == "temperature" { 1.0 } else { ((low + 1) * (8 - high)) as f64 / 9.0 };
        }
        let key = format!("C1-rll8,{kind},{i},{j},");
        let row =
            include_str!("../../reference/thermal.csv").lines().find_map(|line| line.strip_prefix(&key));
        row.and_then(|value| value.parse().ok()).unwrap_or(f64::NAN)
    };
    let places = (0..8).flat_map(|i| (i..8).map(move |j| (i, j)));
    let displacements = places.map(|(i, j)| (found[i][j] - exact("displacements", i, j)).abs());
    let temperatures = (8..16).map(|i| (found[i][i] - exact("temperature", i - 8, i - 8)).abs());
    displacements.chain(temperatures).fold(0.0, f64::max)
}

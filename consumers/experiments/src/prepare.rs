//! What a configuration names and a run has to hold: tables in files, states of recordings, exact solitary waves.

use consumers::theory::{SolitaryWave, Strength};
use producer::integrator::Integrator;
use producer::state::ChainState;
use recording::RecordingSource;
use schemas::config::{ConfigError, FromRecording, RunConfig, Solitary};
use schemas::drive::{Waveform, table_from_csv};
use schemas::frame::{FrameSource, Received};
use sha2::{Digest, Sha256};
use std::fmt::{self, Write};
use std::path::Path;
use storage::is_url;

/// `config` with everything in it that it only names. Files are looked for `beside` the configuration.
///
/// # Errors
/// When a file cannot be read, or there is no such wave.
pub fn prepared(mut config: RunConfig, beside: Option<&Path>) -> Result<RunConfig, ConfigError> {
    let beside = |path: &Path| beside.filter(|_| !is_url(path));
    let place = |path: &Path| beside(path).map_or_else(|| path.to_owned(), |beside| beside.join(path));
    for (i, drive) in config.drive.iter_mut().enumerate() {
        if let Waveform::Csv { csv, interpolation } = &drive.waveform {
            let key = format!("drive[{i}].{}.csv", drive.prescribes.key());
            let path = place(csv);
            let refuse = |why: &dyn fmt::Display| {
                let found = format!("found {}: {why}", path.display());
                refused(&key, format!("{found}; allowed: a file with a time (s) and a value in each row"))
            };
            let text = std::fs::read_to_string(&path).map_err(|error| refuse(&error))?;
            let mut table = table_from_csv(&text).map_err(|why| refuse(&why))?;
            table.interpolation = *interpolation;
            drive.waveform = Waveform::Table(table);
        }
    }
    let beads = usize::try_from(config.chain.beads).unwrap_or(usize::MAX);
    if let Some(solitary) = config.initial.solitary.take() {
        let (u_m, v_m_s) = wave(&config, solitary, beads)?;
        add(&mut config.initial.displacements_m, u_m);
        add(&mut config.initial.velocities_m_s, v_m_s);
    }
    if let Some(from) = config.initial.from.clone()
        && from.sha256.is_none()
    {
        let (u_m, v_m_s, sha256) = state_of(&from, &place(Path::new(&from.recording)))?;
        if u_m.len() != beads {
            let found = format!("a state of {} beads", u_m.len());
            return Err(refused("initial.from", format!("found {found}; allowed: one of {beads} beads")));
        }
        add(&mut config.initial.displacements_m, u_m);
        add(&mut config.initial.velocities_m_s, v_m_s);
        config.initial.from = Some(FromRecording { sha256: Some(sha256), ..from });
    }
    Ok(config)
}

fn refused(key: &str, message: String) -> ConfigError {
    ConfigError { path: None, line: None, key: key.to_owned(), message }
}

/// Adds `more` to a list that may be left out.
fn add(list: &mut Vec<f64>, more: Vec<f64>) {
    if list.is_empty() {
        *list = more;
    } else {
        list.iter_mut().zip(more).for_each(|(value, more)| *value += more);
    }
}

/// Displacements (m) and velocities (m/s) of an exact solitary wave.
fn wave(config: &RunConfig, solitary: Solitary, beads: usize) -> Result<(Vec<f64>, Vec<f64>), ConfigError> {
    let key = "initial.solitary.speed_beads_s";
    let chain = &config.chain;
    let refuse = |why: &dyn fmt::Display| refused(key, format!("found {}; {why}", solitary.speed_beads_s));
    let is_even = chain.masses.is_uniform() && chain.stiffnesses.is_uniform() && config.load.is_none();
    if !is_even || chain.bonds.is_some() || chain.alphas.is_some() || chain.second.is_some() {
        return Err(refuse(&"an exact solitary wave is that of equal beads, one power and no load"));
    }
    let exact = SolitaryWave::new(chain.alpha).map_err(|error| refuse(&error))?;
    let strength = Strength::Speed { beads_per_s: solitary.speed_beads_s.abs() };
    let scale = exact
        .coefficients()
        .scaled(chain.bead_mass_kg, chain.stiffness, strength)
        .map_err(|error| refuse(&error))?;
    let sign = if solitary.speed_beads_s < 0.0 { -1.0 } else { 1.0 };
    let velocity = |i: usize| sign * scale.velocity_m_s * exact.velocity(i as f64 - solitary.bead);
    // contact c, half a bead behind bead c + 1, is overlapped; displacements begin at the side to which the wave goes
    let overlap = |c: usize| scale.overlap_m * exact.overlap(c as f64 + 0.5 - solitary.bead);
    let mut u_m = vec![0.0; beads];
    if sign > 0.0 {
        for i in (0..beads - 1).rev() {
            u_m[i] = u_m[i + 1] + overlap(i);
        }
    } else {
        for i in 1..beads {
            u_m[i] = u_m[i - 1] - overlap(i - 1);
        }
    }
    Ok((u_m, (0..beads).map(velocity).collect()))
}

/// Displacements (m), velocities (m/s) and the hash of a state of a recording, recomputed from the one before where it is not
/// recorded.
fn state_of(from: &FromRecording, path: &Path) -> Result<(Vec<f64>, Vec<f64>, String), ConfigError> {
    let refuse = |why: &dyn fmt::Display| {
        let found = format!("found {}: {why}", path.display());
        refused("initial.from", format!("{found}; allowed: a recording and a step of its run"))
    };
    let mut source = RecordingSource::open(path).map_err(|error| refuse(&error))?;
    let physics = source.manifest().physics.clone();
    if from.step > physics.step_count {
        return Err(refuse(&format!("step {} is after its last, {}", from.step, physics.step_count)));
    }
    source.seek_to_step(from.step).map_err(|error| refuse(&error))?;
    let mut state = match source.receive() {
        Ok(Received::Frame(frame)) if frame.step <= from.step => ChainState::of_frame(&frame),
        Ok(_) => return Err(refuse(&"no state up to that step is recorded")),
        Err(error) => return Err(refuse(&error)),
    };
    let mut integrator = Integrator::new(&physics);
    while state.step < from.step {
        integrator.advance(&mut state, from.step);
    }
    let mut hash = Sha256::new();
    state.u_m.iter().chain(state.v_m_s.iter()).for_each(|x| hash.update(x.to_le_bytes()));
    let mut sha256 = String::new();
    for byte in hash.finalize() {
        // writing to a String cannot fail
        let _ = write!(sha256, "{byte:02x}");
    }
    Ok((state.u_m.to_vec(), state.v_m_s.to_vec(), sha256))
}

//! Loads the things that a configuration names and a run has to hold: tables in files, states of recordings, exact
//! solitary waves, modes, states of a given energy.

mod solitary;
mod states;

use producer::integrator::Integrator;
use producer::state::ChainState;
use recording::{RecordingSource, hex};
use schemas::config::{ConfigError, FromRecording, Initial, RunConfig, StrikerConfig};
use schemas::drive::{Waveform, table_from_csv};
use schemas::frame::{FrameSource, Received};
use sha2::{Digest, Sha256};
use std::fmt;
use std::path::Path;
use storage::is_url;

/// `config` with everything in it that it only names. Files are looked for `beside` the configuration.
///
/// # Errors
/// When a file cannot be read, or there is no such wave.
pub fn prepared(mut config: RunConfig, beside: Option<&Path>) -> Result<RunConfig, ConfigError> {
    let beside = |path: &Path| beside.filter(|_| !is_url(path));
    let place = |path: &Path| beside(path).map_or_else(|| path.to_owned(), |beside| beside.join(path));
    let of_drives = config
        .drive
        .iter_mut()
        .enumerate()
        .map(|(i, drive)| (format!("drive[{i}].{}", drive.prescribes.key()), &mut drive.waveform));
    let of_baths = config.bath.iter_mut().enumerate().flat_map(|(i, bath)| {
        let joule = bath.temperature_j.iter_mut().map(move |t| (format!("bath[{i}].temperature_j"), t));
        joule.chain(bath.temperature_k.iter_mut().map(move |t| (format!("bath[{i}].temperature_k"), t)))
    });
    for (key, waveform) in of_drives.chain(of_baths) {
        if let Waveform::Csv { csv, interpolation } = waveform {
            let key = format!("{key}.csv");
            let path = place(csv);
            let refuse = |why: &dyn fmt::Display| {
                let found = format!("found {}: {why}", path.display());
                refused(&key, format!("{found}; allowed: a file with a time (s) and a value in each row"))
            };
            let text = schemas::text::read(&path).map_err(|error| refuse(&error))?;
            let mut table = table_from_csv(&text).map_err(|why| refuse(&why))?;
            table.interpolation = *interpolation;
            *waveform = Waveform::Table(table);
        }
    }
    let beads = usize::try_from(config.chain.beads).unwrap_or(usize::MAX);
    let initial = solitary::with_waves(&config)?;
    (config.initial.displacements_m, config.initial.velocities_m_s) = initial;
    config.initial.solitary.clear();
    if let Some(modes) = config.initial.modes.take() {
        let (u_m, v_m_s) = states::of_modes(&config, &modes)?;
        add(&mut config.initial.displacements_m, u_m);
        add(&mut config.initial.velocities_m_s, v_m_s);
    }
    if let Some(from) = config.initial.from.clone()
        && from.sha256.is_none()
    {
        let (state, resonators, sha256) = state_of(&from, &place(Path::new(&from.recording)))?;
        if state.u_m.len() != beads {
            let found = format!("a state of {} beads", state.u_m.len());
            return Err(refused("initial.from", format!("found {found}; allowed: one of {beads} beads")));
        }
        add(&mut config.initial.displacements_m, state.u_m.to_vec());
        add(&mut config.initial.velocities_m_s, state.v_m_s.to_vec());
        // a state that is scaled has none of its own
        if config.resonators.is_some() && config.initial.energy_per_bead_j.is_none() {
            let [w_m, w_m_s] = resonators;
            add(&mut config.initial.resonator_displacements_m, w_m);
            add(&mut config.initial.resonator_velocities_m_s, w_m_s);
        }
        config.initial.from = Some(FromRecording { sha256: Some(sha256), ..from });
    }
    if let Some(energy_j) = config.initial.energy_per_bead_j.take() {
        let (displacements_m, velocities_m_s) = states::of_energy(&config, energy_j)?;
        let from = config.initial.from.take();
        config.initial = Initial { displacements_m, velocities_m_s, from, ..Initial::default() };
        config.striker = StrikerConfig { bead: 0, velocity_m_s: 0.0 }.into();
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

/// A state of a recording, recomputed from the one before where it is not recorded, the displacements (m) and velocities (m/s) of its
/// resonators, and the hash of those of its beads.
fn state_of(from: &FromRecording, path: &Path) -> Result<(ChainState, [Vec<f64>; 2], String), ConfigError> {
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
    let resonators = physics.rows().resonators_of(&state.extra).map(<[f64]>::to_vec);
    Ok((state, resonators, hex(&hash.finalize())))
}

//! Loads the things that a configuration names and a run has to hold: tables in files, states of recordings, exact
//! solitary waves, modes, states of a given energy.

mod solitary;
mod states;

use producer::resimulation::{Lend, Resimulation, check_kernel};
use producer::state::ChainState;
use recording::{RecordingSource, hex};
use schemas::config::{ConfigError, FromRecording, Initial, RunConfig, StrikerConfig};
use schemas::drive::{Waveform, table_from_csv};
use schemas::frame::{FrameSource, Received};
use schemas::manifest::Physics;
use sha2::{Digest, Sha256};
use std::error::Error;
use std::fmt;
use std::path::{Path, PathBuf};
use storage::is_url;

/// `config` with everything in it that it only names. Files are looked for `beside` the configuration.
///
/// # Errors
/// When a file cannot be read, or there is no such wave.
pub fn prepared(mut config: RunConfig, beside: Option<&Path>) -> Result<RunConfig, ConfigError> {
    for (key, waveform) in waveforms(&mut config) {
        if let Waveform::Csv { csv, interpolation } = waveform {
            let key = format!("{key}.csv");
            let path = place(csv, beside);
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
        let (state, resonators, sha256) = state_of(&from, &place(Path::new(&from.recording), beside))?;
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

/// The files that `config` names, which are looked for `beside` it.
pub fn files_of(config: &mut RunConfig, beside: Option<&Path>) -> Vec<PathBuf> {
    let of_waveform = |waveform: &mut Waveform| match waveform {
        Waveform::Csv { csv, .. } => Some(place(csv, beside)),
        _ => None,
    };
    let state = config.initial.from.as_ref().map(|from| place(Path::new(&from.recording), beside));
    waveforms(config).filter_map(|(_, waveform)| of_waveform(waveform)).chain(state).collect()
}

fn place(path: &Path, beside: Option<&Path>) -> PathBuf {
    beside.filter(|_| !is_url(path)).map_or_else(|| path.to_owned(), |beside| beside.join(path))
}

/// The waveforms of drives and baths, each with its key.
fn waveforms(config: &mut RunConfig) -> impl Iterator<Item = (String, &mut Waveform)> {
    let of_drives = config
        .drive
        .iter_mut()
        .enumerate()
        .map(|(i, drive)| (format!("drive[{i}].{}", drive.prescribes.key()), &mut drive.waveform));
    let of_baths = config.bath.iter_mut().enumerate().flat_map(|(i, bath)| {
        let joule = bath.temperature_j.iter_mut().map(move |t| (format!("bath[{i}].temperature_j"), t));
        joule.chain(bath.temperature_k.iter_mut().map(move |t| (format!("bath[{i}].temperature_k"), t)))
    });
    of_drives.chain(of_baths)
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

/// A state of a recording, the displacements (m) and velocities (m/s) of its resonators, and the hash of those of its beads.
fn state_of(from: &FromRecording, path: &Path) -> Result<(ChainState, [Vec<f64>; 2], String), ConfigError> {
    let (state, physics) = state_at(from.step, path).map_err(|why| {
        let found = format!("found {}: {why}", path.display());
        refused("initial.from", format!("{found}; allowed: a recording and a step of its run"))
    })?;
    let mut hash = Sha256::new();
    state.u_m.iter().chain(state.v_m_s.iter()).for_each(|x| hash.update(x.to_le_bytes()));
    let resonators = physics.rows().resonators_of(&state.extra).map(<[f64]>::to_vec);
    Ok((state, resonators, hex(&hash.finalize())))
}

/// The state of `step` in the recording `path`: recomputed and proven by the next one where it is not recorded.
fn state_at(step: u64, path: &Path) -> Result<(ChainState, Physics), Box<dyn Error>> {
    let mut source = RecordingSource::open_all(path)?;
    let physics = source.manifest().physics.clone();
    source.end_at(step);
    source.seek_to_step(step)?;
    if let Err(other) = check_kernel(source.manifest()) {
        return match source.receive()? {
            Received::Frame(frame) if frame.step == step => Ok((ChainState::of_frame(&frame), physics)),
            _ => Err(other.into()),
        };
    }
    let mut states = Resimulation::new(source, Lend::Steps)?.lending_from(step).ending_with_the_last_state();
    let mut found = None;
    while states.proven_step().is_none_or(|proven| proven < step) {
        match states.receive()? {
            Received::Frame(frame) if frame.step == step => found = Some(ChainState::of_frame(&frame)),
            Received::Frame(_) | Received::Missed { .. } => {}
            Received::End(_) => break,
        }
    }
    match (found, states.proven_step()) {
        (_, Some(last)) if last < step => {
            Err(format!("step {step} is after its last state, that of step {last}").into())
        }
        (Some(state), _) => Ok((state, physics)),
        (None, _) => Err("no state up to that step is recorded".into()),
    }
}

#[cfg(test)]
mod tests {
    use super::state_at;
    use std::path::Path;

    /// Recorded states of every kernel are taken; those between only where they can be computed and proven, and none after the last.
    #[test]
    fn a_state_of_a_recording_is_recorded_or_proven() {
        let golden = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/golden");
        let found = |name: &str, step| match state_at(step, &golden.join(name)) {
            Ok((state, _)) => {
                assert_eq!(state.step, step);
                "found".to_owned()
            }
            Err(why) => why.to_string(),
        };
        for (name, step, says) in [
            ("1.0-kernel-2/dashpots.mcap", 200, "found"),
            ("1.0-kernel-2/dashpots.mcap", 201, "gear5 with [damping]"),
            ("1.0-kernel-1/sparse.mcap", 200, "found"),
            ("1.0-kernel-1/sparse.mcap", 201, "kernel version 1"),
            ("1.0-kernel-2/sparse.mcap", 0, "found"),
            ("1.0-kernel-2/sparse.mcap", 201, "found"),
            ("1.0-kernel-2/sparse.mcap", 690, "found"),
            ("1.0-kernel-2/sparse.mcap", u64::MAX, "after its last state, that of step 690"),
            ("1.0-kernel-2/partial.mcap.partial", 251, "after its last state, that of step 250"),
        ] {
            let found = found(name, step);
            assert!(found.contains(says), "step {step} of {name}: {found}");
        }
    }
}

use super::*;
use recording::WriteOptions;
use schemas::config::StreamConfig;
use schemas::manifest::Origin;
use schemas::presets::PRESETS;

/// 30 beads over `steps` steps, a frame of each, every `every`-th recorded.
fn manifest(steps: u64, every: u64) -> RunManifest {
    let mut config = PRESETS[2].config();
    config.chain.beads = 30;
    config.stream = StreamConfig { publish_every_steps: 1, record_every_steps: every };
    config.time.dt_s = Some(1e-6);
    config.time.duration_s = steps as f64 * 1e-6;
    let origin = Origin { program: String::new(), host: String::new(), started_unix_ns: 0 };
    RunManifest::new(&config, "run", origin).expect("valid")
}

/// The states of `steps`, which ascend.
fn states(manifest: &RunManifest, steps: &[u64]) -> Vec<ChainState> {
    let mut state = ChainState::initial(&manifest.physics);
    let mut integrator = Integrator::new(&manifest.physics);
    let mut states = Vec::new();
    for step in steps {
        while state.step < *step {
            integrator.step(&mut state);
        }
        states.push(state.clone());
    }
    states
}

/// A message of a file.
enum Found {
    Checked(ChainState),
    Unchecked(ChainState),
}

/// Recovers a file that begins with `first_step`. `watch` sees every step that is asked about.
fn recovered(
    manifest: &RunManifest,
    first_step: u64,
    found: &[Found],
    mut watch: impl FnMut(u64) -> bool,
) -> Result<Recovery, RecoveryError> {
    let dir = tempfile::tempdir().expect("a directory");
    let begin = BeginRecord { first_step, ..BeginRecord::default() };
    let path = dir.path().join("recovered.mcap");
    let options = WriteOptions::default();
    let mut writer = RecordingWriter::create_from(&path, manifest, None, &begin, &options)?;
    let mut salvager = Salvager::new(manifest, &begin, u64::MAX, &mut writer, &mut watch);
    for found in found {
        match found {
            Found::Checked(state) => {
                salvager.take(&state.as_frame(manifest, manifest.frame_at(state.step)))?;
            }
            Found::Unchecked(state) => {
                salvager.take_unchecked(&state.as_frame(manifest, manifest.frame_at(state.step)))?;
            }
        }
    }
    let recovery = salvager.finish(None, false)?;
    writer.discard();
    Ok(recovery)
}

fn changed(state: &ChainState) -> ChainState {
    let mut changed = state.clone();
    changed.v_m_s[3] = f64::from_bits(changed.v_m_s[3].to_bits() ^ 1);
    changed
}

/// A step that is wrong, like everything in a damaged chunk may be, says nothing about the states around it.
#[test]
fn a_state_that_claims_a_later_step_spoils_no_other() {
    let m = manifest(400, 10);
    let all = states(&m, &[103, 110, 120, 130, 140]);
    let liar = ChainState { step: 300, ..all[1].clone() };
    let found = [
        Found::Checked(all[0].clone()),
        Found::Unchecked(liar.clone()),
        Found::Checked(all[2].clone()),
        Found::Unchecked(liar),
        Found::Unchecked(all[3].clone()),
        Found::Unchecked(all[4].clone()),
    ];
    let recovery = recovered(&m, 103, &found, |_| true).expect("recovered");
    assert!(recovery.is_whole(), "{recovery:?}");
    assert_eq!((recovery.kept_count, recovery.recomputed_count, recovery.last_step), (4, 1, Some(140)));
    assert_eq!((recovery.proven_without_checksum_count, recovery.unproven_count), (2, 2));
}

#[test]
fn how_far_an_unchecked_state_leads_is_bounded() {
    let m = manifest(1_000_000, 10);
    let all = states(&m, &[0, 10, 20]);
    let liar = |step| Found::Unchecked(ChainState { step, ..all[1].clone() });
    let mut found = vec![Found::Checked(all[0].clone())];
    found.extend((0..100).map(|number| liar(900_000 + number)));
    found.extend([Found::Unchecked(all[1].clone()), Found::Unchecked(all[2].clone())]);
    let mut farthest = 0;
    let watch = |step| {
        farthest = if step > farthest { step } else { farthest };
        true
    };
    let recovery = recovered(&m, 0, &found, watch).expect("recovered");
    assert_eq!((recovery.proven_without_checksum_count, recovery.unproven_count), (2, 100));
    assert_eq!(farthest, 20);
}

/// States that were lost are behind what comes after them, as far as that costs no more than what was computed before.
#[test]
fn unchecked_states_after_a_long_gap_are_proven() {
    let m = manifest(4000, 1);
    let all = states(&m, &[0, 1500, 2900]);
    let found =
        [Found::Checked(all[0].clone()), Found::Checked(all[1].clone()), Found::Unchecked(all[2].clone())];
    let recovery = recovered(&m, 0, &found, |_| true).expect("recovered");
    assert_eq!((recovery.proven_without_checksum_count, recovery.last_step), (1, Some(2900)));
}

#[test]
fn frames_before_a_wrong_first_state_are_lost_with_it() {
    let m = manifest(200, 10);
    let all = states(&m, &[120, 130, 140]);
    let found =
        [Found::Checked(changed(&all[0])), Found::Checked(all[1].clone()), Found::Checked(all[2].clone())];
    let recovery = recovered(&m, 100, &found, |_| true).expect("recovered");
    assert_eq!((recovery.difference_count, recovery.kept_count), (1, 2));
    assert_eq!(recovery.lost, [(100, Some(120))]);
}

/// A recording begins with a state of any step, due by no schedule.
#[test]
fn a_first_state_between_those_of_the_schedule_is_lost_if_it_is_not_there() {
    let m = manifest(200, 10);
    let all = states(&m, &[103, 110, 120, 130]);
    let of = |range: std::ops::Range<usize>| -> Vec<_> {
        all[range].iter().cloned().map(Found::Checked).collect()
    };
    let lost = |range| recovered(&m, 103, &of(range), |_| true).expect("recovered").lost;
    assert_eq!(lost(0..4), []);
    assert_eq!(lost(1..4), [(103, Some(103))]);
    assert_eq!(lost(2..4), [(103, Some(110))]);
}

#[test]
fn it_stops_while_it_recomputes() {
    let m = manifest(4000, 4000);
    let found: Vec<_> = states(&m, &[0, 4000]).into_iter().map(Found::Checked).collect();
    let mut asked = Vec::new();
    let watch = |step| {
        asked.push(step);
        step < 2048
    };
    let stopped = recovered(&m, 0, &found, watch);
    assert!(matches!(stopped, Err(RecoveryError::Stopped)), "{stopped:?}");
    assert_eq!(asked, [0, 1024, 2048]);
}

//! Analyses that visit only the beads that a frame names make the same bytes as those that visit all.

use super::*;
use consumers::analysis::{Analysis, Beginning, Offer, Outlet, RowValues, Settings};
use consumers::fields::Field;
use consumers::local_energy::{BeadEnergies, bead_energies_j};
use consumers::table::Cell;
use schemas::frame::Active;
use schemas::summary::Summarizer;

/// Everything that an analysis says, and the bits of its rows.
#[derive(Default)]
struct Said(Vec<String>);

impl Outlet for Said {
    fn wants(&self, _: usize) -> bool {
        true
    }

    fn line(&mut self, table: usize, cells: &[Cell]) {
        self.0.push(format!("{table}: {cells:?}"));
    }

    fn is_published(&self) -> bool {
        true
    }

    fn publish(&mut self, frame: &Frame<'_>, row: RowValues<'_>) {
        let bits = match row {
            RowValues::Numbers(row) => format!("{:x?}", row.iter().map(|x| x.to_bits()).collect::<Vec<_>>()),
            RowValues::Classes(row) => format!("{row:?}"),
        };
        self.0.push(format!("step {}: {bits}", frame.step));
    }
}

/// The least window of a state.
fn narrowest(u_m: &[f64], v_m_s: &[f64]) -> Active {
    let moves = |bead: &usize| u_m[*bead].to_bits() != 0 || v_m_s[*bead].to_bits() != 0;
    let first = (0..u_m.len()).find(moves).unwrap_or(0);
    Active { first, end: (0..u_m.len()).rfind(moves).map_or(first, |last| last + 1) }
}

/// States of a run, and then some with motion anywhere: nothing that a window shows need be there in the next frame.
fn states(manifest: &RunManifest, random: &mut Random) -> Vec<ChainState> {
    let physics = &manifest.physics;
    let (mut integrator, mut state) = (Integrator::new(physics), ChainState::initial(physics));
    let mut states = vec![state.clone()];
    let last = physics.step_count * 2 / 3;
    while state.step < last {
        let next = manifest.step_of_frame(states.len() as u64);
        integrator.advance(&mut state, next);
        if state.step < next {
            continue;
        }
        states.push(state.clone());
    }
    let beads = physics.beads;
    let (length_m, speed_m_s) = (physics.scales().length_m, physics.scales().speed_m_s());
    while manifest.step_of_frame(states.len() as u64) < physics.step_count {
        let (first, count) = (random.below(beads), random.below(beads));
        let moving = first..first + random.below(count + 1);
        let mut number = |bead: u64, scale: f64| {
            let one = scale * random.between(-1.0, 1.0);
            if moving.contains(&bead) { one } else { 0.0 }
        };
        let mut state = ChainState { step: manifest.step_of_frame(states.len() as u64), ..state.clone() };
        for (bead, (u, v)) in (0..).zip(state.u_m.iter_mut().zip(&mut *state.v_m_s)) {
            (*u, *v) = (number(bead, length_m), number(bead, speed_m_s));
        }
        states.push(state);
    }
    states
}

/// The windows in which an analysis sees the frames, by the number of the frame: none, the least one, wider ones, and all of these in turns.
fn window(way: u64, [least, sought]: [Active; 2], beads: usize, random: &mut Random) -> Option<Active> {
    let mut some = |most: usize| usize::try_from(random.below(6)).unwrap().min(most);
    let wider = Active { first: least.first - some(least.first), end: least.end + some(beads - least.end) };
    match way {
        0 => None,
        1 => Some(least),
        2 => Some(wider),
        _ => [None, Some(least), Some(wider), Some(sought)][some(3)],
    }
}

fn each(states: &[ChainState], manifest: &RunManifest, way: u64, mut take: impl FnMut(&Frame<'_>, bool)) {
    let mut random = Random { seed: 2, stream: 0, index: way << 32 };
    for (number, state) in (0..).zip(states) {
        let least = narrowest(&state.u_m, &state.v_m_s);
        let sought = Active::of(&state.u_m, &state.v_m_s);
        assert!(least.first == least.end || least.with(sought) == sought, "{sought:?}");
        let active = window(way, [least, sought], state.u_m.len(), &mut random);
        take(&Frame { active, ..state.as_frame(manifest, number) }, number % 97 == 96);
    }
}

/// Everything that `offer` says of a run.
fn said(offer: &'static Offer, manifest: &RunManifest, states: &[ChainState], way: u64) -> Vec<String> {
    let mut settings = Settings::default();
    for setting in offer.settings.iter().filter(|setting| setting.required_unless.is_some()) {
        let value = if offer.name == "deformation" { "13" } else { "contact:3" };
        settings.set(setting, vec![value.to_owned()]).unwrap();
    }
    let beginning = Beginning::whole(offer.name, manifest, &settings);
    let begun = (offer.begin)(&Beginning { is_drawn: true, ..beginning });
    let mut said = Said::default();
    let mut analysis: Box<dyn Analysis> = match begun {
        Ok(analysis) => analysis,
        Err(refusal) => return vec![refusal.why],
    };
    each(states, manifest, way, |frame, is_behind_gap| {
        if is_behind_gap {
            analysis.gap();
        }
        analysis.observe(frame, &mut said);
    });
    let refused = analysis.finish(&mut said).err().map(|refusal| refusal.why);
    said.0.push(format!("{refused:?}"));
    said.0.push(analysis.report().map_or_else(String::new, |report| report.results.to_string()));
    said.0.push(format!("{:?}", analysis.figure().ok()));
    said.0
}

/// Everything that a recorder and pictures of fields say.
fn said_beside(manifest: &RunManifest, states: &[ChainState], way: u64) -> Vec<String> {
    let chain = manifest.physics.chain();
    let (mut summarizer, mut energies) = (Summarizer::new(&manifest.physics), BeadEnergies::new(&chain));
    let mut said = Vec::new();
    each(states, manifest, way, |frame, _| {
        let (beads, energies_j) = energies.of(&chain, frame);
        assert_eq!(energies_j, bead_energies_j(&chain, frame));
        assert!((0..energies_j.len()).all(|bead| beads.contains(&bead) || energies_j[bead].to_bits() == 0));
        let fields =
            Field::ALL.map(|field| field.values(&chain, frame).map(f64::to_bits).collect::<Vec<_>>());
        said.push(format!("{:?} {fields:x?}", summarizer.summarize(frame)));
    });
    said
}

#[test]
fn beads_at_rest_need_not_be_visited() {
    for (stream, kind) in (300..).zip(KINDS) {
        for beads in [9, 70] {
            let mut random = Random { seed: 1, stream, index: beads << 32 };
            let mut config = drawn_of(kind, beads, &mut random);
            (config.stream.publish_every_steps, config.stream.record_every_steps) = (5, 5);
            let origin = Origin { program: String::new(), host: String::new(), started_unix_ns: 0 };
            let manifest = RunManifest::new(&config, "run", origin).unwrap();
            let states = states(&manifest, &mut random);
            // one that makes the steps of the run itself asks no frame where it moves
            for offer in analyses::all().filter(|offer| offer.name != "lyapunov") {
                let whole = said(offer, &manifest, &states, 0);
                for way in 1..=3 {
                    let within = said(offer, &manifest, &states, way);
                    let differs = whole.iter().zip(&within).find(|(whole, within)| whole != within);
                    assert_eq!(differs, None, "{}, {kind}, {beads} beads, way {way}", offer.name);
                    assert_eq!(whole.len(), within.len());
                }
            }
            let whole = said_beside(&manifest, &states, 0);
            assert!(
                (1..=3).all(|way| said_beside(&manifest, &states, way) == whole),
                "{kind}, {beads} beads"
            );
        }
    }
}

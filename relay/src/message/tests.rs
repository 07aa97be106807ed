use super::*;
use producer::state::ChainState;
use schemas::manifest::Origin;
use schemas::presets::PRESETS;

fn manifest() -> RunManifest {
    let origin = Origin { program: String::new(), host: String::new(), started_unix_ns: 0 };
    RunManifest::new(&PRESETS[0].config(), "run", origin).unwrap()
}

fn two_frames(manifest: &RunManifest) -> (FramesMessage, ChainState) {
    let state = ChainState::initial(&manifest.physics);
    let mut message = FramesMessage::default();
    message.push(&state.as_frame(manifest, 7));
    assert!(message.continues_with(8) && !message.continues_with(9));
    message.push(&state.as_frame(manifest, 8));
    (message, state)
}

#[test]
fn frames_come_back() {
    let manifest = manifest();
    let (mut message, state) = two_frames(&manifest);
    let bytes = message.finish();
    assert_eq!(bytes.len(), 16 + 2 * 8 * manifest.frame_doubles());
    let Message::Frames { first: 7, doubles } = Message::decode(&bytes, &manifest).unwrap() else { panic!() };
    let v: Vec<u8> = state.v_m_s.iter().flat_map(|x| x.to_le_bytes()).collect();
    assert_eq!(&doubles[8 * 1000..16 * 1000], v);
    assert!(message.is_empty());
}

#[test]
fn rows_come_back() {
    let columns = ResultColumns::named(&["energy_j", "front_m"]);
    let mut message = RowsMessage::default();
    message.push(9, [1.5f64, 2.5].into_iter().flat_map(f64::to_le_bytes));
    let mut head = RowsHead::new(Topic::own("mine").unwrap(), &columns);
    head.ended = Some(true);
    let bytes = message.finish(&head);
    let Message::Rows { head, rows } = Message::decode(&bytes, &manifest()).unwrap() else { panic!() };
    assert_eq!((head.columns(), head.ended, rows.len()), (columns, Some(true), 24));
    assert_eq!((head.topic().unwrap(), head.row_bytes()), (Topic::own("mine").unwrap(), 24));
}

#[test]
fn the_end_comes_back() {
    let end = EndMessage { reason: "interrupted".into(), last_frame: Some(5) };
    let bytes = end.encode();
    let decoded = Message::decode(&bytes, &manifest()).unwrap();
    assert_eq!(decoded, Message::End { reason: EndReason::Interrupted, last_frame: Some(5) });
}

impl RowsMessage {
    /// Rows of one value of these frames.
    fn of(mut self, frames: &[u64]) -> Vec<u8> {
        for frame in frames {
            self.push(*frame, [0; 8].into_iter());
        }
        self.finish(&RowsHead::new(Topic::own("mine").unwrap(), &ResultColumns::named(&["a_m"])))
    }
}

#[test]
fn garbage_is_refused_and_takes_no_memory() {
    let manifest = manifest();
    let whole = two_frames(&manifest).0.finish();
    let words = |words: &[u64]| words.iter().flat_map(|n| n.to_le_bytes()).collect::<Vec<u8>>();
    let late = [words(&[FRAMES, 55_189]), whole[16..].to_vec()].concat();
    let end = |text: &str| [words(&[END]), text.as_bytes().to_vec()].concat();
    let rows = |text: &str, rest: usize| {
        [words(&[ROWS, text.len() as u64]), text.as_bytes().to_vec(), vec![0; rest]].concat()
    };
    let head = |topic: &str, width: u64| {
        format!(
            "{{\"topic\":\"{topic}\",\"width\":{width},\"names\":\"\",\"tolerance_m\":null,\"ended\":null}}"
        )
    };
    for bytes in [
        vec![],
        vec![1; 7],
        words(&[4]),
        words(&[FRAMES]),
        words(&[FRAMES, 0]),
        whole[..whole.len() - 1].to_vec(),
        late,
        words(&[ROWS, u64::MAX, 0]),
        rows(&head("energies", 11), 95),
        rows(&head("energies", u64::MAX), 96),
        rows(&head("energies", MOST_ROW_BYTES as u64), 0),
        rows(&head("state", 1), 16),
        rows(&head("own/../x", 1), 16),
        end("{}"),
        end("{\"reason\":\"tired\",\"last_frame\":null}"),
        end("{\"reason\":\"complete\",\"last_frame\":55190}"),
    ] {
        let refused = Message::decode(&bytes, &manifest);
        assert!(matches!(refused, Err(MessageError::Garbage { .. })), "{bytes:?}: {refused:?}");
    }
    let late_row = RowsMessage::default().of(&[0, 55_190]);
    for (bytes, expected) in [
        (late_row, "a row of frame 55190, the run has 55190 frames"),
        (vec![1; most_message_bytes(&manifest) + 1], "expected at most"),
    ] {
        let said = Message::decode(&bytes, &manifest).unwrap_err().to_string();
        assert!(said.contains(expected), "{said}");
    }
    assert!(request::<Request>(&vec![b' '; 5000]).is_err());
    assert!(Place::decode(&[0; 31]).is_err() && Place::decode(&[0; 40]).is_err());
}

#[test]
fn a_place_comes_back() {
    let place = Place { seq: 1, after: 2, rows_lost: 3, age_ms: u64::MAX };
    assert_eq!(Place::decode(&place.encode()).unwrap(), place);
}

#[test]
fn other_versions_are_refused_with_both_numbers() {
    let ours = Versions::OURS;
    let kernel = Versions { kernel: ours.kernel + 1, ..ours };
    let said = kernel.check(true).unwrap_err().to_string();
    assert!(
        said.contains("kernel") && said.contains("version 4") && said.contains("this one has 3"),
        "{said}"
    );
    kernel.check(false).expect("nothing is recomputed");
    let schema = Versions { schema: SchemaVersion { major: 2, minor: 0 }, ..ours };
    assert!(schema.check(false).unwrap_err().to_string().contains("2.0"));
    let later = "{\"versions\":{\"protocol\":7,\"colour\":\"red\"},\"more\":1}";
    let said = request::<Request>(later.as_bytes()).unwrap_err().to_string();
    assert!(said.contains("protocol") && said.contains('7'), "{said}");
}

/// A manifest may have a number for each bead, and stands as a text in the answer.
#[test]
fn a_manifest_of_megabytes_fits_an_answer() {
    let mut long = manifest();
    long.physics.initial.velocities_m_s = (0..200_000).map(|bead| 1e-9 * f64::from(bead)).collect();
    let have = Have { stream: 1, seq: 2 };
    let run = Some(Offer { manifest: long.to_json(), have, frames: false });
    let welcome = Welcome { versions: Versions::OURS, run };
    let json = to_json(&welcome);
    assert!(json.len() > 1 << 20);
    assert_eq!(answer::<Welcome>(json.as_bytes()).unwrap(), welcome);
}

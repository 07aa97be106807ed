//! A consumer that is not ours: `examples/own_consumer.rs`, and what becomes of its results.

use crate::harness::{Place, Running, python, skip};
use bus::{AttachOptions, Delivery, LiveSource, ResultPublisher, StreamId};
use mcap::MessageStream;
use schemas::frame::{FrameSource as _, Received};
use schemas::manifest::RunId;
use schemas::results::{ResultColumns, Topic};
use serde_json::json;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

/// The example, which `cargo test` builds unless it is told to build this test alone.
pub(crate) fn example() -> Option<PathBuf> {
    let built = Path::new(env!("CARGO_BIN_EXE_beadline")).with_file_name("examples").join("own_consumer");
    if !built.exists() {
        skip("`cargo build --example own_consumer` first");
    }
    Some(built).filter(|built| built.exists())
}

fn start(place: &Place, example: &Path, source: &str) -> Running {
    Running::start(&format!("own_consumer {source}"), place.foreign(example, [source]))
}

/// The rows that the example printed, as messages: frame, step and the two columns.
fn expected(printed: &str) -> Vec<(u64, [u64; 2])> {
    let row = |line: &str| {
        let mut cells = line.split(',');
        let frame = cells.next().unwrap().parse().unwrap();
        (frame, [(); 2].map(|()| cells.next().unwrap().parse::<f64>().unwrap().to_bits()))
    };
    printed.lines().skip(1).map(row).collect()
}

/// The same of `/own/motion` in a recording, in which the two columns are the last 18 bytes of a message.
fn recorded(place: &Place, file: &str) -> Vec<(u64, [u64; 2])> {
    let bytes = fs::read(place.path(file)).unwrap();
    let mut rows = Vec::new();
    for message in MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        if message.channel.topic != "/own/motion" {
            continue;
        }
        let schema = message.channel.schema.as_ref().unwrap();
        assert_eq!((schema.name.as_str(), schema.encoding.as_str()), ("beadline.own.motion", "protobuf"));
        let (_, columns) = message.data.split_last_chunk::<18>().unwrap();
        assert_eq!((columns[0], columns[9]), (4 << 3 | 1, 5 << 3 | 1));
        let double = |at: usize| u64::from_le_bytes(columns[at..at + 8].try_into().unwrap());
        rows.push((u64::from(message.sequence), [double(1), double(10)]));
    }
    rows
}

/// It sees every frame, live and in a file, and what it publishes is recorded with names and units.
#[test]
fn results_of_a_consumer_of_ones_own_are_recorded() {
    let Some(example) = example() else { return };
    let place = Place::new();
    let run = place.start("run --preset homogeneous --name run --duration 2e-3 --no-record --wait-for 2");
    let recorder = place.start("record live:run --out run.mcap --json");
    let live = start(&place, &example, "live:run").wait().exits(0);
    run.wait().exits(0);
    let summary = recorder.wait().exits(0).json();
    let expected = expected(&live.stdout());
    assert!(expected.len() > 1000);
    assert_eq!(summary["results"]["own/motion"]["rows"], expected.len());
    assert_eq!(recorded(&place, "run.mcap"), expected);

    let file = start(&place, &example, "run.mcap").wait().exits(0);
    assert_eq!(file.stdout(), live.stdout());
    place.run("verify run.mcap").exits(0);
    place.run("thin run.mcap --every-steps 100 --out thin.mcap").exits(0);
    assert_eq!(recorded(&place, "thin.mcap"), expected);

    let Some(python) = python() else { return };
    let read = "from mcap.reader import make_reader; from mcap_protobuf.decoder import DecoderFactory\n\
                reader = make_reader(open('run.mcap', 'rb'), True, [DecoderFactory()])\n\
                for *_, row in reader.iter_decoded_messages(topics=['/own/motion']):\n    \
                print(row.frame, row.momentum_n_s, row.fastest_m_s, sep=',')";
    let rows = Running::start("python", place.foreign(python, ["-c", read])).wait().exits(0);
    let with_head = format!("frame,momentum_n_s,fastest_m_s\n{}", rows.stdout());
    assert_eq!(self::expected(&with_head), expected);
}

/// A publisher that begins again in the middle of a run is recorded, too: in one channel, and nothing is lost but
/// what nobody published.
#[test]
fn a_consumer_of_ones_own_may_begin_again() {
    let place = Place::new();
    let run = place.start("run --preset homogeneous --name run --duration 2e-3 --no-record --wait-for 2");
    let recorder = place.start("record live:run --out run.mcap --json");
    let options = AttachOptions::default();
    let mut source = LiveSource::attach(&place.bus(), None, Delivery::Lossless, &options).unwrap();
    // the run begins when the recorder is there, too
    assert!(matches!(source.receive().unwrap(), Received::Frame(_)));
    let columns = ResultColumns::array("energy_j", 3);
    for frames in [0..10_u64, 100..110] {
        let mut results = source.results(Topic::own("twice").unwrap(), &columns).unwrap();
        for frame in frames {
            let manifest = source.manifest();
            let step = manifest.step_of_frame(frame);
            results.publish(frame, step, manifest.physics.time_s(step), &[1.0; 3]).unwrap();
        }
        // the recorder leaves the first one before the second one comes
        results.finish_and_wait(Duration::from_mins(1)).unwrap();
    }
    while !matches!(source.receive().unwrap(), Received::End(_)) {}
    run.wait().exits(0);
    let ended = recorder.wait();
    let twice = ended.json()["results"]["own/twice"].clone();
    assert_eq!((&twice["rows"], &twice["missed"]), (&json!(20), &json!([[10, 99]])));
}

/// Names and columns that could not be recorded are refused at once.
#[test]
fn results_that_could_not_be_described_are_refused() {
    let place = Place::new();
    let (bus, stream) = (place.bus(), StreamId::new(RunId([1; 16])));
    let create = |columns: &ResultColumns| {
        let (run, topic) = ("run".parse().unwrap(), Topic::own("x").unwrap());
        let created = ResultPublisher::<f64>::create(&bus, &run, topic, stream, columns, Arc::default());
        created.map(|_| ()).map_err(|error| error.to_string())
    };
    assert!(
        create(&ResultColumns::named(&["a b"]))
            .unwrap_err()
            .starts_with("own/x: `a b` is no name of a column")
    );
    assert_eq!(create(&ResultColumns::named(&["a_m"])), Ok(()));
    assert!(Topic::own("Upper").is_err());
}

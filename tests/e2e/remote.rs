//! Recordings behind URLs: the same bytes as from files, in few requests, whatever the network does.

mod server;

use crate::harness::Place;
use crate::object_store::Bucket;
use server::{Asked, Fault, Server};
use std::fs;
use std::path::Path;

/// States of 1000 beads, one every 100 steps: some chunks, and more than the end that comes with the first request.
const SPARSE: &str = "run --preset light-impurity --dt 2e-6 --record-every-steps 100 --out sparse.mcap";

/// A place with a sparse recording that `server` has, too.
fn sparse() -> (Place, Server) {
    let (place, server) = (Place::new(), Server::start());
    place.run(SPARSE).exits(0);
    server.put("bucket/sparse.mcap", &place.path("sparse.mcap"));
    (place, server)
}

fn total(asked: &[Asked]) -> u64 {
    asked.iter().map(|asked| asked.bytes.end - asked.bytes.start).sum()
}

/// Without what names the file.
fn without_path(mut info: serde_json::Value) -> serde_json::Value {
    info["path"].take();
    info
}

#[test]
fn info_of_an_object_takes_two_requests() {
    let (place, server) = sparse();
    let of_file = without_path(place.run("info sparse.mcap --json").exits(0).json());
    let http = format!("info http://{}/bucket/sparse.mcap --json", server.address);
    for words in ["info s3://bucket/sparse.mcap --json", &http] {
        let found = server.start_s3(&place, words).wait().exits(0).json();
        assert_eq!(without_path(found), of_file, "{words}");
        let asked = server.asked();
        assert!(asked.len() == 2 && total(&asked) <= (256 + 64) << 10, "{asked:?}");
    }
}

/// The same from a server that somebody else wrote.
#[test]
fn an_s3_server_is_asked_as_often() {
    let Some(bucket) = Bucket::new() else { return };
    let place = Place::new();
    place.run(SPARSE).exits(0);
    bucket.put("sparse.mcap", &fs::read(place.path("sparse.mcap")).unwrap());
    let url = bucket.url("sparse.mcap");
    for (words, most_requests) in [
        ("info {} --json", 2),
        ("plot {} --what velocity --at 0.0129 --every-step --force --out at.svg", 3),
        ("export {} --to csv --beads 0..3 --every-step --from 0.03 --until 0.045 --force --out part.csv", 3),
    ] {
        let of_file = place.run(&words.replace("{}", "sparse.mcap")).exits(0).stdout();
        let made = ["at.svg", "part.csv"].map(|name| fs::read(place.path(name)).ok());
        let of_object = bucket.run(&place, &words.replace("{}", &url)).exits(0).stdout();
        assert_eq!(of_object.replace(&url, "sparse.mcap"), of_file, "{words}");
        assert_eq!(["at.svg", "part.csv"].map(|name| fs::read(place.path(name)).ok()), made, "{words}");
        let requests = bucket.take_requests();
        assert!(requests.len() <= most_requests, "{words}: {requests:?}");
        assert!(
            requests.iter().all(|request| request.status == 206 && !request.range().is_empty()),
            "{requests:?}"
        );
    }
}

#[test]
fn any_step_of_a_sparse_log_takes_three_requests() {
    let (place, server) = sparse();
    let info = place.run("info sparse.mcap --json").exits(0).json();
    let steps = info["last_step"].as_u64().unwrap();
    // in a chunk, between two chunks, recorded or not
    for step in (0..=steps).step_by(4111).chain([1, 6400, 6450, 6500, 6550, 6600, steps - 1, steps]) {
        let time_s = 2e-6 * step as f64;
        let plot = |source: &str, out: &str| {
            format!("plot {source} --what velocity --at {time_s} --every-step --force --out {out}")
        };
        place.run(&plot("sparse.mcap", "file.svg")).exits(0);
        server.start_s3(&place, &plot("s3://bucket/sparse.mcap", "object.svg")).wait().exits(0);
        assert_eq!(place.read("file.svg"), place.read("object.svg"), "step {step}");
        let asked = server.asked();
        assert!(asked.len() <= 3, "step {step}: {asked:?}");
    }
}

#[test]
fn a_window_takes_a_request_for_its_stretch() {
    let (place, server) = sparse();
    let export = |source: &str, out: &str| {
        format!("export {source} --to csv --beads 0..3 --every-step --from 0.03 --until 0.045 --out {out}")
    };
    place.run(&export("sparse.mcap", "file.csv")).exits(0);
    server.start_s3(&place, &export("s3://bucket/sparse.mcap", "object.csv")).wait().exits(0);
    assert_eq!(place.read("file.csv"), place.read("object.csv"));
    let asked = server.asked();
    assert!(asked.len() <= 3, "{asked:?}");
    assert!(total(&asked) < fs::metadata(place.path("sparse.mcap")).unwrap().len(), "{asked:?}");
}

#[test]
fn every_analysis_of_an_object_gives_the_bytes_of_the_file() {
    let (place, server) = (Place::new(), Server::start());
    place.run("run --preset light-impurity --beads 600 --duration 0.02 --out run.mcap").exits(0);
    server.put("bucket/run.mcap", &place.path("run.mcap"));
    let size = fs::metadata(place.path("run.mcap")).unwrap().len();
    for (words, ending) in [
        ("energies", "csv"),
        ("impurity", "csv"),
        ("contacts", "csv"),
        ("deformation --contact 5", "csv"),
        ("pulses", "csv"),
        ("spreading", "csv"),
        ("spectrum --at bead:20", "csv"),
        ("forces --at contact:20", "csv"),
        ("plot --what velocity", "png"),
        ("export --to npz", "npz"),
        ("export --to csv --beads 0..2", "csv"),
        ("thin --every-steps 100", "mcap"),
        ("expand", "mcap"),
        ("recover", "mcap"),
        ("share", "html"),
    ] {
        let (command, options) = words.split_once(' ').unwrap_or((words, ""));
        let run = |source: &str, out: &str| format!("{command} {source} {options} --out {out}.{ending}");
        place.run(&run("run.mcap", "file")).exits(0);
        server.start_s3(&place, &run("s3://bucket/run.mcap", "object")).wait().exits(0);
        let read = |out: &str| fs::read(place.path(format!("{out}.{ending}"))).unwrap();
        // where it was read from is written into tables and pages
        let strip = |bytes: Vec<u8>| String::from_utf8_lossy(&bytes).replace("s3://bucket/", "");
        assert_eq!(strip(read("object")), strip(read("file")), "{words}");
        let asked = server.asked();
        println!(
            "{words}: {} requests, {:.2} times its bytes",
            asked.len(),
            total(&asked) as f64 / size as f64
        );
        for out in ["file", "object"] {
            fs::remove_file(place.path(format!("{out}.{ending}"))).unwrap();
        }
    }
    for words in ["verify s3://bucket/run.mcap", "replay s3://bucket/run.mcap --wait-for 0"] {
        server.start_s3(&place, words).wait().exits(0);
    }
}

/// What takes a recording in other ways than analyses do.
#[test]
fn modes_checks_and_initial_states_are_taken_from_objects() {
    let (place, server) = (Place::new(), Server::start());
    let run = "run --preset precompressed --duration 2e-3 --record-every-steps 50 --out run.mcap";
    place.run(run).exits(0);
    server.put("bucket/run.mcap", &place.path("run.mcap"));
    for words in ["modes {} --json", "check {} --json"] {
        let file = place.run(&words.replace("{}", "run.mcap")).exits(0).stdout();
        let words = words.replace("{}", "s3://bucket/run.mcap");
        let object = server.start_s3(&place, &words).wait().exits(0).stdout();
        assert_eq!(object.replace("s3://bucket/", ""), file, "{words}");
    }
    server.asked();
    let preset = place.run("preset precompressed").exits(0).stdout();
    let unstruck = preset.replace("[striker]\nbead = 0\nvelocity_m_s = 0.01\n", "");
    assert_ne!(unstruck, preset);
    let initial = |source: &str| {
        let from = format!("[initial]\nfrom = {{ recording = \"{source}\", step = 180 }}\n");
        place.write("begun.toml", &(unstruck.clone() + &from));
        let words = "run begun.toml --no-record --duration 1e-5 --dry-run --json";
        server.start_s3(&place, words).wait().exits(0).json()["manifest"]["physics"]["initial"].to_string()
    };
    let (file, object) = (initial("run.mcap"), initial("s3://bucket/run.mcap"));
    assert!(file.contains("sha256"), "{file}");
    assert_eq!(object.replace("s3://bucket/", ""), file);
    assert!(server.asked().len() <= 3);
}

#[test]
fn reading_through_an_object_takes_few_large_requests() {
    let (place, server) = (Place::new(), Server::start());
    place.run("run --preset light-impurity --out run.mcap").exits(0);
    server.put("bucket/run.mcap", &place.path("run.mcap"));
    let size = fs::metadata(place.path("run.mcap")).unwrap().len();
    place.run("energies run.mcap --out file.csv").exits(0);
    server.start_s3(&place, "energies s3://bucket/run.mcap --out object.csv").wait().exits(0);
    assert_eq!(place.read("file.csv"), place.read("object.csv"));
    let asked = server.asked();
    assert!(asked.len() as u64 <= 3 + size.div_ceil(8 << 20), "{size} bytes: {asked:?}");
    assert!(total(&asked) <= size, "{size} bytes: {asked:?}");
}

#[test]
fn cut_connections_and_throttling_cost_only_time() {
    let (place, server) = sparse();
    place.run("energies sparse.mcap --every-step --out file.csv").exits(0);
    let throttled = Fault::Status(503, "<Error><Code>SlowDown</Code></Error>");
    server.faults([throttled, Fault::Cut(1000), Fault::None, Fault::Cut(7000), throttled, Fault::Cut(0)]);
    let words = "energies s3://bucket/sparse.mcap --every-step --out object.csv";
    server.start_s3(&place, words).wait().exits(0);
    assert_eq!(place.read("file.csv"), place.read("object.csv"));
    assert!(server.requests() >= 8, "{:?}", server.asked());
    server.always(Some(throttled));
    let ended = server.start_s3(&place, "info s3://bucket/sparse.mcap").wait().exits(2);
    ended.says(&["s3://bucket/sparse.mcap", "503", "SlowDown", "retries"]);
}

#[test]
fn an_object_that_changes_is_an_error() {
    let (place, server) = sparse();
    for before in [1, 2] {
        let faults = std::iter::repeat_n(Fault::None, before).chain([Fault::Change]);
        server.faults(faults);
        let words = "energies s3://bucket/sparse.mcap --every-step --out object.csv";
        let ended = server.start_s3(&place, words).wait();
        // what came before is kept, as of a damaged file
        assert!(matches!(ended.code(), Some(2 | 3)), "{}", ended.stderr());
        ended.says(&["s3://bucket/sparse.mcap", "changed while it was read"]);
    }
}

#[test]
fn what_a_store_refuses_is_said() {
    let (place, server) = sparse();
    let info = |url: &str| server.start_s3(&place, &format!("info {url}")).wait().exits(2);
    info("s3://bucket/other.mcap").says(&["s3://bucket/other.mcap", "no such object"]);
    let error = |code: &str| -> &'static str { format!("<Error><Code>{code}</Code></Error>").leak() };
    server.always(Some(Fault::Status(404, error("NoSuchBucket"))));
    info("s3://buckte/sparse.mcap").says(&["s3://buckte/sparse.mcap", "no such bucket"]);
    server.always(Some(Fault::Status(403, error("InvalidAccessKeyId"))));
    info("s3://bucket/sparse.mcap").says(&["access denied: InvalidAccessKeyId", "AWS_ACCESS_KEY_ID"]);
    server.always(None);
    info("s3://bucket/").says(&["no object is named", "s3://BUCKET/KEY"]);
    fs::write(place.path("text"), "not a recording").unwrap();
    server.put("bucket/text", &place.path("text"));
    info("s3://bucket/text").says(&["s3://bucket/text", "not"]);
    fs::write(place.path("empty"), "").unwrap();
    server.put("bucket/empty", &place.path("empty"));
    info("s3://bucket/empty").says(&["s3://bucket/empty", "not"]);
    server.without_ranges();
    info("s3://bucket/sparse.mcap").says(&["range requests"]);
}

#[test]
fn ls_lists_recordings_from_summaries_only() {
    let (place, server) = sparse();
    let dir = place.path("results");
    fs::create_dir_all(dir.join("below")).unwrap();
    place.run("run --preset homogeneous --beads 40 --out results/below/small.mcap").exits(0);
    let whole = fs::read(place.path("sparse.mcap")).unwrap();
    fs::write(dir.join("cut.mcap.partial"), &whole[..whole.len() / 2]).unwrap();
    fs::copy(place.path("sparse.mcap"), dir.join("sparse.mcap")).unwrap();
    for name in ["below/small.mcap", "cut.mcap.partial", "sparse.mcap"] {
        server.put(&format!("bucket/results/{name}"), &dir.join(name));
    }
    server.put("bucket/results/notes.txt", Path::new("/dev/null"));
    let rows = |words: &str| {
        let found = server.start_s3(&place, words).wait().exits(0).json();
        found.as_array().unwrap().iter().cloned().map(without_path).collect::<Vec<_>>()
    };
    let of_files = rows("ls results --json");
    assert_eq!(of_files.len(), 3);
    assert_eq!(server.requests(), 0);
    assert_eq!(rows("ls s3://bucket/results --json"), of_files);
    let asked = server.asked();
    assert!(asked.len() <= 6, "{asked:?}");
    let text = server.start_s3(&place, "ls s3://bucket/results/").wait().exits(0).stdout();
    for word in ["below/small.mcap", "light-impurity", "every 100 steps", "complete", "not closed"] {
        assert!(text.contains(word), "{word}: {text}");
    }
}

#[test]
fn a_damaged_object_is_recovered_into_a_file() {
    let (place, server) = sparse();
    let mut bytes = fs::read(place.path("sparse.mcap")).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    fs::write(place.path("damaged.mcap"), &bytes).unwrap();
    server.put("bucket/damaged.mcap", &place.path("damaged.mcap"));
    let recover = |source: &str, out: &str| format!("recover {source} --out {out} --json");
    let file = place.run(&recover("damaged.mcap", "file.mcap"));
    let object = server.start_s3(&place, &recover("s3://bucket/damaged.mcap", "object.mcap")).wait();
    assert_eq!(object.code(), file.code(), "{}", object.stderr());
    assert_eq!(fs::read(place.path("object.mcap")).unwrap(), fs::read(place.path("file.mcap")).unwrap());
    place.run("verify object.mcap").exits(0);
}

//! Recordings that go to a store: sent while they are written, tried again, sent later.

use crate::harness::{Place, wait_until};
use crate::object_store::{Act, Bucket, Request};
use recording::RecordingInfo;
use std::fs;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

/// Some 20 MB of recording, in a second or more.
const CHAIN: &str =
    "run --beads 300 --impurity 150=0.6e-3 --duration 0.03 --name run --pace 0.03 --spool spool";

const PART_BYTES: u64 = 5 << 20;

/// The recording of an object, as long as it is here.
fn spooled(place: &Place, bucket: &Bucket, key: &str) -> PathBuf {
    place.path(format!("spool/s3/{}/{key}", bucket.name))
}

fn is_complete(place: &Place, bytes: &[u8]) -> bool {
    let path = place.path("object.mcap");
    fs::write(&path, bytes).unwrap();
    RecordingInfo::read(&path).unwrap().is_complete()
}

#[test]
fn a_recording_is_sent_while_it_is_written_and_is_there_when_it_is_whole() {
    let (place, Some(bucket)) = (Place::new(), Bucket::new()) else { return };
    let (file, copy) = (spooled(&place, &bucket, "runs/run.mcap"), place.path("copy.mcap"));
    let was_early = Arc::new(AtomicBool::new(false));
    let (early, from, to) = (Arc::clone(&was_early), file.clone(), copy.clone());
    bucket.behave(move |request| {
        if request.is_part() && !from.exists() {
            early.store(true, Ordering::Relaxed);
        }
        if request.is_completion() {
            fs::copy(&from, &to).unwrap();
        }
        Act::Pass
    });
    let url = bucket.url("runs/run.mcap");
    let ended = bucket.run(&place, &format!("{CHAIN} --out {url} --json")).exits(0).says(&["until then"]);
    assert!(was_early.load(Ordering::Relaxed), "a part is sent before the recording is finished");
    let (object, local) = (bucket.get("runs/run.mcap").unwrap(), fs::read(copy).unwrap());
    assert!(object == local, "{} bytes, {} here", object.len(), local.len());
    assert!(is_complete(&place, &object));
    let size = object.len() as u64;
    let json = ended.json();
    assert_eq!(json["recording"]["path"], url);
    assert_eq!(json["upload"]["sent"][0]["bytes"], size);
    assert!(!place.path("spool/s3").exists(), "nothing stays here");
    assert_eq!(bucket.open_uploads(), 0);

    let requests = bucket.take_requests();
    let parts: Vec<_> = requests.iter().filter(|request| request.is_part()).collect();
    assert_eq!(parts.len() as u64, size.div_ceil(PART_BYTES));
    assert_eq!(parts.iter().map(|part| part.sent_bytes).sum::<u64>(), size);
    assert!(parts.iter().all(|part| part.sent_bytes <= PART_BYTES));
    // begun, completed, and looked at: before it begins, before it is completed, and after it
    assert_eq!(requests.len() - parts.len(), 5, "{requests:?}");
    let conditions = requests.iter().filter_map(|request| request.headers.get("if-none-match"));
    assert_eq!(conditions.collect::<Vec<_>>(), ["*"]);
}

#[test]
fn what_a_store_does_not_take_is_sent_again() {
    let (place, Some(bucket)) = (Place::new(), Bucket::new()) else { return };
    let file = spooled(&place, &bucket, "run.mcap");
    let (copy, number) = (place.path("copy.mcap"), AtomicU64::new(0));
    let to = copy.clone();
    bucket.behave(move |request| {
        if request.is_completion() && file.exists() {
            fs::copy(&file, &to).unwrap();
        }
        let is_data = request.is_part() || request.is_completion();
        match (is_data, number.fetch_add(u64::from(is_data), Ordering::Relaxed) % 4) {
            (true, 0) => Act::Refuse(503, "SlowDown"),
            (true, 1) => Act::CutRequest(1 << 20),
            (true, 2) => Act::CutAnswer(0),
            _ => Act::Delay(Duration::from_millis(100)),
        }
    });
    bucket.run(&place, &format!("{CHAIN} --out {}", bucket.url("run.mcap"))).exits(0);
    assert!(bucket.get("run.mcap").unwrap() == fs::read(copy).unwrap());
    assert_eq!(bucket.open_uploads(), 0);
}

#[test]
fn a_store_that_refuses_does_so_before_the_run_begins() {
    let (place, Some(bucket)) = (Place::new(), Bucket::new()) else { return };
    let short = "run --preset homogeneous --duration 1e-4 --spool spool";
    bucket
        .run(&place, &format!("{short} --out s3://no-such-bucket/run.mcap"))
        .exits(1)
        .says(&["s3://no-such-bucket/run.mcap", "no such bucket"]);
    bucket.behave(|_| Act::Refuse(403, "InvalidAccessKeyId"));
    let url = bucket.url("run.mcap");
    bucket
        .run(&place, &format!("{short} --out {url}"))
        .exits(1)
        .says(&["access denied", "AWS_ACCESS_KEY_ID"]);
    bucket.behave(|_| Act::Pass);
    bucket.put("run.mcap", b"mine");
    bucket.run(&place, &format!("{short} --out {url}")).exits(2).says(&["exists already", "--force"]);
    assert_eq!(bucket.get("run.mcap").unwrap(), b"mine");
    bucket.run(&place, &format!("{short} --out {url} --force")).exits(0);
    assert!(is_complete(&place, &bucket.get("run.mcap").unwrap()));
    assert_eq!(bucket.open_uploads(), 0);
    bucket.run(&place, "run --out http://127.0.0.1:1/run.mcap").exits(2).says(&["only read"]);
    bucket.run(&place, "run --spool spool").exits(2).says(&["--spool", "URL"]);
}

/// Somebody else's object appears after the run began.
#[test]
fn an_object_that_appears_meanwhile_is_not_replaced() {
    let (place, Some(bucket)) = (Place::new(), Bucket::new()) else { return };
    let bucket = Arc::new(bucket);
    let other = Arc::clone(&bucket);
    bucket.behave(move |request| {
        if request.is_completion() {
            // after the last look at it
            other.put("run.mcap", b"theirs");
        }
        Act::Pass
    });
    let url = bucket.url("run.mcap");
    let file = spooled(&place, &bucket, "run.mcap");
    let advice = format!("beadline upload {} {url}", file.display());
    let run = format!("{CHAIN} --out {url} --spool {}", place.path("spool").display());
    let run = run.replacen("--spool spool ", "", 1);
    bucket.run(&place, &run).exits(3).says(&["exists already", &advice]);
    assert_eq!(bucket.get("run.mcap").unwrap(), b"theirs");
    assert!(RecordingInfo::read(&file).unwrap().is_complete());
    assert_eq!(bucket.open_uploads(), 0);
}

/// Credentials expire, and nothing that was sent can be removed.
#[test]
fn a_run_outlives_its_store_and_is_sent_later() {
    let (place, Some(bucket)) = (Place::new(), Bucket::new()) else { return };
    let mut parts = 0;
    bucket.behave(move |request| {
        parts += u64::from(request.is_part());
        if parts > 1 { Act::Refuse(403, "ExpiredToken") } else { Act::Pass }
    });
    let url = bucket.url("run.mcap");
    bucket
        .run(&place, &format!("{CHAIN} --out {url}"))
        .exits(3)
        .says(&["ExpiredToken", "beadline upload spool/s3/"]);
    let file = spooled(&place, &bucket, "run.mcap");
    assert!(RecordingInfo::read(&file).unwrap().is_complete());
    assert_eq!(bucket.open_uploads(), 1);
    assert!(bucket.get("run.mcap").is_none());

    bucket.behave(|_| Act::Pass);
    let upload = format!("upload {} {url}", file.display());
    let sent = bucket.run(&place, &format!("{upload} --json")).exits(0).json();
    assert_eq!(sent[0]["url"], url);
    assert!(bucket.get("run.mcap").unwrap() == fs::read(&file).unwrap());
    assert_eq!(bucket.open_uploads(), 0, "what the run had sent is removed");
    bucket.run(&place, &upload).exits(2).says(&["exists already"]);
}

#[test]
fn a_network_that_goes_away_costs_nothing() {
    let (place, Some(bucket)) = (Place::new(), Bucket::new()) else { return };
    let mut parts = 0;
    bucket.behave(move |request| {
        parts += u64::from(request.is_part());
        if parts > 1 { Act::CutRequest(0) } else { Act::Pass }
    });
    let url = bucket.url("run.mcap");
    bucket.run(&place, &format!("{CHAIN} --out {url}")).exits(3).says(&["beadline upload spool/s3/"]);
    bucket.behave(|_| Act::Pass);
    let file = spooled(&place, &bucket, "run.mcap");
    bucket.run(&place, &format!("upload {} {url}", file.display())).exits(0);
    assert!(bucket.get("run.mcap").unwrap() == fs::read(&file).unwrap());
    assert_eq!(bucket.open_uploads(), 0);
}

/// The store has become slow, and somebody does not wait for it any longer.
#[test]
fn sending_the_rest_can_be_left_for_later() {
    let (place, Some(bucket)) = (Place::new(), Bucket::new()) else { return };
    // the last part is smaller; it is sent when the run has ended
    let has_ended = Arc::new(AtomicBool::new(false));
    let seen = Arc::clone(&has_ended);
    bucket.behave(move |request| {
        let is_last = request.is_part() && request.sent_bytes < PART_BYTES;
        seen.fetch_or(is_last, Ordering::Relaxed);
        if is_last { Act::Delay(Duration::from_secs(100)) } else { Act::Pass }
    });
    let (url, file) = (bucket.url("run.mcap"), spooled(&place, &bucket, "run.mcap"));
    let run = bucket.start(&place, &format!("{CHAIN} --out {url}"));
    wait_until("the last part", || has_ended.load(Ordering::Relaxed).then_some(()));
    run.signal("INT");
    run.wait().exits(3).says(&["beadline upload spool/s3/"]);
    assert!(bucket.get("run.mcap").is_none());
    bucket.behave(|_| Act::Pass);
    bucket.run(&place, &format!("upload {} {url}", file.display())).exits(0);
    assert!(bucket.get("run.mcap").unwrap() == fs::read(&file).unwrap());
    assert_eq!(bucket.open_uploads(), 0);
}

/// A second upload of the same recording would give up what the first one has sent.
#[test]
fn an_upload_under_way_is_left_alone() {
    let (place, Some(bucket)) = (Place::new(), Bucket::new()) else { return };
    large(&place);
    let url = bucket.url("run.mcap");
    bucket.behave(|request| if request.is_part() { Act::Delay(Duration::from_secs(100)) } else { Act::Pass });
    let first = bucket.start(&place, &format!("upload run.mcap {url}"));
    wait_until("a part", || bucket.requests().iter().any(Request::is_part).then_some(()));
    let note = place.read("run.mcap.upload");
    std::os::unix::fs::symlink("run.mcap", place.path("link.mcap")).unwrap();
    for words in [format!("run.mcap {url}"), format!("link.mcap {}", bucket.url("other.mcap"))] {
        let second = bucket.run(&place, &format!("upload {words}"));
        second.exits(1).says(&["run.mcap is being sent by another process"]);
        assert_eq!((bucket.open_uploads(), place.read("run.mcap.upload")), (1, note.clone()));
    }
    first.signal("KILL");
    first.wait();
    bucket.behave(|_| Act::Pass);
    // the file that a link leads to
    bucket.run(&place, &format!("upload link.mcap {url}")).exits(0);
    assert!(bucket.get("run.mcap").unwrap() == fs::read(place.path("run.mcap")).unwrap());
    assert_eq!(bucket.open_uploads(), 0);
    // where no note can be written, nothing is begun
    fs::create_dir(place.path("run.mcap.upload")).unwrap();
    let ended = bucket.run(&place, &format!("upload run.mcap {}", bucket.url("other.mcap")));
    ended.exits(1).says(&["run.mcap.upload", "cannot be written"]);
    assert_eq!(bucket.open_uploads(), 0);
}

/// A run that is killed once a part of it is sent.
fn killed(place: &Place, bucket: &Bucket) {
    let run = CHAIN.replace("--pace 0.03", "--pace 0.003");
    let run = bucket.start(place, &format!("{run} --out {}", bucket.url("run.mcap")));
    wait_until("a part", || bucket.requests().iter().any(Request::is_part).then_some(()));
    run.signal("KILL");
    assert_eq!(run.wait().killed_by(), Some(9));
    assert_eq!(bucket.open_uploads(), 1);
}

#[test]
fn what_is_left_of_a_killed_run_is_recovered_and_sent() {
    let (place, Some(bucket)) = (Place::new(), Bucket::new()) else { return };
    killed(&place, &bucket);
    let file = spooled(&place, &bucket, "run.mcap");
    let partial = file.with_extension("mcap.partial");
    let url = bucket.url("run.mcap");
    bucket
        .run(&place, &format!("upload {} {url}", partial.display()))
        .exits(0)
        .says(&["was not closed", "run.mcap is made of it"]);
    assert!(bucket.get("run.mcap").unwrap() == fs::read(&file).unwrap());
    let info = RecordingInfo::read(&file).unwrap();
    assert!(info.finished && info.frames() > 100, "{info:?}");
    assert_eq!(bucket.open_uploads(), 0);
}

#[test]
fn a_killed_run_goes_on_and_is_sent() {
    let (place, Some(bucket)) = (Place::new(), Bucket::new()) else { return };
    killed(&place, &bucket);
    let partial = spooled(&place, &bucket, "run.mcap").with_extension("mcap.partial");
    let url = bucket.url("run.mcap");
    bucket.run(&place, &format!("run --resume {} --out {url} --spool spool", partial.display())).exits(0);
    assert!(is_complete(&place, &bucket.get("run.mcap").unwrap()));
    assert_eq!(bucket.open_uploads(), 0);
    assert!(!place.path("spool/s3").exists());
}

#[test]
fn each_part_of_a_recording_is_an_object() {
    let (place, Some(bucket)) = (Place::new(), Bucket::new()) else { return };
    let run =
        place.start("run --beads 300 --impurity none --duration 0.02 --name run --no-record --wait-for 1");
    let url = bucket.url("runs/run.mcap");
    let record = format!("record live:run --out {url} --split-size 2MB --spool spool --timeout 100 --json");
    let json = bucket.run(&place, &record).exits(0).json();
    run.wait().exits(0);
    let sent = json["upload"]["sent"].as_array().unwrap();
    assert!(sent.len() > 2, "{json}");
    let mut files = Vec::new();
    for number in 1..=sent.len() {
        let name = format!("run-part-{number:04}.mcap");
        assert_eq!(sent[number - 1]["url"], bucket.url(&format!("runs/{name}")));
        fs::write(place.path(&name), bucket.get(&format!("runs/{name}")).unwrap()).unwrap();
        files.push(name);
    }
    place.run(&format!("verify {}", files.join(" "))).exits(0);
    assert_eq!(bucket.open_uploads(), 0);
    assert!(!place.path("spool/s3").exists());
    // a shorter recording would leave the last parts of this one
    bucket.put("runs/left-part-0002.mcap", b"of a longer one");
    for (name, part) in [("run", "0001"), ("left", "0002")] {
        let run = place
            .start("run --beads 300 --impurity none --duration 0.02 --name run --no-record --wait-for 1");
        let ended =
            bucket.run(&place, &format!("{} --force", record.replace("runs/run", &format!("runs/{name}"))));
        let (there, all) = (format!("{name}-part-{part}.mcap exists already"), format!("{name}-part-*.mcap"));
        ended.exits(2).says(&[&there, "not replaced", &all]);
        run.signal("KILL");
        run.wait();
        assert_eq!(bucket.open_uploads(), 0);
    }
}

/// A recording of some 20 MB, and its size.
fn large(place: &Place) -> u64 {
    place.run("run --beads 300 --impurity 150=0.6e-3 --duration 0.03 --name run --out run.mcap").exits(0);
    let size = fs::metadata(place.path("run.mcap")).unwrap().len();
    assert!(size > 3 * PART_BYTES, "{size}");
    size
}

/// Bytes of parts that were sent since the last look, whole.
fn part_bytes(bucket: &Bucket) -> u64 {
    let requests = bucket.take_requests();
    requests.iter().filter(|part| part.is_part() && part.status == 200).map(|part| part.sent_bytes).sum()
}

/// However an upload was interrupted, the next one sends what the store has not, and nothing else.
#[test]
fn an_upload_goes_on_with_the_parts_that_the_store_has() {
    let (place, Some(bucket)) = (Place::new(), Bucket::new()) else { return };
    let size = large(&place);
    let two_parts = |act: Act| {
        let mut parts = 0;
        move |request: &Request| {
            parts += u64::from(request.is_part());
            if parts > 2 && request.is_part() { act } else { Act::Pass }
        }
    };
    let slow = Act::Delay(Duration::from_secs(100));
    for (number, act, signal) in
        [(0, Act::Refuse(403, "ExpiredToken"), None), (1, slow, Some("KILL")), (2, slow, Some("INT"))]
    {
        let key = format!("{number}.mcap");
        let upload = format!("upload run.mcap {} --json", bucket.url(&key));
        bucket.behave(two_parts(act));
        let running = bucket.start(&place, &upload);
        if let Some(signal) = signal {
            let parts = || bucket.requests().iter().filter(|request| request.is_part()).count();
            wait_until("two parts", || (parts() == 2).then_some(()));
            running.signal(signal);
        }
        let ended = running.wait();
        assert!(ended.code() != Some(0) && bucket.get(&key).is_none(), "{number}: {}", ended.stderr());
        assert_eq!(part_bytes(&bucket), 2 * PART_BYTES, "{number}");
        bucket.behave(|_| Act::Pass);
        let sent = bucket.run(&place, &upload).exits(0).json();
        assert_eq!(part_bytes(&bucket), size - 2 * PART_BYTES, "{number}");
        assert_eq!(sent[0]["bytes_of_earlier_attempts"], 2 * PART_BYTES, "{sent}");
        assert!(bucket.get(&key).unwrap() == fs::read(place.path("run.mcap")).unwrap(), "{number}");
        assert_eq!(bucket.open_uploads(), 0);
        assert!(!place.path("run.mcap.upload").exists());
    }
}

/// What the store has under the number of a part is not what the file holds.
#[test]
fn a_part_that_differs_is_sent_again() {
    let (place, Some(bucket)) = (Place::new(), Bucket::new()) else { return };
    let size = large(&place);
    let upload = format!("upload run.mcap {}", bucket.url("run.mcap"));
    bucket.behave(
        |request| {
            if request.is_completion() { Act::Refuse(403, "ExpiredToken") } else { Act::Pass }
        },
    );
    bucket.run(&place, &upload).exits(1).says(&["ExpiredToken"]);
    assert_eq!(part_bytes(&bucket), size);
    let mut wrong =
        fs::read(place.path("run.mcap")).unwrap()[..usize::try_from(PART_BYTES).unwrap()].to_vec();
    wrong[4711] ^= 1;
    bucket.put_part("run.mcap", 1, &wrong);
    bucket.put_part("run.mcap", 2, b"short");
    bucket.behave(|_| Act::Pass);
    bucket.run(&place, &upload).exits(0);
    assert_eq!(part_bytes(&bucket), 2 * PART_BYTES);
    assert!(bucket.get("run.mcap").unwrap() == fs::read(place.path("run.mcap")).unwrap());
    assert_eq!(bucket.open_uploads(), 0);
}

/// The store has forgotten the upload, or the file is another recording by now.
#[test]
fn an_upload_that_cannot_be_gone_on_with_begins_anew() {
    let (place, Some(bucket)) = (Place::new(), Bucket::new()) else { return };
    let url = bucket.url("run.mcap");
    let run = "run --preset striker-3g --duration 1e-3 --out run.mcap --force";
    for number in 0..2 {
        place.run(run).exits(0);
        bucket.behave(
            |request| {
                if request.is_completion() { Act::Refuse(403, "ExpiredToken") } else { Act::Pass }
            },
        );
        bucket.run(&place, &format!("upload run.mcap {url} --force")).exits(1);
        bucket.behave(|_| Act::Pass);
        if number == 0 {
            // another run under the same name
            place.run(run).exits(0);
        } else {
            let note = place.read("run.mcap.upload");
            let (_, id) = note.lines().next().unwrap().rsplit_once(' ').unwrap();
            place.write("run.mcap.upload", &note.replace(id, "no-such-upload"));
        }
        part_bytes(&bucket);
        bucket.run(&place, &format!("upload run.mcap {url} --force")).exits(0);
        assert_eq!(part_bytes(&bucket), fs::metadata(place.path("run.mcap")).unwrap().len());
        assert!(bucket.get("run.mcap").unwrap() == fs::read(place.path("run.mcap")).unwrap());
        assert_eq!(
            bucket.open_uploads(),
            number,
            "one that nobody knows of stays until the bucket's rule removes it"
        );
    }
}

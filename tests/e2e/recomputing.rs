//! What a source does not hold is recomputed, with the same bits.

use crate::harness::{Place, wait_until};

/// A chain small enough to be quick, with everything that the light-impurity run has.
const SMALL: &str = "run --beads 120 --impurity 60=0.6e-3 --duration 0.012 --name small";

/// Asserts that two tables hold the same bytes.
#[track_caller]
fn assert_equal(place: &Place, one: &str, other: &str) {
    assert!(place.read(one) == place.read(other), "{one} and {other} differ");
}

#[test]
fn a_sparse_recording_holds_every_step() {
    let place = Place::new();
    for method in ["rkn4", "gear5"] {
        place.run(&format!("{SMALL} --method {method} --out full.mcap --force")).exits(0);
        let sparse = format!("{SMALL} --method {method} --record-every-steps 100 --out sparse.mcap --force");
        place.run(&sparse).exits(0);
        for (file, flags) in [("full", ""), ("sparse", "--every-step")] {
            let common = format!("{file}.mcap {flags} --force");
            place.run(&format!("energies {common} --out energies-{file}.csv")).exits(0);
            place.run(&format!("impurity {common} --out i-{file}.csv --events events-{file}.csv")).exits(0);
            place.run(&format!("contacts {common} --out contacts-{file}.csv")).exits(0);
        }
        for table in ["energies", "i", "events", "contacts"] {
            assert_equal(&place, &format!("{table}-full.csv"), &format!("{table}-sparse.csv"));
        }
    }
}

#[test]
fn steps_between_frames_can_be_had_too() {
    let place = Place::new();
    place.run(&format!("{SMALL} --publish-every-steps 7 --out sevenths.mcap")).exits(0);
    let result = place.run("energies sevenths.mcap --every-step --out energies.csv --json").exits(0).json();
    let table = place.read("energies.csv");
    let steps: Vec<u64> =
        table.lines().skip(1).map(|row| row.split(',').nth(1).unwrap().parse().unwrap()).collect();
    assert!(steps.iter().enumerate().all(|(i, step)| i as u64 == *step), "each step once");
    assert_eq!(result["frames_received"], steps.len() as u64);
}

/// The rows of a table whose time (the third column) is from `from_s` to `until_s`, after its head.
fn rows_within(place: &Place, table: &str, from_s: f64, until_s: f64) -> String {
    let text = place.read(table);
    let time_s = |row: &str| row.split(',').nth(2).unwrap().parse::<f64>().unwrap();
    let is_within = |row: &&str| (from_s..=until_s).contains(&time_s(row));
    let (head, rows) = text.split_once('\n').unwrap();
    std::iter::once(head).chain(rows.lines().filter(is_within)).flat_map(|row| [row, "\n"]).collect()
}

/// The steps of any part, also of one that begins and ends between recorded states, with one thread and several.
#[test]
fn any_part_of_a_sparse_recording_can_be_had() {
    let place = Place::new();
    place.run(&format!("{SMALL} --out full.mcap")).exits(0);
    place.run("thin full.mcap --every-steps 1000 --out sparse.mcap").exits(0);
    place.run("contacts full.mcap --out contacts.csv").exits(0);
    place.run("impurity full.mcap --out impurity.csv").exits(0);
    let table = place.read("contacts.csv");
    let time_s = |step: usize| table.lines().nth(step + 1).unwrap().split(',').nth(2).unwrap().to_owned();
    let last = table.lines().count() - 2;
    for (from, until) in [(0, 30), (999, 1001), (1000, 3000), (2345, 2345), (4000, last), (last, last)] {
        let window = format!("--from {} --until {}", time_s(from), time_s(until));
        let (from_s, until_s) = (time_s(from).parse().unwrap(), time_s(until).parse().unwrap());
        for (file, flags) in
            [("full", ""), ("sparse", "--every-step --jobs 1"), ("sparse", "--every-step --jobs 3")]
        {
            for analysis in ["contacts", "impurity"] {
                let made = place
                    .run(&format!("{analysis} {file}.mcap {flags} {window} --out part.csv --force --json"));
                let made = made.exits(0).json();
                let end = if until == last { "complete" } else { "as asked" };
                assert_eq!((made["end"].as_str(), made["frames_missed"].as_u64()), (Some(end), Some(0)));
                assert_eq!(made["frames_received"], until - from + 1);
                let expected = rows_within(&place, &format!("{analysis}.csv"), from_s, until_s);
                assert!(place.read("part.csv") == expected, "{analysis} {file} {flags} {window}");
            }
        }
    }
}

#[test]
fn a_part_that_is_none_is_refused() {
    let place = Place::new();
    place.run(&format!("{SMALL} --record-every-steps 100 --out run.mcap")).exits(0);
    place
        .run("energies run.mcap --from 0.01 --from-start")
        .exits(2)
        .says(&["--from-start", "cannot be used with"]);
    place.run("energies run.mcap --from 0.01 --until 0.005").exits(2).says(&["--from 0.01", "--until 0.005"]);
    place.run("energies run.mcap --from 1").exits(2).says(&["the run ends at 0.01"]);
    place.run("energies run.mcap --from -1").exits(2).says(&["0 or more"]);
    let part = place.run("energies run.mcap --from 0.001 --until 0.0045").exits(0).stdout();
    assert!(part.contains("until 0.0045 s, as asked"), "{part}");
    place.run("energies run.mcap --from 0.0100001 --until 0.0100002").exits(0).says(&["--every-step"]);
}

/// Every analysis gives the same bytes with one thread and with several.
#[test]
fn the_number_of_threads_decides_nothing() {
    let place = Place::new();
    place.run(&format!("{SMALL} --method gear5 --record-every-steps 500 --out run.mcap")).exits(0);
    for jobs in [1, 2, 7] {
        let common = format!("run.mcap --every-step --jobs {jobs}");
        place.run(&format!("energies {common} --out energies-{jobs}.csv")).exits(0);
        place.run(&format!("impurity {common} --out i-{jobs}.csv --events events-{jobs}.csv")).exits(0);
        place.run(&format!("contacts {common} --out contacts-{jobs}.csv")).exits(0);
        place.run(&format!("pulses {common} --out pulses-{jobs}.csv --positions tracks-{jobs}.csv")).exits(0);
        place.run(&format!("deformation {common} --contact 30 --out d-{jobs}.csv")).exits(0);
    }
    for table in ["energies", "i", "events", "contacts", "pulses", "tracks", "d"] {
        for jobs in [2, 7] {
            assert_equal(&place, &format!("{table}-1.csv"), &format!("{table}-{jobs}.csv"));
        }
    }
}

/// A live run is followed from a time to a time: who attached before begins there, and leaves at the end.
#[test]
fn a_part_of_a_live_run_can_be_had() {
    let place = Place::new();
    let run = place.start(&format!("{SMALL} --wait-for 2 --out run.mcap"));
    let window = "--from 0.004 --until 0.006 --no-publish --json";
    let part = place.start(&format!("energies {window} --out part.csv"));
    let steps = place.start(&format!("energies {window} --every-step --out steps.csv"));
    for consumer in [part, steps] {
        assert_eq!(consumer.wait().exits(0).json()["end"], "as asked");
    }
    run.wait().exits(0);
    place.run("energies run.mcap --out all.csv").exits(0);
    let expected = rows_within(&place, "all.csv", 0.004, 0.006);
    assert!(place.read("part.csv") == expected && place.read("steps.csv") == expected);
}

/// A consumer that comes late, and one that is stopped on the way and loses frames, end up with the table
/// of the one that was there from the start.
#[test]
fn nothing_is_missed_by_coming_late_or_by_losing_frames() {
    let place = Place::new();
    // about six seconds, so that others can attach on the way
    let run = place.start(&format!("{SMALL} --wait-for 1 --no-record --pace 0.002"));
    let early = place.start("energies --out early.csv --no-publish");
    place.wait_for_run("small", |run| run.step > 200);
    let late = place.start("energies --out late.csv --no-publish --from-start --json");
    let losing =
        place.start("energies --out losing.csv --no-publish --latest --from-start --fill-gaps --json");
    place.wait_for_run("small", |run| run.latest > 0 && run.lossless > 1);
    losing.signal("STOP");
    wait_until("the run's end", || {
        let runs = bus::list_runs(&place.bus()).unwrap();
        runs.iter().all(|run| !run.is_live()).then_some(())
    });
    losing.signal("CONT");
    run.wait().exits(0);
    early.wait().exits(0);
    for consumer in [late, losing] {
        let summary = consumer.wait().exits(0).json();
        assert_eq!((summary["first_frame"].as_u64(), summary["frames_missed"].as_u64()), (Some(0), Some(0)));
    }
    assert_equal(&place, "early.csv", "late.csv");
    assert_equal(&place, "early.csv", "losing.csv");
}

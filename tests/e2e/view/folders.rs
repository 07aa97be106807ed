//! Folders of strangers: what a row says, and what nobody is led to.

use super::{SMALL, Server};
use crate::harness::Place;
use crate::lying;
use recording::BeginRecord;
use schemas::frame::EndReason;
use std::fs;
use std::os::unix::fs::symlink;

#[test]
fn links_that_lead_out_of_a_folder_are_neither_listed_nor_opened() {
    let place = Place::new();
    for name in ["folder", "folder/inner"] {
        fs::create_dir(place.path(name)).unwrap();
    }
    place.run(&format!("{SMALL} --out secret.mcap")).exits(0);
    for name in ["folder/a.mcap", "folder/inner/b.mcap"] {
        fs::copy(place.path("secret.mcap"), place.path(name)).unwrap();
    }
    symlink("inner/b.mcap", place.path("folder/inside.mcap")).unwrap();
    symlink("../secret.mcap", place.path("folder/out.mcap")).unwrap();
    symlink("/etc/passwd", place.path("folder/passwd.mcap")).unwrap();
    symlink("nothing", place.path("folder/z.mcap")).unwrap();
    let server = Server::start(&place, "view folder");
    let listing = server.json("list");
    let entries = listing["entries"].as_array().unwrap();
    let told = |name: &str| entries.iter().find(|entry| entry["name"] == name).unwrap();
    assert_eq!(entries.len(), 5);
    for name in ["a.mcap", "inside.mcap"] {
        assert_eq!(told(name)["manifest"]["physics"]["beads"], 60, "{name}");
        assert_eq!(server.get(told(name)["url"].as_str().unwrap(), &[]).status, 200, "{name}");
    }
    for name in ["out.mcap", "passwd.mcap", "z.mcap"] {
        let entry = told(name);
        assert!(entry["error"].as_str().unwrap().contains("not followed"), "{entry}");
        assert!(entry["url"] == "" && entry.get("manifest").is_none() && entry.get("bytes").is_none());
    }
    // a file that becomes a link after it was listed
    fs::remove_file(place.path("folder/a.mcap")).unwrap();
    symlink("../secret.mcap", place.path("folder/a.mcap")).unwrap();
    let (url, results) =
        (told("a.mcap")["url"].as_str().unwrap(), told("a.mcap")["results"].as_str().unwrap());
    assert_eq!((server.get(url, &[]).status, server.get(results, &[]).status), (404, 404));
    // no form of a request names a path, and a number is written in one way
    for path in [
        "recording/../secret.mcap",
        "recording/..%2fsecret.mcap",
        "recording/%2e%2e/secret.mcap",
        "recording/..\\secret.mcap",
        "recording/0/../../secret.mcap",
        "recording//etc/passwd",
        "recording/00",
        "recording/+0",
        "recording/%30",
        "recording/-1",
        "recording/",
        "results/00",
        "results/../list",
        "start/0",
        "../list",
        "./list",
        "%6cist",
        "list/",
        "list?id=0/..",
    ] {
        let expected = if path.starts_with("list?") { 200 } else { 404 };
        assert_eq!(server.get(path, &[]).status, expected, "{path}");
    }
    // named by itself, the link is followed: the user has named it
    server.end();
    let server = Server::start(&place, "view folder/out.mcap");
    assert_eq!(server.get("recording/0", &[]).status, 200);
    server.end();
}

#[test]
fn links_out_of_the_directory_of_a_sweep_are_not_followed() {
    let place = Place::new();
    let sweep = "record = true\n[base]\npreset = \"homogeneous\"\nchain.beads = 30\ntime.duration_s = 0.001\n[grid]\nchain.alpha = [1.5, 2.0]\n";
    place.write("s.toml", sweep);
    place.run("sweep s.toml --out done").exits(0);
    let point = place.path("done/recordings/point-000001.mcap");
    fs::rename(&point, place.path("elsewhere.mcap")).unwrap();
    symlink("../../elsewhere.mcap", &point).unwrap();
    let server = Server::start(&place, "view done");
    let listing = server.json("list");
    let entries = listing["entries"].as_array().unwrap();
    assert!(entries[0].get("error").is_none());
    assert!(entries[1]["error"].as_str().unwrap().contains("not followed") && entries[1]["url"] == "");
    server.end();
    fs::rename(place.path("done/sweep.toml"), place.path("other.toml")).unwrap();
    symlink("../other.toml", place.path("done/sweep.toml")).unwrap();
    place.run("view done").exits(2).says(&["sweep.toml", "not followed"]);
}

#[test]
fn a_long_text_of_a_file_is_shown_cut_with_its_length() {
    let place = Place::new();
    let (mut manifest, states) = lying::run(&place);
    manifest.provenance.program = "p".repeat(5_000_000);
    manifest.provenance.host = "h".repeat(70_000);
    lying::write(&place, "long.mcap", &manifest, &BeginRecord::default(), &states, EndReason::Complete);
    let told = place.run("info long.mcap").exits(0).stdout();
    assert!(told.len() < 100_000 && told.contains("p… (5,070,0"), "{} bytes", told.len());
    let told = place.run("ls .").exits(0).stdout();
    assert!(told.len() < 2_000 && told.contains("long.mcap"), "{told}");
    let server = Server::start(&place, "view .");
    let listing = server.get("list", &[]);
    assert!(listing.body.len() < 10_000, "{} bytes", listing.body.len());
    assert!(String::from_utf8(listing.body).unwrap().contains("p… (5,000,000 bytes)"));
    server.end();
    // and nothing of ours writes one
    let name = "n".repeat(100_000);
    place.write("long.toml", &format!("name = \"{name}\"\n[chain]\nbeads = 10\n"));
    let refused =
        place.run("run long.toml").exits(2).says(&["long.toml:1: name: found a text of 100,000 bytes"]);
    assert!(refused.stderr().len() < 1_000);
    let refused = place.run(&format!("run --name {name} --no-record")).exits(2);
    assert!(
        refused.stderr().len() < 1_000 && refused.stderr().contains("(100,000 bytes)"),
        "{}",
        refused.stderr()
    );
}

#[test]
fn a_file_that_nobody_can_read_is_a_row() {
    let place = Place::new();
    place.run(&format!("{SMALL} --out good.mcap")).exits(0);
    place.write("bad.mcap", "\u{89}MCAP0");
    fs::write(place.path("empty.mcap"), "").unwrap();
    fs::create_dir(place.path("folder.mcap")).unwrap();
    let server = Server::start(&place, "view .");
    let listing = server.json("list");
    let entries = listing["entries"].as_array().unwrap();
    let names: Vec<_> = entries.iter().map(|entry| entry["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["bad.mcap", "empty.mcap", "good.mcap"]);
    assert!(entries[..2].iter().all(|entry| entry["error"].is_string() && entry.get("results").is_none()));
    assert_eq!((&entries[2]["manifest"]["physics"]["beads"], &listing["more"]), (&60.into(), &0.into()));
    server.end();
}

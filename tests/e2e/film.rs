//! Films: their pictures, their formats, their refusals.

use crate::harness::{Place, ffmpeg_directory, python};
use std::fs;
use std::process::Command;

const SMALL: &str = "run --preset striker-3g --beads 30 --duration 0.002 --no-publish --out run.mcap";
const SIZE: &str = "--size 320x240";

/// `beadline film` with another PATH.
fn film_with(place: &Place, path: &str, words: &str) -> std::process::Output {
    place.command(words.split_whitespace()).env("PATH", path).output().unwrap()
}

/// Pillow, which the Python of `tests/setup` has, counts the pictures and looks at the last one.
const LAST: &str = "
import sys
from PIL import Image
film = Image.open(sys.argv[1])
film.seek(film.n_frames - 1)
last = film.convert('RGB')
paper = last.tobytes().count(255) / len(last.tobytes())
print(film.n_frames, *last.size, film.info['duration'], paper > 0.6)
";

#[test]
fn a_film_has_its_pictures_and_ends_with_the_last_step() {
    let place = Place::new();
    place.run(SMALL).exits(0);
    let film = |words: &str| place.run(&format!("film run.mcap {SIZE} --json {words}")).exits(0).json();
    for (name, seconds, pictures) in [("a.gif", 0.4, 10), ("b.apng", 0.4, 10), ("c.apng", 0.2, 5)] {
        let made = &film(&format!("--seconds {seconds} --out {name}"))["results"];
        assert_eq!(
            (&made["pictures"], &made["width"], &made["height"]),
            (&pictures.into(), &320.into(), &240.into())
        );
        let end =
            place.run("info run.mcap --json").exits(0).json()["manifest"]["physics"]["step_count"].clone();
        assert_eq!((&made["first_step"], &made["last_step"]), (&0.into(), &end), "{name}");
        let Some(python) = python() else { continue };
        let looked = place.foreign(python, ["-c", LAST, name]).output().unwrap();
        assert!(looked.status.success(), "{}", String::from_utf8_lossy(&looked.stderr));
        let said = String::from_utf8(looked.stdout).unwrap();
        assert_eq!(said.trim().replace(".0", ""), format!("{pictures} 320 240 40 True"), "{name}");
    }
    // a film is the same each time, whatever the number of threads
    film("--seconds 0.4 --out d.apng --jobs 1");
    assert!(fs::read(place.path("b.apng")).unwrap() == fs::read(place.path("d.apng")).unwrap());
}

/// A sparse recording, two beads, a part of a frame or two, a damaged file.
#[test]
fn any_recording_has_a_film() {
    let place = Place::new();
    place.run(&SMALL.replace("run.mcap", "sparse.mcap --record-every-steps 1000000")).exits(0);
    place.run(SMALL).exits(0);
    let film = |words: &str, out: &str| format!("film {words} {SIZE} --seconds 0.2 --out {out} --force");
    place.run(&film("run.mcap", "full.apng")).exits(0);
    place.run(&film("sparse.mcap", "sparse.apng")).exits(0);
    // frames that were not recorded are recomputed, bit for bit
    assert!(fs::read(place.path("full.apng")).unwrap() == fs::read(place.path("sparse.apng")).unwrap());
    place
        .run(&film("run.mcap --from 0.001 --until 0.001001 --field overlap --beads -2..", "part.gif"))
        .exits(0);
    place.run("run --preset striker-3g --beads 2 --duration 1e-5 --no-publish --out two.mcap").exits(0);
    for field in ["velocity", "displacement", "overlap", "energy-density"] {
        place.run(&film(&format!("two.mcap --field {field}"), "two.gif")).exits(0);
    }
    let bytes = fs::read(place.path("run.mcap")).unwrap();
    fs::write(place.path("cut.mcap"), &bytes[..bytes.len() - 1000]).unwrap();
    place.run(&film("cut.mcap", "cut.gif")).exits(3).says(&["not finished, or is damaged"]);
    fs::write(place.path("empty.mcap"), &bytes[..bytes.len() / 2]).unwrap();
    place.run(&film("empty.mcap", "empty.gif")).exits(2).says(&["no frame in this part"]);
}

#[test]
fn a_video_is_made_by_ffmpeg() {
    let place = Place::new();
    place.run(SMALL).exits(0);
    let words = |name: &str| format!("film run.mcap {SIZE} --seconds 0.2 --out {name}");
    let refused = film_with(&place, "/nowhere", &words("none.mp4"));
    let said = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(
        refused.status.code() == Some(2) && said.contains("install it") && said.contains(".apng"),
        "{said}"
    );
    // one that gives up is quoted, and leaves nothing
    fs::create_dir(place.path("bad")).unwrap();
    place.write("bad/ffmpeg", "#!/bin/sh\n[ \"$1\" = -version ] || { echo no such codec >&2; exit 1; }\n");
    Command::new("chmod").arg("+x").arg(place.path("bad/ffmpeg")).status().unwrap();
    let failed = film_with(&place, place.path("bad").to_str().unwrap(), &words("bad.mp4"));
    let said = String::from_utf8_lossy(&failed.stderr).into_owned();
    assert!(failed.status.code() == Some(1) && said.contains("no such codec"), "{said}");
    assert!(!place.path("bad.mp4").exists() && !place.path("bad.mp4.partial").exists());
    let Some(directory) = ffmpeg_directory() else { return };
    for name in ["v.mp4", "v.webm"] {
        let made = film_with(&place, directory.to_str().unwrap(), &words(name));
        assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
        let film = place.path(name);
        let back = ["-v", "error", "-i", film.to_str().unwrap(), "-f", "rawvideo", "-pix_fmt", "gray", "-"];
        let decoded = place.foreign(directory.join("ffmpeg"), back).output().unwrap();
        assert_eq!(decoded.stdout.len(), 5 * 320 * 240, "{name}");
    }
}

#[test]
fn a_film_that_cannot_be_is_refused() {
    let place = Place::new();
    place.run(SMALL).exits(0);
    let refuse = |words: &str, said: &[&str]| {
        place.run(&format!("film {words}")).exits(2).says(said);
    };
    refuse("live --out f.gif", &["a live run cannot be filmed", "beadline record live"]);
    refuse("run.mcap --out f.avi", &["f.avi", ".mp4, .webm, .gif or .apng"]);
    refuse("run.mcap --out run.mcap", &[".mp4"]);
    refuse("run.mcap --out f.gif --size 641x480", &["641x480", "even numbers"]);
    refuse("run.mcap --out f.gif --seconds 0", &["at most 120"]);
    refuse("run.mcap --out f.gif --from 9", &["--from 9", "the run ends"]);
    refuse("run.mcap --out f.gif --beads 40..", &["--beads 40.."]);
    place.write("f.gif", "old");
    refuse("run.mcap --out f.gif", &["f.gif exists already", "--force"]);
    assert_eq!(place.read("f.gif"), "old");
}

//! Tools with which a person measures, notes, compares and takes away in the page.

use crate::harness::Place;
use crate::page::check_by;

const SCRIPT: &str = "check_page_tools.mjs";
/// A sparse recording of 100 beads, and what stands in front of its duration.
const RUN: &str = "run --beads 100 --impurity 50=0.6e-3 --record-every-steps 100";

/// A shared file gives the recording that it carries, which verifies and expands to every step; a server gives its file.
#[test]
fn the_recording_comes_out_of_the_page() {
    let place = Place::new();
    place.run(&format!("{RUN} --duration 0.004 --out run.mcap")).exits(0);
    place.run("share run.mcap --out run.html").exits(0);
    check_by(SCRIPT, &place, "taken", ["run.mcap", "run.html"]);
}

/// The slope of a line along the pulse, in beads/s, and in m/s where the beads are spheres.
#[test]
fn the_slope_of_a_ruler_is_a_speed() {
    let place = Place::new();
    place.write(
        "spheres.toml",
        "[chain]\nbeads = 60\nspheres = { material = \"steel\", radius_m = 5e-3 }\n[striker]\nbead = 0\nvelocity_m_s = 1.0\n\
         [time]\nduration_s = 1.5e-3\n",
    );
    place.run("run spheres.toml --out spheres.mcap").exits(0);
    place.run("share spheres.mcap --out spheres.html").exits(0);
    check_by(SCRIPT, &place, "ruler", ["spheres.html"]);
}

/// They stay wherever one looks, and in the address; another quantity has its own.
#[test]
fn the_ends_of_the_colours_are_fixed() {
    let place = Place::new();
    place.run(&format!("{RUN} --duration 0.004 --out run.mcap")).exits(0);
    place.run("share run.mcap --out run.html").exits(0);
    check_by(SCRIPT, &place, "colours", ["run.html"]);
}

/// A note is text, whatever is in it, and the copy holds the same steps.
#[test]
fn a_copy_of_a_shared_file_keeps_notes() {
    let place = Place::new();
    place.run(&format!("{RUN} --duration 0.002 --out run.mcap")).exits(0);
    place.run("share run.mcap --out run.html").exits(0);
    place.run("expand run.mcap --out whole.mcap").exits(0);
    check_by(SCRIPT, &place, "notes", ["run.html", "whole.mcap"]);
}

/// As many pictures as were announced, at their pace, and different ones.
#[test]
fn a_film_goes_through_the_time_in_view() {
    let place = Place::new();
    place.run(&format!("{RUN} --duration 0.002 --out run.mcap")).exits(0);
    place.run("share run.mcap --out run.html").exits(0);
    check_by(SCRIPT, &place, "film", ["run.html"]);
}

/// Two recordings beside each other, and the difference of their states at the same times, whatever their steps.
#[test]
fn two_recordings_are_compared_and_subtracted() {
    let place = Place::new();
    let run = "run --beads 100 --record-every-steps 100 --duration 0.004";
    place.run(&format!("{run} --impurity 20=0.6e-3 --dt 1.4e-6 --name light --out light.mcap")).exits(0);
    place.run(&format!("{run} --impurity 20=0.9e-3 --dt 1.4e-6 --name heavy --out heavy.mcap")).exits(0);
    place.run(&format!("{run} --impurity 20=0.6e-3 --dt 1.1e-6 --name fine --out fine.mcap")).exits(0);
    place.run("view light.mcap live").exits(2).says(&["each is a recording"]);
    place.run("share light.mcap --out light.html").exits(0);
    check_by(SCRIPT, &place, "compare", ["light.mcap", "heavy.mcap", "fine.mcap", "light.html"]);
}

/// Python and the page in a cell of a notebook move each other.
#[test]
fn the_widget_follows_its_model_and_the_pointer() {
    let place = Place::new();
    place.run(&format!("{RUN} --duration 0.002 --out run.mcap")).exits(0);
    place.run("share run.mcap --out run.html").exits(0);
    check_by(SCRIPT, &place, "widget", ["run.html"]);
}

/// Density of a bead's velocity and of a contact's force, and linear modes, are those of the commands.
#[test]
fn spectra_and_modes_are_those_of_the_commands() {
    let place = Place::new();
    place
        .run("run --preset precompressed --beads 40 --duration 0.004 --record-every-steps 50 --out run.mcap")
        .exits(0);
    place.run("share run.mcap --out run.html").exits(0);
    check_by(SCRIPT, &place, "waves", ["run.mcap", "run.html"]);
}

/// The axis of time ends where the run will, and rows of a page that comes late are as dense before as after.
#[test]
fn a_live_map_has_the_axis_of_the_whole_run() {
    check_by(SCRIPT, &Place::new(), "axis", [""; 0]);
}

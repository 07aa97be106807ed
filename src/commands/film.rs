//! `beadline film`: a recording as a film.

mod reel;

use super::plot::{places, steps_of};
use crate::analysis::{Session, window};
use crate::args::{FilmArgs, FramesArgs};
use crate::display::{self, bytes, count, counted};
use crate::failure::{BadInput as _, Done, Failure};
use crate::outputs::check_place;
use crate::progress::Progress;
use crate::report::Rows;
use crate::threads;
use consumers::follow::Tally;
use consumers::footage::{Footage, Shot};
use consumers::space_time::Extent;
use figure::Scene;
use plots::Film;
use recording::RecordingInfo;
use reel::{Form, Reel};
use schemas::frame::EndReason;
use serde_json::json;
use std::ops::RangeInclusive;

/// Pictures a second, as of the page.
const PER_SECOND: u16 = 25;

pub(crate) fn film(args: &FilmArgs) -> Result<Done, Failure> {
    let form = Form::of(&args.out)?;
    let from = super::recording_of(&args.source, "filmed")?;
    check_place(&args.out, Some(&from), args.force)?;
    form.check()?;
    let info = RecordingInfo::glance(&from).bad_input()?;
    let mut frames = frames(args);
    let mut session = open(&frames)?;
    let steps = reached(session.steps(), [info.first_step, info.last_step]);
    let manifest = session.manifest().clone();
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most two minutes")]
    let wanted = ((args.seconds * f64::from(PER_SECOND)).round() as u64).max(1);
    let there = manifest.frame_at(*steps.end()) - manifest.frame_at(*steps.start()) + 1;
    if there < wanted && !frames.every_step {
        frames.every_step = true;
        session = open(&frames)?;
    }
    let extent = Extent { places: places(args.beads, args.field, &manifest)?, steps };
    let mut footage = Footage::new(&manifest, args.field, extent, wanted, frames.every_step);
    let tally = session.follow(&mut footage)?;
    footage.end();
    if tally.end == EndReason::Stopped {
        return Err(Failure::stopped());
    }
    if footage.shots.is_empty() {
        return Err(bad_input!(
            "{}: there is no frame in this part of the recording; choose another one",
            args.source
        ));
    }
    let film = Film::new(&manifest, &footage);
    let range = args.range.map(|range| [range.from, range.to]);
    let (width, height) = args.size;
    // beside each other, map and curves are as wide as high
    let columns = film.columns(4 * width >= 5 * height, steps_of(args.colours), range)?;
    let scene = Scene::new(args.size, &columns)?;
    shoot(args, form, &session, &scene, &film, &footage.shots)?;
    tell(args, &session, &tally, &footage.shots)
}

/// The part of `steps` between the `ends` of a recording, which may be interrupted; all of them where it holds none.
fn reached(steps: RangeInclusive<u64>, ends: [Option<u64>; 2]) -> RangeInclusive<u64> {
    let [Some(first), Some(last)] = ends else { return steps };
    let held = first.max(*steps.start())..=last.min(*steps.end()); // integers
    if held.is_empty() { steps } else { held }
}

/// The frames that a film is made of: those of the run, whether they were recorded or not.
fn frames(args: &FilmArgs) -> FramesArgs {
    FramesArgs {
        source: args.source.clone(),
        latest: false,
        from_start: false,
        fill_gaps: true,
        every_step: args.every_step,
        from: args.from,
        until: args.until,
        jobs: args.jobs,
        timeout: None,
        force: args.force,
        json: args.json,
    }
}

fn open(frames: &FramesArgs) -> Result<Session<'_>, Failure> {
    Session::of_part(frames, "film", &[], |manifest| window(frames.from, frames.until, manifest))
}

/// Draws the pictures, as many at a time as there are threads, and writes them in their order.
fn shoot(
    args: &FilmArgs,
    form: Form,
    session: &Session<'_>,
    scene: &Scene<'_>,
    film: &Film<'_>,
    shots: &[Shot],
) -> Result<(), Failure> {
    let draw = |shot: &Shot| scene.picture(&film.moment(shot));
    // the last picture has all curves, and colours as the others have them
    let sample = shots.last().map(draw).transpose()?.ok_or_else(Failure::stopped)?;
    let mut reel = Reel::begin(form, args, shots.len(), &sample)?;
    let jobs = threads::or_cores(args.jobs).get();
    let mut progress = Progress::new(shots.len() as u64, "drawing");
    let mut done = 0;
    for batch in shots.chunks(jobs) {
        for picture in threads::each(batch, jobs, draw) {
            if session.is_stopped() {
                return Err(Failure::stopped());
            }
            reel.push(picture?)?;
            done += 1;
            progress.at(done);
        }
    }
    progress.finish();
    reel.finish()
}

/// Prints the summary and says whether anything is missing.
fn tell(args: &FilmArgs, session: &Session<'_>, tally: &Tally, shots: &[Shot]) -> Result<Done, Failure> {
    let pictures = shots.len() as u64;
    let length_s = pictures as f64 / f64::from(PER_SECOND);
    let size = args.out.metadata().bad_input()?.len();
    let (width, height) = args.size;
    let ends = shots.first().zip(shots.last());
    let ends = ends.map(|(first, last)| ([first.time_s, last.time_s], [first.step, last.step]));
    let (times_s, steps) = ends.unwrap_or_default();
    let mut rows = Rows::default();
    rows.add(
        "pictures",
        format_args!("{}, {} × {}", counted(pictures, "picture"), count(width.into()), count(height.into())),
    );
    rows.add("shows", display::range(times_s, "s"));
    rows.add("film", format_args!("{}, {}, {}", args.out.display(), display::seconds(length_s), bytes(size)));
    let results = json!({
        "what": args.field.as_str(),
        "film": args.out.to_string_lossy(),
        "bytes": size,
        "pictures": pictures,
        "seconds": length_s,
        "width": width,
        "height": height,
        "first_step": steps[0],
        "last_step": steps[1],
    });
    session.report(tally, "film", rows, results)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_film_of_an_interrupted_run_is_as_long_as_asked_for() {
        assert_eq!(reached(0..=100, [Some(0), Some(40)]), 0..=40);
        assert_eq!(reached(20..=30, [Some(25), Some(40)]), 25..=30);
        assert_eq!(reached(50..=60, [Some(0), Some(40)]), 50..=60);
        assert_eq!(reached(50..=60, [None, None]), 50..=60);
    }
}

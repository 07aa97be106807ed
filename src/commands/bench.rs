//! `beadline bench`: this machine's figures, each beside its limit.

use crate::args::BenchArgs;
use crate::bench::recordings::Frames;
use crate::bench::{Floor, Row, analyses, dynamics, peers, recordings};
use crate::display;
use crate::failure::{Done, Failure};
use serde_json::json;
use std::fmt::Write as _;

pub(crate) fn bench(args: &BenchArgs) -> Result<Done, Failure> {
    let directory = tempfile::tempdir()?;
    let rounds = args.rounds;
    let mut rows = Vec::new();
    display::notice("measuring the dynamics");
    rows.push(dynamics::step(rounds)?);
    rows.push(dynamics::general_alpha(rounds)?);
    rows.push(dynamics::length(rounds)?);
    display::notice("recording the light-impurity run");
    let frames = Frames::record_in(directory.path())?;
    display::notice("measuring recordings");
    rows.extend(recordings::writing(&frames, rounds)?);
    rows.extend(recordings::reading(&frames, rounds)?);
    rows.extend(recordings::recomputing(&frames, rounds)?);
    display::notice("measuring analyses");
    rows.extend(analyses::rows(&frames, rounds)?);
    if args.peers {
        rows.extend(peers::rows(rounds)?);
    }
    if args.json {
        display::print_json(&json!({ "rounds": rounds, "rows": rows }))?;
    } else {
        display::print(table(&rows))?;
    }
    Ok(Done::whole_if(rows.iter().all(Row::is_met)))
}

fn table(rows: &[Row]) -> String {
    let width = |of: fn(&Row) -> &str| rows.iter().map(|row| of(row).chars().count()).max().unwrap_or(0);
    let (what, against) = (width(|row| row.what), width(|row| row.against));
    let mut text = String::new();
    for row in rows {
        let floor = match row.floor {
            Floor::AtLeast(floor) => format!("≥ {floor}"),
            Floor::AtMost(floor) => format!("≤ {floor}"),
        };
        let mark = if row.is_met() { "met" } else { "NOT met" };
        let spread = format!("({:.2} to {:.2})", row.ratio.least, row.ratio.most);
        // writing to a String cannot fail
        let _ = writeln!(
            text,
            "{:what$}  {:against$}  {:6.2} {spread:16} {floor:7} {mark:8} {}",
            row.what, row.against, row.ratio.median, row.figure
        );
    }
    text
}

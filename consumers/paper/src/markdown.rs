//! The report as pages to read.

use crate::report::{PAPER, Report, Studied, figure_path};
use crate::{Claim, Judgement, Number, Study, Verdict};
use consumers::uncertain::Uncertain;
use std::fmt::{self, Write};

/// `REPORT.md`: a table of all claims, then figure by figure.
pub fn report(report: &Report<'_>) -> String {
    let mut page = String::new();
    // writing to a String cannot fail
    let _ = write_report(&mut page, report);
    page
}

/// `GALLERY.md`: the figures alone.
pub fn gallery(report: &Report<'_>) -> String {
    let mut page = String::new();
    // writing to a String cannot fail
    let _ = write_gallery(&mut page, report);
    page
}

fn write_report(page: &mut String, report: &Report<'_>) -> fmt::Result {
    writeln!(page, "# The paper, by command\n")?;
    writeln!(page, "{PAPER}: every figure and every claim, by `beadline reproduce` ({}).\n", report.program)?;
    let count = |verdict| report.count(verdict);
    writeln!(
        page,
        "{} claims are reproduced, {} reproduced with a correction, {} not so. {} of our numbers have an independently \
         computed reference; {} contradict it.\n",
        count(Verdict::Reproduced),
        count(Verdict::Corrected),
        count(Verdict::NotSo),
        report.reference_count(),
        match report.contradictions().len() {
            0 => "none of them".to_owned(),
            some => some.to_string(),
        },
    )?;
    writeln!(page, "## Claims\n\n| claim | in the paper | verdict | why |\n|---|---|---|---|")?;
    for studied in &report.studies {
        for (claim, judgement) in &studied.claims {
            let link = format!("[{}](#{})", claim.id, anchor(studied));
            let (place, verdict) = (claim.place, mark(judgement.verdict));
            writeln!(page, "| {link} | {place} | {verdict} | {} |", cell(&judgement.why))?;
        }
    }
    writeln!(page, "\n## Figure by figure\n")?;
    writeln!(
        page,
        "± is half the width of an interval; what it comes from stands below each table. Numbers end with the second digit of \
         it; those without ± have three digits, or are counts. References were computed independently, with other programs. \
         Beads and contacts are counted from 0.\n"
    )?;
    for studied in &report.studies {
        write_study(page, studied)?;
    }
    write_runs(page, report)
}

fn write_study(page: &mut String, studied: &Studied) -> fmt::Result {
    write_figure(page, "###", studied.study)?;
    for (claim, judgement) in &studied.claims {
        write_claim(page, claim, judgement)?;
    }
    Ok(())
}

fn write_claim(page: &mut String, claim: &Claim, judgement: &Judgement) -> fmt::Result {
    writeln!(page, "> {} — {}\n", claim.quote, claim.place)?;
    writeln!(page, "{} (`{}`): {}\n", mark(judgement.verdict), claim.id, minus_signs(&judgement.why))?;
    if judgement.numbers.is_empty() {
        return Ok(());
    }
    writeln!(page, "| quantity | ours | ± | reference | unit |\n|---|---:|---:|---:|---|")?;
    let mut origins: Vec<&str> = Vec::new();
    let mut ranges = None;
    for number in &judgement.numbers {
        let Figures { value, plus_minus, reference } = figures(number);
        let against = if number.contradicts_reference() { " **contradicted**" } else { "" };
        writeln!(
            page,
            "| {} | {value} | {plus_minus} | {reference}{against} | {} |",
            cell(&number.what),
            number.unit
        )?;
        if let Some(uncertainty) = number.uncertainty.filter(|found| !origins.contains(&found.from)) {
            origins.push(uncertainty.from);
        }
        ranges = ranges.or(number.range.map(|range| range.from));
    }
    let origins = (!origins.is_empty()).then(|| format!("± from {}.", origins.join("; ")));
    let notes: Vec<String> = origins.into_iter().chain(ranges.map(str::to_owned)).collect();
    if notes.is_empty() { writeln!(page) } else { writeln!(page, "\n{}\n", notes.join(" ")) }
}

fn write_runs(page: &mut String, report: &Report<'_>) -> fmt::Result {
    writeln!(
        page,
        "## Runs\n\nDetermined: until when every quantity is the same, within the tolerance, as in a run with half the step, and as \
         in one with a striker that is one unit in the last place faster (`beadline check`). Runs that others are only \
         compared with, and the longest, are not checked.\n\n\
         | run | beads | α | impurities | method | dt (s) | steps | determined |\n|---|---:|---:|---|---|---:|---:|---|"
    )?;
    for manifest in &report.runs {
        let physics = &manifest.physics;
        let determined = report.determined.get(manifest.provenance.name.as_str());
        let impurities = physics.impurities.iter();
        let impurities: Vec<String> =
            impurities.map(|found| format!("bead {}: {} g", found.bead, found.mass_kg * 1e3)).collect();
        writeln!(
            page,
            "| {} | {} | {} | {} | {} | {:.3e} | {} | {} |",
            manifest.provenance.name,
            physics.beads,
            physics.alpha,
            impurities.join(", "),
            physics.method,
            physics.dt_s,
            physics.step_count,
            determined.map_or("–", String::as_str)
        )?;
    }
    Ok(())
}

fn write_gallery(page: &mut String, report: &Report<'_>) -> fmt::Result {
    writeln!(page, "# Gallery\n")?;
    writeln!(page, "The figures of {PAPER}, by `beadline reproduce` ({}).\n", report.program)?;
    for studied in &report.studies {
        write_figure(page, "##", studied.study)?;
    }
    Ok(())
}

/// The figure of a study, below a heading that begins with these signs.
fn write_figure(page: &mut String, heading: &str, study: &Study) -> fmt::Result {
    writeln!(page, "{heading} {}\n", study.slug)?;
    writeln!(page, "{} ({}).\n", study.title, study.place)?;
    writeln!(page, "![{}]({})\n", study.title, figure_path(study, "png"))
}

/// The heading of a study as Markdown links name it.
fn anchor(studied: &Studied) -> String {
    studied.study.slug.replace('.', "")
}

fn mark(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Reproduced => "✓ reproduced",
        Verdict::Corrected => "≈ reproduced with a correction",
        Verdict::NotSo => "✗ **not so**",
    }
}

/// Text in a cell of a table.
fn cell(text: &str) -> String {
    minus_signs(text).replace('|', "\\|")
}

/// True minus signs before numbers.
fn minus_signs(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    let mut before = ' ';
    let mut letters = text.chars().peekable();
    while let Some(letter) = letters.next() {
        let is_sign =
            letter == '-' && !before.is_alphanumeric() && letters.peek().is_some_and(char::is_ascii_digit);
        out.push(if is_sign { '−' } else { letter });
        before = letter;
    }
    out
}

/// A number as it stands in a table.
struct Figures {
    value: String,
    plus_minus: String,
    reference: String,
}

/// With the digits that are known.
fn figures(number: &Number) -> Figures {
    let signed = |text: String| minus_signs(&text);
    let ours = match number.uncertainty {
        Some(found) => Uncertain::new(number.value, found.plus_minus),
        // counts are exact, or in a range
        None if number.value.fract() == 0.0 => Uncertain::new(number.value, 0.0),
        // what is left of a zero after rounding is one
        None if number.value.abs() < 1e-12 => Uncertain::new(0.0, 0.0),
        None => Uncertain::unknown(number.value),
    };
    let range = number.range.filter(|range| range.least < range.most);
    let range = range.map(|range| format!(" ({}–{})", range.least, range.most));
    // no more digits than ours has; a reference of a count is one
    let beside = match number.uncertainty {
        Some(ours) => ours.plus_minus,
        None if number.range.is_some() => 10.0,
        None => 0.0,
    };
    let reference =
        number.reference.map(|found| Uncertain::new(found.value, found.good_to.max(beside)).value_text());
    Figures {
        value: signed(ours.value_text()) + &range.unwrap_or_default(),
        plus_minus: number.uncertainty.map_or(String::new(), |_| signed(ours.plus_minus_text())),
        reference: signed(reference.unwrap_or_default()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Range, Reference, Uncertainty};

    fn number(value: f64, plus_minus: Option<f64>) -> Number {
        let uncertainty = plus_minus.map(|plus_minus| Uncertainty { plus_minus, from: "test" });
        Number { what: "v".into(), value, unit: "m/s", uncertainty, range: None, reference: None }
    }

    #[test]
    fn a_number_has_the_digits_that_its_uncertainty_allows() {
        let shown = |value, plus_minus| {
            let Figures { value, plus_minus, .. } = figures(&number(value, plus_minus));
            (value, plus_minus)
        };
        assert_eq!(shown(3.334_107_2, Some(2.04e-5)), ("3.334107".into(), "2.0e-5".into()));
        assert_eq!(shown(-11_545.912, Some(0.31)), ("−11545.91".into(), "0.31".into()));
        assert_eq!(shown(5.0, None), ("5".into(), String::new()));
        assert_eq!(shown(0.123_456_789, None).0, "0.123");
        assert_eq!(shown(-3e-17, Some(2e-9)), ("0".into(), "2.0e-9".into()));
    }

    #[test]
    fn numbers_have_true_minus_signs() {
        assert_eq!(minus_signs("-2.63 m/s, (-1), e-5, 3-4"), "−2.63 m/s, (−1), e-5, 3-4");
    }

    #[test]
    fn a_reference_has_the_digits_that_it_is_good_to() {
        let mut number = number(2.000_04, Some(1e-7));
        number.reference = Some(Reference { value: 2.0, good_to: 1e-5 });
        assert_eq!(figures(&number).reference, "2.000000");
        number.uncertainty = Some(Uncertainty { plus_minus: 0.03, from: "test" });
        assert_eq!(figures(&number).reference, "2.000");
    }

    #[test]
    fn a_count_has_its_range_beside_it() {
        let mut count = number(21.0, None);
        count.range = Some(Range { least: 20.0, most: 22.0, from: "runs" });
        count.reference = Some(Reference { value: 22.0, good_to: 1.0 });
        let Figures { value, reference, .. } = figures(&count);
        assert_eq!((value.as_str(), reference.as_str()), ("21 (20–22)", "22"));
        count.range = Some(Range { least: 21.0, most: 21.0, from: "runs" });
        assert_eq!(figures(&count).value, "21");
    }
}

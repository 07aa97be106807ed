//! `beadline analyses`: the list of the analyses, with their options, columns and numbers.

use crate::failure::{Done, Failure};
use crate::report::{Rows, report};
use consumers::analysis::{Meaning, Offer, Setting, Takes, Whereabouts};
use consumers::table::Kind;
use serde_json::{Value, json};

pub(crate) fn list(as_json: bool) -> Result<Done, Failure> {
    let all: Vec<Value> = analyses::all().map(told).collect();
    report(as_json, &all, || {
        let names =
            |numbers: &[Meaning]| numbers.iter().map(|number| number.name).collect::<Vec<_>>().join(", ");
        let mut text = String::new();
        for offer in analyses::all() {
            let mut rows = Rows::default();
            for (name, numbers) in [("each frame", offer.columns), ("measure", offer.numbers())] {
                rows.each(name, (!numbers.is_empty()).then(|| names(numbers)));
            }
            text += &rows.under(format_args!("{}: {}", offer.name, offer.about));
        }
        text + "\nSweeps keep what `measure` names: `energies.driven_j`, or `forces.peak_n@right` of a place. --json has the meanings.\n"
    })?;
    Ok(Done::Whole)
}

/// All that is known of an analysis without a run.
fn told(offer: &Offer) -> Value {
    let table = |table: &consumers::analysis::TableFlag| json!({ "flag": table.name, "about": table.help });
    let (setting, words, allowed) = match &offer.place {
        Whereabouts::Chain => (None, None, None),
        Whereabouts::Of { setting, allowed, .. } => (Some(setting), None, Some(allowed)),
        Whereabouts::Words(words) => (None, Some(words), None),
    };
    json!({
        "name": offer.name,
        "about": offer.about,
        "is_ours": !analyses::is_added(offer),
        "help": offer.help,
        "settings": offer.settings.iter().map(setting_told).collect::<Vec<_>>(),
        "tables": offer.tables.iter().map(table).collect::<Vec<_>>(),
        "columns": offer.columns.iter().map(number_told).collect::<Vec<_>>(),
        "numbers": offer.numbers().iter().map(number_told).collect::<Vec<_>>(),
        "place": { "setting": setting, "words": words, "allowed": allowed },
    })
}

fn number_told(number: &Meaning) -> Value {
    let kind = if number.kind == Kind::Integer { "integer" } else { "double" };
    json!({ "name": number.name, "kind": kind, "meaning": number.meaning })
}

fn setting_told(setting: &Setting) -> Value {
    let (takes, unit, default, words) = match &setting.takes {
        Takes::Nothing => ("nothing", None, None, None),
        Takes::Whole(_) => ("whole", None, None, None),
        Takes::Number { unit, default, .. } => ("number", Some(*unit), *default, None),
        Takes::Word(words) => ("word", None, words.first().map(|(word, _)| *word), Some(words)),
        Takes::Text(name, _) => (*name, None, None, None),
    };
    json!({
        "name": setting.name,
        "about": setting.help,
        "takes": takes,
        "unit": unit,
        "default": default,
        "words": words.map(|words| words.iter().map(|(word, about)| json!([word, about])).collect::<Vec<_>>()),
        "is_repeatable": setting.is_repeatable,
        "required_unless": setting.required_unless,
    })
}

//! Space-time map of compressed, touching and open contacts.

use consumers::analysis::{
    Allowed, Analysis, Beginning, Meaning, Needs, Number, Offer, Outlet, Remake, Report, RowValues, Setting,
    TableFlag, Takes, Whereabouts, Words, frame_columns,
};
use consumers::contacts::{Class, ContactCounts, Contacts, default_tolerance_m};
use consumers::space_time::{Extent, Picture};
use consumers::table::{Cell, Column};
use figure::{Figure, FigureError};
use schemas::amounts::{count, quantity};
use schemas::frame::Frame;
use schemas::manifest::RunManifest;
use schemas::results::ResultColumns;
use serde_json::json;

/// The analysis, before it looks at a run.
pub static OFFER: Offer = Offer {
    name: "contacts",
    about: "Space-time map of compressed, touching and open contacts",
    help: "Examples:\n  \
        beadline contacts --figure map.png                   attach to the only live run\n  \
        beadline contacts run.mcap --out counts.csv --out map.mcap\n  \
        beadline contacts map.mcap --figure map.svg          draw a map that was kept",
    settings: &[Setting::new(
        "tolerance",
        Takes::number("m", Allowed::NotNegative),
        "Largest overlap or gap (m) that counts as touching [default: 1e-6 of the collision length L]",
    )],
    tables: &[TableFlag {
        name: "out",
        help: "FILE.csv or .parquet: table of the counts in each frame; FILE.mcap: the class of every contact (repeatable)",
    }],
    columns: &COLUMNS,
    summary: &COLUMNS,
    place: Whereabouts::Chain,
    needs: Needs {
        last_frame_only: true,
        takes_own_rows: true,
        remake: Remake::OfTolerance("tolerance"),
        ..Needs::FRAMES
    },
    begin: |beginning| Ok(Box::new(ContactAnalysis::new(beginning))),
};

const COLUMNS: [Meaning; 5] = [
    Meaning::count("compressed_count", "compressed contacts"),
    Meaning::count("touching_count", "touching contacts"),
    Meaning::count("open_count", "open contacts"),
    Meaning::count("first_compressed_contact", "the first compressed contact"),
    Meaning::count("last_compressed_contact", "the last compressed contact"),
];

struct ContactAnalysis {
    manifest: RunManifest,
    contacts: Contacts,
    tolerance_m: f64,
    last: Option<ContactCounts>,
    /// Kept for a figure alone.
    picture: Option<Picture<Class>>,
}

impl ContactAnalysis {
    fn new(beginning: &Beginning<'_>) -> Self {
        let manifest = beginning.manifest.clone();
        let tolerance_m =
            beginning.settings.one("tolerance").unwrap_or_else(|| default_tolerance_m(&manifest));
        let extent = Extent { places: 0..manifest.all_contact_count(), steps: beginning.steps.clone() };
        let contacts = Contacts::new(&manifest, tolerance_m);
        Self {
            last: None,
            picture: beginning.is_drawn.then(|| Picture::new(extent)),
            contacts,
            tolerance_m,
            manifest,
        }
    }
}

/// Takes the classes of a frame, from contact `first` on: of all others, which make it `contacts` in all, each touches.
fn take(
    (picture, last): (&mut Option<Picture<Class>>, &mut Option<ContactCounts>),
    (step, contacts): (u64, usize),
    (first, classes): (usize, &[u8]),
) {
    if let Some(picture) = picture {
        picture.push_from(first, step, classes.iter().map(|class| Class(*class)));
    }
    *last = Some(ContactCounts::among(contacts, first, classes));
}

impl Analysis for ContactAnalysis {
    fn columns(&self, _: usize) -> Vec<Column> {
        frame_columns(COLUMNS.map(|column| column.name))
    }

    fn published(&self) -> Option<ResultColumns> {
        Some(ResultColumns::contacts(self.manifest.all_contact_count(), self.tolerance_m))
    }

    fn observe(&mut self, frame: &Frame<'_>, out: &mut dyn Outlet) {
        let contacts = self.contacts.observe(frame).len();
        take((&mut self.picture, &mut self.last), (frame.step, contacts), self.contacts.touched());
        if out.wants(0) {
            out.line_of(
                0,
                frame,
                COLUMNS.map(|column| self.value(column.name, None).map_or(Cell::Empty, Cell::from)),
            );
        }
        out.publish(frame, RowValues::Classes(self.contacts.classes()));
    }

    fn gap(&mut self) {
        if let Some(picture) = &mut self.picture {
            picture.gap();
        }
    }

    fn recall(&mut self, step: u64, tolerance_m: f64, row: RowValues<'_>) {
        self.tolerance_m = tolerance_m;
        if let RowValues::Classes(classes) = row {
            take((&mut self.picture, &mut self.last), (step, classes.len()), (0, classes));
        }
    }

    fn report(&mut self) -> Option<Report> {
        let mut words = Words::default();
        words.add("tolerance", quantity(self.tolerance_m, "m"));
        let mut results = json!({ "tolerance_m": self.tolerance_m, "last": null });
        if let Some(ContactCounts { compressed, touching, open, .. }) = self.last {
            let [pressed, touch, gaps] = [compressed, touching, open].map(count);
            words.add("last frame", format_args!("{pressed} compressed, {touch} touching, {gaps} open"));
            results["last"] = json!({ "compressed": compressed, "touching": touching, "open": open });
        }
        Some(Report { title: "contacts", words, results, ..Report::default() })
    }

    fn figure(&mut self) -> Result<Option<Figure>, FigureError> {
        let extent = Extent { places: 0..self.manifest.all_contact_count(), steps: 0..=0 };
        let picture = self.picture.take().unwrap_or_else(|| Picture::new(extent));
        plots::contact_map(&self.manifest, self.tolerance_m, &picture).map(Some)
    }

    fn value(&self, name: &str, _: Option<&str>) -> Option<Number> {
        let counts = self.last?;
        Some(Number::Count(match name {
            "compressed_count" => counts.compressed,
            "touching_count" => counts.touching,
            "open_count" => counts.open,
            "first_compressed_contact" => counts.compressed_range?.0,
            "last_compressed_contact" => counts.compressed_range?.1,
            _ => return None,
        }))
    }
}

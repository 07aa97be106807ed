//! Linear modes of a loaded chain: frequencies, bands, shapes, and their energies in a run.

use consumers::analysis::{
    Analysis, Beginning, Meaning, Needs, Number, Offer, Outlet, Refusal, Remake, Report, Setting, TableFlag,
    Takes, Whereabouts, Words, frame_columns,
};
use consumers::series::Series;
use consumers::table::{Cell, Column};
use figure::{Figure, FigureError};
use plots::{ModeShape, ModesShown};
use schemas::amounts::{count, quantity, range};
use schemas::chain::Chain;
use schemas::frame::Frame;
use schemas::manifest::RunManifest;
use schemas::results::ResultColumns;
use serde_json::{Value, json};
use std::borrow::Cow;
use std::cell::RefCell;
use std::sync::Arc;
use waves::dispersion::{Band, UnitCell};
use waves::linear::{LinearChain, check_beads_are_free};
use waves::modes::{Modes, ModesError};

/// The analysis, before it looks at a run.
pub static OFFER: Offer = Offer {
    name: "modes",
    about: "Linear modes of a loaded chain: frequencies, bands, shapes, and their energies in a run",
    help: "Examples:\n  \
        beadline modes --preset precompressed --figure modes.png\n  \
        beadline modes chain.toml --out modes.csv            of a configuration\n  \
        beadline modes run.mcap --shapes --mode 1 --mode 50 --figure shapes.svg\n  \
        beadline modes run.mcap --energy --out energies.csv --figure energies.png\n\n\
        Modes are those of small motions about the equilibrium, without damping, counted from 1 by ascending frequency. \
        Where walls move, energies are those of the motion about the places at which the beads would rest between them. The chain has to \
        be pressed together: a contact without load has no linear motion. participation is the number of beads that \
        share a mode's energy, 1/Σ e². Bands and gaps are those of the unit that the chain repeats, if it repeats one; a \
        mode outside of them is held by an impurity or an end. --out and --figure are of what was asked for: the list \
        of modes, their shapes, or the energy in each over time.",
    settings: &[
        Setting::new("shapes", Takes::Nothing, "The shapes of modes").excluding(&["energy"]),
        Setting::new("energy", Takes::Nothing, "The energy in modes over time"),
        Setting::new(
            "mode",
            Takes::Whole("MODE"),
            "A mode for --shapes or --energy, repeatable [default: the lowest 4 for shapes, 8 for energies]",
        )
        .repeatable(),
    ],
    tables: &[TableFlag { name: "out", help: "Table of what was asked for" }],
    columns: &[Meaning::number("energy_mode_MODE_j", "energy in a mode, with --energy")],
    summary: &[
        Meaning::count("centre_bead", "the bead around which the mode lies"),
        Meaning::number("frequency_hz", "its frequency"),
        Meaning::number("participation_beads", "beads that share its energy"),
        Meaning::number("largest_j", "largest energy in it"),
        Meaning::number("last_j", "last energy in it"),
    ],
    place: Whereabouts::Of { setting: "mode", also: &["energy"], allowed: "a mode such as @1, the lowest" },
    needs: Needs {
        takes_configurations: true,
        remake: Remake::OfNames {
            setting: "mode",
            also: &["energy"],
            value: |name| Some(name.strip_prefix("energy_mode_")?.strip_suffix("_j")?.to_owned()),
        },
        ..Needs::FRAMES
    },
    begin: |beginning| Ok(Box::new(ModeAnalysis::begin(beginning)?)),
};

/// Modes whose energies one run is asked for.
const MOST: usize = 64;
/// Modes outside of the bands that are shown.
const SHOWN: usize = 6;

/// Refusal of a chain without linear motion.
pub(crate) const NO_FREQUENCY: &str = "no mode of this chain has a frequency: its bonds have no linear part";

thread_local! {
    /// The modes of one run are asked for several times.
    static LAST_MODES: RefCell<Option<(LinearChain, Arc<Modes>)>> = const { RefCell::new(None) };
}

fn modes_of(chain: &LinearChain) -> Result<Arc<Modes>, ModesError> {
    LAST_MODES.with_borrow_mut(|last| {
        if let Some((known, modes)) = last
            && known == chain
        {
            return Ok(Arc::clone(modes));
        }
        let modes = Arc::new(Modes::of(chain)?);
        *last = Some((chain.clone(), Arc::clone(&modes)));
        Ok(modes)
    })
}

/// The part of each wall's way that each bead at rest goes along.
pub(crate) fn follows(linear: &LinearChain) -> [Vec<f64>; 2] {
    [[1.0, 0.0], [0.0, 1.0]].map(|walls_m| linear.at_rest_m(walls_m))
}

/// Displacements (m) and velocities (m/s) of all beads, and of the resonators that are there after them: displacements are those from the places
/// of rest between the walls, which beads follow as [`follows`] tells.
pub(crate) fn about_rest<'a>(
    chain: &Chain,
    [left, right]: &[Vec<f64>; 2],
    frame: &Frame<'a>,
) -> [Cow<'a, [f64]>; 2] {
    let walls_m = chain.walls_m(frame.extra);
    if !chain.sites.has_resonators() && walls_m == [0.0; 2] {
        return [Cow::Borrowed(frame.u_m), Cow::Borrowed(frame.v_m_s)];
    }
    let rest_m = left.iter().zip(right).map(|(left, right)| walls_m[0] * left + walls_m[1] * right);
    let about =
        |values: &[f64]| values.iter().zip(rest_m.clone()).map(|(x, rest)| x - rest).collect::<Vec<_>>();
    let [w_m, w_m_s] = chain.rows.resonators_of(frame.extra);
    let there = |values: &[f64]| {
        values.iter().zip(&chain.sites.resonator_kg).filter(|(_, m)| **m > 0.0).map(|(x, _)| *x).collect()
    };
    let [w_m, w_m_s]: [Vec<f64>; 2] = [there(&about(w_m)), there(w_m_s)];
    [[about(frame.u_m), w_m].concat().into(), [frame.v_m_s, &w_m_s].concat().into()]
}

/// Subject of the report.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Subject {
    /// All modes: frequencies, participation, bands.
    List,
    Shapes,
    Energies,
}

struct ModeAnalysis {
    manifest: RunManifest,
    chain: Chain,
    follows: [Vec<f64>; 2],
    subject: Subject,
    /// Empty where the chain repeats no unit.
    bands_hz: Vec<Band>,
    /// None where it is a trial.
    modes: Option<Arc<Modes>>,
    /// The modes that are asked for, counted from 0.
    chosen: Vec<usize>,
    /// The energies in the last frame, if there was one.
    row: Vec<f64>,
    /// The largest energy of each, likewise.
    largest_j: Vec<f64>,
    curves: Vec<Series<1>>,
}

impl ModeAnalysis {
    fn begin(beginning: &Beginning<'_>) -> Result<Self, Refusal> {
        let (manifest, settings) = (beginning.manifest.clone(), beginning.settings);
        let (subject, default) = match (settings.is_set("shapes"), settings.is_set("energy")) {
            (true, _) => (Subject::Shapes, 4),
            (_, true) => (Subject::Energies, 8),
            _ => (Subject::List, 0),
        };
        if subject == Subject::List && settings.is_set("mode") {
            let why = "--mode chooses modes for --shapes or --energy; without them all are listed";
            return Err(why.to_owned().into());
        }
        check_beads_are_free(&manifest.physics)?;
        let whole = manifest.physics.chain();
        let chain = LinearChain::of(&whole).map_err(|error| error.to_string())?;
        let count = Modes::count_of(&chain).map_err(|error| error.to_string())?;
        let asked = beginning.numbers("mode", "modes", 1..=count as u64)?;
        if asked.len() > MOST {
            return Err(format!("--mode: at most {MOST} modes at once").into());
        }
        let chosen: Vec<usize> = if asked.is_empty() {
            (0..default.min(count)).collect()
        } else {
            asked.iter().filter_map(|mode| usize::try_from(mode - 1).ok()).collect()
        };
        let modes = (!beginning.is_trial).then(|| modes_of(&chain)).transpose();
        let modes = modes.map_err(|error| error.to_string())?;
        if modes.as_ref().is_some_and(|modes| modes.frequency_hz(count - 1) == 0.0) {
            return Err(NO_FREQUENCY.to_owned().into());
        }
        Ok(Self {
            bands_hz: UnitCell::of(&chain).map_or_else(Vec::new, |cell| cell.bands_hz()),
            modes,
            row: Vec::new(),
            largest_j: Vec::new(),
            curves: vec![Series::default(); chosen.len()],
            chosen,
            subject,
            chain: whole,
            follows: follows(&chain),
            manifest,
        })
    }

    /// True where waves of the frequency of a mode travel; not known where there are no bands.
    fn is_in_band(&self, modes: &Modes, mode: usize) -> Option<bool> {
        let carries = || UnitCell::carries(&self.bands_hz, modes.frequency_hz(mode));
        (!self.bands_hz.is_empty()).then(carries)
    }

    fn energy_names(&self) -> Vec<String> {
        self.chosen.iter().map(|mode| format!("energy_mode_{}_j", mode + 1)).collect()
    }

    fn list(&self, modes: &Modes, out: &mut dyn Outlet) {
        for mode in 0..modes.count() {
            let place = match self.is_in_band(modes, mode) {
                Some(true) => Cell::Word("band".to_owned()),
                Some(false) => Cell::Word("gap".to_owned()),
                None => Cell::Empty,
            };
            let (frequency, shared) = (modes.frequency_hz(mode), modes.participation_beads(mode));
            let (number, centre) =
                (Cell::Integer(mode as u64 + 1), Cell::Integer(modes.centre_bead(mode) as u64));
            out.line(0, &[number, Cell::Double(frequency), Cell::Double(shared), centre, place]);
        }
    }

    fn shapes(&self, modes: &Modes) -> Vec<ModeShape> {
        let shape = |mode: &usize| ModeShape {
            mode: mode + 1,
            frequency_hz: modes.frequency_hz(*mode),
            shape: modes.shape(*mode),
        };
        self.chosen.iter().map(shape).collect()
    }
}

impl Analysis for ModeAnalysis {
    fn columns(&self, _: usize) -> Vec<Column> {
        match self.subject {
            Subject::List => ["mode", "frequency_hz", "participation_beads", "centre_bead", "place"]
                .map(|name| name.to_owned().into())
                .into(),
            Subject::Shapes => {
                let names = self.chosen.iter().map(|mode| format!("u_mode_{}", mode + 1));
                ["bead".to_owned()].into_iter().chain(names).map(Column::from).collect()
            }
            Subject::Energies => frame_columns(self.energy_names()),
        }
    }

    fn published(&self) -> Option<ResultColumns> {
        let names = self.energy_names();
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        (self.subject == Subject::Energies).then(|| ResultColumns::named(&names))
    }

    fn wants_frames(&self) -> bool {
        self.subject == Subject::Energies
    }

    fn observe(&mut self, frame: &Frame<'_>, out: &mut dyn Outlet) {
        let Some(modes) = &self.modes else { return };
        self.row.clear();
        let [u_m, v_m_s] = about_rest(&self.chain, &self.follows, frame);
        self.row.extend(self.chosen.iter().map(|mode| modes.energy_j(*mode, &u_m, &v_m_s)));
        self.largest_j.resize(self.row.len(), 0.0);
        for ((energy_j, largest_j), curve) in self.row.iter().zip(&mut self.largest_j).zip(&mut self.curves) {
            *largest_j = if *energy_j > *largest_j { *energy_j } else { *largest_j };
            curve.push(frame.time_s, [*energy_j]);
        }
        out.row(frame, &self.row);
    }

    fn finish(&mut self, out: &mut dyn Outlet) -> Result<(), Refusal> {
        let Some(modes) = self.modes.clone().filter(|_| out.wants(0)) else { return Ok(()) };
        match self.subject {
            Subject::List => self.list(&modes, out),
            Subject::Shapes => {
                let shapes = self.shapes(&modes);
                for bead in 0..shapes.first().map_or(0, |shape| shape.shape.len()) {
                    let values = shapes.iter().map(|shape| Cell::Double(shape.shape[bead]));
                    let line: Vec<Cell> = [Cell::Integer(bead as u64)].into_iter().chain(values).collect();
                    out.line(0, &line);
                }
            }
            Subject::Energies => {}
        }
        Ok(())
    }

    fn report(&mut self) -> Option<Report> {
        let modes = self.modes.clone()?;
        let (title, words, results) = match self.subject {
            Subject::List => ("modes", self.list_words(&modes), self.list_json(&modes)),
            Subject::Shapes => {
                let (mut words, shapes) = (Words::default(), self.shapes(&modes));
                let text = |shape: &ModeShape| {
                    format!("mode {}: {}", shape.mode, quantity(shape.frequency_hz, "Hz"))
                };
                words.each("shapes", shapes.iter().map(text));
                let json_of = |shape: &ModeShape| json!({ "mode": shape.mode, "frequency_hz": shape.frequency_hz, "displacement": shape.shape });
                let all: Vec<Value> = shapes.iter().map(json_of).collect();
                ("shapes of modes", words, json!({ "shapes": all }))
            }
            Subject::Energies => ("energies of modes", self.energy_words(&modes), self.energy_json(&modes)),
        };
        let mut report = Report { title, words, results, ..Report::default() };
        if !self.manifest.physics.is_without_loss() {
            report.notices.push("frequencies and shapes are those without damping and drag".to_owned());
        }
        Some(report)
    }

    fn figure(&mut self) -> Result<Option<Figure>, FigureError> {
        let Some(modes) = self.modes.clone() else { return Ok(None) };
        let all = 0..modes.count();
        Ok(Some(match self.subject {
            Subject::List => {
                let participation: Vec<f64> =
                    all.clone().map(|mode| modes.participation_beads(mode)).collect();
                let frequencies: Vec<f64> = all.map(|mode| modes.frequency_hz(mode)).collect();
                let shown = ModesShown {
                    frequencies_hz: &frequencies,
                    participation_beads: &participation,
                    bands_hz: &self.bands_hz,
                };
                plots::modes(&self.manifest, &shown)
            }
            Subject::Shapes => plots::mode_shapes(&self.manifest, &self.shapes(&modes)),
            Subject::Energies => {
                let numbers: Vec<usize> = self.chosen.iter().map(|mode| mode + 1).collect();
                plots::mode_energies(&self.manifest, &numbers, &self.curves)
            }
        }))
    }

    fn value(&self, name: &str, _: Option<&str>) -> Option<Number> {
        let (modes, mode) = (self.modes.as_ref()?, *self.chosen.first()?);
        Some(Number::Double(match name {
            "centre_bead" => return Some(Number::Count(modes.centre_bead(mode) as u64)),
            "frequency_hz" => modes.frequency_hz(mode),
            "participation_beads" => modes.participation_beads(mode),
            "largest_j" => *self.largest_j.first()?,
            "last_j" => *self.row.first()?,
            _ => return None,
        }))
    }
}

impl ModeAnalysis {
    fn list_words(&self, modes: &Modes) -> Words {
        let mut words = Words::default();
        let ends = [modes.frequency_hz(0), modes.frequency_hz(modes.count() - 1)];
        words.add("modes", format_args!("{}, {}", count(modes.count() as u64), range(ends, "Hz")));
        words.each("bands", self.bands_hz.iter().map(|band| range(*band, "Hz")));
        if self.bands_hz.is_empty() {
            words.add("bands", "none: the chain repeats no unit");
        }
        let all = 0..modes.count();
        let outside: Vec<usize> = all.filter(|mode| self.is_in_band(modes, *mode) == Some(false)).collect();
        words.each("outside", outside.iter().take(SHOWN).map(|mode| outside_text(modes, *mode)));
        if outside.len() > SHOWN {
            words.add("", format_args!("… {} more; --out has them", outside.len() - SHOWN));
        }
        words
    }

    fn list_json(&self, modes: &Modes) -> Value {
        let mode = |mode: usize| {
            json!({
                "mode": mode + 1,
                "frequency_hz": modes.frequency_hz(mode),
                "participation_beads": modes.participation_beads(mode),
                "centre_bead": modes.centre_bead(mode),
                "in_band": self.is_in_band(modes, mode),
            })
        };
        let all: Vec<Value> = (0..modes.count()).map(mode).collect();
        json!({ "bands_hz": self.bands_hz, "modes": all })
    }

    fn energy_words(&self, modes: &Modes) -> Words {
        let mut words = Words::default();
        let joule = |value: f64| quantity(value, "J");
        let text = |(mode, (largest, last)): (&usize, (&f64, &f64))| {
            let hertz = quantity(modes.frequency_hz(*mode), "Hz");
            format!("mode {} ({hertz}): at most {}, last {}", mode + 1, joule(*largest), joule(*last))
        };
        words.each("energy", self.chosen.iter().zip(self.largest_j.iter().zip(&self.row)).map(text));
        words
    }

    fn energy_json(&self, modes: &Modes) -> Value {
        let mode = |(index, mode): (usize, &usize)| {
            json!({
                "mode": mode + 1,
                "frequency_hz": modes.frequency_hz(*mode),
                "largest_j": self.largest_j.get(index),
                "last_j": self.row.get(index),
            })
        };
        json!({ "modes": self.chosen.iter().enumerate().map(mode).collect::<Vec<_>>() })
    }
}

fn outside_text(modes: &Modes, mode: usize) -> String {
    format!(
        "mode {}: {}, around bead {}, shared by {:.1} beads",
        mode + 1,
        quantity(modes.frequency_hz(mode), "Hz"),
        modes.centre_bead(mode),
        modes.participation_beads(mode)
    )
}

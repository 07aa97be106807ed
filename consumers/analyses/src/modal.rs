//! Sharing of energy by the linear modes: spectral entropy, effective number of modes, the time until equipartition.

use crate::modes::{NO_FREQUENCY, about_rest, follows};
use consumers::analysis::{
    Allowed, Analysis, Beginning, Meaning, Number, Offer, Outlet, Refusal, Report, Setting, TableFlag, Takes,
    frame_columns,
};
use consumers::series::Series;
use consumers::table::{Cell, Column};
use figure::{Axis, Colour, Curve, Figure, FigureError, Panel, Stroke};
use pulp::Arch;
use schemas::amounts::{number, quantity};
use schemas::chain::Chain;
use schemas::frame::Frame;
use schemas::functions::ln;
use schemas::manifest::RunManifest;
use schemas::results::ResultColumns;
use schemas::simd::{ordered_sum, vectorized};
use serde_json::json;
use std::ops::Range;
use waves::linear::{LinearChain, check_beads_are_free};
use waves::modal::Modal;

/// The analysis, before it looks at a run.
pub static OFFER: Offer = Offer {
    name: "modal",
    about: "Energies of all linear modes: spectral entropy, effective number of modes, time of equipartition",
    help: "Examples:\n  \
        beadline modal run.mcap --figure modal.png\n  \
        beadline modal run.mcap --out entropy.csv --spectrum spectrum.csv\n  \
        beadline modal live:fput --threshold 0.2             while the run goes on\n  \
        beadline modal run.mcap --bands 1-4,5-16,17-32 --figure bands.png\n\n\
        Modes are those of `beadline modes`: of small motions about the equilibrium, with the linear part of bonds; where walls \
        move, about the places at which the beads would rest between them. With the part p of all their \
        energy that is in each of M modes (those of frequency 0 left out), the entropy is S = -Σ p·ln p, e^S the effective number of modes, and \
        η = (ln M - S)/(ln M - S0) the distance from equipartition (R. Livi and others, Phys. Rev. A 31 (1985) 1039, doi:10.1103/PhysRevA.31.1039), \
        with S0 of the first frame that is looked at: 1 at first. In equilibrium the energies fluctuate, and η comes to about 0.42/(ln M - S0). \
        The mean η is that of energies averaged over the time s since the first frame with the weight s², which forget the beginning and fluctuate \
        less the longer it lasts; --threshold tells when it was first below. --spectrum has the mean energy of each mode. --bands adds the energies of \
        bands of modes, without those of frequency 0, which show a packet of low modes that lasts before all have the same. A frame costs one Fourier transform where all \
        beads and springs are alike, else the square of their number.",
    settings: &[
        Setting::new(
            "threshold",
            Takes::number("eta", Allowed::AboveZero),
            "The mean η that counts as equipartition [default: 0.5]",
        ),
        Setting::new(
            "bands",
            Takes::Text("BANDS", |text| bands_of(text, usize::MAX).map(drop)),
            "Bands of modes whose energies are columns: 1-4,5-8, or a number of equal ones",
        ),
    ],
    tables: &[
        TableFlag { name: "out", help: "Table of the numbers in each frame" },
        TableFlag {
            name: "spectrum",
            help: "Table of the modes: frequency, mean energy, the same over that of equipartition",
        },
    ],
    columns: &[
        Meaning::number("modal_energy_j", "energy of all modes"),
        Meaning::number("entropy", "spectral entropy"),
        Meaning::number("effective_modes", "effective number of modes"),
        Meaning::number("distance", "distance η from equipartition"),
        Meaning::number("mean_distance", "the same from mean energies, of which a time s has the weight s²"),
        Meaning::number("energy_modes_FIRST_LAST_j", "energy of the modes of a band, with --bands"),
    ],
    summary: &[
        Meaning::number("equipartition_s", "time at which the mean η was first below the threshold"),
        Meaning::number("effective_modes", "effective number of modes in the last frame"),
        Meaning::number("distance", "η in the last frame"),
        Meaning::number("mean_distance", "mean η in the last frame"),
        Meaning::number("effective_modes_of_mean", "the same number from the mean energies of the modes"),
    ],
    begin: |beginning| Ok(Box::new(ModalAnalysis::begin(beginning)?)),
    ..Offer::PLAIN
};

/// Entropy of energies (J) that are shared out; NaN where there is none.
fn entropy_of(energies_j: &[f64]) -> f64 {
    vectorized(
        Arch::new(),
        #[inline(always)]
        || {
            let sum_j = ordered_sum([energies_j], |[energy_j]| energy_j);
            let of = |[energy_j]: [f64; 1]| {
                let part = energy_j / sum_j;
                // whatever comes of nothing is left out: without a choice before the logarithm a loop makes vectors of it
                let product = part * ln(part);
                if part >= f64::MIN_POSITIVE { product } else { 0.0 }
            };
            if sum_j > 0.0 { 0.0 - ordered_sum([energies_j], of) } else { f64::NAN }
        },
    )
}

/// Numbers of a row that are about all modes.
const OF_ALL: usize = 5;

/// The least difference of an entropy from that of equipartition.
const LEAST_WAY: f64 = 1e-9;

/// The most bands.
const MOST_BANDS: usize = 64;

/// The least part of the energy of equipartition that is drawn: far below it, a band has not begun to share.
const LEAST_DRAWN: f64 = 1e-6;

/// The bands that `text` names, of `count` modes, which it counts from 1 and the result from 0.
fn bands_of(text: &str, count: usize) -> Result<Vec<Range<usize>>, String> {
    let allowed =
        || format!("expected bands such as 1-4,5-8, or a number of equal bands, at most {MOST_BANDS}");
    if let Ok(bands) = text.parse::<usize>() {
        if bands == 0 || bands > MOST_BANDS {
            return Err(allowed());
        }
        if bands > count {
            return Err(format!("the chain has {count} modes: expected at most as many bands"));
        }
        let edge = |band: usize| count / bands * band + count % bands * band / bands; // integers
        return Ok((0..bands).map(|band| edge(band)..edge(band + 1)).collect());
    }
    let (mut bands, mut end) = (Vec::new(), 0);
    for band in text.split(',') {
        let (first, last) = band.split_once('-').ok_or_else(allowed)?;
        let number = |text: &str| text.parse::<usize>().map_err(|_| allowed());
        let (first, last) = (number(first)?, number(last)?);
        if first <= end || last < first {
            return Err(format!("{band}: bands ascend from mode 1 on, and have no mode in common"));
        }
        if last > count {
            return Err(format!("{band}: the chain has modes 1 to {count}"));
        }
        bands.push(first - 1..last);
        end = last;
    }
    if bands.len() > MOST_BANDS { Err(allowed()) } else { Ok(bands) }
}

/// Name of the column of a band.
fn name_of(Range { start, end }: &Range<usize>) -> String {
    format!("energy_modes_{}_{end}_j", start + 1)
}

struct ModalAnalysis {
    manifest: RunManifest,
    chain: Chain,
    follows: [Vec<f64>; 2],
    /// None where it is a trial.
    modal: Option<Modal>,
    /// Modes of frequency 0, which are the first.
    free: usize,
    threshold: f64,
    energies_j: Vec<f64>,
    /// Their means over the time (s) since the first frame, with the square of that as their weight, until the second one.
    means_j: Vec<f64>,
    means_over_s: Option<[f64; 2]>,
    /// Sums of the energies (J) of each mode over the frames, and their number.
    sums_j: Vec<f64>,
    frames: f64,
    first_entropy: f64,
    /// Modes of each band, counted from 0; those of frequency 0 count nothing.
    bands: Vec<Range<usize>>,
    /// The last row, if there was one.
    last: Vec<f64>,
    equipartition_s: Option<f64>,
    curves: Option<Series<2>>,
    /// Energies (J) of each band.
    band_curves: Vec<Series<1>>,
}

impl ModalAnalysis {
    fn begin(beginning: &Beginning<'_>) -> Result<Self, Refusal> {
        let manifest = beginning.manifest.clone();
        let chain = manifest.physics.chain();
        check_beads_are_free(&manifest.physics)?;
        let linear = LinearChain::of(&chain).map_err(|error| error.to_string())?;
        let count = Modal::count_of(&linear).map_err(|error| error.to_string())?;
        let bands = match beginning.settings.one::<String>("bands") {
            Some(text) => bands_of(&text, count).map_err(|why| Refusal::of("bands", text, why))?,
            None => Vec::new(),
        };
        let modal = (!beginning.is_trial).then(|| Modal::of(&linear)).transpose();
        let modal = modal.map_err(|error| error.to_string())?;
        if modal.as_ref().is_some_and(|modal| (0..modal.count()).all(|mode| modal.frequency_hz(mode) == 0.0))
        {
            return Err(NO_FREQUENCY.to_owned().into());
        }
        let still =
            |modal: &Modal| (0..modal.count()).take_while(|mode| modal.frequency_hz(*mode) == 0.0).count();
        Ok(Self {
            free: modal.as_ref().map_or(0, still),
            sums_j: vec![0.0; modal.as_ref().map_or(0, Modal::count)],
            threshold: beginning.settings.one("threshold").unwrap_or(0.5),
            energies_j: Vec::new(),
            means_j: Vec::new(),
            means_over_s: None,
            frames: 0.0,
            first_entropy: f64::NAN,
            last: Vec::new(),
            equipartition_s: None,
            curves: beginning.is_drawn.then(Series::default),
            band_curves: vec![Series::default(); if beginning.is_drawn { bands.len() } else { 0 }],
            bands,
            modal,
            follows: follows(&linear),
            chain,
            manifest,
        })
    }

    /// Number of modes that share energy.
    fn count(&self) -> usize {
        self.sums_j.len() - self.free
    }

    /// Frequency (Hz), mean energy (J), and that over the energy of equipartition, of each mode.
    fn spectrum(&self) -> Vec<[f64; 3]> {
        let all_j: f64 = self.sums_j.iter().skip(self.free).sum();
        let even_j = all_j / self.count() as f64;
        let modes =
            self.modal.iter().flat_map(|modal| (self.free..modal.count()).map(move |mode| (modal, mode)));
        let of = |(modal, mode): (&Modal, usize)| {
            let sum_j = self.sums_j[mode];
            [modal.frequency_hz(mode), sum_j / self.frames, sum_j / even_j]
        };
        modes.map(of).collect()
    }

    /// Names of the columns.
    fn names(&self) -> Vec<String> {
        let all = OFFER.columns.iter().take(OF_ALL).map(|column| column.name.to_owned());
        all.chain(self.bands.iter().map(name_of)).collect()
    }

    /// The energy of a mode of each band over that of equipartition, over time.
    fn bands_panel(&mut self) -> Panel {
        let mean_j = self.sums_j.iter().skip(self.free).sum::<f64>() / self.frames;
        let even_j = mean_j / self.count() as f64;
        let panel = Panel::new()
            .x_axis(Axis::new("time (s)").log())
            .y_axis(Axis::new("energy of a mode over that of equipartition").log())
            .horizontal("", 1.0);
        let free = self.free;
        let bands = self.bands.iter().zip(&self.band_curves).filter(|(band, _)| band.end > free);
        bands.fold(panel, |panel, (band, curve)| {
            let sharing = band.end - if band.start > free { band.start } else { free };
            let per_mode = curve.curve(0).map(|(t, energy_j)| (t, energy_j / sharing as f64 / even_j));
            let points: Vec<_> = per_mode.filter(|(t, value)| *t > 0.0 && *value > LEAST_DRAWN).collect();
            panel.line(format!("modes {} to {}", band.start + 1, band.end), points)
        })
    }

    /// Takes the energies of the frame at `time_s` into the means.
    fn take_means(&mut self, time_s: f64) {
        let [begin_s, before_s] = self.means_over_s.unwrap_or([time_s; 2]);
        self.means_over_s = Some([begin_s, time_s]);
        // the part of all weight that is of the time since the frame before
        let old = (before_s - begin_s) / (time_s - begin_s);
        let part = if old.is_finite() { 1.0 - old * old * old } else { 1.0 };
        let shared_j = &self.energies_j[self.free..];
        self.means_j.resize(shared_j.len(), 0.0);
        let pairs = self.means_j.iter_mut().zip(shared_j);
        pairs.for_each(|(mean_j, energy_j)| *mean_j += part * (energy_j - *mean_j));
    }

    fn effective_of_mean(&self) -> f64 {
        entropy_of(self.sums_j.get(self.free..).unwrap_or_default()).exp()
    }
}

impl Analysis for ModalAnalysis {
    fn columns(&self, table: usize) -> Vec<Column> {
        let names = ["mode", "frequency_hz", "mean_energy_j", "over_equipartition"];
        if table == 1 { names.map(|name| name.to_owned().into()).into() } else { frame_columns(self.names()) }
    }

    fn published(&self) -> Option<ResultColumns> {
        let names = self.names();
        Some(ResultColumns::named(&names.iter().map(String::as_str).collect::<Vec<_>>()))
    }

    fn observe(&mut self, frame: &Frame<'_>, out: &mut dyn Outlet) {
        let Some(modal) = &mut self.modal else { return };
        let [u_m, v_m_s] = about_rest(&self.chain, &self.follows, frame);
        modal.energies_j(&u_m, &v_m_s, &mut self.energies_j);
        self.frames += 1.0;
        self.sums_j.iter_mut().zip(&self.energies_j).for_each(|(sum_j, energy_j)| *sum_j += energy_j);
        self.take_means(frame.time_s);
        let shared_j = &self.energies_j[self.free..];
        let (entropy, most) = (entropy_of(shared_j), (shared_j.len() as f64).ln());
        if self.first_entropy.is_nan() {
            self.first_entropy = entropy;
        }
        // a run that begins with equipartition has no way there; what is left is rounding
        let way = Some(most - self.first_entropy).filter(|way| *way > LEAST_WAY).unwrap_or(f64::NAN);
        let distance_of = |entropy: f64| (most - entropy) / way;
        let (distance, mean_distance) = (distance_of(entropy), distance_of(entropy_of(&self.means_j)));
        if mean_distance < self.threshold && self.equipartition_s.is_none() {
            self.equipartition_s = Some(frame.time_s);
        }
        self.last.clear();
        self.last.extend([shared_j.iter().sum(), entropy, entropy.exp(), distance, mean_distance]);
        let of_band = |band: &Range<usize>| {
            self.energies_j[band.clone()].iter().skip(self.free.saturating_sub(band.start)).sum::<f64>()
        };
        self.last.extend(self.bands.iter().map(of_band));
        for (curve, energy_j) in self.band_curves.iter_mut().zip(&self.last[OF_ALL..]) {
            curve.push(frame.time_s, [*energy_j]);
        }
        if let Some(curves) = &mut self.curves {
            curves.push(frame.time_s, [distance, mean_distance]);
        }
        out.row(frame, &self.last);
    }

    fn finish(&mut self, out: &mut dyn Outlet) -> Result<(), Refusal> {
        if out.wants(1) {
            for (mode, values) in (self.free..).zip(self.spectrum()) {
                let values = values.map(|value| Cell::from(Number::Double(value)));
                let line: Vec<Cell> = [Cell::Integer(mode as u64 + 1)].into_iter().chain(values).collect();
                out.line(1, &line);
            }
        }
        Ok(())
    }

    fn report(&mut self) -> Option<Report> {
        let &[energy_j, entropy, effective, distance, mean_distance, ..] = &self.last[..] else {
            return None;
        };
        let mean = self.effective_of_mean();
        let mut report = Report { title: "modal energies", ..Report::default() };
        let words = &mut report.words;
        words.add("modes", self.count());
        words.add("energy", format_args!("{} in the modes", quantity(energy_j, "J")));
        words
            .add("effective", format_args!("{} modes; {} by mean energies", number(effective), number(mean)));
        if distance.is_nan() {
            words.add("distance", "none: the first frame has equipartition, or no energy");
        } else {
            words.add("distance", format_args!("η = {}, mean {}", number(distance), number(mean_distance)));
            let reached = self.equipartition_s.map(|time_s| format!("at {}", quantity(time_s, "s")));
            let never = || "not reached in the frames that were looked at".to_owned();
            words.add(
                "mean η below",
                format_args!("{}: {}", number(self.threshold), reached.unwrap_or_else(never)),
            );
        }
        report.results = json!({
            "modes": self.count(), "modal_energy_j": energy_j, "entropy": entropy, "effective_modes": effective,
            "distance": distance, "mean_distance": mean_distance, "equipartition_s": self.equipartition_s, "effective_modes_of_mean": mean,
        });
        Some(report)
    }

    /// The distance from equipartition over time, and the mean energy of each mode.
    fn figure(&mut self) -> Result<Option<Figure>, FigureError> {
        let curves = self.curves.take().unwrap_or_default();
        let distance = |curve: usize| {
            curves.curve(curve).filter(|(t, value)| *t > 0.0 && *value > 0.0).collect::<Vec<_>>()
        };
        let spectrum = self.spectrum().into_iter().filter(|[_, _, part]| *part > 0.0);
        let spectrum: Vec<_> = spectrum.map(|[hertz, _, part]| (hertz, part)).collect();
        // a curve, which the axis has room for
        let threshold = distance(1).into_iter().map(|(t, _)| (t, self.threshold));
        let threshold =
            Curve::line("threshold", threshold).stroke(Stroke::Dashed).colour(Colour::Grey).thin();
        let figure = Figure::new().caption(plots::caption(&self.manifest));
        let figure = if self.bands.is_empty() { figure } else { figure.panel(self.bands_panel()) };
        Ok(Some(
            figure
                .panel(
                    Panel::new()
                        .x_axis(Axis::new("time (s)").log())
                        .y_axis(Axis::new("distance from equipartition η").log())
                        .curve(threshold)
                        .line("in each frame", distance(0))
                        .line("of mean energies", distance(1)),
                )
                .panel(
                    Panel::new()
                        .x_axis(Axis::new("frequency (Hz)"))
                        .y_axis(Axis::new("mean energy over that of equipartition").log())
                        .horizontal("", 1.0)
                        .points("", spectrum),
                ),
        ))
    }

    fn value(&self, name: &str, _: Option<&str>) -> Option<Number> {
        let &[_, _, effective, distance, mean_distance, ..] = &self.last[..] else { return None };
        Some(Number::Double(match name {
            "equipartition_s" => self.equipartition_s?,
            "effective_modes" => effective,
            "distance" => distance,
            "mean_distance" => mean_distance,
            "effective_modes_of_mean" => self.effective_of_mean(),
            _ => return None,
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use consumers::analysis::{LastRow, Settings};
    use producer::integrator::Integrator;
    use producer::state::ChainState;
    use schemas::config::{End, MassRule, RunConfig};
    use schemas::manifest::Origin;
    use schemas::presets::PRESETS;
    use schemas::term::{Spring, TermLaw};

    #[test]
    fn bands_are_read() {
        assert_eq!(bands_of("1-4,6-6,7-9", 9), Ok(vec![0..4, 5..6, 6..9]));
        for (count, bands) in [(9, 1), (9, 4), (9, 9), (1000, 7)] {
            let found = bands_of(&bands.to_string(), count).expect("bands");
            assert_eq!((found.len(), found[0].start, found[bands - 1].end), (bands, 0, count));
            assert!(found.windows(2).all(|pair| pair[0].end == pair[1].start));
            let sizes = || found.iter().map(ExactSizeIterator::len);
            assert!(sizes().max() <= sizes().min().map(|least| least + 1));
        }
        for (text, why) in [
            ("0", "at most 64"),
            ("65", "at most 64"),
            ("10", "9 modes"),
            ("", "1-4,5-8"),
            ("low", "1-4,5-8"),
            ("1-4,7", "1-4,5-8"),
            ("1-x", "1-4,5-8"),
            ("0-3", "from mode 1 on"),
            ("4-3", "from mode 1 on"),
            ("1-4,4-5", "no mode in common"),
            ("5-6,1-2", "ascend"),
            ("5-10", "modes 1 to 9"),
        ] {
            let found = bands_of(text, 9).expect_err(text);
            assert!(found.contains(why), "{text}: {found}");
        }
    }

    /// Walls, free ends, a ring, and unlike masses: the energies of all bands are that of all modes, to the rounding of a sum of 23.
    #[test]
    fn bands_share_all_of_the_energy() {
        let bonds = [(TermLaw::Spring(Spring(1)), 1e5), (TermLaw::Spring(Spring(3)), 1e12)];
        let setting = OFFER.settings.iter().find(|setting| setting.name == "bands").expect("bands");
        for (end, masses) in [(End::Fixed, 1), (End::Free, 1), (End::Periodic, 1), (End::Fixed, 3)] {
            let mut config = PRESETS[0].config();
            config.chain.impurities.clear();
            (config.chain.beads, config.chain.alpha) = (23, Some(1.0));
            config.chain.bonds = Some(bonds.iter().cloned().collect());
            config.chain.masses = MassRule::PatternKg([1e-3, 3e-3, 2e-3][..masses].to_vec());
            (config.ends.left, config.ends.right) = (end, end);
            let origin = Origin { program: String::new(), host: String::new(), started_unix_ns: 0 };
            let manifest = RunManifest::new(&config, "bands", origin).expect("a chain");
            let v_m_s: Vec<f64> = (0..23).map(|i| 0.1 * f64::from(i * i % 7)).collect();
            let state = ChainState::starting_at(&manifest.physics, &[0.0; 23], &v_m_s);
            for bands in ["1-1,2-9,10-23", "1", "5", "23"] {
                let mut settings = Settings::default();
                settings.set(setting, vec![bands.to_owned()]).expect("bands");
                let beginning = Beginning::whole(OFFER.name, &manifest, &settings);
                let mut analysis = ModalAnalysis::begin(&beginning).expect("modes");
                let mut kept = LastRow::default();
                analysis.observe(&state.as_frame(&manifest, 0), &mut kept);
                let row = kept.values().expect("a row").numbers();
                assert_eq!(row.len(), analysis.names().len());
                let sum: f64 = row[OF_ALL..].iter().sum();
                assert!((sum / row[0] - 1.0).abs() < 1e-13, "{end:?}, {bands}: {row:?}");
            }
        }
        let wrong = bands_of("2-24", 23).expect_err("no mode 24");
        assert!(wrong.contains("modes 1 to 23"), "{wrong}");
    }

    /// A chain on a wall that moves, with the other end free: its modes have all of its energy, that of resonators, too.
    #[test]
    fn modes_go_along_with_a_wall() {
        for resonators in ["", "[resonators]\nmass_kg = 0.5\nstiffness_n_per_m = 1.0\n"] {
            let config = RunConfig::from_toml(&format!(
                "[chain]\nbeads = 8\nbead_mass_kg = 1.0\nbonds = {{ linear = 1.0 }}\n[ends]\nleft = \"fixed\"\n{resonators}\
                 [[drive]]\nwall = \"left\"\nvelocity_m_s = 0.1\n[time]\nduration_s = 40\ndt_s = 0.05\n"
            ));
            let origin = Origin { program: String::new(), host: String::new(), started_unix_ns: 0 };
            let manifest = RunManifest::new(&config.expect("TOML"), "wall", origin).expect("a chain");
            let settings = Settings::default();
            let mut analysis =
                ModalAnalysis::begin(&Beginning::whole(OFFER.name, &manifest, &settings)).expect("modes");
            let mut state = ChainState::initial(&manifest.physics);
            let mut integrator = Integrator::new(&manifest.physics);
            (0..800).for_each(|_| integrator.step(&mut state));
            let frame = state.as_frame(&manifest, 0);
            let energy = analysis.chain.energy(frame.u_m, frame.v_m_s, frame.extra, &mut [0.0; 7]);
            analysis.observe(&frame, &mut LastRow::default());
            let found_j = analysis.last[0];
            assert!((found_j / energy.total_j() - 1.0).abs() < 1e-11, "{found_j} {energy:?}");
        }
    }

    /// A free chain has a mode of frequency 0, of which a band alone shares nothing.
    #[test]
    fn a_band_of_zero_modes_is_not_drawn() {
        let config = "[chain]\nbeads = 8\nbead_mass_kg = 1.0\nbonds = { linear = 1.0 }\n[initial]\n\
             velocities_m_s = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]\n[time]\nduration_s = 1.0\n";
        let origin = Origin { program: String::new(), host: String::new(), started_unix_ns: 0 };
        let manifest = RunManifest::new(&RunConfig::from_toml(config).expect("TOML"), "free", origin);
        let (manifest, mut settings) = (manifest.expect("a chain"), Settings::default());
        let setting = OFFER.settings.iter().find(|setting| setting.name == "bands").expect("bands");
        settings.set(setting, vec!["1-1,2-8".to_owned()]).expect("bands");
        let beginning = Beginning { is_drawn: true, ..Beginning::whole(OFFER.name, &manifest, &settings) };
        let mut analysis = ModalAnalysis::begin(&beginning).expect("modes");
        let state = ChainState::initial(&manifest.physics);
        analysis.observe(&state.as_frame(&manifest, 0), &mut LastRow::default());
        assert!(analysis.figure().expect("a figure").is_some());
    }

    #[test]
    fn energies_have_their_entropy() {
        assert_eq!(entropy_of(&[0.0, 3.0, 0.0]), 0.0);
        assert!((entropy_of(&[2.0; 8]).exp() - 8.0).abs() < 1e-12);
        assert!(entropy_of(&[0.0; 2]).is_nan());
    }
}

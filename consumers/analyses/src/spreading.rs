//! Spreading of the energy of a chain, and the number of beads that share it.

use consumers::analysis::{
    Allowed, Analysis, Beginning, Meaning, Needs, Number, Offer, Outlet, Remake, Report, Setting, Takes,
};
use consumers::local_energy::BeadEnergies;
use consumers::power_law::LineSums;
use consumers::series::Series;
use figure::{Axis, Figure, FigureError, Panel};
use schemas::amounts::{counted, number, quantity};
use schemas::chain::Chain;
use schemas::frame::Frame;
use schemas::manifest::RunManifest;
use serde::Serialize;
use serde_json::json;
use std::f64::consts::TAU;

/// The analysis, before it looks at a run.
pub static OFFER: Offer = Offer {
    name: "spreading",
    about: "Spreading of the energy: second moment, the number of beads that share it, their exponents",
    help: "Examples:\n  \
        beadline spreading --figure s.png                    attach to the only live run\n  \
        beadline spreading run.mcap --out s.csv --figure s.svg\n  \
        beadline spreading sparse.mcap --every-step --from 0.04 --until 0.041 --out s.csv\n\n\
        The energy ε of bead i is its kinetic energy, half the potential energy of each contact with a bead, and all of that with a \
        wall. Second moment: m2 = Σ (i − c)²·ε/Σ ε about the centre c = Σ i·ε/Σ ε. Participation number: P = (Σ ε)²/Σ ε², 1 if one bead \
        has all the energy, N if all have the same. A ring is cut open opposite to where the energy is. \
        None of these exists while bonds or springs give a bead an energy below 0. `beadline plot --what energy-density` maps ε.\n\n\
        m2 and P grow as powers of the time: their exponents are the slopes of the logarithms, by least squares from --fit-from to the end, \
        with the same weight for each factor in time. The localisation length ξ is that of exp(-|i − p|/ξ), fitted to the mean energies of these \
        frames around the bead p that has most, out to where they are 1e-8 of its; there is none if it is longer than the chain. Errors are those over runs: sweep the seed.",
    settings: &[Setting::new(
        "fit-from",
        Takes::number("s", Allowed::AboveZero),
        "Begin of the exponents and of the mean energies [default: a tenth of the time of the last frame]",
    )],
    columns: &COLUMNS,
    summary: &SUMMARY,
    needs: Needs { remake: Remake::OfFrame, ..Needs::FRAMES },
    begin: |beginning| Ok(Box::new(Spreading::new(beginning))),
    ..Offer::PLAIN
};

const COLUMNS: [Meaning; 4] = [
    Meaning::number("energy_j", "energy of all beads"),
    Meaning::number("centre_beads", "centre of the energy"),
    Meaning::number("second_moment_beads2", "second moment of the energy about its centre"),
    Meaning::number("participation_beads", "beads that share the energy"),
];

const SUMMARY: [Meaning; 7] = [
    COLUMNS[0],
    COLUMNS[1],
    COLUMNS[2],
    COLUMNS[3],
    Meaning::number("moment_exponent", "exponent of the growth of the second moment"),
    Meaning::number("participation_exponent", "the same of the participation number"),
    Meaning::number("localisation_beads", "localisation length of the energy"),
];

/// Mean energy of a bead over the largest one, below which the localisation length does not look at it.
const FAINTEST: f64 = 1e-8;

/// The energy of a bead over that of all, below 0, that rounding may give.
const ROUNDING: f64 = 1e-12;

/// Energy along the chain in one frame, with `ε_i` the energy of bead `i` ([`BeadEnergies`]). NaN in a chain without energy, and all
/// but the energy where one is below 0 by more than rounding.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SpreadingRow {
    /// `Σ ε_i` (J).
    pub energy_j: f64,
    /// The middle `ī = Σ i·ε_i/Σ ε_i` (beads).
    pub centre_beads: f64,
    /// The second moment `m2 = Σ (i − ī)²·ε_i/Σ ε_i` (beads²).
    pub second_moment_beads2: f64,
    /// The participation number `P = (Σ ε_i)²/Σ ε_i²` (beads): 1 if one bead has everything, N if all have the same.
    pub participation_beads: f64,
}

impl SpreadingRow {
    /// Makes one for beads with these energies (J). Sums are in the order of the beads.
    ///
    /// ```
    /// use analyses::spreading::SpreadingRow;
    /// let row = SpreadingRow::of(&[1.0, 0.0, 1.0]);
    /// assert_eq!((row.centre_beads, row.second_moment_beads2, row.participation_beads), (1.0, 1.0, 2.0));
    /// ```
    pub fn of(energies_j: &[f64]) -> Self {
        Self::among(0, energies_j, None).0
    }

    /// The same where no beads have energy but those from `first` on, with `energies_j` (J); in a ring of so many beads, which is cut
    /// open opposite to where the energy is. With true if one is below 0 by more than rounding.
    fn among(first: usize, energies_j: &[f64], ring: Option<usize>) -> (Self, bool) {
        let around = ring.map(|beads| (beads as f64, mean_place(first, energies_j, beads as f64)));
        let first = u32::try_from(first).unwrap_or(u32::MAX); // a chain has at most 2e7 beads
        let place = |bead: u32| match (f64::from(bead), around) {
            (place, Some((beads, mean))) => place - beads * ((place - mean) / beads).round(),
            (place, None) => place,
        };
        let sum = |of: &dyn Fn(f64, f64) -> f64| {
            (first..).zip(energies_j).fold(0.0, |sum, (bead, energy)| sum + of(place(bead), *energy))
        };
        let energy_j = sum(&|_, energy| energy);
        let least_j = -ROUNDING * sum(&|_, energy| energy.abs());
        if energies_j.iter().any(|energy_j| *energy_j < least_j) {
            let [centre_beads, second_moment_beads2, participation_beads] = [f64::NAN; 3];
            return (Self { energy_j, centre_beads, second_moment_beads2, participation_beads }, true);
        }
        let centre_beads = sum(&|bead, energy| bead * energy) / energy_j;
        let second = sum(&|bead, energy| (bead - centre_beads) * (bead - centre_beads) * energy);
        let row = Self {
            energy_j,
            centre_beads: around.map_or(centre_beads, |(beads, _)| centre_beads.rem_euclid(beads)),
            second_moment_beads2: second / energy_j,
            participation_beads: energy_j * energy_j / sum(&|_, energy| energy * energy),
        };
        (row, false)
    }

    /// The values in the order of the columns.
    pub fn values(&self) -> [f64; 4] {
        [self.energy_j, self.centre_beads, self.second_moment_beads2, self.participation_beads]
    }
}

/// The mean direction of these energies of beads from `first` on, in a ring of `beads` beads, as a place in it.
fn mean_place(first: usize, energies_j: &[f64], beads: f64) -> f64 {
    let (step_sin, step_cos) = (TAU / beads).sin_cos();
    let (mut sin, mut cos) = (TAU * first as f64 / beads).sin_cos();
    let mut sums = [0.0; 2];
    for energy_j in energies_j {
        sums = [sums[0] + energy_j * cos, sums[1] + energy_j * sin];
        (sin, cos) = (sin * step_cos + cos * step_sin, cos * step_cos - sin * step_sin);
    }
    sums[1].atan2(sums[0]) / TAU * beads
}

struct Spreading {
    manifest: RunManifest,
    chain: Chain,
    energies: BeadEnergies,
    last: Option<SpreadingRow>,
    fit_from_s: f64,
    /// Logarithms of the second moment and of the participation number over that of the time.
    growth: [LineSums; 2],
    /// Sums of the energies (J) of the beads.
    sums_j: Vec<f64>,
    /// Frames in which a bead has an energy below 0.
    below_zero: u64,
    /// Kept for a figure alone.
    curves: Option<Series<4>>,
}

impl Spreading {
    fn new(beginning: &Beginning<'_>) -> Self {
        let manifest = beginning.manifest.clone();
        let curves = beginning.is_drawn.then(Series::default);
        let last_step = manifest.physics.step_count.min(*beginning.steps.end());
        let a_tenth_s = 0.1 * manifest.physics.time_s(last_step);
        let chain = manifest.physics.chain();
        Self {
            energies: BeadEnergies::new(&chain),
            last: None,
            fit_from_s: beginning.settings.one("fit-from").unwrap_or(a_tenth_s),
            growth: [LineSums::default(); 2],
            sums_j: vec![0.0; chain.bead_count()],
            below_zero: 0,
            chain,
            manifest,
            curves,
        }
    }

    /// The exponents of the growth of the second moment and of the participation number.
    fn exponents(&self) -> [Option<f64>; 2] {
        self.growth.map(|sums| sums.line().map(|[slope, _]| slope))
    }

    /// The localisation length (beads); none where energies do not fall from the bead that has most.
    fn localisation_beads(&self) -> Option<f64> {
        let mut sums_j = self.sums_j.clone();
        let (mut peak, most_j) =
            sums_j.iter().copied().enumerate().reduce(|a, b| if b.1 > a.1 { b } else { a })?;
        if self.chain.is_ring {
            let (beads, middle) = (sums_j.len(), sums_j.len() / 2);
            sums_j.rotate_left((peak + beads - middle) % beads);
            peak = middle;
        }
        let is_seen = |sum_j: &&f64| **sum_j > FAINTEST * most_j;
        let mut sums = LineSums::default();
        let (before, after) = sums_j.split_at(peak);
        for (first, side) in [(1_u32, before.iter().rev().collect::<Vec<_>>()), (0, after.iter().collect())] {
            let seen = side.into_iter().take_while(is_seen);
            (first..).zip(seen).for_each(|(distance, sum_j)| sums.add((distance.into(), sum_j.ln()), 1.0));
        }
        // along the chain they fall by e at least, or it holds no length
        let most = sums_j.len() as f64;
        sums.line().map(|[slope, _]| -1.0 / slope).filter(|length| *length > 0.0 && *length <= most)
    }
}

impl Analysis for Spreading {
    fn observe(&mut self, frame: &Frame<'_>, out: &mut dyn Outlet) {
        let (beads, energies_j) = self.energies.of(&self.chain, frame);
        let energies_j = &energies_j[beads.clone()];
        let ring = self.chain.is_ring.then_some(self.chain.bead_count());
        let (row, is_below_zero) = SpreadingRow::among(beads.start, energies_j, ring);
        if self.last.is_none() && frame.time_s > self.fit_from_s {
            self.fit_from_s = frame.time_s;
        }
        self.below_zero += u64::from(is_below_zero);
        if !row.participation_beads.is_nan() && frame.time_s >= self.fit_from_s {
            for (sums, value) in
                self.growth.iter_mut().zip([row.second_moment_beads2, row.participation_beads])
            {
                sums.add((frame.time_s.ln(), value.ln()), 1.0 / frame.time_s);
            }
            self.sums_j[beads].iter_mut().zip(energies_j).for_each(|(sum_j, energy_j)| *sum_j += energy_j);
        }
        if let Some(curves) = &mut self.curves {
            curves.push(frame.time_s, row.values());
        }
        out.row(frame, &row.values());
        self.last = Some(row);
    }

    fn report(&mut self) -> Option<Report> {
        let mut report = Report { title: "spreading", results: json!(self.last), ..Report::default() };
        let Some(row) = self.last else { return Some(report) };
        let [moment_exponent, participation_exponent] = self.exponents();
        let localisation_beads = self.localisation_beads();
        report.results["moment_exponent"] = json!(moment_exponent);
        report.results["participation_exponent"] = json!(participation_exponent);
        report.results["localisation_beads"] = json!(localisation_beads);
        let words = &mut report.words;
        if self.below_zero > 0 {
            let frames = counted(self.below_zero, "frame");
            report.notices.push(format!(
                "in {frames} a bead has an energy below 0: no centre, second moment or participation number there"
            ));
        }
        if row.participation_beads.is_nan() && row.energy_j == 0.0 {
            words.add("energy", "none: nothing can spread");
            return Some(report);
        }
        words.add("energy", quantity(row.energy_j, "J"));
        if !row.participation_beads.is_nan() {
            words.add("centre", format_args!("bead {}", number(row.centre_beads)));
            let (moment, width) = (row.second_moment_beads2, row.second_moment_beads2.sqrt());
            words.add(
                "second moment",
                format_args!("{} beads² (width {} beads)", number(moment), number(width)),
            );
            words.add("participation", format_args!("{} beads", number(row.participation_beads)));
        }
        let from = quantity(self.fit_from_s, "s");
        for (name, exponent) in [("m2 grows", moment_exponent), ("P grows", participation_exponent)] {
            if let Some(exponent) = exponent {
                words.add(name, format_args!("as t^{} from {from} on", number(exponent)));
            }
        }
        if let Some(length) = localisation_beads {
            words.add("localisation", format_args!("{} beads", number(length)));
        }
        Some(report)
    }

    fn value(&self, name: &str, _: Option<&str>) -> Option<Number> {
        let [moment, participation] = self.exponents();
        let value = match name {
            "moment_exponent" => moment,
            "participation_exponent" => participation,
            "localisation_beads" => self.localisation_beads(),
            _ => None,
        };
        value.map(Number::Double)
    }

    /// The second moment and the participation number over time, both logarithmic: a power law is a straight line.
    fn figure(&mut self) -> Result<Option<Figure>, FigureError> {
        let curves = self.curves.take().unwrap_or_default();
        let panel = |label: &str, column: usize| {
            let curve = curves.curve(column).map(|(t, value)| (t * 1e3, value));
            // time 0 has no logarithm, nor has the moment of a single bead
            let curve: Vec<_> = curve.filter(|(t, value)| *t > 0.0 && *value > 0.0).collect();
            Panel::new().x_axis(Axis::new("time (ms)").log()).y_axis(Axis::new(label).log()).line("", curve)
        };
        Ok(Some(
            Figure::new()
                .shared_x()
                .caption(plots::caption(&self.manifest))
                .panel(panel("second moment m_{2} (beads^{2})", 2))
                .panel(panel("participation number P (beads)", 3)),
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use schemas::manifest::Origin;
    use schemas::presets::Preset;

    /// Has looked at frames every ms of 400 beads on springs at rest, with these kinetic energies by the time (ms) and the bead.
    fn observed(energy_j: impl Fn(u32, usize) -> f64) -> Spreading {
        let config = Preset::find("disordered").expect("a preset").config();
        let origin = Origin { program: String::new(), host: String::new(), started_unix_ns: 0 };
        let manifest = RunManifest::new(&config, "run", origin).expect("valid");
        let mut settings = consumers::analysis::Settings::default();
        settings.set(&OFFER.settings[0], vec!["1e-4".to_owned()]).expect("a time");
        let mut spreading = Spreading::new(&Beginning::whole("spreading", &manifest, &settings));
        let mass_kg = spreading.chain.mass_kg.clone();
        for ms in 1..=20 {
            let speed = |(bead, mass_kg): (usize, &f64)| (2.0 * energy_j(ms, bead) / mass_kg).sqrt();
            let v_m_s: Vec<f64> = mass_kg.iter().enumerate().map(speed).collect();
            let (u_m, time_s) = (&vec![0.0; v_m_s.len()], 1e-3 * f64::from(ms));
            let frame = Frame { frame: 0, step: 0, time_s, u_m, v_m_s: &v_m_s, extra: &[], active: None };
            spreading.observe(&frame, &mut consumers::analysis::LastRow::default());
        }
        spreading
    }

    #[test]
    fn laws_of_spreading_are_found() {
        // two beads that run apart: m2 ∝ t², and P = 2
        let apart = |ms: u32, bead: usize| if bead.abs_diff(200) == 3 * ms as usize { 1.0 } else { 0.0 };
        let [moment, shared] = observed(apart).exponents().map(|found| found.expect("frames"));
        assert!((moment - 2.0).abs() < 1e-9 && shared.abs() < 1e-12, "{moment} {shared}");
        // energies that fall by e in two beads
        let held = observed(|_, bead| (-0.5 * (bead as f64 - 200.0).abs()).exp());
        let length = held.localisation_beads().expect("it falls");
        assert!((length - 2.0).abs() < 1e-9, "{length}");
        assert_eq!(observed(|_, _| 1.0).localisation_beads(), None);
        // the squares of energies may be too small for a double
        let mut faint = observed(|_, bead| if bead == 200 { 1e-170 } else { 0.0 });
        assert!(faint.report().expect("a report").notices.is_empty());
        // not from the 0.1 ms on that were asked for: the first frame is later
        assert_eq!(observed(apart).fit_from_s, 1e-3);
    }

    #[test]
    fn a_packet_and_an_even_chain_have_their_numbers() {
        let one = SpreadingRow::of(&[0.0, 0.0, 3.0, 0.0]);
        assert_eq!(one.values(), [3.0, 2.0, 0.0, 1.0]);
        // N beads of one energy: (N² − 1)/12 and N
        let even = SpreadingRow::of(&[0.5; 11]);
        assert_eq!(even.values(), [5.5, 5.0, 10.0, 11.0]);
        assert!(SpreadingRow::of(&[0.0; 3]).participation_beads.is_nan());
        // shares of a sum are above 0, but for rounding
        let [energy_j, rest @ ..] = SpreadingRow::of(&[3.0, -1.0, 2.0]).values();
        assert!(energy_j == 4.0 && rest.iter().all(|value| value.is_nan()));
        assert_eq!(SpreadingRow::of(&[1.0, -1e-17, 1.0]).participation_beads, 2.0);
    }

    /// A packet in a ring is as wide at the seam as elsewhere, and its middle is where it is.
    #[test]
    fn a_ring_has_no_first_bead() {
        let packet = [0.5, 2.0, 1.0, 0.25];
        let (whole, _) = SpreadingRow::among(2, &packet, Some(11));
        assert_eq!(whole, SpreadingRow::of(&[[0.0; 2].as_slice(), &packet, &[0.0; 5]].concat()));
        let mut turned = [[0.0; 2].as_slice(), &packet, &[0.0; 5]].concat();
        for turns in 1..=11_u32 {
            turned.rotate_right(1);
            let (row, _) = SpreadingRow::among(0, &turned, Some(11));
            let middle = (whole.centre_beads + f64::from(turns)) % 11.0;
            assert!((row.centre_beads - middle).abs() < 1e-12, "{turns}: {row:?}");
            assert!(
                (row.second_moment_beads2 - whole.second_moment_beads2).abs() < 1e-12,
                "{turns}: {row:?}"
            );
        }
    }
}

//! Sharing of energy by the linear modes: spectral entropy, effective number of modes, the time until equipartition.

use crate::modes::with_resonators;
use consumers::analysis::{
    Allowed, Analysis, Beginning, Meaning, Needs, Number, Offer, Outlet, Refusal, Report, Setting, TableFlag,
    Takes,
};
use consumers::series::Series;
use consumers::table::{Cell, Column};
use figure::{Axis, Figure, FigureError, Panel};
use schemas::amounts::{number, quantity};
use schemas::chain::Chain;
use schemas::frame::Frame;
use schemas::manifest::RunManifest;
use serde_json::json;
use waves::linear::LinearChain;
use waves::modal::Modal;

/// The analysis, before it looks at a run.
pub static OFFER: Offer = Offer {
    name: "modal",
    about: "Energies of all linear modes: spectral entropy, effective number of modes, time of equipartition",
    help: "Examples:\n  \
        beadline modal run.mcap --figure modal.png\n  \
        beadline modal run.mcap --out entropy.csv --spectrum spectrum.csv\n  \
        beadline modal live:fput --threshold 0.2             while the run goes on\n\n\
        Modes are those of `beadline modes`: of small motions about the equilibrium, with the linear part of bonds. With the part p of all their \
        energy that is in each of M modes (those of frequency 0 left out), the entropy is S = -Σ p·ln p, e^S the effective number of modes, and \
        η = (ln M - S)/(ln M - S0) the distance from equipartition (R. Livi and others, Phys. Rev. A 31 (1985) 1039, doi:10.1103/PhysRevA.31.1039), \
        with S0 of the first frame that is looked at: 1 at first. In equilibrium the energies fluctuate, and η comes to about 0.42/(ln M - S0). \
        The mean η is that of energies averaged over the time s since the first frame with the weight s², which forget the beginning and fluctuate \
        less the longer it lasts; --threshold tells when it was first below. --spectrum has the mean energy of each mode. A frame costs one Fourier transform where all \
        beads and springs are alike, else the square of their number.",
    settings: &[Setting::new(
        "threshold",
        Takes::number("eta", Allowed::AboveZero),
        "The mean η that counts as equipartition [default: 0.5]",
    )],
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
    ],
    summary: &[
        Meaning::number("equipartition_s", "time at which the mean η was first below the threshold"),
        Meaning::number("effective_modes", "effective number of modes in the last frame"),
        Meaning::number("distance", "η in the last frame"),
        Meaning::number("mean_distance", "mean η in the last frame"),
        Meaning::number("effective_modes_of_mean", "the same number from the mean energies of the modes"),
    ],
    needs: Needs::FRAMES,
    begin: |beginning| Ok(Box::new(ModalAnalysis::begin(beginning)?)),
    ..Offer::PLAIN
};

/// Entropy of energies (J) that are shared out; NaN where there is none.
fn entropy_of(energies_j: &[f64]) -> f64 {
    let sum_j = energies_j.iter().fold(0.0, |sum, energy_j| sum + energy_j);
    let of =
        |energy_j: &f64| if *energy_j > 0.0 { (energy_j / sum_j) * (energy_j / sum_j).ln() } else { 0.0 };
    if sum_j > 0.0 { 0.0 - energies_j.iter().map(of).sum::<f64>() } else { f64::NAN }
}

struct ModalAnalysis {
    manifest: RunManifest,
    chain: Chain,
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
    last: [f64; 5],
    equipartition_s: Option<f64>,
    curves: Option<Series<2>>,
}

impl ModalAnalysis {
    fn begin(beginning: &Beginning<'_>) -> Result<Self, Refusal> {
        let manifest = beginning.manifest.clone();
        let chain = manifest.physics.chain();
        let linear = LinearChain::of(&chain).map_err(|error| error.to_string())?;
        let modal = if beginning.is_trial {
            Modal::check(&linear).map(|()| None)
        } else {
            Modal::of(&linear).map(Some)
        };
        let modal = modal.map_err(|error| error.to_string())?;
        if modal.as_ref().is_some_and(|modal| (0..modal.count()).all(|mode| modal.frequency_hz(mode) == 0.0))
        {
            return Err("no mode of this chain has a frequency: its bonds have no linear part"
                .to_owned()
                .into());
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
            last: [f64::NAN; 5],
            equipartition_s: None,
            curves: beginning.is_drawn.then(Series::default),
            modal,
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

    fn effective_of_mean(&self) -> f64 {
        entropy_of(self.sums_j.get(self.free..).unwrap_or_default()).exp()
    }
}

impl Analysis for ModalAnalysis {
    fn columns(&self, table: usize) -> Vec<Column> {
        let names = ["mode", "frequency_hz", "mean_energy_j", "over_equipartition"];
        if table == 1 { names.map(|name| name.to_owned().into()).into() } else { Vec::new() }
    }

    fn observe(&mut self, frame: &Frame<'_>, out: &mut dyn Outlet) {
        let Some(modal) = &mut self.modal else { return };
        let [u_m, v_m_s] = with_resonators(&self.chain, frame);
        modal.energies_j(&u_m, &v_m_s, &mut self.energies_j);
        self.frames += 1.0;
        self.sums_j.iter_mut().zip(&self.energies_j).for_each(|(sum_j, energy_j)| *sum_j += energy_j);
        let shared_j = &self.energies_j[self.free..];
        let [begin_s, before_s] = self.means_over_s.unwrap_or([frame.time_s; 2]);
        // the part of all weight that is of the time since the frame before
        let (time_s, before) = (frame.time_s - begin_s, before_s - begin_s);
        let part = if time_s > 0.0 { 1.0 - (before / time_s).powi(3) } else { 1.0 };
        self.means_over_s = Some([begin_s, frame.time_s]);
        self.means_j.resize(shared_j.len(), 0.0);
        self.means_j
            .iter_mut()
            .zip(shared_j)
            .for_each(|(mean_j, energy_j)| *mean_j += part * (energy_j - *mean_j));
        let (entropy, most) = (entropy_of(shared_j), (shared_j.len() as f64).ln());
        if self.first_entropy.is_nan() {
            self.first_entropy = entropy;
        }
        let distance_of = |entropy: f64| (most - entropy) / (most - self.first_entropy);
        let (distance, mean_distance) = (distance_of(entropy), distance_of(entropy_of(&self.means_j)));
        if mean_distance < self.threshold && self.equipartition_s.is_none() {
            self.equipartition_s = Some(frame.time_s);
        }
        self.last = [shared_j.iter().sum(), entropy, entropy.exp(), distance, mean_distance];
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
        let [energy_j, entropy, effective, distance, mean_distance] = self.last;
        let mean = self.effective_of_mean();
        let mut report = Report { title: "modal energies", ..Report::default() };
        let words = &mut report.words;
        words.add("modes", self.count());
        words.add("energy", format_args!("{} in the modes", quantity(energy_j, "J")));
        words
            .add("effective", format_args!("{} modes; {} by mean energies", number(effective), number(mean)));
        words.add("distance", format_args!("η = {}, mean {}", number(distance), number(mean_distance)));
        let reached = self.equipartition_s.map(|time_s| format!("at {}", quantity(time_s, "s")));
        let never = || "not reached in the frames that were looked at".to_owned();
        words.add(
            "mean η below",
            format_args!("{}: {}", number(self.threshold), reached.unwrap_or_else(never)),
        );
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
        Ok(Some(
            Figure::new()
                .caption(plots::caption(&self.manifest))
                .panel(
                    Panel::new()
                        .x_axis(Axis::new("time (s)").log())
                        .y_axis(Axis::new("distance from equipartition η").log())
                        .horizontal("threshold", self.threshold)
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
        let [_, _, effective, distance, mean_distance] = self.last;
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

    #[test]
    fn energies_have_their_entropy() {
        assert_eq!(entropy_of(&[0.0, 3.0, 0.0]), 0.0);
        assert!((entropy_of(&[2.0; 8]).exp() - 8.0).abs() < 1e-12);
        assert!(entropy_of(&[0.0; 2]).is_nan());
    }
}

//! Equilibrium correlations over distance and time: of stretch, momentum and energy, with the speed of sound.

mod engine;

use consumers::analysis::{
    Allowed, Analysis, Beginning, Meaning, Number, Offer, Outlet, Refusal, Report, Setting, TableFlag, Takes,
};
use consumers::blocks::FEWEST;
use consumers::local_energy::bead_energies_j;
use consumers::table::{Cell, Column};
use consumers::uncertain::Uncertain;
use engine::{Engine, FIELDS, Fields, Found, Plan};
use figure::{Axis, Curve, Figure, FigureError, Panel};
use schemas::amounts::{counted, number, quantity, typed_quantity};
use schemas::chain::Chain;
use schemas::frame::Frame;
use schemas::manifest::RunManifest;
use serde_json::json;
use waves::linear::LinearChain;
use waves::sampling::{Sampling, Take};

/// The analysis, before it looks at a run.
pub static OFFER: Offer = Offer {
    name: "correlations",
    about: "Correlations of stretch, momentum and energy over distance and time, and the speed of sound",
    help: "Examples:\n  \
        beadline correlations run.mcap --from 200 --figure correlations.png\n  \
        beadline correlations run.mcap --lag 50 --lags 10 --out correlations.csv\n  \
        beadline correlations live:hot --figure c.svg        while the run goes on\n\n\
        C(j, t) = <a_(i+j)(s+t)·a_i(s)> - <a_(i+j)>·<a_i> over places i and times s, for the stretch u_(i+1) - u_i of each contact, the momentum m·v \
        and the energy of each bead with half of that of its contacts, in a run in equilibrium: leave out the beginning (--from). In a ring i is each bead. In a \
        chain with ends i + j is in the middle half, and j goes up to a quarter of the beads, so that all distances have equally many pairs. Frames have to be evenly spaced; no pair \
        has a gap between. A run has one energy, and often one momentum: C lies below that of an infinite chain by the variance of these totals over N, and adds up to 0. \
        Sound moves away at ±c, heat stays in the middle (H. Spohn, J. Stat. Phys. 154 (2014) 1191, doi:10.1007/s10955-014-0933-y; S. G. Das and others, Phys. Rev. E 90 (2014) 012124, \
        doi:10.1103/PhysRevE.90.012124). c is the slope of the place of the momentum's peak over the lag. In a ring the sums over j of what is conserved do not change with t, which is \
        reported. Standard errors are from the scatter of about 32 parts of the run. They are too small where its modes hardly exchange energy, as in nearly linear chains, of which \
        each run has its own correlations, and waves whose speed depends on their length draw the peak apart: sweep the seed.",
    settings: &[
        Setting::new(
            "lag",
            Takes::number("s", Allowed::AboveZero),
            "Longest lag (s) [default: a tenth of the time that is looked at, or what small waves need for 0.3 of a ring, 0.15 of another chain]",
        ),
        Setting::new(
            "lags",
            Takes::Whole("COUNT"),
            "Number of lags above 0 [default: 20, fewer of more than 6000 beads]",
        ),
        Setting::new(
            "origins",
            Takes::number("s", Allowed::AboveZero),
            "Time between two origins (s) [default: that between two lags]",
        ),
    ],
    tables: &[TableFlag {
        name: "out",
        help: "Table of the correlations over lag and distance, with errors",
    }],
    summary: &[
        Meaning::number("sound_beads_per_s", "speed of sound"),
        Meaning::number("sound_error_beads_per_s", "its standard error"),
        Meaning::number(
            "stretch_sum_change",
            "largest change of the sum over a ring, over C(0, 0), of the stretch",
        ),
        Meaning::number("momentum_sum_change", "the same of the momentum"),
        Meaning::number("energy_sum_change", "the same of the energy"),
    ],
    begin: |beginning| Ok(Box::new(Correlations::begin(beginning)?)),
    ..Offer::PLAIN
};

/// Lags above 0, unless told.
const LAGS: usize = 20;
/// Most values of a field: one for each bead and lag. Each takes 1.6 kB.
const MOST_VALUES: usize = 1 << 17;
/// Most values of a field that wait for the longest lag. Each takes 24 bytes.
const MOST_WAITING: usize = 1 << 23;
/// Parts of a run whose scatter gives the errors.
const PARTS: u64 = 32;

struct Correlations {
    manifest: RunManifest,
    chain: Chain,
    lag_s: Option<f64>,
    lags: usize,
    origins_s: Option<f64>,
    last_step: u64,
    sampling: Sampling,
    /// The first sample, until there is a second one.
    first: Option<Fields>,
    engine: Option<Engine>,
    refusal: Option<Refusal>,
    found: Option<Found>,
}

impl Correlations {
    fn begin(beginning: &Beginning<'_>) -> Result<Self, Refusal> {
        let (manifest, settings) = (beginning.manifest.clone(), beginning.settings);
        let chain = manifest.physics.chain();
        let beads = chain.bead_count();
        let most = (MOST_VALUES / beads).saturating_sub(1);
        if most == 0 {
            return Err(format!("{beads} beads; allowed: chains of at most {} beads", MOST_VALUES / 2).into());
        }
        let lags = settings.one("lags").unwrap_or(LAGS.min(most));
        if !(1..=most).contains(&lags) {
            let why = format!("allowed for {}: 1 to {most}", counted(beads as u64, "bead"));
            return Err(Refusal::of("lags", lags.to_string(), why));
        }
        Ok(Self {
            lag_s: settings.one("lag"),
            lags,
            origins_s: settings.one("origins"),
            last_step: manifest.physics.step_count.min(*beginning.steps.end()),
            sampling: Sampling::default(),
            first: None,
            engine: None,
            refusal: None,
            found: None,
            chain,
            manifest,
        })
    }

    /// Time from one sample to the next (s).
    fn interval_s(&self) -> f64 {
        self.sampling.interval_steps().unwrap_or(1) as f64 * self.manifest.physics.dt_s
    }

    /// Stretches (m; of a chain with ends one fewer), momenta (kg m/s), energies (J).
    fn fields(&self, frame: &Frame<'_>) -> Fields {
        let u_m = frame.u_m;
        let seam_m = self.chain.is_ring.then(|| u_m[0] - u_m[u_m.len() - 1]);
        [
            u_m.windows(2).map(|pair| pair[1] - pair[0]).chain(seam_m).collect(),
            self.chain.mass_kg.iter().zip(frame.v_m_s).map(|(mass_kg, v)| mass_kg * v).collect(),
            bead_energies_j(&self.chain, frame),
        ]
    }

    /// The lags and origins in `samples` samples.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "above 0; what is too large is refused"
    )]
    fn plan(&self, samples: u64) -> Result<Plan, Refusal> {
        let (interval_s, beads) = (self.interval_s(), self.chain.bead_count());
        let in_samples = |time_s: f64| ((time_s / interval_s).round() as u64).max(1);
        let linear = LinearChain::of(&self.chain).ok();
        let sound = linear.and_then(|linear| linear.long_waves_beads_per_s()).map(|beads_per_s| {
            let distance = if self.chain.is_ring { 0.3 } else { 0.15 } * beads as f64;
            in_samples(distance / beads_per_s).max(self.lags as u64)
        });
        let tenth = (samples / 10).max(1);
        let longest = self.lag_s.map_or(sound.unwrap_or(tenth).min(tenth), in_samples);
        let stride = self.origins_s.map_or((longest / self.lags as u64).max(1), in_samples);
        let longest = (longest as f64 / stride as f64).round().max(1.0) as u64;
        if longest.saturating_mul(beads as u64) > MOST_WAITING as u64 {
            let most = MOST_WAITING / beads;
            let why = format!(
                "{longest} origins within the longest lag; allowed for {beads} beads: {most}. Choose a shorter --lag, or a longer --origins"
            );
            return Err(why.into());
        }
        let lags = (0..=self.lags as u64).map(|lag| (lag * longest) as f64 / self.lags as f64);
        let mut lags: Vec<usize> = lags.map(|lag| lag.round() as usize).collect();
        lags.dedup();
        let origins = (samples.saturating_sub(1) / stride + 1).saturating_sub(longest);
        Ok(Plan { lags, stride, part: (origins / PARTS).max(1) })
    }
}

impl Analysis for Correlations {
    fn columns(&self, _: usize) -> Vec<Column> {
        let fields =
            FIELDS.iter().flat_map(|(name, unit)| [format!("{name}_{unit}"), format!("{name}_error_{unit}")]);
        ["lag_s".to_owned(), "distance_beads".to_owned()]
            .into_iter()
            .chain(fields)
            .map(Column::from)
            .collect()
    }

    fn wants_frames(&self) -> bool {
        self.refusal.is_none()
    }

    fn observe(&mut self, frame: &Frame<'_>, _: &mut dyn Outlet) {
        let take = self.sampling.take(frame.step);
        if take == Take::Skip || self.refusal.is_some() {
            return;
        }
        if self.engine.is_none() {
            let Some(samples) = self.sampling.expected(self.last_step) else {
                self.first = Some(self.fields(frame));
                return;
            };
            match self.plan(samples) {
                Ok(plan) => {
                    let mut engine = Engine::new(self.chain.bead_count(), self.chain.is_ring, plan);
                    self.first.take().iter().for_each(|first| engine.push(first));
                    self.engine = Some(engine);
                }
                Err(refusal) => self.refusal = Some(refusal),
            }
        }
        let Some(mut engine) = self.engine.take() else { return };
        if take == Take::AfterGap {
            engine.restart();
        }
        if self.sampling.index(frame.step).is_multiple_of(engine.stride()) {
            engine.push(&self.fields(frame));
        }
        self.engine = Some(engine);
    }

    fn finish(&mut self, out: &mut dyn Outlet) -> Result<(), Refusal> {
        if let Some(refusal) = self.refusal.take() {
            return Err(refusal);
        }
        let interval_s = self.interval_s();
        let found =
            self.engine.take().and_then(|engine| engine.finish(interval_s, !self.chain.sites.has_springs()));
        let Some(found) = found else {
            let frames = counted(self.sampling.count(), "evenly spaced frame");
            let gaps = match self.sampling.break_count() {
                0 => String::new(),
                gaps => format!(" with {}", counted(gaps, "gap")),
            };
            return Err(format!("{frames}{gaps} hold no lag: look at a longer part of the run, choose a shorter --lag, or record more often").into());
        };
        if out.wants(0) {
            for (lag, lag_s) in found.lags_s.iter().enumerate() {
                for (place, distance) in found.distances.beads().enumerate() {
                    let fields = (0..FIELDS.len()).map(|field| found.at(lag, field, place));
                    let head = [*lag_s, distance];
                    let line = head.into_iter().chain(fields.flatten());
                    out.line(0, &line.map(|value| Number::Double(value).into()).collect::<Vec<Cell>>());
                }
            }
        }
        self.found = Some(found);
        Ok(())
    }

    fn report(&mut self) -> Option<Report> {
        let found = self.found.as_ref()?;
        let mut report = Report { title: "correlations", ..Report::default() };
        let words = &mut report.words;
        words.add("origins", found.origins);
        let longest_s = found.lags_s.last().copied().unwrap_or_default();
        words.add("lags", format_args!("{} up to {}", found.lags_s.len() - 1, quantity(longest_s, "s")));
        match found.sound {
            Some([c, error]) => words.add("sound", format_args!("{} beads/s", Uncertain::new(c, error))),
            None => words.add("sound", "no peak of the momentum moves away"),
        }
        if let Some(changes) = found.sum_changes.filter(|changes| changes.iter().all(|x| x.is_finite())) {
            let changes = changes.map(number);
            let all = FIELDS.iter().zip(&changes).map(|((name, _), change)| format!("{change} ({name})"));
            words.add("sums change by", format_args!("{} of C(0, 0)", all.collect::<Vec<_>>().join(", ")));
        }
        if found.at(0, 0, 0)[1].is_nan() {
            let origins = counted(found.origins, "origin");
            report.notices.push(format!("no errors: {origins} cannot fill {FEWEST} parts of the run"));
        }
        let names = OFFER.summary.iter().map(|meaning| meaning.name);
        report.results = names.zip(found.numbers()).map(|(name, number)| (name, json!(number))).collect();
        Some(report)
    }

    /// The three correlations over distance at some lags, and the peak of sound, scaled.
    fn figure(&mut self) -> Result<Option<Figure>, FigureError> {
        let Some(found) = &self.found else { return Ok(None) };
        let last = found.lags_s.len() - 1;
        let mut shown: Vec<usize> = (1..=4).map(|part| (last * part).div_ceil(4)).collect();
        shown.dedup();
        let origin = found.distances.origin;
        let mut figure = Figure::new().caption(plots::caption(&self.manifest));
        for (field, (name, _)) in FIELDS.iter().enumerate() {
            let one = found.at(0, field, origin)[0];
            let mut panel = Panel::new()
                .x_axis(Axis::new("distance j (beads)"))
                .y_axis(Axis::new(format!("{name} C/C(0, 0)")));
            for lag in &shown {
                let of = |place: usize| found.at(*lag, field, place);
                let places = || found.distances.beads().enumerate().map(|(place, j)| (j, of(place)));
                let band =
                    places().map(|(x, [c, error])| (x, (c - 2.0 * error) / one, (c + 2.0 * error) / one));
                let label = if field == 0 {
                    format!("t = {}", typed_quantity(found.lags_s[*lag], "s"))
                } else {
                    String::new()
                };
                panel = panel.curve(Curve::line(label, places().map(|(x, [c, _])| (x, c / one))).band(band));
            }
            figure = figure.panel(if field == 0 { panel.note("bands: two standard errors") } else { panel });
        }
        if let Some([c, error]) = found.sound {
            let one = found.at(0, 1, origin)[0];
            let label = "(ct)^{2/3}·C/C(0, 0)";
            let mut panel = Panel::new()
                .x_axis(Axis::new("(|j| − ct)/(ct)^{2/3}").limits(-4.0, 4.0))
                .y_axis(Axis::new(label));
            for lag in &shown {
                let (path, curve) = (c * found.lags_s[*lag], found.folded_momentum(*lag));
                let scale = path.powf(2.0 / 3.0);
                let points =
                    curve.iter().enumerate().map(|(j, mean)| ((j as f64 - path) / scale, mean / one * scale));
                panel = panel.line("", points.filter(|(x, _)| x.abs() <= 4.0));
            }
            figure = figure.panel(panel.note(format!("momentum, c = {} beads/s", Uncertain::new(c, error))));
        }
        Ok(Some(figure))
    }

    fn value(&self, name: &str, _: Option<&str>) -> Option<Number> {
        let place = OFFER.summary.iter().position(|meaning| meaning.name == name)?;
        self.found.as_ref().map(|found| Number::Double(found.numbers()[place]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use consumers::analysis::{LastRow, Settings};
    use producer::integrator::Integrator;
    use producer::state::ChainState;
    use schemas::config::RunConfig;
    use schemas::manifest::Origin;
    use schemas::random::normal;
    use std::f64::consts::TAU;

    /// A run of `steps` steps of 1 s of beads of 1 kg, or as `chain` says.
    fn manifest(beads: u64, chain: &str, steps: u64) -> RunManifest {
        let origin = Origin { program: "test".into(), host: "here".into(), started_unix_ns: 1 };
        let toml = format!(
            "seed = 5\n[chain]\nbeads = {beads}\nbead_mass_kg = 1.0\n{chain}\n[time]\nduration_s = {steps}\ndt_s = 1\n"
        );
        RunManifest::new(&RunConfig::from_toml(&toml).unwrap(), "run", origin).unwrap()
    }

    const RING: &str = "bonds = { linear = 0.04 }\n[ends]\nleft = \"periodic\"\nright = \"periodic\"\n[striker]\nbead = 0\nvelocity_m_s = 1\n";

    fn begun(manifest: &RunManifest, told: &[(&'static str, &str)]) -> Correlations {
        let mut settings = Settings::default();
        for (name, value) in told {
            let setting = OFFER.settings.iter().find(|setting| setting.name == *name).unwrap();
            settings.set(setting, vec![(*value).to_owned()]).unwrap();
        }
        Correlations::begin(&Beginning::whole("correlations", manifest, &settings)).unwrap()
    }

    fn push(analysis: &mut Correlations, step: u64, u_m: &[f64], v_m_s: &[f64]) {
        let frame = Frame { frame: step, step, time_s: step as f64, u_m, v_m_s, extra: &[], active: None };
        analysis.observe(&frame, &mut LastRow::default());
    }

    /// Frames without order in chains of every kind, with a gap: sums by hand.
    #[test]
    fn correlations_are_the_sums_that_define_them() {
        let ends = |left: &str, right: &str| {
            format!(
                "masses = {{ pattern_kg = [1.0, 2.5] }}\nalpha = 1.5\nstiffness = 0.001\n[ends]\nleft = \"{left}\"\nright = \"{right}\"\n[striker]\nbead = 0\nvelocity_m_s = 1\n"
            )
        };
        let chains = [ends("fixed", "fixed"), ends("free", "free"), ends("fixed", "free"), RING.to_owned()];
        for (beads, (chain, stride)) in [2, 3, 4, 5, 8, 11]
            .into_iter()
            .flat_map(|beads| chains.iter().zip([1, 2, 1, 3]).map(move |of| (beads, of)))
        {
            let is_ring = chain == RING;
            if is_ring && beads < 3 {
                continue;
            }
            let manifest = manifest(beads, chain, 299);
            let mut analysis =
                begun(&manifest, &[("lag", "12"), ("lags", "2"), ("origins", &stride.to_string())]);
            let mut all = Vec::new();
            for step in (0..300).filter(|step| !(100..130).contains(step)) {
                let of = |stream| {
                    (0..beads).map(|bead| 0.3 + normal(9, stream, step * beads + bead)).collect::<Vec<_>>()
                };
                let (u_m, v_m_s) = (of(1), of(2));
                push(&mut analysis, step, &u_m, &v_m_s);
                let frame =
                    Frame { frame: 0, step, time_s: 0.0, u_m: &u_m, v_m_s: &v_m_s, extra: &[], active: None };
                if step.is_multiple_of(stride) {
                    all.push((step, analysis.fields(&frame)));
                }
            }
            analysis.finish(&mut LastRow::default()).unwrap();
            let found = analysis.found.unwrap();
            assert_eq!(found.lags_s, [0.0, 6.0, 12.0]);
            let is_whole = |first: &&[(u64, Fields)]| first[first.len() - 1].0 - first[0].0 == 12;
            let runs: Vec<_> = all
                .windows(1 + 12 / usize::try_from(stride).unwrap())
                .filter(is_whole)
                .take(usize::try_from(found.origins).unwrap())
                .collect();
            assert!(runs.len() as u64 == found.origins && found.origins > 60, "{}", found.origins);
            for (lag, field) in
                [0, 1, 2].into_iter().flat_map(|lag| (0..FIELDS.len()).map(move |field| (lag, field)))
            {
                for (place, distance) in found.distances.beads().enumerate() {
                    let sites = runs[0][0].1[field].len();
                    let margin = if is_ring { 0 } else { usize::try_from(beads / 4).unwrap() };
                    let pairs = |run: &[(u64, Fields)]| {
                        let (late, early) =
                            (&run[run.len() - 1].1[field], &run[(run.len() - 1) * (2 - lag) / 2].1[field]);
                        let early = |i: usize| early[(i + sites + found.distances.origin - place) % sites];
                        (margin..sites - margin).map(|i| (late[i], early(i))).collect::<Vec<_>>()
                    };
                    let runs: Vec<_> = runs.iter().map(|run| pairs(run)).collect();
                    let mean = |of: &dyn Fn(usize, (f64, f64)) -> f64| {
                        let pairs = runs.iter().flat_map(|run| run.iter().copied().enumerate());
                        pairs.map(|(i, pair)| of(i, pair)).sum::<f64>() / (runs.len() * runs[0].len()) as f64
                    };
                    let at = |of: &dyn Fn((f64, f64)) -> f64| -> Vec<f64> {
                        (0..runs[0].len())
                            .map(|i| runs.iter().map(|run| of(run[i])).sum::<f64>() / runs.len() as f64)
                            .collect()
                    };
                    let (late, early) = (at(&|pair| pair.0), at(&|pair| pair.1));
                    let exact = mean(&|i, (a, b)| (a - late[i]) * (b - early[i]));
                    let found = found.at(lag, field, place)[0];
                    assert!(
                        (found - exact).abs() < 1e-11,
                        "{beads} {chain} {lag} {field} {distance}: {found} {exact}"
                    );
                }
            }
        }
    }

    /// The running waves of a harmonic ring at a temperature, to the right and to the left, each also with the other sign: means over places are exact, and
    /// `C = m·T/N·Σ cos(ω·t)·cos(q·j)` over all waves but that of the whole ring.
    #[test]
    fn the_waves_of_a_harmonic_ring_have_their_correlations() {
        let (beads, temperature_j) = (31_u64, 0.7);
        let manifest = manifest(beads, RING, 689);
        let mut analysis = begun(&manifest, &[("lag", "40"), ("lags", "8"), ("origins", "1")]);
        let waves = (1..=beads / 2).map(|wave| TAU * wave as f64 / beads as f64);
        let waves: Vec<[f64; 2]> = waves.map(|q| [q, 0.4 * (0.5 * q).sin()]).collect();
        let height = (4.0 * temperature_j / beads as f64).sqrt();
        for (part, (direction, sign)) in (0..).zip([(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)]) {
            for step in part * 172..part * 172 + 160 {
                let sum = |bead: f64, of: &dyn Fn(f64, f64) -> f64| {
                    let phase = |[q, omega]: &[f64; 2]| {
                        q * bead - direction * omega * (step - 172 * part) as f64 + 7.0 * q * q
                    };
                    sign * height * waves.iter().map(|wave| of(wave[1], phase(wave))).sum::<f64>()
                };
                let at = |of: &dyn Fn(f64, f64) -> f64| {
                    (0..beads).map(|bead| sum(bead as f64, of)).collect::<Vec<_>>()
                };
                let u_m = at(&|omega, phase| -phase.sin() / (direction * omega));
                push(&mut analysis, step, &u_m, &at(&|_, phase| phase.cos()));
            }
        }
        analysis.finish(&mut LastRow::default()).unwrap();
        let found = analysis.found.unwrap();
        // a part of the run holds 20 origins, and each of the four pieces 120
        assert_eq!(found.origins, 480);
        for (lag, t) in found.lags_s.iter().enumerate() {
            for (place, j) in found.distances.beads().enumerate() {
                let sum = |of: &dyn Fn(f64) -> f64| {
                    waves
                        .iter()
                        .map(|[q, omega]| 2.0 * of(*q) * (omega * t).cos() * (q * j).cos())
                        .sum::<f64>()
                };
                let momentum = temperature_j / beads as f64 * sum(&|_| 1.0);
                let stretch = temperature_j / 0.04 / beads as f64 * sum(&|_| 1.0);
                for (field, exact) in [(1, momentum), (0, stretch)] {
                    let found = found.at(lag, field, place)[0];
                    assert!((found - exact).abs() < 1e-11 / 0.04, "{t} {j} {field}: {found} {exact}");
                }
            }
        }
        assert!(found.sum_changes.unwrap().iter().all(|change| *change < 1e-12), "{:?}", found.sum_changes);
    }

    /// Shapes that run at a speed, without a change, and without an order of their own.
    #[test]
    fn sound_has_the_speed_of_what_runs() {
        let (beads, c) = (120_u64, 0.61);
        let manifest = manifest(beads, RING, 3999);
        let mut analysis = begun(&manifest, &[("lag", "75"), ("lags", "15")]);
        for step in 0..4000 {
            let sum = |bead: u64| {
                let of = |wave: u64| {
                    let q = TAU * wave as f64 / beads as f64;
                    let [right, left] =
                        [1, -1].map(|side| q * (bead as f64 - f64::from(side) * c * step as f64));
                    let height = (-0.02 * (wave * wave) as f64).exp();
                    height * ((right + normal(1, 1, wave)).cos() + (left + 9.0 * normal(1, 2, wave)).cos())
                };
                (1..20).map(of).sum::<f64>()
            };
            push(&mut analysis, step, &vec![0.0; 120], &(0..beads).map(sum).collect::<Vec<_>>());
        }
        analysis.finish(&mut LastRow::default()).unwrap();
        let [found, error] = analysis.found.unwrap().sound.unwrap();
        assert!((found - c).abs() < 1e-3 * c && error < 1e-3 * c, "{found} ± {error}");
    }

    /// Runs of chains with and without linear waves.
    #[test]
    fn totals_that_are_conserved_keep_their_correlations() {
        let initial = "[initial]\nthermal = { energy_j = 0.01 }\n";
        for law in ["bonds = { linear = 1.0, quadratic = 0.5, cubic = 1.0 }", "alpha = 1.5\nstiffness = 1.0"]
        {
            let load = if law.contains("alpha") { "[load]\nprecompression_n = 0.1\n" } else { "" };
            let ends = "[ends]\nleft = \"periodic\"\nright = \"periodic\"\n";
            let toml = format!(
                "seed = 5\n[chain]\nbeads = 24\nbead_mass_kg = 1.0\nmasses = {{ pattern_kg = [1.0, 2.0] }}\n{law}\n{ends}{load}{initial}[time]\nduration_s = 400\ndt_s = 0.05\n"
            );
            let origin = Origin { program: "test".into(), host: "here".into(), started_unix_ns: 1 };
            let manifest = RunManifest::new(&RunConfig::from_toml(&toml).unwrap(), "run", origin).unwrap();
            let mut analysis = begun(&manifest, &[]);
            let mut state = ChainState::initial(&manifest.physics);
            let mut integrator = Integrator::new(&manifest.physics);
            while state.step < manifest.physics.step_count {
                if state.step.is_multiple_of(5) {
                    analysis.observe(&state.as_frame(&manifest, state.step), &mut LastRow::default());
                }
                integrator.step(&mut state);
            }
            analysis.finish(&mut LastRow::default()).unwrap();
            let found = analysis.found.unwrap();
            let [stretch, momentum, energy] = found.sum_changes.unwrap();
            // the total energy is that of the run but for the error of its steps
            assert!(
                stretch < 1e-12 && momentum < 1e-12 && energy < 1e-3,
                "{stretch:e} {momentum:e} {energy:e}"
            );
            let variance = found.at(0, 1, found.distances.origin);
            assert!(variance[0] > 0.0 && variance[1] < 0.3 * variance[0], "{variance:?}");
        }
    }

    /// The speed of sound at the temperature of the run by thermodynamics (Spohn 2014), for springs of V = r²/2 + r⁴/4 that are not pressed:
    /// `c² = (T²/2 + <V;V>)/Γ` with `Γ = (<r;r>·<V;V> - <r;V>²)/T + T·<r;r>/2`. Within 50 s
    /// short waves lag behind long ones, by less than 1.5 % of the way.
    #[test]
    fn sound_in_a_chain_of_fermi_and_others_has_its_speed() {
        let toml = "seed = 5\n[chain]\nbeads = 100\nbead_mass_kg = 1.0\nbonds = { linear = 1.0, cubic = 1.0 }\n[ends]\nleft = \"periodic\"\nright = \"periodic\"\n\
            [initial]\nthermal = { energy_j = 2.0 }\n[time]\nduration_s = 6000\ndt_s = 0.02\n";
        let origin = Origin { program: "test".into(), host: "here".into(), started_unix_ns: 1 };
        let manifest = RunManifest::new(&RunConfig::from_toml(toml).unwrap(), "run", origin).unwrap();
        let mut analysis = begun(&manifest, &[]);
        let mut state = ChainState::initial(&manifest.physics);
        let mut integrator = Integrator::new(&manifest.physics);
        while state.step < manifest.physics.step_count {
            integrator.step(&mut state);
            if state.step > 10_000 && state.step.is_multiple_of(25) {
                analysis.observe(&state.as_frame(&manifest, state.step), &mut LastRow::default());
            }
        }
        analysis.finish(&mut LastRow::default()).unwrap();
        let found = analysis.found.unwrap();
        let temperature_j = found.at(0, 1, found.distances.origin)[0] / 0.99;
        let energy_j = |r: f64| 0.5 * r * r + 0.25 * r.powi(4);
        let mean = |of: &dyn Fn(f64) -> f64| {
            let points = (-4_000..=4_000)
                .map(|i| 2e-3 * f64::from(i))
                .map(|r| (of(r), (-energy_j(r) / temperature_j).exp()));
            let [sum, all] =
                points.fold([0.0; 2], |[sum, all], (of, weight)| [sum + of * weight, all + weight]);
            sum / all
        };
        // V is even, so that <r;V> = 0
        let (stretch, energy) = (mean(&|r| r * r), mean(&|r| energy_j(r).powi(2)) - mean(&energy_j).powi(2));
        let gamma = stretch * energy / temperature_j + 0.5 * temperature_j * stretch;
        let exact = ((0.5 * temperature_j * temperature_j + energy) / gamma).sqrt();
        let [c, error] = found.sound.unwrap();
        assert!(
            (c - exact).abs() < 0.015 * exact && error < 0.01 * c,
            "{c} ± {error}, {exact} at {temperature_j}"
        );
    }

    #[test]
    fn what_cannot_be_is_refused() {
        let manifest = manifest(4, RING, 99);
        let mut settings = Settings::default();
        settings.set(&OFFER.settings[1], vec!["0".to_owned()]).unwrap();
        let refused =
            Correlations::begin(&Beginning::whole("correlations", &manifest, &settings)).err().unwrap();
        assert_eq!(refused.to_string(), "lags 0: allowed for 4 beads: 1 to 32767");
        let mut analysis = begun(&manifest, &[("lag", "200")]);
        (0..100).for_each(|step| push(&mut analysis, step, &[0.0; 4], &[0.0; 4]));
        let refused = analysis.finish(&mut LastRow::default()).unwrap_err().to_string();
        assert!(refused.starts_with("100 evenly spaced frames hold no lag"), "{refused}");
    }
}

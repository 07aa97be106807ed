//! Lyapunov exponents: the rates at which small changes of a run grow.

use consumers::analysis::{
    Analysis, Beginning, Meaning, Needs, Number, Offer, Outlet, Refusal, Report, Setting, Takes,
    frame_columns,
};
use consumers::blocks::Blocks;
use consumers::series::Series;
use consumers::space_time::{Extent, Picture, singles};
use consumers::table::Column;
use consumers::uncertain::Uncertain;
use figure::{Axis, Figure, FigureError, Panel};
use producer::integrator::Integrator;
use producer::resimulation::check_kernel;
use producer::state::ChainState;
use schemas::amounts::{count, number, quantity};
use schemas::frame::Frame;
use schemas::functions::ln;
use schemas::manifest::RunManifest;
use schemas::results::ResultColumns;
use serde_json::json;

/// The analysis, before it looks at a run.
pub static OFFER: Offer = Offer {
    name: "lyapunov",
    about: "Lyapunov exponents: growth of small changes, from the exact derivative of each step",
    help: "Examples:\n  \
        beadline lyapunov --figure growth.png                attach to the only live run\n  \
        beadline lyapunov run.mcap --exponents 4 --out exponents.csv\n  \
        beadline lyapunov run.mcap --exponents all           the whole spectrum, in pairs\n\n\
        Changes of a state are carried through the very operations of the steps, which are computed again beside the frames: exponents \
        do not depend on which frames there are. They are means since the first frame, ln of the growth over the time, with |w|² = Σ \
        m·((δu/T)² + δv²) and the collision time T of the run. Errors are from the scatter of parts of the run, 32 to 63 \
        of them, or of longer ones, down to two, where these scatter more. Where growth remembers as long as the run they are too small, and runs with other seeds tell. Methods: all but gear5. \
        Exponents are in the order in which changes are made orthogonal, roughly from the largest on. They pair as λ and −λ where nothing is damped. Where contacts open, a power between 1 and 2 \
        has no slope on both sides: the growth errs by dt^1.5 at each opening.",
    settings: &[
        Setting::new(
            "exponents",
            Takes::Text("K", |text| wanted(text).map(drop)),
            "Number of exponents, roughly from the largest on, or `all` [default: 1]",
        ),
        Setting::new(
            "interval-steps",
            Takes::Whole("STEPS"),
            "Steps after which changes are made orthogonal again [default: 100]",
        ),
    ],
    columns: &[Meaning::number("exponent_NUMBER_per_s", "exponent of that number, from 1 on")],
    summary: &[
        Meaning::number("exponent_per_s", "the largest exponent"),
        Meaning::number("exponent_error_per_s", "its error, from the scatter of parts of the run"),
        Meaning::number("entropy_per_s", "sum of the exponents above zero, of those that were computed"),
        Meaning::number(
            "pairing_per_s",
            "largest sum of an exponent and its partner, without its sign, if all were computed and nothing is damped",
        ),
        Meaning::number("gali_2", "volume of two changes of length 1: it falls exponentially in chaos"),
        Meaning::number("gali_4", "the same of four changes"),
    ],
    // what is computed between two frames cannot be stopped
    needs: Needs { longest_interval_steps: Some(|_| Some(MOST_STEPS)), ..Needs::FRAMES },
    begin: |beginning| Ok(Box::new(Lyapunov::begin(beginning)?)),
    ..Offer::PLAIN
};

/// Steps between two looks for orthogonal changes, unless told.
const INTERVAL_STEPS: u64 = 100;
/// Steps that are made together, with one look at the chain. A live run goes on meanwhile, as far as its queue of frames goes.
const TOGETHER: u64 = 12;
/// Most steps between frames; of recordings with fewer frames those between are made again first.
const MOST_STEPS: u64 = 10_000;
/// Part of a change that has to be left beside those before it: 1e-4 of what is left is rounding.
const LEFT: f64 = 1e-12;
/// Most curves of a figure.
const MOST_CURVES: usize = 8;

/// The number of exponents; none for `all`.
fn wanted(text: &str) -> Result<Option<usize>, String> {
    match text.parse() {
        Ok(count) if count > 0 => Ok(Some(count)),
        _ if text == "all" => Ok(None),
        _ => Err("expected a whole number from 1 on, or `all`".to_owned()),
    }
}

struct Lyapunov {
    manifest: RunManifest,
    integrator: Integrator,
    weights: Vec<f64>,
    count: usize,
    has_all: bool,
    every: u64,
    /// The state that the changes belong to, and the step at which they began.
    state: Option<ChainState>,
    first: u64,
    growth: Growth,
    alignment: Alignment,
    /// Kept for a figure alone.
    drawn: Option<Drawn>,
}

/// Contents of a figure.
struct Drawn {
    exponents: Vec<Series<1>>,
    /// Alignment of two and of four changes.
    alignments: Vec<Series<1>>,
    /// The part of each bead in the first change.
    map: Picture<f32>,
}

/// Directions of changes that are not made orthogonal, by those that are: columns of length 1, as far as their own number.
struct Alignment(Vec<Vec<f64>>);

impl Alignment {
    /// Numbers of changes whose alignment is told.
    const TOLD: [usize; 2] = [2, 4];

    fn of(count: usize) -> Self {
        Self((0..count.min(Self::TOLD[1])).map(|number| [vec![0.0; number], vec![1.0]].concat()).collect())
    }

    /// Goes over an interval, in which changes along the orthogonal ones came to `parts`.
    fn add(&mut self, parts: &[Vec<f64>]) {
        for column in &mut self.0 {
            let along =
                |to: usize| (to..column.len()).map(|from| parts[from][to] * column[from]).sum::<f64>();
            let moved: Vec<f64> = (0..column.len()).map(along).collect();
            let length = moved.iter().map(|x| x * x).sum::<f64>().sqrt();
            *column = moved.into_iter().map(|x| x / length).collect();
        }
    }

    /// The volume that the first `count` directions span, if there are so many.
    fn of_first(&self, count: usize) -> Option<f64> {
        let columns = self.0.get(..count)?;
        Some(columns.iter().filter_map(|column| column.last()).product::<f64>().abs())
    }
}

/// Logarithms of the growth of each change.
struct Growth {
    /// Their sums over all intervals.
    sums: Vec<f64>,
    /// The same over parts of the run.
    parts: Blocks,
}

impl Growth {
    fn of(count: usize) -> Self {
        Self { sums: vec![0.0; count], parts: Blocks::new(count) }
    }

    /// Adds those of an interval.
    fn add(&mut self, logarithms: &[f64]) {
        self.sums.iter_mut().zip(logarithms).for_each(|(sum, more)| *sum += more);
        self.parts.push(logarithms.iter().copied());
    }

    /// Number of intervals.
    fn intervals(&self) -> u64 {
        self.parts.frames()
    }

    /// The exponents (1/s), with intervals of `interval_s`; NaN before the first one has passed.
    fn exponents_per_s(&self, interval_s: f64) -> Vec<f64> {
        self.sums.iter().map(|sum| sum / (self.intervals() as f64 * interval_s)).collect()
    }

    /// The error (1/s) of an exponent, if there are enough parts.
    fn error_per_s(&self, number: usize, interval_s: f64) -> Option<f64> {
        let error = self.parts.estimate(number).error / interval_s;
        (!error.is_nan()).then_some(error)
    }
}

impl Lyapunov {
    fn begin(beginning: &Beginning<'_>) -> Result<Self, Refusal> {
        let (manifest, settings) = (beginning.manifest.clone(), beginning.settings);
        let physics = &manifest.physics;
        check_kernel(&manifest).map_err(|error| error.to_string())?;
        let refuse = |error: producer::tangents::NoTangent| Refusal::from(error.to_string());
        let mut integrator = Integrator::with_tangents(physics, 0).map_err(refuse)?;
        let free = integrator.tangents().map(|tangents| tangents.free()).unwrap_or_default();
        let most = free.iter().filter(|free| **free).count();
        let text = settings.one::<String>("exponents").unwrap_or_else(|| "1".to_owned());
        let count = wanted(&text)?.unwrap_or(most);
        if count > most {
            let why = format!("the chain has {most} exponents; ask for 1 to {most}, or for `all`");
            return Err(Refusal::of("exponents", text, why));
        }
        let every = settings.one("interval-steps").unwrap_or(INTERVAL_STEPS);
        if every == 0 {
            return Err(Refusal::of("interval-steps", "0", "expected a whole number from 1 on"));
        }
        let mut weights = Vec::new();
        if let Some(tangents) = integrator.tangents() {
            tangents.resize(count);
            weights = tangents.weights(physics.scales().time_s);
        }
        let extent = || Extent { places: 0..physics.chain().bead_count(), steps: 0..=physics.step_count };
        let told = Alignment::TOLD.iter().filter(|told| **told <= count).count();
        let drawn = beginning.is_drawn.then(|| Drawn {
            exponents: vec![Series::default(); count.min(MOST_CURVES)],
            alignments: vec![Series::default(); told],
            map: Picture::new(extent()),
        });
        Ok(Self {
            growth: Growth::of(count),
            alignment: Alignment::of(count),
            has_all: count == most,
            state: None,
            first: 0,
            manifest,
            integrator,
            weights,
            count,
            every,
            drawn,
        })
    }

    fn interval_s(&self) -> f64 {
        self.every as f64 * self.manifest.physics.dt_s
    }

    fn exponents_per_s(&self) -> Vec<f64> {
        self.growth.exponents_per_s(self.interval_s())
    }

    /// Carries the changes some steps at a time towards the step of `frame`: no moment but the end of an interval tells anything.
    fn go_to(&mut self, frame: &Frame<'_>) {
        let Some(mut state) = self.state.take() else {
            if let Some(tangents) = self.integrator.tangents() {
                tangents.spread(&self.weights);
            }
            (self.state, self.first) = (Some(ChainState::of_frame(frame)), frame.step);
            return;
        };
        loop {
            let end = state.step - (state.step - self.first) % self.every + self.every;
            let together = end.min(state.step + TOGETHER); // integers
            if together > frame.step {
                break;
            }
            while state.step < together {
                self.integrator.advance(&mut state, together);
            }
            if state.step < end {
                continue;
            }
            let Some(tangents) = self.integrator.tangents() else { break };
            if let Some(drawn) = &mut self.drawn {
                let shares = shares(&tangents.tangent(0), &self.weights, state.u_m.len());
                drawn.map.push(state.step, singles(shares));
            }
            let mut parts = tangents.orthonormalise(&self.weights);
            let is_left = |parts: &Vec<f64>| {
                let whole = parts.iter().map(|part| part * part).sum::<f64>().sqrt();
                parts.last().is_some_and(|norm| *norm > LEFT * whole)
            };
            let left = parts.iter().take_while(|parts| is_left(parts)).count();
            parts[left..].iter_mut().flatten().for_each(|part| *part = f64::NAN);
            let norms = parts.iter().filter_map(|parts| parts.last());
            let logarithms: Vec<f64> =
                norms.map(|norm| if norm.is_nan() { *norm } else { ln(*norm) }).collect();
            self.growth.add(&logarithms);
            self.alignment.add(&parts);
            self.draw(state.step);
        }
        self.state = Some(state);
    }

    /// Adds the numbers at `step` to the figure.
    fn draw(&mut self, step: u64) {
        let (exponents, time_s) = (self.exponents_per_s(), self.manifest.physics.time_s(step));
        let Some(drawn) = &mut self.drawn else { return };
        for (curve, exponent) in drawn.exponents.iter_mut().zip(exponents) {
            curve.push(time_s, [exponent]);
        }
        for (curve, told) in drawn.alignments.iter_mut().zip(Alignment::TOLD) {
            curve.push(time_s, [self.alignment.of_first(told).unwrap_or(0.0)]);
        }
    }

    /// The sum of the exponents (1/s) above zero; NaN if one is lost.
    fn entropy_per_s(&self) -> f64 {
        let exponents = self.exponents_per_s();
        exponents.iter().fold(0.0, |sum, exponent| sum + if *exponent < 0.0 { 0.0 } else { *exponent })
    }

    /// The largest sum (1/s) of an exponent and its partner.
    fn pairing_per_s(&self) -> Option<f64> {
        let exponents = self.exponents_per_s();
        let pairs = exponents.iter().zip(exponents.iter().rev()).map(|(one, other)| (one + other).abs());
        let physics = &self.manifest.physics;
        let is_conserved = physics.is_without_loss() && physics.baths.is_empty();
        (self.has_all && is_conserved && self.lost().is_none()).then(|| pairs.fold(0.0, f64::max))
    }

    /// The first exponent, from 0 on, that is lost in rounding.
    fn lost(&self) -> Option<usize> {
        self.exponents_per_s().iter().position(|exponent| exponent.is_nan())
    }
}

impl Analysis for Lyapunov {
    fn columns(&self, _: usize) -> Vec<Column> {
        frame_columns((1..=self.count).map(|number| format!("exponent_{number}_per_s")))
    }

    fn published(&self) -> Option<ResultColumns> {
        Some(ResultColumns::array("exponents_per_s", self.count))
    }

    fn observe(&mut self, frame: &Frame<'_>, out: &mut dyn Outlet) {
        self.go_to(frame);
        out.row(frame, &self.exponents_per_s());
    }

    fn report(&mut self) -> Option<Report> {
        let mut report = Report { title: "Lyapunov exponents", ..Report::default() };
        if self.growth.intervals() == 0 {
            let why = format!(
                "no exponent: fewer than {} steps were looked at; choose a shorter --interval-steps",
                count(self.every)
            );
            report.notices.push(why);
            report.results = json!({ "exponents_per_s": [] });
            return Some(report);
        }
        if self.integrator.tangents().is_some_and(|tangents| tangents.has_jumped()) {
            let why = "a damped contact closes or opens, where its force jumps or has a slope without bound: exponents are not those of the motion";
            report.notices.push(why.to_owned());
        }
        let (interval_s, exponents) = (self.interval_s(), self.exponents_per_s());
        let lost = self.lost().unwrap_or(self.count);
        if lost < self.count {
            report.notices.push(format!(
                "exponents from {} on are lost in rounding: choose a shorter --interval-steps",
                lost + 1
            ));
        }
        let errors: Vec<_> =
            (0..self.count).map(|place| self.growth.error_per_s(place, interval_s)).collect();
        let over_s = self.growth.intervals() as f64 * interval_s;
        report.words.add("over", quantity(over_s, "s"));
        let kept = exponents.iter().zip(&errors).take(lost.min(MOST_CURVES));
        for (place, (exponent, error)) in kept.enumerate() {
            let shown = match error {
                Some(error) => format!("{} 1/s", Uncertain::new(*exponent, *error)),
                None => format!("{} 1/s", number(*exponent)),
            };
            report.words.add(format!("exponent {}", place + 1), shown);
        }
        for told in Alignment::TOLD {
            if let Some(volume) = self.alignment.of_first(told).filter(|_| told <= lost) {
                report.words.add(format!("GALI_{told}"), number(volume));
            }
        }
        if lost == self.count {
            report.words.add("entropy", format_args!("{} 1/s", number(self.entropy_per_s())));
        }
        if let Some(pairing_per_s) = self.pairing_per_s() {
            report.words.add("pairs add up to", format_args!("{} 1/s", number(pairing_per_s)));
        }
        report.results = json!({
            "over_s": over_s,
            "interval_steps": self.every,
            "exponents_per_s": exponents,
            "errors_per_s": errors,
            "entropy_per_s": self.entropy_per_s(),
            "pairing_per_s": self.pairing_per_s(),
            "gali_2": self.alignment.of_first(2),
            "gali_4": self.alignment.of_first(4),
        });
        Some(report)
    }

    fn figure(&mut self) -> Result<Option<Figure>, FigureError> {
        let Some(Drawn { exponents: curves, alignments, map }) = self.drawn.take() else { return Ok(None) };
        let axis = Axis::new("time (ms)").log();
        let mut panel = Panel::new().x_axis(axis).y_axis(Axis::new("exponent (1/s)")).horizontal("", 0.0);
        for (number, curve) in curves.iter().enumerate() {
            let points = curve.curve(0).map(|(t, value)| (t * 1e3, value)).filter(|(t, _)| *t > 0.0);
            panel = panel.line(format!("λ_{{{}}}", number + 1), points.collect::<Vec<_>>());
        }
        let mut figure = Figure::new().caption(plots::caption(&self.manifest)).panel(panel);
        if !alignments.is_empty() {
            let axis = Axis::new("time (ms)").log();
            let mut panel = Panel::new().x_axis(axis).y_axis(Axis::new("alignment").log());
            for (told, curve) in Alignment::TOLD.iter().zip(&alignments) {
                let points = curve.curve(0).map(|(t, value)| (t * 1e3, value));
                let points = points.filter(|(t, value)| *t > 0.0 && *value > 0.0);
                panel = panel.line(format!("GALI_{{{told}}}"), points.collect::<Vec<_>>());
            }
            figure = figure.panel(panel);
        }
        Ok(Some(figure.panel(plots::share_map(&self.manifest, "|w_{bead}|/|w|", &map)?)))
    }

    fn value(&self, name: &str, _: Option<&str>) -> Option<Number> {
        if self.growth.intervals() == 0 {
            return None;
        }
        Some(Number::Double(match name {
            "exponent_per_s" => *self.exponents_per_s().first()?,
            "exponent_error_per_s" => self.growth.error_per_s(0, self.interval_s())?,
            "entropy_per_s" => self.entropy_per_s(),
            "pairing_per_s" => self.pairing_per_s()?,
            "gali_2" => self.alignment.of_first(2)?,
            "gali_4" => self.alignment.of_first(4)?,
            _ => return None,
        }))
    }
}

/// The part of each bead in a change, over its norm: √ of its terms.
fn shares(change: &[f64], weights: &[f64], beads: usize) -> Vec<f64> {
    let mut squares = vec![0.0; beads];
    for (place, (x, weight)) in change.iter().zip(weights).enumerate() {
        squares[place % beads] += weight * (x * x);
    }
    let all: f64 = squares.iter().sum();
    squares.into_iter().map(|square| (square / all).sqrt()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use schemas::random::normal;

    #[test]
    fn parts_keep_all_intervals() {
        let mut growth = Growth::of(2);
        for interval in 0..1000 {
            growth.add(&[1.0, f64::from(interval % 2)]);
        }
        assert_eq!(growth.exponents_per_s(0.5), [2.0, 1.0]);
        // 62 whole parts of 16 intervals, with as many of each
        assert_eq!(growth.parts.means().collect::<Vec<_>>(), vec![[1.0, 0.5]; 62]);
        assert_eq!(growth.error_per_s(1, 0.5), Some(0.0));
        assert!(Growth::of(1).exponents_per_s(1.0)[0].is_nan());
    }

    /// x ← 0.98·x + ξ remembers 50 intervals, about a part of 64: with the scatter of these alone, the mean is off by 1.6 errors.
    #[test]
    fn errors_allow_for_growth_that_remembers_longer_than_a_part() {
        let (seeds, mut squares) = (300_u32, 0.0);
        for seed in 0..seeds {
            let (mut growth, mut x) = (Growth::of(1), 0.0);
            for interval in 0..3_300 {
                x = 0.98 * x + normal(seed.into(), 1, interval);
                if interval >= 300 {
                    growth.add(&[x]);
                }
            }
            squares += (growth.exponents_per_s(1.0)[0] / growth.error_per_s(0, 1.0).unwrap()).powi(2);
        }
        let off = (squares / f64::from(seeds)).sqrt();
        assert!((1.0..1.35).contains(&off), "{off}");
    }

    /// Changes that grow as the time, as those of a free chain that is pushed, have the exponent 0 within some errors.
    #[test]
    fn growth_by_a_power_of_the_time_is_no_chaos() {
        for (length, intervals) in [(20.0, 33), (50.0, 63), (100.0, 600), (1000.0, 4_000)] {
            let mut growth = Growth::of(1);
            let grown = |interval: u32| ln(1.0 + length * f64::from(interval) / f64::from(intervals));
            (0..intervals).for_each(|interval| growth.add(&[grown(interval + 1) - grown(interval)]));
            let (exponent, error) = (growth.exponents_per_s(1.0)[0], growth.error_per_s(0, 1.0).unwrap());
            assert!(exponent < 2.6 * error, "{length}: {exponent} {error}");
        }
    }
}

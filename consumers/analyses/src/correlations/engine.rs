//! Sums over pairs of frames, from frames as they come, in memory that does not grow with the run.

use consumers::blocks::FEWEST;
use consumers::power_law::LineSums;
use consumers::statistics::Statistics;
use std::collections::VecDeque;
use std::iter::zip;
use std::ops::Range;
use waves::correlation::{Complex, Correlator};

/// The fields, and the units of their correlations in the names of columns.
pub(super) const FIELDS: [(&str, &str); 3] = [("stretch", "m2"), ("momentum", "kg2_m2_s2"), ("energy", "j2")];
const MOMENTUM: usize = 1;

/// A value of each field at each place.
pub(super) type Fields = [Vec<f64>; FIELDS.len()];

/// Lags and origins.
#[derive(Debug)]
pub(super) struct Plan {
    /// Lags, rising from 0, in origins.
    pub(super) lags: Vec<usize>,
    /// Samples from an origin to the next one.
    pub(super) stride: u64,
    /// Origins of a part of the run.
    pub(super) part: u64,
}

/// Distances from `−origin` on: that at the place p is `p − origin` beads.
#[derive(Debug, Clone, Copy)]
pub(super) struct Distances {
    pub(super) origin: usize,
    pub(super) count: usize,
}

impl Distances {
    /// The distances (beads).
    pub(super) fn beads(self) -> impl Iterator<Item = f64> {
        (0..self.count).map(move |place| place as f64 - self.origin as f64)
    }
}

/// Sums over pairs of frames, the later of which is cut to the places that count: of products of their transforms and of the transforms.
#[derive(Debug)]
struct Sums {
    /// A spectrum for each lag and field.
    products: Vec<Complex<f64>>,
    early: Vec<Complex<f64>>,
    /// A spectrum for each field.
    late: Vec<Complex<f64>>,
}

/// Means over the pairs of a part of the run: of products, of each lag, field and distance; of transforms of each field.
#[derive(Debug)]
struct Part {
    products: Vec<f64>,
    early: Vec<Complex<f64>>,
    late: Vec<Complex<f64>>,
}

/// Takes the frames of origins.
pub(super) struct Engine {
    beads: usize,
    is_ring: bool,
    plan: Plan,
    distances: Distances,
    correlator: Correlator,
    /// Transforms of the fields in the last frames, as many as the longest lag has.
    past: VecDeque<[Vec<Complex<f64>>; FIELDS.len()]>,
    sums: Sums,
    in_part: u64,
    /// Origins of all parts.
    origins: u64,
    /// Sums over all parts that are full, of transforms alone.
    all: [Vec<Complex<f64>>; 2],
    parts: Vec<Part>,
}

impl Engine {
    pub(super) fn new(beads: usize, is_ring: bool, plan: Plan) -> Self {
        let [origin, after] = if is_ring { [(beads - 1) / 2, beads / 2] } else { [beads / 4; 2] };
        let rows = plan.lags.len() * FIELDS.len();
        let zeros = |rows: usize| vec![Complex::new(0.0, 0.0); rows * (beads / 2 + 1)];
        let sums = Sums { products: zeros(rows), early: zeros(rows), late: zeros(FIELDS.len()) };
        Self {
            distances: Distances { origin, count: origin + 1 + after },
            all: [sums.early.clone(), sums.late.clone()],
            correlator: Correlator::new(beads),
            past: VecDeque::new(),
            parts: Vec::new(),
            in_part: 0,
            origins: 0,
            sums,
            beads,
            is_ring,
            plan,
        }
    }

    /// Samples from an origin to the next one.
    pub(super) fn stride(&self) -> u64 {
        self.plan.stride
    }

    /// Frames are missing before the next one.
    pub(super) fn restart(&mut self) {
        self.past.clear();
    }

    /// The places of a field at which the later frame of a pair counts.
    fn places(&self, field: usize) -> Range<usize> {
        let missing = usize::from(field == 0 && !self.is_ring);
        let margin = if self.is_ring { 0 } else { self.beads / 4 };
        margin..self.beads - missing - margin
    }

    /// Adds the frame of an origin.
    pub(super) fn push(&mut self, fields: &Fields) {
        self.past.push_back(fields.each_ref().map(|field| self.correlator.transform(field.iter().copied())));
        let longest = self.plan.lags.last().copied().unwrap_or_default();
        if self.past.len() <= longest {
            return;
        }
        let bins = self.beads / 2 + 1;
        for (field, values) in fields.iter().enumerate() {
            let places = self.places(field);
            let cut =
                values.iter().enumerate().map(|(at, value)| if places.contains(&at) { *value } else { 0.0 });
            let late = self.correlator.transform(cut);
            zip(&mut self.sums.late[field * bins..], &late).for_each(|(sum, late)| *sum += late);
            for (row, lag) in self.plan.lags.iter().enumerate() {
                let row = (row * FIELDS.len() + field) * bins;
                let sums = zip(&mut self.sums.products[row..], &mut self.sums.early[row..]);
                for ((product, sum), (late, early)) in zip(sums, zip(&late, &self.past[longest - lag][field]))
                {
                    *product += late * early.conj();
                    *sum += early;
                }
            }
        }
        self.past.pop_front();
        self.in_part += 1;
        if self.in_part == self.plan.part {
            self.end_part();
        }
    }

    fn end_part(&mut self) {
        self.origins += self.in_part;
        let count = std::mem::take(&mut self.in_part) as f64;
        let mean = |sums: &[Complex<f64>]| sums.iter().map(|sum| sum / count).collect::<Vec<_>>();
        let [products, early, late] =
            [&self.sums.products, &self.sums.early, &self.sums.late].map(|sums| mean(sums));
        let (early, products) = (early[..late.len()].to_vec(), self.means(products));
        self.parts.push(Part { products, early, late });
        for (all, sums) in zip(&mut self.all, [&self.sums.early, &self.sums.late]) {
            zip(all, sums).for_each(|(all, sum)| *all += sum);
        }
        for sums in [&mut self.sums.products, &mut self.sums.early, &mut self.sums.late] {
            sums.fill(Complex::new(0.0, 0.0));
        }
    }

    /// Means over places of products, for each row and distance, from their transforms.
    fn means(&mut self, mut products: Vec<Complex<f64>>) -> Vec<f64> {
        let mut found = Vec::with_capacity(products.len());
        for (row, products) in products.chunks_exact_mut(self.beads / 2 + 1).enumerate() {
            let count = self.places(row % FIELDS.len()).len() as f64;
            let all = self.correlator.correlation(products);
            let Distances { origin, count: places } = self.distances;
            found.extend((0..places).map(|place| all[(self.beads + place - origin) % self.beads] / count));
        }
        found
    }

    /// The correlations, if there is a part; with the speed of sound if something carries momentum along.
    pub(super) fn finish(mut self, interval_s: f64, has_sound: bool) -> Option<Found> {
        if self.parts.is_empty() && self.in_part > 0 {
            self.end_part();
        }
        if self.parts.is_empty() {
            return None;
        }
        let (count, origins) = (self.parts.len() as f64, self.origins);
        let [early, late] =
            self.all.each_ref().map(|sums| sums.iter().map(|sum| sum / origins as f64).collect::<Vec<_>>());
        let of_means =
            self.means(zip(&early, late.iter().cycle()).map(|(early, late)| late * early.conj()).collect());
        let mut parts = std::mem::take(&mut self.parts);
        let of_all = |index: usize| parts.iter().map(|part| part.products[index]).sum::<f64>() / count;
        let means: Vec<f64> =
            of_means.iter().enumerate().map(|(index, of_means)| of_all(index) - of_means).collect();
        // a part's fluctuations about the means of all, to first order
        for part in &mut parts {
            let sides = zip(zip(&early, &late), zip(&part.early, &part.late));
            let changes = sides.map(|((early, late), (of_part, later))| {
                (later - late) * early.conj() + late * of_part.conj()
            });
            let changes = self.means(changes.collect());
            zip(&mut part.products, changes.iter().cycle()).for_each(|(product, change)| *product -= change);
        }
        let error = |index: usize| {
            let found = Statistics::of(parts.iter().map(|part| part.products[index]))
                .filter(|_| parts.len() >= FEWEST);
            found.and_then(|found| found.standard_error).unwrap_or(f64::NAN)
        };
        let step_s = self.plan.stride as f64 * interval_s;
        let mut found = Found {
            lags_s: self.plan.lags.iter().map(|lag| *lag as f64 * step_s).collect(),
            correlations: means.iter().enumerate().map(|(index, mean)| [*mean, error(index)]).collect(),
            distances: self.distances,
            origins,
            sound: None,
            sum_changes: None,
        };
        found.sum_changes = self.is_ring.then(|| found.sum_changes());
        found.sound = has_sound.then(|| found.sound(&parts)).flatten();
        Some(found)
    }
}

/// Correlations with standard errors.
#[derive(Debug)]
pub(super) struct Found {
    pub(super) lags_s: Vec<f64>,
    pub(super) distances: Distances,
    /// A correlation for each lag, field and distance, with its error.
    correlations: Vec<[f64; 2]>,
    pub(super) origins: u64,
    /// Speed of sound (beads/s) and its standard error.
    pub(super) sound: Option<[f64; 2]>,
    /// Largest change of the sum over distances of each field, over its variance.
    pub(super) sum_changes: Option<[f64; FIELDS.len()]>,
}

impl Found {
    fn index(&self, lag: usize, field: usize, place: usize) -> usize {
        (lag * FIELDS.len() + field) * self.distances.count + place
    }

    /// The correlation of a field at a lag and its error, by the place of the distance.
    pub(super) fn at(&self, lag: usize, field: usize, place: usize) -> [f64; 2] {
        self.correlations[self.index(lag, field, place)]
    }

    /// The numbers of the summary.
    pub(super) fn numbers(&self) -> [f64; 5] {
        let [c, error] = self.sound.unwrap_or([f64::NAN; 2]);
        let [stretch, momentum, energy] = self.sum_changes.unwrap_or([f64::NAN; 3]);
        [c, error, stretch, momentum, energy]
    }

    fn sum_changes(&self) -> [f64; FIELDS.len()] {
        std::array::from_fn(|field| {
            let sum = |lag| (0..self.distances.count).map(|place| self.at(lag, field, place)[0]).sum::<f64>();
            let first = sum(0);
            let most = (0..self.lags_s.len()).fold(0.0_f64, |most, lag| most.max((sum(lag) - first).abs()));
            most / self.at(0, field, self.distances.origin)[0]
        })
    }

    /// Means over both directions, from the distance 0 on, of `values` at the places of distances.
    fn folded(&self, values: impl Fn(usize) -> f64) -> Vec<f64> {
        let origin = self.distances.origin;
        (0..=origin).map(|distance| 0.5 * (values(origin + distance) + values(origin - distance))).collect()
    }

    /// The correlation of the momentum at a lag, over the distance from 0 on.
    pub(super) fn folded_momentum(&self, lag: usize) -> Vec<f64> {
        self.folded(|place| self.at(lag, MOMENTUM, place)[0])
    }

    /// The speed of sound, from the peak of the momentum at the lags at which it stands apart and goes on. Its error is from leaving out one part after
    /// the other.
    fn sound(&self, parts: &[Part]) -> Option<[f64; 2]> {
        let mut places: Vec<(usize, f64)> = Vec::new();
        for lag in 1..self.lags_s.len() {
            let curve = self.folded_momentum(lag);
            let error = self.folded(|place| self.at(lag, MOMENTUM, place)[1]);
            match peak(&curve).filter(|(at, _)| error[*at].is_nan() || curve[*at] > 4.0 * error[*at]) {
                Some((_, place)) if places.last().is_none_or(|(_, before)| place > *before) => {
                    places.push((lag, place));
                }
                Some(_) => break,
                None => (),
            }
        }
        let speed = |places: &[(usize, f64)]| {
            let mut line = LineSums::default();
            for (lag, place) in places {
                line.add((self.lags_s[*lag], *place), 1.0);
            }
            line.line().map(|[slope, _]| slope)
        };
        let c = speed(&places)?;
        let count = parts.len() as f64;
        let others = parts.iter().filter_map(|part| {
            let moved = places.iter().filter_map(|(lag, _)| {
                let without = |place: usize| {
                    let index = self.index(*lag, MOMENTUM, place);
                    let [mean, _] = self.correlations[index];
                    mean + (mean - part.products[index]) / (count - 1.0)
                };
                Some((*lag, peak(&self.folded(without))?.1))
            });
            speed(&moved.collect::<Vec<_>>())
        });
        let others: Vec<f64> = others.collect();
        let left = others.len() as f64 - 1.0;
        let error = Statistics::of(others).and_then(|found| found.standard_error).unwrap_or(f64::NAN);
        Some([c, left * error])
    }
}

/// The highest value of a curve and the middle of what is above half of it, if that reaches neither end.
fn peak(curve: &[f64]) -> Option<(usize, f64)> {
    let at = (0..curve.len()).max_by(|a, b| curve[*a].total_cmp(&curve[*b]))?;
    let half = 0.5 * curve[at];
    let below = |value: &f64| *value <= half;
    let from = curve[..at].iter().rposition(below)? + 1;
    let to = at + curve[at..].iter().position(below)?;
    let [mass, moment] = (from..to).fold([0.0; 2], |[mass, moment], place| {
        let above = curve[place] - half;
        [mass + above, moment + above * place as f64]
    });
    (half > 0.0).then(|| (at, moment / mass))
}

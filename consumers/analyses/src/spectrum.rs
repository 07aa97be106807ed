//! Frequencies of waves: spectra at places, transmission, the map over frequency and wavenumber.

mod found;

use crate::places::{ALLOWED, TAKES_PAIR, TAKES_PLACE, pairs, places};
use consumers::analysis::{
    Allowed, Analysis, Beginning, Meaning, Number, Offer, Outlet, Refusal, Report, Setting, TableFlag, Takes,
    Whereabouts,
};
use consumers::table::Column;
use figure::{Figure, FigureError};
use found::{Found, Kind};
use schemas::amounts::{counted, quantity};
use schemas::beads::Beads;
use schemas::chain::Chain;
use schemas::frame::Frame;
use schemas::manifest::RunManifest;
use std::ops::Range;
use waves::dispersion::{Band, UnitCell};
use waves::linear::LinearChain;
use waves::place::{Place, Quantity};
use waves::sampling::{Sampling, Take, segment_length};
use waves::segments::{Segments, Window};
use waves::spectrogram::Spectrogram;
use waves::wave_map::WaveMap;
use waves::welch::Welch;

/// The analysis, before it looks at a run.
pub static OFFER: Offer = Offer {
    name: "spectrum",
    about: "Frequencies of waves: spectra at places, transmission, the map over frequency and wavenumber",
    help: "Examples:\n  \
        beadline spectrum run.mcap --at bead:20 --at bead:100 --figure psd.png\n  \
        beadline spectrum --at wall:right --of force --out f.csv   attach to the only live run\n  \
        beadline spectrum run.mcap --transmission bead:10,bead:90 --window none --figure t.svg\n  \
        beadline spectrum run.mcap --at bead:50 --spectrogram --figure s.png\n  \
        beadline spectrum run.mcap --map --figure map.png      all of the chain over ω and q\n  \
        beadline spectrum sparse.mcap --at bead:50 --every-step\n\n\
        Densities are one-sided, by Welch's method: means over segments that overlap by half, less their mean, under a \
        Hann window (by 7/8 in the spectrogram). Their integral over frequency is the mean square of the rest. Samples are those of frames; the sampling \
        frequency is told, and a warning where the recording is too sparse for it. Transmission is the estimate \
        H1 = S_ab/S_aa, with its phase, and its coherence if there are several segments: a figure has |H1| where that is above chance, and of one \
        segment up to the top of the band; a pulse that passes both places \
        wants --window none, motion that lasts wants segments much longer than the way between them. The map has q in rad per bead, above 0 for waves to the right; the \
        dispersion relation of a chain that is linear about its equilibrium is drawn over it. --out and --figure are of \
        what was asked for: spectra, the spectrogram or the map, which is no finer in the table than in the figure.",
    settings: &[
        Setting::new("at", TAKES_PLACE, "A place, repeatable: bead:20, contact:7, wall:left, wall:right")
            .repeatable()
            .required_unless(&["transmission", "map"]),
        Setting::new(
            "of",
            Takes::Word(&[
                ("velocity", "Velocity of a bead, or the rate at which an overlap grows"),
                ("force", "Force of a contact or wall; at a bead the mean of those on its two sides"),
                ("displacement", "Displacement of a bead, or the overlap of a contact"),
            ]),
            "The quantity",
        ),
        Setting::new("transmission", TAKES_PAIR, "Two places: how the second follows the first, repeatable")
            .repeatable()
            .excluding(&["spectrogram", "map"]),
        Setting::new("spectrogram", Takes::Nothing, "The spectrum of one place over time")
            .excluding(&["map"]),
        Setting::new(
            "map",
            Takes::Nothing,
            "The velocity (or displacement) of all beads over frequency and wavenumber",
        )
        .excluding(&["at"]),
        Setting::new(
            "beads",
            Takes::Text("A..B", |text| text.parse::<Beads>().map(drop)),
            "Only these beads in the map",
        )
        .belonging_to("map"),
        Setting::new(
            "segment",
            Takes::Text("SAMPLES", |text| samples_of_segment(text).map(drop)),
            "Samples in a segment, even: more of them resolve more, fewer of them average more [default: so that 4 fill the \
             run (overlapping by half), 12 for the spectrogram, 2 for the map, as far as memory allows]",
        ),
        Setting::new(
            "window",
            Takes::Word(&[
                ("hann", "Hann: for motion that lasts"),
                ("none", "None, and one segment for all: for a pulse that has come and gone at the end"),
            ]),
            "Weights of the samples of a segment",
        )
        .excluding(&["spectrogram", "map"]),
        Setting::new(
            "max-frequency",
            Takes::number("hz", Allowed::AboveZero),
            "Highest frequency (Hz) of figures, and of tables over two axes [default: where nothing is above]",
        ),
    ],
    tables: &[TableFlag { name: "out", help: "Table of what was asked for" }],
    summary: &[
        Meaning::number("peak_hz", "frequency of the largest density of the velocity"),
        Meaning::number("peak_density", "that density"),
        Meaning::number("mean_square", "mean square of the velocity, less its mean"),
    ],
    place: Whereabouts::Of { setting: "at", also: &[], allowed: ALLOWED },
    begin: |beginning| Ok(Box::new(SpectrumAnalysis::begin(beginning)?)),
    ..Offer::PLAIN
};

fn samples_of_segment(text: &str) -> Result<usize, String> {
    let is_allowed = |samples: &usize| (16..=1 << 20).contains(samples) && samples.is_multiple_of(2);
    let samples = text.parse().ok().filter(is_allowed);
    samples.ok_or_else(|| "expected an even number of samples from 16 to 1048576".to_owned())
}

/// Places and quantities that are asked for.
struct Asked {
    quantity: Quantity,
    /// Each place once.
    places: Vec<Place>,
    /// Pairs of them, by their index.
    pairs: Vec<(usize, usize)>,
    /// The beads of a map.
    beads: Range<usize>,
    kind: Kind,
    /// Samples in a segment, if that is given.
    segment: Option<usize>,
    window: Window,
    /// Highest frequency of figures (Hz), if that is given.
    max_hz: Option<f64>,
}

/// Sums of samples. They begin when the number of samples to come is known.
enum Engine {
    Spectra(Welch),
    Spectrogram(Spectrogram),
    Map(Box<WaveMap>),
}

impl Asked {
    fn of(beginning: &Beginning<'_>, chain: &Chain) -> Result<Self, Refusal> {
        let settings = beginning.settings;
        let kind = if settings.is_set("map") {
            Kind::Map
        } else if settings.is_set("spectrogram") {
            Kind::Spectrogram
        } else {
            Kind::Spectra
        };
        let mut places_once: Vec<Place> = Vec::new();
        let mut index = |place: Place| {
            places_once.iter().position(|known| *known == place).unwrap_or_else(|| {
                places_once.push(place);
                places_once.len() - 1
            })
        };
        for place in places(beginning, "at", chain)? {
            index(place);
        }
        let pairs = pairs(beginning, "transmission", chain)?;
        let pairs = pairs.into_iter().map(|[from, to]| (index(from), index(to))).collect();
        let range: Beads = settings.one("beads").unwrap_or_default();
        let beads = range.of(beginning.manifest.physics.beads).map_err(|why| format!("--beads {why}"))?;
        let others = [Quantity::Force, Quantity::Displacement];
        let quantity = others.into_iter().find(|quantity| settings.says("of", quantity.name()));
        let quantity = quantity.unwrap_or(Quantity::Velocity);
        let window = if settings.says("window", "none") { Window::None } else { Window::Hann };
        let (segment, max_hz) = (settings.one("segment"), settings.one("max-frequency"));
        let asked = Self { quantity, places: places_once, pairs, beads, kind, segment, window, max_hz };
        asked.check()?;
        Ok(asked)
    }

    fn check(&self) -> Result<(), Refusal> {
        let refuse = |why: String| Err(Refusal::from(why));
        let beads = self.beads.len();
        match self.kind {
            Kind::Spectra if self.places.is_empty() => refuse(
                "say where, such as --at bead:20, or --transmission bead:10,bead:90, or --map for all of the chain"
                    .to_owned(),
            ),
            Kind::Spectrogram if self.places.len() != 1 => {
                refuse("--spectrogram is of one place; name it with --at, such as --at bead:20".to_owned())
            }
            Kind::Map if self.quantity == Quantity::Force => {
                refuse("--map is of the velocity or the displacement of beads, not of forces".to_owned())
            }
            Kind::Map if beads < 8 => refuse(format!("--beads: a map needs at least 8 beads, not {beads}")),
            Kind::Map => {
                let longest = WaveMap::longest(beads);
                match self.segment.filter(|segment| *segment > longest) {
                    Some(segment) => refuse(format!(
                        "--segment {segment}: a map of {beads} beads has at most {longest} samples in a segment, since \
                         all of them are in memory; take fewer, or fewer beads with --beads"
                    )),
                    None => Ok(()),
                }
            }
            _ => Ok(()),
        }
    }

    /// The engine for `samples` samples.
    fn engine(&self, samples: u64) -> Engine {
        let length = |segments: u64, most: usize| {
            self.segment.unwrap_or_else(|| segment_length(samples, segments, (64.min(most), most)))
        };
        match self.kind {
            Kind::Spectra => {
                let (signals, pairs, window) = (self.places.len(), &self.pairs, self.window);
                Engine::Spectra(match self.segment {
                    Some(length) => Welch::new(signals, length, pairs, window),
                    None => Welch::for_samples(signals, samples, pairs, window),
                })
            }
            Kind::Spectrogram => Engine::Spectrogram(Spectrogram::new(samples, length(12, 1 << 14))),
            Kind::Map => {
                let beads = self.beads.len();
                let longest = WaveMap::longest(beads).min(1 << 16);
                Engine::Map(Box::new(WaveMap::new(beads, length(2, longest))))
            }
        }
    }
}

impl Engine {
    fn push(&mut self, index: u64, values: &[f64]) {
        match self {
            Self::Spectra(welch) => welch.push(values.iter().copied()),
            Self::Spectrogram(spectrogram) => spectrogram.push(index, values[0]),
            Self::Map(map) => map.push(values.iter().copied()),
        }
    }

    fn restart(&mut self) {
        match self {
            Self::Spectra(welch) => welch.restart(),
            Self::Spectrogram(spectrogram) => spectrogram.restart(),
            Self::Map(map) => map.restart(),
        }
    }

    fn segments(&self) -> &Segments {
        match self {
            Self::Spectra(welch) => welch.segments(),
            Self::Spectrogram(spectrogram) => spectrogram.segments(),
            Self::Map(map) => map.segments(),
        }
    }
}

/// Rate and number of samples.
struct Samples {
    rate_hz: f64,
    /// Time of the first one (s).
    first_s: f64,
    count: u64,
    interval_steps: u64,
}

/// The bands of a chain that is linear about its equilibrium, and the unit that it repeats.
struct Linear {
    cell: UnitCell,
    bands_hz: Vec<Band>,
}

impl Linear {
    fn of(manifest: &RunManifest) -> Option<Self> {
        let cell = UnitCell::of(&LinearChain::of(&manifest.physics.chain()).ok()?)?;
        Some(Self { bands_hz: cell.bands_hz(), cell })
    }

    fn top_hz(&self) -> f64 {
        self.bands_hz.last().map_or(0.0, |band| band[1])
    }
}

struct SpectrumAnalysis {
    manifest: RunManifest,
    asked: Asked,
    chain: Chain,
    linear: Option<Linear>,
    last_step: u64,
    sampling: Sampling,
    /// The first sample, until there is a second one.
    first: Vec<f64>,
    values: Vec<f64>,
    engine: Option<Engine>,
    found: Option<Found>,
}

impl SpectrumAnalysis {
    fn begin(beginning: &Beginning<'_>) -> Result<Self, Refusal> {
        let manifest = beginning.manifest.clone();
        let chain = manifest.physics.chain();
        Ok(Self {
            asked: Asked::of(beginning, &chain)?,
            linear: Linear::of(&manifest),
            last_step: manifest.physics.step_count.min(*beginning.steps.end()),
            sampling: Sampling::default(),
            first: Vec::new(),
            values: Vec::new(),
            engine: None,
            found: None,
            chain,
            manifest,
        })
    }

    fn samples(&self) -> Samples {
        let (physics, interval_steps) = (&self.manifest.physics, self.sampling.interval_steps().unwrap_or(1));
        Samples {
            rate_hz: 1.0 / (interval_steps as f64 * physics.dt_s),
            first_s: physics.time_s(self.sampling.first().unwrap_or(0)),
            count: self.sampling.count(),
            interval_steps,
        }
    }

    /// The values of a frame that are asked for.
    fn read(&mut self, frame: &Frame<'_>) {
        self.values.clear();
        let Asked { quantity, places, beads, kind, .. } = &self.asked;
        match (kind, quantity) {
            (Kind::Map, Quantity::Displacement) => self.values.extend(&frame.u_m[beads.clone()]),
            (Kind::Map, _) => self.values.extend(&frame.v_m_s[beads.clone()]),
            _ => {
                let values = places.iter().map(|place| place.value(&self.chain, frame, *quantity));
                self.values.extend(values);
            }
        }
    }

    /// A warning where there is motion that is too fast for the samples.
    fn slow_samples(&self, found: &Found) -> Option<String> {
        let samples = self.samples();
        let half_hz = 0.5 * samples.rate_hz;
        let advice = match samples.interval_steps {
            1 => "take a shorter time step",
            _ => "use --every-step, or record more often",
        };
        let half = quantity(half_hz, "Hz");
        let top_hz = self.linear.as_ref().map_or(0.0, Linear::top_hz);
        if top_hz > half_hz {
            return Some(format!(
                "samples tell frequencies up to {half}, and the chain has waves up to {}, which appear as lower ones: {advice}",
                quantity(top_hz, "Hz")
            ));
        }
        (found.at_the_end > 1e-3).then(|| {
            format!(
                "near {half}, the highest frequency that samples tell, there is still {:.1e} of the largest density: faster \
                 motion appears as slower one; {advice}",
                found.at_the_end
            )
        })
    }
}

impl Analysis for SpectrumAnalysis {
    fn columns(&self, _: usize) -> Vec<Column> {
        found::columns(&self.asked)
    }

    fn too_coarse(&self, interval_steps: u64) -> Option<String> {
        let half_hz = 0.5 / (interval_steps as f64 * self.manifest.physics.dt_s);
        let top_hz = self.linear.as_ref().map(Linear::top_hz).filter(|top_hz| *top_hz > half_hz)?;
        Some(format!(
            "the chain has waves up to {top_hz:.0} Hz, and frames every {interval_steps} steps tell frequencies up to {half_hz:.0} Hz"
        ))
    }

    fn observe(&mut self, frame: &Frame<'_>, _: &mut dyn Outlet) {
        let take = self.sampling.take(frame.step);
        if take == Take::Skip {
            return;
        }
        self.read(frame);
        if self.engine.is_none() {
            let Some(samples) = self.sampling.expected(self.last_step) else {
                self.first.clone_from(&self.values);
                return;
            };
            let mut engine = self.asked.engine(samples);
            engine.push(0, &self.first);
            self.engine = Some(engine);
        }
        if let Some(engine) = &mut self.engine {
            if take == Take::AfterGap {
                engine.restart();
            }
            engine.push(self.sampling.index(frame.step), &self.values);
        }
    }

    fn finish(&mut self, out: &mut dyn Outlet) -> Result<(), Refusal> {
        let samples = self.samples();
        let Some(engine) = self.engine.take().filter(|engine| engine.segments().count() > 0) else {
            return Err(too_few(&samples, self.sampling.break_count()));
        };
        let found =
            Found::new(&self.asked, engine, &samples, self.linear.as_ref().map_or(0.0, Linear::top_hz));
        if out.wants(0) {
            found.write(out);
        }
        self.found = Some(found);
        Ok(())
    }

    fn report(&mut self) -> Option<Report> {
        let mut report = Report { title: self.asked.kind.title(), ..Report::default() };
        let found = self.found.as_ref()?;
        let bands_hz = self.linear.as_ref().map(|linear| &linear.bands_hz[..]);
        report.words = found.words(&self.asked, &self.samples(), bands_hz.unwrap_or_default());
        report.results = found.json(&self.asked, &self.samples(), bands_hz);
        report.notices = self.slow_samples(found).into_iter().chain(found.incoherent(&self.asked)).collect();
        Some(report)
    }

    fn figure(&mut self) -> Result<Option<Figure>, FigureError> {
        let Some(found) = &self.found else { return Ok(None) };
        found.figure(&self.manifest, &self.asked, self.linear.as_ref()).map(Some)
    }

    fn value(&self, name: &str, _: Option<&str>) -> Option<Number> {
        let found = self.found.as_ref()?.first_summary()?;
        Some(Number::Double(match name {
            "peak_hz" => found.peak?[0],
            "peak_density" => found.peak?[1],
            "mean_square" => found.mean_square,
            _ => return None,
        }))
    }
}

fn too_few(samples: &Samples, break_count: u64) -> Refusal {
    let seen = counted(samples.count, "sample");
    let gaps = if break_count > 0 { format!(" with {}", counted(break_count, "gap")) } else { String::new() };
    Refusal::from(format!(
        "{seen}{gaps} cannot fill a segment of a spectrum: take a longer part of the run, a shorter --segment (at least \
         16), or --every-step, which recomputes what is between frames; `beadline recover` fills gaps"
    ))
}

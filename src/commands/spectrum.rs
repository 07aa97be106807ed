//! `beadline spectrum`.

mod outputs;

use crate::analysis::{AnalysisError, Session, check_beads, draw};
use crate::args::{OfArg, SpectrumArgs};
use crate::display;
use crate::failure::{BadInput, Done, Failure};
use crate::outputs::check_tables;
use anyhow::anyhow;
use consumers::follow::Analysis;
use outputs::Kind;
use schemas::frame::{EndReason, Frame};
use schemas::manifest::RunManifest;
use std::ops::Range;
use waves::dispersion::{Band, UnitCell};
use waves::linear::LinearChain;
use waves::place::{Place, Quantity, Sensors};
use waves::sampling::{Sampling, Take, segment_length};
use waves::segments::Window;
use waves::spectrogram::Spectrogram;
use waves::wave_map::WaveMap;
use waves::welch::Welch;

/// What is asked of the samples.
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
}

/// What adds samples up; it begins when the number of samples to come is known.
enum Engine {
    Spectra(Welch),
    Spectrogram(Spectrogram),
    Map(Box<WaveMap>),
}

struct Look {
    asked: Asked,
    sensors: Sensors,
    last_step: u64,
    sampling: Sampling,
    /// The first sample, until there is a second one.
    first: Vec<f64>,
    values: Vec<f64>,
    engine: Option<Engine>,
}

impl Asked {
    fn of(args: &SpectrumArgs, manifest: &RunManifest) -> Result<Self, Failure> {
        let kind = if args.map {
            Kind::Map
        } else if args.spectrogram {
            Kind::Spectrogram
        } else {
            Kind::Spectra
        };
        let mut places: Vec<Place> = Vec::new();
        let mut index = |place: Place| {
            places.iter().position(|known| *known == place).unwrap_or_else(|| {
                places.push(place);
                places.len() - 1
            })
        };
        for place in &args.at {
            index(*place);
        }
        let pairs = args.transmission.iter().map(|(from, to)| (index(*from), index(*to))).collect();
        let beads = check_beads(manifest, args.beads)?;
        let (quantity, window) = (args.of.quantity(), args.window.window());
        let asked = Self { quantity, places, pairs, beads, kind, segment: args.segment, window };
        asked.check(args, manifest)?;
        Ok(asked)
    }

    fn check(&self, args: &SpectrumArgs, manifest: &RunManifest) -> Result<(), Failure> {
        let chain = manifest.physics.chain();
        for place in &self.places {
            place.check(&chain).bad_input()?;
        }
        match self.kind {
            Kind::Spectra if self.places.is_empty() => Err(bad_input!(
                "say where, such as --at bead:20, or --transmission bead:10,bead:90, or --map for all of the chain"
            )),
            Kind::Spectrogram if self.places.len() != 1 => {
                Err(bad_input!("--spectrogram is of one place; name it with --at, such as --at bead:20"))
            }
            Kind::Map if args.of == OfArg::Force => {
                Err(bad_input!("--map is of the velocity or the displacement of beads, not of forces"))
            }
            Kind::Map if self.beads.len() < 8 => {
                Err(bad_input!("--beads: a map needs at least 8 beads, not {}", self.beads.len()))
            }
            Kind::Map => {
                let longest = WaveMap::longest(self.beads.len());
                match self.segment.filter(|segment| *segment > longest) {
                    Some(segment) => Err(bad_input!(
                        "--segment {segment}: a map of {} beads has at most {longest} samples in a segment, since \
                         all of them are in memory; take fewer, or fewer beads with --beads",
                        self.beads.len()
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

    fn segment_length(&self) -> usize {
        match self {
            Self::Spectra(welch) => welch.segment_length(),
            Self::Spectrogram(spectrogram) => spectrogram.segment_length(),
            Self::Map(map) => map.segment_length(),
        }
    }

    fn segment_count(&self) -> u64 {
        match self {
            Self::Spectra(welch) => welch.segment_count(),
            Self::Spectrogram(spectrogram) => spectrogram.segment_count(),
            Self::Map(map) => map.segment_count(),
        }
    }
}

impl Analysis for Look {
    type Error = AnalysisError;

    fn observe(&mut self, frame: &Frame<'_>) -> Result<(), AnalysisError> {
        let take = self.sampling.take(frame.step);
        if take == Take::Skip {
            return Ok(());
        }
        self.values.clear();
        let Asked { quantity, places, beads, kind, .. } = &self.asked;
        match (kind, quantity) {
            (Kind::Map, Quantity::Displacement) => self.values.extend(&frame.u_m[beads.clone()]),
            (Kind::Map, _) => self.values.extend(&frame.v_m_s[beads.clone()]),
            _ => {
                let values = places.iter().map(|place| self.sensors.value(frame, *place, *quantity));
                self.values.extend(values);
            }
        }
        if self.engine.is_none() {
            let Some(samples) = self.sampling.expected(self.last_step) else {
                self.first.clone_from(&self.values);
                return Ok(());
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
        Ok(())
    }
}

/// How the samples were taken.
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

pub(crate) fn spectrum(args: &SpectrumArgs) -> Result<Done, Failure> {
    let tables: Vec<_> = args.out.iter().collect();
    check_tables(&tables)?;
    let mut session = Session::open(&args.common, "spectrum", &tables)?;
    let manifest = session.manifest().clone();
    let asked = Asked::of(args, &manifest)?;
    let mut look = Look {
        asked,
        sensors: Sensors::new(manifest.physics.chain()),
        last_step: manifest.physics.step_count.min(*session.steps().end()),
        sampling: Sampling::default(),
        first: Vec::new(),
        values: Vec::new(),
        engine: None,
    };
    let tally = session.follow(&mut look)?;

    let Look { asked, sampling, engine, .. } = look;
    let interval_steps = sampling.interval_steps().unwrap_or(1);
    let samples = Samples {
        rate_hz: 1.0 / (interval_steps as f64 * manifest.physics.dt_s),
        first_s: manifest.physics.time_s(sampling.first().unwrap_or(0)),
        count: sampling.count(),
        interval_steps,
    };
    let Some(engine) = engine.filter(|engine| engine.segment_count() > 0) else {
        if tally.end == EndReason::Stopped {
            return Err(Failure::Stopped(anyhow!("stopped before there were samples enough")));
        }
        return Err(too_few(&samples, sampling.break_count()));
    };
    let linear = Linear::of(&manifest);
    let found = outputs::found(&asked, engine, &samples, linear, args.max_frequency);
    warn_of_slow_samples(&found, &samples);
    found.warn_of_incoherence(&asked);
    if let Some(path) = &args.out {
        found.write(&asked, path, args.common.frames.force)?;
    }
    draw(&args.common, || found.figure(&manifest, &asked))?;
    session.report(&tally, asked.kind.title(), found.rows(&asked, &samples), found.json(&asked, &samples))
}

fn too_few(samples: &Samples, break_count: u64) -> Failure {
    let seen = display::counted(samples.count, "sample");
    let gaps = if break_count > 0 {
        format!(" with {}", display::counted(break_count, "gap"))
    } else {
        String::new()
    };
    bad_input!(
        "{seen}{gaps} do not fill a segment of a spectrum: take a longer part of the run, a shorter --segment (at least \
         16), or --every-step, which recomputes what is between frames; --fill-gaps fills gaps"
    )
}

/// Says so if there is motion that is too fast for the samples.
fn warn_of_slow_samples(found: &outputs::Found, samples: &Samples) {
    let half_hz = 0.5 * samples.rate_hz;
    let advice = match samples.interval_steps {
        1 => "take a shorter time step",
        _ => "use --every-step, or record more often",
    };
    let half = display::quantity(half_hz, "Hz");
    let top_hz = found.linear.as_ref().map_or(0.0, Linear::top_hz);
    if top_hz > half_hz {
        notice!(
            "samples tell frequencies up to {half}, and the chain has waves up to {}, which appear as lower ones: {advice}",
            display::quantity(top_hz, "Hz")
        );
    } else if found.at_the_end > 1e-3 {
        notice!(
            "near {half}, the highest frequency that samples tell, there is still {:.1e} of the largest density: faster \
             motion appears as slower one; {advice}",
            found.at_the_end
        );
    }
}

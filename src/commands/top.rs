//! `beadline top`: live runs on a screen of the terminal.

mod keys;
mod watching;

use crate::args::TopArgs;
use crate::commands::ls;
use crate::display::{self, count};
use crate::failure::{Done, Failure};
use crate::keyboard::{Keyboard, Terminal};
use anyhow::anyhow;
use bus::{Bus, ConsumerInfo, RunInfo, RunState};
use keys::Key;
use ratatui::backend::TermionBackend;
use schemas::run_name::RunName;
use screen::{Depth, Field, Palette, RunLine, Screen, Watched, draw};
use source::Named;
use std::collections::HashMap;
use std::io::{self, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant, SystemTime};
use watching::{List, Watch};

pub(crate) fn top(args: &TopArgs) -> Result<Done, Failure> {
    let Named::Live(wanted) = &args.source else {
        let file = &args.source;
        return Err(bad_input!(
            "{file}: expected `live` or `live:RUN`; `beadline replay {file}` makes it one"
        ));
    };
    let bus = Bus::from_env()?;
    let is_dumb = std::env::var_os("TERM").is_none_or(|term| term == "dumb" || term.is_empty());
    let taken = if is_dumb { None } else { Keyboard::with_screen()? };
    let Some((keyboard, stop)) = taken else {
        return Err(bad_input!(
            "this is no terminal to show a screen on; programs read `beadline ls --json`"
        ));
    };
    let terminal = keyboard.terminal();
    close_on_panic(&terminal, &stop);
    let period = Duration::from_secs_f64(1.0 / args.rate);
    let mut top = Top {
        list: List::start(&bus)?,
        bus,
        period,
        wanted: wanted.clone(),
        chosen: None,
        watch: None,
        runs: Vec::new(),
        speeds: HashMap::new(),
        screen: Screen { field: args.field, notice: "looking for runs …".to_owned(), ..Screen::default() },
        frozen: None,
        palette: palette(),
    };
    let blank = || {
        let out = Out { terminal: Arc::clone(&terminal), bytes: Vec::new() };
        ratatui::Terminal::new(TermionBackend::new(out))
    };
    let mut shown = blank()?;
    let mut times_taken = terminal.times_taken();
    let mut due = Instant::now();
    while !stop.load(Ordering::Relaxed) {
        if let Some(key) = keyboard.wait(due.saturating_duration_since(Instant::now())) {
            top.obey(key)?;
        }
        if Instant::now() >= due {
            due = Instant::now() + period;
            top.look()?;
        }
        if std::mem::replace(&mut times_taken, terminal.times_taken()) != terminal.times_taken() {
            // the screen was given back meanwhile; to clear it, ratatui would ask for the cursor and read from our keys
            shown = blank()?;
        }
        let screen = top.frozen.as_ref().unwrap_or(&top.screen);
        shown.draw(|frame| draw(frame.buffer_mut(), screen, top.palette))?;
    }
    if terminal.is_closed() {
        return Err(Failure::Failed(anyhow!(
            "a thread of the screen went wrong: that is a bug, please report it"
        )));
    }
    Ok(Done::Whole)
}

/// A panic is told on the screen that was there before.
fn close_on_panic(terminal: &Arc<Terminal>, stop: &Arc<AtomicBool>) {
    let (terminal, stop) = (Arc::clone(terminal), Arc::clone(stop));
    let tell = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        terminal.close();
        stop.store(true, Ordering::Relaxed);
        tell(panic);
    }));
}

/// The colours that the environment tells of.
fn palette() -> Palette {
    let text = |name| std::env::var(name).unwrap_or_default();
    let depth = match (text("COLORTERM").as_str(), text("TERM").as_str()) {
        ("truecolor" | "24bit", _) => Depth::True,
        (_, term) if term.contains("256color") => Depth::Cube,
        (_, term) if term.ends_with("-direct") => Depth::True,
        _ => Depth::Sixteen,
    };
    // `15;0`: the last number is the background's, of the sixteen colours
    let background = text("COLORFGBG").rsplit(';').next().and_then(|last| last.parse::<u8>().ok());
    // until the terminal has told its background; sixteen colours are those of consoles, which are dark
    let is_dark = background.map_or(depth == Depth::Sixteen, |colour| colour < 7 || colour == 8);
    Palette { depth, is_dark }
}

/// The terminal as something to write on: each screen at once.
struct Out {
    terminal: Arc<Terminal>,
    bytes: Vec<u8>,
}

impl Write for Out {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.bytes.extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.terminal.write(&self.bytes);
        self.bytes.clear();
        Ok(())
    }
}

/// Link between the bus and the screen.
struct Top {
    bus: Bus,
    list: List,
    period: Duration,
    /// The run that was asked for on the command line, until it came.
    wanted: Option<RunName>,
    chosen: Option<RunName>,
    watch: Option<Watch>,
    runs: Vec<RunInfo>,
    speeds: HashMap<RunName, Speed>,
    screen: Screen,
    /// The screen while it is paused.
    frozen: Option<Screen>,
    palette: Palette,
}

/// Steps a second of a run, from two reports of its producer.
struct Speed {
    step: u64,
    written: SystemTime,
    per_second: Option<f64>,
}

impl Top {
    fn obey(&mut self, key: Key) -> Result<(), Failure> {
        match key {
            Key::Up => self.choose(-1)?,
            Key::Down => self.choose(1)?,
            Key::NextField => self.change(|screen| screen.field = screen.field.after(1)),
            Key::LastField => self.change(|screen| screen.field = screen.field.after(Field::ALL.len() - 1)),
            Key::Colours => self.change(|screen| screen.other_scale = !screen.other_scale),
            Key::Help => self.change(|screen| screen.shows_help = !screen.shows_help),
            Key::Pause => {
                self.frozen = match self.frozen.take() {
                    Some(_) => None,
                    None => Some(Screen { is_paused: true, ..self.screen.clone() }),
                };
            }
            Key::Background { is_dark } => self.palette.is_dark = is_dark,
            Key::End => {}
        }
        Ok(())
    }

    /// Changes the screen, paused or not.
    fn change(&mut self, change: impl Fn(&mut Screen)) {
        change(&mut self.screen);
        self.frozen.iter_mut().for_each(change);
    }

    /// Chooses the run so many lines below.
    fn choose(&mut self, lines: isize) -> Result<(), Failure> {
        let at = self.screen.chosen.map_or(0, |chosen| chosen.saturating_add_signed(lines));
        let Some(run) = self.runs.get(at.min(self.runs.len().saturating_sub(1))) else { return Ok(()) };
        if self.chosen.as_ref() != Some(&run.name) {
            self.frozen = None;
            let name = run.name.clone();
            self.watch(name)?;
        }
        Ok(())
    }

    fn watch(&mut self, name: RunName) -> Result<(), Failure> {
        self.watch = Some(Watch::start(&self.bus, &name, self.period)?);
        if self.chosen.as_ref() != Some(&name) {
            // of one that comes to life again, the last state stays until there is a new one
            self.screen.watched = None;
        }
        self.chosen = Some(name);
        self.wanted = None;
        self.place();
        Ok(())
    }

    /// Takes the news since the last look.
    fn look(&mut self) -> Result<(), Failure> {
        match self.list.take() {
            None => {}
            Some(Ok(runs)) => self.listed(runs)?,
            Some(Err(error)) => self.screen.notice = display::printable(&error.to_string()),
        }
        if let Some(watch) = &mut self.watch
            && let Some(told) = watch.take(&mut self.screen.watched)?
        {
            self.screen.notice = told;
        }
        if let (Some(chosen), Some(end)) = (self.screen.chosen, self.ended()) {
            // of a run that is over, the list knows only while somebody reads it
            if let Some(line) = self.screen.runs.get_mut(chosen) {
                line.0[1] = end;
            }
        }
        Ok(())
    }

    fn ended(&self) -> Option<String> {
        self.screen.watched.as_ref().and_then(Watched::ended).map(|reason| reason.to_string())
    }

    fn listed(&mut self, runs: Vec<RunInfo>) -> Result<(), Failure> {
        self.runs = runs;
        for run in &self.runs {
            let written = SystemTime::now().checked_sub(run.age).unwrap_or(SystemTime::UNIX_EPOCH);
            note_speed(&mut self.speeds, run, written);
        }
        let live =
            |run: &&RunInfo| run.is_live() && self.wanted.as_ref().is_none_or(|name| *name == run.name);
        let again = self.runs.iter().filter(live).find(|run| Some(&run.name) == self.chosen.as_ref());
        let first = self.runs.iter().find(live);
        // what is over stays on the screen until its name comes to life again
        let next = if self.chosen.is_none() { first } else { again.filter(|_| self.is_over()) };
        if let Some(name) = next.map(|run| run.name.clone()) {
            self.watch(name)?;
        }
        self.place();
        Ok(())
    }

    /// True if the run that is watched has ended, and all of it was shown.
    fn is_over(&self) -> bool {
        self.watch.as_ref().is_some_and(Watch::is_over)
    }

    /// Brings the list and the consumers onto the screen.
    fn place(&mut self) {
        let position = |run: &RunInfo| Some(&run.name) == self.chosen.as_ref();
        self.screen.chosen = self.runs.iter().position(position);
        self.screen.runs = self.runs.iter().map(|run| line(run, self.speeds.get(&run.name))).collect();
        let chosen = self.screen.chosen.and_then(|chosen| self.runs.get(chosen));
        self.screen.consumers = chosen.map(consumers).unwrap_or_default();
        self.screen.notice = match &self.wanted {
            Some(name) => format!("no run {name} yet; waiting for it"),
            None if self.runs.is_empty() => "no runs; start one with `beadline run`".to_owned(),
            None => String::new(),
        };
    }
}

fn note_speed(speeds: &mut HashMap<RunName, Speed>, run: &RunInfo, written: SystemTime) {
    let step = run.step;
    let Some(speed) = speeds.get_mut(&run.name) else {
        speeds.insert(run.name.clone(), Speed { step, written, per_second: None });
        return;
    };
    let elapsed_s = written.duration_since(speed.written).unwrap_or_default().as_secs_f64();
    if step < speed.step {
        *speed = Speed { step, written, per_second: None };
    } else if elapsed_s > 0.2 {
        *speed = Speed { step, written, per_second: Some((step - speed.step) as f64 / elapsed_s) };
    } else if run.age > Duration::from_secs(3) {
        speed.per_second = None;
    }
}

fn line(run: &RunInfo, speed: Option<&Speed>) -> RunLine {
    let [name, state, step, part, _, ends_in, ..] = ls::cells(run);
    let rate = speed.and_then(|speed| speed.per_second).filter(|_| run.state == RunState::Running);
    let rate = rate.map_or_else(|| "–".to_owned(), |rate| display::per_second(rate, "steps"));
    RunLine([name, state, step, part.trim().to_owned(), rate, ends_in])
}

fn consumers(run: &RunInfo) -> Vec<String> {
    let label = |consumer: &ConsumerInfo| display::printable(&consumer.label);
    let width = run.consumers.iter().map(|consumer| label(consumer).chars().count()).max().unwrap_or(0);
    let line = |consumer: &ConsumerInfo| {
        let lag = ls::lag_in_words(consumer, consumer.lag_frames.map(|lag| count(lag).to_string()));
        format!("{:width$}  {lag}", label(consumer))
    };
    run.consumers.iter().map(line).collect()
}

//! `beadline top` on a terminal, which is emulated here as far as the screen uses it.

use crate::harness::{Place, Running, wait_until};
use rustix::fs::{Mode, OFlags, fcntl_setfl, open};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{Winsize, tcgetattr, tcsetwinsize};
use std::fs::File;
use std::io::{ErrorKind, Read as _, Write as _};

/// A short recording, and a replay of it that takes two seconds.
const SHORT: &str = "run --beads 120 --impurity 60=0.6e-3 --duration 2e-3 --name small";
const SLOWLY: &str = "replay small.mcap --rate 1e-3 --wait-for 0 --json";

/// What a terminal shows.
struct Shown {
    cells: Vec<Vec<char>>,
    cursor: (usize, usize),
    is_alternate: bool,
    has_cursor: bool,
    /// The begin of a sequence or of a character that is not there yet.
    rest: Vec<u8>,
}

impl Shown {
    fn new((columns, rows): (u16, u16)) -> Self {
        let cells = vec![vec![' '; columns.into()]; rows.into()];
        Self { cells, cursor: (0, 0), is_alternate: false, has_cursor: true, rest: Vec::new() }
    }

    fn resize(&mut self, (columns, rows): (u16, u16)) {
        self.cells = vec![vec![' '; columns.into()]; rows.into()];
    }

    fn feed(&mut self, bytes: &[u8]) {
        self.rest.extend(bytes);
        let bytes = std::mem::take(&mut self.rest);
        let whole = match std::str::from_utf8(&bytes) {
            Ok(text) => text,
            Err(error) => std::str::from_utf8(&bytes[..error.valid_up_to()]).unwrap(),
        };
        let mut text = whole;
        while let Some(first) = text.chars().next() {
            let taken = if first == '\x1b' { self.obey(text) } else { Some(self.put(first)) };
            let Some(taken) = taken else { break };
            text = &text[taken..];
        }
        self.rest = bytes[whole.len() - text.len()..].to_vec();
    }

    fn put(&mut self, character: char) -> usize {
        let (column, row) = self.cursor;
        match character {
            '\r' => self.cursor.0 = 0,
            '\n' => self.cursor.1 += 1,
            _ => {
                if let Some(cell) = self.cells.get_mut(row).and_then(|row| row.get_mut(column)) {
                    *cell = character;
                }
                self.cursor.0 += 1;
            }
        }
        character.len_utf8()
    }

    /// Obeys the sequence at the begin of `text`, and says how long it is; none if its end is not there yet.
    fn obey(&mut self, text: &str) -> Option<usize> {
        let rest = text.get(1..).filter(|rest| !rest.is_empty())?;
        if rest.starts_with(']') {
            return rest.find("\x1b\\").map(|end| end + 3);
        }
        let numbers = rest.strip_prefix('[').unwrap_or_else(|| panic!("{rest:?}"));
        let end = numbers.find(|character: char| character.is_ascii_alphabetic())?;
        let values: Vec<usize> = numbers[..end].split(';').map(|value| value.parse().unwrap_or(1)).collect();
        match &numbers[..=end] {
            "?1049h" => self.is_alternate = true,
            "?1049l" => self.is_alternate = false,
            "?25h" => self.has_cursor = true,
            "?25l" => self.has_cursor = false,
            "2J" => self.cells.iter_mut().for_each(|row| row.fill(' ')),
            place if place.ends_with('H') => self.cursor = (values[1] - 1, values[0] - 1),
            other => assert!(other.ends_with('m'), "{other:?} is unknown"),
        }
        Some(end + 3)
    }

    fn text(&self) -> String {
        self.cells.iter().map(|row| row.iter().collect::<String>() + "\n").collect()
    }
}

/// `beadline` on a terminal of its own.
struct Terminal {
    running: Running,
    controller: File,
    other_side: File,
    shown: Shown,
    before: String,
}

/// The modes of a terminal, to be compared.
fn modes(terminal: &File) -> String {
    format!("{:?}", tcgetattr(terminal).unwrap())
}

fn size((columns, rows): (u16, u16)) -> Winsize {
    Winsize { ws_row: rows, ws_col: columns, ws_xpixel: 0, ws_ypixel: 0 }
}

impl Terminal {
    fn start(place: &Place, words: &str, columns_rows: (u16, u16)) -> Self {
        let controller = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).unwrap();
        grantpt(&controller).unwrap();
        unlockpt(&controller).unwrap();
        let name = ptsname(&controller, Vec::new()).unwrap();
        let terminal = open(name, OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC, Mode::empty()).unwrap();
        let (controller, terminal) = (File::from(controller), File::from(terminal));
        fcntl_setfl(&controller, OFlags::NONBLOCK).unwrap();
        tcsetwinsize(&controller, size(columns_rows)).unwrap();
        let before = modes(&terminal);
        // it takes the terminal on its stdin as its own, as a shell does
        let beadline = [env!("CARGO_BIN_EXE_beadline")];
        let mut command = place.foreign("setsid", ["--ctty"].iter().chain(&beadline));
        command.args(words.split_whitespace()).env("TERM", "xterm-256color").env_remove("COLORTERM");
        command.stdin(terminal.try_clone().unwrap());
        command.stdout(terminal.try_clone().unwrap());
        command.stderr(terminal.try_clone().unwrap());
        let running = Running::of(words, command.spawn().unwrap());
        Self { running, controller, other_side: terminal, shown: Shown::new(columns_rows), before }
    }

    fn press(&mut self, keys: &str) {
        self.controller.write_all(keys.as_bytes()).unwrap();
    }

    fn resize(&mut self, columns_rows: (u16, u16)) {
        self.shown.resize(columns_rows);
        tcsetwinsize(&self.controller, size(columns_rows)).unwrap();
    }

    fn read(&mut self) {
        let mut bytes = [0; 4096];
        loop {
            match self.controller.read(&mut bytes) {
                Ok(count) => self.shown.feed(&bytes[..count]),
                Err(error) if error.kind() == ErrorKind::WouldBlock => return,
                Err(error) => panic!("{error}"),
            }
        }
    }

    /// Waits until the screen shows something, and gives it.
    fn until(&mut self, what: &str, shows: impl Fn(&str) -> bool) -> String {
        let mut text = String::new();
        wait_until(what, || {
            self.read();
            text = self.shown.text();
            shows(&text).then_some(())
        });
        text
    }

    fn until_it_says(&mut self, what: &str) -> String {
        self.until(what, |text| text.contains(what))
    }

    /// Whether the terminal is as it was found.
    fn is_restored(&mut self) -> bool {
        self.read();
        !self.shown.is_alternate && self.shown.has_cursor && modes(&self.other_side) == self.before
    }

    /// Waits for the end: an exit code, or a signal as a negative number. The terminal is as it was.
    #[track_caller]
    fn ends(mut self, expected: i32) {
        wait_until("the end", || {
            self.read();
            (!self.running.is_running()).then_some(())
        });
        assert!(self.is_restored(), "{}", self.shown.text());
        let ended = self.running.wait();
        assert_eq!(ended.code().or(ended.killed_by().map(|signal| -signal)), Some(expected));
    }
}

/// The number behind `name` on the screen.
fn number<'a>(text: &'a str, name: &str) -> &'a str {
    let rest = text.split_once(name).unwrap_or_else(|| panic!("{name} is not on\n{text}")).1;
    rest.split_whitespace().next().unwrap().trim_end_matches(',')
}

/// Asserts that the energies on the screen are those of the table at the step on the screen.
#[track_caller]
fn check_energies(text: &str, table: &str) -> u64 {
    let step: u64 = number(text, "· step ").replace(',', "").parse().unwrap();
    let columns: Vec<&str> = table.lines().next().unwrap().split(',').collect();
    let place = |name: &str| columns.iter().position(|column| *column == name).unwrap();
    let rows = table.lines().skip(1).map(|line| line.split(',').collect::<Vec<_>>());
    let row = rows.into_iter().find(|row| row[place("step")] == step.to_string()).unwrap();
    let value = |name: &str| row[place(name)].parse::<f64>().unwrap();
    assert!(text.contains("energies (mJ)"), "{text}");
    for (name, column) in [
        ("\n kinetic ", "kinetic_j"),
        ("\n potential ", "potential_j"),
        ("\n left ", "left_j"),
        ("\n bead 60 ", "split_j"),
        ("\n right ", "right_j"),
        ("together ", "total_j"),
    ] {
        let shown = number(text, name);
        let decimals = shown.split_once('.').map_or(6, |(_, decimals)| decimals.len());
        let last_digit = 10_f64.powi(-i32::try_from(decimals).unwrap());
        let off = (shown.parse::<f64>().unwrap() - 1e3 * value(column)).abs();
        assert!(off <= 0.51 * last_digit, "{column} at step {step}: {shown} mJ, {} J\n{text}", value(column));
    }
    step
}

#[test]
fn the_screen_shows_what_the_tables_say() {
    let place = Place::new();
    place.run(SHORT).exits(0);
    place.run("energies small.mcap --out energies.csv").exits(0);
    let table = place.read("energies.csv");
    let mut terminal = Terminal::start(&place, "top", (80, 24));
    terminal.until_it_says("no runs; start one with `beadline run`");
    let replay = place.start(SLOWLY);
    terminal.until_it_says("· step ");
    place.wait_for_run("small", |run| run.step > 100 && run.latest == 1 && run.lossless == 0);
    terminal.until("a speed and a consumer", |text| text.contains("steps/s") && text.contains("top  "));
    terminal.press("p");
    let text = terminal.until_it_says("PAUSED");
    let step = check_energies(&text, &table);
    // the screen stands still, the run does not
    place.wait_for_run("small", |run| run.step > step + 50);
    terminal.read();
    assert_eq!(check_energies(&terminal.shown.text(), &table), step);
    terminal.press("p");
    let text = terminal.until_it_says("ended: complete");
    let last = check_energies(&text, &table);
    assert_eq!(replay.wait().exits(0).json()["last_step"].as_u64().unwrap_or(last), last);
    assert!(text.contains("complete"), "{text}");
    terminal.press("q");
    terminal.ends(0);
}

#[test]
fn keys_choose_what_is_shown_and_a_resize_is_followed() {
    let place = Place::new();
    let mut terminal = Terminal::start(&place, "top --field energy --rate 30", (80, 24));
    let long = "--preset homogeneous --beads 120 --duration 1 --no-record --pace 1e-3 --yes --json";
    let _one = place.start(&format!("run {long} --name one"));
    terminal.until("the one run", |text| text.contains("one · step") && text.contains("energy from"));
    let _two = place.start(&format!("run {long} --name two"));
    terminal.until_it_says("\n two");
    for (key, shows) in [
        ("j", "two · step"),
        ("\x1b[A", "one · step"),
        ("f", "contacts from"),
        ("f", "velocity from"),
        ("l", ", linear"),
        ("l", ", log"),
        ("F", "contacts from"),
        ("?", "the next or the last field"),
        ("?", "contacts from"),
    ] {
        terminal.press(key);
        terminal.until_it_says(shows);
    }
    for columns_rows in [(40, 12), (140, 45), (20, 5), (80, 24)] {
        terminal.resize(columns_rows);
        terminal.until("a screen of this size", |text| {
            let last = text.lines().last().unwrap();
            last.contains("q quit") && text.contains("step")
        });
    }
    terminal.press("\x1b");
    terminal.ends(0);
}

#[test]
fn the_terminal_is_as_it_was_after_every_end() {
    let place = Place::new();
    let _run = place.start(
        "run --preset homogeneous --beads 120 --duration 1 --no-record --pace 1e-3 --yes --name one --json",
    );
    for (key, signal, expected) in [
        ("\x03", "", 0),
        ("\x1c", "", -3),
        ("", "INT", 0),
        ("", "TERM", 0),
        ("", "HUP", 0),
        ("", "QUIT", -3),
        ("", "USR1", -10),
        ("", "ALRM", -14),
    ] {
        let mut terminal = Terminal::start(&place, "top", (80, 24));
        terminal.until_it_says("one · step");
        assert!(terminal.shown.is_alternate && !terminal.shown.has_cursor && !terminal.is_restored());
        terminal.press(key);
        if !signal.is_empty() {
            terminal.running.signal(signal);
        }
        terminal.ends(expected);
    }
    // Ctrl-Z: the shell gets its terminal, and the screen is drawn anew when it goes on
    let mut terminal = Terminal::start(&place, "top", (80, 24));
    terminal.until_it_says("one · step");
    for _ in 0..2 {
        terminal.press("\x1a");
        wait_until("the terminal", || terminal.is_restored().then_some(()));
        terminal.shown.resize((80, 24));
        terminal.running.signal("CONT");
        terminal.until("all of the screen", |text| text.contains("one · step") && text.contains("q quit"));
        assert!(terminal.shown.is_alternate && !terminal.shown.has_cursor);
    }
    terminal.press("q");
    terminal.ends(0);
}

/// A line over which nothing comes any more holds up who writes, but not the end.
#[test]
fn a_second_signal_ends_it_though_nobody_reads_the_terminal() {
    let place = Place::new();
    let _run =
        place.start("run --preset homogeneous --beads 120 --duration 1 --no-record --pace 1e-3 --yes --json");
    let mut terminal = Terminal::start(&place, "top --rate 60", (500, 200));
    terminal.until_it_says("homogeneous · step");
    terminal.press("?????????????????????????????????????????");
    wait_until("the end", || {
        terminal.running.signal("TERM");
        (!terminal.running.is_running()).then_some(())
    });
    assert_eq!(modes(&terminal.other_side), terminal.before);
}

#[test]
fn what_is_no_terminal_or_no_live_run_is_refused() {
    let place = Place::new();
    place.run("top").exits(2).says(&["no terminal", "beadline ls --json"]);
    place.run("top some.mcap").exits(2).says(&["some.mcap", "live:RUN", "beadline replay some.mcap"]);
    place.run("top --rate 0").exits(2).says(&["0.1 to 60"]);
    place.run("top --field mass").exits(2).says(&["velocity", "contacts"]);
}

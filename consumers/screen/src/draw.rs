//! Drawing of a screen in cells.

use crate::field::Field;
use crate::profile::profile;
use crate::strip::Strip;
use crate::{Palette, RunLine, Screen, Watched};
use consumers::uncertain::Uncertain;
use figure::ColourScale;
use ratatui::buffer::{Buffer, Cell};
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::Line;
use ratatui::widgets::{Block, Borders, Clear, Paragraph, Widget as _};
use schemas::amounts::{count, seconds, unit};

/// The keys and their effects.
const KEYS: [(&str, &str); 7] = [
    ("↑ ↓, k j", "choose a run"),
    ("f, F", "the next or the last field: velocity, displacement, overlap, energy, contacts"),
    ("l", "linear or logarithmic colours"),
    ("p, space", "pause the screen, not the run; go on"),
    ("?", "this help, and back"),
    ("q, Esc, Ctrl-C", "the end"),
    (
        "",
        "Nothing here slows a run down. Red is above 0, blue below. Contacts: dark compressed, orange open.",
    ),
];

/// The last lines that there may be: the longest one that fits is shown.
const LAST_LINES: [&str; 3] = [
    "↑↓ run   f field   l colours   p pause   ? help   q quit",
    "↑↓ run f field p pause ? help q quit",
    "? help  q quit",
];

const TITLE: Style = Style::new().add_modifier(Modifier::BOLD);
const FAINT: Style = Style::new().add_modifier(Modifier::DIM);

/// Draws all of it, as large as the buffer is.
pub fn draw(buffer: &mut Buffer, screen: &Screen, palette: Palette) {
    let area = buffer.area;
    let is_high = area.height >= 18;
    let most = if area.height < 16 { 1 } else { usize::from(area.height / 6).min(8) };
    let runs = lines(1 + screen.runs.len().clamp(1, most));
    let outcome = screen.watched.as_ref().and_then(Watched::outcome);
    let is_driven = outcome.is_some_and(|outcome| outcome.is_driven);
    let energies = match area.height {
        18.. => 8 + u16::from(is_driven),
        14.. => 4,
        _ => 3,
    };
    let of_consumers = if is_high && area.width < 64 { lines(screen.consumers.len().min(4)) } else { 0 };
    let profile = (area.height.saturating_sub(runs + energies + 2) / 3 + 1).clamp(3, 14);
    let rows = [
        Constraint::Length(if area.height < 10 { 0 } else { runs }),
        Constraint::Length(if area.height < 8 { 0 } else { energies }),
        Constraint::Length(of_consumers),
        Constraint::Length(profile),
        Constraint::Fill(1),
        Constraint::Length(1),
    ];
    let [runs, energies, consumers, profile, strip, last] = Layout::vertical(rows).areas(area);
    draw_runs(buffer, runs, screen);
    draw_last_line(buffer, last, screen);
    let Some(watched) = &screen.watched else {
        let text = Paragraph::new(screen.notice.as_str()).centered();
        text.render(Rect { height: strip.height.min(1), ..strip }, buffer);
        return draw_help(buffer, screen);
    };
    let beside = if is_high && area.width >= 64 { area.width / 2 } else { 0 };
    let halves = [Constraint::Fill(1), Constraint::Length(beside)];
    let [energies, right] = Layout::horizontal(halves).areas(energies);
    draw_energies(buffer, energies, watched, palette);
    draw_consumers(buffer, if beside > 0 { right } else { consumers }, &screen.consumers);
    draw_profile(buffer, profile, screen, watched, palette);
    draw_strip(buffer, strip, screen, watched, palette);
    draw_help(buffer, screen);
}

/// Number of rows.
fn lines(count: usize) -> u16 {
    u16::try_from(count).unwrap_or(u16::MAX)
}

/// A line with a title, and the area below it.
fn titled(buffer: &mut Buffer, area: Rect, title: &str) -> Rect {
    titled_twice(buffer, area, title, "")
}

/// The same with something at its right end, if there is room for it.
fn titled_twice(buffer: &mut Buffer, area: Rect, title: &str, right: &str) -> Rect {
    let room = usize::from(area.width).saturating_sub(title.chars().count() + 5);
    let right =
        if right.is_empty() || right.chars().count() > room { String::new() } else { format!(" {right} ") };
    let title: String = title.chars().take(usize::from(area.width.saturating_sub(4))).collect();
    let block = Block::new()
        .borders(Borders::TOP)
        .border_style(FAINT)
        .title(Line::styled(format!(" {title} "), TITLE))
        .title(Line::styled(right, FAINT).right_aligned());
    let inner = block.inner(area);
    block.render(area, buffer);
    inner
}

/// The columns of the list that are left out where there is no room, in this order.
const DISPENSABLE: [usize; 4] = [2, 4, 5, 3];

fn draw_runs(buffer: &mut Buffer, area: Rect, screen: &Screen) {
    let header = RunLine(RunLine::HEADER.map(str::to_owned));
    let mut shown: Vec<usize> = (0..RunLine::HEADER.len()).collect();
    let width = |column: usize| {
        let cells = screen.runs.iter().chain([&header]).map(|run| run.0[column].chars().count());
        cells.max().unwrap_or(0)
    };
    let total = |shown: &[usize]| shown.iter().map(|column| width(*column) + 2).sum::<usize>();
    for column in DISPENSABLE {
        if total(&shown) > usize::from(area.width) {
            shown.retain(|other| *other != column);
        }
    }
    // a name may be longer than the screen is wide
    let too_much = total(&shown).saturating_sub(usize::from(area.width));
    let line = |run: &RunLine| {
        let cells = shown.iter().map(|column| {
            let width = if *column == 0 { width(0).saturating_sub(too_much).max(4) } else { width(*column) };
            let cell = &run.0[*column];
            let cut: String = cell.chars().take(width.saturating_sub(1)).chain(['…']).collect();
            let cell = if cell.chars().count() > width { &cut } else { cell };
            if *column < 2 { format!("{cell:width$}") } else { format!("{cell:>width$}") }
        });
        cells.collect::<Vec<_>>().join("  ")
    };
    let style = FAINT.add_modifier(Modifier::BOLD);
    let right = area.right();
    let mut put = |row: u16, text: &str, style: Style| {
        if row < area.height {
            buffer.set_stringn(area.x + 1, area.y + row, text, usize::from(right.saturating_sub(1)), style);
        }
    };
    put(0, &line(&header), style);
    if screen.runs.is_empty() && screen.watched.is_some() {
        put(1, &screen.notice, FAINT);
    }
    let rows = usize::from(area.height.saturating_sub(1));
    let first = screen.chosen.map_or(0, |chosen| (chosen + 1).saturating_sub(rows));
    for (index, run) in screen.runs.iter().enumerate().skip(first).take(rows) {
        let is_chosen = screen.chosen == Some(index);
        let style = if is_chosen { Style::new().add_modifier(Modifier::REVERSED) } else { Style::new() };
        let text = line(run);
        let text =
            if is_chosen { format!("{text:0$}", usize::from(area.width).saturating_sub(2)) } else { text };
        put(lines(1 + index - first), &text, style);
    }
}

fn draw_energies(buffer: &mut Buffer, area: Rect, watched: &Watched, palette: Palette) {
    let Some(outcome) = watched.outcome() else {
        titled(buffer, area, "energies");
        return;
    };
    let last = &outcome.last;
    let all_j = last.total_j + last.dissipated_j;
    let known = |energy_j: f64| Uncertain::new(energy_j, outcome.step_error_j());
    let (unit, one_j) = unit(all_j, "J");
    let total = (known(all_j) / one_j).value_text();
    let inner = titled(buffer, area, &format!("energies ({unit}), together {total}"));
    let bead = format!("bead {}", outcome.split_bead);
    let mut parts = vec![
        ("kinetic", last.kinetic_j),
        ("potential", last.potential_j),
        ("left", last.left_j),
        ("right", last.right_j),
        (bead.as_str(), last.split_j),
        ("dissipated", last.dissipated_j),
    ];
    parts.extend(outcome.is_driven.then_some(("driven", last.driven_j)));
    let text = |energy_j: f64| (known(energy_j) / one_j).value_text();
    let drift = format!("{:.1e}", last.relative_drift);
    let width = usize::from(inner.width);
    if usize::from(inner.height) <= parts.len() {
        let column = width / 2;
        let mut cells: Vec<_> =
            parts.iter().map(|(name, energy_j)| format!("{name} {}", text(*energy_j))).collect();
        // of a chain that dissipates nothing, the drift says more
        if last.dissipated_j == 0.0 {
            cells[5] = format!("drift {drift}");
        }
        for (row, pair) in (inner.y..inner.bottom()).zip(cells.chunks(2)) {
            let line = format!("{:column$}{}", pair[0], pair.get(1).map_or("", String::as_str));
            buffer.set_stringn(inner.x + 1, row, line, width.saturating_sub(1), Style::new());
        }
        return;
    }
    let numbers: Vec<_> = parts.iter().map(|(_, energy_j)| text(*energy_j)).collect();
    let widest = numbers.iter().map(|number| number.chars().count()).max().unwrap_or(0);
    let room = width.saturating_sub(widest + 15);
    for (row, ((name, energy_j), number)) in (inner.y..).zip(parts.iter().zip(&numbers)) {
        let line = format!("{name:<10}  {number:>widest$}");
        let (x, _) = buffer.set_stringn(inner.x + 1, row, line, width.saturating_sub(1), Style::new());
        buffer.set_stringn(x + 1, row, bar(energy_j / all_j, room), room, Style::new().fg(palette.line()));
    }
    let (row, line) = (inner.y + lines(parts.len()), format!("{:<10}  {drift:>widest$}", "drift"));
    buffer.set_stringn(inner.x + 1, row, line, width.saturating_sub(1), Style::new());
}

/// A bar for a part of the whole, to an eighth of a cell.
fn bar(part: f64, width: usize) -> String {
    const EIGHTHS: [&str; 8] = ["", "▏", "▎", "▍", "▌", "▋", "▊", "▉"];
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
    let eighths = (part.clamp(0.0, 1.0) * 8.0 * width as f64).round() as usize;
    "█".repeat(eighths / 8) + EIGHTHS[eighths % 8]
}

fn draw_consumers(buffer: &mut Buffer, area: Rect, consumers: &[String]) {
    if area.is_empty() {
        return;
    }
    let inner = titled(buffer, area, "consumers");
    let rows = usize::from(inner.height);
    let fits = if consumers.len() > rows { rows.saturating_sub(1) } else { rows };
    let more = consumers.len().saturating_sub(fits);
    let last = (more > 0).then(|| format!("and {more} more"));
    let shown = consumers.iter().take(fits).chain(&last);
    for (row, line) in (inner.y..inner.bottom()).zip(shown) {
        buffer.set_stringn(inner.x + 1, row, line, usize::from(inner.width).saturating_sub(1), Style::new());
    }
}

/// The range of a field over all that was seen; contacts have the same always.
fn range_of(field: Field, strip: &Strip) -> [f64; 2] {
    if field == Field::Contacts { [-0.5, 1.0] } else { strip.range() }
}

fn draw_profile(buffer: &mut Buffer, area: Rect, screen: &Screen, watched: &Watched, palette: Palette) {
    let field = screen.field;
    let (values, strip) = watched.shown(field);
    let range = range_of(field, strip);
    let at = format!("step {} of {}", count(watched.step), count(watched.step_count));
    let ended = watched.end.map_or_else(String::new, |reason| format!(" · ended: {reason}"));
    let time = seconds(watched.time_s);
    let title = format!("{} · {at} · t = {time}{ended}", watched.name);
    let title =
        if title.chars().count() + 4 > usize::from(area.width) { format!("{at}{ended}") } else { title };
    let inner = titled(buffer, area, &title);
    let rows = profile(values, range, usize::from(inner.width), usize::from(inner.height));
    let line = Style::new().fg(palette.line());
    let split = watched.outcome().map(|outcome| (outcome.split_bead, outcome.beads));
    let marked = split.map(|(bead, beads)| u64::from(inner.width) * bead / beads);
    for (y, row) in (inner.y..inner.bottom()).zip(rows) {
        for (x, cell) in (inner.x..inner.right()).zip(row) {
            let is_free = matches!(cell, ' ' | '┈');
            let cell = if cell == ' ' && Some(u64::from(x - inner.x)) == marked { '┊' } else { cell };
            let style = if is_free { FAINT } else { line };
            buffer[(x, y)].set_char(cell).set_style(style);
        }
    }
    let bounds = [(range[1], inner.y), (range[0], inner.bottom().saturating_sub(1))];
    if field != Field::Contacts && inner.height > 1 {
        let (unit, one) = unit(if range[1] > -range[0] { range[1] } else { range[0] }, field.unit());
        for (value, row) in bounds {
            let label = if value == 0.0 { "0".to_owned() } else { format!("{:.2} {unit}", value / one) };
            let x = inner.right().saturating_sub(lines(label.chars().count()));
            buffer.set_string(x, row, label, FAINT.fg(Color::Reset));
        }
    }
}

fn draw_strip(buffer: &mut Buffer, area: Rect, screen: &Screen, watched: &Watched, palette: Palette) {
    let field = screen.field;
    let (values, strip) = watched.shown(field);
    let [low, high] = range_of(field, strip);
    let is_log = (field != Field::Displacement) != screen.other_scale;
    let mut scale = ColourScale::new("", low, high);
    if is_log {
        scale = scale.log_beyond(1e-3 * high.max(-low));
    }
    let (first, end) = strip.steps();
    let [from, to] = [first, end.min(watched.step)].map(|step| seconds(step as f64 * watched.dt_s));
    let scaled = match (field, is_log) {
        (Field::Contacts, _) => "",
        (_, true) => ", log",
        (_, false) => ", linear",
    };
    let places = format!("{}s 0 to {}", field.place(), values.len().saturating_sub(1));
    let inner =
        titled_twice(buffer, area, &format!("{} from {from} down to {to}{scaled}", field.name()), &places);
    let (columns, rows) = (usize::from(inner.width), usize::from(inner.height));
    let cells = strip.fitted(columns, 2 * rows);
    let colour = |value: f64| {
        if field == Field::Contacts { palette.class(value) } else { palette.diverging(scale.shade(value)) }
    };
    for (y, pair) in (inner.y..).zip(cells.chunks(2)) {
        for (x, column) in (inner.x..inner.right()).zip(0..columns) {
            let above = colour(pair[0][column]);
            let below = pair.get(1).map_or(Color::Reset, |row| colour(row[column]));
            halves(&mut buffer[(x, y)], above, below);
        }
    }
}

/// A cell of two colours; `Reset` is that of the background, which nothing can be drawn in.
fn halves(cell: &mut Cell, above: Color, below: Color) {
    match (above, below) {
        (Color::Reset, Color::Reset) => cell.set_char(' '),
        (Color::Reset, _) => cell.set_char('▄').set_fg(below),
        _ => cell.set_char('▀').set_fg(above).set_bg(below),
    };
}

fn draw_last_line(buffer: &mut Buffer, area: Rect, screen: &Screen) {
    let paused = if screen.is_paused { "PAUSED  " } else { "" };
    let width = usize::from(area.width);
    let fits = |line: &&str| paused.chars().count() + line.chars().count() + 1 < width;
    let keys = LAST_LINES.into_iter().find(fits).unwrap_or_default();
    let (x, _) = buffer.set_stringn(area.x + 1, area.y, paused, width.saturating_sub(1), TITLE);
    buffer.set_stringn(x, area.y, keys, width.saturating_sub(usize::from(x)), FAINT);
}

fn draw_help(buffer: &mut Buffer, screen: &Screen) {
    if !screen.shows_help {
        return;
    }
    let area = buffer.area;
    let area = Rect { height: area.height.saturating_sub(1), ..area };
    Clear.render(area, buffer);
    let inner = titled(buffer, area, "keys");
    let lines: Vec<Line<'_>> = KEYS
        .iter()
        .map(
            |(key, what)| {
                if key.is_empty() { Line::from(*what) } else { Line::from(format!("{key:15} {what}")) }
            },
        )
        .collect();
    Paragraph::new(lines).wrap(ratatui::widgets::Wrap { trim: false }).render(inner, buffer);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Depth;
    use schemas::config::RunConfig;
    use schemas::frame::{EndReason, Frame};
    use schemas::manifest::{Origin, RunManifest};
    use schemas::presets::PRESETS;

    const PALETTE: Palette = Palette { depth: Depth::True, is_dark: true };

    /// A run whose bead 400 moves at 5 m/s in the last of three states.
    fn screen() -> Screen {
        let origin = Origin { program: String::new(), host: String::new(), started_unix_ns: 0 };
        let manifest = RunManifest::new(&PRESETS[0].config(), "run", origin).expect("valid");
        let mut watched = Watched::new(&manifest);
        for step in 0..3 {
            let mut v_m_s = vec![0.0; 1000];
            v_m_s[if step == 2 { 400 } else { 0 }] = 5.0;
            let time_s = manifest.physics.time_s(step);
            let u_m = vec![0.0; 1000];
            watched.observe(&Frame {
                frame: step,
                step,
                time_s,
                u_m: &u_m,
                v_m_s: &v_m_s,
                extra: &[],
                active: None,
            });
        }
        let line = |name: &str| RunLine([name, "running", "2 of 55,189", "0 %", "–", "–"].map(str::to_owned));
        Screen {
            runs: vec![
                line("light-impurity"),
                line("a-name-of-sixty-four-letters-is-longer-than-a-narrow-screen-has"),
            ],
            chosen: Some(1),
            consumers: (0..9).map(|index| format!("consumer-{index}  0 behind")).collect(),
            watched: Some(watched),
            field: Field::Velocity,
            other_scale: false,
            is_paused: false,
            shows_help: false,
            notice: String::new(),
        }
    }

    fn rows(screen: &Screen, columns: u16, rows: u16) -> Vec<String> {
        let mut buffer = Buffer::empty(Rect::new(0, 0, columns, rows));
        draw(&mut buffer, screen, PALETTE);
        let row = |y| (0..columns).map(|x| buffer[(x, y)].symbol()).collect::<String>();
        (0..rows).map(row).collect()
    }

    #[test]
    fn a_screen_of_the_usual_size_has_everything() {
        let rows = rows(&screen(), 80, 24);
        let text = rows.join("\n");
        for part in [
            "NAME",
            "light-impurity",
            "energies (mJ), together 12.5",
            "kinetic",
            "dissipated",
            "drift",
            "consumer-5  0 behind",
            "and 3 more",
            "light-impurity · step 2 of 55,189",
            "5.00 m/s",
            "velocity from 0 s down to",
            "beads 0 to 999",
            "q quit",
        ] {
            assert!(text.contains(part), "{part} is not in\n{text}");
        }
        assert!(rows.iter().filter(|row| row.contains('▀')).count() >= 2, "{text}");
    }

    /// What came in from outside is part of the whole: energies = initial + driven.
    #[test]
    fn a_driven_chain_has_the_work_beside_all_of_its_energy() {
        let origin = Origin { program: String::new(), host: String::new(), started_unix_ns: 0 };
        let config = RunConfig::from_toml(
            "[chain]\nbeads = 2\nbead_mass_kg = 2.0\nalpha = 1.5\nstiffness = 1.0\n\
             [[bath]]\nbeads = '0..'\ntemperature_j = 1.0\nfriction_per_s = 1.0\n\
             [time]\nduration_s = 1.0\ndt_s = 0.1",
        );
        let manifest = RunManifest::new(&config.expect("valid"), "run", origin).expect("valid");
        let mut watched = Watched::new(&manifest);
        for (step, v_m_s, extra) in [(0, [0.0; 2], [0.0; 2]), (1, [3.0, -1.0], [9.0, 1.0])] {
            let time_s = manifest.physics.time_s(step);
            let frame = Frame {
                frame: step,
                step,
                time_s,
                u_m: &[0.0; 2],
                v_m_s: &v_m_s,
                extra: &extra,
                active: None,
            };
            watched.observe(&frame);
        }
        let text = rows(&Screen { watched: Some(watched), ..screen() }, 80, 24).join("\n");
        for part in ["energies (J), together 10", "driven      10", "drift"] {
            assert!(text.contains(part), "{part} is not in\n{text}");
        }
    }

    #[test]
    fn every_size_shows_what_it_can() {
        let mut screen = screen();
        let small = rows(&screen, 40, 12).join("\n");
        for part in ["running", "kinetic", "right", "step 2 of 55,189", "velocity from", "▀", "q quit"] {
            assert!(small.contains(part), "{part} is not in\n{small}");
        }
        assert!(rows(&screen, 200, 60).join("\n").contains("consumer-5"));
        screen.watched.iter_mut().for_each(|watched| watched.end(EndReason::Complete));
        assert!(rows(&screen, 80, 24).join("\n").contains("ended: complete"));
        for (columns, lines) in [(0, 0), (1, 1), (5, 3), (3, 50), (500, 2), (39, 9), (64, 18)] {
            for field in Field::ALL {
                (screen.field, screen.shows_help) = (field, lines == 9);
                assert_eq!(rows(&screen, columns, lines).len(), usize::from(lines));
            }
        }
    }

    #[test]
    fn without_a_run_the_screen_says_so() {
        let none = Screen {
            runs: Vec::new(),
            chosen: None,
            watched: None,
            notice: "no runs; start one".to_owned(),
            ..screen()
        };
        assert!(rows(&none, 80, 24).join("\n").contains("no runs; start one"));
    }

    #[test]
    fn halves_of_cells_have_colours_of_their_own() {
        let drawn = |above, below| {
            let mut cell = Cell::EMPTY;
            halves(&mut cell, above, below);
            (cell.symbol().to_owned(), cell.fg, cell.bg)
        };
        assert_eq!(drawn(Color::Red, Color::Blue), ("▀".into(), Color::Red, Color::Blue));
        assert_eq!(drawn(Color::Reset, Color::Blue), ("▄".into(), Color::Blue, Color::Reset));
        assert_eq!(drawn(Color::Reset, Color::Reset).0, " ");
    }
}

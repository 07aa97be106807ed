//! Layout of a figure: sizes of the look, margins from the real width of the text, heights of panels.

use super::axis::Axis;
use super::colour_scale::BarTicks;
use super::legend::{self, Row};
use super::look::{LEADING, Look};
use super::panel::Panel;
use super::scale::{Margin, Scale};
use super::sheet::Rect;
use super::text::{CAP_HEIGHT, width, wrap};
use super::ticks::{Ticks, label_with_factor};
use super::{Figure, Size};

/// Axes are no lower than this, in units of the numbers' size; the figure grows instead.
const LOWEST: f64 = 5.0;

/// A panel with all that is needed to draw it.
#[derive(Debug)]
pub(super) struct Placed<'a> {
    pub(super) panel: &'a Panel,
    pub(super) x: Scale,
    pub(super) y: Scale,
    pub(super) x_ticks: Ticks,
    pub(super) y_ticks: Ticks,
    pub(super) x_label: Vec<String>,
    pub(super) y_label: Vec<String>,
    pub(super) legend: Vec<Row>,
    /// Beside the axes, if there is a raster of numbers.
    pub(super) bar: Option<Bar>,
    /// True if numbers and label are written below.
    pub(super) has_x_text: bool,
    /// The axes.
    pub(super) frame: Rect,
    /// Distance from the axes leftwards to the baseline of the y label's last line: the same for all panels.
    pub(super) y_label_distance: f64,
}

impl Placed<'_> {
    /// Height of legend and title above the axes.
    pub(super) fn head_height(&self, look: &Look) -> f64 {
        let rows = self.legend.len().max(usize::from(!self.panel.title.is_empty()));
        legend::height(rows, look.label)
    }
}

/// A colour bar with its text.
#[derive(Debug, Default)]
pub(super) struct Bar {
    pub(super) ticks: BarTicks,
    pub(super) label: Vec<String>,
}

impl Bar {
    /// The bar beside a panel of this height.
    fn of(panel: &Panel, height: f64, look: &Look) -> Option<Self> {
        let scale = panel.raster.as_ref()?.scale.as_ref()?;
        let ticks = scale.ticks(y_count(height, look) + 2);
        let label = wrap(&label_with_factor(&scale.label, ticks.exponent), look.label, height);
        Some(Self { ticks, label })
    }

    /// Distance from the axes to the right end of the numbers.
    pub(super) fn numbers_end(&self, look: &Look) -> f64 {
        let widths = self.ticks.numbers.iter().map(|(_, label)| width(label, look.number));
        look.bar_gap()
            + look.bar_width()
            + look.tick_length()
            + look.number_gap()
            + widths.fold(0.0, f64::max)
    }

    /// Distance from the axes to the right end of everything.
    fn width(&self, look: &Look) -> f64 {
        self.numbers_end(look) + (self.label.len() as f64 * LEADING + 0.4) * look.label
    }
}

/// A figure laid out.
#[derive(Debug)]
pub(super) struct Layout<'a> {
    pub(super) look: Look,
    pub(super) panels: Vec<Placed<'a>>,
    pub(super) caption: Vec<String>,
    /// Upper edge of the caption.
    pub(super) caption_y: f64,
    pub(super) height: f64,
}

impl<'a> Layout<'a> {
    /// Makes the layout. With `dots_per_point` the axes lie on whole device dots, so that they come out sharp.
    pub(super) fn new(figure: &'a Figure, size: Size, dots_per_point: Option<f64>) -> Self {
        let look = Look::of(size);
        let wanted = figure.panels.iter().map(|panel| look.wanted_height(figure, panel));
        let first = Self::with_heights(figure, look, &wanted.collect::<Vec<_>>());
        // Where the height is scarce, text is wrapped once more for the height there is.
        let heights = first.panels.iter().map(|placed| placed.frame.height);
        let mut layout = Self::with_heights(figure, look, &heights.collect::<Vec<_>>());
        layout.stack(dots_per_point);
        layout
    }

    /// Panels of about these heights, with margins for the text that these lead to.
    fn with_heights(figure: &'a Figure, look: Look, heights: &[f64]) -> Self {
        let mut panels = scaled_panels(figure, &look, heights);
        let left = set_left_margin(&mut panels, &look);
        let right = set_x_ticks(&mut panels, &look, left);
        for placed in &mut panels {
            placed.frame.x = left;
            placed.frame.width = look.width - left - right;
            let factor = placed.x_ticks.exponent;
            let label = label_with_factor(&placed.panel.x.label, factor);
            placed.x_label = wrap(&label, look.label, placed.frame.width);
            placed.legend = legend::rows(placed.panel, look.label, placed.frame.width);
        }
        let caption = wrap(&figure.caption, look.caption, look.width - 2.0 * look.pad());
        let mut layout = Self { look, panels, caption, caption_y: 0.0, height: 0.0 };
        layout.fit_heights();
        layout
    }

    /// Shares what the text leaves of the height among the axes.
    fn fit_heights(&mut self) {
        let look = self.look;
        let axes: f64 = self.panels.iter().map(|placed| placed.frame.height).sum();
        let text = self.stack(None) - axes;
        let room = look.height - text;
        if axes <= 0.0 || (axes <= room && !look.fixed_height) {
            return;
        }
        let mut heights: Vec<f64> = self.panels.iter().map(|placed| placed.frame.height).collect();
        share(&mut heights, room, LOWEST * look.number);
        for (placed, height) in self.panels.iter_mut().zip(heights) {
            placed.frame.height = height;
            placed.y_ticks = placed.y.ticks(y_count(placed.frame.height, &look));
            placed.bar = Bar::of(placed.panel, placed.frame.height, &look);
        }
    }

    /// Puts the panels under each other and the caption below; gives the height that this takes.
    fn stack(&mut self, dots_per_point: Option<f64>) -> f64 {
        let look = self.look;
        let snap = |place: f64| dots_per_point.map_or(place, |dots| (place * dots).round() / dots);
        let mut y = look.pad();
        for (index, placed) in self.panels.iter_mut().enumerate() {
            if index > 0 {
                y += 0.7 * look.label;
            }
            y += placed.head_height(&look);
            let bottom = snap(y + placed.frame.height);
            let right = snap(placed.frame.right());
            placed.frame.y = snap(y);
            placed.frame.height = bottom - placed.frame.y;
            placed.frame.x = snap(placed.frame.x);
            placed.frame.width = right - placed.frame.x;
            y = bottom + look.tick_length();
            if placed.has_x_text {
                y += look.number_gap() + look.number * CAP_HEIGHT;
                y += placed.x_label.len() as f64 * look.label * LEADING + 0.15 * look.label;
            }
        }
        if !self.caption.is_empty() {
            y += 0.7 * look.label;
            self.caption_y = y;
            y += self.caption.len() as f64 * look.caption * LEADING;
        }
        let taken = y + look.pad();
        // axes that begin and end on whole dots may take a dot more
        let exceeds = taken > look.height + 1.0;
        self.height = if look.fixed_height && !exceeds { look.height } else { taken };
        taken
    }
}

/// Scales heights to `room` in all, but none below `lowest`.
fn share(heights: &mut [f64], room: f64, lowest: f64) {
    let mut is_low = vec![false; heights.len()];
    // each turn but the last finds another that is too low
    for _ in 0..heights.len() {
        let low = is_low.iter().filter(|low| **low).count() as f64;
        let free: f64 = heights.iter().zip(&is_low).filter(|(_, low)| !**low).map(|(height, _)| height).sum();
        let factor = (room - low * lowest) / free;
        let found = (0..heights.len()).find(|index| !is_low[*index] && heights[*index] * factor < lowest);
        let Some(index) = found else {
            for (height, low) in heights.iter_mut().zip(&is_low) {
                *height = if *low { lowest } else { *height * factor };
            }
            return;
        };
        is_low[index] = true;
    }
    heights.fill(lowest);
}

/// The panels with their scales and y ticks.
fn scaled_panels<'a>(figure: &'a Figure, look: &Look, heights: &[f64]) -> Vec<Placed<'a>> {
    let last = figure.panels.len().saturating_sub(1);
    let place = |(index, (panel, &height)): (usize, (&'a Panel, &f64))| {
        let x = if figure.shared_x {
            shared_x_scale(figure, &panel.x)
        } else {
            Scale::new(&panel.x, panel.x_values(), panel.x_room())
        };
        let y = Scale::new(&panel.y, panel.y_values(), panel.y_room());
        let y_ticks = y.ticks(y_count(height, look));
        let y_label = label_with_factor(&panel.y.label, y_ticks.exponent);
        Placed {
            panel,
            x,
            y,
            x_ticks: x.ticks(4),
            y_label: wrap(&y_label, look.label, height),
            y_ticks,
            x_label: Vec::new(),
            legend: Vec::new(),
            bar: Bar::of(panel, height, look),
            has_x_text: !figure.shared_x || index == last,
            frame: Rect { x: 0.0, y: 0.0, width: 0.0, height },
            y_label_distance: 0.0,
        }
    };
    figure.panels.iter().zip(heights).enumerate().map(place).collect()
}

/// One scale for all panels: the limits that the first panel with limits sets, or what all of them show.
fn shared_x_scale(figure: &Figure, own: &Axis) -> Scale {
    let mut axis = own.clone();
    axis.limits = figure.panels.iter().find_map(|panel| panel.x.limits);
    let values = figure.panels.iter().flat_map(Panel::x_values);
    // A raster's edges are the axes' edges; else the panel with markers, if any, needs the most room.
    let rooms = || figure.panels.iter().map(Panel::x_room);
    let room =
        [Margin::Nothing, Margin::Part(0.04)].into_iter().find(|room| rooms().any(|other| other == *room));
    Scale::new(&axis, values, room.unwrap_or(Margin::ToRound))
}

/// Number of numbers that fit on a y axis of this height in comfort.
fn y_count(height: f64, look: &Look) -> usize {
    // A small positive number.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let count = (height / (2.6 * look.number)).round() as usize;
    count.clamp(2, 8)
}

fn widest(ticks: &Ticks, size: f64) -> f64 {
    let widths = ticks.major.iter().map(|(_, label)| width(label, size));
    widths.fold(0.0, f64::max)
}

/// Gives all y labels one distance from the axes, beyond the widest number; returns the left margin.
fn set_left_margin(panels: &mut [Placed<'_>], look: &Look) -> f64 {
    let largest = |value: &dyn Fn(&Placed<'_>) -> f64| panels.iter().map(value).fold(0.0, f64::max);
    let numbers = largest(&|placed| widest(&placed.y_ticks, look.number));
    let half_number = 0.5 * largest(&|placed| widest(&placed.x_ticks, look.number));
    let lines = largest(&|placed| placed.y_label.len() as f64);
    let distance = look.tick_length() + look.number_gap() + numbers + 0.6 * look.label;
    for placed in &mut *panels {
        placed.y_label_distance = distance;
    }
    (distance + lines * LEADING * look.label).max(half_number + look.pad())
}

/// Gives each x axis as many numbers as fit side by side; returns the right margin.
fn set_x_ticks(panels: &mut [Placed<'_>], look: &Look, left: f64) -> f64 {
    let bars = panels.iter().filter_map(|placed| placed.bar.as_ref());
    let mut right = bars.map(|bar| bar.width(look)).fold(look.pad(), f64::max);
    let room = look.width - left - right;
    for placed in panels {
        let fitting = (2..=9).rev().map(|count| placed.x.ticks(count)).find(|ticks| {
            let slot = room / ticks.major.len().max(1) as f64;
            widest(ticks, look.number) + 1.6 * look.number <= slot
        });
        placed.x_ticks = fitting.unwrap_or_else(|| placed.x.ticks(1));
        for (fraction, label) in &placed.x_ticks.major {
            let beyond = 0.5 * width(label, look.number) - (1.0 - fraction) * room;
            right = right.max(beyond + 0.3 * look.label);
        }
    }
    right
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn low_panels_stay_readable_and_the_others_share_the_rest() {
        let shared = |heights: &[f64], room| {
            let mut heights = heights.to_vec();
            share(&mut heights, room, 10.0);
            heights
        };
        assert_eq!(shared(&[100.0, 50.0], 75.0), [50.0, 25.0]);
        assert_eq!(shared(&[100.0, 10.0], 55.0), [45.0, 10.0]);
        assert_eq!(shared(&[100.0, 10.0, 50.0], 40.0), [20.0, 10.0, 10.0]);
        assert_eq!(shared(&[30.0, 30.0], 5.0), [10.0, 10.0]);
    }
}

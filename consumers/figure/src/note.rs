//! A short text inside the axes, in the corner where it hides least.

use super::look::{LEADING, Look};
use super::sheet::{Anchor, Rect, Sheet};
use super::style::Colour;
use super::text::{CAP_HEIGHT, width, wrap};

/// Draws `note` into a corner of `frame` that the lines and dots of `drawn` avoid as far as possible.
pub(super) fn draw(sheet: &mut Sheet, note: &str, frame: Rect, drawn: &[Vec<(f64, f64)>], look: &Look) {
    let size = 0.94 * look.label;
    let pad = 0.4 * size;
    let lines = wrap(note, size, 0.6 * frame.width);
    if lines.is_empty() {
        return;
    }
    let text_width = lines.iter().map(|line| width(line, size)).fold(0.0, f64::max);
    let (across, down) = (text_width + 2.0 * pad, lines.len() as f64 * LEADING * size + pad);
    let inset = 0.45 * size;
    let left = frame.x + inset;
    let right = frame.right() - inset - across;
    let top = frame.y + inset;
    let bottom = frame.bottom() - inset - down;
    let corners = [(right, top), (left, top), (right, bottom), (left, bottom)];
    let boxes = corners.map(|(x, y)| Rect { x, y, width: across, height: down });
    let hidden = boxes.map(|corner| length_inside(corner, drawn));
    let mut best = 0;
    for corner in 1..boxes.len() {
        if hidden[corner] < hidden[best] {
            best = corner;
        }
    }
    let chosen = boxes[best];
    sheet.fill(chosen, Colour::White, 0.85);
    for (index, line) in lines.iter().enumerate() {
        let middle = chosen.y + 0.5 * pad + (index as f64 + 0.5) * LEADING * size;
        let place = (chosen.x + pad, middle + 0.5 * CAP_HEIGHT * size);
        sheet.text(place, Anchor::Start, (size, Colour::Black), line);
    }
}

/// About how many points of line, and how many dots, lie in a rectangle.
fn length_inside(rect: Rect, drawn: &[Vec<(f64, f64)>]) -> usize {
    const STRIDE: f64 = 1.0;
    let inside =
        |x: f64, y: f64| (rect.x..=rect.right()).contains(&x) && (rect.y..=rect.bottom()).contains(&y);
    let mut count = 0;
    for line in drawn {
        count += line.iter().filter(|(x, y)| inside(*x, *y)).count();
        for pair in line.windows(2) {
            let [(x0, y0), (x1, y1)] = [pair[0], pair[1]];
            let distance = (x1 - x0).hypot(y1 - y0);
            // Bounded: places lie within a few thousand points of the page.
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
            let steps = (distance / STRIDE) as u32;
            let between = (1..steps).map(|step| f64::from(step) / f64::from(steps));
            count += between.filter(|part| inside(x0 + part * (x1 - x0), y0 + part * (y1 - y0))).count();
        }
    }
    count
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_through_a_rectangle_counts_even_without_points_in_it() {
        let rect = Rect { x: 10.0, y: 10.0, width: 20.0, height: 10.0 };
        let through = vec![vec![(0.0, 15.0), (100.0, 15.0)]];
        assert_eq!(length_inside(rect, &through), 21);
        assert_eq!(length_inside(rect, &[vec![(0.0, 5.0), (100.0, 5.0)]]), 0);
    }
}

//! The few SVG elements that figures are made of. Lengths are points (1/72 inch), y grows downwards.

use std::fmt::Write;

use super::style::{Colour, Stroke};
use super::text;

/// A rectangle by its upper left corner.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Rect {
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) width: f64,
    pub(super) height: f64,
}

impl Rect {
    pub(super) fn right(&self) -> f64 {
        self.x + self.width
    }

    pub(super) fn bottom(&self) -> f64 {
        self.y + self.height
    }

    /// As SVG writes it.
    fn attributes(&self) -> String {
        let [x, y, width, height] = [self.x, self.y, self.width, self.height].map(number);
        format!(r#"x="{x}" y="{y}" width="{width}" height="{height}""#)
    }
}

/// Where a text's position lies in it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

/// A pen: colour, width, gaps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Pen {
    pub(super) colour: Colour,
    pub(super) width: f64,
    pub(super) stroke: Stroke,
}

impl Pen {
    pub(super) fn solid(colour: Colour, width: f64) -> Self {
        Self { colour, width, stroke: Stroke::Solid }
    }
}

/// A document in the making.
#[derive(Debug, Default)]
pub(super) struct Svg {
    body: String,
}

/// A coordinate with two decimals (7 µm), shortest form.
pub(super) fn number(value: f64) -> String {
    let text = format!("{value:.2}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    match text {
        "-0" => "0".to_owned(),
        other => other.to_owned(),
    }
}

impl Svg {
    fn push(&mut self, element: std::fmt::Arguments<'_>) {
        // Writing to a String cannot fail.
        let _ = self.body.write_fmt(element);
        self.body.push('\n');
    }

    pub(super) fn text(
        &mut self,
        (x, y): (f64, f64),
        anchor: Anchor,
        (size, colour): (f64, Colour),
        content: &str,
    ) {
        let place = format!(r#"x="{}" y="{}""#, number(x), number(y));
        self.place_text(&place, anchor, (size, colour), content);
    }

    /// Text that reads upwards; `(x, y)` is on its baseline.
    pub(super) fn text_upwards(&mut self, (x, y): (f64, f64), (size, colour): (f64, Colour), content: &str) {
        let place = format!(r#"transform="translate({} {}) rotate(-90)""#, number(x), number(y));
        self.place_text(&place, Anchor::Middle, (size, colour), content);
    }

    fn place_text(&mut self, place: &str, anchor: Anchor, pen: (f64, Colour), content: &str) {
        let anchor = match anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        let (size, colour) = pen;
        self.push(format_args!(
            r#"<text {place} text-anchor="{anchor}" font-size="{}" fill="{}">{}</text>"#,
            number(size),
            colour.hex(),
            text::spans(content, size)
        ));
    }

    /// A filled rectangle, `opacity` from 0 to 1.
    pub(super) fn fill(&mut self, rect: Rect, colour: Colour, opacity: f64) {
        self.push(format_args!(
            r#"<rect {} fill="{}" fill-opacity="{}"/>"#,
            rect.attributes(),
            colour.hex(),
            number(opacity)
        ));
    }

    /// The outline of a rectangle.
    pub(super) fn outline(&mut self, rect: Rect, pen: Pen) {
        self.push(format_args!(r#"<rect {} fill="none" {}/>"#, rect.attributes(), stroke(pen)));
    }

    /// A drawn path; `path` as in SVG's `d`.
    pub(super) fn path(&mut self, path: &str, pen: Pen) {
        self.push(format_args!(
            r#"<path d="{path}" fill="none" stroke-linejoin="round" stroke-linecap="{}" {}/>"#,
            if pen.stroke == Stroke::Dashed { "butt" } else { "round" },
            stroke(pen)
        ));
    }

    /// A path with its inside filled and a hairline of white around, which keeps neighbours apart.
    pub(super) fn area(&mut self, path: &str, colour: Colour, rim: f64) {
        self.push(format_args!(
            r##"<path d="{path}" fill="{}" stroke="#ffffff" stroke-width="{}"/>"##,
            colour.hex(),
            number(rim)
        ));
    }

    /// The inside of a path, `opacity` from 0 to 1.
    pub(super) fn tinted(&mut self, path: &str, colour: Colour, opacity: f64) {
        let (fill, opacity) = (colour.hex(), number(opacity));
        self.push(format_args!(r#"<path d="{path}" fill="{fill}" fill-opacity="{opacity}"/>"#));
    }

    pub(super) fn line(&mut self, from: (f64, f64), to: (f64, f64), pen: Pen) {
        self.push(format_args!(
            r#"<line x1="{}" y1="{}" x2="{}" y2="{}" {}/>"#,
            number(from.0),
            number(from.1),
            number(to.0),
            number(to.1),
            stroke(pen)
        ));
    }

    /// An image stretched over a rectangle, its cells kept as sharp squares.
    pub(super) fn image(&mut self, rect: Rect, data_uri: &str) {
        self.push(format_args!(
            concat!(
                r#"<image {} preserveAspectRatio="none" "#,
                r#"image-rendering="optimizeSpeed" style="image-rendering:pixelated" xlink:href="{}"/>"#
            ),
            rect.attributes(),
            data_uri
        ));
    }

    /// What follows, up to [`Svg::end_clip`], is cut off outside of a rectangle. Its id is made of the
    /// rectangle, so that two figures in one HTML page can share an id only where they mean the same.
    pub(super) fn begin_clip(&mut self, rect: Rect) {
        let id = [rect.x, rect.y, rect.width, rect.height].map(number).join("_");
        let sides = rect.attributes();
        self.push(format_args!(
            r#"<clipPath id="clip_{id}"><rect {sides}/></clipPath><g clip-path="url(#clip_{id})">"#
        ));
    }

    pub(super) fn end_clip(&mut self) {
        self.push(format_args!("</g>"));
    }

    /// The whole document, in points, on white.
    pub(super) fn finish(self, width: f64, height: f64) -> String {
        let (width, height) = (number(width), number(height));
        format!(
            concat!(
                r#"<svg xmlns="http://www.w3.org/2000/svg" "#,
                // Programs older than SVG 2 find images by xlink only.
                r#"xmlns:xlink="http://www.w3.org/1999/xlink" width="{w}pt" height="{h}pt" "#,
                r#"viewBox="0 0 {w} {h}" font-family="{family}" xml:space="preserve">"#,
                "\n<rect width=\"{w}\" height=\"{h}\" fill=\"#ffffff\"/>\n{body}</svg>\n"
            ),
            w = width,
            h = height,
            family = text::FAMILIES,
            body = self.body
        )
    }
}

fn stroke(pen: Pen) -> String {
    let dashes = match pen.stroke {
        Stroke::Solid => String::new(),
        Stroke::Dashed => {
            format!(r#" stroke-dasharray="{} {}""#, number(pen.width * 5.0), number(pen.width * 3.0))
        }
        // With round caps a dash of no length is a dot.
        Stroke::Dotted => format!(r#" stroke-dasharray="0.01 {}""#, number(pen.width * 2.5)),
    };
    format!(r#"stroke="{}" stroke-width="{}"{dashes}"#, pen.colour.hex(), number(pen.width))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coordinates_are_short() {
        let texts = [1.0, 0.10, -0.001, 12.346, -3.5].map(number);
        assert_eq!(texts, ["1", "0.1", "0", "12.35", "-3.5"]);
    }
}

//! A sheet as SVG.

use std::fmt::Write;

use base64::Engine;

use super::FigureError;
use super::path::Step;
use super::sheet::{Anchor, Element, Outline, Pen, Rect, Shape, Sheet, Text};
use super::style::Stroke;
use super::{picture, text};

/// A coordinate with two decimals (7 µm), shortest form.
fn number(value: f64) -> String {
    let text = format!("{value:.2}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    match text {
        "-0" => "0".to_owned(),
        other => other.to_owned(),
    }
}

/// The whole document.
pub(super) fn document(sheet: &Sheet) -> Result<String, FigureError> {
    let mut body = String::new();
    for element in &sheet.elements {
        body += &written(element)?;
        body.push('\n');
    }
    Ok(format!(
        concat!(
            r#"<svg xmlns="http://www.w3.org/2000/svg" "#,
            // Programs older than SVG 2 find images by xlink only.
            r#"xmlns:xlink="http://www.w3.org/1999/xlink" width="{w}pt" height="{h}pt" "#,
            r#"viewBox="0 0 {w} {h}" font-family="{family}" xml:space="preserve">"#,
            "\n<rect width=\"{w}\" height=\"{h}\" fill=\"#ffffff\"/>\n{body}</svg>\n"
        ),
        w = number(sheet.width),
        h = number(sheet.height),
        family = text::FAMILIES,
        body = body,
    ))
}

fn written(element: &Element) -> Result<String, FigureError> {
    Ok(match element {
        Element::Shape(shape) => shape_element(shape),
        Element::Text(text) => text_element(text),
        Element::Image(rect, cells) => image_element(*rect, &picture::png_of(cells)?),
        // Its id is made of the rectangle, so that two figures in one HTML page can share an id only where they mean the
        // same.
        Element::Clip(rect) => {
            let id = [rect.x, rect.y, rect.width, rect.height].map(number).join("_");
            let sides = attributes(*rect);
            format!(r#"<clipPath id="clip_{id}"><rect {sides}/></clipPath><g clip-path="url(#clip_{id})">"#)
        }
        Element::EndClip => "</g>".to_owned(),
    })
}

fn attributes(rect: Rect) -> String {
    let [x, y, width, height] = [rect.x, rect.y, rect.width, rect.height].map(number);
    format!(r#"x="{x}" y="{y}" width="{width}" height="{height}""#)
}

fn shape_element(shape: &Shape) -> String {
    let mut element = match &shape.outline {
        Outline::Rect(rect) => format!("<rect {}", attributes(*rect)),
        Outline::Line(from, to) => {
            let [x1, y1, x2, y2] = [from.0, from.1, to.0, to.1].map(number);
            format!(r#"<line x1="{x1}" y1="{y1}" x2="{x2}" y2="{y2}""#)
        }
        Outline::Path(steps) => format!(r#"<path d="{}""#, data(steps)),
    };
    // writing to a String cannot fail
    let _ = match shape.fill {
        Some((colour, 1.0)) => write!(element, r#" fill="{}""#, colour.hex()),
        Some((colour, opacity)) => {
            write!(element, r#" fill="{}" fill-opacity="{}""#, colour.hex(), number(opacity))
        }
        None if matches!(shape.outline, Outline::Line(..)) => Ok(()),
        None => write!(element, r#" fill="none""#),
    };
    if let Some(pen) = shape.pen {
        if shape.is_round() {
            let cap = if pen.stroke == Stroke::Dashed { "butt" } else { "round" };
            let _ = write!(element, r#" stroke-linejoin="round" stroke-linecap="{cap}""#);
        }
        element += &stroke(pen);
    }
    element + "/>"
}

fn stroke(pen: Pen) -> String {
    let colour = pen.colour.hex();
    let dashes =
        pen.dashes().map(|[dash, gap]| format!(r#" stroke-dasharray="{} {}""#, number(dash), number(gap)));
    format!(r#" stroke="{colour}" stroke-width="{}"{}"#, number(pen.width), dashes.unwrap_or_default())
}

fn data(steps: &[Step]) -> String {
    let mut data = String::new();
    let mut in_line = false;
    for step in steps {
        // writing to a String cannot fail
        let _ = match *step {
            Step::Move(x, y) => write!(data, "M{} {}", number(x), number(y)),
            Step::Line(x, y) => {
                write!(data, "{}{} {}", if in_line { " " } else { "L" }, number(x), number(y))
            }
            Step::Circle { x, y, radius } => {
                let [left, y, r, across] = [x - radius, y, radius, 2.0 * radius].map(number);
                write!(data, "M{left} {y}a{r} {r} 0 1 0 {across} 0a{r} {r} 0 1 0 -{across} 0z")
            }
            Step::Close => write!(data, "z"),
        };
        in_line = matches!(step, Step::Line(..));
    }
    data
}

fn text_element(text: &Text) -> String {
    let [x, y] = [text.place.0, text.place.1].map(number);
    let place = if text.is_upwards {
        format!(r#"transform="translate({x} {y}) rotate(-90)""#)
    } else {
        format!(r#"x="{x}" y="{y}""#)
    };
    let anchor = match text.anchor {
        Anchor::Start => "start",
        Anchor::Middle => "middle",
        Anchor::End => "end",
    };
    format!(
        r#"<text {place} text-anchor="{anchor}" font-size="{}" fill="{}">{}</text>"#,
        number(text.size),
        text.colour.hex(),
        text::spans(&text.content, text.size)
    )
}

fn image_element(rect: Rect, png: &[u8]) -> String {
    format!(
        concat!(
            r#"<image {} preserveAspectRatio="none" image-rendering="optimizeSpeed" "#,
            r#"style="image-rendering:pixelated" xlink:href="data:image/png;base64,{}"/>"#
        ),
        attributes(rect),
        base64::engine::general_purpose::STANDARD.encode(png)
    )
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

//! Pictures one after the other in one file: as GIF, or as PNG with all of their colours. A picture is stored as the
//! dots that differ from the picture before.

use super::scene::Dots;
use gif::{EncodingError, Repeat};
use png::{BitDepth, BlendOp, ColorType, Compression};
use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};
use std::io::{self, Write};

/// A rectangle of dots: left, top, width, height.
type Place = [u32; 4];

/// The smallest rectangle with all dots in which two pictures differ, of one dot where they do not.
fn changed(before: &Dots, after: &Dots) -> Place {
    let row_bytes = 4 * after.width as usize;
    let rows = || before.rgba.chunks_exact(row_bytes).zip(after.rgba.chunks_exact(row_bytes));
    let (mut left, mut right, mut top, mut bottom) = (after.width, 0, after.height, 0);
    for (row, (before, after)) in (0..).zip(rows()).filter(|(_, (before, after))| before != after) {
        let dots = || (0..).zip(before.as_chunks::<4>().0.iter().zip(after.as_chunks::<4>().0));
        let mut columns = dots().filter(|(_, (before, after))| before != after).map(|(column, _)| column);
        let first: u32 = columns.next().unwrap_or(0);
        let last = columns.last().unwrap_or(first);
        (left, right) = (left.min(first), right.max(last));
        (top, bottom) = (top.min(row), row);
    }
    if left > right { [0, 0, 1, 1] } else { [left, top, right - left + 1, bottom - top + 1] }
}

/// The dots at `place`, each with its dot in the picture before; without one, all are new.
fn dots_at<'a>(
    before: Option<&'a Dots>,
    after: &'a Dots,
    [left, top, width, height]: Place,
) -> impl Iterator<Item = (Option<[u8; 4]>, [u8; 4])> + 'a {
    let row_of = move |dots: &'a Dots, row: u32| {
        let begin = (row * dots.width + left) as usize;
        &dots.rgba.as_chunks::<4>().0[begin..begin + width as usize]
    };
    (top..top + height).flat_map(move |row| {
        let old = before.map(|before| row_of(before, row));
        row_of(after, row).iter().enumerate().map(move |(index, dot)| (old.map(|old| old[index]), *dot))
    })
}

/// The part of `after` that is stored, and that part's place.
fn place_of(before: Option<&Dots>, after: &Dots) -> Place {
    before.map_or([0, 0, after.width, after.height], |before| changed(before, after))
}

/// An animated PNG in the making.
pub struct Apng<W: Write> {
    writer: png::Writer<W>,
    before: Option<Dots>,
}

impl<W: Write> Apng<W> {
    /// One of so many pictures of (width, height) dots, `per_second` of them a second, shown again and again.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn new(to: W, (width, height): (u32, u32), count: u32, per_second: u16) -> io::Result<Self> {
        let mut encoder = png::Encoder::new(to, width, height);
        encoder.set_color(ColorType::Rgba);
        encoder.set_depth(BitDepth::Eight);
        encoder.set_compression(Compression::Balanced);
        encoder.set_animated(count, 0)?;
        encoder.set_frame_delay(1, per_second)?;
        encoder.set_blend_op(BlendOp::Over)?;
        Ok(Self { writer: encoder.write_header()?, before: None })
    }

    /// Adds the next picture.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn push(&mut self, picture: Dots) -> io::Result<()> {
        let place = place_of(self.before.as_ref(), &picture);
        let [left, top, width, height] = place;
        if self.before.is_some() {
            // the position first: a frame must fit at any time
            self.writer.reset_frame_position()?;
            self.writer.set_frame_dimension(width, height)?;
            self.writer.set_frame_position(left, top)?;
        }
        let dots = dots_at(self.before.as_ref(), &picture, place);
        let new = dots.flat_map(|(old, dot)| if old == Some(dot) { [0; 4] } else { dot });
        self.writer.write_image_data(&new.collect::<Vec<_>>())?;
        self.before = Some(picture);
        Ok(())
    }

    /// Writes the end.
    ///
    /// # Errors
    /// When it cannot be written, or when a picture is missing.
    pub fn finish(self) -> io::Result<()> {
        Ok(self.writer.finish()?)
    }
}

/// Colours of all pictures of a GIF: as many as it holds, with an entry for dots that stay.
#[derive(Debug)]
struct Palette {
    rgb: Vec<u8>,
    /// The entry of each colour, of which six bits count.
    nearest: Vec<u8>,
}

impl Palette {
    /// Entry of dots that stay as they are.
    const STAYS: u8 = 255;

    /// The most frequent colours of a picture, one of those that differ by little; white and black are among them.
    fn of(picture: &Dots) -> Self {
        let mut counts = BTreeMap::<[u8; 3], u32>::new();
        for [red, green, blue, _] in picture.rgba.as_chunks::<4>().0 {
            *counts.entry([*red, *green, *blue]).or_default() += 1;
        }
        let mut colours: Vec<_> = counts.into_iter().collect();
        colours.sort_by_key(|(_, count)| Reverse(*count));
        let mut seen = BTreeSet::new();
        colours.retain(|(colour, _)| seen.insert(colour.map(|part| part >> 3)));
        colours.truncate(usize::from(Self::STAYS) - 2);
        let mut rgb: Vec<u8> = colours.into_iter().flat_map(|(colour, _)| colour).collect();
        rgb.extend([255, 255, 255, 0, 0, 0]);
        let entries: Vec<[i32; 3]> =
            rgb.as_chunks::<3>().0.iter().map(|entry| entry.map(i32::from)).collect();
        let nearest = (0..1 << 18).map(|colour: i32| {
            let wide = |bits: i32| bits << 2 | bits >> 4;
            let colour = [12, 6, 0].map(|shift| wide(colour >> shift & 63));
            let distance =
                |entry: &[i32; 3]| (0..3).map(|part| (entry[part] - colour[part]).pow(2)).sum::<i32>();
            let found = (0..Self::STAYS).zip(&entries).min_by_key(|(_, entry)| distance(entry));
            found.map_or(0, |(index, _)| index)
        });
        let nearest = nearest.collect();
        rgb.resize(3 * 256, 0);
        Self { rgb, nearest }
    }

    fn entry([red, green, blue, _]: [u8; 4]) -> usize {
        let bits = |part: u8| usize::from(part >> 2);
        bits(red) << 12 | bits(green) << 6 | bits(blue)
    }
}

fn side(length: u32) -> io::Result<u16> {
    u16::try_from(length).map_err(io::Error::other)
}

fn refused(error: EncodingError) -> io::Error {
    match error {
        EncodingError::Io(error) => error,
        other => io::Error::other(other),
    }
}

/// A GIF in the making, shown again and again.
pub struct Gif<W: Write> {
    encoder: gif::Encoder<W>,
    palette: Palette,
    /// Hundredths of a second for which a picture is shown.
    delay: u16,
    before: Option<Dots>,
}

impl<W: Write> Gif<W> {
    /// One of pictures that are as large and have about the colours of `sample`, `per_second` of them a second.
    ///
    /// # Errors
    /// When it cannot be written, or a side has more than 65,535 dots.
    pub fn new(to: W, sample: &Dots, per_second: u16) -> io::Result<Self> {
        let palette = Palette::of(sample);
        let (width, height) = (side(sample.width)?, side(sample.height)?);
        let mut encoder = gif::Encoder::new(to, width, height, &palette.rgb).map_err(refused)?;
        encoder.set_repeat(Repeat::Infinite).map_err(refused)?;
        Ok(Self { encoder, palette, delay: 100 / per_second, before: None })
    }

    /// Adds the next picture.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn push(&mut self, picture: Dots) -> io::Result<()> {
        let place = place_of(self.before.as_ref(), &picture);
        let entry = |(old, dot): (Option<[u8; 4]>, [u8; 4])| {
            if old == Some(dot) { Palette::STAYS } else { self.palette.nearest[Palette::entry(dot)] }
        };
        let entries: Vec<u8> = dots_at(self.before.as_ref(), &picture, place).map(entry).collect();
        let [left, top, width, height] = place;
        let frame = gif::Frame {
            delay: self.delay,
            transparent: Some(Palette::STAYS),
            left: side(left)?,
            top: side(top)?,
            ..gif::Frame::from_indexed_pixels(side(width)?, side(height)?, entries, None)
        };
        self.encoder.write_frame(&frame).map_err(refused)?;
        self.before = Some(picture);
        Ok(())
    }

    /// Writes the end.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn finish(self) -> io::Result<()> {
        self.encoder.into_inner().map_err(refused)?.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A red square on white paper that goes down and to the right, and stays at last.
    fn pictures() -> Vec<Dots> {
        let drawn = |shift: usize| {
            let mut rgba = vec![255; 4 * 40 * 30];
            for place in
                (0..8).flat_map(|row| (0..5).map(move |column| 40 * (row + 2 * shift) + column + 3 * shift))
            {
                rgba[4 * place..4 * place + 3].copy_from_slice(&[213, 0, 0]);
            }
            Dots { width: 40, height: 30, rgba }
        };
        [0, 1, 2, 5, 5].map(drawn).into()
    }

    #[test]
    fn an_animated_png_holds_every_picture() {
        let mut file = Vec::new();
        let mut reel = Apng::new(&mut file, (40, 30), 5, 25).expect("begins");
        for picture in pictures() {
            reel.push(picture).expect("writes");
        }
        reel.finish().expect("ends");
        let mut reader = png::Decoder::new(io::Cursor::new(&file)).read_info().expect("a header");
        assert_eq!(reader.info().animation_control().map(|all| all.num_frames), Some(5));
        let mut shown = vec![0; 4 * 40 * 30];
        for picture in pictures() {
            let mut part = vec![0; reader.output_buffer_size().expect("a size")];
            reader.next_frame(&mut part).expect("a picture");
            let place = *reader.info().frame_control().expect("its place");
            for (dot, place) in
                part.as_chunks::<4>().0.iter().zip(places(place.x_offset, place.y_offset, place.width))
            {
                if dot[3] > 0 {
                    shown[4 * place..4 * place + 4].copy_from_slice(dot);
                }
            }
            assert!(shown == picture.rgba);
        }
    }

    #[test]
    fn a_gif_holds_every_picture_in_its_colours() {
        let mut file = Vec::new();
        let mut reel = Gif::new(&mut file, &pictures()[0], 25).expect("begins");
        for picture in pictures() {
            reel.push(picture).expect("writes");
        }
        reel.finish().expect("ends");
        let mut options = gif::DecodeOptions::new();
        options.set_color_output(gif::ColorOutput::RGBA);
        let mut reader = options.read_info(file.as_slice()).expect("a header");
        let mut shown = vec![0; 4 * 40 * 30];
        for picture in pictures() {
            let frame = reader.read_next_frame().expect("reads").expect("a picture");
            assert_eq!(frame.delay, 4);
            let places = places(frame.left.into(), frame.top.into(), frame.width.into());
            for (dot, place) in frame.buffer.as_chunks::<4>().0.iter().zip(places) {
                if dot[3] > 0 {
                    shown[4 * place..4 * place + 4].copy_from_slice(dot);
                }
            }
            // of two colours each has its entry, but for the two bits that do not count
            let is_near = |(a, b): (&u8, &u8)| a.abs_diff(*b) <= 3;
            assert!(shown.iter().zip(&picture.rgba).all(is_near));
        }
        assert!(reader.read_next_frame().expect("reads").is_none());
    }

    fn places(left: u32, top: u32, width: u32) -> impl Iterator<Item = usize> {
        (top..30).flat_map(move |row| (left..left + width).map(move |column| (40 * row + column) as usize))
    }
}

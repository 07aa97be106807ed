//! PNG files: rasters for embedding, and whole figures from their SVG.

use std::sync::{Arc, OnceLock};

use png::{BitDepth, ColorType, Compression, Encoder, PixelDimensions, Unit};
use resvg::{tiny_skia, usvg};

use super::{FigureError, text};

pub(super) fn failed(reason: impl std::fmt::Display) -> FigureError {
    FigureError::Render { reason: reason.to_string() }
}

/// Reads a document of this module with the bundled font only.
pub(super) fn tree(document: &str, dpi: f64) -> Result<usvg::Tree, FigureError> {
    // At most 2400, which f32 holds exactly enough.
    #[allow(clippy::cast_possible_truncation)]
    let options = usvg::Options {
        dpi: dpi as f32,
        font_family: "Liberation Sans".to_owned(),
        fontdb: fonts(),
        ..usvg::Options::default()
    };
    usvg::Tree::from_str(document, &options).map_err(failed)
}

/// Renders a document of this module.
pub(super) fn png(document: &str, dpi: f64) -> Result<Vec<u8>, FigureError> {
    let tree = tree(document, dpi)?;
    let size = tree.size().to_int_size();
    let mut pixels = tiny_skia::Pixmap::new(size.width(), size.height())
        .ok_or_else(|| failed("no room for the pixels"))?;
    // The sheet may end within a dot.
    pixels.fill(tiny_skia::Color::WHITE);
    resvg::render(&tree, tiny_skia::Transform::identity(), &mut pixels.as_mut());
    let rgb: Vec<u8> =
        pixels.pixels().iter().flat_map(|pixel| [pixel.red(), pixel.green(), pixel.blue()]).collect();
    encode_below(LARGEST_FILE, (size.width(), size.height()), &rgb, dpi)
}

/// What a figure takes at most (bytes) if fewer colours are enough for that.
const LARGEST_FILE: usize = 1_000_000;

/// The picture in all of its colours or, where that takes more than `limit` bytes, in as many as fit: 32 or 16
/// shades of red, green and blue are as good to the eye in a picture so full of detail. If even these do not fit,
/// which takes a high resolution, all colours stay.
fn encode_below(
    limit: usize,
    (width, height): (u32, u32),
    rgb: &[u8],
    dpi: f64,
) -> Result<Vec<u8>, FigureError> {
    let whole = encode_rgb(width, height, rgb, Some(dpi))?;
    if whole.len() <= limit {
        return Ok(whole);
    }
    for steps in [31, 15] {
        let coarse: Vec<u8> = rgb.iter().map(|part| coarsened(*part, steps)).collect();
        let file = encode_rgb(width, height, &coarse, Some(dpi))?;
        if file.len() <= limit {
            return Ok(file);
        }
    }
    Ok(whole)
}

/// The nearest of `steps + 1` evenly spread shades, white and black among them.
fn coarsened(part: u8, steps: u16) -> u8 {
    let step = (u16::from(part) * steps + 127) / 255;
    u8::try_from((step * 255 + steps / 2) / steps).unwrap_or(u8::MAX)
}

fn fonts() -> Arc<usvg::fontdb::Database> {
    static FONTS: OnceLock<Arc<usvg::fontdb::Database>> = OnceLock::new();
    let load = || {
        let mut fonts = usvg::fontdb::Database::new();
        fonts.load_font_data(text::FONT.to_vec());
        Arc::new(fonts)
    };
    FONTS.get_or_init(load).clone()
}

/// A PNG of `rgb`, of shape (`height`, `width`, 3); with `dpi` it states its physical size.
pub(super) fn encode_rgb(
    width: u32,
    height: u32,
    rgb: &[u8],
    dpi: Option<f64>,
) -> Result<Vec<u8>, FigureError> {
    encode((width, height), (ColorType::Rgb, BitDepth::Eight), rgb, |encoder| {
        if let Some(dpi) = dpi {
            // At most 94,488.
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
            let per_metre = (dpi / 0.0254).round() as u32;
            encoder.set_pixel_dims(Some(PixelDimensions {
                xppu: per_metre,
                yppu: per_metre,
                unit: Unit::Meter,
            }));
        }
    })
}

/// A PNG of indices into `palette` (3 bytes a colour), of shape (`height`, `width`), with as few bits a
/// cell as the palette needs.
pub(super) fn encode_palette(
    width: u32,
    height: u32,
    indices: &[u8],
    palette: Vec<u8>,
) -> Result<Vec<u8>, FigureError> {
    let (depth, bits) = match palette.len() / 3 {
        0..=2 => (BitDepth::One, 1),
        3..=4 => (BitDepth::Two, 2),
        5..=16 => (BitDepth::Four, 4),
        _ => (BitDepth::Eight, 8),
    };
    let packed: Vec<u8> = indices
        .chunks(width.max(1) as usize)
        .flat_map(|row| row.chunks(8 / bits).map(|cells| pack(cells, bits)))
        .collect();
    encode((width, height), (ColorType::Indexed, depth), &packed, |encoder| encoder.set_palette(palette))
}

/// A PNG of bytes as they are, with what `particulars` says of it.
fn encode(
    (width, height): (u32, u32),
    (color, depth): (ColorType, BitDepth),
    bytes: &[u8],
    particulars: impl FnOnce(&mut Encoder<'_, &mut Vec<u8>>),
) -> Result<Vec<u8>, FigureError> {
    let mut file = Vec::new();
    let mut encoder = Encoder::new(&mut file, width, height);
    encoder.set_color(color);
    encoder.set_depth(depth);
    encoder.set_compression(Compression::High);
    particulars(&mut encoder);
    let mut writer = encoder.write_header().map_err(failed)?;
    writer.write_image_data(bytes).map_err(failed)?;
    writer.finish().map_err(failed)?;
    Ok(file)
}

/// Up to a byte's worth of cells, the first in the highest bits.
fn pack(cells: &[u8], bits: usize) -> u8 {
    let place = |(index, cell): (usize, &u8)| cell << (8 - bits * (index + 1));
    cells.iter().enumerate().map(place).fold(0, |byte, cell| byte | cell)
}

/// Width, height and RGB of a PNG.
#[cfg(test)]
pub(super) fn decode(file: &[u8]) -> (usize, usize, Vec<[u8; 3]>) {
    let mut decoder = png::Decoder::new(std::io::Cursor::new(file));
    decoder.set_transformations(png::Transformations::EXPAND);
    let mut reader = decoder.read_info().expect("a header");
    let mut rgb = vec![0; reader.output_buffer_size().expect("a size")];
    let info = reader.next_frame(&mut rgb).expect("a frame");
    let pixels = rgb.chunks_exact(3).map(|p| [p[0], p[1], p[2]]);
    (info.width as usize, info.height as usize, pixels.collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_full_of_detail_gets_fewer_colours() {
        // the high bits of a linear congruential sequence
        let mut state = 1_u32;
        let mut noise = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            state.to_be_bytes()[0]
        };
        let rgb: Vec<u8> = (0..30_000).map(|_| noise()).collect();
        let drawn = |limit| {
            let file = encode_below(limit, (100, 100), &rgb, 72.0).expect("encodes");
            let (_, _, pixels) = decode(&file);
            (pixels.into_iter().flatten().collect::<std::collections::BTreeSet<_>>().len(), file.len())
        };
        let (all, whole_bytes) = drawn(usize::MAX);
        let (fewer, fewer_bytes) = drawn(whole_bytes - 1);
        let (fewest, _) = drawn(fewer_bytes - 1);
        assert_eq!([all, fewer, fewest, drawn(10).0], [256, 32, 16, 256]);
        assert_eq!([0, 255].map(|part| coarsened(part, 31)), [0, 255]);
    }

    #[test]
    fn packed_cells_come_back() {
        let palette = vec![0, 0, 0, 50, 50, 50, 100, 100, 100];
        let cells = [0, 1, 2, 2, 1, 2, 0, 1, 1, 0];
        let file = encode_palette(5, 2, &cells, palette).expect("encodes");
        let (width, height, rgb) = decode(&file);
        assert_eq!((width, height), (5, 2));
        let reds: Vec<u8> = rgb.iter().map(|pixel| pixel[0] / 50).collect();
        assert_eq!(reds, cells);
    }
}

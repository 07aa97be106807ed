//! Colours of velocities: white at rest, redder the faster towards larger bead numbers, bluer the other way.

/// Velocities of less than this part of the scale are white; the colours span the decades from there to the scale.
const LEAST: f32 = 1e-3;

const RED: [f32; 3] = [178.0, 24.0, 43.0];
const BLUE: [f32; 3] = [33.0, 102.0, 172.0];
const WHITE: f32 = 255.0;

/// The colour of `v` (m/s), fullest at `scale` (m/s), by the logarithm: a weak pulse is seen beside a strong one.
pub(super) fn of(v: f32, scale: f32) -> [u8; 3] {
    let part = v.abs() / scale;
    let fullness = if part > LEAST { (1.0 - part.log10() / LEAST.log10()).clamp(0.0, 1.0) } else { 0.0 };
    let full = if v > 0.0 { RED } else { BLUE };
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 255")]
    full.map(|channel| (WHITE + fullness * (channel - WHITE)).round() as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_say_which_way_and_how_fast() {
        assert_eq!(of(0.0, 5.0), [255; 3]);
        assert_eq!(of(0.004, 5.0), [255; 3]);
        assert_eq!((of(5.0, 5.0), of(7.0, 5.0)), ([178, 24, 43], [178, 24, 43]));
        assert_eq!(of(-5.0, 5.0), [33, 102, 172]);
        let [red, green, _] = of(0.5, 5.0);
        assert!(red > 178 && green > 24 && green < 255, "{red} {green}");
    }
}

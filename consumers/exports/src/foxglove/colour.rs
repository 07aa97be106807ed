//! Colours of velocities, as figures have them: white at rest, redder the faster towards larger bead numbers, bluer
//! the other way.

use figure::diverging;

/// Velocities of less than this part of the scale are white; the colours span the decades from there to the scale.
const LEAST: f64 = 1e-3;

/// Colour where nothing is known.
pub(super) const NOTHING: [u8; 3] = [0xC0; 3];

/// The colour of `v`, fullest at `scale`, by the logarithm: a weak pulse is seen beside a strong one.
pub(super) fn of(v: f64, scale: f64) -> [u8; 3] {
    let part = v.abs() / scale;
    let fullness = if part > LEAST { 1.0 - part.log10() / LEAST.log10() } else { 0.0 };
    diverging(fullness.copysign(v)).rgb()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_say_which_way_and_how_fast() {
        assert_eq!((of(0.0, 5.0), of(-0.004, 5.0)), ([255; 3], [255; 3]));
        assert_eq!(of(5.0, 5.0), of(7.0, 5.0));
        let ([red, _, blue], [other_red, _, other_blue]) = (of(5.0, 5.0), of(-5.0, 5.0));
        assert!(red > blue && other_red < other_blue);
        let brightness = |v| of(v, 5.0).map(u32::from).iter().sum::<u32>();
        assert!(brightness(0.05) > brightness(0.5) && brightness(0.5) > brightness(5.0));
    }
}

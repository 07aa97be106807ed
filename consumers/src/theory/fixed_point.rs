//! Fixed points of a smooth map of many variables that contracts, however slowly.

/// Plain iteration goes on until the map changes nothing by more than this; Newton's method takes over.
const NEAR: f64 = 1e-2;

/// Evaluations of the map: some ten while far, then three to five.
const STEP_LIMIT: usize = 60;

/// Factor by which a solution of a linear system reduces its residual.
const REDUCTION: f64 = 1e-4;

/// Directions searched for a solution of a linear system.
const DIRECTION_LIMIT: usize = 60;

/// End of an iteration.
#[derive(Debug)]
pub(super) struct Ended {
    /// The last point.
    pub(super) point: Vec<f64>,
    /// The largest component of the last step, by which the point before it was off.
    pub(super) last_step: f64,
    /// Evaluations of the map.
    pub(super) step_count: usize,
}

/// Finds `x = map(x)`: by iteration, and near it by Newton's method, until a step of it is `tolerance`
/// at most in every component. `map(x)` gives the image of x and the derivative there, a function of a direction.
///
/// Newton's steps `(1 − map′)·s = map(x) − x` are solved for by conjugate residuals, which need no more of the
/// derivative than its action, and few directions where most of the spectrum of `map′` is near 0.
///
/// # Source
/// S. C. Eisenstat, H. C. Elman and M. H. Schultz, SIAM J. Numer. Anal. 20 (1983) 345, doi:10.1137/0720023
/// (the generalised conjugate residual method).
pub(super) fn fixed_point<D: Fn(&[f64]) -> Vec<f64>>(
    start: Vec<f64>,
    tolerance: f64,
    map: impl Fn(&[f64]) -> (Vec<f64>, D),
) -> Ended {
    let mut ended = Ended { point: start, last_step: f64::INFINITY, step_count: 0 };
    while ended.last_step > tolerance && ended.step_count < STEP_LIMIT {
        let (image, derivative) = map(&ended.point);
        let mut step = difference(&image, &ended.point);
        let near = largest(&step) <= NEAR;
        if near {
            step = solve(|direction| difference(direction, &derivative(direction)), step);
        }
        subtract(&mut ended.point, -1.0, &step);
        ended.last_step = if near { largest(&step) } else { f64::INFINITY };
        ended.step_count += 1;
    }
    ended
}

/// A direction and its image under the operator, of length one and orthogonal to those of the others.
struct Direction {
    direction: Vec<f64>,
    image: Vec<f64>,
}

/// Solves `operator(s) = right_hand_side` for s, so far that the residual is reduced to [`REDUCTION`].
fn solve(operator: impl Fn(&[f64]) -> Vec<f64>, right_hand_side: Vec<f64>) -> Vec<f64> {
    let mut residual = right_hand_side;
    let mut solution = vec![0.0; residual.len()];
    let enough = REDUCTION * length(&residual);
    let mut searched: Vec<Direction> = Vec::new();
    while length(&residual) > enough && searched.len() < DIRECTION_LIMIT {
        let (mut direction, mut image) = (residual.clone(), operator(&residual));
        for earlier in &searched {
            let overlap = dot(&earlier.image, &image);
            subtract(&mut image, overlap, &earlier.image);
            subtract(&mut direction, overlap, &earlier.direction);
        }
        let norm = length(&image);
        image.iter_mut().chain(&mut direction).for_each(|value| *value /= norm);
        let share = dot(&image, &residual);
        subtract(&mut residual, share, &image);
        subtract(&mut solution, -share, &direction);
        searched.push(Direction { direction, image });
    }
    solution
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn length(a: &[f64]) -> f64 {
    dot(a, a).sqrt()
}

/// The largest absolute value, NaN if there is one.
fn largest(a: &[f64]) -> f64 {
    a.iter().fold(0.0, |largest, value| if value.abs() <= largest { largest } else { value.abs() })
}

fn difference(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

fn subtract(from: &mut [f64], factor: f64, what: &[f64]) {
    from.iter_mut().zip(what).for_each(|(value, part)| *value -= factor * part);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Contractions by 0.999 and less around 1, with a curvature: plain iteration needs 30,000 evaluations.
    #[test]
    fn slow_contractions_take_few_steps() {
        let rates = [0.999, 0.997, 0.99, 0.9, 0.1];
        let map = |x: &[f64]| {
            let away: Vec<f64> = x.iter().map(|x| x - 1.0).collect();
            let image = away.iter().zip(rates).map(|(d, rate)| 1.0 + rate * d + 1e-3 * d * d).collect();
            let derivative = move |direction: &[f64]| -> Vec<f64> {
                let slopes = away.iter().zip(rates).map(|(d, rate)| rate + 2e-3 * d);
                direction.iter().zip(slopes).map(|(direction, slope)| slope * direction).collect()
            };
            (image, derivative)
        };
        let ended = fixed_point(vec![1.1; 5], 1e-12, map);
        assert!(ended.last_step <= 1e-12 && ended.step_count < 8, "{ended:?}");
        assert!(ended.point.iter().all(|x| (x - 1.0).abs() < 1e-12));
    }
}

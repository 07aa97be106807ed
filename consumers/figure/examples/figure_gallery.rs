//! Draws one figure of each kind, at every size, from made-up data: to look at after a change of the look.
//!
//! `cargo run -p beadline-figure --example figure_gallery -- DIR`

use std::path::PathBuf;

use figure::{Axis, Colour, ColourScale, Curve, Figure, FigureError, Options, Panel, Raster, Size, Stroke};

type Figures = Vec<(&'static str, Figure)>;

const RUN: &str = "α = 1.5, k = 10⁷ N·m^{−1.5}, 1000 beads of 1 g, impurity 0.6 g at bead 500, v₀ = 5 m/s, \
                   rkn4, dt = 0.005 T, run 3f2a9c0e, beadline 0.1.0";

fn main() -> Result<(), FigureError> {
    let folder = std::env::args_os().nth(1).map_or_else(std::env::temp_dir, PathBuf::from);
    let sizes = [(Size::Column, "column", 300.0), (Size::Page, "page", 200.0), (Size::Slide, "slide", 110.0)];
    for (name, figure) in figures()? {
        for (size, label, dpi) in sizes {
            let options = Options { size, dpi };
            figure.write(&folder.join(format!("{name}-{label}.png")), options, true)?;
            figure.write(&folder.join(format!("{name}-{label}.svg")), options, true)?;
        }
    }
    Ok(())
}

fn figures() -> Result<Figures, FigureError> {
    Ok(vec![
        ("profile", profile()),
        ("energies", energies()),
        ("trajectory", trajectory()),
        ("map", contact_map()?),
        ("numbers", numbers()?),
        ("widths", widths()),
        ("awkward", awkward()),
    ])
}

/// A solitary wave of the given height and place: sin⁴ over five beads.
fn pulse(bead: f64, height: f64, centre: f64) -> f64 {
    let phase = (bead - centre) / 5.0 + 0.5;
    if (0.0..1.0).contains(&phase) { height * (std::f64::consts::PI * phase).sin().powi(4) } else { 0.0 }
}

fn profile() -> Figure {
    let velocity = |bead: f64, ahead: f64| {
        let pulses =
            [(2.45, 870.0), (1.31, 700.0), (0.74, 610.0), (0.4, 560.0), (-0.9, 180.0), (-0.35, 250.0)];
        pulses.iter().map(|(height, centre)| pulse(bead, *height, centre + ahead)).sum::<f64>()
    };
    let beads = || (0..1000).map(f64::from);
    let panel = Panel::new()
        .x_axis("bead")
        .y_axis("velocity (m/s)")
        .line("t = 60 ms", beads().map(move |bead| (bead, velocity(bead, -60.0))))
        .line("t = 64 ms", beads().map(move |bead| (bead, velocity(bead, 0.0))))
        .vertical("impurity", 500.0)
        .note("v₀ = 5 m/s");
    Figure::new().caption(RUN).panel(panel)
}

fn energies() -> Figure {
    let times = || (0..55_000).map(|frame| f64::from(frame) * 80.0 / 55_000.0);
    let step = |time: f64, at: f64| 1.0 / (1.0 + (-(time - at) * 4.0).exp());
    let ripple = |time: f64| 0.12e-3 * (time * 9.0).sin() * (-(time - 41.0).abs() / 4.0).exp();
    let left = move |time: f64| 12.5e-3 * (1.0 - 0.93 * step(time, 41.0)) - ripple(time);
    let impurity = move |time: f64| (ripple(time) * 6.0).abs() + 0.2e-3 * step(time, 42.0);
    let right = move |time: f64| 12.5e-3 - left(time) - impurity(time);
    let kinetic = move |time: f64| 7.2e-3 + 0.35e-3 * (time * 37.0).sin();
    let drift = |time: f64| 4e-13 * (time / 7.0).sin() + 1e-14 * time;
    Figure::new()
        .caption(RUN)
        .shared_x()
        .panel(
            Panel::new()
                .x_axis("time (ms)")
                .y_axis("energy (J)")
                .line("left of the impurity", times().map(move |t| (t, left(t))))
                .line("impurity", times().map(move |t| (t, impurity(t))))
                .line("right of the impurity", times().map(move |t| (t, right(t)))),
        )
        .panel(
            Panel::new()
                .x_axis("time (ms)")
                .y_axis("energy (J)")
                .line("kinetic", times().map(move |t| (t, kinetic(t))))
                .line("potential", times().map(move |t| (t, 12.5e-3 - kinetic(t))))
                .curve(Curve::line("total", times().map(|t| (t, 12.5e-3))).colour(Colour::Black)),
        )
        .panel(
            Panel::new()
                .x_axis("time (ms)")
                .y_axis("relative drift")
                .height(0.7)
                .curve(Curve::line("", times().map(move |t| (t, drift(t)))).colour(Colour::Black))
                .horizontal("", 0.0),
        )
}

fn trajectory() -> Figure {
    let turns =
        [(40.0, 0.0), (41.2, 2.31), (42.9, 2.05), (45.6, 2.62), (50.1, 2.38), (57.8, 2.71), (80.0, 2.66)];
    let events = turns[1..6].to_vec();
    let neighbour = |shift: f64| move |time: f64| shift + 2.9 / (1.0 + (-(time - 41.0) / 1.4).exp());
    let times = || (400..800).map(|tenth| f64::from(tenth) / 10.0);
    let bands = |panel: Panel| panel.band_x("both contacts open", 46.2, 49.5);
    let panel = Panel::new()
        .x_axis("time (ms)")
        .y_axis("displacement (mm)")
        .curve(
            Curve::line("left neighbour", times().map(move |t| (t, neighbour(-0.5)(t)))).colour(Colour::Grey),
        )
        .curve(
            Curve::line("right neighbour", times().map(move |t| (t, neighbour(0.12)(t))))
                .colour(Colour::Grey)
                .stroke(Stroke::Dashed),
        )
        .line("impurity", turns)
        .curve(Curve::points("turning points", events).colour(Colour::Vermillion));
    Figure::new().caption(RUN).panel(bands(panel))
}

fn contact_map() -> Result<Figure, FigureError> {
    let class = |contact: u32, row: u32| {
        let (contact, row) = (f64::from(contact), f64::from(row));
        let front = 0.98 * row;
        let reflected = 500.0 - 0.6 * (row - 510.0);
        let behind = |place: f64, width: f64| (contact - place).abs() < width;
        let tail = (1..7).any(|n| behind(front - 60.0 * f64::from(n) * (row / 1000.0), 2.0));
        if behind(front, 2.5) || tail && contact < front || row > 510.0 && behind(reflected, 2.0) {
            2
        } else {
            u8::from(contact > front) // ahead of the front beads still touch
        }
    };
    let cells = (0..1000).flat_map(|row| (0..999).map(move |contact| class(contact, row)));
    let classes = [("open", Colour::White), ("touching", Colour::LightGrey), ("compressed", Colour::Blue)];
    let map = Raster::classes(999, 1000, cells.collect(), &classes)?.over((-0.5, 998.5), (0.0, 80.0));
    let panel = Panel::new()
        .x_axis("contact")
        .y_axis(Axis::new("time (ms)").reversed())
        .vertical("impurity", 499.5)
        .raster(map);
    Ok(Figure::new().caption(RUN).panel(panel))
}

fn numbers() -> Result<Figure, FigureError> {
    let value = |place: u16, row: u16| {
        let distance = (f32::from(place) - 0.9 * f32::from(row)) / 12.0;
        (row > 40 && row < 470).then(|| 3.0 * (-distance * distance / 9.0).exp() * distance.cos())
    };
    let cells: Vec<_> = (0..500).flat_map(|row| (0..500).map(move |place| value(place, row))).collect();
    let scale = ColourScale::new("velocity (m/s)", -2.5, 3.0).log_beyond(3e-3);
    let map = Raster::values(500, 500, &cells, scale)?.over((-0.5, 499.5), (0.0, 80.0));
    let panel = Panel::new().x_axis("bead").y_axis(Axis::new("time (ms)").reversed()).raster(map);
    Ok(Figure::new().caption(RUN).panel(panel))
}

fn widths() -> Figure {
    let excess = [0.1, 0.15, 0.2, 0.3, 0.5, 0.8, 1.0, 1.5, 2.0, 3.0, 4.0];
    let measured = excess.map(|x: f64| (x, 4.6 * x.powf(-0.5) * (1.0 + 0.03 * (x * 40.0).sin())));
    let other = excess.map(|x: f64| (x, 3.4 * x.powf(-0.48)));
    let fit = (0..=60).map(|i| 0.09 * 1.07_f64.powi(i)).map(|x| (x, 4.6 * x.powf(-0.5)));
    let panel = Panel::new()
        .x_axis(Axis::new("α − 1").log())
        .y_axis(Axis::new("width (beads)").log())
        .points("full width", measured)
        .curve(Curve::points("width at half height", other).mark(figure::Mark::Square))
        .curve(Curve::line("4.6 (α − 1)^{−0.5}", fit).colour(Colour::Black))
        .note("slope −0.497 ± 0.004");
    Figure::new().caption("27 runs of 1000 equal beads").panel(panel)
}

/// Cases that must not break the layout: no values, one value, gaps, long names, many curves, huge numbers.
fn awkward() -> Figure {
    let steps = || (0..200).map(f64::from);
    let gaps = |x: f64| {
        if (80.0..90.0).contains(&x) { f64::NAN } else { 3e7 + 4e6 * (x / 9.0).cos() }
    };
    let mut many = Panel::new()
        .x_axis("a label of the x axis that goes on for much longer than anyone could ask for, with & and <b> (µm/s²)")
        .y_axis("a long label of the y axis in brackets (N·m⁻²)");
    for curve in 0..9 {
        let phase = f64::from(curve);
        let name = format!("curve number {curve}");
        many = many.line(name, steps().map(move |x| (1e6 * x, gaps(x) + 1e6 * phase)));
    }
    Figure::new()
        .panel(Panel::new().x_axis("nothing").y_axis("no values (m)"))
        .panel(
            Panel::new().x_axis("one value (s)").y_axis("u (m)").line("constant", [(0.5, 1e-4), (2.5, 1e-4)]),
        )
        .panel(many.note("a note at the end"))
}

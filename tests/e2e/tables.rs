//! `beadline plot` of tables: what it chooses, what it says, and that it never guesses what was not there.

use crate::harness::Place;
use serde_json::{Value, json};
use std::fmt::Write as _;

/// A table as a sweep over a law, a mass and seeds leaves it: `value` is exact, so that means are known.
fn results(alphas: &[f64], masses: u32, seeds: u32) -> String {
    let mut csv =
        "index,chain.alpha,\"chain.impurities[0].mass_kg\",seed,end,steps,time_s,total_j,error\n".to_owned();
    let mut index = 0;
    for alpha in alphas {
        for mass in 1..=masses {
            for seed in 0..seeds {
                let value = alpha * f64::from(mass) + f64::from(seed);
                let mass_kg = 1e-3 * f64::from(mass);
                let row = format!(
                    "{index},{alpha},{mass_kg},{seed},complete,100,1e-3,{value},
"
                );
                csv.push_str(&row);
                index += 1;
            }
        }
    }
    csv
}

fn plot(place: &Place, words: &str) -> Value {
    place.run(&format!("plot {words} --force --json")).exits(0).json()
}

#[test]
fn what_is_drawn_is_chosen_well_and_said() {
    let place = Place::new();
    place.write("results.csv", &results(&[1.5, 2.0], 12, 3));
    let said = place.run("plot results.csv").exits(0).stdout();
    for says in
        ["chain.impurities[0].mass_kg (chosen", "total_j (chosen", "chain.alpha (chosen", "averaged over"]
    {
        assert!(said.contains(says), "{says}: {said}");
    }
    assert!(place.path("results-total_j.png").exists());
    let chosen = plot(&place, "results.csv --out a.svg");
    assert_eq!(chosen["x"], "chain.impurities[0].mass_kg");
    assert_eq!((&chosen["by"], &chosen["averaged_over"]), (&json!("chain.alpha"), &json!(["seed"])));
    let svg = place.read("a.svg");
    for says in ["impurity 0 mass", "total", "α = 1.5", "α = 2", "mean over seed"] {
        assert!(svg.contains(says), "{says}");
    }
    // two long axes and no wish: a map
    place.write("grid.csv", &results(&[1.2, 1.3, 1.4, 1.5, 1.6, 1.7, 1.8, 1.9, 2.0], 12, 2));
    let map = plot(&place, "grid.csv --out m.svg");
    assert_eq!((&map["heat"], &map["x"]), (&json!("total_j"), &json!("chain.alpha")));
    assert_eq!(map["y"], json!(["chain.impurities[0].mass_kg"]));
    assert!(place.read("m.svg").contains("<image"));
    assert_eq!(plot(&place, "grid.csv --heat steps --out m.svg --log x,y")["heat"], "steps");
}

/// The curve of the means: 3 seeds add 0, 1 and 2 to α·m.
#[test]
fn a_band_shows_how_rows_scatter() {
    let place = Place::new();
    place.write("results.csv", &results(&[1.5, 2.0], 6, 3));
    for (flag, says) in
        [("--band", "mean ± standard error over seed"), ("--band=quantiles", "median, 25 % to 75 %")]
    {
        plot(&place, &format!("results.csv {flag} --out b.svg"));
        let svg = place.read("b.svg");
        assert!(svg.contains(says) && svg.contains("fill-opacity"), "{flag}");
    }
    // one row for each point has no band, and that is said
    place.write("alone.csv", &results(&[1.5, 2.0], 6, 1));
    place.run("plot alone.csv --band --out c.svg").exits(0).says(&["no band for total_j"]);
}

#[test]
fn an_ensemble_is_drawn_from_either_of_its_tables() {
    let place = Place::new();
    place.write(
        "s.toml",
        "[ensemble]\nover = \"striker.velocity_m_s\"\n[base]\npreset = \"homogeneous\"\nchain.beads = 20\n\
         time.duration_s = 1e-3\n[grid]\nchain.alpha = [1.3, 1.5, 2.0]\n\"striker.velocity_m_s\" = [1, 2, 3]\n",
    );
    place.run("sweep s.toml --out dir").exits(0);
    for band in ["", "--band", "--band=quantiles"] {
        let words = format!("--x chain.alpha --y total_j {band}");
        plot(&place, &format!("dir/ensemble.csv {words} --out e.svg"));
        plot(&place, &format!("dir/ensemble.parquet {words} --out p.svg"));
        plot(&place, &format!("dir/results.csv {words} --by end --out r.svg"));
        let curves = |file: &str| -> Vec<String> {
            let svg = place.read(file);
            svg.lines().filter(|line| line.starts_with("<path")).map(str::to_owned).collect()
        };
        let words = place.read("e.svg").replace('\u{a0}', " ");
        // what all runs have in common is named, and what was swept is not
        assert!(words.contains("1 g,") && !words.contains("α = 1.3"), "{words}");
        assert_eq!(curves("e.svg"), curves("p.svg"), "{band}");
        assert!(!curves("r.svg").is_empty());
    }
}

/// Two of nine rows have no value: one of a point of three, and all that one point has.
#[test]
fn rows_without_a_value_are_counted_and_means_of_fewer_are_marked() {
    let place = Place::new();
    let row = |x: u32, seed: u32, value: &str| format!("{x},{seed},complete,{value}\n");
    let values = |x: u32| (0..3).map(move |seed| row(x, seed, if (x, seed) == (2, 1) { "" } else { "1.5" }));
    let rows: String = (1..=2).flat_map(values).collect();
    let csv = format!("index,chain.beads,seed,end,peak_n\n{}", rows + &row(3, 0, ""));
    let csv: String = csv
        .lines()
        .enumerate()
        .map(|(i, line)| if i == 0 { format!("{line}\n") } else { format!("{i},{line}\n") })
        .collect();
    place.write("r.csv", &csv);
    let ended = plot(&place, "r.csv --x chain.beads --y peak_n --out r.svg");
    assert_eq!(ended["left_out"][0]["rows"], 7);
    assert_eq!(
        (&ended["left_out"][0]["without_value"], &ended["left_out"][0]["of_fewer"]),
        (&json!(2), &json!(1))
    );
    let svg = place.read("r.svg").replace('\u{a0}', " ");
    for says in ["2 of 7 rows", "have no value", "mean of fewer rows"] {
        assert!(svg.contains(says), "{says}");
    }
    let said = place.run("plot r.csv --x chain.beads --y peak_n --out r.svg --force").exits(0).stdout();
    assert!(said.contains("peak_n: 2 of 7 rows have no value, 1 mean of fewer rows"), "{said}");
    let heat = plot(&place, "r.csv --x chain.beads --y seed --heat peak_n --out h.svg");
    assert_eq!(heat["left_out"][0]["without_value"], 2);
    assert!(place.read("h.svg").replace('\u{a0}', " ").contains("2 of 7 rows have no value"));
    // a whole table says nothing of the kind
    place.write("whole.csv", &results(&[1.5, 2.0], 6, 3));
    let whole = plot(&place, "whole.csv --out w.svg");
    assert_eq!(
        (&whole["left_out"][0]["without_value"], &whole["left_out"][0]["of_fewer"]),
        (&json!(0), &json!(0))
    );
    assert!(!place.read("w.svg").contains("fewer"));
}

/// A power law is a straight line on logarithmic axes, and a curve on all others; it is one of what is drawn, and says where it is none.
#[test]
fn power_laws_are_drawn_as_they_are() {
    let place = Place::new();
    let rows = |of: [[i32; 4]; 2]| {
        let row = |(at, (b, y)): (usize, (usize, i32))| format!("{at},{},{b},{y}\n", 1 << (at % 4));
        let all = of.into_iter().enumerate().flat_map(|(b, ys)| ys.map(|y| (b, y)));
        all.enumerate().map(row).collect::<String>()
    };
    place.write("t.csv", &format!("index,k,b,y\n{}", rows([[1, 4, 16, 64], [-1, 2, 3, 4]])));
    let lines = |words: &str, dashes: &str| {
        plot(&place, &format!("t.csv --x k --y y --by b {words} --out l.svg"));
        let svg = place.read("l.svg");
        let dashed = svg.lines().filter(|line| line.contains(&format!("stroke-dasharray=\"{dashes}")));
        let path =
            |line: &str| line.split("d=\"").nth(1).and_then(|rest| rest.split('"').next()).map(str::to_owned);
        dashed.filter_map(path).map(|path| path.split(' ').count()).max().unwrap_or(0)
    };
    assert!(lines("--fit --log x,y", "4 ") < 5);
    assert!(lines("--fit --log none", "4 ") > 50);
    assert!(lines("--fit --log x", "4 ") > 50);
    let said =
        place.run("plot t.csv --x k --y y --by b --fit --slope 2 --log none --out l.svg --force").exits(0);
    said.says(&["y, b = 1: no power law"]);
    let [mean, median] = ["", "--band=quantiles"].map(|band| {
        place.write("m.csv", "index,k,seed,y\n0,1,0,1\n1,1,1,1\n2,1,2,4\n3,2,0,2\n4,2,1,2\n5,2,2,5\n6,4,0,4\n7,4,1,4\n8,4,2,7\n");
        let told = plot(&place, &format!("m.csv --x k --y y --fit {band} --out m.svg"));
        told["fits"][0]["exponent"].as_f64().unwrap()
    });
    assert!((median - 1.0).abs() < 1e-12 && mean < 0.9, "{mean} {median}");
}

/// The axis that was swept by the logarithm is logarithmic, whichever it is, unless another one is asked for.
#[test]
fn a_swept_axis_is_logarithmic_where_its_values_are() {
    let place = Place::new();
    let mut csv = "index,chain.alpha,striker.velocity_m_s,end,total_j\n".to_owned();
    for (i, (alpha, v)) in (0..5).flat_map(|a| (0..5).map(move |v| (a, v))).enumerate() {
        let (alpha, v) = (1.2 + 0.2 * f64::from(alpha), 0.1 * 2.0_f64.powi(v));
        let _ = writeln!(csv, "{i},{alpha},{v},complete,{}", alpha * v);
    }
    place.write("r.csv", &csv);
    let log = |words: &str| plot(&place, &format!("r.csv {words} --out h.svg"))["log"].clone();
    assert_eq!(log("--heat total_j"), json!(["y"]));
    assert_eq!(log("--heat total_j --x striker.velocity_m_s --y chain.alpha"), json!(["x"]));
    assert_eq!(log("--x striker.velocity_m_s --y total_j"), json!(["x"]));
    assert_eq!(log("--x chain.alpha --y total_j"), json!([]));
    assert_eq!(log("--heat total_j --log none"), json!([]));
    assert_eq!(log("--heat total_j --log x,y"), json!(["x", "y"]));
}

/// Keys of cases have few values, and none in the other cases.
#[test]
fn a_map_has_the_axes_with_most_values() {
    let place = Place::new();
    let mut csv = "index,damping.restitution,chain.beads,striker.velocity_m_s,end,total_j\n".to_owned();
    for (i, (case, beads, v)) in
        ["", "0.9"].iter().flat_map(|c| (0..15).map(move |i| (c, 20 + i / 5, 1 + i % 5))).enumerate()
    {
        let _ = writeln!(csv, "{i},{case},{beads},{v},complete,{}", beads * v);
    }
    place.write("r.csv", &csv);
    let map = plot(&place, "r.csv --heat total_j --out h.svg");
    assert_eq!((&map["x"], &map["y"]), (&json!("chain.beads"), &json!(["striker.velocity_m_s"])));
    place.write("none.csv", "index,a,b,end,y\n0,,1,complete,1\n1,2,,complete,2\n");
    place.run("plot none.csv --heat y --x a --y b").exits(2).says(&["y has no numbers over a and b"]);
}

/// Times of runs with steps of their own are no repetitions of each other.
#[test]
fn a_law_through_rows_of_several_parameters_says_so() {
    let place = Place::new();
    let mut csv = "index,v,disorder[0].uniform,time_s,m\n".to_owned();
    for (i, (v, uniform, t)) in
        (1..4).flat_map(|v| (1..4).flat_map(move |u| (1..6).map(move |t| (v, u, t)))).enumerate()
    {
        let time_s = f64::from(t) + 0.01 * f64::from(v) + 0.001 * f64::from(uniform);
        let _ = writeln!(csv, "{i},{v},{uniform},{time_s},{}", time_s * f64::from(uniform));
    }
    place.write("series.csv", &csv);
    let ended = place.run("plot series.csv --x time_s --y m --by v --fit --out f.svg").exits(0);
    ended.says(&["differ in disorder[0].uniform too"]);
    let told = plot(&place, "series.csv --x time_s --y m --by v --fit --out f.svg");
    assert_eq!(told["averaged_over"], json!(["disorder[0].uniform"]));
}

/// A curve for each value of the swept key would have one point.
#[test]
fn a_result_over_another_is_one_curve() {
    let place = Place::new();
    let mut csv = "index,v,end,force,speed\n".to_owned();
    for i in 1..7 {
        let _ = writeln!(csv, "{i},{i},complete,{},{i}", i * i);
    }
    place.write("r.csv", &csv);
    let told = plot(&place, "r.csv --x force --y speed --fit --out f.svg");
    assert_eq!(told["by"], json!(null));
    assert!((told["fits"][0]["exponent"].as_f64().unwrap() - 0.5).abs() < 1e-9);
    place.run("plot r.csv --x force --y speed --by v --fit --out g.svg").exits(2).says(&["`--by none`"]);
}

#[test]
fn samples_are_points_and_words_are_no_axis() {
    let place = Place::new();
    place.write(
        "s.toml",
        "[sample]\nmethod = \"sobol\"\ncount = 16\nranges = { chain.alpha = { from = 1.2, to = 3 }, \
         striker.velocity_m_s = { from = 0.1, to = 10, spacing = \"log\" } }\n[base]\npreset = \"homogeneous\"\n\
         chain.beads = 20\ntime.duration_s = 1e-3\n",
    );
    place.run("sweep s.toml --out dir").exits(0);
    let points = plot(&place, "dir/results.csv --x chain.alpha --y total_j --log y --out points.svg");
    assert_eq!(points["averaged_over"], json!([]));
    let svg = place.read("points.svg");
    assert_eq!(svg.lines().filter(|line| line.starts_with("<path")).count(), 1, "marks and no line");
    plot(&place, "dir/results.csv --heat total_j --log y --out map.png");
    place
        .run("plot dir/results.csv --x end --y total_j")
        .exits(2)
        .says(&["end has words, such as `complete`"]);
}

#[test]
fn mistakes_say_what_there_is() {
    let place = Place::new();
    place.write("results.csv", &results(&[1.5, 2.0], 3, 2));
    place.write("torn.csv", "a,b\n1,2\n3\n");
    place.write("empty.csv", "a,b\n");
    for (words, says) in [
        ("results.csv --y total", "--y total: the table has no such column; it has chain.alpha"),
        ("results.csv --x speed", "--x speed: the table has no such column"),
        ("results.csv --at 0.1", "--at is for runs and recordings; results.csv is a table"),
        ("results.csv --every-step", "--every-step is for runs and recordings"),
        ("torn.csv", "torn.csv:3: found 1 fields; expected 2"),
        ("empty.csv", "empty.csv has no rows"),
        ("nothing.csv", "nothing.csv cannot be read"),
        ("results.csv --out figure.txt", "a figure is written as .svg, .pdf or .png"),
        ("run.mcap --x chain.alpha", "--x is for tables (.csv, .parquet); run.mcap is a run or a recording"),
        (
            "run.mcap --what velocity --slope 1",
            "--slope is for tables (.csv, .parquet); run.mcap is a run or a recording",
        ),
        ("results.csv --slope nan", "expected an exponent, such as 1.5 or -2"),
        ("run.mcap", "--what is missing"),
    ] {
        place.run(&format!("plot {words}")).exits(2).says(&[says]);
    }
    place.run("plot results.csv --out a.png").exits(0);
    place.run("plot results.csv --out a.png").exits(2).says(&["a.png exists already"]);
}

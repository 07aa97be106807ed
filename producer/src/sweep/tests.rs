use super::ParameterKind::{Double, Word};
use super::*;
use schemas::method::Method;

const SWEEP: &str = "\
[base]
preset = \"homogeneous\"
chain.beads = 40
chain.impurities = [{ bead = 20, mass_kg = 1e-3 }]
time.duration_s = 1e-3

[grid]
\"chain.impurities[0].mass_kg\" = { from = 1e-3, to = 2e-3, count = 3 }
chain.alpha = [1.5, 2]

[[case]]
\"integrator.method\" = \"rkn4\"
[[case]]
\"integrator.method\" = \"velocity-verlet\"
\"time.dt_s\" = 1e-7
";

const CHAIN: &str = "\
[chain]
beads = 40
bead_mass_kg = 1e-3
alpha = 0.5
stiffness = 1e7
[striker]
bead = 0
velocity_m_s = 5.0
[time]
duration_s = 1e-3
[stream]
publish_every_steps = 2
";

fn read(text: &str) -> Result<Sweep, SweepError> {
    let file = |path: &Path| {
        assert_eq!(path, Path::new("dir/chain.toml"));
        Ok(CHAIN.to_owned())
    };
    let prepare: fn(RunConfig, Option<&Path>) -> Result<RunConfig, ConfigError> = |config, beside| {
        assert_eq!(beside, Some(Path::new("dir")));
        Ok(config)
    };
    Sweep::from_toml(text, Path::new("dir/s.toml"), file, Hooks { prepare, ..Hooks::NONE })
}

fn config(sweep: &Sweep, index: u64) -> RunConfig {
    sweep.point(index).expect("a point").config
}

#[test]
fn cases_times_grid_with_the_last_key_fastest() {
    let sweep = read(SWEEP).expect("valid");
    assert_eq!(sweep.point_count(), 2 * 3 * 2);
    let parameters: Vec<_> = sweep.parameters().iter().map(|p| (p.key.as_str(), p.kind)).collect();
    assert_eq!(
        parameters,
        [
            ("integrator.method", Word),
            ("time.dt_s", Double),
            ("chain.impurities[0].mass_kg", Double),
            ("chain.alpha", Double)
        ]
    );
    for (index, (mass_kg, alpha)) in [(1e-3, 1.5), (1e-3, 2.0), (1.5e-3, 1.5)].into_iter().enumerate() {
        let chain = config(&sweep, index as u64).chain;
        assert_eq!((chain.impurities[0].mass_kg, chain.alpha), (mass_kg, Some(alpha)));
        assert_eq!((chain.impurities[0].bead, chain.beads), (20, 40));
    }
    let (first, last) = (sweep.point(0).expect("first"), sweep.point(11).expect("last"));
    assert_eq!((first.config.time.dt_s, last.config.time.dt_s), (None, Some(1e-7)));
    assert_eq!(first.parameters[1], None);
    let word = ParameterValue::Word("velocity-verlet".to_owned());
    let doubles = [1e-7, 2e-3, 2.0].map(|value| Some(ParameterValue::Double(value)));
    assert_eq!(last.parameters, [[Some(word)].as_slice(), &doubles].concat());
    assert!(sweep.point(12).is_err());
}

/// The unit of work: a point depends on nothing but the file and the index.
#[test]
fn a_point_is_a_pure_function_of_file_and_index() {
    let (a, b) = (read(SWEEP).expect("valid"), read(SWEEP).expect("valid"));
    for index in (0..12).rev() {
        assert_eq!(a.point(index).expect("point"), b.point(index).expect("point"));
    }
    assert_eq!(a.identity(), b.identity());
    let commented = read(&format!("# a comment\n{SWEEP}")).expect("valid");
    assert_eq!(a.identity(), commented.identity());
    let other = read(&SWEEP.replace("to = 2e-3", "to = 2.5e-3")).expect("valid");
    assert_ne!(a.identity(), other.identity());
}

#[test]
fn any_key_of_the_configuration_can_be_swept() {
    let sweep = read(
        "[base]\npreset = \"homogeneous\"\n[grid]\n\"chain.beads\" = { from = 40, to = 60, count = 3 }\n\
         \"chain.impurities\" = [[], [{ bead = 3, mass_kg = 2e-3 }]]\n\"stream.publish_every_steps\" = [1, 7]\n",
    )
    .expect("valid");
    assert_eq!(sweep.point_count(), 12);
    let last = sweep.point(11).expect("last");
    assert_eq!((last.config.chain.beads, last.config.chain.impurities.len()), (60, 1));
    assert_eq!(last.config.stream.publish_every_steps, 7);
    assert_eq!(last.parameters[0], Some(ParameterValue::Integer(60)));
    let list = Some(ParameterValue::Word("[{ bead = 3, mass_kg = 0.002 }]".to_owned()));
    assert_eq!(last.parameters[1], list);
}

/// Analysed frames are 0.1 T apart unless the base says otherwise, and what is recorded is among them.
#[test]
fn intervals_of_frames_are_filled_in() {
    let stream = |base: &str| {
        let sweep = read(&format!("[base]\npreset = \"homogeneous\"\n{base}\n[grid]\nchain.alpha = [1.5]"));
        let stream = config(&sweep.expect(base), 0).stream;
        (stream.publish_every_steps, stream.record_every_steps)
    };
    assert_eq!(stream(""), (5, 100)); // the default step is 0.02 T
    assert_eq!(stream("time.dt_s = 1e-6"), (7, 105)); // T = 72.5 µs
    assert_eq!(stream("stream.publish_every_steps = 3"), (3, 102));
    assert_eq!(stream("stream.record_every_steps = 8"), (4, 8));
}

#[track_caller]
fn refuses(text: &str, line: usize, says: &[&str]) {
    let error = read(text).expect_err("refused").to_string();
    for says in [format!("s.toml:{line}: ").as_str()].iter().chain(says) {
        assert!(error.contains(says), "`{says}` is not in: {error}");
    }
}

#[test]
fn mistakes_have_file_line_and_key() {
    let base = "[base]\npreset = \"homogeneous\"\n";
    let grid = |axis: &str| format!("{base}[grid]\n{axis}\n");
    refuses(&grid("chain.alpha = [1.5,\n 0.5]"), 5, &["chain.alpha", "0.5", "point 1"]);
    refuses(&grid("\"chain.alpa\" = [1.5]"), 4, &["chain.alpa", "alpha"]);
    refuses(&grid("chain.alpha = [1.5, \"x\"]"), 4, &["chain.alpha", "point 1"]);
    refuses(&grid("chain.alpha = []"), 4, &["chain.alpha", "list"]);
    refuses(&grid("chain.alpha = {}"), 4, &["chain.alpha", "empty table"]);
    refuses(&grid("chain.alpha = [1.5]\nload = {}"), 5, &["load", "empty table"]);
    refuses(&grid("chain.alpha = { from = 1.0, to = 2.0 }"), 4, &["chain.alpha", "count"]);
    refuses(&grid("\"chain.impurities[0].mass_kg\" = [1e-3]"), 4, &["has 0 entries"]);
    refuses(&grid("chain.alpha = [1.5]\n\"chain.alpha\" = [2]"), 5, &["chain.alpha", "twice"]);
    refuses(&grid("chain.beads = [40, 99999999999999999999]"), 4, &["chain.beads"]);
    refuses(&grid("chain.alpha = { from = 99999999999999999999, to = 2, count = 3 }"), 4, &["chain.alpha"]);
    refuses(&format!("{base}chain.beads = 99999999999999999999\n"), 3, &["base"]);
    refuses(&format!("case = []\n{base}"), 1, &["case", "no point"]);
    refuses(&grid("name = [\"a\"]"), 4, &["name"]);
    refuses(&format!("{base}[gird]\n"), 3, &["gird", "grid"]);
    refuses(&format!("until = \"noon\"\n{base}"), 1, &["noon", "stationary"]);
    refuses(&format!("split_bead = 200\n{base}"), 1, &["split_bead", "0 to 199"]);
    refuses(&format!("record = 3\n{base}"), 1, &["record", "true or false"]);
    refuses("[base]\npreset = \"nothing\"\n", 2, &["nothing", "homogeneous"]);
    refuses("[grid]\nchain.alpha = [1.5]\n", 1, &["[base]"]);
    refuses(&format!("{base}chain.alpha = 0.5\n"), 3, &["chain.alpha", "0.5"]);
    refuses(&format!("{base}[grid\n"), 3, &[]);
    refuses(&format!("{base}[[case]]\n\"time.dt_s\" = 1.0\n"), 4, &["time.dt_s", "collision time"]);
}

/// Otherwise a row would name a value that was not run.
#[test]
fn keys_that_lie_in_each_other_are_refused() {
    let base = "[base]\npreset = \"light-impurity\"\n";
    let mass = "\"chain.impurities[0].mass_kg\" = [1e-3]\n";
    let list = "\"chain.impurities\" = [[{ bead = 3, mass_kg = 2e-3 }]]\n";
    let grid = |first: &str, second: &str| format!("{base}[grid]\n{first}{second}");
    refuses(&grid(mass, list), 5, &["chain.impurities: ", "`chain.impurities[0].mass_kg` of line 4"]);
    refuses(&grid(list, mass), 5, &["chain.impurities[0].mass_kg: ", "`chain.impurities` of line 4"]);
    refuses(
        &grid(mass, &mass.replace("[0]", "[00]")),
        5,
        &["chain.impurities[0].mass_kg", "twice", "line 4"],
    );
    let case = format!("[[case]]\n{}", list.replace("[[", "[").replace("]]", "]"));
    refuses(
        &format!("{base}{case}[grid]\n{mass}"),
        6,
        &["chain.impurities[0].mass_kg: ", "`chain.impurities` of line 4"],
    );
    // of other cases they are none of each other's business, and one key has one name
    let cases = format!("{base}[[case]]\n{}[[case]]\n{list}", mass.replace("[1e-3]", "1e-3"));
    let cases = cases.replace("[[{", "[{").replace("}]]", "}]").replace("[0]", "[00]");
    let sweep = read(&cases).expect("two cases");
    assert_eq!(sweep.parameters()[0].key, "chain.impurities[0].mass_kg");
    assert_eq!((sweep.point_count(), sweep.parameters().len()), (2, 2));
}

/// As in a grid; a table of its own goes on with that of the base.
#[test]
fn a_table_in_braces_in_a_case_replaces_that_of_the_base() {
    let base = "[base]\npreset = \"homogeneous\"\nchain.beads = 40\n\
                initial.gaussian = { bead = 15, width_beads = 2, displacement_m = 1e-9 }\n[[case]]\n";
    let shape = |case: &str| {
        let gaussian = config(&read(&format!("{base}{case}\n")).expect("valid"), 0).initial.gaussian;
        gaussian.map(|shape| (shape.bead, shape.displacement_m, shape.velocity_m_s)).expect("a shape")
    };
    let of_case = "gaussian = { bead = 16, width_beads = 2, velocity_m_s = 0.01 }";
    for written in [
        format!("\"initial.{of_case}").replace(" = {", "\" = {"),
        format!("initial.{of_case}"),
        format!("[case.initial]\n{of_case}"),
    ] {
        assert_eq!(shape(&written), (16.0, 0.0, 0.01), "{written}");
    }
    for written in ["initial.gaussian.bead = 16", "[case.initial.gaussian]\nbead = 16"] {
        assert_eq!(shape(written), (16.0, 1e-9, 0.0), "{written}");
    }
}

/// What a preset says of its own run is nothing that the points of a sweep have in common.
#[test]
fn a_preset_lends_its_physics_only() {
    let sweep = read("[base]\npreset = \"homogeneous\"\n[grid]\n\"damping.restitution\" = [0.9, 0.95]\n");
    let config = config(&sweep.expect("the method of damping is the default then"), 1);
    assert_eq!((config.integrator.method, config.name), (Method::Rk5, None));
    let damped = read("[base]\npreset = \"damped\"\n").expect("valid").point(0).expect("point").config;
    assert_eq!(damped.integrator.method, Method::Rk5);
}

#[test]
fn mistakes_in_the_file_of_the_base_are_located_there() {
    let text = "[base]\nfile = \"chain.toml\"\n[grid]\n\"time.duration_s\" = [1e-3, 2e-3]\n";
    let error = read(text).expect_err("α = 0.5").to_string();
    assert!(error.starts_with("dir/chain.toml:4: chain.alpha: found 0.5"), "{error}");
    // and are no mistakes where the sweep sets the value
    let sweep = read(&text.replace("\"time.duration_s\" = [1e-3, 2e-3]", "chain.alpha = [2, 3]"));
    let point = sweep.expect("valid").point(1).expect("point");
    assert_eq!((point.config.chain.alpha, point.config.stream.publish_every_steps), (Some(3.0), 2));
}

#[test]
fn the_number_of_points_is_limited() {
    let axis = |key: &str| format!("\"{key}\" = {{ from = 1e-3, to = 2e-3, count = 4000 }}\n");
    let text = format!(
        "[base]\npreset = \"homogeneous\"\n[grid]\n{}{}",
        axis("chain.bead_mass_kg"),
        axis("time.duration_s")
    );
    assert!(matches!(read(&text), Err(SweepError::TooMany { found: 16_000_000, .. })));
}

/// Of ten million points some are checked, with the values of every list among them; the others are computed when they are asked
/// for.
#[test]
fn many_points_are_begun_at_once() {
    let text = "[base]\npreset = \"homogeneous\"\nchain.beads = 40\n\
                disorder = [{ of = \"masses\", uniform = 0.1 }]\n[grid]\nchain.alpha = [1.5, 2.0]\n\
                \"time.duration_s\" = { from = 1e-3, to = 2e-3, count = 1000 }\n\
                [[case]]\n[[case]]\n\"time.dt_s\" = 1e-7\n";
    let seeds = |text: &str| format!("seeds = {{ from = 5, count = 2500 }}\n{text}");
    let sweep = read(&seeds(text)).expect("valid");
    assert_eq!(sweep.point_count(), MAX_POINTS);
    let last = sweep.point(MAX_POINTS - 1).expect("possible");
    assert_eq!(
        (last.config.seed, last.config.chain.alpha, last.config.time.dt_s),
        (2504, Some(2.0), Some(1e-7))
    );
    refuses(&seeds(&text.replace("2.0]", "0.5]")), 7, &["chain.alpha", "0.5"]);
    refuses(&seeds(&text.replace("dt_s\" = 1e-7", "dt_s\" = 1.0")), 11, &["time.dt_s"]);
    let alike = text.replace("disorder = [{ of = \"masses\", uniform = 0.1 }]\n", "");
    refuses(&seeds(&alike), 1, &["seed", "found 5", "[[disorder]]"]);
    // one of the cases has some, or the seed makes the beginning
    let of_case = alike.replace(
        "[[case]]\n[[case]]\n",
        "[[case]]\n[[case]]\ndisorder = [{ of = \"masses\", uniform = 0.1 }]\n",
    );
    assert!(read(&seeds(&of_case)).is_ok());
    let last = |text: &str| text.replace("from = 5, count = 2500", "from = 9223372036854775807, count = 1");
    assert_eq!(
        read(&last(&seeds(text))).expect("valid").point(0).expect("possible").config.seed,
        u64::MAX >> 1
    );
    let other = read(&seeds(&text.replace("to = 2e-3", "to = 2.1e-3"))).expect("valid");
    assert_ne!(other.identity(), sweep.identity());
}

/// What is read of a document is what is read of its text.
#[test]
fn a_point_is_its_configuration_as_text() {
    for preset in schemas::presets::PRESETS {
        let sweep = read(&format!(
            "[base]\npreset = \"{}\"\n[grid]\nstream.publish_every_steps = [1]\n",
            preset.name
        ))
        .expect("valid");
        let point = sweep.point(0).expect("point");
        let again = RunConfig::from_toml(&point.config.to_toml()).expect("TOML");
        assert_eq!(Physics::resolve(&again).expect("valid").hash(), point.physics.hash(), "{}", preset.name);
    }
}

const SAMPLE: &str = "[sample]\nmethod = \"sobol\"\ncount = 4\nranges = { chain.beads = { from = 10, to = 49 }, \
                      \"time.duration_s\" = { from = 1e-3, to = 2e-3 } }\n[base]\npreset = \"homogeneous\"\n\
                      [[case]]\n[[case]]\n\"integrator.method\" = \"velocity-verlet\"\n[grid]\nchain.alpha = [1.5, 2.0]\n";

/// Cases vary slowest, then samples, then the grid; a sample sets all of its keys together.
#[test]
fn samples_are_combined_with_cases_and_grid() {
    let sweep = read(SAMPLE).expect("valid");
    assert_eq!(sweep.point_count(), 16);
    let keys: Vec<_> = sweep.parameters().iter().map(|parameter| parameter.key.as_str()).collect();
    assert_eq!(keys, ["integrator.method", "chain.beads", "time.duration_s", "chain.alpha"]);
    let drawn = |index| {
        let config = config(&sweep, index);
        (config.chain.beads, config.time.duration_s.to_bits())
    };
    for index in 0..8 {
        assert_eq!(drawn(index), drawn(index + 8), "of the other case");
        assert_eq!(drawn(index), drawn(index / 2 * 2), "of the other law");
    }
    let mut quarters: Vec<u64> = (0..4).map(|sample| (drawn(2 * sample).0 - 10) / 10).collect();
    quarters.sort_unstable();
    assert_eq!(quarters, [0, 1, 2, 3]);
    assert_ne!(
        read(&SAMPLE.replace("count = 4", "count = 4\nseed = 1")).expect("valid").identity(),
        sweep.identity()
    );
}

#[test]
fn an_ensemble_leaves_one_key_out() {
    let ensemble = |over: &str| {
        let text = format!("[ensemble]\nover = \"{over}\"\n{SAMPLE}");
        let sweep = read(&text).expect("valid");
        let found = sweep.ensemble().expect("asked for");
        let groups: Vec<u64> = (0..16).map(|index| found.group(index)).collect();
        (groups, found.shared.clone(), found.member_count())
    };
    let (groups, shared, members) = ensemble("chain.alpha");
    assert_eq!(
        (groups[..5].to_vec(), groups[15], shared, members),
        (vec![0, 0, 1, 1, 2], 7, vec![0, 1, 2], 2)
    );
    let (groups, shared, members) = ensemble("sample");
    assert_eq!((groups[..4].to_vec(), groups[8..12].to_vec()), (vec![0, 1, 0, 1], vec![2, 3, 2, 3]));
    assert_eq!((shared, members), (vec![0, 3], 4));
    assert!(read(SAMPLE).expect("valid").ensemble().is_none());
    refuses(&format!("[ensemble]\n{SAMPLE}"), 1, &["`seed`", "chain.alpha"]);
    refuses(&format!("seeds = 5\n{SAMPLE}"), 1, &["seeds", "{ from = 0, count = 100 }"]);
    refuses(&SAMPLE.replace("chain.beads = {", "chain.alpha = {"), 11, &["chain.alpha", "twice"]);
    let many = (0..17).fold(String::new(), |all, i| all + &format!("\"a{i}\" = {{ from = 1, to = 2 }}, "));
    let many = format!(
        "[sample]\nmethod = \"sobol\"\ncount = 4\nranges = {{ {many} }}\n[base]\npreset = \"homogeneous\"\n"
    );
    refuses(&many, 1, &["sample.ranges", "17", "16", "latin-hypercube"]);
}

/// What the documentation shows is a sweep: 3 × 12 points of one case.
#[test]
fn the_documented_sweep_is_one() {
    let page = include_str!("../../../docs/CONFIGURATION.md");
    let section = page.split("## Sweeps").nth(1).expect("the section");
    let toml = section.split("```toml").nth(1).and_then(|rest| rest.split("```").next()).expect("an example");
    let sweep = read(toml).expect("valid");
    assert_eq!((sweep.point_count(), sweep.until(), sweep.record()), (36, Until::Stationary, false));
    assert_eq!(sweep.parameters().len(), 4);
}

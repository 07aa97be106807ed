use super::*;
use crate::functions::Moment;

fn at(t: f64) -> Moment {
    Moment::new(0, 0.0, t)
}

fn read(text: &str) -> Result<Drive, String> {
    let drive: Result<Drive, _> = toml::from_str(text);
    drive.map_err(|error| error.to_string())
}

const SINE: &str = "wall = \"left\"\ndisplacement_m = { sine = { amplitude = 1e-8, frequency_hz = 6300.0, ramp_s = 1e-3 } }\n";

/// One of each kind, in the shape of a manifest.
fn all() -> Vec<Waveform> {
    let text = r#"[3.5,
        {"sine":{"amplitude":2.0,"frequency_hz":3.0,"phase_rad":0.4,"ramp_s":0.3,"until_s":2.0,"ramp_down_s":0.5}},
        {"chirp":{"amplitude":2.0,"from_hz":1.0,"to_hz":4.0,"duration_s":2.0,"ramp_s":0.3,"ramp_down_s":0.5}},
        {"step":{"amplitude":2.0,"at_s":0.2,"rise_s":0.4}},
        {"ramp":{"amplitude":2.0,"from_s":0.1,"to_s":1.7}},
        {"half_sine":{"amplitude":2.0,"duration_s":1.0,"at_s":0.3}},
        {"gaussian":{"amplitude":2.0,"at_s":1.0,"width_s":0.3,"frequency_hz":2.0}},
        {"table":{"times_s":[0.0,0.5,0.7,2.5],"values":[1.0,-1.0,0.0,3.0],"interpolation":"cubic"}},
        {"table":{"times_s":[0.25,2.5],"values":[1.0,-1.0],"interpolation":"linear"}}]"#;
    serde_json::from_str(text).expect("waveforms")
}

#[test]
fn drives_round_trip() {
    let drive = read(SINE).expect("a drive");
    assert_eq!((drive.at, drive.prescribes), (Place::Wall(Side::Left), Quantity::Displacement));
    let json = serde_json::to_string(&drive).expect("json");
    let written = r#"{"wall":"left","displacement_m":{"sine":{"amplitude":1e-8,"frequency_hz":6300.0,"ramp_s":0.001}}}"#;
    assert_eq!(json, written);
    assert_eq!(serde_json::from_str::<Drive>(&json).expect("the same"), drive);
    assert_eq!(read(&toml::to_string(&drive).expect("toml")).expect("the same"), drive);
    assert_eq!(drive.words(), "displacement of the left wall: sine of 10 nm at 6300 Hz");
    for waveform in all() {
        let json = serde_json::to_string(&waveform).expect("json");
        assert_eq!(serde_json::from_str::<Waveform>(&json).expect("the same"), waveform);
    }
    for constant in ["5", "5.0", "{ constant = 5 }"] {
        let drive = read(&format!("bead = 3\nvelocity_m_s = {constant}\n")).expect("a piston");
        assert_eq!(drive.waveform, Waveform::Constant(5.0));
    }
    let file = read("bead = 3\nforce_n = { csv = \"f.csv\", interpolation = \"cubic\" }\n").expect("a file");
    assert_eq!(read(&toml::to_string(&file).expect("toml")).expect("the same"), file);
}

#[test]
fn drives_that_say_too_little_or_too_much_are_refused() {
    for (text, expected) in [
        ("force_n = 1.0", "without a place"),
        ("bead = 1\nwall = \"left\"\nforce_n = 1.0", "`wall` and `bead`"),
        ("bead = 1", "found 0 of `force_n`"),
        ("bead = 1\nforce_n = 1.0\nvelocity_m_s = 1.0", "found 2 of `force_n`"),
        ("wall = \"left\"\nforce_n = 1.0", "at a wall"),
        ("wall = \"top\"\nforce_n = 1.0", "top"),
        ("bead = 1\nforce_n = {}", "a number, or one of"),
        ("bead = 1\nforce_n = { sine = { amplitude = 1.0 } }", "frequency_hz"),
        ("bead = 1\nforce_n = { sinus = 1.0 }", "sinus"),
        ("bead = 1\nforce_n = { constant = 1.0, interpolation = \"cubic\" }", "beside `csv`"),
        ("bead = 1\nforce_n = \"sine\"", "a number, or a waveform"),
    ] {
        let error = read(text).expect_err(text);
        assert!(error.contains(expected), "{text}: {error}");
    }
}

#[test]
fn impossible_waveforms_are_refused_with_their_key() {
    let allowed = |text: &str| {
        let drive = read(text).unwrap_or_else(|error| panic!("{text}: {error}"));
        drive.check("drive[0]", 1.0).map_err(|error| error.to_string())
    };
    assert_eq!(allowed(SINE), Ok(()));
    for (text, key) in [
        ("force_n = nan", "drive[0].force_n: found NaN"),
        (
            "force_n = { sine = { amplitude = 1.0, frequency_hz = 0.0 } }",
            "drive[0].force_n.sine.frequency_hz",
        ),
        ("force_n = { sine = { amplitude = 1.0, frequency_hz = 9.0, ramp_down_s = 1.0 } }", "until_s"),
        (
            "force_n = { sine = { amplitude = 1.0, frequency_hz = 9.0, ramp_s = 1.0, ramp_down_s = 1.0, until_s = 1.5 } }",
            "room",
        ),
        ("force_n = { gaussian = { amplitude = 1.0, at_s = 0.1, width_s = 0.0 } }", "gaussian.width_s"),
        ("force_n = { half_sine = { amplitude = 1.0, duration_s = -1.0 } }", "half_sine.duration_s"),
        ("force_n = { ramp = { amplitude = 1.0, from_s = 2.0, to_s = 1.0 } }", "ramp.to_s"),
        (
            "force_n = { chirp = { amplitude = 1.0, from_hz = 1.0, to_hz = inf, duration_s = 1.0 } }",
            "chirp.to_hz",
        ),
        (
            "force_n = { table = { times_s = [0.0, 0.5], values = [1.0, 2.0] } }",
            "times_s[1]: found 0.5; allowed: times up to",
        ),
        ("force_n = { table = { times_s = [0.0, 0.0, 2.0], values = [1.0, 2.0, 3.0] } }", "times_s[1]"),
        ("force_n = { table = { times_s = [0.0, 2.0], values = [1.0] } }", "table.values"),
        ("force_n = { csv = \"f.csv\" }", "has not been read"),
        ("displacement_m = { step = { amplitude = 1.0 } }", "step: found a step with no `rise_s`"),
        (
            "displacement_m = { sine = { amplitude = 1.0, frequency_hz = 9.1, until_s = 0.7 } }",
            "sine: found a sine that ends at",
        ),
    ] {
        let error = allowed(&format!("bead = 0\n{text}\n")).expect_err(text);
        assert!(error.contains(key), "{text}: {error}");
    }
    let whole =
        "bead = 0\ndisplacement_m = { sine = { amplitude = 1.0, frequency_hz = 10.0, until_s = 0.5 } }";
    assert_eq!(allowed(whole), Ok(()));
}

/// Central differences of a smooth piece have an error of h²/6 of the third derivative, at most 2·(2π·4)³ here.
#[test]
fn slopes_are_those_of_the_values() {
    let h = 1e-5;
    for waveform in all() {
        for n in 1..80 {
            let t = 0.031 * f64::from(n);
            let difference = (waveform.value(at(t + h)) - waveform.value(at(t - h))) / (2.0 * h);
            let slope = waveform.slope(at(t));
            assert!((difference - slope).abs() < 1e-5, "{waveform:?} at {t}: {slope} not {difference}");
            assert!(waveform.value(at(t)).abs() <= waveform.largest(), "{waveform:?} at {t}");
        }
    }
}

#[test]
fn waveforms_have_their_values() {
    let waveforms = all();
    let expect = |index: usize, t: f64, value: f64| {
        let found: f64 = waveforms[index].value(at(t));
        assert!((found - value).abs() < 1e-14, "{:?} at {t}: {found}", waveforms[index]);
    };
    let sine = |turns: f64| (std::f64::consts::TAU * turns).sin();
    expect(0, 9.0, 3.5);
    expect(1, 1.0, 2.0 * 0.4_f64.sin());
    expect(1, 0.15, 2.0 * 0.5 * (std::f64::consts::TAU * 0.45 + 0.4).sin());
    expect(1, 1.75, 2.0 * 0.5 * (std::f64::consts::TAU * 0.25 + 0.4).sin());
    expect(1, 2.0, 0.0);
    expect(2, 1.0, 2.0 * sine(1.0 + 0.75));
    expect(3, 0.1, 0.0);
    expect(3, 0.4, 1.0);
    expect(3, 1.0, 2.0);
    expect(4, 0.9, 1.0);
    expect(4, 1.8, 2.0);
    expect(5, 0.8, 2.0);
    expect(5, 1.31, 0.0);
    expect(6, 1.0, 2.0);
    expect(6, 1.25, 2.0 * (-0.5 * (0.25_f64 / 0.3).powi(2)).exp() * sine(0.5 + 0.25));
    for (t, value) in [(0.0, 1.0), (0.5, -1.0), (0.7, 0.0), (2.5, 3.0), (9.0, 3.0)] {
        expect(7, t, value);
    }
    expect(8, 0.1, 1.0);
    expect(8, 1.375, 0.0);
}

/// A parabola through any points is what cubic pieces are: their slopes are those of parabolas.
#[test]
fn cubic_pieces_are_exact_for_a_parabola() {
    let times_s = vec![0.0, 0.1, 0.4, 0.45, 1.0];
    let values = times_s.iter().map(|t| 1.0 + t - 3.0 * t * t).collect();
    let table = Waveform::Table(Table { times_s, values, interpolation: Interpolation::Cubic });
    for n in 0..=100 {
        let t = 0.01 * f64::from(n);
        assert!((table.value(at(t)) - (1.0 + t - 3.0 * t * t)).abs() < 1e-15);
        assert!((table.slope(at(t)) - (1.0 - 6.0 * t)).abs() < 1e-13);
    }
}

/// A sine that has run for 2^52 steps is as good as a new one: the exact value is that of `functions.csv`'s kind.
#[test]
fn late_steps_are_as_good_as_early_ones() {
    let sine = |frequency_hz| {
        Waveform::Sine(Sine {
            amplitude: 1.0,
            frequency_hz,
            phase_rad: 0.0,
            ramp_s: 0.0,
            until_s: None,
            ramp_down_s: 0.0,
        })
    };
    // a step of 2^−20 s and 2^15 + 2^−6 Hz: turns of step n are n·(2^−5 + 2^−26), exactly
    let wave = sine(32_768.015_625);
    let dt_s = 2.0_f64.powi(-20);
    let early = wave.value(Moment::new(5, dt_s, 0.0));
    assert_eq!(wave.value(Moment::new(5 + (1 << 26), dt_s, 0.0)), early);
    assert_eq!(wave.value(Moment::new(5 + (1 << 51), dt_s, 0.0)), early);
}

#[test]
fn tables_are_read_from_text() {
    let table =
        table_from_csv("# from a sensor\ntime;force\n0;1\n\n0.5\t2 # mid\n 1,  -3e0\n").expect("a table");
    assert_eq!((table.times_s, table.values), (vec![0.0, 0.5, 1.0], vec![1.0, 2.0, -3.0]));
    for (text, expected) in [
        ("0,1\n0.5\n", "line 2: found \"0.5\""),
        ("0,1\n0.5,x\n", "line 2"),
        ("t,x\nt,x\n", "line 2"),
        ("0,1,2\n", "line 1"),
        ("t,x\n0,1\n", "found 1 rows"),
        ("O,5\n1,1\n2,1\n", "line 1: found \"O,5\""),
        ("0,0x1\n1,1\n2,1\n", "line 1"),
        (",5\n1,1\n2,1\n", "line 1"),
        ("t,,x\n0,,1\n1,,1\n", "line 2"),
    ] {
        let error = table_from_csv(text).expect_err(text);
        assert!(error.contains(expected), "{text}: {error}");
    }
}

/// Pins the bits: these change only together with the kernel version. FNV-1a of the values and slopes, each number as one, without
/// signs of zeros.
#[test]
fn bits_are_pinned() {
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    for waveform in all() {
        for step in [0, 1, 7, 100, 101, 1000, 123_456] {
            for after_s in [0.0, 0.0007] {
                let (value, slope) = waveform.value_and_slope(Moment::new(step, 0.0017, after_s));
                for number in [value, slope] {
                    hash = (hash ^ (number + 0.0).to_bits()).wrapping_mul(0x0100_0000_01b3);
                }
            }
        }
    }
    assert_eq!(hash, 0x1876_be18_8146_b1e7, "{hash:#018x}");
}

//! Names, words and exit codes, as a person and a script meet them.

use crate::harness::{Ended, Place, Running, wait_until};
use crate::recordings::in_a_namespace;
use serde_json::Value;
use std::ffi::OsStr;
use std::fs;
use std::os::unix::ffi::OsStrExt;
use std::path::Path;

const PROGRAM: &str = env!("CARGO_BIN_EXE_beadline");
const SHORT: &str = "run --preset homogeneous --beads 20 --duration 1e-4 --force";
const PACED: &str = "run --preset homogeneous --pace 1e-3 --name paced";

/// A configuration without a name.
const CONFIGURATION: &str = "[chain]\nbeads = 20\nbead_mass_kg = 1e-3\nalpha = 1.5\nstiffness = 1e7\n\
    impurities = [{ bead = 5, mass_kg = 1e-3 }]\n[striker]\nbead = 0\nvelocity_m_s = 5.0\n\
    [time]\nduration_s = 1e-4\n[stream]\nrecord_every_steps = 1\n";

/// Runs a script of bash in the place.
fn bash(place: &Place, script: &str) -> Ended {
    Running::start(script, place.foreign("bash", ["-c", script])).wait()
}

/// The object on the last line of stderr.
#[track_caller]
fn told(ended: &Ended) -> Value {
    let stderr = ended.stderr();
    let told: Value = serde_json::from_str(stderr.lines().last().unwrap_or_default())
        .unwrap_or_else(|error| panic!("{error}: {stderr}"));
    assert_eq!(told["error"]["exit_code"].as_i64(), ended.code().map(i64::from), "{stderr}");
    told["error"].clone()
}

#[test]
fn any_file_name_makes_a_name() {
    let place = Place::new();
    for (file, name) in [
        ("run_01.toml", "run-01"),
        ("Dimer.toml", "dimer"),
        ("Körner 3.toml", "korner-3"),
        ("鎖.toml", "run"),
    ] {
        place.write(file, CONFIGURATION);
        let run = Running::start(file, place.command(["run", file, "--json"])).wait().exits(0);
        let said = format!("{file}: the run is called {name}");
        assert_eq!(run.stderr().matches(&said).count(), 1, "{}", run.stderr());
        assert_eq!(run.json()["run"], name);
        assert!(place.path(format!("{name}.mcap")).exists());
    }
    place.write("plain.toml", CONFIGURATION);
    let plain = place.run("run plain.toml").exits(0);
    assert!(!plain.stderr().contains("is called"), "{}", plain.stderr());
}

/// A name that is given is taken as it is, or refused.
#[test]
fn names_do_not_begin_with_a_dash() {
    let place = Place::new();
    Running::start("dash", place.command(["run", "--name=-x", "--no-record"]))
        .wait()
        .exits(2)
        .says(&["--name", "`-x`", "`x`"]);
    place.run("run --name Dimer").exits(2).says(&["--name", "`Dimer`", "such as `dimer`"]);
    place.write("named.toml", &format!("name = \"-Dimer\"\n{CONFIGURATION}"));
    place.run("run named.toml").exits(2).says(&["named.toml:1: name", "`-Dimer`", "such as `dimer`"]);
    place.run("energies live:-x").exits(2).says(&["`-x`", "such as `x`"]);
}

/// Words that only a parser, or only Rust, knows.
const LEAKS: [&str; 16] = [
    "invalid digit",
    "float literal",
    "u64",
    "f64",
    "usize",
    "exactly 1 element",
    "variant",
    "sequence",
    "invalid type",
    "Os {",
    "::",
    " inf ",
    "fit in target type",
    "struct ",
    "non-zero",
    "panicked",
];

#[track_caller]
fn is_plain(ended: &Ended, expected: &str) {
    let said = ended.stderr();
    let leak = LEAKS.iter().find(|leak| said.contains(**leak));
    assert!(leak.is_none(), "`{}` in: {said}", leak.unwrap());
    assert!(said.contains(expected), "`{expected}` is not in: {said}");
}

/// Every flag that takes a number, with what is none.
#[test]
fn wrong_flags_are_refused_in_plain_words() {
    let place = Place::new();
    place.run(&format!("{SHORT} --name run")).exits(0);
    let commands = [
        (
            "run --no-record",
            "beads alpha stiffness bead-mass impurity striker duration dt method publish-every-steps \
            record-every-steps wait-for pace stall-timeout flush-period sync-period preset name",
        ),
        ("energies run.mcap", "split from until jobs timeout dpi size"),
        ("impurity run.mcap", "bead"),
        ("contacts run.mcap", "tolerance"),
        ("deformation run.mcap", "contact"),
        ("pulses run.mcap", "threshold"),
        ("forces run.mcap --at bead:1", "at threshold"),
        ("spectrum run.mcap --at bead:1", "at segment max-frequency"),
        ("modes --preset precompressed --shapes", "mode"),
        ("plot run.mcap --what velocity", "at frame beads colours"),
        ("film run.mcap --out f.gif", "seconds size field from until beads colours range jobs"),
        ("record --out r.mcap", "split-size split-duration min-free record-every-steps flush-period timeout"),
        ("replay run.mcap", "rate from until wait-for stall-timeout name"),
        ("thin run.mcap --out t.mcap", "every-steps jobs"),
        ("export run.mcap --out e.npz", "every-steps beads clouds from to"),
        ("sweep s.toml --out s", "jobs shard"),
    ];
    for (command, flags) in commands {
        for flag in flags.split_whitespace() {
            for value in ["x!", "-1.5e", "1e!"] {
                let words = format!("{command} --{flag}={value}");
                let ended = place.run(&words);
                assert_eq!(ended.code(), Some(2), "{words}: {}", ended.stderr());
                is_plain(&ended, flag);
            }
        }
    }
    // numbers that are none for this flag
    for (words, expected) in [
        ("run --beads=1", "--beads (chain.beads): found 1; allowed: 2 to"),
        ("run --beads=-5", "expected a whole number, 0 or more"),
        ("run --beads=1.5", "expected a whole number, 0 or more"),
        ("run --beads=99999999999999999999999", "expected a whole number, 0 or more"),
        ("run --alpha=nan", "--alpha (chain.alpha): found NaN; allowed"),
        ("run --alpha=0.5", "--alpha (chain.alpha): found 0.5; allowed"),
        ("run --stiffness=-1", "--stiffness (chain.stiffness): found -1; allowed"),
        ("run --duration=0", "--duration"),
        ("run --duration=inf", "--duration"),
        ("run --dt=1", "--dt"),
        ("run --impurity=99999=1", "--impurity"),
        ("run --striker=99999=1", "--striker"),
        ("run --publish-every-steps=0", "--publish-every-steps"),
        ("run --record-every-steps=0", "--record-every-steps"),
        ("run --out=/proc/x.mcap", "stores no files"),
        ("run --out=x.txt", ".mcap"),
        ("energies run.mcap --split=99", "--split 99: the chain has beads 0 to 19"),
        ("energies run.mcap --from=1", "--from 1: the run ends at"),
        ("contacts run.mcap --tolerance=-1", "--tolerance"),
        ("contacts run.mcap --tolerance=nan", "--tolerance"),
        ("pulses run.mcap --threshold=nan", "--threshold"),
        ("deformation run.mcap --contact=99", "--contact 99"),
        ("energies run.mcap --figure a.svg --figure ./a.svg", "./a.svg is named for two outputs"),
        ("forces run.mcap --at bead:20", "bead:20: the chain has beads 0 to 19"),
        ("forces run.mcap --at wall:right", "wall:right: this end of the chain is free"),
        ("spectrum run.mcap --at contact:19", "contact:19: the chain has contacts 0 to 18"),
        ("spectrum run.mcap", "say where, such as --at bead:20"),
        ("spectrum run.mcap --map --of force", "--map is of the velocity"),
        ("spectrum run.mcap --at bead:1 --segment 15", "an even number of samples"),
        ("spectrum run.mcap --at bead:1 --segment 1000000", "cannot fill a segment"),
        ("modes run.mcap", "contact 0 is not pressed together at rest"),
        ("modes --preset precompressed --shapes --mode 201", "--mode 201: the chain has modes 1 to 200"),
        ("plot run.mcap --what velocity --at 1", "--at"),
        ("plot run.mcap --what velocity --frame 99999", "frame"),
        ("plot run.mcap --what velocity --beads 5..5", "--beads 5..5"),
        ("replay run.mcap --from=0.2", "there is no frame from 0.2 s on; recorded is 0 s to"),
        ("thin run.mcap --out t.mcap --every-steps=0", "--every-steps 0"),
        ("expand run.mcap --out t.mcap --every-steps=0", "--every-steps 0"),
        ("export run.mcap --out e.npz --clouds=0", "expected a whole number, 1 or more"),
        ("export run.mcap --out e.xyz", "--to"),
        ("sweep s.toml --out s --shard 2/2", "expected I/N"),
        ("preset nothing", "light-impurity"),
        ("run --preset nothing", "light-impurity"),
        ("reproduce nothing", "there is no figure `nothing`"),
    ] {
        let ended = place.run(words);
        assert_eq!(ended.code(), Some(2), "{words}: {}", ended.stderr());
        is_plain(&ended, expected);
    }
}

/// Every key of a configuration with values of the wrong type and beyond what is allowed, in a run and in a sweep.
#[test]
fn wrong_configurations_are_refused_in_plain_words() {
    let place = Place::new();
    let keys =
        CONFIGURATION.lines().enumerate().filter_map(|(i, line)| Some((i + 1, line.split_once(" = ")?.0)));
    for (line, key) in keys {
        for value in
            ["\"x\"", "-1", "nan", "true", "[]", "{}", "[{}]", "1979-05-27", "99999999999999999999", "'"]
        {
            let lines = CONFIGURATION.lines().enumerate();
            let text: Vec<String> = lines
                .map(|(i, text)| if i + 1 == line { format!("{key} = {value}") } else { text.to_owned() })
                .collect();
            if (key, value) == ("impurities", "[]") || (key, value) == ("velocity_m_s", "-1") {
                continue; // they are right
            }
            place.write("wrong.toml", &text.join("\n"));
            let ended = place.run("run wrong.toml --no-record").exits(2);
            is_plain(&ended, &format!("wrong.toml:{line}: "));
            if value != "'" {
                is_plain(&ended, key);
            }
        }
    }
    for (text, expected) in [
        ("masses = { pattern_kg = [1e-3], taper = 1.1 }", "wrong.toml:5: chain.masses: found"),
        ("masses = { random = 3 }", "allowed: \"uniform\", or one of { pattern_kg"),
        ("masses = { list_kg = [1.0, \"x\"] }", "chain.masses.list_kg[1]: found \"x\"; allowed: a number"),
        ("stiffnesses = 3", "allowed: \"uniform\", \"radii\", or one of"),
        ("alhpa = 3", "unknown key `alhpa`; allowed: beads"),
    ] {
        place.write(
            "wrong.toml",
            &CONFIGURATION.replace("stiffness = 1e7", &format!("{text}\nstiffness = 1e7")),
        );
        is_plain(&place.run("run wrong.toml --no-record").exits(2), expected);
    }
    for (text, expected) in [
        (
            "[base]\npreset = \"homogeneous\"\n[grid]\n\"chain.beads\" = [\"many\"]\n",
            "chain.beads: found \"many\"; allowed: a whole number",
        ),
        ("[base]\npreset = 3\n", "base.preset"),
        ("[base]\npreset = \"homogeneous\"\nchain.masses = { taper = 1.0, list_kg = [] }\n", "chain.masses"),
        ("until = 3\n[base]\npreset = \"homogeneous\"\n", "sweep.toml:1: until: found 3; allowed"),
        ("[grid]\n", "a sweep needs a [base]"),
        ("[base\n", "sweep.toml:1"),
    ] {
        place.write("sweep.toml", text);
        is_plain(&place.run("sweep sweep.toml --out rows").exits(2), expected);
    }
}

/// A program that asks for JSON gets errors as JSON, also about the command line itself.
#[test]
fn errors_are_json_where_results_are() {
    let place = Place::new();
    place.write("not.mcap", "something else");
    for (words, code, message) in [
        ("info no.mcap --json", 2, "cannot read no.mcap"),
        ("verify not.mcap --json", 2, "not.mcap is not an MCAP file"),
        ("run --beads 1 --json", 2, "--beads (chain.beads): found 1"),
        ("run --beads x --json", 2, "invalid value 'x' for '--beads <N>': expected a whole number"),
        ("run --json --colour", 2, "unexpected argument '--colour'"),
        ("--json nonsense", 2, "unexpected argument '--json'"),
        ("energies live:no --timeout 0.1 --json", 1, "no run no was published"),
        ("sweep no.toml --out rows --json", 2, "no.toml"),
        ("thin not.mcap --every-steps 2 --out t.mcap --json", 2, "not an MCAP file"),
        ("export not.mcap --out t.npz --json", 2, "not an MCAP file"),
        ("recover not.mcap --out t.mcap --json", 2, "not an MCAP file"),
        ("record --out no/r.mcap --json", 2, "no/r.mcap"),
        ("replay not.mcap --json", 2, "not an MCAP file"),
        ("reproduce nothing --json", 2, "nothing"),
        ("ls --json --names", 2, "cannot be used with"),
    ] {
        let ended = place.run(words).exits(code);
        let told = told(&ended);
        let said = told["message"].as_str().unwrap();
        assert!(said.contains(message) && !said.starts_with("error"), "{words}: {told}");
        assert!(told["causes"].is_array() && ended.stdout().is_empty(), "{words}: {told}");
    }
    let missing = told(&place.run("info no.mcap --json"));
    assert_eq!(missing["causes"][0], "No such file or directory (os error 2)");
    // in words without it
    let words = place.run("info no.mcap").exits(2).stderr();
    assert_eq!(words, "beadline: cannot read no.mcap: No such file or directory (os error 2)\n");
}

#[test]
fn physics_and_provenance_are_at_the_top_of_info() {
    let place = Place::new();
    place.run(&format!("{SHORT} --name run")).exits(0);
    let info = place.run("info run.mcap --json").exits(0).json();
    assert_eq!(info["physics"]["beads"], 20);
    assert_eq!(info["provenance"]["name"], "run");
    assert_eq!(info["physics"], info["manifest"]["physics"], "older programs look there");
}

/// What is no recording is told with what to do.
#[test]
fn a_table_is_told_from_a_recording() {
    let place = Place::new();
    place.write("results.csv", "index,alpha\n0,1.5\n");
    place.run("energies results.csv").exits(2).says(&["results.csv", "pandas", "recording (.mcap)"]);
    place.run("plot results.csv --what velocity").exits(2).says(&["--what", "results.csv is a table"]);
    place.write("mine.toml", CONFIGURATION);
    place.run("info mine.toml").exits(2).says(&["`beadline run`"]);
}

/// A table that the disk does not take is removed, since it would only fill the disk; what was said to be kept is.
#[test]
fn a_full_disk_is_not_kept_full() {
    let place = Place::new();
    place.run("run --preset homogeneous --duration 0.02 --record-every-steps 1000 --name run").exits(0);
    fs::create_dir(place.path("small")).unwrap();
    for (command, file) in [
        ("impurity run.mcap --every-step --bead 1 --bead 2 --bead 3 --bead 4 --out", "e.csv"),
        ("energies run.mcap --every-step --out", "e.parquet"),
        ("export run.mcap --every-step --out", "e.npz"),
        ("export run.mcap --every-step --out", "e.csv"),
    ] {
        let script = format!(
            "mount -t tmpfs -o size=512k tmpfs small && {{ {PROGRAM} {command} small/{file}; code=$?; ls small >left.txt; exit $code; }}"
        );
        let Some(ended) = in_a_namespace(&place, &script) else { return };
        let ended = ended.exits(1).says(&[
            file,
            "the part that was written is removed",
            "make room",
            "No space left",
        ]);
        assert!(
            !ended.stderr().contains("ZipWriter") && !ended.stderr().contains("Os {"),
            "{}",
            ended.stderr()
        );
        assert_eq!(place.read("left.txt"), "", "{command} {file}");
    }
}

/// `run && next` stops, whichever way a run is asked to end.
#[test]
fn who_is_asked_to_stop_exits_with_3() {
    for signal in ["INT", "TERM", "HUP"] {
        let place = Place::new();
        let run = place.start(&format!("{PACED} --json"));
        let energies = place.start("energies --json");
        let seen_out = place.start("impurity --json");
        let recorder = place.start("record --out r.mcap --json");
        place.wait_for_run("paced", |run| run.step > 20 && run.lossless == 3);
        energies.signal(signal);
        assert_eq!(energies.wait().exits(3).says(&["the run goes on"]).json()["end"], "stopped");
        recorder.signal(signal);
        assert_eq!(recorder.wait().exits(3).json()["end"], "detached");
        run.signal(signal);
        assert_eq!(run.wait().exits(3).json()["end"], "interrupted");
        // it has seen all that there is
        assert_eq!(seen_out.wait().exits(0).json()["end"], "interrupted");
        place.run("info paced.mcap").exits(0);
        let waiting = place.start("energies live:never --json");
        wait_until("the handler", || {
            let status = fs::read_to_string(format!("/proc/{}/status", waiting.id())).ok()?;
            let caught = status.lines().find_map(|line| line.strip_prefix("SigCgt:"))?.trim().to_owned();
            let caught = u64::from_str_radix(&caught, 16).ok()?;
            (caught & 1 != 0).then_some(()) // of SIGHUP, the last one
        });
        waiting.signal(signal);
        assert_eq!(told(&waiting.wait().exits(3))["message"], "stopped while waiting for a run");
    }
}

/// A terminal that goes away does not end what was started to outlive it.
#[test]
fn nohup_is_respected() {
    let place = Place::new();
    let script = format!("trap '' HUP; exec {PROGRAM} {PACED} --no-record");
    let mut run = Running::start(&script, place.foreign("bash", ["-c", &script]));
    place.wait_for_run("paced", |run| run.step > 20);
    run.signal("HUP");
    let before = place.wait_for_run("paced", |_| true).step;
    place.wait_for_run("paced", |run| run.step > before + 20);
    assert!(run.is_running());
    run.signal("TERM");
    run.wait().exits(3);
}

/// A second Ctrl-C does not wait, and says where everything is.
#[test]
fn a_second_signal_says_what_is_left() {
    let place = Place::new();
    let run = place.start(&format!("{PACED} --flush-period 0.01 --wait-for 1"));
    let stuck = place.start("energies live:paced");
    place.wait_for_run("paced", |run| run.step > 100);
    stuck.signal("STOP");
    // the run is held back by a consumer that is stopped, and its end is not at once
    run.signal("INT");
    run.signal("TERM");
    let ended = run.wait();
    if ended.code() == Some(1) && place.path("paced.mcap").exists() {
        // the recording was finished before the second signal came; what is said depends on how long before
        ended.says(&["ended at once", "paced.mcap"]);
        place.run("verify paced.mcap").exits(0);
    } else if ended.code() == Some(1) {
        let ended =
            ended.says(&["ended at once", "paced.mcap.partial", "beadline run --resume paced.mcap.partial"]);
        assert!(!ended.stderr().contains("panicked"));
        place.run("run --resume paced.mcap.partial --out whole.mcap --name other").exits(2);
        place.run("run --resume paced.mcap.partial --out whole.mcap").exits(0);
        place.run("verify whole.mcap").exits(0);
    } else {
        // it was faster than the second signal
        ended.exits(3);
    }
}

/// Names come from other people's files: a terminal shows them, and does not obey them.
#[test]
fn what_turns_the_direction_of_writing_is_escaped() {
    let place = Place::new();
    let name = "a\u{202e}b\u{9b}c\u{7f}d.mcap";
    place.run(&format!("{SHORT} --name run")).exits(0);
    fs::rename(place.path("run.mcap"), place.path(name)).unwrap();
    for json in [None, Some("--json")] {
        for file in [name, "no\u{202e}\u{9b}\u{7f}.mcap"] {
            let arguments = ["info", file].into_iter().chain(json);
            let ended = Running::start(file, place.command(arguments)).wait();
            let printed = ended.stdout() + &ended.stderr();
            assert!(!printed.contains(['\u{202e}', '\u{9b}', '\u{7f}']), "{printed:?}");
            assert!(
                printed.contains("202e") && printed.contains("9b") && printed.contains("7f"),
                "{printed}"
            );
            if json.is_some() && file == name {
                assert_eq!(ended.json()["path"], name);
            }
        }
    }
}

/// A name may have any bytes but 0 and `/`: results name it as well as JSON can, and lists have a line for it.
#[test]
fn a_name_that_is_no_text_is_told_as_well_as_can_be() {
    let place = Place::new();
    let name = OsStr::from_bytes(b"a\xff\nb.mcap");
    let told = "a\u{fffd}\nb.mcap";
    place.run(&format!("{SHORT} --name run")).exits(0);
    fs::rename(place.path("run.mcap"), place.path(name)).unwrap();
    let run = |words: &str| {
        let words_and_name = words.split_whitespace().map(OsStr::new).chain([name]);
        Running::start(words, place.command(words_and_name)).wait().exits(0)
    };
    for (words, key) in
        [("info --json", "path"), ("verify --json", "file"), ("replay --json --wait-for 0", "path")]
    {
        assert_eq!(run(words).json()[key], told, "{words}");
    }
    assert_eq!(run("share --json").json()["path"], told.replace("mcap", "html"));
    assert_eq!(
        place.run("ls . --json").exits(0).json()[0]["path"].as_str().unwrap().matches(told).count(),
        1
    );
    for words in ["ls . --names", "ls ."] {
        let lines = place.run(words).exits(0).stdout();
        assert!(lines.contains("a\u{fffd}\\nb.mcap"), "{lines}");
    }
}

/// Results that nobody can have got are an error.
#[test]
fn a_closed_stdout_is_an_error() {
    let place = Place::new();
    place.run(&format!("{SHORT} --name run")).exits(0);
    bash(&place, &format!("{PROGRAM} info run.mcap >&-")).exits(1).says(&["stdout is closed"]);
    for words in ["info run.mcap", "--help", "run --help", "--version"] {
        bash(&place, &format!("{PROGRAM} {words} >/dev/full")).exits(1).says(&["stdout", "No space left"]);
    }
    // as Python opens it for a child
    bash(&place, &format!("{PROGRAM} info run.mcap 1<>/dev/null")).exits(0);
}

/// Limits of the process are named where they are the reason.
#[test]
fn tight_limits_are_named() {
    let place = Place::new();
    let run = format!("{PROGRAM} {SHORT} --name run --no-record");
    bash(&place, &format!("ulimit -n 32; {run}")).exits(1).says(&["32 files", "ulimit -n 256"]);
    // raised by itself as far as it may be
    bash(&place, &format!("ulimit -S -n 32; {run}")).exits(0);
    place.run("run --duration 8e-3 --name big --record-every-steps 100").exits(0);
    // the least memory in which the program says its name
    let starts = |limit_kb: &u32| {
        let script = format!("ulimit -c 0; ulimit -v {limit_kb}; exec {PROGRAM} --version");
        bash(&place, &script).code() == Some(0)
    };
    let least_kb = (20_000..1_000_000).step_by(1000).find(starts).unwrap();
    for limit_kb in [12_000, 24_000, 64_000].map(|more| least_kb + more) {
        for command in [
            "energies big.mcap --figure e.png --force",
            "pulses big.mcap --every-step --jobs 8",
            "run --beads 1000000 --duration 1e-6 --name v --force",
        ] {
            let ended = bash(
                &place,
                &format!("ulimit -c 0; unset RUST_BACKTRACE; ulimit -v {limit_kb}; exec {PROGRAM} {command}"),
            );
            let (code, said) = (ended.code(), ended.stderr());
            assert!(matches!(code, Some(0 | 1)), "{limit_kb} {command}: {code:?} {said}");
            assert!(code == Some(0) || said.contains("ulimit -v"), "{limit_kb} {command}: {said}");
            assert!(!said.contains("panicked"), "{said}");
        }
    }
}

/// Not less is left on a disk than was asked for, also with results in small chunks and parts.
#[test]
fn room_that_is_to_be_left_is_left() {
    let place = Place::new();
    fs::create_dir(place.path("small")).unwrap();
    let script = format!(
        "mount -t tmpfs -o size=8m tmpfs small && {{ \
         {PROGRAM} record --out small/run.mcap --min-free 4MB --split-size 100kB --flush-period 0.001 --timeout 60 & recorder=$!; \
         for analysis in contacts energies pulses; do {PROGRAM} $analysis live:small --timeout 60 >/dev/null 2>&1 & done; \
         {PROGRAM} run --name small --no-record --wait-for 4 --duration 0.04 >/dev/null 2>&1; \
         wait $recorder; code=$?; stat -f -c '%a %S' small >free.txt; exit $code; }}"
    );
    let Some(ended) = in_a_namespace(&place, &script) else { return };
    ended.exits(3).says(&["nearly full", "the run goes on"]);
    let free: Vec<u64> =
        place.read("free.txt").split_whitespace().map(|number| number.parse().unwrap()).collect();
    assert!(free[0] * free[1] >= 4_000_000, "{} bytes are left", free[0] * free[1]);
}

/// What bash makes of a line that ends with a tab.
fn completed(place: &Place, line: &str) -> Vec<String> {
    let script = format!(
        "PATH={}:$PATH; source <(beadline completions bash); COMP_LINE='{line}'; COMP_POINT=${{#COMP_LINE}}; \
         COMP_WORDS=({}); COMP_CWORD=$(( ${{#COMP_WORDS[@]}} - 1 )); \
         complete -p beadline >/dev/null || exit 1; function=$(complete -p beadline | sed 's/.*-F \\([^ ]*\\).*/\\1/'); \
         $function beadline \"${{COMP_WORDS[COMP_CWORD]}}\" \"${{COMP_WORDS[COMP_CWORD-1]}}\"; printf '%s\\n' \"${{COMPREPLY[@]}}\"",
        Path::new(PROGRAM).parent().unwrap().display(),
        // bash breaks words at colons
        line.replace(':', " : ") + if line.ends_with(' ') { "''" } else { "" },
    );
    let ended = bash(place, &script).exits(0);
    ended.stdout().lines().map(str::to_owned).collect()
}

#[test]
fn shells_complete_presets_and_live_runs() {
    let place = Place::new();
    place.write("lively.mcap", "");
    let run = place.start(&format!("{PACED} --no-record"));
    place.wait_for_run("paced", |run| run.step > 0);
    assert_eq!(completed(&place, "beadline run --preset heavy"), ["heavy-impurity"]);
    assert_eq!(completed(&place, "beadline preset homo"), ["homogeneous"]);
    assert_eq!(completed(&place, "beadline energies live:p"), ["paced"], "what bash puts behind the colon");
    assert_eq!(completed(&place, "beadline energies live"), ["live", "live:paced", "lively.mcap"]);
    assert_eq!(completed(&place, "beadline record --timeout 3 live:x"), [""]);
    assert_eq!(completed(&place, "beadline info live"), [""], "no live runs there");
    assert!(completed(&place, "beadline energies --out liv").contains(&"lively.mcap".to_owned()));
    assert_eq!(place.run("ls --names").exits(0).stdout(), "paced\n");
    run.signal("INT");
    run.wait().exits(3);
    assert_eq!(place.run("ls --names").exits(0).stdout(), "");
    for shell in ["zsh", "fish"] {
        let script = place.run(&format!("completions {shell}")).exits(0).stdout();
        assert!(script.contains("ls --names") && script.contains("heavy-impurity"), "{shell}");
    }
}

#[test]
fn each_command_says_in_a_line_of_its_own_what_it_does() {
    let place = Place::new();
    let help = place.run("--help").exits(0).stdout();
    let commands = help.split("Options:").next().unwrap().lines().filter(|line| line.starts_with("  "));
    let lines: Vec<&str> = commands
        .filter_map(|line| line.trim_start().split_once("  "))
        .map(|(_, about)| about.trim())
        .collect();
    let unlike: std::collections::BTreeSet<_> = lines.iter().collect();
    assert!(lines.len() > 30 && unlike.len() == lines.len(), "{help}");
}

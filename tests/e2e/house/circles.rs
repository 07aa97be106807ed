//! Circles of imports between modules that lie beside each other.

use super::counts::BUDGETS;
use super::source::{Source, files, read, root};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// Directories, and modules in them that import each other. None is added or grows; one that is cut leaves the list.
const KNOWN: [(&str, &str); 2] = [
    (
        "schemas/bus/src/transport",
        "backpressure board creating delivery leftovers manifest_file position room root services shared_segment",
    ),
    ("schemas/recording/src", "proto read repair results write"),
];

/// The names of a module or of an item, from the root of its crate.
type Names = Vec<String>;

/// Modules and those that each of them imports.
type Imports = BTreeMap<String, BTreeSet<String>>;

/// Paths in `code` that begin with `start`, of which groups are taken apart. What is known by another name ends with that.
fn paths(code: &str, start: &str) -> Vec<Names> {
    let is_word = |letter: char| letter.is_alphanumeric() || letter == '_';
    let mut found = Vec::new();
    for (at, _) in code.match_indices(start) {
        if code[..at].ends_with(|before: char| is_word(before) || before == ':' || before == '$') {
            continue;
        }
        let mut rest = code[at..].trim_start_matches("use ");
        let (mut path, mut groups) = (Names::new(), Vec::new());
        loop {
            rest = rest.trim_start().trim_start_matches("::");
            let (word, behind) = rest.split_at(rest.find(|letter| !is_word(letter)).unwrap_or(rest.len()));
            if !word.is_empty() {
                path.extend(["as", "self"].iter().all(|name| *name != word).then(|| word.to_owned()));
                rest = behind;
            } else if let Some(behind) = rest.strip_prefix('{') {
                groups.push(path.len());
                rest = behind;
            } else {
                found.push(path.clone());
                if rest.starts_with('}') {
                    groups.pop();
                }
                path.truncate(groups.last().copied().unwrap_or(0));
                if groups.is_empty() || !rest.starts_with([',', '}']) {
                    break;
                }
                rest = &rest[1..];
            }
        }
    }
    found
}

/// The path from the root of the crate of one that stands in `module`.
fn absolute(module: &[String], path: &[String]) -> Names {
    let (mut base, mut rest) = (module.to_vec(), path);
    while let Some((first, behind)) = rest.split_first() {
        match first.as_str() {
            "crate" => base.clear(),
            "super" => drop(base.pop()),
            _ => break,
        }
        rest = behind;
    }
    [&base, rest].concat()
}

/// Each module of a crate: what its names stand for, and what it uses.
struct Modules(BTreeMap<Names, (BTreeMap<String, Names>, Vec<Names>)>);

impl Modules {
    fn of_crate(directory: &Path) -> Self {
        let mut modules = BTreeMap::<Names, (BTreeMap<_, _>, Vec<_>)>::new();
        for source in Source::of_crate(directory) {
            let path = source.path.strip_prefix(directory.join("src")).unwrap().with_extension("");
            let names = path.iter().map(|name| name.to_str().unwrap().to_owned());
            let module: Names = names.filter(|name| name != "lib" && name != "main").collect();
            let code = source.code().collect::<Vec<_>>().join("\n");
            let named = paths(&code, "use ").into_iter();
            let named: Vec<_> =
                named.filter_map(|path| Some((path.last()?.clone(), absolute(&module, &path)))).collect();
            let used = ["crate::", "super::"].into_iter().flat_map(|start| paths(&code, start));
            let used: Vec<_> = used.map(|path| absolute(&module, &path)).collect();
            let (all_named, all_used) = modules.entry(module).or_default();
            all_named.extend(named);
            all_used.extend(used);
        }
        Self(modules)
    }

    /// The module that defines what is at `path`.
    fn owner(&self, path: &[String], most_steps: usize) -> Names {
        let length = (0..=path.len()).rev().find(|length| self.0.contains_key(&path[..*length])).unwrap_or(0);
        let (module, rest) = path.split_at(length);
        let target = rest.first().and_then(|name| self.0.get(module)?.0.get(name)).filter(|_| most_steps > 0);
        target.map_or(module.to_vec(), |target| self.owner(&[target, &rest[1..]].concat(), most_steps - 1))
    }

    /// In each module, which of its modules import which others of them.
    fn imports(&self) -> BTreeMap<Names, Imports> {
        let mut found = BTreeMap::<Names, Imports>::new();
        for (from, (_, used)) in &self.0 {
            for to in used.iter().map(|path| self.owner(path, 8)) {
                let shared = from.iter().zip(&to).take_while(|(one, other)| one == other).count();
                if let (Some(one), Some(other)) = (from.get(shared), to.get(shared)) {
                    let beside = found.entry(from[..shared].to_vec()).or_default();
                    beside.entry(one.clone()).or_default().insert(other.clone());
                }
            }
        }
        found
    }
}

/// The modules that each module of the Python package imports while it runs.
fn python_imports(directory: &Path) -> Imports {
    let module = |path: &Path| {
        let mut is_for_types = false;
        let mut imported = BTreeSet::new();
        for line in read(path).lines().filter(|line| !line.is_empty()) {
            if !line.starts_with(' ') {
                is_for_types = line.starts_with("if TYPE_CHECKING");
            }
            let line = line.trim_start();
            if let Some(names) = line.strip_prefix("from . import ") {
                imported.extend(names.split(", ").map(str::to_owned).filter(|_| !is_for_types));
            } else if let Some((name, _)) = line.strip_prefix("from .").and_then(|rest| rest.split_once(' '))
            {
                imported.extend(Some(name.to_owned()).filter(|_| !is_for_types));
            }
        }
        (path.file_stem().unwrap().to_str().unwrap().to_owned(), imported)
    };
    files(directory, &["py"]).iter().map(|path| module(path)).collect()
}

/// Sets of modules that reach each other.
fn circles(imports: &Imports) -> BTreeSet<BTreeSet<String>> {
    let reached = |from: &String| {
        let (mut found, mut left) = (BTreeSet::new(), vec![from]);
        while let Some(next) = left.pop() {
            left.extend(imports.get(next).into_iter().flatten().filter(|used| found.insert((*used).clone())));
        }
        found
    };
    let reached: BTreeMap<_, _> = imports.keys().map(|from| (from, reached(from))).collect();
    let is_back = |from: &String, to: &String| reached.get(to).is_some_and(|back| back.contains(from));
    let circle = |from| reached[from].iter().filter(|to| is_back(from, to)).cloned().collect::<BTreeSet<_>>();
    imports.keys().map(circle).filter(|circle| circle.len() > 1).collect()
}

/// A directory, and modules in it that reach each other.
type Circle = (String, BTreeSet<String>);

fn is_part((place, part): &Circle, (other_place, whole): &Circle) -> bool {
    place == other_place && part.is_subset(whole)
}

#[test]
fn modules_beside_each_other_import_in_no_new_circle() {
    let mut found = Vec::new();
    for (name, _) in BUDGETS {
        let name = if name == "the command" { "" } else { name };
        for (module, imports) in Modules::of_crate(&root().join(name)).imports() {
            let place = Path::new(name).join("src").join(module.join("/")).display().to_string();
            let place = place.trim_end_matches('/').to_owned();
            found.extend(circles(&imports).into_iter().map(|circle| (place.clone(), circle)));
        }
    }
    let python = circles(&python_imports(&root().join("python/beadline")));
    found.extend(python.into_iter().map(|circle| ("python/beadline".to_owned(), circle)));
    let owned = |(place, names): &(&str, &str)| {
        ((*place).to_owned(), names.split(' ').map(str::to_owned).collect::<BTreeSet<_>>())
    };
    let known: Vec<Circle> = KNOWN.iter().map(owned).collect();
    let new: Vec<_> = found.iter().filter(|found| !known.iter().any(|known| is_part(found, known))).collect();
    let cut: Vec<_> = known.iter().filter(|known| !found.iter().any(|found| is_part(found, known))).collect();
    assert!(new.is_empty() && cut.is_empty(), "cut the new ones: {new:?}\ntake these out of KNOWN: {cut:?}");
}

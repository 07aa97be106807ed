//! ES modules as one script: each becomes a function that is called once, before those that import it.
//!
//! Modules keep to a small part of the language, so that this needs no parser: whole lines of
//! `import { a, b } from "./x.js";`, and `export` before a function, a class or a constant at the start of a line. Lines that
//! are comments, types within lines, and what lines are indented by, are left out, so that a shared page is small; but not
//! inside of a template.

use std::collections::BTreeSet;
use std::fmt::Write;

/// The modules of the page.
pub(crate) const MODULES: &[(&str, &str)] = &[
    ("actions", include_str!("../actions.js")),
    ("axes", include_str!("../axes.js")),
    ("baths", include_str!("../baths.js")),
    ("board", include_str!("../board.js")),
    ("caption", include_str!("../caption.js")),
    ("carried", include_str!("../carried.js")),
    ("chains", include_str!("../chains.js")),
    ("change", include_str!("../change.js")),
    ("changing", include_str!("../changing.js")),
    ("colouring", include_str!("../colouring.js")),
    ("colours", include_str!("../colours.js")),
    ("compare", include_str!("../compare.js")),
    ("comparing", include_str!("../comparing.js")),
    ("curves", include_str!("../curves.js")),
    ("difference", include_str!("../difference.js")),
    ("elements", include_str!("../elements.js")),
    ("engine", include_str!("../engine.js")),
    ("events", include_str!("../events.js")),
    ("exporting", include_str!("../exporting.js")),
    ("fields", include_str!("../fields.js")),
    ("film", include_str!("../film.js")),
    ("folder", include_str!("../folder.js")),
    ("gestures", include_str!("../gestures.js")),
    ("history", include_str!("../history.js")),
    ("kernel", include_str!("../kernel.js")),
    ("keyboard", include_str!("../keyboard.js")),
    ("keys", include_str!("../keys.js")),
    ("laws", include_str!("../laws.js")),
    ("live", include_str!("../live.js")),
    ("manifest", include_str!("../manifest.js")),
    ("map", include_str!("../map.js")),
    ("mcap", include_str!("../mcap.js")),
    ("notes", include_str!("../notes.js")),
    ("page", include_str!("../page.js")),
    ("pictures", include_str!("../pictures.js")),
    ("pieces", include_str!("../pieces.js")),
    ("pointer", include_str!("../pointer.js")),
    ("profile", include_str!("../profile.js")),
    ("prove", include_str!("../prove.js")),
    ("readout", include_str!("../readout.js")),
    ("recording", include_str!("../recording.js")),
    ("rows", include_str!("../rows.js")),
    ("ruler", include_str!("../ruler.js")),
    ("run", include_str!("../run.js")),
    ("spectrum", include_str!("../spectrum.js")),
    ("surface", include_str!("../surface.js")),
    ("tables", include_str!("../tables.js")),
    ("tabs", include_str!("../tabs.js")),
    ("taking", include_str!("../taking.js")),
    ("tasks", include_str!("../tasks.js")),
    ("thumbnails", include_str!("../thumbnails.js")),
    ("timeline", include_str!("../timeline.js")),
    ("view", include_str!("../view.js")),
    ("waveforms", include_str!("../waveforms.js")),
    ("webm", include_str!("../webm.js")),
    ("welch", include_str!("../welch.js")),
    ("worker", include_str!("../worker.js")),
    ("zip", include_str!("../zip.js")),
    ("zstd", include_str!("../zstd.js")),
];

/// Script that both the page and its worker run. The worker is made from the same text.
const START: &str = "typeof document === \"undefined\" ? worker_js.serve() : page_js.start();\n";

/// Texts that end a script, or hide a part of it, wherever they stand.
const REFUSED: [&str; 3] = ["</script", "<!--", "import.meta"];

/// The script of the page.
///
/// # Errors
/// When a module does not keep to the rules.
pub(crate) fn script(modules: &[(&str, &str)]) -> Result<String, String> {
    let modules: Vec<_> =
        modules.iter().map(|(name, text)| Module::read(name, text)).collect::<Result<_, _>>()?;
    let mut script = String::from("\"use strict\";\n");
    let mut done = BTreeSet::new();
    while done.len() < modules.len() {
        let is_next = |module: &&Module<'_>| {
            !done.contains(module.name) && module.imports.iter().all(|name| done.contains(name))
        };
        let Some(next) = modules.iter().find(is_next) else {
            let left: Vec<_> = modules.iter().filter(|module| !done.contains(module.name)).collect();
            let known = |name: &&str| modules.iter().any(|module| module.name == *name);
            let missing = left.iter().flat_map(|module| &module.imports).find(|name| !known(name));
            let names = left.iter().map(|module| module.name).collect::<Vec<_>>().join(", ");
            return Err(match missing {
                Some(missing) => format!("{missing}.js is imported, and not in the table of modules"),
                None => format!("modules import each other, or are named twice: {names}"),
            });
        };
        let (name, body, exports) = (next.name, &next.body, next.exports.join(", "));
        // writing to a String cannot fail
        let _ = write!(script, "const {name}_js = (() => {{\n{body}return {{ {exports} }};\n}})();\n");
        done.insert(name);
    }
    script.push_str(START);
    Ok(script)
}

struct Module<'a> {
    name: &'a str,
    imports: Vec<&'a str>,
    exports: Vec<&'a str>,
    body: String,
}

impl<'a> Module<'a> {
    fn read(name: &'a str, text: &'a str) -> Result<Self, String> {
        let lower = text.to_ascii_lowercase();
        if let Some(word) = REFUSED.into_iter().find(|word| lower.contains(word)) {
            return Err(format!("{name}.js: `{word}` cannot stand in a module"));
        }
        let mut module = Self { name, imports: Vec::new(), exports: Vec::new(), body: String::new() };
        let (mut is_comment, mut is_template) = (false, false);
        for (number, line) in (1..).zip(text.lines()) {
            let refused = || format!("{name}.js, line {number}: not a form that the page knows: {line}");
            if is_template {
                is_template = is_even(line);
                module.body.extend([line, "\n"]);
                continue;
            }
            let code = line.trim();
            if is_comment || (code.starts_with("/*") && !code.contains("*/")) {
                is_comment = !code.contains("*/");
                if !is_comment && !code.ends_with("*/") {
                    return Err(refused());
                }
                continue;
            }
            let is_one = code.starts_with("/*") && code.find("*/") == code.len().checked_sub(2);
            if code.is_empty() || code.starts_with("//") || is_one {
                continue;
            }
            if code.ends_with('\\') {
                return Err(refused());
            }
            is_template = !is_even(code);
            let line = if line.starts_with("import") {
                let (names, from) = import(line).ok_or_else(refused)?;
                module.imports.push(from);
                format!("const {{ {names} }} = {from}_js;")
            } else if let Some(rest) = line.strip_prefix("export ") {
                module.exports.push(declared(rest).ok_or_else(refused)?);
                rest.to_owned()
            } else if line.starts_with("export") {
                return Err(refused());
            } else {
                code.to_owned()
            };
            module.body.extend([&untyped(&line).ok_or_else(refused)?, "\n"]);
        }
        if is_template || is_comment {
            return Err(format!("{name}.js: a template or a comment has no end"));
        }
        Ok(module)
    }
}

/// A line without the comments that are types of values; none if one does not end in it.
fn untyped(line: &str) -> Option<String> {
    let mut parts = line.split("/** @");
    let mut code = parts.next()?.to_owned();
    for part in parts {
        code.push_str(part.split_once("*/")?.1.trim_start());
    }
    Some(code)
}

/// True if as many templates end as begin in a line.
fn is_even(line: &str) -> bool {
    line.matches('`').count().is_multiple_of(2)
}

/// The names and the module of `import { a, b } from "./x.js";`.
fn import(line: &str) -> Option<(&str, &str)> {
    let (names, from) = line.strip_prefix("import { ")?.split_once(" } from \"./")?;
    let from = from.strip_suffix(".js\";")?;
    (names.split(", ").all(is_name) && is_name(from)).then_some((names, from))
}

/// The name of `function NAME(`, `class NAME {` or `const NAME =`.
fn declared(line: &str) -> Option<&str> {
    let kinds = ["function ", "async function ", "class ", "const "];
    let rest = kinds.iter().find_map(|kind| line.strip_prefix(kind))?;
    let name = rest.split(|c: char| !(c.is_ascii_alphanumeric() || c == '_' || c == '$')).next()?;
    is_name(name).then_some(name)
}

fn is_name(text: &str) -> bool {
    let rest = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '$';
    text.starts_with(|c: char| rest(c) && !c.is_ascii_digit()) && text.chars().all(rest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn modules_become_one_script_in_the_order_of_their_imports() {
        let b = "import { one } from \"./a.js\";\n/** Doc. */\nexport async function two() {\n  // why\n  return one;\n}\n\n\
            /**\n * More.\n */\nconst own = /** @type {any} */ (two);\n  /** @type {any} */ (own).x = 1; /* y */\n";
        let found =
            script(&[("b", b), ("a", "export const one = 1;\n  const own = `\n  // a`;\n")]).expect("valid");
        let expected = "\"use strict\";\n\
            const a_js = (() => {\nconst one = 1;\nconst own = `\n  // a`;\nreturn { one };\n})();\n\
            const b_js = (() => {\nconst { one } = a_js;\nasync function two() {\nreturn one;\n}\n\
            const own = (two);\n(own).x = 1; /* y */\n\
            return { two };\n})();\n";
        assert_eq!(found, format!("{expected}{START}"));
    }

    #[test]
    fn other_forms_and_cycles_are_refused() {
        for text in [
            "import x from \"./a.js\";",
            "import { a as b } from \"./a.js\";",
            "import * as a from \"./a.js\";",
            "import { a } from \"a\";",
            "import \"./a.js\";",
            "import {",
            "export default 1;",
            "export { a };",
            "export * from \"./a.js\";",
            "export const { a } = b;",
            "export let a = 1;",
            "const a = \"</Script>\";",
            "// <!--",
            "import.meta.url;",
            "const a = `",
            "const a = \"\\",
            "/*\n*/ const a = 1;",
            "import { a } from \"./m.js\";",
            "import { a } from \"./missing.js\";",
        ] {
            assert!(script(&[("m", text)]).is_err(), "{text}");
        }
        let (a, b) = ("import { b } from \"./b.js\";\n", "import { a } from \"./a.js\";\n");
        assert!(script(&[("a", a), ("b", b)]).expect_err("a cycle").contains("a, b"));
    }
}

//! Links in folders that somebody looks at.

use crate::failure::Failure;
use std::path::Path;

/// Reason why a link that leads out of what is viewed is not opened.
pub(crate) const NOT_FOLLOWED: &str = "a link that leads out of this folder, or nowhere: it is not followed; view the file that it leads to by its own name";

/// Refuses a `path` in `folder` that leads to something that is not.
pub(crate) fn check_inside(path: &Path, folder: &Path) -> Result<(), Failure> {
    if leads_out(path, folder) { Err(bad_input!("{}: {NOT_FOLLOWED}", path.display())) } else { Ok(()) }
}

/// True if `path`, which is in `folder`, leads to something outside of it, or to nothing.
pub(crate) fn leads_out(path: &Path, folder: &Path) -> bool {
    match (path.canonicalize(), folder.canonicalize()) {
        (Ok(path), Ok(folder)) => !path.starts_with(folder),
        _ => true,
    }
}

#[cfg(test)]
mod tests {
    use super::leads_out;
    use std::fs;
    use std::os::unix::fs::symlink;

    #[test]
    fn links_lead_out_by_any_way_or_stay() {
        let place = tempfile::tempdir().expect("a directory");
        let at = |name: &str| place.path().join(name);
        fs::create_dir_all(at("folder/inner")).expect("made");
        // a name that begins as the folder's
        for name in ["folder/own", "folder-beside"] {
            fs::write(at(name), "").expect("written");
        }
        for (target, link) in [
            ("own", "folder/to-own"),
            ("../folder/own", "folder/around"),
            ("../folder-beside", "folder/beside"),
            ("to-nothing", "folder/nothing"),
            ("loop", "folder/loop"),
            ("beside", "folder/twice"),
            ("..", "folder/inner/up"),
            ("../..", "folder/inner/out"),
        ] {
            symlink(target, at(link)).expect("a link");
        }
        symlink("folder", at("by-link")).expect("a link");
        for (path, expected) in [
            ("folder/own", false),
            ("folder/to-own", false),
            ("folder/around", false),
            ("folder/inner/up/own", false),
            ("folder/beside", true),
            ("folder/nothing", true),
            ("folder/loop", true),
            ("folder/twice", true),
            ("folder/inner/out/folder-beside", true),
            ("folder/missing", true),
        ] {
            assert_eq!(leads_out(&at(path), &at("folder")), expected, "{path}");
        }
        assert!(!leads_out(&at("by-link/own"), &at("by-link")));
    }
}

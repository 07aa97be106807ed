use super::*;
use std::sync::Barrier;
use tempfile::TempDir;

fn place() -> (TempDir, PathBuf) {
    let directory = tempfile::tempdir().expect("directory");
    let path = directory.path().join("a.csv");
    (directory, path)
}

fn write(file: &WholeFile, text: &str) {
    file.file().as_ref().write_all(text.as_bytes()).expect("written");
}

#[test]
fn a_name_stands_for_a_whole_file() {
    let (_directory, path) = place();
    let file = WholeFile::create(&path, false).expect("new");
    write(&file, "half");
    assert!(!path.exists() && file.partial().exists());
    write(&file, " and half");
    assert_eq!(file.publish().expect("named"), path);
    assert_eq!(fs::read_to_string(&path).expect("there"), "half and half");
    assert!(!path.with_extension("csv.partial").exists());
}

#[test]
fn what_is_there_is_replaced_only_if_that_was_asked_for() {
    let (_directory, path) = place();
    let partial = path.with_extension("csv.partial");
    fs::write(&path, "mine").expect("written");
    assert!(matches!(WholeFile::create(&path, false), Err(WholeFileError::Exists { .. })));
    fs::rename(&path, &partial).expect("renamed");
    assert!(matches!(WholeFile::create(&path, false), Err(WholeFileError::PartialExists { .. })));
    assert_eq!(fs::read_to_string(&partial).expect("kept"), "mine");
    // nothing is lost of one that was killed before it wrote anything
    fs::write(&partial, "").expect("written");
    drop(WholeFile::create(&path, false).expect("empty"));
    fs::write(&path, "mine").expect("written");
    let file = WholeFile::create(&path, true).expect("asked for");
    assert_eq!(fs::read_to_string(&path).expect("until there is another"), "mine");
    write(&file, "new");
    file.publish().expect("named");
    assert_eq!(fs::read_to_string(&path).expect("replaced"), "new");
}

#[test]
fn a_living_writer_keeps_its_file() {
    let (_directory, path) = place();
    let first = WholeFile::create(&path, false).expect("new");
    for replace in [false, true] {
        let second = WholeFile::create(&path, replace);
        assert!(matches!(second, Err(WholeFileError::Busy { .. })), "{second:?}");
    }
    write(&first, "first");
    first.publish().expect("named");
    assert_eq!(fs::read_to_string(&path).expect("there"), "first");
}

/// Whoever starts at the same moment finds either nothing, or a writer that lives.
#[test]
fn of_many_that_start_at_once_one_gets_the_file() {
    for replace in [false, true] {
        for _ in 0..50 {
            let (_directory, path) = place();
            let start = Barrier::new(4);
            let winners: Vec<WholeFile> = std::thread::scope(|scope| {
                let starters = [(); 4].map(|()| {
                    scope.spawn(|| {
                        start.wait();
                        WholeFile::create(&path, replace)
                    })
                });
                starters.into_iter().filter_map(|starter| starter.join().expect("no panic").ok()).collect()
            });
            // with `replace`, several may have removed each other's before it was locked, and given up
            assert!(winners.len() == 1 || (replace && winners.is_empty()), "{winners:?}");
            for file in winners {
                file.publish().expect("named");
            }
        }
    }
}

#[test]
fn what_is_no_file_is_refused_at_once_and_always() {
    let (directory, path) = place();
    fs::create_dir(&path).expect("directory");
    let link = directory.path().join("link");
    std::os::unix::fs::symlink("elsewhere", &link).expect("link");
    let behind = directory.path().join("b.csv");
    std::os::unix::fs::symlink("elsewhere", behind.with_extension("csv.partial")).expect("link");
    for path in [path.as_path(), &link, &behind, Path::new("/dev/null"), Path::new("/"), Path::new("")] {
        for replace in [false, true] {
            let refused = WholeFile::create(path, replace).expect_err("no file");
            assert!(matches!(refused, WholeFileError::NotAFile { .. }), "{refused}");
        }
    }
    assert_eq!(fs::read_dir(directory.path()).expect("listed").count(), 3, "nothing was created");
}

#[test]
fn a_file_that_appears_meanwhile_is_left_alone() {
    let (_directory, path) = place();
    let file = WholeFile::create(&path, false).expect("new");
    let partial = file.partial().to_owned();
    write(&file, "ours");
    fs::write(&path, "mine").expect("written");
    assert!(matches!(file.publish(), Err(WholeFileError::Appeared { .. })));
    assert_eq!(fs::read_to_string(&path).expect("kept"), "mine");
    assert_eq!(fs::read_to_string(&partial).expect("kept, too"), "ours");
}

/// `replace` is about the file that the user saw.
#[test]
fn only_the_file_that_was_there_is_replaced() {
    for was_there in [false, true] {
        let (_directory, path) = place();
        if was_there {
            fs::write(&path, "old").expect("written");
        }
        let file = WholeFile::create(&path, true).expect("asked for");
        write(&file, "ours");
        let other = path.with_extension("other");
        fs::write(&other, "mine").expect("written");
        fs::rename(&other, &path).expect("appears");
        assert!(matches!(file.publish(), Err(WholeFileError::Appeared { .. })));
        assert_eq!(fs::read_to_string(&path).expect("kept"), "mine");
        assert_eq!(fs::read_to_string(path.with_extension("csv.partial")).expect("kept, too"), "ours");
    }
    let (_directory, path) = place();
    fs::write(&path, "old").expect("written");
    let file = WholeFile::create(&path, true).expect("asked for");
    fs::remove_file(&path).expect("removed meanwhile");
    file.publish().expect("nothing is in the way");
}

#[test]
fn a_file_that_is_given_up_stays_only_if_it_is_worth_something() {
    let (directory, path) = place();
    let count = || fs::read_dir(directory.path()).expect("listed").count();
    drop(WholeFile::create(&path, false).expect("new"));
    assert_eq!(count(), 0);
    let mut file = WholeFile::create(&path, false).expect("nothing is in the way");
    file.keep();
    file.discard();
    assert_eq!(count(), 0);
    let mut file = WholeFile::create(&path, false).expect("nothing is in the way");
    file.keep();
    drop(file);
    assert!(path.with_extension("csv.partial").exists());
}

/// The user moves the `.partial` away, and another writer begins.
#[test]
fn another_writers_file_is_neither_named_nor_removed() {
    let (_directory, path) = place();
    let (first, other) = (WholeFile::create(&path, false), WholeFile::create(&path, false));
    let first = first.expect("new");
    assert!(other.is_err());
    fs::rename(first.partial(), path.with_extension("away")).expect("moved");
    let second = WholeFile::create(&path, false).expect("new");
    write(&second, "second");
    let gone = first.publish().expect_err("moved");
    assert!(matches!(gone, WholeFileError::Gone { .. }), "{gone}");

    fs::rename(second.partial(), path.with_extension("away")).expect("moved");
    let third = WholeFile::create(&path, false).expect("new");
    drop(second);
    write(&third, "third");
    third.publish().expect("named");
    assert_eq!(fs::read_to_string(&path).expect("there"), "third");
}

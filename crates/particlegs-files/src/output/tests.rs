use super::*;
use crate::context::Context;
use crate::{Error, Result};
use std::fs;
use std::path::Path;

const TEXT: Kind = Kind { name: "a text", kept: true, is: |_, head| head.starts_with(b"text") };
const NOTE: Kind = Kind { name: "a note", kept: false, is: |_, head| head.starts_with(b"note") };

fn listing(folder: &Path) -> usize {
    fs::read_dir(folder).unwrap().count()
}

#[test]
fn a_failed_write_leaves_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a");
    let r = write_atomic(&path, |w| {
        w.write_all(b"half")?;
        Err(std::io::Error::other("disk full"))
    });
    assert!(r.is_err());
    assert_eq!(listing(dir.path()), 0);
    write_bytes(&path, b"whole").unwrap();
    assert_eq!(fs::read(&path).unwrap(), b"whole");
}

#[test]
fn appears_whole_or_not_at_all() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("a");
    let file = PlacedFile::create(&out, 4).unwrap();
    file.write_at(b"cd", 2).unwrap();
    file.write_at(b"ab", 0).unwrap();
    assert!(!out.exists());
    file.finish().unwrap();
    assert_eq!(fs::read(&out).unwrap(), b"abcd");
    drop(PlacedFile::create(&folder.path().join("b"), 4).unwrap());
    assert_eq!(listing(folder.path()), 1);
}

#[cfg(unix)]
#[test]
fn links_are_followed_and_stay() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    fs::create_dir(at("far")).unwrap();
    fs::write(at("far/file"), "old").unwrap();
    std::os::unix::fs::symlink("far/file", at("one")).unwrap();
    std::os::unix::fs::symlink("one", at("two")).unwrap();
    write_bytes(&at("two"), b"new").unwrap();
    assert_eq!(fs::read(at("far/file")).unwrap(), b"new");
    assert!(at("one").is_symlink() && at("two").is_symlink());
    std::os::unix::fs::symlink("far/none", at("dangling")).unwrap();
    write_bytes(&at("dangling"), b"made").unwrap();
    assert_eq!(fs::read(at("far/none")).unwrap(), b"made");
    std::os::unix::fs::symlink("ring", at("ring")).unwrap();
    assert!(write_bytes(&at("ring"), b"x").is_err());
}

#[test]
fn inputs_and_other_outputs_are_refused_and_so_is_another_kind() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    ["data", "list"].iter().for_each(|folder| fs::create_dir(at(folder)).unwrap());
    let files = "data/xx.f32 data/meta.json snap.0.hdf5 snap.1.hdf5 list.pvtp list/0.vtp g g#1 text note other empty";
    for name in files.split(' ') {
        fs::write(at(name), if name == "empty" { "" } else { name }).unwrap();
    }
    fs::hard_link(at("data/xx.f32"), at("hard")).unwrap();
    let o = Outputs::new(false);
    o.reads(Input::Data(at("data")));
    ["snap.0.hdf5", "list.pvtp", "g"].iter().for_each(|name| o.reads(Input::Data(at(name))));
    let refused = |o: &Outputs, name: &str, kind: &Kind| match o.writes(&at(name), kind, &Context::SILENT) {
        Err(Error::Output { what, .. }) => what,
        other => panic!("{name}: {other:?}"),
    };
    for name in ["data/xx.f32", "data/../data/meta.json", "hard", "snap.0.hdf5", "snap.1.hdf5", "list/0.vtp", "g#1"] {
        assert!(refused(&o, name, &NOTE).contains("input"), "{name}");
    }
    assert!(refused(&o, "other", &TEXT).contains("not a text"));
    assert!(o.writes(&at("text"), &TEXT, &Context::SILENT).unwrap(), "it is there, and kept");
    assert!(refused(&Outputs::new(true), "text", &NOTE).contains("not a note"));
    assert!(!o.writes(&at("note"), &NOTE, &Context::SILENT).unwrap());
    assert!(!o.writes(&at("empty"), &TEXT, &Context::SILENT).unwrap());
    assert!(!o.writes(&at("new"), &TEXT, &Context::SILENT).unwrap());
    assert!(refused(&o, "data/../new", &TEXT).contains("named twice as an output"));
    assert!(!o.writes(Path::new("-"), &TEXT, &Context::SILENT).unwrap() && o.on_standard_output());
    assert!(o.writes(Path::new("-"), &NOTE, &Context::SILENT).is_err());
    let forced = Outputs::new(true);
    assert!(!forced.writes(&at("text"), &TEXT, &Context::SILENT).unwrap());
    let inner = forced.writes_folder(dir.path(), &[]);
    assert!(matches!(inner, Err(Error::Output { .. })), "foreign files");
    assert!(o.writes_folder(&at("data"), &["xx.f32", "meta.json"]).is_err(), "an input");
    assert!(!forced.writes_folder(&at("data"), &["xx.f32", "meta.json"]).unwrap());
}

#[test]
fn made_folders_that_stay_empty_go() {
    let dir = tempfile::tempdir().unwrap();
    let o = Outputs::new(false);
    o.make_folder(&dir.path().join("a/b/c")).unwrap();
    o.make_folder(&dir.path().join("d/e")).unwrap();
    fs::write(dir.path().join("d/file"), "").unwrap();
    drop(o);
    assert_eq!(listing(dir.path()), 1);
    assert_eq!(listing(&dir.path().join("d")), 1);
}

#[test]
fn folders_are_exchanged_whole() {
    let dir = tempfile::tempdir().unwrap();
    let (out, own_names) = (dir.path().join("out"), ["a", "b"]);
    let make = |names: &[&str], text: &str| {
        let folder = WholeFolder::create(&out, &own_names)?;
        names.iter().for_each(|n| fs::write(folder.path().join(n), text).unwrap());
        folder.finish()
    };
    make(&["a", "b"], "one").unwrap();
    drop(WholeFolder::create(&out, &own_names).unwrap());
    make(&["a"], "two").unwrap();
    assert_eq!((listing(&out), fs::read(out.join("a")).unwrap()), (1, b"two".to_vec()));
    assert_eq!(listing(dir.path()), 1, "the old one is gone");
    fs::write(out.join("mine"), "").unwrap();
    assert!(matches!(make(&["a"], "three"), Err(Error::Output { .. })));
    assert_eq!(fs::read(out.join("a")).unwrap(), b"two");
    fs::remove_dir_all(&out).unwrap();
    fs::create_dir(&out).unwrap();
    make(&["b"], "four").unwrap();
    assert_eq!(listing(&out), 1);
    // What another process has put there meanwhile is not lost.
    let (late, own_names) = (dir.path().join("late"), ["a"]);
    let folder = WholeFolder::create(&late, &own_names).unwrap();
    fs::create_dir(&late).unwrap();
    fs::write(late.join("a"), "theirs").unwrap();
    assert!(folder.finish().is_err());
    assert_eq!(fs::read(late.join("a")).unwrap(), b"theirs");
    assert!(dir.path().join("late-1").is_dir() && listing(dir.path()) == 3, "what was made stays, too");
}

/// A plan of one output, and then what happens there before it is written.
fn changed_meanwhile(
    path: &Path,
    force: bool,
    change: impl FnOnce(),
    write: impl FnOnce() -> Result<()>,
) -> Result<()> {
    let o = Outputs::new(force);
    o.writes(path, &TEXT, &Context::SILENT)?;
    change();
    write()
}

#[cfg(unix)]
#[test]
fn what_appears_or_changes_while_a_command_runs_stays_and_what_was_made_lies_beside_it() {
    const MINE: &str = "text, mine";
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    let placed = |path: &Path| {
        let file = PlacedFile::create(path, MINE.len() as u64)?;
        file.write_at(MINE.as_bytes(), 0)?;
        file.finish()
    };
    let set = |path: &Path| {
        let set = FileSet::in_folder(dir.path())?;
        fs::write(set.path().join(path.file_name().unwrap()), MINE).unwrap();
        set.finish().map(drop)
    };
    let atomic = |path: &Path| write_bytes(path, MINE.as_bytes());
    let writers: [(&str, &dyn Fn(&Path) -> Result<()>); 3] = [("atomic", &atomic), ("placed", &placed), ("set", &set)];
    for (name, write) in writers {
        for (case, before, during) in [
            ("new", None, "text"),
            ("there", Some("text"), "notes"),
            ("same length", Some("text of"), "texts.."),
            ("gone", Some("text"), ""),
        ] {
            let path = at(&format!("{name} {case}.t"));
            before.iter().for_each(|text| fs::write(&path, text).unwrap());
            let change = || match during {
                "" => fs::remove_file(&path).unwrap(),
                text => {
                    // Another file of the same length and time, and one of another.
                    let modified = fs::metadata(&path).and_then(|m| m.modified()).ok();
                    fs::write(at("theirs"), text).unwrap();
                    modified.iter().for_each(|t| {
                        fs::File::options().write(true).open(at("theirs")).unwrap().set_modified(*t).unwrap()
                    });
                    fs::rename(at("theirs"), &path).unwrap();
                }
            };
            let done = changed_meanwhile(&path, true, change, || write(&path));
            let beside = at(&format!("{name} {case}-1.t"));
            if during.is_empty() {
                done.unwrap();
                assert_eq!(fs::read_to_string(&path).unwrap(), MINE, "{name} {case}");
                continue;
            }
            assert!(
                matches!(&done, Err(Error::Output { what, .. }) if what.contains("while this command ran")),
                "{done:?}"
            );
            assert_eq!(fs::read_to_string(&path).unwrap(), during, "{name} {case}");
            assert_eq!(fs::read_to_string(&beside).ok().as_deref(), (name != "set").then_some(MINE), "{name} {case}");
        }
        // Nothing is lost: the same bytes, an empty file, one's own of before.
        let path = at(&format!("{name} own.t"));
        for theirs in [MINE, ""] {
            fs::remove_file(&path).ok();
            changed_meanwhile(&path, false, || fs::write(&path, theirs).unwrap(), || write(&path)).unwrap();
            assert_eq!(fs::read_to_string(&path).unwrap(), MINE);
        }
        changed_meanwhile(&path, true, || (), || write(&path).and_then(|()| write(&path))).unwrap();
    }
}

#[test]
fn a_set_appears_together() {
    let dir = tempfile::tempdir().unwrap();
    let set = FileSet::in_folder(dir.path()).unwrap();
    fs::write(set.path().join("a"), "1").unwrap();
    drop(set);
    assert_eq!(listing(dir.path()), 0);
    let set = FileSet::in_folder(dir.path()).unwrap();
    fs::write(set.path().join("b"), "2").unwrap();
    fs::write(set.path().join("a"), "1").unwrap();
    assert_eq!(set.finish().unwrap(), [dir.path().join("a"), dir.path().join("b")]);
    assert_eq!(listing(dir.path()), 2);
}

#[cfg(unix)]
#[test]
fn folders_that_change_while_a_command_runs_stay_whole() {
    let dir = tempfile::tempdir().unwrap();
    let (out, own_names) = (dir.path().join("out"), ["a", "b"]);
    type FolderChange<'a> = &'a dyn Fn();
    let within = |name: &str| out.join(name);
    let changes: [(&str, FolderChange); 6] = [
        ("a file of another name", &|| fs::write(within("notes"), "theirs").unwrap()),
        ("a folder", &|| fs::create_dir(within("sub")).unwrap()),
        ("one of its files, written anew", &|| fs::write(within("a"), "theirs").unwrap()),
        ("one more of its files", &|| fs::write(within("b"), "theirs").unwrap()),
        ("a link", &|| std::os::unix::fs::symlink("a", within("b")).unwrap()),
        ("another folder", &|| {
            fs::remove_dir_all(&out).unwrap();
            fs::create_dir(&out).unwrap();
            fs::write(within("a"), "theirs").unwrap();
        }),
    ];
    for (case, change) in changes {
        for late in [false, true] {
            [&out, &dir.path().join("out-1")].iter().for_each(|f| drop(fs::remove_dir_all(f)));
            fs::create_dir(&out).unwrap();
            fs::write(within("a"), "before").unwrap();
            let o = Outputs::new(true);
            o.writes_folder(&out, &own_names).unwrap();
            if !late {
                change();
            }
            let new_folder = WholeFolder::create(&out, &own_names);
            assert_eq!(new_folder.is_ok(), late, "{case}");
            if let Ok(folder) = new_folder {
                fs::write(folder.path().join("a"), "mine").unwrap();
                change();
                assert!(matches!(folder.finish(), Err(Error::Output { .. })), "{case}");
                assert_eq!(fs::read_to_string(dir.path().join("out-1/a")).unwrap(), "mine", "{case}");
            }
            let text = fs::read_to_string(within("a")).unwrap();
            assert!(text == "before" && listing(&out) == 2 || text == "theirs" && listing(&out) == 1, "{case}: {text}");
        }
    }
    // An empty one that another command has filled meanwhile with files of the same names.
    fs::remove_dir_all(&out).unwrap();
    let o = Outputs::new(false);
    assert!(!o.writes_folder(&out, &own_names).unwrap());
    fs::create_dir(&out).unwrap();
    fs::write(within("a"), "theirs").unwrap();
    assert!(matches!(WholeFolder::create(&out, &own_names), Err(Error::Output { .. })));
}

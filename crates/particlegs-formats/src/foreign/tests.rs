use super::*;
use std::path::PathBuf;

fn head(name: &str, bytes: &[u8]) -> FileHead {
    FileHead::from_bytes(&PathBuf::from(name), bytes.len() as u64, bytes.to_vec()).unwrap()
}

/// The description of a file, and the command that converts it.
fn describe(name: &str, bytes: &[u8]) -> (String, String) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    let error = crate::detect::detect(&path).err().expect("a format that is not read");
    let at = folder.path().display().to_string();
    (error.to_string().replace(&at, ""), error.hint().to_string().replace(&at, ""))
}

#[test]
fn files_of_molecular_dynamics_are_named_with_their_converter() {
    for (name, text, title, command) in [
        ("a.cif", "data_x\n_cell_length_a 3\n_cell_length_b 3\n", "a CIF file", "-i cif"),
        ("b.cif", "data_x\nloop_\n_atom_site.Cartn_x\n1 2 3\n", "an mmCIF file", "ovito"),
    ] {
        let (description, hint) = describe(name, text.as_bytes());
        assert!(
            description.contains(title) && description.contains("which this program does not read"),
            "{name}: {description}"
        );
        assert!(hint.contains(command) && hint.contains("pip install"), "{name}: {hint}");
    }
}

#[test]
fn binary_files_are_named_with_their_converter() {
    let netcdf = [b"CDF\x02\0\0\0\0".as_slice(), b"Conventions\0AMBER\0"].concat();
    for (name, bytes, title, tool) in [
        ("a.nc", &netcdf[..], "AMBER trajectory (NetCDF)", "ovito"),
        ("a.fits", b"SIMPLE  =                    T", "a FITS file", "astropy"),
    ] {
        let (description, hint) = describe(name, bytes);
        assert!(description.contains(title), "{name}: {description}");
        assert!(hint.contains(tool), "{name}: {hint}");
    }
}

#[test]
fn names_that_a_shell_would_take_apart_are_left_to_the_user() {
    let foreign = foreign_of(&head("x", b"fxyz....")).unwrap();
    let hint = |name: &str| foreign.hint(Path::new(name)).to_string();
    assert!(hint("a b;rm.binpos").contains("`mdconvert FILE -o file_converted.dcd`"), "{}", hint("a b;rm.binpos"));
    assert!(hint("run-1/a.binpos").contains("`mdconvert run-1/a.binpos -o a.dcd`"));
}

#[test]
fn tables_and_other_text_stay_what_they_are() {
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures");
    for entry in std::fs::read_dir(fixtures).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|e| e == "py") {
            continue;
        }
        let foreign = foreign_of(&FileHead::read(&path).unwrap());
        assert!(foreign.is_none(), "{}: {}", path.display(), foreign.unwrap().title);
    }
    for text in ["1 2 3\n4 5 6\n", "2\n2\n1 2 3\n4 5 6\n7 8 9\n1 2 3\n", "x y z\n1 1 1\n2 2 2\n3 3 3\n4 4 4\n5 5 5\n"] {
        assert!(foreign_of(&head("a.txt", text.as_bytes())).is_none(), "{text}");
    }
}

use super::*;
use std::path::PathBuf;

fn head(name: &str, bytes: &[u8]) -> FileHead {
    FileHead::from_bytes(&PathBuf::from(name), bytes.len() as u64, bytes.to_vec()).unwrap()
}

/// What a file is said to be, and the command that converts it.
fn describe(name: &str, bytes: &[u8]) -> (String, String) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    let error = crate::open::detect(&path).err().expect("a format that is not read");
    let at = folder.path().display().to_string();
    (error.to_string().replace(&at, ""), error.hint().to_string().replace(&at, ""))
}

#[test]
fn files_of_molecular_dynamics_are_named_with_their_converter() {
    let pdb = "REMARK made\nATOM      1  O   HOH A   1      17.181  15.246   1.772  1.00  0.00           O\n";
    let poscar = "cell\n1.0\n30 0 0\n0 30 0\n0 0 30\n2\nDirect\n0.5 0.5 0.1\n0.1 0.8 0.5\n";
    let vasp5 = "cell\n1.0\n30 0 0\n0 30 0\n0 0 30\nO H\n1 1\nSelective dynamics\nCartesian\n0.5 0.5 0.1 T T T\n";
    let data = "made by hand\n\n2 atoms\n1 atom types\n0 30 xlo xhi\n0 30 ylo yhi\n0 30 zlo zhi\n\nAtoms\n\n1 1 1 2 3\n2 1 4 5 6\n";
    for (name, text, title, command) in [
        ("a.pdb", pdb, "a PDB file", "ase convert -i proteindatabank -o extxyz /a.pdb a.extxyz"),
        ("POSCAR", poscar, "a VASP structure", "ase convert -i vasp -o extxyz /POSCAR poscar_converted.extxyz"),
        ("b.vasp", vasp5, "a VASP structure", "-i vasp"),
        ("data.lmp", data, "a LAMMPS data file", "-i lammps-data"),
        ("a.cif", "data_x\n_cell_length_a 3\n_cell_length_b 3\n", "a CIF file", "-i cif"),
        ("b.cif", "data_x\nloop_\n_atom_site.Cartn_x\n1 2 3\n", "an mmCIF file", "ovito"),
    ] {
        let (what, hint) = describe(name, text.as_bytes());
        assert!(what.contains(title) && what.contains("which this program does not read"), "{name}: {what}");
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
        let (what, hint) = describe(name, bytes);
        assert!(what.contains(title), "{name}: {what}");
        assert!(hint.contains(tool), "{name}: {hint}");
    }
}

#[test]
fn names_that_a_shell_would_take_apart_are_left_to_the_user() {
    let foreign = foreign_of(&head("x", b"fxyz....")).unwrap();
    let of = |name: &str| foreign.hint(Path::new(name)).to_string();
    assert!(of("a b;rm.binpos").contains("`mdconvert FILE -o file_converted.dcd`"), "{}", of("a b;rm.binpos"));
    assert!(of("run-1/a.binpos").contains("`mdconvert run-1/a.binpos -o a.dcd`"));
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

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
    let gro = "water t= 0.0\n    2\n    1SOL     OW    1   1.718   1.525   0.177\n    2SOL     OW    2   0.085   2.520   1.637\n   3 3 3\n";
    let pdb = "REMARK made\nATOM      1  O   HOH A   1      17.181  15.246   1.772  1.00  0.00           O\n";
    let poscar = "cell\n1.0\n30 0 0\n0 30 0\n0 0 30\n2\nDirect\n0.5 0.5 0.1\n0.1 0.8 0.5\n";
    let vasp5 = "cell\n1.0\n30 0 0\n0 30 0\n0 0 30\nO H\n1 1\nSelective dynamics\nCartesian\n0.5 0.5 0.1 T T T\n";
    let data = "made by hand\n\n2 atoms\n1 atom types\n0 30 xlo xhi\n0 30 ylo yhi\n0 30 zlo zhi\n\nAtoms\n\n1 1 1 2 3\n2 1 4 5 6\n";
    for (name, text, title, command) in [
        ("a.gro", gro, "a GROMACS structure (GRO)", "ase convert -i gromacs -o extxyz /a.gro a.extxyz"),
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
    let xtc = [0, 0, 7, 0xcb, 0, 0, 0, 2, 0, 0, 0, 0];
    let trr = [0, 0, 7, 0xc9, 0, 0, 0, 13];
    let dcd = [&[84, 0, 0, 0][..], b"CORD", &[2, 0, 0, 0]].concat();
    let netcdf = [b"CDF\x02\0\0\0\0".as_slice(), b"Conventions\0AMBER\0"].concat();
    // One dark particle.
    let mut tipsy = vec![0; 32 + 36];
    for (k, count) in [1u32, 3, 0, 1, 0].into_iter().enumerate() {
        tipsy[8 + 4 * k..12 + 4 * k].copy_from_slice(&count.to_be_bytes());
    }
    for (name, bytes, title, tool) in [
        ("a.xtc", &xtc[..], "XTC", "ovito"),
        ("a.trr", &trr[..], "TRR", "ovito"),
        ("a.dcd", &dcd, "DCD", "ovito"),
        ("a.nc", &netcdf, "AMBER trajectory (NetCDF)", "ovito"),
        ("a.tipsy", &tipsy, "a Tipsy snapshot", "s = pynbody.load('/a.tipsy'); numpy.savez('a.npz'"),
        ("a.fits", b"SIMPLE  =                    T", "a FITS file", "astropy"),
    ] {
        let (what, hint) = describe(name, bytes);
        assert!(what.contains(title), "{name}: {what}");
        assert!(hint.contains(tool), "{name}: {hint}");
    }
    tipsy.pop();
    assert!(foreign_of(&head("cut.tipsy", &tipsy)).is_none());
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

//! Formats that are known and not read: what they are, and what turns them into one that is read.

use crate::format::{FileHead, is_whole};
use crate::text::split::{Separator, number, tokens};
use particlegs_core::Hint;
use std::path::Path;

pub(crate) struct ForeignFormat {
    /// Title of such a file, with its article.
    pub title: &'static str,
    /// Whether a file that begins so has this format.
    is: fn(&FileHead) -> bool,
    converter: Converter,
}

#[derive(Clone, Copy)]
enum Converter {
    /// ASE's command, by the name that it has for the format: to extended XYZ.
    Ase(&'static str),
    Ovito,
    /// Lines of Python, `{in}` and `{out}` for the files, and the packages that they want.
    Python(&'static str, &'static str),
    /// A format that pandas reads, to a table of text.
    Pandas(&'static str),
    /// A format that MDAnalysis reads, by its names for the format and for its topology.
    MdAnalysis(&'static str, &'static str),
    /// A command, `{in}` and `{out}` for the files.
    Command(&'static str),
}

use Converter::{Ase, Command, MdAnalysis, Ovito, Pandas, Python};

/// Particles of what yt reads.
pub(crate) const YT: &str = "import yt, numpy; a = yt.load('{in}').all_data(); numpy.savez('{out}.npz', \
    pos=a['all', 'particle_position'], mass=a['all', 'particle_mass'])";

const fn foreign(title: &'static str, is: fn(&FileHead) -> bool, converter: Converter) -> ForeignFormat {
    ForeignFormat { title, is, converter }
}

/// All of them; the surest signatures first.
static FOREIGN: &[ForeignFormat] = &[
    foreign(
        "a GROMACS trajectory (TNG)",
        |s| s.names(b"GENERAL INFO", 256),
        Command("gmx trjconv -f {in} -o {out}.xtc"),
    ),
    foreign("an AMBER trajectory (NetCDF)", |s| is_netcdf(s) && s.names(b"AMBER", 1 << 16), Ovito),
    foreign(
        "a NetCDF file",
        is_netcdf,
        Python(
            "import xarray, numpy; d = xarray.open_dataset('{in}'); \
             numpy.savez('{out}.npz', **{k: d[k].values for k in d.variables})",
            "xarray scipy",
        ),
    ),
    foreign("an AMBER trajectory (BINPOS)", |s| s.begins(&[b"fxyz"]), Command("mdconvert {in} -o {out}.dcd")),
    foreign(
        "a LAMMPS restart file",
        |s| s.begins(&[b"LammpS RestartT"]),
        Command("lmp -restart2dump {in} all atom {out}.dump"),
    ),
    foreign(
        "a FITS file",
        |s| s.begins(&[b"SIMPLE  ="]),
        Python("from astropy.table import Table; Table.read('{in}').write('{out}.csv')", "astropy"),
    ),
    foreign("a Parquet table", |s| s.begins(&[b"PAR1"]), Pandas("parquet")),
    foreign("a Feather table", |s| s.begins(&[b"ARROW1", b"FEA1"]), Pandas("feather")),
    foreign(
        "a MATLAB file",
        |s| s.begins(&[b"MATLAB 5.0 MAT-file"]),
        Python(
            "import scipy.io, numpy; m = scipy.io.loadmat('{in}'); \
             numpy.savez('{out}.npz', **{k: m[k] for k in m if k[0] != '_'})",
            "scipy",
        ),
    ),
    foreign(
        "a laser scan (LAS, LAZ or E57)",
        |s| s.begins(&[b"LASF", b"ASTM-E57"]),
        Command("pdal translate {in} {out}.ply"),
    ),
    foreign(
        "a point cloud of PCL (PCD)",
        |s| s.begins(&[b"# .PCD", b"VERSION ."]),
        Command("pdal translate {in} {out}.ply"),
    ),
    foreign("a RAMSES output", |s| s.begins(&[b"ncpu        ="]), Python(YT, "yt")),
    foreign("an mmCIF file", |s| s.names(b"_atom_site.Cartn_x", 1 << 16), Ovito),
    foreign("a CIF file", |s| s.lines().any(|l| l.starts_with(b"_cell_length_a")), Ase("cif")),
    foreign(
        "a GROMOS structure (G96)",
        |s| s.begins(&[b"TITLE"]) && s.lines().any(|l| l.starts_with(b"POSITION")),
        Ase("gromos"),
    ),
    foreign("an XCrySDen structure (XSF)", is_xsf, Ase("xsf")),
    foreign("an AtomEye configuration (CFG)", |s| s.begins(&[b"Number of particles"]), Ase("cfg")),
    foreign(
        "an MDL molecule (MOL, SDF)",
        |s| s.lines().nth(3).is_some_and(|l| l.trim_ascii_end().ends_with(b"V2000")),
        Ase("sdf"),
    ),
    foreign("a Tripos molecule (MOL2)", |s| s.lines().any(|l| l.starts_with(b"@<TRIPOS>")), MdAnalysis("MOL2", "MOL2")),
    foreign("a TINKER file", is_tinker, MdAnalysis("TXYZ", "TXYZ")),
    foreign("an AMBER restart file", is_amber_restart, MdAnalysis("INPCRD", "MINIMAL")),
    foreign("a DL_POLY configuration", is_dl_poly, Ase("dlp4")),
    foreign("an FHI-aims structure", |s| s.lines().any(|l| is_row(l, b"lattice_vector", 3)), Ase("aims")),
    foreign("a Gaussian cube file", is_cube, Ase("cube")),
];

/// The first format that takes a file to be its own.
pub(crate) fn foreign_of(head: &FileHead) -> Option<&'static ForeignFormat> {
    FOREIGN.iter().find(|f| (f.is)(head))
}

impl ForeignFormat {
    /// The command that turns the file `path` into one that is read.
    pub(crate) fn hint(&self, path: &Path) -> Hint {
        let (input, output) = names(path);
        match self.converter {
            Ase(name) => converted(format!("ase convert -i {name} -o extxyz {input} {output}.extxyz"), "ase"),
            Ovito => python(
                path,
                "from ovito.io import *; export_file(import_file('{in}'), '{out}.dump', 'lammps/dump', multiple_frames=True, \
                 columns=['Particle Identifier', 'Position.X', 'Position.Y', 'Position.Z'])",
                "ovito",
            ),
            Python(code, packages) => python(path, code, packages),
            Pandas(kind) => {
                let code = format!("import pandas; pandas.read_{kind}('{{in}}').to_csv('{{out}}.csv', index=False)");
                python(path, &code, "pandas pyarrow")
            }
            MdAnalysis(format, topology) => {
                let read = format!("MDAnalysis.Universe('{{in}}', format='{format}', topology_format='{topology}')");
                python(path, &format!("import MDAnalysis; {read}.atoms.write('{{out}}.xyz')"), "MDAnalysis")
            }
            Command(text) => converted(text.replace("{in}", &input).replace("{out}", &output), ""),
        }
    }
}

/// Lines of Python that convert the file `path`, `{in}` and `{out}` for the files, and the packages that they want.
pub(crate) fn python(path: &Path, code: &str, packages: &str) -> Hint {
    let (input, output) = names(path);
    converted(format!("python3 -c \"{}\"", code.replace("{in}", &input).replace("{out}", &output)), packages)
}

fn converted(command: String, packages: &str) -> Hint {
    let packages = if packages.is_empty() { String::new() } else { format!(" (`pip install {packages}`)") };
    format!("convert it: `{command}`{packages}").into()
}

/// A file's name for a command, and one beside it without ending. Names that a shell would take apart are left to the
/// user.
fn names(path: &Path) -> (String, String) {
    let plain = |c: char| c.is_ascii_alphanumeric() || "._/-+".contains(c);
    let input = path.to_str().filter(|p| p.chars().all(plain) && !p.starts_with('-')).unwrap_or("FILE");
    let stem = Path::new(input).file_stem().and_then(|s| s.to_str()).unwrap_or(input);
    // The converters look at names: POSCAR.extxyz would be VASP's.
    let output = if Path::new(input).extension().is_none() {
        format!("{}_converted", stem.to_lowercase())
    } else {
        stem.to_string()
    };
    (input.to_string(), output)
}

/// A line of a word and so many numbers.
fn is_row(line: &[u8], word: &[u8], count: usize) -> bool {
    let words = tokens(line, Separator::Blanks);
    words.first() == Some(&word) && words.len() == count + 1 && words[1..].iter().all(|w| number(w).is_some())
}

fn is_netcdf(s: &FileHead) -> bool {
    s.begins(&[b"CDF\x01", b"CDF\x02", b"CDF\x05"])
}

fn is_xsf(s: &FileHead) -> bool {
    let first = s.lines().map(<[u8]>::trim_ascii).find(|l| !l.is_empty() && !l.starts_with(b"#")).unwrap_or_default();
    let words: [&[u8]; 7] = [b"CRYSTAL", b"SLAB", b"POLYMER", b"MOLECULE", b"PRIMVEC", b"ATOMS", b"ANIMSTEPS"];
    words.iter().any(|w| first.starts_with(w))
        && s.lines().any(|l| matches!(l.trim_ascii(), b"PRIMVEC" | b"PRIMCOORD" | b"ATOMS"))
}

/// A number of atoms, perhaps a title, and lines of a number, a symbol, a position, a type.
fn is_tinker(s: &FileHead) -> bool {
    let atom = s.words(1);
    s.words(0).first().is_some_and(|w| is_whole(w))
        && atom.len() >= 6
        && atom[0] == b"1"
        && number(atom[1]).is_none()
        && atom[2..5].iter().all(|w| number(w).is_some())
        && atom[5..].iter().all(|w| is_whole(w))
}

/// A title, a number of atoms and perhaps a time, and lines of six numbers in columns of twelve.
fn is_amber_restart(s: &FileHead) -> bool {
    let count = s.words(1).first().is_some_and(|w| is_whole(w)) && s.words(1).len() <= 3;
    let row = s.lines().nth(2).unwrap_or_default();
    let fixed = row.len() == 72 && row.chunks(12).all(|f| number(f.trim_ascii()).is_some() && f[4] == b'.');
    count && fixed
}

/// A title, two or more whole numbers, a cell.
fn is_dl_poly(s: &FileHead) -> bool {
    let flags = s.words(1);
    let atom = s.words(5);
    (2..=5).contains(&flags.len())
        && flags.iter().take(2).all(|w| w.len() == 1 && is_whole(w))
        && s.are_numbers(2..5, 3)
        && atom.first().is_some_and(|w| number(w).is_none())
        && s.are_numbers(6..7, 3)
}

/// Two lines of comment, a number of atoms and an origin, three numbers of voxels and vectors.
fn is_cube(s: &FileHead) -> bool {
    let whole_first = |i: usize| s.words(i).first().is_some_and(|w| is_whole(w.strip_prefix(b"-").unwrap_or(w)));
    (2..6).all(whole_first)
        && s.are_numbers(3..6, 4)
        && s.are_numbers(6..7, 5)
        && s.numbers(2).is_some_and(|n| n.len() >= 4)
}

#[cfg(test)]
mod tests {
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
        let error = crate::open::detect(&path).err().expect("a format that is not read");
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
        for text in
            ["1 2 3\n4 5 6\n", "2\n2\n1 2 3\n4 5 6\n7 8 9\n1 2 3\n", "x y z\n1 1 1\n2 2 2\n3 3 3\n4 4 4\n5 5 5\n"]
        {
            assert!(foreign_of(&head("a.txt", text.as_bytes())).is_none(), "{text}");
        }
    }
}

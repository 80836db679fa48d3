//! The formats that a model is exported in.

use particlegs_core::{Error, Hint, Result};
use particlegs_files::output;
use std::path::Path;

particlegs_core::named_values! {
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum Kind {
        /// A page that shows the model in any browser, offline: one file.
        Html = "html",
        /// Splats as 3-D Gaussian splatting stores them (PLY).
        Ply = "ply",
        /// Splats as binary glTF 2.0 with KHR_gaussian_splatting.
        Glb = "glb",
        /// The same as text, with its numbers inside.
        Gltf = "gltf",
        /// Density on a grid: NumPy array, and a JSON beside it.
        Npy = "npy",
        /// Density on a grid: VTK ImageData, for ParaView.
        Vti = "vti",
        /// Density on a grid: FITS cube.
        Fits = "fits",
        /// Density on a grid: OpenDX text, for viewers of molecules.
        Dx = "dx",
        /// Density on a grid: MRC2014 map, for viewers of molecules.
        Mrc = "mrc",
        Npz = "npz",
        /// The Gaussians themselves: a table of text.
        Csv = "csv",
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Group {
    /// Splats that are sorted and blended.
    Splats,
    Grid,
    /// Means, covariances, counts.
    Gaussians,
    /// The model file itself, and what shows it.
    Page,
}

impl Kind {
    /// The ending that means it, its name on the command line too.
    pub fn ending(self) -> &'static str {
        self.name()
    }

    pub fn group(self) -> Group {
        match self {
            Kind::Ply | Kind::Glb | Kind::Gltf => Group::Splats,
            Kind::Npy | Kind::Vti | Kind::Fits | Kind::Dx | Kind::Mrc => Group::Grid,
            Kind::Npz | Kind::Csv => Group::Gaussians,
            Kind::Html => Group::Page,
        }
    }

    /// Whether a file of density has room for fields.
    pub fn has_fields_in_cells(self) -> bool {
        matches!(self, Kind::Vti | Kind::Fits)
    }

    /// The format that an output's ending means, or the one that is asked for.
    pub fn for_output(out: &Path, requested_kind: Option<Kind>) -> Result<Kind> {
        let ending = out.extension().map(|e| e.to_string_lossy().to_lowercase());
        let ending = match ending.as_deref() {
            Some("fit") => Some("fits"),
            Some("map" | "ccp4") => Some("mrc"),
            other => other,
        };
        let meant = Kind::ALL.into_iter().find(|k| Some(k.ending()) == ending);
        match (meant, requested_kind) {
            (Some(meant), Some(requested)) if meant != requested => {
                let [meant, requested] = [meant, requested].map(Kind::ending);
                let message =
                    format!("{}: the ending means {meant}, but kind {requested} was requested", out.display());
                let hint = Hint::from("omit ").option("kind", "").words(" or name another file");
                Err(Error::argument_with(message, hint))
            }
            (Some(kind), _) | (None, Some(kind)) => Ok(kind),
            (None, None) => Err(Error::argument_with(
                format!("{}: the file kind is not clear from the ending", out.display()),
                Self::hint(ending.unwrap_or_default()),
            )),
        }
    }

    fn hint(ending: &str) -> Hint {
        let particles = ["hdf5", "h5", "vtp", "dump", "lammpstrj", "f32", "xyz", "vtu", "vtk"];
        let pictures = ["png", "pdf", "svg", "jpg", "webp"];
        if particles.contains(&ending) {
            let hint = Hint::from("draw particles with ").command("recover", "").words(", then write them with ");
            return hint.command("convert", "");
        }
        if pictures.contains(&ending) {
            return Hint::from("draw pictures with ").command("render", "");
        }
        let all: Vec<String> = Kind::ALL.iter().map(|k| format!(".{}", k.ending())).collect();
        Hint::from(format!("use one of {}, or ", all.join(", "))).option("kind", "")
    }

    /// The kind of output, by which a file in its place may be replaced.
    pub fn file(self) -> output::Kind {
        const fn kept(name: &'static str, is: fn(&Path, &[u8]) -> bool) -> output::Kind {
            output::Kind { name, kept: true, is }
        }
        match self {
            Kind::Ply => kept("a PLY", |_, head| head.starts_with(b"ply")),
            Kind::Glb => kept("a binary glTF", |_, head| head.starts_with(b"glTF")),
            Kind::Gltf => kept("a glTF", |_, head| holds(head, "\"accessors\"") || holds(head, "\"asset\"")),
            Kind::Npy => kept("a NumPy array", |_, head| head.starts_with(b"\x93NUMPY")),
            Kind::Vti => kept("a VTK ImageData", |_, head| holds(head, "\"ImageData\"")),
            Kind::Fits => kept("a FITS", |_, head| head.starts_with(b"SIMPLE  =")),
            Kind::Dx => kept("an OpenDX", |_, head| holds(head, "class gridpositions counts")),
            // Word 53 of the header is this name.
            Kind::Mrc => kept("an MRC", |_, head| head.get(208..212) == Some(b"MAP ")),
            Kind::Npz => kept("a NumPy archive", |_, head| head.starts_with(b"PK")),
            Kind::Html => kept("an HTML page", |_, head| head.starts_with(b"<!doctype html>")),
            Kind::Csv => kept("a table of Gaussians", |_, head| head.starts_with(TABLE_BEGIN.as_bytes())),
        }
    }

    /// The kind of output of the description beside an array.
    pub fn description() -> output::Kind {
        output::Kind {
            name: "the description of a density",
            kept: true,
            is: |_, head| head.trim_ascii_start().starts_with(b"{") && holds(head, "\"density\""),
        }
    }
}

/// The beginning of a table of text.
const TABLE_BEGIN: &str = "# written by particlegs ";

fn holds(head: &[u8], words: &str) -> bool {
    String::from_utf8_lossy(head).contains(words)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ending_says_what_is_written() {
        let kind_of = |out: &str, asked: Option<Kind>| Kind::for_output(Path::new(out), asked);
        for kind in &Kind::ALL {
            assert_eq!(kind_of(&format!("a.b/x.{}", kind.ending().to_uppercase()), None).unwrap(), *kind);
            assert_eq!(kind_of(&format!("x.{}", kind.ending()), Some(*kind)).unwrap(), *kind);
            assert_eq!(kind_of("-", Some(*kind)).unwrap(), *kind);
        }
        assert_eq!([kind_of("x.fit", None).unwrap(), kind_of("x.ccp4", None).unwrap()], [Kind::Fits, Kind::Mrc]);
        assert!(kind_of("x.ply", Some(Kind::Csv)).is_err());
        for (out, words) in [("x", ".npz"), ("-", "`kind`"), ("x.hdf5", "`recover`"), ("x.png", "`render`")] {
            let error = kind_of(out, None).unwrap_err();
            assert!(error.hint().to_string().contains(words), "{out}: {}", error.hint());
        }
    }
}

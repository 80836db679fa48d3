//! The library's errors as exceptions, in its own words.

use particlegs::{Error, NamedValue, Remedy};
use pyo3::exceptions::{
    PyFileExistsError, PyKeyboardInterrupt, PyMemoryError, PyOSError, PyRuntimeError, PyValueError,
};
use pyo3::prelude::*;
use pyo3::{PyTypeInfo, create_exception};

create_exception!(particlegs, InputError, PyValueError, "A snapshot, model or argument that cannot be used as it is.");
create_exception!(
    particlegs,
    ModelError,
    InputError,
    "A model file that is corrupt, or of a version that is not known."
);
create_exception!(
    particlegs,
    UnreachableError,
    PyValueError,
    "A size or quality that cannot be reached with this snapshot."
);

/// Adds the exceptions to the module.
pub fn add(py: Python<'_>, m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add("InputError", InputError::type_object(py))?;
    m.add("ModelError", ModelError::type_object(py))?;
    m.add("UnreachableError", UnreachableError::type_object(py))
}

/// The value that an argument names.
pub fn named<T: NamedValue>(argument: &str, name: &str) -> PyResult<T> {
    T::from_name(name).map_err(|there| InputError::new_err(format!("{argument}=\"{name}\": {there}")))
}

/// A remedy in Python's words: arguments, not options of the command.
fn in_words(remedy: &Remedy) -> String {
    match remedy {
        Remedy::Both(both) => format!("{}; {}", in_words(&both.0), in_words(&both.1)),
        Remedy::StateBox | Remedy::StateBoxOrRegion => "state it by box=".into(),
        Remedy::LeaveOutInvalid => "skip_invalid=True leaves them out; weights=None counts all particles alike".into(),
        Remedy::LayersBySpecies => "use layers_by=\"species\"".into(),
        Remedy::ChooseSpecies => "choose fewer with species=".into(),
        Remedy::NameFormat(formats) => format!("format= forces one of: {formats}"),
        Remedy::NameFormatOfFolder => "name one of them; format= leaves files of other formats out".into(),
        Remedy::NameBlocks => {
            "blocks=[\"POS\", \"VEL\", \"ID\", \"-\", \"MASS\"] names the blocks behind the header".into()
        }
        Remedy::NamePositions(there) => format!("positions=\"A,B,C\" names them; there are: {}", there.join(", ")),
        Remedy::ChoosePositions(there) => format!("choose with positions=: {}", there.join(", ")),
        Remedy::ReadFrame(frame) => format!("frame={frame} reads the last whole frame"),
        Remedy::AllowMemory => "allow that much with memory=, or ask for a smaller model".into(),
        Remedy::LargerFile { bytes, ratio: None } => format!("ask for size={bytes} or more"),
        Remedy::LargerFile { bytes, ratio: Some(ratio) } => {
            format!("ask for size={bytes} or more, or for ratio={ratio:.4} or less")
        }
        Remedy::MoreGaussians(number) => format!("ask for gaussians={number} or more"),
        Remedy::TrainFromSnapshot => "compress(..., train=...) trains such a model from its snapshot".into(),
        Remedy::DrawParticles => "draw particles from it with Model.recover".into(),
        Remedy::IsSnapshot => "compress() makes a model of it".into(),
        Remedy::IsModel => "read() opens it".into(),
        Remedy::NameModel => "name a model file, as Model.save writes it".into(),
        other => other.to_string(),
    }
}

/// The exception that an error is.
pub fn exception(error: &Error) -> PyErr {
    let remedy = error.remedy();
    let said = match remedy.is_none() {
        true => error.to_string(),
        false => format!("{error}; {}", in_words(&remedy)),
    };
    match error {
        Error::Input { .. } | Error::Argument { .. } => InputError::new_err(said),
        Error::Corrupt { .. } | Error::Compatibility { .. } | Error::Differs { .. } => ModelError::new_err(said),
        Error::Unreachable { .. } => UnreachableError::new_err(said),
        Error::Memory { .. } | Error::Bound { .. } => PyMemoryError::new_err(said),
        Error::Io { place, source } => match source.raw_os_error() {
            // With its number Python picks FileNotFoundError, PermissionError and the like.
            Some(number) => {
                let said = source.to_string();
                let said = said.split(" (os error").next().unwrap_or_default().to_string();
                PyOSError::new_err((number, said, place.clone()))
            }
            None if source.kind() == std::io::ErrorKind::NotFound => {
                pyo3::exceptions::PyFileNotFoundError::new_err(said)
            }
            None => PyOSError::new_err(said),
        },
        Error::Output { .. } => PyFileExistsError::new_err(said),
        Error::Cancelled | Error::Checkpointed { .. } => PyKeyboardInterrupt::new_err(said),
        _ => PyRuntimeError::new_err(said),
    }
}

/// The library's results as Python's.
pub trait IntoPyResult<T> {
    /// The value, or the exception that its error is.
    fn or_raise(self) -> PyResult<T>;
}

impl<T> IntoPyResult<T> for particlegs::Result<T> {
    fn or_raise(self) -> PyResult<T> {
        self.map_err(|e| exception(&e))
    }
}

//! The library's errors as exceptions.

use particlegs_core::{Error, Hint, NamedValue};
use pyo3::exceptions::{
    PyFileExistsError, PyKeyboardInterrupt, PyMemoryError, PyOSError, PyRuntimeError, PyValueError,
};
use pyo3::prelude::*;
use pyo3::{PyTypeInfo, create_exception};
use std::path::Path;

create_exception!(particlegs, InputError, PyValueError, "A snapshot, model or argument that cannot be used as it is.");
create_exception!(particlegs, ModelError, InputError, "A model file that is corrupt or of an unknown version.");
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

/// The enum value named by an argument.
pub fn named<T: NamedValue>(argument: &str, name: &str) -> PyResult<T> {
    T::from_name(name).map_err(|message| InputError::new_err(format!("{argument}=\"{name}\": {message}")))
}

/// A hint for Python: arguments and methods instead of options and commands.
fn hint_text(hint: &Hint) -> String {
    let argument = |name: &str, value: &str| match (name, value) {
        ("skip-invalid", _) => "skip_invalid=True".into(),
        ("mass-field", "none") => "mass_field=None".into(),
        ("layers-by" | "share-gaussians", _) => format!("{}=\"{value}\"", name.replace('-', "_")),
        ("particle-type", _) => "species=".into(),
        ("gadget-blocks", _) => format!("blocks=\"{value}\".split(\",\")"),
        ("positions", "A,B,C") => "positions=\"A,B,C\"".into(),
        ("box", _) => "box=".into(),
        ("fields", _) => "fields=".into(),
        ("layer", _) => "layers=".into(),
        ("force", _) => "overwrite=True".into(),
        ("size", _) => format!("size={}", value.trim_end_matches('B')),
        _ => format!("{}={value}", name.replace('-', "_")),
    };
    let method = |name: &str, arguments: &str| match name {
        "compress" => "compress()".into(),
        "recover" => "Model.recover()".into(),
        "render" => "Model.render()".into(),
        _ => format!("`{}`", ["particlegs", name, arguments].join(" ").trim_end()),
    };
    hint.spell(argument, method)
}

/// The exception for an error.
pub fn exception(error: &Error) -> PyErr {
    let hint = error.hint();
    let message = match hint.is_empty() {
        true => error.to_string(),
        false => format!("{error}; {}", hint_text(&hint)),
    };
    match error {
        Error::Input { .. } | Error::Argument { .. } => InputError::new_err(message),
        Error::Corrupt { .. } | Error::Compatibility { .. } | Error::Differs { .. } => ModelError::new_err(message),
        Error::Unreachable { .. } => UnreachableError::new_err(message),
        Error::Memory { .. } | Error::Bound { .. } => PyMemoryError::new_err(message),
        Error::Io { place, source } => match source.raw_os_error() {
            // From the number Python makes FileNotFoundError, PermissionError and so on.
            Some(number) => {
                let message = source.to_string();
                let message = message.split(" (os error").next().unwrap_or_default().to_string();
                PyOSError::new_err((number, message, place.clone()))
            }
            None if source.kind() == std::io::ErrorKind::NotFound => {
                pyo3::exceptions::PyFileNotFoundError::new_err(message)
            }
            None => PyOSError::new_err(message),
        },
        Error::Output { .. } => PyFileExistsError::new_err(message),
        Error::Cancelled | Error::Checkpointed { .. } => PyKeyboardInterrupt::new_err(message),
        _ => PyRuntimeError::new_err(message),
    }
}

/// Converts results of the library.
pub trait IntoPyResult<T> {
    /// The value, or the exception for the error.
    fn or_raise(self) -> PyResult<T>;
}

impl<T> IntoPyResult<T> for particlegs_core::Result<T> {
    fn or_raise(self) -> PyResult<T> {
        self.map_err(|e| exception(&e))
    }
}

/// Refuses to write to an existing path.
pub fn refuse(path: &Path, overwrite: bool) -> PyResult<()> {
    if overwrite || path.symlink_metadata().is_err() {
        return Ok(());
    }
    let message = format!("{} exists already: overwrite=True replaces it", path.display());
    Err(PyFileExistsError::new_err(message))
}

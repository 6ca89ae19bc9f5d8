//! Finds and opens ONNX Runtime's shared library. Nothing here runs before a network is opened.

use crate::{Error, Result};
use ort::environment::Environment;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// How to get the library.
pub(super) const HOW_TO_GET: &str = "pip install onnxruntime, and set ORT_DYLIB_PATH to its \
     onnxruntime/capi/libonnxruntime.so.* (or name the Python environment's folder)";

/// The environment of the library opened first; a process holds only one.
static OPENED: Mutex<Option<Environment>> = Mutex::new(None);

/// Opens the library, or returns the one that is open.
pub(super) fn load(given: Option<&Path>) -> Result<Environment> {
    let mut opened = OPENED.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(environment) = &*opened {
        return Ok(environment.clone());
    }
    let path = find(std::env::var_os("ORT_DYLIB_PATH").map(PathBuf::from).as_deref(), given)?;
    // The binding resolves relative paths against the program's folder; a user means the working
    // folder.
    let path = std::path::absolute(&path).map_err(|e| Error::file(&path, e))?;
    let unusable = |e: &dyn std::fmt::Display| {
        let text = format!("{}: {e}; {HOW_TO_GET}", path.display());
        Error::Runtime(text.split_whitespace().collect::<Vec<_>>().join(" "))
    };
    let environment = ort::init_from(&path).map_err(|e| unusable(&e))?.build().map_err(|e| unusable(&e))?;
    *opened = Some(environment.clone());
    Ok(environment)
}

/// The library's file: the one that the environment variable names, else the user's, or the one in
/// the user's folder.
pub(super) fn find(variable: Option<&Path>, given: Option<&Path>) -> Result<PathBuf> {
    let variable = variable.filter(|p| !p.as_os_str().is_empty());
    let places = [(variable, "ORT_DYLIB_PATH"), (given, "the given runtime")];
    for (place, called) in places {
        let Some(place) = place else { continue };
        if place.is_file() {
            return Ok(place.to_owned());
        }
        return library_in(place).ok_or_else(|| {
            let text =
                format!("{called} is {}, which is or holds no ONNX Runtime library; {HOW_TO_GET}", place.display());
            Error::Runtime(text)
        });
    }
    Err(Error::Runtime(format!("SAM 2.1 needs its library, and none is named; {HOW_TO_GET}")))
}

/// The library in a folder: directly, in a Python package, or in a virtual environment.
fn library_in(folder: &Path) -> Option<PathBuf> {
    let package = Path::new("onnxruntime").join("capi");
    let mut folders = vec![
        folder.to_owned(),
        folder.join("capi"),
        folder.join(&package),
        folder.join("Lib").join("site-packages").join(&package),
    ];
    let pythons = names(&folder.join("lib")).into_iter().filter(|n| n.starts_with("python"));
    folders.extend(pythons.map(|n| folder.join("lib").join(n).join("site-packages").join(&package)));
    folders.push(folder.join("lib"));
    folders.iter().find_map(|f| names(f).into_iter().find(|n| is_library(n)).map(|n| f.join(n)))
}

fn is_library(name: &str) -> bool {
    name == "onnxruntime.dll"
        || name.starts_with("libonnxruntime.so")
        || (name.starts_with("libonnxruntime.") && name.ends_with(".dylib"))
}

/// The names in a folder, sorted; none if it cannot be read.
pub(super) fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut names: Vec<String> = entries.filter_map(|e| e.file_name().into_string().ok()).collect();
    names.sort();
    names
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_library_is_found_where_python_puts_it() {
        let dir = tempfile::tempdir().unwrap();
        let capi = dir.path().join("lib/python3.11/site-packages/onnxruntime/capi");
        std::fs::create_dir_all(&capi).unwrap();
        let library = capi.join("libonnxruntime.so.1.31.1");
        assert!(find(None, Some(dir.path())).is_err());
        for name in ["libonnxruntime_providers_shared.so", "libonnxruntime.so.1.31.1"] {
            std::fs::write(capi.join(name), "").unwrap();
        }
        for given in [dir.path(), &dir.path().join("lib/python3.11/site-packages"), &capi, &library] {
            assert_eq!(find(None, Some(given)).unwrap(), library, "{}", given.display());
        }
        // The variable has priority, also when it is wrong.
        assert_eq!(find(Some(&library), Some(Path::new("nowhere"))).unwrap(), library);
        let message = find(Some(Path::new("/no/lib.so")), Some(dir.path())).unwrap_err().to_string();
        assert!(message.contains("ORT_DYLIB_PATH is /no/lib.so"), "{message}");
        assert_eq!(find(Some(Path::new("")), Some(dir.path())).unwrap(), library);
    }

    #[test]
    fn a_missing_library_is_one_line_with_the_remedy() {
        let message = find(None, None).unwrap_err().to_string();
        assert!(message.contains("pip install onnxruntime") && message.contains("ORT_DYLIB_PATH"), "{message}");
        assert!(!message.contains('\n'));
    }
}

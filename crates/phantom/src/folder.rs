//! The folder in which made phantoms are kept.

use std::ffi::OsString;
use std::path::PathBuf;

/// The folder in which made phantoms are kept: the environment variable `TROCAR_PHANTOMS`, else
/// `trocar/phantoms` in the user's cache (`XDG_CACHE_HOME`, or `~/.cache`), else `trocar-phantoms`
/// in the working folder.
pub fn phantoms_folder() -> PathBuf {
    choose(|name| std::env::var_os(name), std::env::home_dir())
}

fn choose(variable: impl Fn(&str) -> Option<OsString>, home: Option<PathBuf>) -> PathBuf {
    let folder = |name: &str| variable(name).filter(|value| !value.is_empty()).map(PathBuf::from);
    if let Some(given) = folder("TROCAR_PHANTOMS") {
        return given;
    }
    let home = home.filter(|home| !home.as_os_str().is_empty());
    match folder("XDG_CACHE_HOME").or_else(|| home.map(|home| home.join(".cache"))) {
        Some(cache) => cache.join("trocar").join("phantoms"),
        None => PathBuf::from("trocar-phantoms"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn the_variable_goes_before_the_cache_and_the_cache_before_the_working_folder() {
        let home = || Some(PathBuf::from("/home/ada"));
        let with = |set: &[(&str, &str)], home: Option<PathBuf>| {
            let find = |name: &str| set.iter().find(|s| s.0 == name).map(|s| OsString::from(s.1));
            choose(find, home)
        };
        let given = [("TROCAR_PHANTOMS", "/data/phantoms"), ("XDG_CACHE_HOME", "/cache")];
        assert_eq!(with(&given, home()), Path::new("/data/phantoms"));
        assert_eq!(with(&given[1..], home()), Path::new("/cache/trocar/phantoms"));
        assert_eq!(with(&[("TROCAR_PHANTOMS", "")], home()), Path::new("/home/ada/.cache/trocar/phantoms"));
        assert_eq!(with(&[], None), Path::new("trocar-phantoms"));
    }
}

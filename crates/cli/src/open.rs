//! Opens what was made in the browser.

/// Opens a file or an address in the browser if there is a desktop; `what` it is, for the message
/// if that fails.
pub fn in_browser(what_to_open: &str, what: &str) {
    let desktop = cfg!(target_os = "macos")
        || cfg!(windows)
        || std::env::var_os("DISPLAY").is_some()
        || std::env::var_os("WAYLAND_DISPLAY").is_some();
    if desktop && ::open::that_detached(what_to_open).is_err() {
        eprintln!("the browser cannot be started; open {what} yourself");
    }
}

//! External tools and libraries that some tests compare with, and that are not part of the project:
//! ONNX Runtime's library, MuJoCo, OpenCV, Embree, scikit-image, openpi's client and server, the
//! TetGen program. Without them these tests are skipped, and say so.

use std::path::Path;
use std::process::{Command, Stdio};

/// A Python environment of the project's own, beside what cargo builds.
struct Environment {
    folder: &'static str,
    /// Packages and their versions.
    packages: &'static [&'static str],
    /// The Python modules that must be importable then.
    modules: &'static str,
}

/// openpi's client wants an older NumPy than the others have.
const ENVIRONMENTS: [Environment; 2] = [
    Environment {
        folder: "target/tools",
        packages: &[
            "onnxruntime>=1.23",
            "mujoco>=4.0",
            "opencv-python-headless>=4.10",
            "embreex>=4.4",
            "scikit-image>=0.25",
        ],
        modules: "onnxruntime, mujoco, cv2, embreex, skimage",
    },
    Environment {
        folder: "target/tools-openpi",
        packages: &["openpi-client>=0.1.2", "openpi-server>=0.1", "typing-extensions"],
        modules: "openpi_client.websocket_client_policy, openpi_server",
    },
];

/// Fetches what is missing. A machine without network or Python is no error.
pub fn fetch() {
    for Environment { folder, packages, modules } in ENVIRONMENTS {
        let python = Path::new(folder).join("bin/python");
        let import = || quiet(Command::new(&python).args(["-c", &format!("import {modules}")]));
        if !import() {
            eprintln!("== tools: {} into {folder}", packages.join(" "));
            let made = quiet(Command::new("python3").args(["-m", "venv", folder]))
                && quiet(Command::new(&python).args(["-m", "pip", "install", "--quiet"]).args(packages));
            if !made || !import() {
                eprintln!(
                    "   not to be had (python3 with venv and network is needed); the tests that need it are skipped"
                );
            }
        }
    }
    // It ends with an error however it is asked for its help; that it starts is enough.
    if Command::new("tetgen").arg("-h").stdout(Stdio::null()).stderr(Stdio::null()).status().is_err() {
        eprintln!("== tools: tetgen (apt)");
        let install = |sudo: bool| {
            let mut command = if sudo { Command::new("sudo") } else { Command::new("apt-get") };
            if sudo {
                command.args(["-n", "apt-get"]);
            }
            quiet(command.args(["install", "-y", "-q", "tetgen"]))
        };
        if !install(false) && !install(true) {
            eprintln!("   not to be had without root; the tests that need it are skipped");
        }
    }
}

/// Runs a command without a word of it; says whether it could be started and went well.
fn quiet(command: &mut Command) -> bool {
    let status = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).status();
    status.is_ok_and(|s| s.success())
}

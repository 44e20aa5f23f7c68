//! Checks the files of Vulkan: loader, drivers and render nodes. Builds do not need Vulkan, and runs need
//! it only with `--backend gpu`.

use super::{Check, Feature, Machine, Status};
use std::path::PathBuf;

const LOADER: &str = "libvulkan.so.1";
const DRIVERS: [&str; 3] = [
    "usr/share/vulkan/icd.d",
    "usr/local/share/vulkan/icd.d",
    "etc/vulkan/icd.d",
];

pub(super) fn checks(machine: &Machine) -> Vec<Check> {
    let fix = || {
        let apt = machine.has("usr/bin/apt-get");
        apt.then(|| "sudo apt-get install mesa-vulkan-drivers libvulkan1".to_owned())
    };
    let check = |found: String| Check::ok("Vulkan", Feature::Vulkan, found);
    if !cfg!(feature = "gpu") {
        let found = "this program was built without the feature gpu".to_owned();
        return vec![check(found).but(Status::Missing, None)];
    }
    if library(machine, LOADER).is_none() {
        return vec![check(format!("no loader ({LOADER})")).but(Status::Missing, fix())];
    }
    let mut checks = Vec::new();
    let mut found = false;
    for file in DRIVERS.iter().flat_map(|folder| machine.list(folder)) {
        if file.extension().is_none_or(|e| e != "json") {
            continue;
        }
        let shown = machine.shown(&file);
        let text = machine.text(&file).unwrap_or_default();
        let json: serde_json::Value = serde_json::from_str(&text).unwrap_or_default();
        let Some(path) = json["ICD"]["library_path"].as_str() else {
            checks.push(check(format!("{shown} names no library")).but(Status::Note, None));
            continue;
        };
        if library(machine, path).is_some() {
            found = true;
            checks.push(check(format!("driver {path} ({shown})")));
        } else {
            checks.push(check(format!("{shown}: {path} is missing")).but(Status::Note, None));
        }
    }
    if !found {
        checks.push(check("no driver".into()).but(Status::Missing, fix()));
    }
    checks.extend(render_nodes(machine));
    checks
}

/// Finds a library by its path, or by its name in the folders of the system's linker.
fn library(machine: &Machine, name: &str) -> Option<PathBuf> {
    if let Some(path) = name.strip_prefix('/') {
        return Some(machine.path(path)).filter(|path| path.exists());
    }
    let mut folders: Vec<_> = ["usr/lib", "usr/lib64", "usr/local/lib", "lib"]
        .map(|folder| machine.path(folder))
        .into();
    // Debian has one library folder per architecture.
    let triples = machine.list("usr/lib").into_iter().filter(|path| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        name.contains("-linux-gnu")
    });
    folders.extend(triples);
    let mut paths = folders.into_iter().map(|folder| folder.join(name));
    paths.find(|path| path.exists())
}

/// Checks access to the render nodes of the GPUs. A software driver needs no render node.
fn render_nodes(machine: &Machine) -> Vec<Check> {
    let nodes = machine.list("dev/dri").into_iter().filter(|path| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        name.starts_with("renderD")
    });
    nodes
        .map(|path| {
            let shown = machine.shown(&path);
            match (machine.access)(&path, &machine.user) {
                Ok(()) => Check::ok("adapter", Feature::Vulkan, shown),
                Err(e) => Check::ok(
                    "adapter",
                    Feature::Vulkan,
                    format!("{shown}: {e}; join the group and log in again"),
                )
                .but(
                    Status::Note,
                    format!(
                        "sudo usermod -aG render {}",
                        machine.name("passwd", machine.user.uid)
                    ),
                ),
            }
        })
        .collect()
}

//! Checks whether the system files that Phasmid ships are installed.

use super::{Check, Feature, MODPROBE, MODULES_LOAD, Machine, Shipped, Status, UDEV};
use phasmid_v4l2::RELOAD;
use std::path::{Path, PathBuf};

/// Roots of the folders in which the system looks for configuration files, in order of precedence.
const ROOTS: [&str; 4] = ["etc", "run", "usr/lib", "lib"];

/// Returns the command that installs a file.
fn put(file: &Shipped) -> String {
    format!(
        "phasmid doctor --print {} | sudo tee {} > /dev/null",
        file.name, file.path
    )
}

/// Returns the command that installs and applies the udev rules.
pub(super) fn install_rules() -> String {
    format!(
        "{} && sudo udevadm control --reload && sudo udevadm trigger --subsystem-match=video4linux --action=change",
        put(&UDEV)
    )
}

/// Returns the command that installs the options of v4l2loopback and reloads the module.
pub(super) fn install_options() -> String {
    format!("{} && {RELOAD}", put(&MODPROBE))
}

pub(super) fn checks(machine: &Machine) -> Vec<Check> {
    vec![rules(machine), options(machine), loading(machine)]
}

/// Lists the files of a configuration folder under all [`ROOTS`], in order of precedence.
fn files(machine: &Machine, folder: &str) -> Vec<PathBuf> {
    let folders = ROOTS.iter().map(|root| Path::new(root).join(folder));
    folders.flat_map(|folder| machine.list(folder)).collect()
}

fn rules(machine: &Machine) -> Check {
    let check = |found: String| Check::ok("udev rules", Feature::V4l2, found);
    let name = Path::new(UDEV.path).file_name();
    let ours = files(machine, "udev/rules.d")
        .into_iter()
        .find(|path| path.file_name() == name);
    let without_udev = if machine.has("run/udev") {
        ""
    } else {
        "; udev does not run here, so nothing applies them"
    };
    let Some(path) = ours else {
        let found = format!("not installed: no stable names{without_udev}");
        return check(found).but(Status::Note, install_rules());
    };
    let shown = machine.shown(&path);
    if machine.text(&path).as_deref() == Some(UDEV.text) {
        check(format!("{shown}{without_udev}"))
    } else {
        let found = format!("{shown} differs from this version's file{without_udev}");
        check(found).but(Status::Note, install_rules())
    }
}

fn options(machine: &Machine) -> Check {
    let check = |found: String| Check::ok("module options", Feature::V4l2, found);
    let name = Path::new(MODPROBE.path).file_name();
    let mut foreign = None;
    for path in files(machine, "modprobe.d") {
        let text = machine.text(&path).unwrap_or_default();
        let shown = machine.shown(&path);
        if path.file_name() == name {
            return if text == MODPROBE.text {
                check(shown)
            } else {
                let found = format!("{shown} differs from this version's file");
                check(found).but(Status::Note, install_options())
            };
        }
        let words = |line: &str| {
            let mut words = line.split_whitespace();
            words.next() == Some("options") && words.next() == Some("v4l2loopback")
        };
        if text.lines().any(words) {
            foreign.get_or_insert(shown);
        }
    }
    match foreign {
        Some(shown) => check(format!("{shown}, which Phasmid does not ship")),
        None => check("not installed: modprobe makes one node, without a Phasmid label".into())
            .but(Status::Note, install_options()),
    }
}

fn loading(machine: &Machine) -> Check {
    let check = |found: String| Check::ok("at start", Feature::V4l2, found);
    let mut paths = files(machine, "modules-load.d");
    paths.push(machine.path("etc/modules"));
    let loads = paths.into_iter().find(|path| {
        let text = machine.text(path).unwrap_or_default();
        text.lines().any(|line| line.trim() == "v4l2loopback")
    });
    match loads {
        Some(path) => check(format!("{} loads the module", machine.shown(&path))),
        None => {
            check("the module is not loaded at boot".into()).but(Status::Note, put(&MODULES_LOAD))
        }
    }
}

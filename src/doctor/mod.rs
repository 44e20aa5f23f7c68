//! Reports what a machine has and lacks for Phasmid, and the command that fixes each lack.
//!
//! Everything is read from files in `/sys`, `/proc`, `/etc` and `/dev`. The only devices opened are
//! `/dev/ptmx` and the v4l2loopback nodes that are labelled for Phasmid, so a check does not disturb
//! other programs. The root of the file system, the user and the environment are parameters, so the
//! tests examine machines made of files.
//!
//! | file | contents |
//! | --- | --- |
//! | `basics` | pty and run directory |
//! | `module` | the kernel module v4l2loopback |
//! | `nodes` | video nodes: state, permissions, stable names |
//! | `installed` | the system files that Phasmid ships |
//! | `usb` | the virtual USB host controller and the drivers |
//! | `vulkan` | Vulkan loader, drivers and render nodes |
//! | `machine` | the examined machine |
//! | `report` | the results as text and JSON |

mod basics;
mod installed;
mod machine;
mod module;
mod nodes;
mod report;
#[cfg(test)]
mod tests;
mod usb;
mod vulkan;

pub use installed::{MODPROBE, MODULES_LOAD, Shipped, UDEV};
pub use machine::{Machine, User};
pub use report::{Check, Feature, Report, Status};

/// Runs all checks.
pub fn examine(machine: &Machine) -> Report {
    let mut checks = basics::checks(machine);
    checks.push(module::check(machine));
    checks.extend(nodes::checks(machine));
    // In a container, /etc is not what the host's module tools read. The checks run there only if the
    // module is loaded.
    if !machine.container() || machine.has(module::LOADED) {
        checks.extend(installed::checks(machine));
    }
    checks.extend(usb::checks(machine));
    checks.extend(vulkan::checks(machine));
    Report {
        kernel: machine.release.clone(),
        container: machine.container(),
        checks,
    }
}

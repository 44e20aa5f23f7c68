//! What a machine has and lacks for Phasmid, and the one command that mends each lack.
//!
//! Everything is read from files: `/sys`, `/proc`, `/etc`, `/dev`. No device is opened but
//! `/dev/ptmx` and the v4l2loopback nodes that are labelled for Phasmid, so a look disturbs nobody. Root of the file system, user and environment are passed
//! in, so the tests look at machines made of files.

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

/// Looks at everything.
pub fn examine(machine: &Machine) -> Report {
    let mut checks = basics::checks(machine);
    checks.push(module::check(machine));
    checks.extend(nodes::checks(machine));
    // A container's /etc is not the one that the kernel's programs read, unless it was let to load
    // the module.
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

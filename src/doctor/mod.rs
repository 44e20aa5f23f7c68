//! Reports which requirements of Phasmid a machine meets, and the command that fixes each unmet
//! one.
//!
//! Everything is read from files in `/sys`, `/proc`, `/etc` and `/dev`. The only devices opened are
//! `/dev/ptmx` and the v4l2loopback nodes that are labelled for Phasmid, so a check does not disturb
//! other programs. The root of the file system, the user and the environment are parameters, so that
//! tests can examine imitated machines that are trees of files.
//!
//! | file | contents |
//! | --- | --- |
//! | `links` | pty, run directory, virtual USB host controller and the drivers |
//! | `v4l2` | the kernel module v4l2loopback, its nodes, and the installed files |
//! | `vulkan` | Vulkan loader, drivers and render nodes |
//! | `machine` | the examined machine |
//! | `report` | the results as text and JSON |
//! | `shipped` | the system files that Phasmid ships |

mod links;
mod machine;
mod report;
mod shipped;
#[cfg(all(test, feature = "gpu", feature = "v4l2"))]
mod tests;
#[cfg(feature = "v4l2")]
mod v4l2;
#[cfg(not(feature = "v4l2"))]
#[path = "without_v4l2.rs"]
mod v4l2;
mod vulkan;

pub use machine::{Machine, User};
pub use report::{Check, Feature, Report, Status};
pub use shipped::{MODPROBE, MODULES_LOAD, Shipped, UDEV};
pub use v4l2::is_forgotten;

/// Runs all checks.
pub fn examine(machine: &Machine) -> Report {
    let mut checks = links::ports(machine);
    checks.extend(v4l2::checks(machine));
    checks.extend(links::usb(machine));
    checks.extend(vulkan::checks(machine));
    Report {
        kernel: machine.release.clone(),
        container: machine.container(),
        checks,
    }
}

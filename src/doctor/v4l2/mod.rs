//! Checks the requirements for emulating a device as a V4L2 camera of the kernel.
//!
//! | file | contents |
//! | --- | --- |
//! | `module` | the kernel module v4l2loopback |
//! | `nodes` | video nodes: state, permissions, stable names |
//! | `installed` | whether the system files that Phasmid ships are installed |

mod installed;
mod module;
mod nodes;

use super::{Check, Feature, MODPROBE, MODULES_LOAD, Machine, Shipped, Status, UDEV};
use phasmid_v4l2::Node;
use std::path::Path;

pub(super) fn checks(machine: &Machine) -> Vec<Check> {
    let mut checks = vec![module::check(machine)];
    checks.extend(nodes::checks(machine));
    // The host's module tools do not read a container's /etc. In a container, check the installed files
    // only if the module is loaded.
    if !machine.container() || machine.has(module::LOADED) {
        checks.extend(installed::checks(machine));
    }
    checks
}

/// Returns whether a v4l2loopback node has lost both its capture and its output side; see
/// [`Machine::forgotten`].
pub fn is_forgotten(path: &Path) -> bool {
    Node::open(path).is_ok_and(|(_, node)| node.is_forgotten())
}

impl Machine {
    /// Returns a file's first line; `None` if it cannot be read.
    fn line(&self, path: impl AsRef<Path>) -> Option<String> {
        let text = self.text(path)?;
        Some(text.lines().next().unwrap_or_default().trim().to_owned())
    }
}

//! The results of the checks, as text and JSON.

use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::{self, Display, Formatter};

/// Result of a check.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Status {
    /// No problem.
    Ok,
    /// The subject works, but not as well as it could.
    Note,
    /// The subject is missing, so the feature does not work.
    Missing,
}

/// A feature of Phasmid; each check belongs to one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Feature {
    /// The device without kernel modules: control port on a pty, frames on a socket.
    Embedded,
    /// The device as a V4L2 camera of the kernel.
    V4l2,
    /// The device as a USB device of this machine's kernel.
    Usb,
    /// Rendering on a GPU.
    Vulkan,
}

impl Feature {
    /// All features.
    pub const ALL: [Self; 4] = [Self::Embedded, Self::V4l2, Self::Usb, Self::Vulkan];

    fn words(self) -> (&'static str, &'static str) {
        match self {
            Self::Embedded => ("pty and frame socket", "`phasmid serve` cannot run"),
            Self::V4l2 => (
                "V4L2 camera",
                "`phasmid serve --camera auto` uses the frame socket",
            ),
            Self::Usb => (
                "USB device",
                "`phasmid serve --usb attach` fails; --usb export works",
            ),
            Self::Vulkan => ("GPU (Vulkan)", "`--backend gpu` fails; auto uses the CPU"),
        }
    }
}

/// One check and its result.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Check {
    /// Subject of the check.
    pub topic: &'static str,
    /// The feature that needs the subject.
    pub feature: Feature,
    /// The result.
    pub status: Status,
    /// The finding and its consequence, as text.
    pub found: String,
    /// The command that fixes the problem.
    pub fix: Option<String>,
}

impl Check {
    /// Makes a check without a problem.
    pub(super) fn ok(topic: &'static str, feature: Feature, found: impl Display) -> Self {
        Self {
            topic,
            feature,
            status: Status::Ok,
            found: plain(&found.to_string()),
            fix: None,
        }
    }

    /// Returns the check with another status and the command that fixes it.
    pub(super) fn but(mut self, status: Status, fix: impl Into<Option<String>>) -> Self {
        self.status = status;
        self.fix = fix.into();
        self
    }
}

/// Replaces control characters by `?`, because labels and files may contain anything.
fn plain(text: &str) -> String {
    let steers = |c: char| c.is_control();
    text.chars()
        .map(|c| if steers(c) { '?' } else { c })
        .collect()
}

/// The results of all checks.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Report {
    /// The running kernel's release.
    pub kernel: String,
    /// Whether the machine looks like a container. The kernel modules of a container are loaded by
    /// its host.
    pub container: bool,
    /// The checks, in the order in which problems are best fixed.
    pub checks: Vec<Check>,
}

impl Report {
    /// Returns whether the machine has everything that a feature needs.
    pub fn works(&self, feature: Feature) -> bool {
        let mut its = self.checks.iter().filter(|check| check.feature == feature);
        its.all(|check| check.status != Status::Missing)
    }

    /// Returns whether the embedded device and all these features work.
    pub fn suffices(&self, needed: &[Feature]) -> bool {
        self.works(Feature::Embedded) && needed.iter().all(|feature| self.works(*feature))
    }

    /// Returns the report as JSON.
    pub fn to_json(&self) -> serde_json::Value {
        let features: BTreeMap<Feature, bool> = Feature::ALL
            .map(|feature| (feature, self.works(feature)))
            .into();
        serde_json::json!({
            "kernel": self.kernel,
            "container": self.container,
            "features": features,
            "checks": self.checks,
        })
    }
}

impl Display for Report {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let container = if self.container {
            "; this looks like a container: run the commands for kernel modules on its host"
        } else {
            ""
        };
        writeln!(f, "kernel {}{container}", plain(&self.kernel))?;
        for check in &self.checks {
            let status = match check.status {
                Status::Ok => "ok",
                Status::Note => "note",
                Status::Missing => "missing",
            };
            writeln!(f, "{status:<9}{:<15}{}", check.topic, check.found)?;
            if let Some(fix) = &check.fix {
                writeln!(f, "{:24}$ {fix}", "")?;
            }
        }
        writeln!(f)?;
        for feature in Feature::ALL {
            let (name, without) = feature.words();
            if self.works(feature) {
                writeln!(f, "{name}: works")?;
            } else {
                writeln!(f, "{name}: off, {without}")?;
            }
        }
        Ok(())
    }
}

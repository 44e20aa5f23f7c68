//! What was found, in words and for programs.

use serde::Serialize;
use std::fmt::{self, Display, Formatter};

/// How a thing stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Status {
    /// As it should be.
    Ok,
    /// It works, less well than it could.
    Note,
    /// The feature is off without it.
    Missing,
}

/// What a thing is needed for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Feature {
    /// The device that needs nothing of the kernel: control port on a pty, frames on a socket.
    Embedded,
    /// The device as a camera of the kernel.
    V4l2,
    /// The device as a USB device of this machine's kernel.
    Usb,
    /// Rendering on a graphics adapter.
    Vulkan,
}

impl Feature {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Embedded, Self::V4l2, Self::Usb, Self::Vulkan];

    fn words(self) -> (&'static str, &'static str) {
        match self {
            Self::Embedded => ("pty and frame socket", "`phasmid serve` cannot run"),
            Self::V4l2 => (
                "V4L2 camera",
                "`phasmid serve --camera auto` takes the frame socket",
            ),
            Self::Usb => (
                "USB device",
                "`phasmid serve --usb attach` is refused; --usb export works",
            ),
            Self::Vulkan => (
                "GPU (Vulkan)",
                "`--backend gpu` is refused; auto takes the processor",
            ),
        }
    }
}

/// One thing that was looked at.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Check {
    /// What it is.
    pub topic: &'static str,
    /// What it is needed for.
    pub feature: Feature,
    /// How it stands.
    pub status: Status,
    /// What was found, and what follows from it.
    pub found: String,
    /// The command that mends it.
    pub fix: Option<String>,
}

impl Check {
    /// Something that is as it should be.
    pub(super) fn ok(topic: &'static str, feature: Feature, found: impl Display) -> Self {
        Self {
            topic,
            feature,
            status: Status::Ok,
            found: plain(&found.to_string()),
            fix: None,
        }
    }

    /// The same check with what is to be said of it.
    pub(super) fn but(mut self, status: Status, fix: impl Into<Option<String>>) -> Self {
        self.status = status;
        self.fix = fix.into();
        self
    }
}

/// Labels and files are anybody's: nothing in them steers a terminal.
fn plain(text: &str) -> String {
    let steers = |c: char| c.is_control();
    text.chars()
        .map(|c| if steers(c) { '?' } else { c })
        .collect()
}

/// Everything that was found.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Report {
    /// The running kernel's release.
    pub kernel: String,
    /// It is a container's, so modules are loaded elsewhere.
    pub container: bool,
    /// In the order in which a reader would mend them.
    pub checks: Vec<Check>,
}

impl Report {
    /// Whether a feature lacks nothing.
    pub fn works(&self, feature: Feature) -> bool {
        let mut its = self.checks.iter().filter(|check| check.feature == feature);
        its.all(|check| check.status != Status::Missing)
    }

    /// Whether the embedded device and all of these work.
    pub fn suffices(&self, needed: &[Feature]) -> bool {
        self.works(Feature::Embedded) && needed.iter().all(|feature| self.works(*feature))
    }

    /// For programs.
    pub fn to_json(&self) -> serde_json::Value {
        serde_json::json!({
            "kernel": self.kernel,
            "container": self.container,
            "features": {
                "embedded": self.works(Feature::Embedded),
                "v4l2": self.works(Feature::V4l2),
                "vulkan": self.works(Feature::Vulkan),
            },
            "checks": self.checks,
        })
    }
}

impl Display for Report {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let container = if self.container {
            "; this looks like a container: what concerns the kernel is done on its host"
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

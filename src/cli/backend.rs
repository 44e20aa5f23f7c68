//! `--backend`: where the render passes run.

use phasmid_render::Backend;
use std::fmt;

/// Values of `--backend`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum Choice {
    /// The CPU; equal seeds give equal bytes on every machine
    Cpu,
    /// A Vulkan adapter, a software one if there is no other; fails without one
    Gpu,
    /// A hardware Vulkan adapter if there is one that can hold the scene, else the CPU
    Auto,
}

impl From<Choice> for Backend {
    fn from(choice: Choice) -> Self {
        match choice {
            Choice::Cpu => Self::Cpu,
            Choice::Gpu => Self::Gpu,
            Choice::Auto => Self::Auto,
        }
    }
}

impl fmt::Display for Choice {
    /// Writes the value as spelled on the command line.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Cpu => "cpu",
            Self::Gpu => "gpu",
            Self::Auto => "auto",
        })
    }
}

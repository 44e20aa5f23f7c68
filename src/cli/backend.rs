//! `--backend`: what runs the passes of a rendering.

use phasmid_render::Backend;
use std::fmt;

/// What a command line may ask for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum Choice {
    /// The processor
    Cpu,
    /// A Vulkan adapter, software where there is no other
    Gpu,
    /// A Vulkan adapter that is hardware, where there is one that holds the scene; else the processor
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
    /// As it is written on a command line.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Cpu => "cpu",
            Self::Gpu => "gpu",
            Self::Auto => "auto",
        })
    }
}

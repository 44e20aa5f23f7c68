//! `phasmid doctor`: reports which requirements of Phasmid this machine meets.

use crate::doctor::{
    Feature, MODPROBE, MODULES_LOAD, Machine, Shipped, UDEV, User, examine, is_forgotten,
};
use phasmid_core::error::{Error, Result};
use rustix::fs::{Access, AtFlags, CWD};
use std::io;
use std::path::Path;

/// Report which requirements this machine meets, and the command that fixes each unmet one
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  phasmid doctor --need v4l2")]
pub struct Args {
    /// Fail unless this feature works; may be repeated. The pty and the frame socket are always needed
    #[arg(long, value_enum, value_name = "FEATURE")]
    need: Vec<Need>,
    /// Print the report as JSON
    #[arg(long)]
    json: bool,
    /// Print only this system file, which Phasmid ships
    #[arg(long, value_enum, value_name = "FILE", conflicts_with_all = ["need", "json"])]
    print: Option<Print>,
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum Need {
    /// The device as a V4L2 camera of the kernel.
    V4l2,
    /// The device as a USB device of this machine's kernel.
    Usb,
    /// Rendering on a GPU; checks that loader and driver files exist, without loading them.
    Vulkan,
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum Print {
    /// Rules for stable names and permissions.
    Udev,
    /// Options of v4l2loopback.
    Modprobe,
    /// Loads v4l2loopback at boot.
    ModulesLoad,
}

pub(super) fn run(args: &Args) -> Result<()> {
    if let Some(print) = args.print {
        let Shipped { text, .. } = match print {
            Print::Udev => UDEV,
            Print::Modprobe => MODPROBE,
            Print::ModulesLoad => MODULES_LOAD,
        };
        print!("{text}");
        return Ok(());
    }
    let report = examine(&this_machine());
    if args.json {
        println!("{:#}", report.to_json());
    } else {
        print!("{report}");
    }
    let needed: Vec<_> = args
        .need
        .iter()
        .map(|need| match need {
            Need::V4l2 => Feature::V4l2,
            Need::Usb => Feature::Usb,
            Need::Vulkan => Feature::Vulkan,
        })
        .collect();
    if report.suffices(&needed) {
        Ok(())
    } else {
        Err(Error::device(
            "a required feature does not work; see the report above",
        ))
    }
}

fn this_machine() -> Machine {
    let mut groups: Vec<_> = rustix::process::getgroups()
        .unwrap_or_default()
        .into_iter()
        .map(rustix::process::Gid::as_raw)
        .collect();
    groups.push(rustix::process::getegid().as_raw());
    Machine {
        root: "/".into(),
        release: rustix::system::uname().release().to_string_lossy().into(),
        user: User {
            uid: rustix::process::geteuid().as_raw(),
            groups,
        },
        container_env: std::env::var_os("container").is_some_and(|name| !name.is_empty()),
        run_parent: super::serve::run_parent(),
        access,
        forgotten: is_forgotten,
    }
}

fn access(path: &Path, _: &User) -> io::Result<()> {
    let wanted = Access::READ_OK | Access::WRITE_OK;
    rustix::fs::accessat(CWD, path, wanted, AtFlags::EACCESS).map_err(io::Error::from)
}

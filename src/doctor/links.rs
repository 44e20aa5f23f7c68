//! Checks the requirements of an emulated device's links other than V4L2: a pty, a folder for
//! sockets, the virtual USB host controller, which attaches an exported device to this machine's
//! kernel, and the drivers for that device.

use super::{Check, Feature, Machine, Status};
use std::fs::File;

const CONTROLLER: &str = "sys/devices/platform/vhci_hcd.0";
/// Name of each driver, and start of the file name of the driver's kernel module.
const DRIVERS: [(&str, &str); 2] = [("uvcvideo", "uvcvideo.ko"), ("cdc_acm", "cdc-acm.ko")];

/// Checks the pty and the folder of run directories.
pub(super) fn ports(machine: &Machine) -> Vec<Check> {
    vec![pty(machine), run_directory(machine)]
}

fn pty(machine: &Machine) -> Check {
    let topic = "pty";
    let check = |found: String| Check::ok(topic, Feature::Embedded, found);
    let opened = File::options()
        .read(true)
        .write(true)
        .open(machine.path("dev/ptmx"));
    let mounts = machine.text("proc/mounts");
    let mounted = match &mounts {
        Some(mounts) => mounts
            .lines()
            .any(|line| line.split(' ').nth(2) == Some("devpts")),
        None => machine.has("dev/pts"),
    };
    match opened {
        _ if !mounted => check("no devpts is mounted: the control port cannot be created".into())
            .but(
                Status::Missing,
                "sudo mkdir -p /dev/pts && sudo mount -t devpts devpts /dev/pts".to_owned(),
            ),
        Ok(_) => check("/dev/ptmx opens: the control port can be created".into()),
        Err(e) => check(format!("/dev/ptmx: {e}: cannot create the control port"))
            .but(Status::Missing, "sudo chmod 666 /dev/ptmx".to_owned()),
    }
}

fn run_directory(machine: &Machine) -> Check {
    let place = machine.run_parent.display();
    let access = (machine.access)(&machine.run_parent, &machine.user);
    match access {
        Ok(()) => Check::ok(
            "run directory",
            Feature::Embedded,
            format!("can be created in {place}"),
        ),
        Err(e) => Check::ok(
            "run directory",
            Feature::Embedded,
            format!("{place}: {e}; use a folder of your own"),
        )
        .but(
            Status::Missing,
            "phasmid serve --run-dir ~/phasmid-run".to_owned(),
        ),
    }
}

/// Checks the virtual USB host controller and the drivers.
pub(super) fn usb(machine: &Machine) -> Vec<Check> {
    let check = |topic, found: String| Check::ok(topic, Feature::Usb, found);
    let controller = check("vhci_hcd", "loaded".into());
    let controller = if machine.has(CONTROLLER) {
        controller
    } else if machine.container() {
        check(
            "vhci_hcd",
            "not loaded, and a container loads no modules: load it on the host; `phasmid serve \
             --usb export` and `phasmid scan --device` do not need it"
                .into(),
        )
        .but(Status::Missing, "sudo modprobe vhci-hcd".to_owned())
    } else {
        check(
            "vhci_hcd",
            "not loaded; `phasmid serve --usb attach` needs it, --usb export does not".into(),
        )
        .but(Status::Missing, "sudo modprobe vhci-hcd".to_owned())
    };
    let modules = format!("lib/modules/{}", machine.release);
    let list = |file| {
        machine
            .text(format!("{modules}/{file}"))
            .unwrap_or_default()
    };
    let known = [list("modules.dep"), list("modules.builtin")].concat();
    // Debian's kernels for cloud machines lack these drivers; the package linux-image-amd64 has
    // them.
    let apt = machine.has("usr/bin/apt-get");
    let install = || apt.then(|| "sudo apt-get install linux-image-amd64".to_owned());
    let drivers = DRIVERS.iter().map(|&(driver, file)| {
        if machine.has(format!("sys/module/{driver}")) {
            check(driver, "loaded".into())
        } else if known.contains(file) {
            check(driver, "available when a device is attached".into())
        } else {
            check(driver, "not among this kernel's modules".into()).but(Status::Note, install())
        }
    });
    std::iter::once(controller).chain(drivers).collect()
}

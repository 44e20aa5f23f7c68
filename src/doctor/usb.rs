//! Checks the virtual USB host controller, which attaches an exported device to this machine's kernel, and
//! the drivers for the device.

use super::{Check, Feature, Machine, Status};

const CONTROLLER: &str = "sys/devices/platform/vhci_hcd.0";
/// Each driver, and the start of its module's file name.
const DRIVERS: [(&str, &str); 2] = [("uvcvideo", "uvcvideo.ko"), ("cdc_acm", "cdc-acm.ko")];

pub(super) fn checks(machine: &Machine) -> Vec<Check> {
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
    // Kernels for cloud machines omit drivers.
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

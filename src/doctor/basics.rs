//! Checks what the embedded device needs: a pty and a folder for its sockets.

use super::{Check, Feature, Machine, Status};
use std::fs::File;

pub(super) fn checks(machine: &Machine) -> Vec<Check> {
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

//! Checks video nodes: which nodes are labelled for Phasmid, who may open these, their numbers of
//! buffers, and their stable names.

use super::installed::{install_options, install_rules};
use super::module;
use super::{Check, Feature, Machine, Status};
use phasmid_v4l2::{FORGOTTEN, RELOAD};
use std::os::unix::fs::MetadataExt;
use std::path::PathBuf;

/// Start of the labels of nodes that `phasmid serve --camera auto` uses; case is ignored.
const LABEL: &str = "phasmid";
/// Maximum number of nodes of other drivers that are listed.
const MAX_OTHERS: usize = 8;

struct Node {
    number: u32,
    label: String,
    /// Whether the node has an attribute that only nodes of v4l2loopback have.
    loopback: bool,
    driver: String,
    /// Format of the producer's stream, as the module reports it, such as `GREY:640x480@30`.
    stream: Option<String>,
    buffers: Option<u32>,
    path: PathBuf,
    /// Whether the node has lost both its capture and its output side, which makes it unusable.
    /// Checked only for nodes that are labelled for Phasmid.
    forgotten: bool,
}

impl Node {
    fn ours(&self) -> bool {
        let start = self.label.get(..LABEL.len());
        self.loopback && start.is_some_and(|start| start.eq_ignore_ascii_case(LABEL))
    }
}

pub(super) fn checks(machine: &Machine) -> Vec<Check> {
    let mut nodes = nodes(machine);
    for node in nodes.iter_mut().filter(|node| node.ours()) {
        node.forgotten = (machine.forgotten)(&node.path);
    }
    // An unusable node is only a note if another node is usable.
    let usable = nodes.iter().any(|node| node.ours() && !node.forgotten);
    let (loopbacks, others): (Vec<_>, Vec<_>) = nodes.into_iter().partition(|node| node.loopback);
    let mut checks = Vec::new();
    for (index, node) in loopbacks.iter().enumerate() {
        if node.ours() {
            checks.push(if node.forgotten {
                let status = if usable {
                    Status::Note
                } else {
                    Status::Missing
                };
                forgotten(node).but(status, RELOAD.to_owned())
            } else {
                camera(machine, node, index)
            });
            checks.extend(access(machine, node));
        } else {
            checks.push(Check::ok(
                "other node",
                Feature::V4l2,
                format!(
                    "/dev/video{} (v4l2loopback {:?}) is not labelled for Phasmid and is not used",
                    node.number, node.label
                ),
            ));
        }
    }
    for node in others.iter().take(MAX_OTHERS) {
        checks.push(Check::ok(
            "other node",
            Feature::V4l2,
            format!(
                "/dev/video{} ({} {:?})",
                node.number, node.driver, node.label
            ),
        ));
    }
    let ours: Vec<_> = loopbacks.iter().filter(|node| node.ours()).collect();
    if ours.is_empty() {
        if machine.has(module::LOADED) {
            checks.push(
                Check::ok(
                    "camera",
                    Feature::V4l2,
                    "no v4l2loopback node has a label that starts with Phasmid",
                )
                .but(Status::Missing, install_options()),
            );
        }
    } else {
        checks.push(names(machine, &ours));
    }
    checks
}

fn nodes(machine: &Machine) -> Vec<Node> {
    let mut nodes: Vec<_> = machine
        .list("sys/class/video4linux")
        .into_iter()
        .filter_map(|path| {
            let name = path.file_name()?.to_str()?.to_owned();
            let number = name.strip_prefix("video")?.parse().ok()?;
            let loopback = path.join("max_openers").exists();
            let driver = std::fs::read_link(path.join("device/driver")).ok();
            let driver = driver.and_then(|d| Some(d.file_name()?.to_str()?.to_owned()));
            Some(Node {
                number,
                label: machine.line(path.join("name")).unwrap_or_default(),
                loopback,
                driver: driver.unwrap_or_else(|| "virtual".into()),
                stream: machine.line(path.join("format")).filter(|f| !f.is_empty()),
                buffers: machine
                    .line(path.join("buffers"))
                    .and_then(|line| line.parse().ok()),
                path: machine.path(format!("dev/{name}")),
                forgotten: false,
            })
        })
        .collect();
    nodes.sort_by_key(|node| node.number);
    nodes
}

fn forgotten(node: &Node) -> Check {
    let found = format!("/dev/video{} {:?}: {FORGOTTEN}", node.number, node.label);
    Check::ok("camera", Feature::V4l2, found)
}

fn camera(machine: &Machine, node: &Node, index: usize) -> Check {
    let state = match &node.stream {
        Some(stream) => format!("a producer streams {stream}"),
        None => "free".into(),
    };
    let mut found = format!("/dev/video{} {:?}: {state}", node.number, node.label);
    let mut fix = None;
    if module::exclusive(machine, node.number, index) == Some(false) {
        found += "; exclusive_caps=0: browsers, OpenCV and GStreamer may not see it as a camera";
        fix = Some(install_options());
    }
    if let (Some(left), Some(most)) = (node.buffers, module::buffers(machine))
        && left < most
    {
        found += &format!(
            "; {left} of {most} buffers: a reader has requested fewer, and version 0.12 keeps that number; a frame that is being read is overwritten {left} frames later"
        );
        fix.get_or_insert_with(|| RELOAD.to_owned());
    }
    let check = Check::ok("camera", Feature::V4l2, found);
    match fix {
        Some(fix) => check.but(Status::Note, fix),
        None => check,
    }
}

/// Checks whether the user may open a node. If not, the result says how to get the permission.
fn access(machine: &Machine, node: &Node) -> Option<Check> {
    let place = format!("/dev/video{}", node.number);
    let check = |found: String| Check::ok("permission", Feature::V4l2, found);
    let Ok(file) = std::fs::metadata(&node.path) else {
        let found = format!("{place} is missing in /dev, although the kernel has the device");
        return Some(if machine.container() {
            // Give no command, because only the user knows how the container was started.
            check(format!(
                "{found}: start the container with `--device {place}` (docker, podman)"
            ))
            .but(Status::Missing, None)
        } else {
            check(found).but(
                Status::Missing,
                "sudo udevadm trigger --subsystem-match=video4linux".to_owned(),
            )
        });
    };
    let Err(e) = (machine.access)(&node.path, &machine.user) else {
        return Some(check(format!("{place} can be read and written")));
    };
    let group = machine.name("group", file.gid());
    let mode = file.mode() & 0o777;
    let user = machine.name("passwd", machine.user.uid);
    let mut groups: Vec<_> = machine
        .user
        .groups
        .iter()
        .map(|gid| machine.name("group", *gid))
        .collect();
    groups.sort();
    groups.dedup();
    let found = format!(
        "{place}: {e}: it belongs to {}:{group}, mode {mode:04o}; {user} is in {}",
        machine.name("passwd", file.uid()),
        groups.join(", ")
    );
    let (then, fix) = if group == "root" || mode & 0o060 != 0o060 {
        ("", install_rules())
    } else if member(machine, &group, &user) && !machine.user.groups.contains(&file.gid()) {
        // `/etc/group` lists the user in the group, but the user has logged in before being added.
        (
            "; the group takes effect at the next login, or at once in a new shell:",
            format!("newgrp {group}"),
        )
    } else {
        (
            "; join the group and log in again",
            format!("sudo usermod -aG {group} {user}"),
        )
    };
    Some(check(format!("{found}{then}")).but(Status::Missing, fix))
}

/// Whether `/etc/group` lists a user in a group.
fn member(machine: &Machine, group: &str, user: &str) -> bool {
    let mut entries = machine.entries("group").into_iter();
    let members = entries.find(|(name, ..)| name == group);
    members.is_some_and(|(.., list)| list.split(',').any(|name| name == user))
}

/// Checks the stable names of the nodes, which are links under `/dev/phasmid`.
fn names(machine: &Machine, ours: &[&Node]) -> Check {
    let links: Vec<_> = machine
        .list("dev/phasmid")
        .into_iter()
        .filter_map(|link| {
            let target = std::fs::canonicalize(&link).ok()?;
            Some((machine.shown(&link), target))
        })
        .collect();
    let mut found = Vec::new();
    let mut without = Vec::new();
    for node in ours {
        let path = std::fs::canonicalize(&node.path).unwrap_or_else(|_| node.path.clone());
        match links.iter().find(|(_, target)| *target == path) {
            Some((link, _)) => found.push(format!("{link} is /dev/video{}", node.number)),
            None => without.push(format!("/dev/video{}", node.number)),
        }
    }
    if without.is_empty() {
        return Check::ok("stable names", Feature::V4l2, found.join(", "));
    }
    let verb = match without.len() {
        1 => "has",
        _ => "have",
    };
    found.push(format!(
        "{} {verb} no link under /dev/phasmid",
        without.join(", ")
    ));
    Check::ok("stable names", Feature::V4l2, found.join("; ")).but(Status::Note, install_rules())
}

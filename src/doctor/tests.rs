//! Tests with imitated machines, each a tree of files.

use super::*;
use std::fs;
use std::io;
use std::os::unix::fs::{MetadataExt, PermissionsExt, symlink};
use std::path::Path;
use tempfile::TempDir;

const RELEASE: &str = "6.1.0-test";

/// Checks access by the file's mode bits alone, as for a user who is not root.
fn by_mode(path: &Path, user: &User) -> io::Result<()> {
    let file = fs::metadata(path)?;
    let shift = if file.uid() == user.uid {
        6
    } else if user.groups.contains(&file.gid()) {
        3
    } else {
        0
    };
    if file.mode() >> shift & 0o6 == 0o6 {
        Ok(())
    } else {
        Err(io::ErrorKind::PermissionDenied.into())
    }
}

struct Fake {
    tree: TempDir,
    machine: Machine,
}

impl Fake {
    /// A Debian machine with a pty and nothing else.
    fn bare() -> Self {
        let tree = tempfile::tempdir().unwrap();
        let file = fs::metadata(tree.path()).unwrap();
        let machine = Machine {
            root: tree.path().to_owned(),
            release: RELEASE.into(),
            user: User {
                uid: file.uid(),
                groups: vec![file.gid()],
            },
            container_env: false,
            run_parent: tree.path().join("tmp"),
            access: by_mode,
            forgotten: |_| false,
        };
        let fake = Self { tree, machine };
        fake.file("dev/ptmx", "");
        fake.file("proc/mounts", "devpts /dev/pts devpts rw 0 0\n");
        fake.file("usr/bin/apt-get", "");
        fake.file("run/udev/control", "");
        fake.file(
            &format!("lib/modules/{RELEASE}/modules.dep"),
            "kernel/video.ko:\n",
        );
        fs::create_dir(fake.path("tmp")).unwrap();
        fake
    }

    /// A machine that has everything that Phasmid can use.
    fn good() -> Self {
        let fake = Self::bare();
        fake.loaded("Y,N", 32);
        fake.node(10, "Phasmid 1", "32");
        for shipped in [UDEV, MODPROBE, MODULES_LOAD] {
            fake.file(&shipped.path[1..], shipped.text);
        }
        fs::create_dir(fake.path("dev/phasmid")).unwrap();
        symlink("../video10", fake.path("dev/phasmid/1")).unwrap();
        fake
    }

    fn path(&self, path: &str) -> std::path::PathBuf {
        self.tree.path().join(path)
    }

    fn file(&self, path: &str, text: &str) {
        let path = self.path(path);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }

    fn loaded(&self, exclusive_caps: &str, max_buffers: u32) {
        let module = "sys/module/v4l2loopback";
        self.file(&format!("{module}/version"), "0.12.7\n");
        let parameters = format!("{module}/parameters");
        self.file(
            &format!("{parameters}/exclusive_caps"),
            &format!("{exclusive_caps}\n"),
        );
        self.file(&format!("{parameters}/video_nr"), "10,-1\n");
        self.file(
            &format!("{parameters}/max_buffers"),
            &format!("{max_buffers}\n"),
        );
    }

    fn node(&self, number: u32, label: &str, buffers: &str) {
        let node = format!("sys/class/video4linux/video{number}");
        self.file(&format!("{node}/name"), &format!("{label}\n"));
        self.file(&format!("{node}/format"), "");
        self.file(&format!("{node}/buffers"), &format!("{buffers}\n"));
        self.file(&format!("{node}/max_openers"), "10\n");
        let device = format!("dev/video{number}");
        self.file(&device, "");
        self.mode(&device, 0o660);
    }

    fn mode(&self, path: &str, mode: u32) {
        fs::set_permissions(self.path(path), fs::Permissions::from_mode(mode)).unwrap();
    }

    fn report(&self) -> Report {
        examine(&self.machine)
    }

    /// Returns the only check of a topic.
    fn check(&self, topic: &str) -> Check {
        let checks = self.report().checks;
        let mut its = checks.into_iter().filter(|check| check.topic == topic);
        let check = its.next().unwrap_or_else(|| panic!("no {topic}"));
        assert_eq!(its.next(), None);
        check
    }
}

fn fix(check: &Check) -> &str {
    check.fix.as_deref().unwrap_or_default()
}

#[test]
fn bare_machine_suffices_for_the_embedded_device() {
    let fake = Fake::bare();
    let report = fake.report();
    assert!(report.suffices(&[]));
    assert!(!report.suffices(&[Feature::V4l2]));
    assert!(!report.suffices(&[Feature::Vulkan]));
    let check = fake.check("v4l2loopback");
    assert_eq!(check.status, Status::Missing);
    assert_eq!(
        fix(&check),
        "sudo apt-get install v4l2loopback-dkms linux-headers-6.1.0-test"
    );
    let text = report.to_string();
    assert!(text.contains("pty and frame socket: works"), "{text}");
    assert!(text.contains("V4L2 camera: off"), "{text}");
    // Every problem has a command that fixes it.
    for check in &report.checks {
        assert_eq!(check.fix.is_some(), check.status != Status::Ok, "{check:?}");
    }
}

#[test]
fn installed_module_only_needs_loading() {
    let fake = Fake::bare();
    fake.file(
        &format!("lib/modules/{RELEASE}/modules.dep"),
        "kernel/a.ko:\nupdates/dkms/v4l2loopback.ko.xz: kernel/a.ko\n",
    );
    assert_eq!(
        fix(&fake.check("v4l2loopback")),
        "sudo modprobe v4l2loopback"
    );
}

#[test]
fn missing_pty_or_run_directory_fails_the_check() {
    let fake = Fake::bare();
    fs::remove_file(fake.path("dev/ptmx")).unwrap();
    assert_eq!(fake.check("pty").status, Status::Missing);
    assert!(!fake.report().suffices(&[]));
    let fake = Fake::bare();
    fake.file("proc/mounts", "proc /proc proc rw 0 0\n");
    assert!(fix(&fake.check("pty")).contains("mount -t devpts"));
    let fake = Fake::bare();
    fake.mode("tmp", 0o500);
    assert_eq!(fake.check("run directory").status, Status::Missing);
}

#[test]
fn complete_machine_passes_all_checks() {
    let fake = Fake::good();
    fake.node(2, "Other", "2");
    let report = fake.report();
    assert!(report.suffices(&[Feature::V4l2]));
    for check in &report.checks {
        let expected = match check.feature {
            Feature::Vulkan => Status::Missing,
            _ => Status::Ok,
        };
        if check.feature != Feature::Usb {
            assert_eq!(check.status, expected, "{check:?}");
        }
    }
    assert!(fake.check("camera").found.contains("free"));
    assert!(fake.check("v4l2loopback").found.contains("0.12.7"));
    assert_eq!(
        fake.check("stable names").found,
        "/dev/phasmid/1 is /dev/video10"
    );
    assert!(fake.check("other node").found.contains("\"Other\""));
    // In release 0.12 the module has no file that states its version.
    fs::remove_file(fake.path("sys/module/v4l2loopback/version")).unwrap();
    assert!(fake.check("v4l2loopback").found.contains("unknown"));
    fake.file("var/lib/dkms/v4l2loopback/0.12.8/source", "");
    fake.file("var/lib/dkms/v4l2loopback/kernel-6.1.0", "");
    assert!(
        fake.check("v4l2loopback")
            .found
            .starts_with("0.12.8 is loaded")
    );
    fake.file("sys/class/video4linux/video10/format", "GREY:640x480@30\n");
    assert!(
        fake.check("camera")
            .found
            .contains("streams GREY:640x480@30")
    );
    let json = report.to_json();
    let features = json["features"].as_object().unwrap();
    assert_eq!(features.len(), Feature::ALL.len());
    assert_eq!(features["v4l2"], true);
    assert_eq!(json["checks"][0]["status"], "ok");
}

#[test]
fn bad_module_options_are_reported_with_their_effect() {
    let fake = Fake::good();
    fake.loaded("N,Y", 2);
    fake.node(10, "Phasmid 1", "2");
    let module = fake.check("v4l2loopback");
    assert_eq!(module.status, Status::Note);
    assert!(
        module
            .found
            .contains("max_buffers=2: a frame that is being read is overwritten 2 frames later")
    );
    assert!(fix(&module).contains("--print modprobe"));
    let camera = fake.check("camera");
    assert_eq!(camera.status, Status::Note);
    assert!(camera.found.contains("exclusive_caps=0"), "{camera:?}");
    // The camera works although these options are not the recommended ones.
    assert!(fake.report().suffices(&[Feature::V4l2]));
}

#[test]
fn foreign_video_nodes_are_no_camera() {
    let fake = Fake::bare();
    fake.loaded("Y,Y", 32);
    fake.node(10, "OBS Virtual Camera", "32");
    let camera = fake.check("camera");
    assert_eq!(camera.status, Status::Missing);
    assert!(fix(&camera).contains("modprobe.d"));
    // A webcam with this label is not a loopback node.
    fake.file("sys/class/video4linux/video3/name", "Phasmid\n");
    assert_eq!(fake.check("camera").status, Status::Missing);
}

#[test]
fn reduced_buffer_count_is_fixed_by_reloading_the_module() {
    let fake = Fake::good();
    fake.node(10, "Phasmid 1", "4");
    let camera = fake.check("camera");
    assert_eq!(camera.status, Status::Note);
    assert!(camera.found.contains("4 of 32 buffers"), "{camera:?}");
    assert_eq!(
        fix(&camera),
        "sudo modprobe -r v4l2loopback && sudo modprobe v4l2loopback"
    );
}

#[test]
fn a_node_without_sides_is_not_free() {
    let mut fake = Fake::good();
    fake.machine.forgotten = |path| path.ends_with("video10");
    let camera = fake.check("camera");
    assert_eq!(camera.status, Status::Missing);
    assert!(
        camera
            .found
            .contains("neither a capture nor an output side"),
        "{camera:?}"
    );
    assert!(!camera.found.contains("free"), "{camera:?}");
    assert!(fix(&camera).starts_with("sudo modprobe -r"), "{camera:?}");
    assert!(!fake.report().suffices(&[Feature::V4l2]));
    // One usable node besides an unusable one is enough.
    fake.node(11, "Phasmid 2", "32");
    let report = fake.report();
    assert!(report.suffices(&[Feature::V4l2]));
    let first = report.checks.iter().find(|check| check.topic == "camera");
    assert_eq!(first.map(|check| check.status), Some(Status::Note));
    // Nodes with other labels are not opened.
    fake.node(10, "Other", "32");
    fake.machine.forgotten = |path| {
        assert!(!path.ends_with("video10"));
        false
    };
    assert!(fake.check("camera").found.contains("free"));
}

#[test]
fn a_user_outside_the_group_is_told_to_join_it() {
    let mut fake = Fake::good();
    let gid = fs::metadata(fake.path("dev/video10")).unwrap().gid();
    fake.file("etc/group", &format!("video:x:{gid}:ann\nusers:x:77:\n"));
    fake.file(
        "etc/passwd",
        "bob:x:70001:77::/home/bob:/bin/sh\nann:x:70002:77::/:/bin/sh\n",
    );
    fake.mode("tmp", 0o777);
    fake.machine.user = User {
        uid: 70001,
        groups: vec![77],
    };
    let check = fake.check("permission");
    assert_eq!(check.status, Status::Missing);
    assert!(
        check.found.contains(":video, mode 0660; bob is in users"),
        "{check:?}"
    );
    assert!(check.found.ends_with("join the group and log in again"));
    assert_eq!(fix(&check), "sudo usermod -aG video bob");
    assert!(!fake.report().suffices(&[Feature::V4l2]));
    // The user with number 70002, Ann, joined the group after she logged in.
    fake.machine.user.uid = 70002;
    assert_eq!(fix(&fake.check("permission")), "newgrp video");
    // Only the owner has access, so joining the group would not help.
    fake.mode("dev/video10", 0o600);
    assert!(fix(&fake.check("permission")).contains("60-phasmid.rules"));
}

#[test]
fn in_a_container_the_host_is_to_load_the_module() {
    let mut fake = Fake::bare();
    fake.file(".dockerenv", "");
    let check = fake.check("v4l2loopback");
    assert!(check.found.contains("on the host"), "{check:?}");
    assert_eq!(fix(&check), "sudo modprobe v4l2loopback");
    let report = fake.report();
    assert!(report.to_string().contains("looks like a container"));
    assert!(
        report
            .checks
            .iter()
            .all(|check| check.topic != "udev rules")
    );
    fs::remove_file(fake.path(".dockerenv")).unwrap();
    assert!(!fake.report().container);
    fake.machine.container_env = true;
    assert!(fake.report().container);
    // In a container, the host's nodes appear in /sys but not in /dev.
    fake.loaded("Y", 32);
    fake.node(10, "Phasmid", "32");
    fs::remove_file(fake.path("dev/video10")).unwrap();
    let check = fake.check("permission");
    assert!(check.found.contains("--device /dev/video10"), "{check:?}");
    assert_eq!(check.fix, None);
}

#[test]
fn installed_files_are_compared() {
    let fake = Fake::good();
    fake.file(&UDEV.path[1..], "# older\n");
    fake.file(&MODPROBE.path[1..], "options v4l2loopback devices=1\n");
    for topic in ["udev rules", "module options"] {
        let check = fake.check(topic);
        assert_eq!(check.status, Status::Note);
        assert!(
            check.found.contains("differs from this version's file"),
            "{check:?}"
        );
    }
    fs::remove_file(fake.path(&MODPROBE.path[1..])).unwrap();
    fake.file(
        "etc/modprobe.d/mine.conf",
        "options  v4l2loopback devices=1\n",
    );
    let check = fake.check("module options");
    assert_eq!(check.status, Status::Ok);
    assert!(
        check.found.contains("/etc/modprobe.d/mine.conf"),
        "{check:?}"
    );
    fs::remove_dir_all(fake.path("dev/phasmid")).unwrap();
    fake.node(11, "Phasmid 2", "32");
    let names = fake.check("stable names");
    assert!(fix(&names).contains("udevadm trigger"));
    assert_eq!(
        names.found,
        "/dev/video10, /dev/video11 have no link under /dev/phasmid"
    );
}

#[test]
fn vulkan_needs_loader_and_driver() {
    let fake = Fake::bare();
    let lib = "usr/lib/x86_64-linux-gnu";
    fake.file(&format!("{lib}/libvulkan.so.1"), "");
    assert!(!fake.report().works(Feature::Vulkan));
    let icd = r#"{"ICD": {"library_path": "libvulkan_test.so"}}"#;
    fake.file("usr/share/vulkan/icd.d/test.json", icd);
    fake.file("usr/share/vulkan/icd.d/broken.json", "{");
    assert!(!fake.report().works(Feature::Vulkan));
    fake.file(&format!("{lib}/libvulkan_test.so"), "");
    assert!(fake.report().works(Feature::Vulkan));
}

#[test]
fn a_label_cannot_steer_a_terminal() {
    let fake = Fake::good();
    fake.node(10, "Phasmid \u{1b}[2J", "32");
    fake.node(11, "\u{e9}\u{9b}", "x");
    let text = fake.report().to_string();
    assert!(
        !text.chars().any(|c| c.is_control() && c != '\n'),
        "{text:?}"
    );
}

#[test]
fn the_virtual_host_controller_is_known() {
    let fake = Fake::good();
    assert_eq!(fake.check("vhci_hcd").status, Status::Missing);
    assert_eq!(
        fake.check("vhci_hcd").fix.as_deref(),
        Some("sudo modprobe vhci-hcd")
    );
    assert!(!fake.report().suffices(&[Feature::Usb]));
    assert_eq!(fake.check("uvcvideo").status, Status::Note);
    fake.file("sys/devices/platform/vhci_hcd.0/status", "");
    let modules = "kernel/uvcvideo.ko.xz:\nkernel/cdc-acm.ko:\n";
    fake.file(&format!("lib/modules/{RELEASE}/modules.dep"), modules);
    assert_eq!(fake.check("vhci_hcd").status, Status::Ok);
    assert_eq!(fake.check("uvcvideo").status, Status::Ok);
    assert_eq!(fake.check("cdc_acm").status, Status::Ok);
    assert!(fake.report().suffices(&[Feature::Usb]));
}

"""The files of udev/: names, group and mode of nodes, and the module's options."""

import grp
import pathlib
import shutil
import subprocess

from lab import loopback, udev
from lab.failure import expect
from lab.guest import REPO, wait_until

NODES = [(10, "Phasmid 1"), (11, "phasmid  left arm"), (12, "Other"), (13, "Phasmid"), (14, "Phasmid ../a/b")]
NAMES = {"1": "/dev/video10", "left-arm": "/dev/video11", "13": "/dev/video13", "-a-b": "/dev/video14"}


def owner(path):
    stat = pathlib.Path(path).stat()
    return grp.getgrgid(stat.st_gid).gr_name, oct(stat.st_mode & 0o777)


def test_nodes_have_names_group_and_mode(scratch):
    with udev.running(scratch):
        loopback.load(NODES)
        wait_until(f"names {NAMES}", lambda: udev.links() == NAMES)
        for node in NAMES.values():
            wait_until(f"group and mode of {node}", lambda: owner(node) == ("video", "0o660"))
        loopback.unload()
        wait_until("names that go with their nodes", lambda: udev.links() == {})


def test_rules_apply_to_nodes_that_are_there(scratch):
    loopback.load(NODES)
    with udev.running(scratch):
        expect("names", udev.links(), {})
        scratch.run("udevadm", "trigger", "--subsystem-match=video4linux", "--action=change").ok()
        wait_until(f"names {NAMES}", lambda: udev.links() == NAMES)


def test_modprobe_takes_our_options(scratch):
    loopback.unload()
    release = subprocess.run(["uname", "-r"], capture_output=True, text=True, check=True).stdout.strip()
    folder = scratch.dir / "root/lib/modules" / release
    folder.mkdir(parents=True)
    shutil.copy(loopback.MODULE, folder)
    scratch.run("depmod", "-b", scratch.dir / "root", release).ok()
    config = scratch.dir / "modprobe.d"
    config.mkdir()
    shutil.copy(REPO / "udev/v4l2loopback-phasmid.conf", config)
    # Loads the module that the modules-load.d file names, as systemd does at boot.
    lines = (REPO / "udev/phasmid-modules.conf").read_text().splitlines()
    (module,) = [line for line in lines if line and not line.startswith("#")]
    scratch.run("modprobe", "-d", scratch.dir / "root", "-C", config, module).ok()
    nodes = pathlib.Path("/sys/class/video4linux")
    for number in (10, 11):
        expect("label", (nodes / f"video{number}/name").read_text(), f"Phasmid {number - 9}\n")
        expect("buffers", (nodes / f"video{number}/buffers").read_text(), "32\n")
    parameters = pathlib.Path("/sys/module/v4l2loopback/parameters")
    expect("exclusive_caps", (parameters / "exclusive_caps").read_text()[:4], "Y,Y,")

"""The system's udev in the guest, with the rules that we ship."""

import contextlib
import os
import pathlib
import shutil

from .guest import REPO, wait_until

UDEVD = "/lib/systemd/systemd-udevd"
RULES = REPO / "udev/60-phasmid.rules"
# The tests run in a chroot, in which udevadm does nothing without this variable.
ENVIRONMENT = {"SYSTEMD_IGNORE_CHROOT": "1"}


@contextlib.contextmanager
def running(scratch):
    """Runs udev for a test, and removes its names after it."""
    folder = pathlib.Path("/run/udev/rules.d")
    folder.mkdir(parents=True, exist_ok=True)
    shutil.copy(RULES, folder)
    os.environ.update(ENVIRONMENT)
    daemon = scratch.start(UDEVD)
    wait_until("udev", pathlib.Path("/run/udev/control").exists)
    try:
        yield
    finally:
        daemon.end()
        shutil.rmtree("/run/udev", ignore_errors=True)
        shutil.rmtree("/dev/phasmid", ignore_errors=True)


def links():
    """Targets of the names under /dev/phasmid."""
    folder = pathlib.Path("/dev/phasmid")
    return {link.name: str(link.resolve()) for link in folder.iterdir()} if folder.exists() else {}

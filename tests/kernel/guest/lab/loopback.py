"""v4l2loopback, loaded anew for each test: frames, formats and rings of other tests outlive their
users in it."""

import pathlib
import subprocess

from .failure import Failure

MODULE = "/mnt/modules/v4l2loopback.ko"
PHASMID, SECOND, OTHER = "/dev/video10", "/dev/video11", "/dev/video12"
# Numbers and labels of the nodes.
NODES = [(10, "Phasmid one"), (11, "Phasmid two"), (12, "Other")]


def load(nodes=None, exclusive_caps=1, max_buffers=32):
    """Loads the module with these nodes, as the modprobe.d file that we ship does."""
    unload()
    nodes = nodes or NODES
    # The labels contain spaces, so the whole value is quoted, as the kernel allows.
    labels = ",".join(label for _, label in nodes)
    done = insmod(
        MODULE,
        f"devices={len(nodes)}",
        "video_nr=" + ",".join(str(number) for number, _ in nodes),
        f'card_label="{labels}"',
        "exclusive_caps=" + ",".join(str(exclusive_caps) for _ in nodes),
        f"max_buffers={max_buffers}",
    )
    if done.returncode != 0:
        raise Failure(f"v4l2loopback cannot be loaded: {done.stderr.strip()}")


def loaded():
    return pathlib.Path("/sys/module/v4l2loopback").exists()


def unload():
    if loaded():
        done = rmmod()
        if done.returncode != 0:
            raise Failure(f"a test has left v4l2loopback in use: {done.stderr.strip()}")


def rmmod():
    return subprocess.run(["rmmod", "v4l2loopback"], capture_output=True, text=True)


def insmod_all(order, options):
    """Loads what a list of module files names and is not there yet; options by module."""
    for file in pathlib.Path(order).read_text().split():
        name = file.removesuffix(".ko").replace("-", "_")
        if not pathlib.Path(f"/sys/module/{name}").exists():
            done = insmod(f"/mnt/modules/{file}", *options.get(name, []))
            if done.returncode != 0:
                raise Failure(f"{file} cannot be loaded: {done.stderr.strip()}")


def insmod(*arguments):
    return subprocess.run(["insmod", *arguments], capture_output=True, text=True)

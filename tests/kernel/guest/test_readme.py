"""The commands of the book that need a kernel: the blocks marked `sh kernel` of its page."""

from lab import loopback, udev
from lab.failure import expect_true, limit, whole
from lab.guest import PHASMID, REPO, wait_until

PRELUDE = f"set -eu\nPATH={PHASMID.parent}:$PATH\ntrap 'kill $(jobs -p) 2> /dev/null; wait' EXIT\n"


@whole
@limit(400)
def test_every_command_runs(scratch):
    text = (REPO / "docs/src/guides/kernel-camera.md").read_text()
    blocks = [rest.split("```")[0] for rest in text.split("```sh kernel\n")[1:]]
    expect_true("the page has no block for a kernel", blocks)
    with udev.running(scratch):
        loopback.load([(10, "Phasmid 1"), (11, "Phasmid 2")])
        wait_until("a name", lambda: "1" in udev.links())
        scratch.run("bash", "-c", PRELUDE + "\n".join(blocks), seconds=380).ok()
    for file in ("viewed.png", "shot.png", "kernel-scan/cloud.ply"):
        expect_true(f"no {file}", (scratch.dir / file).is_file())

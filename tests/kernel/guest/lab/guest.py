"""A test's place in the guest: its folder, its processes, its time, and the kernel's health."""

import contextlib
import os
import pathlib
import shutil
import signal
import subprocess
import tempfile
import time

from .failure import Failure

REPO = pathlib.Path("/mnt/repo")
LANE = REPO / "tests/kernel"
OUT = pathlib.Path("/mnt/out")
PHASMID = REPO / "target/release/phasmid"
# Bits of /proc/sys/kernel/tainted: 7 after an oops, 9 after a kernel warning.
BROKEN = 1 << 7 | 1 << 9


def kernel_state():
    return int(pathlib.Path("/proc/sys/kernel/tainted").read_text()) & BROKEN


@contextlib.contextmanager
def time_limit(seconds):
    def late(_signal, _frame):
        raise Failure(f"not done within {seconds} s")

    signal.signal(signal.SIGALRM, late)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)


def wait_until(what, condition, seconds=20):
    """Polls until the condition gives something true, and returns that."""
    end = time.monotonic() + seconds
    while True:
        found = condition()
        if found:
            return found
        if time.monotonic() > end:
            raise Failure(f"{what}: not within {seconds} s")
        time.sleep(0.05)


class Done:
    """A program that has ended."""

    def __init__(self, command, status, out, err):
        self.command, self.status, self.out, self.err = command, status, out, err

    def ok(self):
        """Itself, where the status is 0."""
        return self.with_status(0)

    def with_status(self, status):
        if self.status != status:
            said = (self.err or self.out).strip()[-600:]
            raise Failure(f"{self.command}: status {self.status}, wanted {status}; it says: {said}")
        return self


class Job:
    """A program that runs beside the test, in a session of its own."""

    def __init__(self, scratch, name, command, user=None):
        self.command = " ".join(map(str, command))
        self.paths = [scratch.out / f"{name}.{kind}" for kind in ("out", "err")]
        with open(self.paths[0], "wb") as out, open(self.paths[1], "wb") as err:
            self.process = subprocess.Popen(
                list(map(str, command)),
                stdin=subprocess.DEVNULL, stdout=out, stderr=err,
                cwd=scratch.dir, start_new_session=True,
                user=user, group=user, extra_groups=[] if user else None,
            )

    def said(self):
        """Standard output and standard error so far."""
        return [path.read_text(errors="replace") for path in self.paths]

    def running(self):
        return self.process.poll() is None

    def has_open(self, path):
        """Whether the program has this file open."""
        for entry in pathlib.Path(f"/proc/{self.process.pid}/fd").iterdir():
            with contextlib.suppress(OSError):
                if os.readlink(entry) == path:
                    return True
        return False

    def send(self, number):
        """Signals the program and what it has started."""
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.process.pid, number)

    def wait(self, seconds=60):
        try:
            status = self.process.wait(seconds)
        except subprocess.TimeoutExpired:
            out, err = self.said()
            said = (err or out).strip()[-600:]
            raise Failure(f"{self.command}: still running after {seconds} s; it says: {said}")
        return Done(self.command, status, *self.said())

    def end(self):
        if self.running():
            self.send(signal.SIGKILL)
            self.process.wait()


class Scratch:
    """A folder in memory for a test (`dir`), one for its logs that outlives the guest (`out`), and
    the programs that it starts."""

    def __init__(self, name):
        # A short path, because the length of socket paths is limited.
        self.dir = pathlib.Path(tempfile.mkdtemp(dir="/tmp"))
        self.out = OUT / name
        self.jobs = []
        self.held = []
        self.count = 0

    def __enter__(self):
        self.dir.chmod(0o777)
        self.out.mkdir()
        return self

    def __exit__(self, *_):
        shutil.rmtree(self.dir, ignore_errors=True)

    def log(self, name):
        return open(self.out / name, "w", encoding="utf-8")

    def start(self, *command, name=None, user=None):
        self.count += 1
        name = name or f"{self.count:02}-{pathlib.Path(command[0]).name}"
        job = Job(self, name, command, user)
        self.jobs.append(job)
        return job

    def run(self, *command, seconds=60, user=None):
        """Runs a program to its end."""
        return self.start(*command, user=user).wait(seconds)

    def phasmid(self, *arguments, **options):
        return self.run(PHASMID, *arguments, **options)

    def hold(self, descriptor):
        """Has a descriptor closed when the test is over; returns it."""
        self.held.append(descriptor)
        return descriptor

    def let_go(self, descriptor):
        self.held.remove(descriptor)
        os.close(descriptor)

    def end(self):
        """Ends what still runs; what went wrong unseen, or None."""
        for descriptor in self.held:
            os.close(descriptor)
        for job in reversed(self.jobs):
            job.end()
        for job in self.jobs:
            if "panicked at" in job.said()[1]:
                return f"{job.command} panicked: {job.said()[1].strip()[-600:]}"
        return None

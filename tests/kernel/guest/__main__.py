"""Runs the tests of the kernel lane, in the guest: every function `test_*` of the files `test_*.py`.

One line a test, `ok TOPIC.NAME (s)` or `FAILED TOPIC.NAME: reason`; exits 0 when all passed. Each
test has a time limit, and what the kernel logs while it runs fails it too where it is a complaint.
"""

import importlib
import pathlib
import sys
import time
import traceback

from lab import guest
from lab.failure import Failure
from lab.kernel_log import KernelLog

FILTERS = pathlib.Path("/mnt/out/filters")
# Holds the name of the running test, so that the host can report it if the guest breaks off.
RUNNING = pathlib.Path("/mnt/out/running")
# Tests that unregister nodes run last: the module cannot be reloaded afterwards.
LAST = ["test_unplug"]


def tests():
    folder = pathlib.Path(__file__).parent
    names = sorted(path.stem for path in folder.glob("test_*.py"))
    names.sort(key=lambda name: name in LAST)
    for name in names:
        module = importlib.import_module(name)
        for key, function in list(vars(module).items()):
            if key.startswith("test_") and callable(function):
                yield f"{name[5:]}.{key[5:]}", function


def run(name, function):
    """Runs one test; the reason of its failure, or None."""
    reason = None
    with guest.Scratch(name) as scratch:
        broken = guest.kernel_state()
        log = KernelLog()
        try:
            with guest.time_limit(getattr(function, "limit_s", 90)):
                function(scratch)
        except Failure as failure:
            reason = str(failure)
        except Exception as error:  # a test that breaks must not end the others
            traceback.print_exc(file=scratch.log("traceback"))
            reason = f"{type(error).__name__}: {error}"
        left = scratch.end()
        reason = reason or left
        with scratch.log("kernel.log") as keep:
            complaints = log.complaints(keep)
        log.close()
        if complaints:
            reason = f"the kernel logs {complaints[:5]} ({reason or 'the test passed'})"
        if guest.kernel_state() != broken:
            reason = f"the kernel complains, see console.log ({reason or 'the test passed'})"
    return reason


def main():
    if sys.argv[1:] == ["--list"]:
        print("\n".join(name for name, _ in tests()))
        return 0
    # Parts of test names. "*" selects all tests; an empty list selects all tests not marked
    # `whole`.
    wanted = FILTERS.read_text().split()
    failed = 0
    print("begins")
    for name, function in tests():
        whole = getattr(function, "whole", False)
        if not any(part in name or part == "*" for part in wanted) if wanted else whole:
            continue
        RUNNING.write_text(name)
        start = time.monotonic()
        reason = run(name, function)
        seconds = time.monotonic() - start
        if reason is None:
            print(f"ok {name} ({seconds:.1f} s)")
        else:
            failed += 1
            print(f"FAILED {name}: " + "\n  ".join(reason.strip().splitlines()))
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())

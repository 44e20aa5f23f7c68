"""The command ``phasmid``."""

import signal
import sys

from . import _phasmid


def main() -> None:
    """Run the command with the arguments of the process and exit with its status."""
    # Python's handler would wait for the command to end. A signal that the process was started to ignore
    # stays ignored.
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    sys.exit(_phasmid.run(["phasmid", *sys.argv[1:]], _phasmid.__file__))


if __name__ == "__main__":
    main()

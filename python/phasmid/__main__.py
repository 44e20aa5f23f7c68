"""``python -m phasmid`` is the command ``phasmid``."""

from ._main import main

main()

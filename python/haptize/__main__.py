"""The command line of haptize: `haptize` or `python -m haptize`."""

import os
import signal
import sys

from . import _haptize


def main() -> None:
    """Run what the command line asks for, and exit with its code."""
    # Ctrl-C ends the program, or is taken by the command that can keep its work: Python would wait for its own turn.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    # Mesa's device-select layer reorders adapters, which haptize ranks itself.
    os.environ["NODEVICE_SELECT"] = "1"
    sys.exit(_haptize.main(["haptize", *sys.argv[1:]]))


if __name__ == "__main__":
    main()

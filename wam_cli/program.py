"""The program `wam`: Ctrl-C ends it silently from its first import on."""

import os
import sys
from pathlib import Path

from wam_ros.process_signals import end_at_once_on_signals


def main() -> None:
    """Run the command line as this process; a stream that its caller has closed is the null device."""
    while os.open(os.devnull, os.O_RDWR) < 3:  # else the next file would have its number, and get its text
        pass
    sys.stdout, sys.stderr = sys.stdout or os.fdopen(1, "w"), sys.stderr or os.fdopen(2, "w")
    end_at_once_on_signals()
    from wam_cli.main import program  # imports argparse and more: an interrupted import would print a traceback

    program()


def node() -> None:
    """Run `wam node` for the node that has the name of this program; that named 'node' takes it as an argument."""
    name = Path(sys.argv[0]).name
    sys.argv[1:1] = ["node"] if name == "node" else ["node", name]
    main()


if __name__ == "__main__":
    main()

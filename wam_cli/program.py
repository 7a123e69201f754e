"""The program `wam`: Ctrl-C ends it silently from its first import on."""

import sys
from pathlib import Path

from wam_ros.process_signals import end_at_once_on_signals


def main() -> None:
    """Run the command line as this process."""
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

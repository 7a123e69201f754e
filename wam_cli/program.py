"""The program `wam`: Ctrl-C ends it silently from its first import on."""

from wam_ros.process_signals import end_at_once_on_signals


def main() -> None:
    """Run the command line as this process."""
    end_at_once_on_signals()
    from wam_cli.main import program  # imports argparse and more: an interrupted import would print a traceback

    program()


if __name__ == "__main__":
    main()

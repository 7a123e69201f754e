"""The program of a node: `python3 -m wam_ros.program NAME`; it ends quietly where its imports are interrupted."""

from wam_description.nodes import installation
from wam_ros.process_signals import end_at_once_on_signals, ignore_signals


def main() -> None:
    """Run the nodes that the name of this program, or its first arguments, name."""
    end_at_once_on_signals()
    try:
        from wam_ros.node import main as run_node

        run_node()
    except ModuleNotFoundError as error:
        raise SystemExit(
            f"error: the Python package '{error.name}' is missing; {installation(error.name or '')}, or put its folder "
            "on PYTHONPATH: see docs/tutorial.md"
        ) from None
    finally:
        ignore_signals()


if __name__ == "__main__":
    main()

"""`wam follow`: the action FollowJointTrajectory of a stack that runs, for MoveIt and other planners."""

import argparse

from wam_cli.commands import namespace
from wam_ros.program import Stop, end_at_once_on_signals
from wam_ros.run import NAMESPACE, die_with_parent


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument("--namespace", type=namespace, default=NAMESPACE, help="of the stack; default: %(default)s")
    parser.epilog = "Needs control_msgs, of a ROS installation: apt install ros-jazzy-control-msgs."


def run(given: argparse.Namespace) -> int:
    """Serve the action until Ctrl-C."""
    end_at_once_on_signals()
    die_with_parent()
    try:
        from wam_cli.trajectory_action import serve
    except ModuleNotFoundError as error:
        if error.name != "control_msgs":
            raise
        raise ValueError("it needs control_msgs, of a ROS installation: apt install ros-jazzy-control-msgs") from None
    stop = Stop()
    serve(given.namespace, lambda: stop.is_set, lambda line: print(line, flush=True))
    return 0

"""`wam follow`: the action FollowJointTrajectory of a stack that runs, for MoveIt and other planners."""

import argparse

from wam_cli.commands import namespace, of_installation
from wam_ros.process_signals import Stop, end_at_once_on_signals
from wam_ros.run import die_with_parent
from wam_ros.topics import NAMESPACE


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument("--namespace", type=namespace, default=NAMESPACE, help="of the stack; default: %(default)s")
    parser.epilog = "Needs control_msgs, of a ROS installation: apt install ros-jazzy-control-msgs."


def run(given: argparse.Namespace) -> int:
    """Serve the action until Ctrl-C."""
    end_at_once_on_signals()
    die_with_parent()
    with of_installation("control_msgs"):
        from wam_live.trajectory_action import serve
    stop = Stop()
    serve(given.namespace, lambda: stop.is_set, lambda line: print(line, flush=True))
    return 0

"""`wam tf`: /tf and /tf_static of a stack that runs."""

import argparse

from wam_cli.commands import namespace, of_installation
from wam_ros.process_signals import Stop, end_at_once_on_signals
from wam_ros.run import die_with_parent
from wam_ros.topics import NAMESPACE


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument("--namespace", type=namespace, default=NAMESPACE, help="of the stack; default: %(default)s")
    parser.add_argument("--frame-prefix", default="", help="put before every frame, for example left/")
    parser.epilog = (
        "Needs tf2_msgs, of a ROS installation: apt install ros-jazzy-tf2-msgs. In another namespace than "
        f"{NAMESPACE} and without a prefix, the topics are tf and tf_static in that namespace."
    )


def run(given: argparse.Namespace) -> int:
    """Publish until Ctrl-C."""
    end_at_once_on_signals()
    die_with_parent()
    with of_installation("tf2_msgs"):
        from wam_live.frame_publisher import FramesNode
    from wam_live.stack_client import run_next_to

    stop = Stop()
    run_next_to(
        given.namespace,
        lambda context, shared: FramesNode(context, given.namespace, shared, given.frame_prefix),
        lambda: stop.is_set,
    )
    return 0

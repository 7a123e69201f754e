"""Start every node of one configuration, in one process or in several, with transforms and RViz.

    ros2 launch wam_stack wam.launch.py config:=wam namespace:=wam rviz:=true scenario:=demo_scenario bag:=bags/first

`ros2 launch wam_stack wam.launch.py --show-args` describes the arguments; wam.launch.xml takes the same.  All nodes end
with the launch, however it ends, and the launch ends with the first of them.
"""

import atexit
import importlib.util
import os
import sys
import tempfile
from pathlib import Path
from typing import Any

from ament_index_python.packages import get_package_share_directory, get_packages_with_prefixes
from launch.actions import DeclareLaunchArgument, ExecuteProcess, LogInfo, OpaqueFunction, Shutdown
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from launch import LaunchContext, LaunchDescription
from wam_control.task.scenario import load_for, script_file
from wam_description.configuration import Configuration, named_file, option_values
from wam_description.nodes import EACH, GROUPED, NODES
from wam_description.urdf import urdf
from wam_ros.processors import placed_groups
from wam_ros.run import NAMESPACE, PARENT

CONFIGURED = "configured"
SWITCH = ["true", "false"]
ARGUMENTS = {  # name: default, description, allowed values
    "config": ("wam", "name of an installed configuration (wam, testbed), or path of a YAML file", None),
    "overrides": (
        "",
        "values in place of the configuration's: 'force_loop:force_gain=[0.01]; arm.payload=0.3'",
        None,
    ),
    "namespace": (NAMESPACE, "namespace of the arm; a second arm on this machine needs another one", None),
    "mode": (
        CONFIGURED,
        "lockstep waits for every command, realtime runs on the steady clock, configured is what the file sets",
        [CONFIGURED, "realtime", "lockstep"],
    ),
    "processes": (
        "false",
        "true: one per node; grouped: driver with velocity loop, recorder, all others; false: one, in realtime grouped",
        [*SWITCH, GROUPED],
    ),
    "scenario": ("", "scenario that is played: name of an installed one, or path of a YAML file; empty: none", None),
    "record": (
        "false",
        "record every topic into a bag in the directory that the configuration names (recorder: directory)",
        SWITCH,
    ),
    "bag": ("", "path of a new bag into which every topic is recorded; empty: as record sets it", None),
    "log_level": ("info", "least severity of what the nodes print", ["debug", "info", "warn", "error", "fatal"]),
    "tf": (
        "auto",
        "robot_state_publisher publishes /tf and /tf_static; auto: where it is installed",
        ["auto", *SWITCH],
    ),
    "frame_prefix": ("", "put before every frame of /tf; the frames in the arm's own messages have none", None),
    "rviz": ("false", "RViz with the arm, contacts and forces", SWITCH),
    "trajectory_action": (
        "auto",
        "the action FollowJointTrajectory, for MoveIt; auto: where control_msgs is installed",
        ["auto", *SWITCH],
    ),
    "use_sim_time": ("true", "RViz and robot_state_publisher take the arm's /clock", SWITCH),
}


def start_nodes(context: LaunchContext) -> list[Any]:
    """All nodes in one process or in several, with the parameters of the configuration; viewers."""
    given = {argument: LaunchConfiguration(argument).perform(context) for argument in ARGUMENTS}
    configuration = chosen(given)
    namespace = given["namespace"].strip("/")
    folder = tempfile.TemporaryDirectory(prefix="wam_stack_")
    atexit.register(folder.cleanup)
    parameters = Path(folder.name, "parameters.yaml")
    parameters.write_text(configuration.text, encoding="utf-8")
    # what is started ends with this process, even where a signal ends it before it can stop its children
    ends: dict[str, Any] = {"additional_env": {PARENT: str(os.getpid())}, "output": "screen"}
    ends["on_exit"] = Shutdown(reason="a node of the arm has ended")
    viewers = [
        *transforms(configuration, given, namespace, ends),
        *rviz(given, namespace, Path(folder.name)),
        *action(given, namespace, ends),
    ]
    if configuration.shared.timing.mode == "lockstep" and given["processes"] == "false":
        command = ["up", "--config", str(parameters), "--namespace", namespace, "--log-level", given["log_level"]]
        return [program(command, ends), *viewers]
    processes = EACH if given["processes"] == "true" else GROUPED
    nodes = [
        Node(
            package="wam_stack",
            executable="node" if set(group) - {*NODES} or len(group) > 1 else group[0],
            arguments=group if set(group) - {*NODES} or len(group) > 1 else [],
            ros_arguments=["--log-level", given["log_level"]],
            namespace=namespace,
            parameters=[str(parameters)],
            **{**ends, "additional_env": {**ends["additional_env"], **place}},
        )
        for group, place in placed_groups(configuration.shared, processes)
    ]
    return [*nodes, *viewers]


def chosen(given: dict[str, str]) -> Configuration:
    """The configuration with what the arguments change; scenario and recorder are nodes of it."""
    configuration = Configuration.load(named_file(given["config"]))
    values = option_values([text for text in given["overrides"].split(";") if text.strip()])
    values |= {"timing.mode": given["mode"]} if given["mode"] != CONFIGURED else {}
    more = []
    if given["scenario"]:
        file = script_file(given["scenario"]).resolve()
        # refused before any node starts
        load_for(configuration.with_values(values) if values else configuration, str(file))
        more.append("scenario")
        values["scenario:script"] = str(file)
    if given["record"] == "true" or given["bag"]:
        more.append("recorder")
    if given["bag"]:
        bag = Path(given["bag"]).resolve()
        values |= {"recorder:directory": str(bag.parent), "recorder:name": bag.name}
    configuration = configuration.with_values(values) if values else configuration
    return configuration.with_nodes(*more) if more else configuration


def own_names(namespace: str, prefix: str) -> list[tuple[str, str]]:
    """Names of a second arm: its clock, and its tree of frames where no prefix distinguishes them."""
    if namespace == NAMESPACE:
        return []
    tree = [] if prefix else [("/tf", "tf"), ("/tf_static", "tf_static")]
    return [("/clock", "clock"), *tree]


def transforms(configuration: Configuration, given: dict[str, str], namespace: str, ends: dict[str, Any]) -> list[Any]:
    """The frames by robot_state_publisher, or a line that states why there are none."""
    if given["tf"] == "false":
        return []
    if given["tf"] == "auto" and "robot_state_publisher" not in get_packages_with_prefixes():
        return [LogInfo(msg="no /tf: install robot_state_publisher (apt install ros-jazzy-robot-state-publisher)")]
    return [
        Node(
            package="robot_state_publisher",
            executable="robot_state_publisher",
            namespace=namespace,
            parameters=[
                {
                    "robot_description": urdf(configuration.shared.arm),
                    "frame_prefix": given["frame_prefix"],
                    "use_sim_time": given["use_sim_time"] == "true",
                }
            ],
            # the driver publishes the description itself, latched: one publisher is enough
            remappings=[("robot_description", "~/robot_description"), *own_names(namespace, given["frame_prefix"])],
            additional_env=ends["additional_env"],
            output="screen",
        )
    ]


def rviz(given: dict[str, str], namespace: str, folder: Path) -> list[Any]:
    """RViz with the view of the package, in the namespace of the arm; closing it ends nothing."""
    if given["rviz"] == "false":
        return []
    view = Path(get_package_share_directory("wam_stack"), "rviz", "wam.rviz").read_text(encoding="utf-8")
    prefix = given["frame_prefix"]
    view = view.replace("Fixed Frame: base_link", f"Fixed Frame: {prefix}base_link")
    view = view.replace('TF Prefix: ""', f"TF Prefix: {prefix.rstrip('/')!r}").replace("/wam/", f"/{namespace}/")
    file = folder / "wam.rviz"
    file.write_text(view, encoding="utf-8")
    return [
        Node(
            package="rviz2",
            executable="rviz2",
            namespace=namespace,
            arguments=["-d", str(file)],
            parameters=[{"use_sim_time": given["use_sim_time"] == "true"}],
            remappings=own_names(namespace, prefix),
            output="screen",
        )
    ]


def action(given: dict[str, str], namespace: str, ends: dict[str, Any]) -> list[Any]:
    """The server of the action FollowJointTrajectory."""
    wanted = given["trajectory_action"]
    if wanted == "false" or (wanted == "auto" and importlib.util.find_spec("control_msgs") is None):
        return []
    return [program(["live", "--trajectories", "--namespace", namespace], ends)]


def program(command: list[str], ends: dict[str, Any]) -> Any:
    """The command `wam` as a process."""
    return ExecuteProcess(cmd=[sys.executable, "-m", "wam_cli.main", *command], **ends)


def generate_launch_description() -> LaunchDescription:
    """Describe the arguments and the nodes to `ros2 launch`."""
    declared = [
        DeclareLaunchArgument(name, default_value=default, description=text, choices=choices)
        for name, (default, text, choices) in ARGUMENTS.items()
    ]
    return LaunchDescription([*declared, OpaqueFunction(function=start_nodes)])

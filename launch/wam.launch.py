"""Start every node of one configuration, each as a process of its own.

    ros2 launch wam_stack wam.launch.py config:=wam namespace:=wam mode:=lockstep record:=true

`ros2 launch wam_stack wam.launch.py --show-args` describes the arguments.  All nodes end with the launch,
however it ends.
"""

import atexit
import os
import tempfile
from pathlib import Path

from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from launch import LaunchContext, LaunchDescription
from wam_description.configuration import Configuration, packaged
from wam_ros.run import PARENT

CONFIGURED = "configured"
ARGUMENTS = {  # name: default, description, allowed values
    "config": ("wam", "name of an installed configuration (wam, testbed), or path of a YAML file", None),
    "namespace": ("wam", "namespace of the arm; a second arm on this machine needs another one", None),
    "mode": (
        CONFIGURED,
        "lockstep waits for every command, realtime runs on the steady clock, configured is what the file says",
        [CONFIGURED, "realtime", "lockstep"],
    ),
    "record": (
        "false",
        "record every topic into a bag in the directory that the configuration names (recorder: directory)",
        ["true", "false"],
    ),
}


def start_nodes(context: LaunchContext) -> list[Node]:
    """One process per node, all with the parameters of the configuration."""
    config, namespace, mode, record = (LaunchConfiguration(argument).perform(context) for argument in ARGUMENTS)
    is_path = config.endswith((".yaml", ".yml"))
    configuration = Configuration.load(Path(config).resolve() if is_path else packaged(config))
    if mode != CONFIGURED:
        configuration = configuration.with_values({"timing.mode": mode})
    folder = tempfile.TemporaryDirectory(prefix="wam_stack_")
    atexit.register(folder.cleanup)
    parameters = Path(folder.name, "parameters.yaml")
    parameters.write_text(configuration.text, encoding="utf-8")
    return [
        Node(
            package="wam_stack",
            executable="node" if ":" in entry else entry,
            arguments=[entry] if ":" in entry else [],
            namespace=namespace,
            parameters=[str(parameters)],
            # a node ends with this process, even where a signal ends it before it can stop its children
            additional_env={PARENT: str(os.getpid())},
            output="screen",
        )
        for entry in [*configuration.shared.nodes, *(["recorder"] if record == "true" else [])]
    ]


def generate_launch_description() -> LaunchDescription:
    """Describe the arguments and the nodes to `ros2 launch`."""
    declared = [
        DeclareLaunchArgument(name, default_value=default, description=text, choices=choices)
        for name, (default, text, choices) in ARGUMENTS.items()
    ]
    return LaunchDescription([*declared, OpaqueFunction(function=start_nodes)])

"""Start every node of one configuration, all in one process or each in its own.

    ros2 launch wam_stack wam.launch.py config:=wam namespace:=wam processes:=true record:=true

`ros2 launch wam_stack wam.launch.py --show-args` describes the arguments.  All nodes end with the launch,
however it ends.
"""

import atexit
import os
import sys
import tempfile
from pathlib import Path
from typing import Any

from launch.actions import DeclareLaunchArgument, ExecuteProcess, OpaqueFunction
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
    "processes": (
        "false",
        "a process for each node; false: all nodes in one process, unless the mode is realtime",
        ["true", "false"],
    ),
    "record": (
        "false",
        "record every topic into a bag in the directory that the configuration names (recorder: directory)",
        ["true", "false"],
    ),
}


def start_nodes(context: LaunchContext) -> list[Any]:
    """All nodes in one process, or one process per node, with the parameters of the configuration."""
    config, namespace, mode, processes, record = (
        LaunchConfiguration(argument).perform(context) for argument in ARGUMENTS
    )
    is_path = config.endswith((".yaml", ".yml"))
    configuration = Configuration.load(Path(config).resolve() if is_path else packaged(config))
    if mode != CONFIGURED:
        configuration = configuration.with_values({"timing.mode": mode})
    folder = tempfile.TemporaryDirectory(prefix="wam_stack_")
    atexit.register(folder.cleanup)
    parameters = Path(folder.name, "parameters.yaml")
    parameters.write_text(configuration.text, encoding="utf-8")
    # what is started ends with this process, even where a signal ends it before it can stop its children
    environment = {PARENT: str(os.getpid())}
    if configuration.shared.timing.mode == "lockstep" and processes == "false":
        command = [sys.executable, "-m", "wam_cli.main", "up", "--config", str(parameters), "--namespace", namespace]
        command += ["--record"] if record == "true" else []
        return [ExecuteProcess(cmd=command, additional_env=environment, output="screen")]
    return [
        Node(
            package="wam_stack",
            executable="node" if ":" in entry else entry,
            arguments=[entry] if ":" in entry else [],
            namespace=namespace,
            parameters=[str(parameters)],
            additional_env=environment,
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

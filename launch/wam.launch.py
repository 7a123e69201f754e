"""Start every node of one configuration, all in one process or each in its own.

    ros2 launch wam_stack wam.launch.py config:=wam namespace:=wam processes:=true record:=true

`config` is the name of an installed configuration or the path of a YAML file; mode:=realtime implies processes:=true.
"""

import os
import sys
from pathlib import Path
from typing import Any

import yaml
from ament_index_python.packages import get_package_share_directory
from launch.actions import DeclareLaunchArgument, ExecuteProcess, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from launch import LaunchContext, LaunchDescription
from wam_ros.run import PARENT


def start_nodes(context: LaunchContext) -> list[Any]:
    """All nodes in one process, or one process per node, with the parameters of the configuration."""
    config, namespace, mode, processes, record = (
        LaunchConfiguration(argument).perform(context)
        for argument in ("config", "namespace", "mode", "processes", "record")
    )
    installed = Path(get_package_share_directory("wam_stack"), "config", f"{config}.yaml")
    parameters = installed if installed.is_file() else Path(config).resolve()
    if not parameters.is_file():
        names = ", ".join(sorted(file.stem for file in installed.parent.glob("*.yaml")))
        raise ValueError(f"config:={config} is no file and none of: {names}")
    if mode == "lockstep" and processes == "false":
        command = [sys.executable, "-m", "wam_cli.main", "up", "--mode", mode, "--config", str(parameters)]
        command += ["--namespace", namespace, *(["--record"] if record == "true" else [])]
        return [ExecuteProcess(cmd=command, additional_env={PARENT: str(os.getpid())}, output="screen")]
    nodes = yaml.safe_load(parameters.read_text())["/**"]["ros__parameters"]["nodes"]
    return [
        Node(
            package="wam_stack",
            executable="node" if ":" in entry else entry,
            arguments=[entry] if ":" in entry else [],
            namespace=namespace,
            parameters=[str(parameters), {"timing.mode": mode}],
            output="screen",
        )
        for entry in [*nodes, *(["recorder"] if record == "true" else [])]
    ]


def generate_launch_description() -> LaunchDescription:
    """Describe the arguments and the nodes to `ros2 launch`."""
    return LaunchDescription(
        [
            DeclareLaunchArgument("config", default_value="wam", description="configuration name or YAML file"),
            DeclareLaunchArgument("namespace", default_value="wam", description="namespace of the arm"),
            DeclareLaunchArgument("mode", default_value="lockstep", choices=["lockstep", "realtime"]),
            DeclareLaunchArgument("processes", default_value="false", choices=["true", "false"]),
            DeclareLaunchArgument("record", default_value="false", choices=["true", "false"]),
            OpaqueFunction(function=start_nodes),
        ]
    )

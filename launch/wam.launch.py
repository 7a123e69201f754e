"""Start every node of one configuration.

    ros2 launch wam_stack wam.launch.py config:=wam namespace:=wam mode:=realtime record:=true

`config` is the name of an installed configuration or the path of a YAML file.
"""

from pathlib import Path

import yaml
from ament_index_python.packages import get_package_share_directory
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from launch import LaunchContext, LaunchDescription


def start_nodes(context: LaunchContext) -> list[Node]:
    """One process a node, all with the parameters of the configuration."""
    config, namespace, mode, record = (
        LaunchConfiguration(argument).perform(context) for argument in ("config", "namespace", "mode", "record")
    )
    installed = Path(get_package_share_directory("wam_stack"), "config", f"{config}.yaml")
    parameters = installed if installed.is_file() else Path(config).resolve()
    if not parameters.is_file():
        names = ", ".join(sorted(file.stem for file in installed.parent.glob("*.yaml")))
        raise ValueError(f"config:={config} is no file and none of: {names}")
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
            DeclareLaunchArgument("mode", default_value="realtime", choices=["realtime", "lockstep"]),
            DeclareLaunchArgument("record", default_value="false", choices=["true", "false"]),
            OpaqueFunction(function=start_nodes),
        ]
    )

"""One tree, two builds: `pip install .` where there is no ROS, `colcon build` where there is."""

import sys
from glob import glob
from pathlib import Path
from xml.etree import ElementTree

from setuptools import find_packages, setup

NODES = {
    "driver": "wam_driver.driver_node",
    "transform": "wam_control.transform_node",
    "velocity_loop": "wam_control.velocity_loop_node",
    "gravity": "wam_control.gravity_node",
    "force_loop": "wam_control.force_loop_node",
    "contact_estimator": "wam_control.contact_estimator_node",
    "scenario": "wam_control.scenario_node",
    "recorder": "wam_ros.recorder_node",
}

CONFIGURATIONS = ("config", "config/experiments", "config/experiments/sets")

package = ElementTree.parse(Path(__file__).resolve().parent / "package.xml").getroot()
name = package.findtext("name")

# colcon and bloom run `setup.py install` or `setup.py develop`: each node becomes a console script, which
# setup.cfg sends to lib/wam_stack.  pip builds a wheel, whose console scripts all land on PATH: there only
# `wam` is one, and the launchers in scripts/ stand in lib/wam_stack instead.
ros_build = not {"install", "develop"}.isdisjoint(sys.argv)
console_scripts = [f"{node} = {module}:main" for node, module in NODES.items()] if ros_build else []
launchers = [] if ros_build else [f"scripts/{node}" for node in NODES]

setup(
    name=name,
    version=package.findtext("version"),
    description=package.findtext("description"),
    license=package.findtext("license"),
    maintainer=package.findtext("maintainer"),
    maintainer_email=package.find("maintainer").get("email"),
    packages=find_packages(include=["wam_*"]),
    python_requires=">=3.11",
    install_requires=[
        "lz4",
        "matplotlib",
        "mujoco",
        "numpy",
        "pin",
        "pyyaml",
        "zstandard",
    ],
    extras_require={
        # maps and batteries on many machines: `wam map --dask ADDRESS`
        "dask": ["distributed"],
        # ROS 2 Jazzy as wheels, for machines without ROS; never required, so that pip leaves a real ROS alone
        "ros": ["ros-jazzy-common-interfaces", "ros-jazzy-rclpy[fastrtps]"],
        "test": [
            "colcon-common-extensions",
            "mcap",
            "mcap-ros2-support",
            "distributed",
            "mypy",
            "pytest<9",
            "rosbags",
            "ruff",
            "scipy",
            "setuptools<80",
            "types-PyYAML",
        ],
        # the viewer of `wam view`; its interface changes from version to version
        "view": ["rerun-sdk>=0.41,<0.42"],
    },
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{name}"]),
        (f"share/{name}", ["package.xml"]),
        *((f"share/{name}/{folder}", sorted(glob(f"{folder}/*.yaml"))) for folder in CONFIGURATIONS),
        (f"share/{name}/launch", sorted(glob("launch/*.launch.py"))),
        (f"lib/{name}", launchers),
    ],
    entry_points={"console_scripts": ["wam = wam_ros.cli:main", *console_scripts]},
    zip_safe=False,
)

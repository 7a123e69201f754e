"""One tree, two builds: `pip install .` where there is no ROS, `colcon build` where there is."""

import os
import shutil
import sys
import sysconfig
from glob import glob
from importlib.util import find_spec
from multiprocessing.pool import ThreadPool
from pathlib import Path
from runpy import run_path
from xml.etree import ElementTree

from setuptools import Extension, find_packages, setup
from setuptools.command.build_ext import build_ext

HERE = Path(__file__).resolve().parent
NODES = run_path(str(HERE / "wam_description" / "nodes.py"))["NODES"]
PROGRAMS = ("node", *NODES)  # `node` starts a node of the user's own

# The inner loop, which mypyc makes into C where WAM_COMPILE is set: same source, same bits (the benchmark `compiled`).
# The substeps of the plant are C then, too: wam_driver/fast_steps.c.  WAM_COMPILE=auto: only where that is possible.
COMPILED = (
    "wam_bag/bag_writer.py",
    "wam_bag/cdr.py",
    "wam_bag/mcap_writer.py",
    "wam_bag/value_messages.py",
    "wam_control/contact/contact_estimator.py",
    "wam_control/contact/contact_fit.py",
    "wam_control/contact/contact_fusion.py",
    "wam_control/contact/contact_inference.py",
    "wam_control/contact/contact_table.py",
    "wam_control/contact/error_effects.py",
    "wam_control/contact/motor_side.py",
    "wam_control/force/axes.py",
    "wam_control/force/belief.py",
    "wam_control/force/command_run.py",
    "wam_control/force/contact_place.py",
    "wam_control/force/force_axis.py",
    "wam_control/force/force_command.py",
    "wam_control/force/force_loop.py",
    "wam_control/force/force_measurement.py",
    "wam_control/force/force_watch.py",
    "wam_control/force/held_arm.py",
    "wam_control/force/knowledge.py",
    "wam_control/force/limits.py",
    "wam_control/force/problem.py",
    "wam_control/contact/model_errors.py",
    "wam_control/contact/momentum_observer.py",
    "wam_control/task/motion.py",
    "wam_control/task/scenario.py",
    "wam_control/contact/shaft_friction.py",
    "wam_control/velocity/transform.py",
    "wam_control/contact/velocity_fit.py",
    "wam_control/velocity/velocity_loop.py",
    "wam_description/defects.py",
    "wam_description/message_bus.py",
    "wam_description/rigid_body.py",
    "wam_description/signals.py",
    "wam_description/small_matrices.py",
    "wam_description/synchroniser.py",
    "wam_description/transmission_map.py",
    "wam_driver/amplifier.py",
    "wam_driver/bus/bus_parameters.py",
    "wam_driver/circuits.py",
    "wam_driver/driver.py",
    "wam_driver/dry_friction.py",
    "wam_driver/limit_watch.py",
    "wam_driver/loads.py",
    "wam_driver/plant.py",
    "wam_driver/safety.py",
    "wam_driver/sensors.py",
    "wam_ros/recorder.py",
    "wam_ros/wire.py",
    "wam_sim/bus.py",
    "wam_sim/simulation.py",
)
COMPILE = "pip install -U mypy mujoco wheel 'setuptools>=68,<80' && WAM_COMPILE=1 pip install --no-build-isolation ."
CONFIGURATIONS = ("config", "config/experiments", "config/experiments/sets", "config/tasks")


def is_compiler_there():
    """Whether there is a C compiler, with the headers of Python."""
    compiler = str(sysconfig.get_config_var("CC") or "cc").split()[0]
    return bool(shutil.which(compiler)) and Path(sysconfig.get_path("include"), "Python.h").exists()


def extensions():
    """C extensions of the modules that are compiled; none without WAM_COMPILE."""
    wanted = os.environ.get("WAM_COMPILE")
    if not wanted or (wanted == "auto" and not is_compiler_there()):
        return []
    try:
        from mypyc.build import mypycify
    except ImportError:
        sys.exit(f"WAM_COMPILE needs mypyc: {COMPILE}")
    mujoco = find_spec("mujoco")
    if mujoco is None or mujoco.origin is None:
        sys.exit(f"WAM_COMPILE needs the headers of MuJoCo: {COMPILE}")
    given = ["--config-file", "pyproject.toml", "--ignore-missing-imports"]  # stubs are for `make check`
    found = mypycify([*COMPILED, *given], opt_level="3", multi_file=True, target_dir="build/mypyc")
    headers = Path(mujoco.origin).parent / "include"
    found.append(Extension("wam_driver.fast_steps", ["wam_driver/fast_steps.c"], include_dirs=[str(headers)]))
    for extension in found:
        # no fused operations: the bits of Python; calls within the extension need no table of addresses
        extension.extra_compile_args += ["-ffp-contract=off", "-fvisibility=hidden"]
    return found


class BuildOnAllProcessors(build_ext):
    """Compiles several files at a time; setuptools does so for whole extensions only, and there is one large one."""

    def build_extensions(self):
        """As that of setuptools."""
        compile_them = self.compiler.compile

        def compile_in_parallel(sources, **options):
            with ThreadPool(len(os.sched_getaffinity(0))) as pool:
                objects = pool.map(lambda source: compile_them([source], **options), sources)
            return [one for several in objects for one in several]

        self.compiler.compile = compile_in_parallel
        super().build_extensions()


package = ElementTree.parse(HERE / "package.xml").getroot()
name = package.findtext("name")

# colcon and bloom run `setup.py install` or `setup.py develop`: each node becomes a console script, which
# setup.cfg sends to lib/wam_stack.  pip builds a wheel, whose console scripts all land on PATH: there only
# `wam` is one, and scripts/node is installed in lib/wam_stack under the name of each node.
ros_build = not {"install", "develop"}.isdisjoint(sys.argv)
console_scripts = [f"{program} = wam_cli.program:node" for program in PROGRAMS] if ros_build else []
launchers = [] if ros_build else [f"build/launchers/{program}" for program in PROGRAMS]
for launcher in launchers:
    Path(launcher).parent.mkdir(parents=True, exist_ok=True)
    shutil.copy("scripts/node", launcher)

setup(
    name=name,
    version=package.findtext("version"),
    description=package.findtext("description"),
    license=package.findtext("license"),
    maintainer=package.findtext("maintainer"),
    maintainer_email=package.find("maintainer").get("email"),
    packages=find_packages(include=["wam_*"]),
    package_data={
        "": ["py.typed"],
        "wam_bag": ["messages.json"],
        "wam_description": ["constants.yaml"],
        "wam_driver.bus": ["properties.json"],
        "wam_ros": ["this_machine.xml"],
        "wam_analysis.findings": ["charts.js", "uplot/*"],
    },
    python_requires=">=3.11",
    install_requires=[
        "lz4",
        "matplotlib",
        "mcap",
        "mujoco",
        "numpy",
        "pin",
        "pyyaml",
        "quadprog",
        "zstandard",
    ],
    extras_require={
        # the arm of Barrett Technology on its CAN bus
        "bus": ["msgpack", "python-can"],  # the first is for `udp_multicast`
        # the inner loop as C: WAM_COMPILE
        "compile": ["mypy", "setuptools<80"],
        # Tab in the shell: `register-python-argcomplete wam`
        "completion": ["argcomplete"],
        # sweeps and benchmarks on many machines: `wam sweep --dask ADDRESS`
        "dask": ["distributed"],
        # the documentation site: `make docs`
        "docs": ["furo", "myst-parser", "numpydoc", "sphinx>=8.2"],
        # the fixture `arm` in tests of your nodes
        "kit": ["pytest<9", "pytest-xdist"],
        # the live page in the browser: `wam live`; without an upper limit pip takes 0.2, which has no plots
        "live": ["viser>=1.1,<1.2"],
        # ROS 2 Jazzy as wheels, for machines without ROS; never required, so that pip leaves a real ROS alone
        "ros": ["ros-jazzy-common-interfaces", "ros-jazzy-rclpy[fastrtps]"],
        # bags of ROS 1 and of SQLite: `wam analyse`
        "rosbags": ["rosbags"],
        "test": [
            "colcon-common-extensions",
            "mcap-ros2-support",
            "distributed",
            "msgpack",
            "mypy",
            "pytest<9",
            "pytest-xdist",
            "python-can",
            "rosbags",
            "ruff",
            "scipy",
            "setuptools<80",
            "types-PyYAML",
        ],
    },
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{name}"]),
        (f"share/{name}", ["package.xml"]),
        *((f"share/{name}/{folder}", sorted(glob(f"{folder}/*.yaml"))) for folder in CONFIGURATIONS),
        (f"share/{name}/launch", sorted(glob("launch/*.launch.*"))),
        (f"share/{name}/rviz", sorted(glob("rviz/*.rviz"))),
        (f"lib/{name}", launchers),
    ],
    entry_points={
        "console_scripts": ["wam = wam_cli.program:main", *console_scripts],
        "pytest11": ["wam_ros.pytest_plugin = wam_ros.pytest_plugin"],  # the test kit; named like its module
    },
    ext_modules=extensions(),
    cmdclass={"build_ext": BuildOnAllProcessors},
    zip_safe=False,
)

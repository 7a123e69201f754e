"""The table of nodes: name and class, which declares everything else.  setup.py reads this file, too."""

from typing import Final

NODES: Final = {
    "driver": "wam_driver.interface:DriverInterface",
    "transform": "wam_control.velocity.transform_node:TransformNode",
    "velocity_loop": "wam_control.velocity.velocity_loop_node:VelocityLoopNode",
    "gravity": "wam_control.velocity.gravity_node:GravityNode",
    "force_loop": "wam_control.force.force_loop_node:ForceLoopNode",
    "contact_estimator": "wam_control.contact.contact_estimator_node:ContactEstimatorNode",
    "scenario": "wam_control.task.scenario_node:ScenarioNode",
    "recorder": "wam_ros.recorder_interface:RecorderInterface",
}
ONE, GROUPED, EACH = "one", "grouped", "each"  # process for all nodes, for each group, for each node
# What works in every inner period, driver and inner loop, is together: its messages do not leave the process.  The
# others of the table are of the outer group, which has a period for its answer; the recorder has time.  A node of
# another name, as of your own, has a process of its own: a long step would hold up the force loop.
INNER, OUTER = "inner", "outer"
GROUPS: Final = {**dict.fromkeys(NODES, OUTER), "driver": INNER, "recorder": "recorder"}

_ON_PYPI: Final = {"pinocchio": "pin", "yaml": "pyyaml"}  # modules that have another name there


def installation(module: str) -> str:
    """How to install a module that a node or a command needs."""
    name = module.partition(".")[0]
    return f"pip install {_ON_PYPI.get(name, name)}"

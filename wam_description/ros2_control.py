"""The tag ``<ros2_control>`` in the URDF: controllers of ros2_control command postures of the arm over its topics."""

from xml.etree import ElementTree as ET
from xml.etree.ElementTree import Element, SubElement

from wam_description.arm import Arm
from wam_description.urdf import urdf

PLUGIN = "joint_state_topic_hardware_interface/JointStateTopicSystem"
STATES, COMMANDS = "joint_states", "joint_posture_command"
EVERY = "-1"  # threshold from which a command is sent: below 0 each of them, as the arm drops a command that ends


def urdf_with_ros2_control(arm: Arm, namespace: str) -> str:
    """The URDF with a system of position interfaces that listens to the arm's states and sends it postures.

    Parameters
    ----------
    arm : the arm.
    namespace : of its topics.
    """
    robot = ET.fromstring(urdf(arm))
    system = SubElement(robot, "ros2_control", name=arm.name, type="system")
    hardware = SubElement(system, "hardware")
    SubElement(hardware, "plugin").text = PLUGIN
    topics = {"joint_states_topic": STATES, "joint_commands_topic": COMMANDS}
    for name, topic in topics.items():
        SubElement(hardware, "param", name=name).text = f"/{namespace.strip('/')}/{topic}"
    SubElement(hardware, "param", name="trigger_joint_command_threshold").text = EVERY
    for name, low, high in zip(arm.joints.names, arm.joints.lower, arm.joints.upper, strict=True):
        joint = SubElement(system, "joint", name=name)
        command = SubElement(joint, "command_interface", name="position")
        _limit(command, "min", low)
        _limit(command, "max", high)
        for quantity in ("position", "velocity"):
            SubElement(joint, "state_interface", name=quantity)
    ET.indent(robot)
    return '<?xml version="1.0"?>\n' + ET.tostring(robot, encoding="unicode") + "\n"


def _limit(interface: Element, name: str, value: float) -> None:
    SubElement(interface, "param", name=name).text = repr(float(value))

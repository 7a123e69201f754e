"""The URDF, read by pinocchio and MuJoCo, against the parameters it was made from."""

from xml.etree import ElementTree as ET

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from wam_description.arm import Arm
from wam_description.configuration import Configuration, packaged
from wam_description.rigid_body import RigidBody
from wam_description.topics import BY_NAME
from wam_description.urdf import urdf

JOINTS = ["joint1", "joint2", "joint3", "joint4"]


@pytest.fixture(scope="module")
def arm() -> Arm:
    return Configuration.load(packaged("wam")).shared.arm


@pytest.fixture(scope="module")
def by_pinocchio(arm: Arm) -> pin.Model:
    return pin.buildModelFromXML(urdf(arm))


@pytest.fixture(scope="module")
def by_mujoco(arm: Arm) -> mujoco.MjModel:
    spec = mujoco.MjSpec.from_string(urdf(arm))
    spec.compiler.fusestatic = False
    return spec.compile()


def test_masses_and_inertias_survive(arm: Arm, by_pinocchio: pin.Model, by_mujoco: mujoco.MjModel) -> None:
    fused = mujoco.MjModel.from_xml_string(urdf(arm))
    for i, name in enumerate(arm.links.names):
        inertia = by_pinocchio.inertias[i + 1]
        rows = slice(3 * i, 3 * i + 3)
        assert inertia.mass == arm.links.mass[i]
        assert inertia.lever == pytest.approx(arm.links.centre[rows])
        assert np.diag(inertia.inertia) == pytest.approx(arm.links.inertia[rows])
        for model in (by_mujoco, fused):
            assert model.body(name).mass[0] == arm.links.mass[i]
            assert model.body(name).ipos == pytest.approx(arm.links.centre[rows])
            assert sorted(model.body(name).inertia) == pytest.approx(sorted(arm.links.inertia[rows]))
    assert mujoco.mj_getTotalmass(by_mujoco) == pytest.approx(sum(arm.links.mass))


def test_axes_and_limits_survive(arm: Arm, by_pinocchio: pin.Model, by_mujoco: mujoco.MjModel) -> None:
    newton_metre = 4.4482216152605 * 0.0254
    effort = [43 * newton_metre * ratio for ratio in (29.97, 2 * 30.40, 30.40, 19.15)]
    assert list(by_pinocchio.names)[1:] == JOINTS
    assert by_pinocchio.lowerPositionLimit == pytest.approx(arm.joints.lower)
    assert by_pinocchio.upperPositionLimit == pytest.approx(arm.joints.upper)
    assert by_pinocchio.upperEffortLimit == pytest.approx(effort)
    assert by_pinocchio.upperVelocityLimit == pytest.approx(arm.joints.speed_limit)
    for i, name in enumerate(JOINTS):
        joint = by_mujoco.joint(name)
        assert by_pinocchio.joints[i + 1].shortname() == "JointModelRZ"
        assert joint.axis == pytest.approx([0, 0, 1])
        assert joint.range == pytest.approx([arm.joints.lower[i], arm.joints.upper[i]])
        assert by_mujoco.jnt_actfrcrange[joint.id] == pytest.approx([-effort[i], effort[i]])


def test_tubes_lie_from_start_to_end_of_the_covers(arm: Arm, by_mujoco: mujoco.MjModel) -> None:
    body = RigidBody(arm)
    data = mujoco.MjData(by_mujoco)
    q = [0.3, -0.5, 0.7, 0.4]
    data.qpos[:] = q
    mujoco.mj_kinematics(by_mujoco, data)
    spheres = data.geom_xpos[by_mujoco.geom_type == mujoco.mjtGeom.mjGEOM_SPHERE]
    cylinders = np.flatnonzero(by_mujoco.geom_type == mujoco.mjtGeom.mjGEOM_CYLINDER)
    assert len(cylinders) == len(arm.covers.names)
    for i, name in enumerate(arm.covers.names):
        rows = slice(3 * i, 3 * i + 3)
        ends = [body.point(q, name, ends[rows]) for ends in (arm.covers.start, arm.covers.end)]
        assert all(min(np.linalg.norm(spheres - end, axis=1)) < 1e-9 for end in ends)
        centre, axis = data.geom_xpos[cylinders[i]], data.geom_xmat[cylinders[i]].reshape(3, 3)[:, 2]
        half = by_mujoco.geom_size[cylinders[i], 1]
        assert np.allclose(centre + half * axis, ends[1], atol=1e-9)
        assert np.allclose(centre - half * axis, ends[0], atol=1e-9)


def test_every_link_has_one_parent_and_contact_frames_exist(arm: Arm) -> None:
    robot = ET.fromstring(urdf(arm))
    links = {link.get("name") for link in robot.iter("link")}
    children = [child.get("link") for child in robot.iter("child")]
    assert {*arm.links.names, "inner_link", "outer_link", "tool", "base", "base_link"} == links
    assert sorted(children, key=str) == sorted(links - {"base_link"}, key=str)


def test_the_tag_of_ros2_control_names_joints_limits_and_topics_of_the_arm(arm: Arm) -> None:
    robot = ET.fromstring(urdf(arm, "/left/"))
    (system,) = robot.findall("ros2_control")
    assert [joint.get("name") for joint in system.findall("joint")] == list(arm.joints.names)
    for i, joint in enumerate(system.findall("joint")):
        limits = {param.get("name"): float(param.text or "") for param in joint.findall("command_interface/param")}
        assert limits == {"min": arm.joints.lower[i], "max": arm.joints.upper[i]}
        assert [state.get("name") for state in joint.findall("state_interface")] == ["position", "velocity"]
    params = {param.get("name"): param.text or "" for param in system.findall("hardware/param")}
    states, commands = (params[f"joint_{kind}_topic"].removeprefix("/left/") for kind in ("states", "commands"))
    assert BY_NAME[states].type == BY_NAME[commands].type == "sensor_msgs/msg/JointState"
    robot.remove(system)
    assert len(pin.buildModelFromXML(ET.tostring(robot, encoding="unicode")).names) == 5, "else it is the URDF"

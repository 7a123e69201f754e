"""Frames for /tf against the table of (A.4) by hand and pinocchio's own reading of the URDF, alone and over topics."""

import re
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from contact_truth import cover_frame, frame

from wam_description.arm import Arm
from wam_description.configuration import Configuration, packaged
from wam_description.frames import ArmFrames, FramePlacement
from wam_description.urdf import urdf
from wam_ros.bring_up import Composition
from wam_ros.client import StackClient


def arm_of(name: str) -> Arm:
    return Configuration.load(packaged(name)).shared.arm


def homogeneous(one: FramePlacement) -> np.ndarray:
    """(4, 4), from the quaternion by hand."""
    x, y, z, w = one.quaternion
    turn = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.block([[np.array(turn), np.array(one.translation)[:, None]], [np.zeros((1, 3)), np.ones((1, 1))]])


def in_the_root(placements: list[FramePlacement], root: str = "base_link") -> dict[str, np.ndarray]:
    """Every frame in the root, through its parents, as a listener of /tf computes it."""
    parents = {one.child: one for one in placements}
    assert len(parents) == len(placements), "a frame has one parent"

    def found(name: str) -> np.ndarray:
        return np.eye(4) if name == root else found(parents[name].parent) @ homogeneous(parents[name])

    return {name: found(name) for name in parents}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["wam", "testbed", "barrett-wam4", "barrett-wam7"])
def test_every_frame_is_where_pinocchio_puts_the_link_of_that_name_of_the_urdf(name: str) -> None:
    arm = arm_of(name)
    model = pin.buildModelFromXML(urdf(arm))
    data, frames = model.createData(), ArmFrames(arm)
    for q in np.random.default_rng(3).uniform(arm.joints.lower, arm.joints.upper, (20, len(arm.joints.names))):
        pin.framesForwardKinematics(model, data, q)
        bodies = {one.name: data.oMf[i] for i, one in enumerate(model.frames) if one.type == pin.FrameType.BODY}
        found = in_the_root([*frames.fixed, *frames.moving(q.tolist())])
        assert set(found) == set(bodies) - {"base_link"}
        for link, there in found.items():
            np.testing.assert_allclose(there, bodies[link].homogeneous, rtol=0, atol=1e-9)


def test_covers_and_links_of_the_thesis_are_where_its_table_puts_them() -> None:
    frames = ArmFrames(arm_of("wam"), "left/")
    for q in ((0.3, -1.0, 0.2, 0.5), (-1.1, 0.4, -0.9, 1.9)):
        found = in_the_root([*frames.fixed, *frames.moving(q)], "left/base_link")
        for i in range(4):
            np.testing.assert_allclose(found[f"left/link{i + 1}"], frame(q, i + 1), atol=1e-9)
        for cover in ("inner_link", "outer_link"):
            np.testing.assert_allclose(found[f"left/{cover}"], cover_frame(q, cover), atol=1e-9)


PAGE = Path(__file__).parents[2] / "docs/topics.md"
AXES = re.findall(r"^\| `(\w+)` of `(.*)` \| (.*) \| (.*) \| (.*) \|$", PAGE.read_text(), re.MULTILINE)


@pytest.mark.parametrize(("cover", "name", "axes"), [(cover, name, axes) for cover, name, *axes in AXES])
def test_the_axes_of_a_cover_point_where_the_page_states(cover: str, name: str, axes: list[str]) -> None:
    frames = ArmFrames(arm_of(name))
    turn = in_the_root([*frames.fixed, *frames.moving([0.0] * 4)])[cover][:3, :3]
    stated = [(-1.0 if axis[0] == "-" else 1.0) * np.eye(3)["xyz".index(axis[-1])] for axis in axes]
    np.testing.assert_allclose(turn.T, stated, atol=1e-9)


@pytest.mark.parametrize(
    ("namespace", "prefix", "topics"), [("wam", "", "/"), ("left", "left/", "/"), ("left", "", "/left/")]
)
def test_a_running_stack_has_its_frames_on_tf(domain_id: int, namespace: str, prefix: str, topics: str) -> None:
    messages = pytest.importorskip("tf2_msgs.msg", reason="needs tf2_msgs, of a ROS installation; not in the wheels")
    from rclpy.node import Node
    from rclpy.qos import DurabilityPolicy, QoSProfile
    from sensor_msgs.msg import JointState

    from wam_live.frame_publisher import FramePublisher

    configuration = Configuration.load(packaged("wam"))
    shared = configuration.shared
    with Composition(configuration, namespace=namespace, domain_id=domain_id) as stack:
        FramePublisher(StackClient(namespace, "frames", stack, shared), prefix)
        onlooker = stack.add(Node("onlooker", context=stack.context, namespace=namespace))
        moving, fixed, states = [], [], []
        onlooker.create_subscription(messages.TFMessage, f"{topics}tf", moving.append, 10)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        onlooker.create_subscription(messages.TFMessage, f"{topics}tf_static", fixed.append, latched)
        onlooker.create_subscription(JointState, "joint_states", states.append, 1000)

        def stamp_of(message: object) -> tuple[int, int]:
            return message.header.stamp.sec, message.header.stamp.nanosec  # type: ignore[attr-defined]

        def common() -> set[tuple[int, int]]:
            return {stamp_of(one.transforms[0]) for one in moving} & {stamp_of(one) for one in states}

        stack.spin(lambda: len(common()) > 3 and bool(fixed))
        at = max(common())
    (q,) = (one.position.tolist() for one in states if stamp_of(one) == at)
    (sent,) = (one for one in moving if stamp_of(one.transforms[0]) == at)
    assert {stamp_of(one) for one in sent.transforms} == {at}
    found = in_the_root([placement(one) for one in (*fixed[0].transforms, *sent.transforms)], f"{prefix}base_link")
    np.testing.assert_allclose(found[f"{prefix}outer_link"], cover_frame(q, "outer_link"), atol=1e-9)
    ns = sorted(s * 10**9 + n for s, n in {stamp_of(one.transforms[0]) for one in moving})
    period = shared.timing.outer_period_ns * shared.timing.display_divisor
    assert min(np.diff(ns)) == period, "at the display rate"


def placement(message: object) -> FramePlacement:
    transform = message.transform  # type: ignore[attr-defined]
    place, turn = transform.translation, transform.rotation
    parent, child = message.header.frame_id, message.child_frame_id  # type: ignore[attr-defined]
    return FramePlacement(parent, child, (place.x, place.y, place.z), (turn.x, turn.y, turn.z, turn.w))

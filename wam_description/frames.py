"""Where each frame of the arm is in the frame before it, with the names of the URDF: what /tf and /tf_static carry."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wam_description.arm import Arm
from wam_description.rigid_body import cover_placement, joint_placement
from wam_description.urdf import BASE, ROOT, TOOL


class FramePlacement(NamedTuple):
    """A frame in its parent frame.

    Attributes
    ----------
    parent, child : names of the frames.
    translation : (3,), m.
    quaternion : (4,), rotation as x, y, z, w.
    """

    parent: str
    child: str
    translation: tuple[float, float, float]
    quaternion: tuple[float, float, float, float]


class ArmFrames:
    """The tree of frames of an arm.

    Parameters
    ----------
    arm : the arm.
    prefix : put before every name, as 'left/'.

    Attributes
    ----------
    fixed : the frames that no joint moves in their parent: base, covers, tool.
    """

    def __init__(self, arm: Arm, prefix: str = "") -> None:
        self._prefix = prefix
        links, covers = arm.links.names, arm.covers
        self._joints = [(links[i - 1] if i else BASE, name, joint_placement(arm, i)) for i, name in enumerate(links)]
        self.fixed = (
            self._placed(ROOT, BASE, pin.SE3.Identity()),
            *(self._placed(covers.links[i], name, cover_placement(arm, i)) for i, name in enumerate(covers.names)),
            self._placed(links[-1], TOOL, pin.SE3(np.eye(3), np.array(arm.tool))),
        )

    def moving(self, q: Sequence[float]) -> list[FramePlacement]:
        """The frames of the links at joint angles q, (n,), rad; joint i turns link i about its z axis."""
        return [
            self._placed(parent, child, placement * pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, angle), np.zeros(3)))
            for (parent, child, placement), angle in zip(self._joints, q, strict=True)
        ]

    def _placed(self, parent: str, child: str, placement: pin.SE3) -> FramePlacement:
        x, y, z, *quaternion = pin.SE3ToXYZQUAT(placement).tolist()
        return FramePlacement(self._prefix + parent, self._prefix + child, (x, y, z), tuple(quaternion))

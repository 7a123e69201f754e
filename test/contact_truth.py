"""What the contact tests hold for true: the arm written down a second time, by other means.

Torques of a contact come from central differences of the product of (A.4), motion from a MuJoCo
model of the links with rigid cables.  Nothing of wam_control or of RigidBody is used.
"""

import math
from collections.abc import Sequence
from xml.sax.saxutils import quoteattr

import mujoco
import numpy as np

from wam_description.arm import Arm

L3, L4 = 0.5588, 0.4064  # 22 and 16 in
TABLE = ((0.0, 0.0), (math.pi / 2, 0.0), (-math.pi / 2, L3), (math.pi / 2, 0.0))  # alpha_(i-1), d_i; a = 0
N1, N2, N4 = 29.97, 30.40, 19.15


def frame(q: Sequence[float], last: int) -> np.ndarray:
    """Frame `last` of (A.4) in the base, (4, 4), m."""
    result = np.eye(4)
    for angle, (alpha, d) in zip(q[:last], TABLE[:last], strict=True):
        c, s, ca, sa = math.cos(angle), math.sin(angle), math.cos(alpha), math.sin(alpha)
        result = result @ np.array(
            [[c, -s, 0, 0], [s * ca, c * ca, -sa, -sa * d], [s * sa, c * sa, ca, ca * d], [0, 0, 0, 1]]
        )
    return result


def cover_frame(q: Sequence[float], cover: str) -> np.ndarray:
    """Frame of a cover in the base: x from shoulder to elbow, or from elbow to tip."""
    if cover == "outer_link":
        return frame(q, 4)
    turn = np.array([[0, 0, -1, 0], [0, 1, 0, 0], [1, 0, 0, -L3], [0, 0, 0, 1.0]])
    return frame(q, 3) @ turn


def torques(q: Sequence[float], cover: str, point: Sequence[float], force: Sequence[float]) -> np.ndarray:
    """Joint torques of a force, N, in the cover's frame, at a point of it, m, by virtual work."""
    direction = cover_frame(q, cover)[:3, :3] @ np.array(force)
    result = np.zeros(4)
    for i in range(4):
        ahead, back = list(q), list(q)
        ahead[i] += 1e-6
        back[i] -= 1e-6
        moved = (cover_frame(ahead, cover) - cover_frame(back, cover)) @ np.array([*point, 1.0])
        result[i] = direction @ moved[:3] / 2e-6
    return result


def joint_from_motor(theta: np.ndarray) -> np.ndarray:
    """(A.5) by hand."""
    return np.array([theta[0] / N1, (theta[2] - theta[1]) / (2 * N2), -(theta[1] + theta[2]) / N2, theta[3] / N4])


def motor_from_joint(q: np.ndarray) -> np.ndarray:
    """The inverse of (A.5) by hand: thm2 = -N2 th2 - (N2/2) th3, thm3 = N2 th2 - (N2/2) th3."""
    return np.array([N1 * q[0], -N2 * q[1] - N2 / 2 * q[2], N2 * q[1] - N2 / 2 * q[2], N4 * q[3]])


def joint_torques(tau: np.ndarray) -> np.ndarray:
    """Torques at the joints of torques at the motors, by power."""
    return np.array([N1 * tau[0], N2 * (tau[2] - tau[1]), -N2 / 2 * (tau[1] + tau[2]), N4 * tau[3]])


class RigidArm:
    """Links, pulleys and rotors on rigid cables, sliding friction at each motor and joint."""

    SUBSTEPS = 4

    def __init__(self, arm: Arm, q: Sequence[float], friction: float) -> None:
        rotor = arm.motors.inertia[0]
        reflected = (N1**2 * rotor, 2 * N2**2 * rotor, N2**2 / 2 * rotor, N4**2 * rotor)
        self.armature = np.array(arm.joints.armature) + reflected
        self.model = mujoco.MjModel.from_xml_string(_mjcf(arm, self.armature))
        self.data = mujoco.MjData(self.model)
        self.data.qpos[:] = q
        mujoco.mj_forward(self.model, self.data)
        self._motor = friction * np.array(arm.motors.dynamic_friction)
        self._motor_viscous = friction * np.array(arm.motors.viscous_friction)
        self._joint = friction * np.array(arm.joints.dynamic_friction)
        self._joint_viscous = friction * np.array(arm.joints.viscous_friction)
        self._carried = np.zeros(4)

    def gravity(self) -> np.ndarray:
        """Torques that carry the arm where it is."""
        resting = mujoco.MjData(self.model)
        resting.qpos[:] = self.data.qpos
        mujoco.mj_forward(self.model, resting)
        return resting.qfrc_bias.copy()

    def step(self, tau_motor: np.ndarray, external: np.ndarray) -> None:
        """One millisecond with motor torques and torques of the world held."""
        data = self.data
        for _ in range(self.SUBSTEPS):
            speed = motor_from_joint(data.qvel)
            friction = self._motor * np.tanh(speed / 1.0) + self._motor_viscous * speed
            own = self._joint * np.tanh(data.qvel / 0.03) + self._joint_viscous * data.qvel
            self._carried = joint_torques(tau_motor - friction) - own
            data.qfrc_applied[:] = self._carried + external
            mujoco.mj_step(self.model, data)

    def motors(self, tau_motor: np.ndarray) -> tuple[list[float], list[float], list[float]]:
        theta, thetad = motor_from_joint(self.data.qpos), motor_from_joint(self.data.qvel)
        return theta.tolist(), thetad.tolist(), tau_motor.tolist()

    def sensors(self) -> tuple[list[float], list[float], list[float]]:
        """Encoders and strain torque, rotors and pulleys taken off, of the last substep."""
        strain = self._carried - self.armature * self.data.qacc
        return self.data.qpos.tolist(), self.data.qvel.tolist(), strain.tolist()


def _mjcf(arm: Arm, armature: np.ndarray) -> str:
    text, end = "", ""
    for i, (alpha, d) in enumerate(TABLE):
        place = f"0 {-math.sin(alpha) * d!r} {math.cos(alpha) * d!r}"
        centre = " ".join(map(repr, arm.links.centre[3 * i : 3 * i + 3]))
        inertia = " ".join(map(repr, arm.links.inertia[3 * i : 3 * i + 3]))
        text += f"<body name={quoteattr(arm.links.names[i])} pos='{place}' euler='{alpha!r} 0 0'>"
        text += f"<inertial pos='{centre}' mass='{arm.links.mass[i]!r}' diaginertia='{inertia}'/>"
        text += f"<joint type='hinge' axis='0 0 1' armature='{float(armature[i])!r}'/>"
        end += "</body>"
    return (
        "<mujoco><compiler angle='radian'/><option timestep='0.00025' integrator='implicitfast' "
        f"gravity='0 0 -9.80665'/><worldbody>{text}{end}</worldbody></mujoco>"
    )

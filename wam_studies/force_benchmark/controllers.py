"""What a user would write in place of the force loop, in a few lines each: what can be done at all.

Both press along the commanded direction at the declared position, or at the estimated one, and measure the force by
the pseudoinverse of the Jacobian there.  They refuse nothing and limit nothing but their speed.
"""

import math
from typing import Any, ClassVar

import numpy as np

from wam_control.contact.contact_table import contact_of
from wam_control.force.force_loop_parameters import ForceLoopParameters
from wam_control.force.guard import Report
from wam_description.arm import Shared
from wam_description.event import OBEYED, Event
from wam_description.rigid_body import Array, RigidBody
from wam_description.signals import State
from wam_description.wiring import Input, Inputs, Outputs, reaction


class UsualController:
    """One force at one point, and the posture of the start in what is left."""

    name, parameters = "force_loop", ForceLoopParameters
    event: ClassVar[Event] = OBEYED
    refusals: ClassVar[dict[str, Event]] = {}
    guard_report: ClassVar[Report] = Report("", False, {})

    def __init__(self, shared: Shared, own: ForceLoopParameters) -> None:
        self._body, self._own = RigidBody(shared.model_arm), own
        self._start: Array | None = None
        self._zero, self._torques = np.zeros((2, shared.arm.n))

    def tare(self) -> None:
        """Take the present torques as zero."""
        self._zero = self._torques

    @reaction(
        Input("joint_states"),
        Input("external_joint_torques", "effort", absent="brake"),
        Input("contact/hypotheses", absent="brake"),
        Input("force_command", age="command", absent="hold"),
        outputs=("joint_velocity_command", "joint_effort_command", "external_torque_zero"),
    )
    def step(self, inputs: Inputs) -> Outputs:
        """Compute velocities and torques of the joints for one outer period."""
        joints, command, torques = (inputs[t] for t in ("joint_states", "force_command", "external_joint_torques"))
        q = np.array(joints.position)
        self._start = q if self._start is None else self._start
        self._torques = self._zero if torques is None else np.array(torques.effort)
        velocity, effort = 2.0 * (self._start - q), np.zeros(len(q))
        size = math.hypot(*command.force) if command else 0.0
        if size:
            direction = np.array(command.force) / size
            jacobian = self._jacobian(joints.position, inputs["contact/hypotheses"])
            force = -float(direction @ np.linalg.pinv(jacobian.T, rcond=0.1) @ (self._torques - self._zero))
            lever: Array = direction @ jacobian
            square = max(float(lever @ lever), 1e-4)
            velocity = velocity - lever * (float(lever @ velocity) / square)
            velocity, effort = self.press(lever, square, size, force, velocity, np.array(joints.velocity), inputs.dt)
        return {
            "joint_velocity_command": State([], np.array(velocity).tolist(), []),
            "joint_effort_command": State([], [], effort.tolist()),
            "external_torque_zero": State([], [], [0.0] * len(q)),
        }

    def _jacobian(self, q: list[float], hypotheses: Any) -> Array:
        own, covers = self._own, self._body.arm.covers
        cover, position = own.contact_cover, own.contact_position
        if own.contact_source != "pinned" and hypotheses:
            contact = contact_of(hypotheses, covers.names)
            if contact.cover and not math.isnan(contact.position):
                cover, position = contact.cover, contact.position
        return self._body.point_jacobian(q, cover, (position, 0.0, 0.0))

    def press(
        self, lever: Array, square: float, size: float, force: float, velocity: Array, moving: Array, dt: float
    ) -> tuple[Array, Array]:
        """Joint velocities, none for torques alone, and joint torques (n,)."""
        raise NotImplementedError


class Admittance(UsualController):
    """A mass and a damper along the force: m dv/dt + d v = F_des - F."""

    MASS, DAMPING, FASTEST = 4.0, 120.0, 0.05  # kg, N s/m, m/s
    _speed = 0.0

    def press(
        self, lever: Array, square: float, size: float, force: float, velocity: Array, moving: Array, dt: float
    ) -> tuple[Array, Array]:
        """Joint velocities of the admittance."""
        self._speed += (size - force - self.DAMPING * self._speed) / self.MASS * dt
        self._speed = min(max(self._speed, -self.FASTEST), self.FASTEST)
        return velocity + lever * (self._speed / square), np.zeros(len(lever))


class TorqueControl(UsualController):
    """The torque of the force, an integral of what is missing of it, and damping of the joints."""

    INTEGRAL, SHARE, DAMPING, STIFFNESS = 4.0, 1.0, 4.0, 20.0  # 1/s, of the force, N m s/rad, N m/rad
    _missing = 0.0

    def press(
        self, lever: Array, square: float, size: float, force: float, velocity: Array, moving: Array, dt: float
    ) -> tuple[Array, Array]:
        """Joint torques alone; `velocity` goes to the posture of the start."""
        most = self.SHARE * size
        self._missing = min(max(self._missing + self.INTEGRAL * (size - force) * dt, -most), most)
        held = 0.5 * self.STIFFNESS * velocity
        return np.zeros(0), lever * (size + self._missing) + held - self.DAMPING * moving

"""Predictions for a press from the recorded parameters: the friction node at the contact, the guard's domain.

The arm is reduced to the node of figure 5.4 along the commanded force.  Joints move as the force loop moves
them, dq/dx = J^T d/|J^T d|^2, which gives friction and damping by conservation of power; stiffness and inertia
are the apparent ones along d.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from wam_analysis.findings.finding import shown
from wam_analysis.recorded import PredictionParameters
from wam_analysis.thresholds import HOLD
from wam_bag.arrays import Numbers
from wam_control.force.force_loop_parameters import force_law, task_of
from wam_control.force.guard import Supervision, margin_text
from wam_control.force.stability_guard import GuardAssessment, GuardedContact, StabilityGuard, posture_of
from wam_description.arm import Arm
from wam_description.parameters import ParameterError
from wam_description.rigid_body import RigidBody
from wam_theory import linear_loop, regimes, stiction


class PressedPoint(NamedTuple):
    """Where an arm in a pose, q in rad, presses: on a cover, m from its start, along a unit axis of the base frame."""

    body: RigidBody
    q: Sequence[float]
    cover: str
    position: float
    axis: Numbers

    @property
    def torque(self) -> Numbers:
        """Of the joints per newton, (n,), m."""
        return self.axis @ self.body.point_jacobian(self.q, self.cover, (self.position, 0.0, 0.0))


class Node(NamedTuple):
    """The friction node at the contact, along the force: SI units with N and m.

    Attributes
    ----------
    transmission_stiffness, contact_stiffness : k_tr, k_c, N/m; k_c NaN if the surface is not known.
    inertia : J_l, kg, of the joint side.
    damping : b, N s/m, of joints, cables and surface together; the motor is taken as slow.
    driven_stiffness : k_tr in series with the velocity loops, N/m: the integral term of each acts as a spring about the
        commanded path.  k_tr alone where they are not known.
    static_friction, dynamic_friction : N.
    joint_per_metre : (n,), dq/dx, rad/m.
    """

    transmission_stiffness: float
    driven_stiffness: float
    contact_stiffness: float
    inertia: float
    damping: float
    static_friction: float
    dynamic_friction: float
    joint_per_metre: Numbers


class Predicted(NamedTuple):
    """Predictions of chapter 5 for a node under integral force control; NaN where it has none.

    Attributes
    ----------
    force_peak_to_peak, period : stiction cycle of F_c, N and s, (5.8), (5.9) corrected, with the driven stiffness;
        NaN where (5.11) is too large for them, or nothing cycles.
    actuator_peak_to_peak : Coulomb cycle of the motor, m at the contact, (5.20).
    """

    force_peak_to_peak: float = math.nan
    period: float = math.nan
    actuator_peak_to_peak: float = math.nan


def node_at(recorded: PredictionParameters, press: PressedPoint) -> Node | None:
    """The node at a contact, with the recorded surface and velocity loops; None if the arm cannot press there so."""
    body, arm, q, along = press.body, press.body.arm, press.q, press.torque
    square = float(along @ along)
    if square <= 1e-6:
        return None
    at_joints = arm.transmission.at_joints
    cables = at_joints(arm.cables.damping)
    inertia = body.mass_matrix(q) + arm.pulleys
    gives, servo = float(along @ np.linalg.solve(arm.stiffness, along)), recorded.servo
    yields = servo is not None and all(gain > 0.0 for gain in servo.integral_gain)
    driven = float(along @ np.linalg.solve(at_joints(servo.integral_gain), along)) if servo and yields else 0.0
    moves = along / square
    surface, damping = _surface(recorded, arm, press.cover, press.position)
    return Node(
        transmission_stiffness=1.0 / gives,
        driven_stiffness=1.0 / (gives + driven),
        contact_stiffness=surface,
        inertia=1.0 / float(along @ np.linalg.solve(inertia, along)),
        damping=float(moves @ (np.diag(arm.joints.viscous_friction) + cables) @ moves) + damping,
        static_friction=float(np.array(arm.joints.static_friction) @ np.abs(moves)),
        dynamic_friction=float(np.array(arm.joints.dynamic_friction) @ np.abs(moves)),
        joint_per_metre=moves,
    )


def _surface(recorded: PredictionParameters, arm: Arm, cover: str, position: float) -> tuple[float, float]:
    """Stiffness, N/m, and damping, N s/m: of the spring under the joint, else of the obstacles if all have the same."""
    link = arm.covers.links[arm.covers.names.index(cover)]
    joint = arm.joints.names[arm.links.names.index(link)]
    if recorded.world is None:
        return math.nan, 0.0
    springs, obstacles = recorded.world.springs, recorded.world.obstacles
    for name, stiffness, lever in zip(springs.joints, springs.stiffness, springs.lever, strict=True):
        if name == joint and stiffness > 0.0 and position > 0.0:
            return stiffness * (lever / position) ** 2, 0.0
    found = set(zip(obstacles.stiffness, obstacles.damping, strict=True))
    return found.pop() if len(found) == 1 else (math.nan, 0.0)


def predict(node: Node, gain: float, proportional_gain: float) -> Predicted:
    """Predictions of chapter 5 for a node.

    Parameters
    ----------
    node : with all numbers known.
    gain, proportional_gain : G_I, m/s/N, and G_P, m/N, used in Routh's criterion only, (5.23).
    """
    j, b, ktr, kc = node.inertia, node.damping, node.transmission_stiffness, node.contact_stiffness
    if not (gain > 0.0 and b > 0.0 and math.isfinite(kc)):
        return Predicted()
    fs, fd = node.static_friction, node.dynamic_friction
    zeta = float(linear_loop.damping_ratio(j, b, ktr, kc))
    gamma = float(linear_loop.gain_ratio(gain, j, b, ktr, kc, proportional_gain))
    driven = node.driven_stiffness
    damped = float(linear_loop.damping_ratio(j, b, driven, kc))
    size = float(stiction.stiction_cycle_force(driven, kc, fs, fd, damped))
    period = float(stiction.stiction_cycle_period(gain, driven, kc, fs, fd, damped))
    if float(stiction.stiction_cycle_number(gain, j, b, ktr, kc)) > HOLD.certain or math.isinf(period):
        size = period = math.nan
    actuator = float(regimes.actuator_cycle(fd, ktr, gamma, zeta))
    return Predicted(size, period, actuator)


class Guarded(NamedTuple):
    """The guard's result for the sampled loop with its velocity loops, see `wam_control.force.sampled_loop`.

    Attributes
    ----------
    assessment : at this contact.
    surface : its stiffness, N/m.
    posture : of this contact, in words.
    """

    assessment: GuardAssessment
    surface: float
    posture: str

    @property
    def sentence(self) -> str:
        """The result as a sentence."""
        domain, scale = self.assessment.domain, self.assessment.scale
        stable = "linearly stable with up to" if scale >= 1.0 else "NOT linearly stable with more than"
        return (
            f"Stability guard (sampled loop with its velocity loops, contact of {shown(self.surface)} N/m, "
            f"{self.posture}): domain {domain}, {stable} {margin_text(scale, digits=3)} times the gains at the start."
        )


def admitted(recorded: PredictionParameters) -> tuple[PredictionParameters, str]:
    """The parameters with the gains that the guard admitted at the start, and in words which of them it had lowered."""
    own = recorded.of_force_loop
    if own is None or own[-1].guard.mode != "limit":
        return recorded, ""
    try:
        found = Supervision(*own, ())
    except ParameterError:
        return recorded, ""
    return recorded._replace(force_loop=found.parameters), found.lowered


def guarded(recorded: PredictionParameters, press: PressedPoint, surface: float) -> Guarded | None:
    """Evaluate the recorded gains of the force loop; None if the bag has too few parameters.

    Parameters
    ----------
    surface : stiffness of what is pressed, N/m; NaN takes that of the guard's parameters.
    """
    own = recorded.of_force_loop
    if own is None or own[-1].mode != "hybrid":
        return None
    arm, servo, timing, loop = own
    parameters = loop.guard
    if math.isfinite(surface):
        parameters = replace(parameters, contact_stiffness=surface)
    x, y, z = press.axis.tolist()
    law = force_law(loop)
    try:
        guard = StabilityGuard(arm, servo, timing, parameters, loop.sensing)
    except ParameterError:
        return None
    contact = GuardedContact(tuple(press.q), press.cover, press.position, 0.0, (x, y, z), HOLD.typical_press)
    touches = guard.with_lever(contact)
    if not touches or not any((*law.gain, *law.proportional_gain)):
        return None
    posture = posture_of(touches[0]._replace(q=tuple(np.round(press.q, 3))))
    return Guarded(guard.assess(task_of(loop), tuple(touches)), parameters.contact_stiffness, posture)

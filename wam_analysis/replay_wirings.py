"""How each node feeds its machine, for replays: what starts a step, what it needs, what comes out.

The same stands in each shell, with messages in place of recorded numbers; that both do the same is under
test, bit for bit.  The driver is not here: it is enabled, paused and stopped by services, which no bag holds.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final, NamedTuple

from wam_control.contact_estimator import ContactEstimator, ContactEstimatorParameters
from wam_control.dither import Dither
from wam_control.force_loop import ForceCommand, ForceLoop, ForceLoopParameters
from wam_control.transform import Transform
from wam_control.velocity_loop import VelocityLoop, VelocityLoopParameters
from wam_description.arm import Shared, seconds
from wam_description.parameters import Nothing
from wam_description.rigid_body import RigidBody
from wam_description.signals import NO_CONTACT, Contact, State
from wam_ros.lockstep import Need

BASE: Final = "base"
ZERO: Final = (0.0, 0.0, 0.0)
WITH_STAMP: Final = ("motor_velocity_command", "motor_effort_command", "force_command")  # of which the age counts

Said = Mapping[str, tuple[Sequence[float], str]]  # by topic: numbers and frame
Work = Callable[[int, float, Mapping[str, Any]], Said]  # of stamp, dt and inputs


class Step(NamedTuple):
    """A kind of work of a node: what starts it, what it needs, what it does."""

    trigger: str
    needs: Mapping[str, Need]
    work: Work


class Wiring(NamedTuple):
    """A node's parameters, and the steps of a machine that is made of them."""

    parameters: type
    steps: Callable[[Shared, Any], list[Step]]


def _streamed(shared: Shared, *chain: str) -> bool:
    return set(chain) <= set(shared.nodes)


def _velocity_loop(shared: Shared, own: VelocityLoopParameters) -> list[Step]:
    loop, delay = VelocityLoop(shared.arm.motors, own), shared.timing.outer_delay
    dither = Dither(shared.arm, shared.timing, own.dither)
    still = [0.0] * len(shared.arm.motors.names)

    def work(stamp: int, dt: float, inputs: Mapping[str, Any]) -> Said:
        motors = inputs["motor_states"]
        cause, velocity = inputs["motor_velocity_command"] or (stamp, State([], still, []))
        _, effort = inputs["motor_effort_command"] or (stamp, State([], [], still))
        age, feedforward = seconds(stamp - cause), dither.added(stamp, effort.effort)
        currents = loop.step(motors.velocity, motors.effort, velocity.velocity, age, feedforward, dt)
        return {"motor_current_command": (currents, "")}

    needs = {
        "motor_velocity_command": Need(True, delay, _streamed(shared, "transform", "force_loop")),
        "motor_effort_command": Need(True, delay, _streamed(shared, "transform", "gravity")),
    }
    return [Step("motor_states", needs, work)]


def _transform(shared: Shared, _: Nothing) -> list[Step]:
    transform, none = Transform(shared.arm), [0.0] * len(shared.arm.joints.names)

    def states(stamp: int, _: float, inputs: Mapping[str, Any]) -> Said:
        if not shared.timing.is_outer(stamp):
            return {}
        joints = transform.joint_state(inputs["motor_states"])
        return {"joint_states": ([*joints.position, *joints.velocity, *joints.effort], "")}

    def velocity(_: int, __: float, inputs: Mapping[str, Any]) -> Said:
        return {"motor_velocity_command": (transform.motor_velocity(inputs["joint_velocity_command"].velocity), "")}

    def effort(_: int, __: float, inputs: Mapping[str, Any]) -> Said:
        command = inputs["joint_effort_command"]
        added = command.effort if command else none
        return {"motor_effort_command": (transform.motor_effort(inputs["gravity_effort"].effort, added), "")}

    wanted = {"joint_effort_command": Need(outer=True, streamed=_streamed(shared, "force_loop"))}
    return [
        Step("motor_states", {}, states),
        Step("joint_velocity_command", {}, velocity),
        Step("gravity_effort", wanted, effort),
    ]


def _gravity(shared: Shared, _: Nothing) -> list[Step]:
    body = RigidBody(shared.arm)

    def work(_: int, __: float, inputs: Mapping[str, Any]) -> Said:
        return {"gravity_effort": (body.gravity_torque(inputs["joint_states"].position).tolist(), "")}

    return [Step("joint_states", {}, work)]


def _force_loop(shared: Shared, own: ForceLoopParameters) -> list[Step]:
    loop = ForceLoop(shared.arm, own, shared.timing)

    def work(stamp: int, dt: float, inputs: Mapping[str, Any]) -> Said:
        external, posture, torque = (
            inputs[name] for name in ("external_joint_torques", "joint_posture_command", "joint_torque_command")
        )
        asked = inputs["force_command"]
        cause, (frame, force, _) = asked or (stamp, (BASE, ZERO, ZERO))
        out = loop.step(
            inputs["joint_states"],
            inputs.get("joint_sensors"),
            _contact(inputs["contact/wrench"], inputs["contact/point"], inputs["contact/spread"]),
            external.effort if external else None,
            ForceCommand(frame, force) if asked else None,
            seconds(stamp - cause),
            posture.position if posture else None,
            torque.effort if torque else None,
            dt,
        )
        forces = {"force_measured": out.measured, "force_error": out.error, "force_error_limited": out.limited}
        return {
            "joint_velocity_command": (out.velocity, ""),
            "joint_effort_command": (out.effort, ""),
            **{topic: ([*value, *ZERO], frame) for topic, value in forces.items()},
        }

    estimated = Need(True, streamed=_streamed(shared, "contact_estimator"))
    played = Need(True, streamed=_streamed(shared, "scenario"))
    felt = ("external_joint_torques", "contact/wrench", "contact/point", "contact/spread")
    needs = dict.fromkeys(felt, estimated)
    needs |= dict.fromkeys(("force_command", "joint_posture_command"), played)
    needs["joint_torque_command"] = Need(True, streamed=False)
    if shared.arm.joint_sensors:
        needs["joint_sensors"] = Need(outer=False)
    return [Step("joint_states", needs, work)]


def _contact(wrench: Any, point: Any, spread: Any) -> Contact:
    if wrench is None or point is None or wrench[0] == BASE:
        return NO_CONTACT
    return Contact(wrench[0], point[0], wrench[1], *(spread[:2] if spread else ()))


def _contact_estimator(shared: Shared, own: ContactEstimatorParameters) -> list[Step]:
    estimator = ContactEstimator(shared.arm, shared.timing, own)

    def work(stamp: int, dt: float, inputs: Mapping[str, Any]) -> Said:
        estimator.observe(inputs["motor_states"], inputs.get("joint_sensors"), dt)
        if not shared.timing.is_outer(stamp):
            return {}
        estimate = estimator.estimate()
        frame = estimate.link or BASE
        return {
            "external_joint_torques": (estimate.external_torques, ""),
            "external_joint_torques_sd": (estimate.torque_sd, ""),
            "contact/wrench": ([*estimate.force, *estimate.moment], frame),
            "contact/point": ([estimate.place, 0.0, 0.0], frame),
            "contact/spread": ([estimate.place_sd, estimate.probability, estimate.direction_sd], frame),
        }

    needs = {"joint_sensors": Need(outer=False)} if own.use_joint_sensors else {}
    return [Step("motor_states", needs, work)]


WIRINGS: Final = {
    "velocity_loop": Wiring(VelocityLoopParameters, _velocity_loop),
    "transform": Wiring(Nothing, _transform),
    "gravity": Wiring(Nothing, _gravity),
    "force_loop": Wiring(ForceLoopParameters, _force_loop),
    "contact_estimator": Wiring(ContactEstimatorParameters, _contact_estimator),
}

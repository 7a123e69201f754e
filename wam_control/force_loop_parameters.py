"""Parameters of the force loop, and the laws that they make."""

from dataclasses import dataclass

from wam_control.force_law import ForceLaw
from wam_control.sampled_loop import Feedback
from wam_control.stability_guard import GuardParameters, Task
from wam_description.parameters import parameter

AXES = ("x", "y", "z")  # of the force command's frame


@dataclass(frozen=True)
class ForceLoopParameters:
    """Gains and limits of the force loop."""

    guard: GuardParameters
    mode: str = parameter(
        "hybrid: force along its direction, posture elsewhere; joint_torque: torque of each joint; "
        "open_loop: J^T F fed forward, no feedback",
        choices=("hybrid", "joint_torque", "open_loop"),
        live=True,
    )
    feedback: str = parameter(
        "where F_c comes from", choices=("joint_sensors", "contact_estimate", "joint_position"), live=True
    )
    force_gain: tuple[float, ...] = parameter(
        "G_I of each axis x y z of the force command's frame, or one for all: velocity per force error",
        "m/s/N",
        low=0.0,
        live=True,
    )
    force_proportional_gain: tuple[float, ...] = parameter(
        "G_P of each axis (5.23), or one for all: displacement per force error", "m/N", low=0.0, live=True
    )
    force_error_limit: tuple[float, ...] = parameter(
        "saturation of F_error of each axis, or one for all; above the deadband", "N", low=0.0, live=True
    )
    force_deadband: tuple[float, ...] = parameter(
        "deadband at the input of G_I of each axis (5.7), or one for all", "N", low=0.0, live=True
    )
    force_limit: float = parameter("largest force that may be asked for", "N", low=0.0, live=True)
    torque_gain: tuple[float, ...] = parameter(
        "G_I of each joint in the joint_torque mode, or one for all", "rad/s/(N m)", low=0.0, live=True
    )
    torque_proportional_gain: tuple[float, ...] = parameter(
        "G_P of each joint, or one for all", "rad/(N m)", low=0.0, live=True
    )
    torque_error_limit: tuple[float, ...] = parameter(
        "saturation of the torque error of each joint, or one for all; above the deadband", "N m", low=0.0, live=True
    )
    torque_deadband: tuple[float, ...] = parameter(
        "deadband at the input of each joint's G_I, or one for all", "N m", low=0.0, live=True
    )
    torque_limit: float = parameter("largest torque of a joint that may be asked for", "N m", low=0.0, live=True)
    delay_samples: int = parameter(
        "outer periods for which the velocity of the law is held back; zero answers at once", low=0, high=20, live=True
    )
    blend_time: float = parameter(
        "time constant with which the velocity goes over from what it was to what the law asks for, when a command "
        "begins or ends, the mode or a gain is changed, or the motors start; zero for at once",
        "s",
        low=0.0,
        live=True,
    )
    posture_gain: float = parameter("joint velocity per posture error", "1/s", low=0.0, live=True)
    joint_speed_limit: float = parameter(
        "largest joint speed that posture and force ask for", "rad/s", low=0.0, live=True
    )
    force_filter: float = parameter("time constant of the low pass on the measured force", "s", low=0.0, live=True)
    spring_stiffness: tuple[float, ...] = parameter(
        "stiffness of a known spring at each joint, for the feedback joint_position", "N m/rad", low=0.0, live=True
    )
    spring_rest: tuple[float, ...] = parameter("joint angle at which that spring is not pressed", "rad", live=True)
    command_timeout: float = parameter(
        "age at which a force command no longer counts and the arm holds where it is", "s", low=0.001, live=True
    )
    contact_cover: str = parameter("cover that is taken to touch while no contact is felt", live=True)
    contact_place: float = parameter("place on it", "m", live=True)
    schedule: str = parameter(
        "off: the gains stay; place: the gains follow the estimated place so that the margin stays what it is at "
        "contact_place, and fall back to the worst place of the cover where the estimate is not sure",
        choices=("off", "place"),
        live=True,
    )
    place_uncertainty_limit: float = parameter(
        "standard deviation of an estimated place up to which it is sure", "m", low=0.0, live=True
    )
    link_probability_limit: float = parameter(
        "probability of the touched link from which its place is sure", low=0.0, high=1.0, live=True
    )


def force_law(parameters: ForceLoopParameters) -> ForceLaw:
    """The law of the axes of the force's frame."""
    return ForceLaw(
        "force",
        AXES,
        parameters.force_gain,
        parameters.force_proportional_gain,
        parameters.force_error_limit,
        parameters.force_deadband,
    )


def torque_law(parameters: ForceLoopParameters, joints: tuple[str, ...]) -> ForceLaw:
    """The law of the joints."""
    return ForceLaw(
        "torque",
        joints,
        parameters.torque_gain,
        parameters.torque_proportional_gain,
        parameters.torque_error_limit,
        parameters.torque_deadband,
    )


def task_of(parameters: ForceLoopParameters, law: ForceLaw) -> Task:
    """What the guard has to know of a set."""
    is_joints = parameters.mode == "joint_torque"
    return Task(
        law=law,
        is_joints=is_joints,
        feedback=Feedback(parameters.feedback, parameters.spring_stiffness, parameters.guard.feedback_lag),
        hold_gain=parameters.posture_gain,
        filter_time=0.0 if is_joints else parameters.force_filter,
        delay_samples=parameters.delay_samples,
    )

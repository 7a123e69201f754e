"""Parameters of the force loop, and the laws built from them."""

import math
from dataclasses import dataclass, replace
from functools import cached_property

from wam_control.force.force_axis import SensingParameters
from wam_control.force.force_law import ForceLaw
from wam_control.force.sampled_loop import Feedback
from wam_control.force.stability_guard import GuardedTask, GuardParameters
from wam_control.force.task import TaskParameters
from wam_control.force.thresholds import FORCE
from wam_description.arm import Arm
from wam_description.parameters import lengths, parameter, require

AXES = ("x", "y", "z")  # of the force command's frame


@dataclass(frozen=True)
class LimitParameters:
    """Where the force loop stops the arm."""

    joint_gain: float = parameter(
        "largest speed of a joint towards its limit, per distance from the limit; 0: joint limits are not watched",
        "1/s",
        high=100.0,
    )
    joint_acceleration: float = parameter(
        "largest acceleration of a joint by commands, except away from a push; 0: no limit",
        "rad/s^2",
        high=1e4,
    )
    joint_margin: float = parameter("distance from its limit at which a joint has to stop", "rad", high=1.0)
    contact_force: float = parameter("largest measured force on the arm; above it the arm moves away", "N")
    whole_force: float = parameter(
        "largest magnitude of the force at the contact, in all directions together, as a multiple of the commanded "
        "force; above it the arm moves away",
    )
    impact: float = parameter(
        "largest predicted impact (3.1) on a surface of guard.contact_stiffness, as a multiple of the commanded "
        "force; it limits the speed before the contact; 0: no limit",
        high=1e3,
    )
    settling_time: float = parameter("time after which a force that is still not reached is reported", "s", low=1e-3)
    free_travel: float = parameter(
        "largest travel along a commanded force that is not reached; also largest travel against this force under a "
        "push. Beyond it, the arm holds its position",
        "m",
    )
    tolerance: float = parameter(
        "tolerated error of a force, as a fraction of the commanded force; with a smaller error the force counts as "
        "reached",
    )
    doubt: float = parameter(
        "largest ratio of predicted to tolerated error with which a force is applied; with a larger limit fewer "
        "forces are refused and more are wrong",
        low=0.01,
    )
    cycle_force: float = parameter(
        "smallest limit cycle that is reported: measured force, peak to peak, as a fraction of the commanded force",
    )
    surface_speed: float = parameter(
        "expected speed of the surface along the force; the force lags behind the motion, which counts as an error",
        "m/s",
        high=10.0,
    )
    slide_speed: float = parameter(
        "expected speed of the surface across the force; a sloping surface then also moves along the force, which "
        "counts as an error",
        "m/s",
        high=10.0,
    )


@dataclass(frozen=True)
class ForceLoopParameters:
    """Gains and limits of the force loop."""

    are_live = True
    guard: GuardParameters
    sensing: SensingParameters
    limits: LimitParameters
    task: TaskParameters
    mode: str = parameter(
        "hybrid: control of the force in its direction, of the posture in all others; open_loop: J^T F fed forward, no "
        "feedback",
        choices=("hybrid", "open_loop"),
    )
    feedback: str = parameter(
        "source of the measured force F_c", choices=("joint_sensors", "contact_estimate", "joint_position")
    )
    force_gain: tuple[float, ...] = parameter(
        "G_I of each axis x y z of the force command's frame, or one for all: velocity per force error",
        "m/s/N",
        high=100.0,
    )
    force_proportional_gain: tuple[float, ...] = parameter(
        "G_P of each axis (5.23), or one for all: position per force error", "m/N", high=100.0
    )
    force_error_limit: tuple[float, ...] = parameter(
        "saturation of F_error of each axis, or one for all; it must exceed the deadband", "N"
    )
    force_deadband: tuple[float, ...] = parameter(
        "deadband at the input of G_I of each axis (5.7), or one for all", "N", high=1e3
    )
    force_limit: float = parameter("largest force that may be commanded", "N", high=1e3)
    torque_gain: tuple[float, ...] = parameter(
        "G_I of each joint whose torque is commanded, or one for all", "rad/s/(N m)", high=100.0
    )
    torque_proportional_gain: tuple[float, ...] = parameter(
        "G_P of each joint, or one for all", "rad/(N m)", high=100.0
    )
    torque_error_limit: tuple[float, ...] = parameter(
        "saturation of the torque error of each joint, or one for all; it must exceed the deadband", "N m"
    )
    torque_deadband: tuple[float, ...] = parameter(
        "deadband at the input of each joint's G_I, or one for all", "N m", high=1e3
    )
    torque_limit: float = parameter("largest joint torque that may be commanded", "N m", high=1e3)
    delay_samples: int = parameter(
        "additional delay of the velocity that the force law commands, in outer periods", high=20
    )
    force_feedforward: float = parameter(
        "fraction of the torque of the commanded force that is fed forward at once, as in the thesis; it "
        "accelerates a free arm towards the surface",
        high=1.0,
    )
    friction_feedforward: float = parameter(
        "fraction of the model's dry friction that is fed forward along the commanded motion during a "
        "force; none with feedback contact_estimate",
        high=1.0,
    )
    posture_gain: float = parameter("joint velocity per error of the posture", "1/s", high=1e3)
    joint_speed_limit: float = parameter(
        "largest joint speed that is commanded for posture and force", "rad/s", high=1e3
    )
    force_filter: float = parameter("time constant of the low pass on the measured force", "s", high=10.0)
    spring_stiffness: tuple[float, ...] = parameter(
        "stiffness of a known spring at each joint, for the feedback joint_position", "N m/rad"
    )
    spring_rest: tuple[float, ...] = parameter("joint angle at which this spring is relaxed", "rad", within=13.0)
    contact_source: str = parameter(
        "where the force acts. pinned: at contact_position; estimated: at the estimated contact, if that is certain "
        "enough. If a force command in a cover's frame has a torque, this torque gives the position in both cases",
        choices=("estimated", "pinned"),
    )
    contact_cover: str = parameter("cover that is assumed in contact while no contact is detected")
    contact_position: float = parameter("assumed contact position along that cover", "m", high=3.0)
    contact_position_sd: float = parameter(
        "standard deviation of a pinned contact position",
        "m",
        high=1.0,
    )
    link_probability_limit: float = parameter(
        "smallest probability of the estimated link with which the estimated contact position is used",
        high=1.0,
    )

    @cached_property
    def is_estimated(self) -> bool:
        """Whether the estimated torques are fed back, in place of those of sensors."""
        return self.feedback == "contact_estimate"

    @cached_property
    def sensing_fed_back(self) -> SensingParameters:
        """How the force is sensed with this feedback."""
        given = self.sensing
        if not self.is_estimated:
            return given
        return replace(given, torque_sd=given.estimated_torque_sd, torque_fraction=given.estimated_torque_fraction)

    @cached_property
    def latency(self) -> float:
        """By how much the measured force is late, s."""
        return max(self.force_filter + self.guard.feedback_lag * self.is_estimated, FORCE.negligible)

    @cached_property
    def rise_time(self) -> float:
        """Time in which the force on the stiffest surface may rise, s: some latencies of the measured force."""
        return (FORCE.ramp + FORCE.shown) * self.latency

    def impact_energy(self, force: float) -> float:
        """Kinetic energy, J, with the impact (3.1) that `limits.impact` allows at a force, N; infinite if it is 0."""
        own = self.limits
        return (own.impact * force) ** 2 / (2.0 * self.guard.contact_stiffness) if own.impact else math.inf

    def require_fit(self, arm: Arm) -> None:
        """Refuse parameters that do not fit the arm.

        Raises
        ------
        ParameterError
            names the parameter and what is allowed.
        """
        covers = arm.covers.names
        require(
            self.contact_cover in covers,
            f"contact_cover is '{self.contact_cover}'; allowed: {', '.join(covers)}",
        )
        length = arm.covers.length_of(self.contact_cover)
        require(
            self.contact_position <= length,
            f"contact_position is {self.contact_position:g} m; allowed: 0 to {length:g}, on {self.contact_cover}",
        )
        slowest = min(arm.joints.speed_limit)
        require(
            self.joint_speed_limit <= slowest or self.guard.mode in ("off", "warn"),
            f"joint_speed_limit is {self.joint_speed_limit:g} rad/s; the driver stops the arm at "
            f"arm.joints.speed_limit; allowed: 0 to {slowest:g}",
        )
        require(
            self.is_estimated or arm.joint_sensors,
            f"feedback is '{self.feedback}' but arm.joint_sensors is false; use 'contact_estimate'",
        )
        force_law(self)  # a law refuses what does not fit it
        torque_law(self, arm.joints.names)
        springs = {"spring_stiffness": self.spring_stiffness, "spring_rest": self.spring_rest}
        lengths("force_loop", arm.joints.names, springs)
        require(
            self.feedback != "joint_position" or any(self.spring_stiffness),
            "feedback is 'joint_position' but spring_stiffness is 0 at each joint, so that no force is measured; give "
            "the stiffness, N m/rad, of the known spring that the arm presses, or use 'joint_sensors' or "
            "'contact_estimate'",
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


def task_of(parameters: ForceLoopParameters) -> GuardedTask:
    """What the guard needs to know of a parameter set."""
    return GuardedTask(
        law=force_law(parameters),
        feedback=Feedback(parameters.feedback, parameters.spring_stiffness, parameters.guard.feedback_lag),
        hold_gain=parameters.posture_gain,
        filter_time=parameters.force_filter,
        delay_samples=parameters.delay_samples,
    )

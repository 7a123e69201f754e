"""The table of topics: every topic of the stack, one row each.

Names are relative to the arm's namespace, except those that begin with '/'.  Who publishes and who
subscribes follows from the declarations of the nodes (`wam_description.nodes`); `docs/topics.md` is
written from both, nodes take their types and QoS from here, the recorder records every row.
"""

from functools import cache
from typing import Any, Final, NamedTuple

from wam_description.signals import ObjectState

JOINT_STATE, WRENCH, POINT = (
    "sensor_msgs/msg/JointState",
    "geometry_msgs/msg/WrenchStamped",
    "geometry_msgs/msg/PointStamped",
)
TABLE = "sensor_msgs/msg/PointCloud2"
TRAJECTORY = "trajectory_msgs/msg/JointTrajectory"
BOOL, STRING = "std_msgs/msg/Bool", "std_msgs/msg/String"
TIME = "rosgraph_msgs/msg/Clock"
OF_OWN_NODES: Final = (JOINT_STATE, WRENCH, POINT, TABLE, TRAJECTORY, BOOL, STRING)  # types that a node may add
RATES: Final = ("inner", "outer", "display", "latched", "1 Hz")
SIDES: Final = ("motors", "joints")
EVERY_NODE: Final = ("status", "/diagnostics")  # published by every node, declared by none
STATUS: Final = "status"
DEPTH: Final = 1000  # messages, a second of the inner loop: a late reader loses nothing until then

LINK: Final = "link"  # column with the index of a cover in arm.covers.names
HYPOTHESIS_COLUMNS: Final = (
    LINK,  # index of the cover in arm.covers.names
    "probability",  # of this hypothesis among all
    "position",  # m along the cover, NaN where it cannot be observed
    "position_sd",  # m, NaN where the position is
    "low",  # m, ends of the part of the cover that is in the 90 % set, NaN where no part is
    "high",
    "force_x",  # N, of the world on the link, in the cover's frame
    "force_y",
    "force_z",
    "force_sd",  # N, NaN where the force is a lower bound
    "is_lower_bound",  # 1 where the force is the least one that explains the torques
    "direction",  # rad, angle of the force about the link, from the cover's y to its z axis
    "direction_sd",  # rad
    "moment_x",  # N m, of the force about the origin of the cover's frame
    "moment_y",
    "moment_z",
    "residual",  # chi^2 that the contact leaves unexplained
    "reasons",  # why the position is unknown or the answer is not to be trusted: bits of `wam_description.reasons.Reason`
)

FRICTION_COLUMNS: Final = (
    "positive",  # N m, Coulomb friction in positive motion
    "negative",  # N m, the same in negative motion
    "load",  # friction per torque that the cables transmit
    "positive_sd",  # N m, standard deviations of these
    "negative_sd",
    "load_sd",
)

FORCE_AXIS: Final = {  # columns of the table, and what they mean
    "event": "number of `wam_description.event.Code`; 0 if the command is obeyed",
    "holds": "1 if the arm holds its position because of the event",
    "doubt": "predicted force error divided by the tolerated force error",
    "tolerance": "tolerated force error, N",
    "torques": "part of the predicted force error by errors of the measured torques, N",
    "friction": "part by friction of the surface, and by other forces of a task, N",
    "place": "part by the error of the contact position, or of the link, N",
    "resting": "part by external torques from before the touch, N",
    "moving_surface": "part by the lag of the force behind a moving surface, N",
    "slow_arm": "N; infinite if the arm would reach the force too slowly, else 0",
    "shaking_arm": "part by vibration of the arm due to the dither, N",
    "force_sd": "standard deviation of the measured force, N; infinite if the force has no lever",
    "lever": "lever arm: norm of the joint torques divided by the force, m",
    "apparent_mass": "measured force divided by the acceleration along it, in free motion, kg",
    "speed_fraction": "velocity along the force divided by the commanded velocity, 0 to 1",
    "position": "contact position along the cover, m",
    "position_sd": "its standard deviation, m",
}

TASK_COLUMNS: Final = (
    "kind",  # number of `wam_control.force.task.AxisKind`: 1 force, 2 velocity, 3 position, 4 impedance
    "joint",  # index of the joint, -1 for a point of a link
    "link",  # index of the cover in arm.covers.names, -1 for a joint
    "position",  # m along the cover; NaN of a force: the estimated position
    "x",  # direction of the axis in the frame of the table; its length does not count
    "y",
    "z",
    "value",  # N, m/s or m; of a joint N m, rad/s or rad; NaN of a position: where it is when the axis begins
    "rate",  # m/s or rad/s at which a commanded position moves
    "stiffness",  # N/m or N m/rad, of an impedance
    "damping",  # N s/m or N m s/rad
)
TASK_AXIS_COLUMNS: Final = (
    "kind",
    "commanded",  # the value in force
    "measured",  # N, m/s or m; of a joint N m, rad/s or rad
    "force_sd",  # N or N m, standard deviation of the measured force; NaN for a motion
    "speed_fraction",  # velocity along the axis per commanded one, 0 to 1
)

# Magnitudes that no arm reaches, by quantity, also in an experiment without limits: a message with more is refused
# whole.  What is computed from less stays finite.
LARGEST: Final = {
    "position": 1e6,  # rad, of motors too, which turn on without stops
    "velocity": 1e6,  # rad/s
    "effort": 1e12,  # N m, or A where the topic carries amperes
    "force": 1e9,  # N
    "torque": 1e9,  # N m
    "point": 1e3,  # m
}
LARGEST_ESTIMATE: Final = 1e12  # in a column of the contact hypotheses, whatever its unit
LARGEST_ELSEWHERE: Final = 1e100  # in other tables
_NEVER_UNKNOWN: Final = (LINK, "probability", "force_x", "force_y", "force_z", "moment_x", "moment_y", "moment_z")


class Column(NamedTuple):
    """What numbers a column of a table may have."""

    name: str
    largest: float  # magnitude
    may_be_unknown: bool  # NaN


@cache
def columns_of(names: tuple[str, ...]) -> tuple[Column, ...]:
    """The columns of a table by their names."""
    if names == TASK_COLUMNS:
        return tuple(Column(name, LARGEST_ESTIMATE, name in ("value", "position")) for name in names)
    known = HYPOTHESIS_COLUMNS
    return tuple(
        Column(name, LARGEST_ESTIMATE if name in known else LARGEST_ELSEWHERE, name not in _NEVER_UNKNOWN)
        for name in names
    )


class Topic(NamedTuple):
    """One row of the table of topics.

    Attributes
    ----------
    name : relative to the arm's namespace, or absolute.
    type : ROS message type.
    rate : 'inner', 'outer', 'display', 'latched' or '1 Hz'.
    doc : what it carries, with units.
    side : 'motors' or 'joints': whose names a JointState carries.
    columns : of a table, float64 each.
    needs_joint_sensors : whether it exists only on an arm with joint-side sensors.
    is_viewed : whether viewers show it.
    """

    name: str
    type: str
    rate: str
    doc: str
    side: str = ""
    columns: tuple[str, ...] = ()
    needs_joint_sensors: bool = False
    is_viewed: bool = False

    def check(self) -> None:
        """Refuse a row that a node cannot add: a type, a rate or a side that does not exist.

        Raises
        ------
        TypeError
            names the topic, the value and what is allowed.
        """
        sides = SIDES if self.type in (JOINT_STATE, TRAJECTORY) else ("",)
        for key, allowed in (("type", OF_OWN_NODES), ("rate", RATES), ("side", sides)):
            if (value := getattr(self, key)) not in allowed:
                words = ", ".join(f"'{word}'" for word in allowed)
                raise TypeError(f"topic '{self.name}': {key} is '{value}'; allowed: {words}")
        if (self.type == TABLE) != bool(self.columns):
            needed = "name its columns" if self.type == TABLE else f"only a {TABLE} has columns"
            raise TypeError(f"topic '{self.name}': columns are {self.columns}; {needed}")

    @property
    def latched(self) -> bool:
        """True where a late subscriber gets the last message (transient local)."""
        return self.rate == "latched"

    @property
    def depth(self) -> int:
        """Messages that a publisher keeps for late readers."""
        return 1 if self.latched else DEPTH

    @property
    def is_replayed(self) -> bool:
        """Whether a replay gives its messages to a node."""
        return self.is_numbers or self.type == TRAJECTORY

    @property
    def is_numbers(self) -> bool:
        """Whether a message is a stamp, a frame and numbers, which the simulation keeps and a replay compares."""
        return self.type in {JOINT_STATE, WRENCH, POINT, TABLE}


def _motors(name: str, rate: str, doc: str) -> Topic:
    return Topic(name, JOINT_STATE, rate, doc, "motors")


def _joints(name: str, rate: str, doc: str, **more: Any) -> Topic:
    return Topic(name, JOINT_STATE, rate, doc, "joints", **more)


TOPICS: Final = (
    _motors("motor_states", "inner", "motor1..N: rad, rad/s, effort = motor torque in N m"),
    _motors("motor_currents", "outer", "effort = measured current in AMPERES"),
    _motors("motor_current_command", "inner", "effort = commanded current in AMPERES"),
    _joints(
        "joint_sensors",
        "inner",
        "joint1..N: angle and velocity from joint-side encoders, rad and rad/s; effort = torque from strain gauges on "
        "the link side of the joint friction, N m",
        needs_joint_sensors=True,
    ),
    _joints(
        "joint_states",
        "outer",
        "joint1..N: rad, rad/s, effort = motor torque converted to the joint, N m",
        is_viewed=True,
    ),
    _joints("gravity_effort", "outer", "effort = torque that balances gravity, N m"),
    _joints(
        "joint_velocity_command",
        "outer",
        "joint velocities, rad/s; an empty velocity array commands torque only; without any message the motors are "
        "held at 0 rad/s",
    ),
    _joints(
        "joint_effort_command",
        "outer",
        "torque without gravity, N m; acts only together with a velocity command, which may be empty",
    ),
    _motors("motor_velocity_command", "outer", "motor velocities, rad/s; an empty velocity array commands torque only"),
    _motors("motor_effort_command", "outer", "feed-forward torque with gravity, N m"),
    _joints(
        "joint_posture_command",
        "outer",
        "joint angles, rad; the arm holds them in all directions except that of a commanded force; for a moving "
        "posture also its velocity, rad/s",
    ),
    Topic(
        "joint_trajectory",
        TRAJECTORY,
        "outer",
        "a whole path, rad, in place of `joint_posture_command`; your program repeats it: see docs/ros.md",
        "joints",
    ),
    _joints(
        "joint_torque_command",
        "outer",
        "torque of each joint on the world, N m, in place of force and posture",
    ),
    Topic("force_command", WRENCH, "outer", "force of the arm on the world, N; zero ends it"),
    Topic(
        "task_command",
        TABLE,
        "outer",
        "forces, velocities, positions and impedances along chosen axes, one row each; no row: no task; "
        "float64 columns: see docs/tasks.md",
        columns=TASK_COLUMNS,
    ),
    Topic(
        "task_axes",
        TABLE,
        "display",
        "how well each axis of the task is measured and followed, in the order of `task_command`; float64 columns: "
        "see docs/tasks.md",
        columns=TASK_AXIS_COLUMNS,
    ),
    Topic(
        "force_measured",
        WRENCH,
        "outer",
        "measured force of the arm on the world, along the commanded direction, N",
        is_viewed=True,
    ),
    Topic("force_error", WRENCH, "outer", "F_error, desired minus measured force, before saturation, N"),
    Topic("force_error_limited", WRENCH, "outer", "F_error after saturation, N"),
    Topic(
        "force_axis",
        TABLE,
        "display",
        "how well the commanded force is measured and held; frame = the cover; no row without a command; "
        "published also at each new event; float64 columns: see below",
        columns=tuple(FORCE_AXIS),
    ),
    _joints(
        "external_torque_zero",
        "outer",
        "effort = torques of the joint sensors that count as zero force, N m. They are set by `wam call tare` and when "
        "a force begins. The estimator corrects its modelled masses with them",
    ),
    _joints("external_joint_torques", "outer", "effort = estimated torque of the world on the joints, N m"),
    _joints("external_joint_torques_sd", "outer", "effort = standard deviation of `external_joint_torques`, N m"),
    Topic(
        "contact/wrench",
        WRENCH,
        "outer",
        "estimated force of the world on the touched link, frame = its cover, N; frame base without contact",
    ),
    Topic(
        "contact/point",
        POINT,
        "outer",
        "x = estimated position of the contact along the touched link in m, NaN where it cannot be observed",
    ),
    Topic(
        "contact/hypotheses",
        TABLE,
        "outer",
        "one row per link, the most probable first; no row without contact; float64 columns: see docs/estimator.md",
        columns=HYPOTHESIS_COLUMNS,
        is_viewed=True,
    ),
    Topic(
        "contact/tracked_friction",
        TABLE,
        "1 Hz",
        "tracked friction, one row per shaft, motors first; only if the estimator uses no joint sensors; float64 "
        "columns: see docs/estimator.md",
        columns=FRICTION_COLUMNS,
    ),
    Topic("contact/in_contact", BOOL, "latched", "true while a contact is detected"),
    Topic(
        "contact/markers",
        "visualization_msgs/msg/MarkerArray",
        "display",
        "the contact as an arrow and a sphere; a band along the links that contains it with 90 % probability",
    ),
    _joints("sim/joint_states", "outer", "truth: joint angles, velocities, torques through the cables", is_viewed=True),
    Topic(
        "sim/contact/wrench",
        WRENCH,
        "outer",
        "truth: force of the world on the link with the largest load; frame = its cover, moment about its origin",
        is_viewed=True,
    ),
    Topic(
        "sim/contact/point",
        POINT,
        "outer",
        "truth: x = position along that link, NaN without contact",
        is_viewed=True,
    ),
    Topic(
        "sim/objects",
        TABLE,
        "outer",
        "truth: one row per free body, door and moving obstacle, if there are any; frame base; float64 "
        "columns: see below",
        columns=ObjectState._fields,
        is_viewed=True,
    ),
    Topic(
        "sim/disturbance",
        WRENCH,
        "outer",
        "a push: force and torque at the origin of the cover that is the frame, N and N m. There is one push at a "
        "time; it ends `ages.command` after the last message, or with another push",
    ),
    Topic("robot_description", STRING, "latched", "URDF of the arm"),
    Topic("status", "diagnostic_msgs/msg/DiagnosticStatus", "latched", "state of each node; each node latches its own"),
    Topic("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", "1 Hz", "counts, timing and refusals of each node"),
    Topic("/clock", TIME, "outer", "time of the arm, strictly increasing"),
)

BY_NAME: Final = {topic.name: topic for topic in TOPICS}

"""The interface table: every topic of the stack, one row each.

Names are relative to the arm's namespace, except those that begin with '/'.  `docs/topics.md` is
written from this table, nodes take their types and QoS from it, the recorder records it.
"""

from typing import NamedTuple


class Topic(NamedTuple):
    """One row of the interface table."""

    name: str
    type: str
    publisher: tuple[str, ...]
    subscribers: tuple[str, ...]
    rate: str  # 'inner', 'outer', 'display', 'latched' or '1 Hz'
    doc: str

    @property
    def latched(self) -> bool:
        """True where a late subscriber gets the last message (transient local)."""
        return self.rate == "latched"


TOPICS: tuple[Topic, ...] = (
    Topic(
        "motor_states",
        "sensor_msgs/msg/JointState",
        ("driver",),
        ("transform", "velocity_loop", "contact_estimator"),
        "inner",
        "motor1..N: rad, rad/s, effort = motor torque in N m",
    ),
    Topic(
        "motor_currents",
        "sensor_msgs/msg/JointState",
        ("driver",),
        (),
        "outer",
        "effort = current that flows, in AMPERES",
    ),
    Topic(
        "motor_current_command",
        "sensor_msgs/msg/JointState",
        ("velocity_loop",),
        ("driver",),
        "inner",
        "effort = current asked for, in AMPERES",
    ),
    Topic(
        "joint_sensors",
        "sensor_msgs/msg/JointState",
        ("driver",),
        ("contact_estimator", "force_loop"),
        "inner",
        "joint1..N: joint-side encoder in rad and rad/s, strain torque on the link side of the friction in N m",
    ),
    Topic(
        "joint_states",
        "sensor_msgs/msg/JointState",
        ("transform",),
        ("gravity", "force_loop", "scenario"),
        "outer",
        "joint1..N: rad, rad/s, effort = motor torque seen at the joint in N m",
    ),
    Topic(
        "gravity_effort",
        "sensor_msgs/msg/JointState",
        ("gravity",),
        ("transform",),
        "outer",
        "effort that carries the links, N m",
    ),
    Topic(
        "joint_velocity_command",
        "sensor_msgs/msg/JointState",
        ("force_loop",),
        ("transform",),
        "outer",
        "rad/s; an empty velocity array asks for torque only",
    ),
    Topic(
        "joint_effort_command",
        "sensor_msgs/msg/JointState",
        ("force_loop",),
        ("transform",),
        "outer",
        "feed-forward torque without gravity, N m",
    ),
    Topic(
        "motor_velocity_command",
        "sensor_msgs/msg/JointState",
        ("transform",),
        ("velocity_loop",),
        "outer",
        "rad/s; an empty velocity array asks for torque only",
    ),
    Topic(
        "motor_effort_command",
        "sensor_msgs/msg/JointState",
        ("transform",),
        ("velocity_loop",),
        "outer",
        "feed-forward torque with gravity, N m",
    ),
    Topic(
        "joint_posture_command",
        "sensor_msgs/msg/JointState",
        ("scenario",),
        ("force_loop",),
        "outer",
        "posture held in the complement of the force, rad",
    ),
    Topic(
        "joint_torque_command",
        "sensor_msgs/msg/JointState",
        (),
        ("force_loop",),
        "outer",
        "joint torques asked for in the joint_torque mode, by a program of yours, N m",
    ),
    Topic(
        "force_command",
        "geometry_msgs/msg/WrenchStamped",
        ("scenario",),
        ("force_loop",),
        "outer",
        "force of the arm on the world, N; zero releases the force axis",
    ),
    Topic(
        "force_measured",
        "geometry_msgs/msg/WrenchStamped",
        ("force_loop",),
        (),
        "outer",
        "force of the arm on the world along the commanded direction, N",
    ),
    Topic(
        "force_error",
        "geometry_msgs/msg/WrenchStamped",
        ("force_loop",),
        (),
        "outer",
        "F_error = F_des - F_c before saturation, N",
    ),
    Topic(
        "force_error_limited",
        "geometry_msgs/msg/WrenchStamped",
        ("force_loop",),
        (),
        "outer",
        "F_error after saturation, N",
    ),
    Topic(
        "external_joint_torques",
        "sensor_msgs/msg/JointState",
        ("contact_estimator",),
        ("force_loop",),
        "outer",
        "effort = torque of the world on the joints, N m",
    ),
    Topic(
        "external_joint_torques_sd",
        "sensor_msgs/msg/JointState",
        ("contact_estimator",),
        (),
        "outer",
        "effort = standard deviation of `external_joint_torques`, N m",
    ),
    Topic(
        "contact/wrench",
        "geometry_msgs/msg/WrenchStamped",
        ("contact_estimator",),
        ("force_loop", "scenario"),
        "outer",
        "force of the world on the touched link, frame = its cover, N",
    ),
    Topic(
        "contact/point",
        "geometry_msgs/msg/PointStamped",
        ("contact_estimator",),
        ("force_loop", "scenario"),
        "outer",
        "x = distance along the touched link in m, NaN where it cannot be observed",
    ),
    Topic(
        "contact/spread",
        "geometry_msgs/msg/PointStamped",
        ("contact_estimator",),
        ("force_loop",),
        "outer",
        "how sure the contact is: x = standard deviation of the place in m, NaN with it; y = probability that this "
        "link is touched; z = standard deviation of the force's angle round the link in rad; NaN without contact",
    ),
    Topic(
        "contact/in_contact",
        "std_msgs/msg/Bool",
        ("contact_estimator",),
        (),
        "latched",
        "whether something touches the arm",
    ),
    Topic(
        "contact/markers",
        "visualization_msgs/msg/MarkerArray",
        ("contact_estimator",),
        (),
        "display",
        "the contact as an arrow and a sphere, and the places that are likely, 90 % in all, as a band along the links",
    ),
    Topic(
        "contact/hypotheses",
        "diagnostic_msgs/msg/DiagnosticArray",
        ("contact_estimator",),
        (),
        "display",
        "one entry a hypothesis: link, place, part of the 90 % set, force, spreads, reason where unknown",
    ),
    Topic(
        "sim/joint_states",
        "sensor_msgs/msg/JointState",
        ("driver",),
        (),
        "outer",
        "truth: joint angles, velocities, torques through the cables",
    ),
    Topic(
        "sim/contact/wrench",
        "geometry_msgs/msg/WrenchStamped",
        ("driver",),
        (),
        "outer",
        "truth: force of the world on the link it loads most, moment about the origin of its cover, the frame",
    ),
    Topic(
        "sim/contact/point",
        "geometry_msgs/msg/PointStamped",
        ("driver",),
        (),
        "outer",
        "truth: x = where along that link, NaN without contact",
    ),
    Topic(
        "sim/disturbance",
        "geometry_msgs/msg/WrenchStamped",
        ("scenario",),
        ("driver",),
        "outer",
        "a push: force at and torque about the origin of the cover named by frame_id",
    ),
    Topic("robot_description", "std_msgs/msg/String", ("driver",), (), "latched", "URDF of the arm"),
    Topic(
        "status",
        "diagnostic_msgs/msg/DiagnosticStatus",
        ("driver", "transform", "velocity_loop", "gravity", "force_loop", "contact_estimator", "scenario", "recorder"),
        ("driver", "scenario", "contact_estimator"),
        "latched",
        "state of each node, latched by each",
    ),
    Topic(
        "/diagnostics",
        "diagnostic_msgs/msg/DiagnosticArray",
        ("driver", "transform", "velocity_loop", "gravity", "force_loop", "contact_estimator", "scenario", "recorder"),
        (),
        "1 Hz",
        "counts, timing and refusals of each node",
    ),
    Topic("/clock", "rosgraph_msgs/msg/Clock", ("driver",), (), "outer", "time of the arm, strictly increasing"),
)

BY_NAME = {topic.name: topic for topic in TOPICS}

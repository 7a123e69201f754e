"""The arm as parameters: what every node of the stack must agree on.

Arrays run over motors, joints, links or covers in the order of the `names` beside them.  Nested
arrays are flattened row by row because ROS parameters know no others.
"""

from dataclasses import dataclass
from functools import cached_property

from wam_description.cables import Cables, Circuit, circuits
from wam_description.parameters import lengths, parameter, require


def _distinct(group: str, names: tuple[str, ...]) -> None:
    require(len(names) > 0, f"parameter '{group}.names' is empty; name at least one")
    require(len(set(names)) == len(names), f"parameter '{group}.names' has a name twice: {', '.join(names)}")


@dataclass(frozen=True)
class Motors:
    """The motors, one per cable circuit."""

    names: tuple[str, ...] = parameter("motor names, as they stand in JointState messages")
    inertia: tuple[float, ...] = parameter("rotor inertia", "kg m^2", low=1e-9)
    torque_constant: tuple[float, ...] = parameter("torque per current", "N m/A", low=1e-6)
    peak_torque: tuple[float, ...] = parameter("torque at which the amplifier clips", "N m", low=0.0)
    continuous_torque: tuple[float, ...] = parameter("torque that can be held for ever", "N m", low=1e-6)
    static_friction: tuple[float, ...] = parameter("breakaway torque of rotor and first pinion", "N m", low=0.0)
    dynamic_friction: tuple[float, ...] = parameter("Coulomb torque while turning", "N m", low=0.0)
    viscous_friction: tuple[float, ...] = parameter("torque per velocity", "N m s/rad", low=0.0)

    def __post_init__(self) -> None:
        _distinct("arm.motors", self.names)
        lengths("arm.motors", self.names, {k: v for k, v in vars(self).items() if k != "names"})
        _friction("arm.motors", self.names, self.static_friction, self.dynamic_friction)
        for name, peak, continuous in zip(self.names, self.peak_torque, self.continuous_torque, strict=True):
            require(
                continuous <= peak,
                f"{name}: arm.motors.continuous_torque {continuous:g} N m is above peak_torque {peak:g} N m",
            )


@dataclass(frozen=True)
class Joints:
    """The joints in Craig's Denavit-Hartenberg convention (A.4); angles of the joints are the state."""

    names: tuple[str, ...] = parameter("joint names, as they stand in JointState messages")
    twist: tuple[float, ...] = parameter("alpha_(i-1), link twist before the joint", "rad")
    length: tuple[float, ...] = parameter("a_(i-1), link length before the joint", "m")
    offset: tuple[float, ...] = parameter("d_i, link offset along the joint axis", "m")
    lower: tuple[float, ...] = parameter("lower stop", "rad")
    upper: tuple[float, ...] = parameter("upper stop", "rad")
    start: tuple[float, ...] = parameter("angle at power-up, brakes on", "rad")
    armature: tuple[float, ...] = parameter("inertia of the pulleys that turn with the joint", "kg m^2", low=0.0)
    static_friction: tuple[float, ...] = parameter("breakaway torque at the joint", "N m", low=0.0)
    dynamic_friction: tuple[float, ...] = parameter("Coulomb torque while turning, at the joint", "N m", low=0.0)
    viscous_friction: tuple[float, ...] = parameter("torque per velocity at the joint", "N m s/rad", low=0.0)
    speed_limit: tuple[float, ...] = parameter("speed that faults the driver", "rad/s", low=0.0)

    def __post_init__(self) -> None:
        _distinct("arm.joints", self.names)
        lengths("arm.joints", self.names, {k: v for k, v in vars(self).items() if k != "names"})
        _friction("arm.joints", self.names, self.static_friction, self.dynamic_friction)
        for name, low, start, high in zip(self.names, self.lower, self.start, self.upper, strict=True):
            require(low < high, f"{name}: arm.joints.lower {low:g} rad is not below upper {high:g} rad")
            require(low <= start <= high, f"{name}: arm.joints.start {start:g} rad is outside {low:g} to {high:g} rad")


def _friction(group: str, names: tuple[str, ...], static: tuple[float, ...], dynamic: tuple[float, ...]) -> None:
    for name, f_static, f_dynamic in zip(names, static, dynamic, strict=True):
        require(
            f_dynamic <= f_static,
            f"{name}: {group}.dynamic_friction {f_dynamic:g} N m is above static_friction {f_static:g} N m",
        )


@dataclass(frozen=True)
class Links:
    """The rigid links; link i moves with joint i, its frame is frame i of (A.4)."""

    names: tuple[str, ...] = parameter("link names, one per joint, as they stand in frame ids")
    mass: tuple[float, ...] = parameter("mass", "kg", low=1e-6)
    centre: tuple[float, ...] = parameter("centre of mass in the link's frame, x y z of each link", "m")
    inertia: tuple[float, ...] = parameter("principal inertia about the centre of mass, x y z", "kg m^2", low=0.0)

    def __post_init__(self) -> None:
        _distinct("arm.links", self.names)
        lengths("arm.links", self.names, {"mass": self.mass})
        lengths("arm.links", self.names, {"centre": self.centre, "inertia": self.inertia}, width=3)


@dataclass(frozen=True)
class Covers:
    """The foam-covered tubes that touch the world.

    Each has a frame of its own, named like the cover: origin where the kinematic link begins, x
    along the kinematic link, axes turned from its link's frame by `rotation`.  A place on the
    cover is the distance x along that frame.
    """

    names: tuple[str, ...] = parameter("cover names; contacts and pushes use them as frame ids")
    links: tuple[str, ...] = parameter("link that carries the cover")
    origin: tuple[float, ...] = parameter("origin of the cover's frame in its link's frame, x y z", "m")
    rotation: tuple[float, ...] = parameter("turn from the link's axes to the cover's, roll pitch yaw", "rad")
    length: tuple[float, ...] = parameter("length of the kinematic link, along x", "m", low=0.0)
    start: tuple[float, ...] = parameter("begin of the tube's axis in the cover's frame, x y z", "m")
    end: tuple[float, ...] = parameter("end of the tube's axis in the cover's frame, x y z", "m")
    radius: tuple[float, ...] = parameter("outer radius of the tube, rounded ends", "m", low=1e-4)

    def __post_init__(self) -> None:
        _distinct("arm.covers", self.names)
        lengths("arm.covers", self.names, {"links": self.links, "length": self.length, "radius": self.radius})
        spatial = {key: getattr(self, key) for key in ("origin", "rotation", "start", "end")}
        lengths("arm.covers", self.names, spatial, width=3)

    def aside(self, name: str, place: float) -> tuple[float, float]:
        """How far the tube's axis is off the frame's x axis at a place, m: y and z, m."""
        at = 3 * self.names.index(name)
        start, end = self.start[at : at + 3], self.end[at : at + 3]
        share = (place - start[0]) / (end[0] - start[0]) if end[0] != start[0] else 0.0
        return start[1] + share * (end[1] - start[1]), start[2] + share * (end[2] - start[2])


@dataclass(frozen=True)
class Arm:
    """Everything about the arm that all nodes must agree on."""

    motors: Motors
    cables: Cables
    joints: Joints
    links: Links
    covers: Covers
    name: str = parameter("name of the arm, also of its URDF and MJCF")
    joint_from_motor: tuple[float, ...] = parameter("the matrix of (A.5), joint = matrix motor, row by row")
    tool: tuple[float, ...] = parameter("origin of the tool frame in the last link's frame, x y z", "m")
    gravity: tuple[float, ...] = parameter("gravity in the base frame, x y z", "m/s^2")
    joint_sensors: bool = parameter("whether joint-side encoders and strain gauges are mounted")

    def __post_init__(self) -> None:
        motors, joints = len(self.motors.names), len(self.joints.names)
        require(motors == joints, f"{motors} motors and {joints} joints; the transmission needs as many of each")
        require(
            len(self.joint_from_motor) == motors * joints,
            f"parameter 'arm.joint_from_motor' has {len(self.joint_from_motor)} values; it needs {motors * joints}",
        )
        require(
            len(self.links.names) == joints,
            f"parameter 'arm.links.names' has {len(self.links.names)} links; {joints} joints need {joints}",
        )
        for key in ("pretension", "breaking_strength", "damping", "reducer"):
            lengths("arm.cables", self.motors.names, {key: getattr(self.cables, key)})
        self.circuits  # noqa: B018 - refuses stages that make no circuit
        for name, vector in (("tool", self.tool), ("gravity", self.gravity)):
            require(len(vector) == 3, f"parameter 'arm.{name}' has {len(vector)} values; it needs x y z")
        for link in self.covers.links:
            require(link in self.links.names, f"arm.covers.links names '{link}'; links: {', '.join(self.links.names)}")

    @cached_property
    def circuits(self) -> tuple[Circuit, ...]:
        """The cable circuit of each motor, its stages in series."""
        return circuits(self.motors.names, self.joint_from_motor, self.cables)


@dataclass(frozen=True)
class Timing:
    """The clockwork: motor side every `period`, joint side every `outer_divisor` periods."""

    mode: str = parameter(
        "realtime: the driver runs on the steady clock; lockstep: it waits for every answer",
        choices=("realtime", "lockstep"),
    )
    period: float = parameter("period of the inner loop and of motor_states", "s", low=1e-4, high=0.1)
    substeps: int = parameter("steps of the plant in one period", low=1, high=1000)
    outer_divisor: int = parameter("inner periods in one period of the joint side", low=1, high=1000)
    outer_delay: int = parameter("inner periods after which an outer command is used (lockstep)", low=0, high=1)
    display_divisor: int = parameter("outer periods between messages that are made for people", low=1, high=1000)
    niceness: int = parameter(
        "scheduling priority of driver and velocity_loop in realtime, where the system grants it", low=-20, high=0
    )
    timeout: float = parameter("longest wait for an answer in lockstep, steady clock", "s", low=0.1)
    dither_cycle: int = parameter(
        "inner periods in one cycle of the dither of the motor torques, by which contact is felt at rest; 0: no dither",
        low=0,
        high=1000,
    )

    @property
    def period_ns(self) -> int:
        """Period of the inner loop in nanoseconds."""
        return round(self.period * 1e9)

    @property
    def outer_period_ns(self) -> int:
        """Period of the joint side in nanoseconds."""
        return self.period_ns * self.outer_divisor

    @property
    def substep(self) -> float:
        """Step of the plant in seconds."""
        return self.period / self.substeps

    def outer_stamp(self, stamp: int) -> int:
        """Stamp of the outer period that `stamp` falls into, ns; the first period, tick 1, is an outer one."""
        tick = stamp // self.period_ns
        return (1 + (tick - 1) // self.outer_divisor * self.outer_divisor) * self.period_ns

    def is_outer(self, stamp: int) -> bool:
        """Whether the joint side works on the state of this stamp, ns."""
        return self.outer_stamp(stamp) == stamp

    def is_display(self, stamp: int) -> bool:
        """Whether messages that are made for people are due at this stamp, ns."""
        return (stamp - self.period_ns) % (self.outer_period_ns * self.display_divisor) == 0


def seconds(nanoseconds: int) -> float:
    """Time in seconds, the nearest number there is; everything that needs a dt takes it from here."""
    return nanoseconds / 1_000_000_000


@dataclass(frozen=True)
class Shared:
    """The part of a configuration that every node reads."""

    timing: Timing
    arm: Arm
    nodes: tuple[str, ...] = parameter("nodes that belong to this bring-up; lockstep waits until all are there")

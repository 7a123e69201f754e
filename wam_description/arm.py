"""Parameters that every node of the stack shares: the arm and the timing.

Arrays run over motors, joints, links or covers in the order of the `names` of the same group.  Nested
arrays are flattened row by row because ROS parameters cannot be nested.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from wam_description.cables import Cables, Circuit, circuits
from wam_description.model import ArmModel
from wam_description.parameters import aligned, lengths, named, parameter, require, rows
from wam_description.parts import Joints, Links, Motors
from wam_description.small_matrices import Array, rotation_xyz
from wam_description.thresholds import FILES, MODEL
from wam_description.transmission_map import TransmissionMap
from wam_description.units import STANDARD_GRAVITY


@dataclass(frozen=True)
class Covers:
    """The foam-covered tubes that touch the world.

    Each has a frame of its own, named like the cover: its origin is the start of the kinematic link, its x
    axis lies along the kinematic link, and `rotation` turns the link's axes into its axes.  A contact position is
    x in that frame.
    """

    names: tuple[str, ...] = parameter("cover names; contacts and pushes use them as frame ids")
    links: tuple[str, ...] = parameter("link that carries the cover")
    origin: tuple[float, ...] = parameter(
        "origin of the cover's frame in its link's frame, x y z", "m", within=3.0, width=3
    )
    rotation: tuple[float, ...] = parameter(
        "rotation from the link's axes to the cover's, roll pitch yaw", "rad", within=6.3, width=3
    )
    length: tuple[float, ...] = parameter("length of the kinematic link, along x", "m", high=3.0)
    start: tuple[float, ...] = parameter(
        "start of the tube's axis in the cover's frame, x y z", "m", within=3.0, width=3
    )
    end: tuple[float, ...] = parameter("end of the tube's axis in the cover's frame, x y z", "m", within=3.0, width=3)
    radius: tuple[float, ...] = parameter("outer radius of the tube, whose ends are rounded", "m", low=1e-4, high=0.5)

    def __post_init__(self) -> None:
        named("arm.covers", self, least=1)

    def length_of(self, name: str) -> float:
        """Length of the tube of this name, m."""
        return self.length[self.names.index(name)]

    def radius_of(self, name: str) -> float:
        """Outer radius of the tube of this name, m."""
        return self.radius[self.names.index(name)]

    def on_axis(self, name: str, place: float) -> tuple[float, float, float]:
        """Point of the tube's axis in the frame of the cover, m, at a contact position, m."""
        at = 3 * self.names.index(name)
        start, end = self.start[at : at + 3], self.end[at : at + 3]
        fraction = (place - start[0]) / (end[0] - start[0]) if end[0] != start[0] else 0.0
        return place, start[1] + fraction * (end[1] - start[1]), start[2] + fraction * (end[2] - start[2])


def _point(point: Sequence[float]) -> str:
    return f"({', '.join(f'{round(value, 4) + 0.0:g}' for value in point)})"


@dataclass(frozen=True)
class Arm:
    """The arm: mechanics, names and sensors."""

    motors: Motors
    cables: Cables
    joints: Joints
    links: Links
    covers: Covers
    name: str = parameter("name of the arm, also of its URDF and MJCF")
    joint_from_motor: tuple[float, ...] = parameter("matrix M of (A.5), q = M theta, row by row", within=100.0)
    tool: tuple[float, ...] = parameter(
        "origin of the tool frame in the last link's frame, x y z", "m", within=3.0, length=3
    )
    payload: float = parameter(
        "mass carried at the tool, known to all nodes and part of the simulated arm", "kg", high=50.0,
    )  # fmt: skip
    gravity: tuple[float, ...] = parameter("gravity in the base frame, x y z", "m/s^2", within=20.0, length=3)
    joint_sensors: bool = parameter("true if joint-side encoders and strain gauges are mounted")

    def __post_init__(self) -> None:
        motors, joints, links = self.motors.names, self.joints.names, self.links.names
        lengths("arm", motors, {"joints.names": joints, "links.names": links})
        lengths("arm", motors, {"joint_from_motor": self.joint_from_motor}, width=len(joints))
        condition = float(np.linalg.cond(np.reshape(self.joint_from_motor, (self.n, self.n))))
        require(
            condition < MODEL.condition,
            f"parameter 'arm.joint_from_motor' is singular (condition number {condition:.3g}, allowed below "
            f"{MODEL.condition:g}): each joint needs its own combination of motors",
        )
        for key in ("pretension", "breaking_strength", "damping", "reducer"):
            lengths("arm.cables", motors, {key: getattr(self.cables, key)})
        self.circuits  # noqa: B018 - refuses stages that make no circuit
        for link in self.covers.links:
            require(link in links, f"arm.covers.links names '{link}'; links: {', '.join(links)}")
        require(
            list(self.covers.links) == sorted(self.covers.links, key=links.index),
            f"arm.covers.links is {', '.join(self.covers.links)}; list the covers from the base to the tool",
        )
        self._require_plausible()
        self._require_joined()

    def _require_joined(self) -> None:
        """Refuse covers that do not end where the kinematics have the next joint, or the tool."""
        joints, links = rows(self.joints), self.links.names
        following = (*self.joints.places[1:], self.tool)
        for cover in rows(self.covers):
            x, link = rotation_xyz(*cover.rotation)[:, 0], links.index(cover.link)
            end = cover.origin + cover.length * x
            beyond = end - following[link]
            along = float(beyond @ x)
            across = math.dist(beyond, along * x)
            also = what = "arm.tool"  # what has to change with the length
            if link + 1 < len(links):
                what = joints[link + 1].name
                also = f"arm.joints.offset and length of {what}, arm.covers.origin"
                across = max(0.0, across - cover.radius)  # the axis of a joint may cross the tube anywhere
                apart = math.hypot(along, across)
            else:
                apart = max(0.0, along) if across <= MODEL.same_point else 0.0  # a tool may be beyond or next to it
            cure = f"; to change the length of {cover.name}, change arm.covers.length and end, "
            masses = ", and arm.links.mass, centre, inertia"
            require(
                apart <= MODEL.same_point,
                f"{cover.name} ends at {_point(end)} m in the frame of {cover.link}, by arm.covers.length, but "
                f"{what} is at {_point(following[link])} m{cure}{also}{masses}",
            )
            own = joints[link]
            before = (-own.length, 0.0, -own.offset)  # the joint before, in this link's frame
            require(
                min(math.hypot(*cover.origin), math.dist(cover.origin, before)) <= MODEL.same_point,
                f"{cover.name}: arm.covers.origin is {_point(cover.origin)} m; allowed: (0, 0, 0), or "
                f"{_point(before)}, where {own.name} begins by arm.joints.length and offset"
                f"{cure}arm.covers.origin, arm.joints.offset{masses}",
            )
            far = max(cover.start[0], cover.end[0])
            require(
                far <= cover.length + MODEL.same_point,
                f"{cover.name}: arm.covers.start and end reach up to {far:g} m, but arm.covers.length is "
                f"{cover.length:g} m{cure}{also}{masses}",
            )

    def _require_plausible(self) -> None:
        """Refuse links that this arm cannot have, such as values in other units."""
        joints, links = self.joints, rows(self.carried)
        spans = [abs(a) + abs(d) for a, d in zip(joints.length, joints.offset, strict=True)]
        size = sum(spans) + math.hypot(*self.tool)
        for link in links:
            centre, inertia = math.hypot(*link.centre), max(link.inertia)
            require(
                centre <= size,
                f"{link.name}: arm.links.centre is {centre:.3g} m from the link's frame; the whole arm is "
                f"{size:.3g} m long",
            )
            require(
                math.sqrt(inertia / link.mass) <= size,
                f"{link.name}: arm.links.inertia is {inertia:.3g} kg m^2; allowed: up to {link.mass * size * size:.3g} "
                f"kg m^2, that of {link.mass:.3g} kg at the end of an arm of {size:.3g} m",
            )
        require(
            self.gravity[2] <= 0.0,
            f"arm.gravity points upwards in the base frame: z is {self.gravity[2]:g} m/s^2; write it negative; "
            "if the arm hangs from a ceiling, turn its base: add pi to arm.joints.twist of the first joint",
        )
        strength = self.transmission.largest_joint_torques(self.motors.peak_torque)
        for i, joint in enumerate(joints.names):
            torque = STANDARD_GRAVITY * sum(
                link.mass * (sum(spans[i + 1 : j + 1]) + math.hypot(*link.centre))
                for j, link in enumerate(links)
                if j >= i
            )
            require(
                torque <= strength[i],
                f"the motors cannot carry the links beyond {joint}: their weight needs up to {torque:.3g} N m there, "
                f"the peak torque is {strength[i]:.3g} N m; check arm.links.mass, arm.links.centre, "
                "arm.joints.length and offset" + f", and arm.payload, {self.payload:g} kg" * bool(self.payload),
            )

    @cached_property
    def carried(self) -> Links:
        """The links with the payload, a point mass at the tool: what the motors carry, in every model of the arm."""
        links, payload = self.links, self.payload
        if not payload:
            return links
        centre, inertia, product = (
            np.reshape(values, (-1, 3)).copy() for values in (links.centre, links.inertia, links.product)
        )
        lever, mass = np.array(self.tool) - centre[-1], links.mass[-1]
        fraction = payload / (mass + payload)
        inertia[-1] += mass * fraction * (lever @ lever - lever * lever)
        product[-1] -= mass * fraction * lever[[0, 0, 1]] * lever[[1, 2, 2]]
        centre[-1] += fraction * lever
        shown = {"centre": centre, "inertia": inertia, "product": product}
        moved = {name: tuple(values.ravel().tolist()) for name, values in shown.items()}
        return replace(links, mass=(*links.mass[:-1], mass + payload), **moved)

    @cached_property
    def circuits(self) -> tuple[Circuit, ...]:
        """The cable circuit of each motor, its stages in series."""
        return circuits(self.motors.names, self.transmission.motor_from_joint, self.cables)

    @cached_property
    def rotors(self) -> Array:
        """Inertia of the rotors as the joints have it, (n, n), kg m^2."""
        return self.transmission.at_joints(self.motors.inertia)

    @cached_property
    def pulleys(self) -> Array:
        """Inertia of the pulleys that turn with the joints, (n, n), kg m^2."""
        return np.diag(self.joints.armature)

    @cached_property
    def stiffness(self) -> Array:
        """Stiffness of the cables as the joints have it, (n, n), N m/rad."""
        return self.transmission.at_joints([circuit.stiffness for circuit in self.circuits])

    @property
    def n(self) -> int:
        """Number of motors, of joints and of links."""
        return len(self.joints.names)

    @property
    def transmission(self) -> TransmissionMap:
        """The map between motors and joints."""
        return TransmissionMap(np.reshape(self.joint_from_motor, (self.n, self.n)))


@dataclass(frozen=True)
class Timing:
    """Timing: the motor side runs every `period`, the joint side every `outer_divisor` periods."""

    mode: str = parameter(
        "lockstep: the driver waits for every command; realtime: it runs on the steady clock",
        choices=("lockstep", "realtime"),
    )
    period: float = parameter("period of the inner loop and of motor_states", "s", low=1e-4, high=0.1)
    substeps: int = parameter("steps of the plant in one period", low=1, high=1000)
    outer_divisor: int = parameter(
        "inner periods in one outer period; the nodes of the joint side run once in an outer period", low=1, high=1000
    )
    outer_delay: int = parameter(
        "in lockstep: delay after which a command of the outer loop is used, in inner periods", high=1
    )
    display_divisor: int = parameter("outer periods between messages at the display rate", low=1, high=1000)
    niceness: int = parameter(
        "in realtime: niceness of all nodes but the recorder, if the system does not grant "
        "timing.fifo_priority; 0: as other programs",
        low=-20,
        high=0,
    )
    timeout: float = parameter("longest wait for a command in lockstep, on the steady clock", "s", low=0.1, high=3600.0)
    real_time_factor: float = parameter(
        "in lockstep: largest simulated time per time of the computer; at least 0.001, or 0: as fast as possible",
        high=100.0,
    )
    dither_cycle: int = parameter(
        "inner periods in one cycle of the dither, with which motors detect contact at rest; 0: no dither",
        high=1000,
    )
    fifo_priority: int = parameter(
        "SCHED_FIFO priority of driver and velocity_loop in realtime, if the system grants it; the other "
        "nodes but the recorder have one less; 0: none requested",
        high=49,
    )

    def __post_init__(self) -> None:
        factor = self.real_time_factor
        require(
            factor == 0.0 or factor >= FILES.slowest,
            f"timing.real_time_factor is {factor:g}; allowed: {FILES.slowest:g} to 100, or 0 for as fast as it can",
        )

    @cached_property
    def period_ns(self) -> int:
        """Period of the inner loop in nanoseconds."""
        return round(self.period * 1e9)

    @cached_property
    def outer_period_ns(self) -> int:
        """Period of the joint side in nanoseconds."""
        return self.period_ns * self.outer_divisor

    @cached_property
    def substep(self) -> float:
        """Step of the plant in seconds."""
        return self.period / self.substeps

    def is_outer(self, stamp: int) -> bool:
        """Whether the joint side works on the state of this stamp, ns; the first period, tick 1, is an outer one."""
        return (stamp - self.period_ns) % self.outer_period_ns == 0

    def is_display(self, stamp: int) -> bool:
        """Whether messages at the display rate are due at this stamp, ns."""
        return (stamp - self.period_ns) % (self.outer_period_ns * self.display_divisor) == 0


@dataclass(frozen=True)
class Servo:
    """Gains of the velocity loop of each motor; the velocity loop uses them, the stability guard relies on them."""

    proportional_gain: tuple[float, ...] = parameter("motor torque per velocity error", "N m s/rad")
    integral_gain: tuple[float, ...] = parameter("motor torque per angle error", "N m/rad")


def seconds(nanoseconds: int) -> float:
    """Time in seconds, correctly rounded; every dt is computed here."""
    return nanoseconds / 1_000_000_000


@dataclass(frozen=True)
class InputAges:
    """Ages from which an input counts as absent; also how far its stamp may be ahead of the newest state."""

    feedback: float = parameter(
        "age from which a message of another node counts as absent; if the arm needs the message, the driver brakes",
        "s",
        low=0.002,
        high=1.0,
    )
    command: float = parameter(
        "age from which a command of a program counts as absent: force, posture, joint torque",
        "s",
        low=0.002,
        high=1.0,
    )

    def limit_ns(self, kind: str) -> int:
        """The limit of this name, such as 'command', in ns."""
        return round(getattr(self, kind) * 1e9)


@dataclass(frozen=True)
class MotionParameters:
    """Limits of motions that are planned: trajectories of the joints, and straight lines of the tool."""

    joint_speed: tuple[float, ...] = parameter("largest speed of each joint", "rad/s", low=1e-3, high=100.0)
    joint_acceleration: tuple[float, ...] = parameter(
        "largest acceleration of each joint", "rad/s^2", low=1e-3, high=1e4
    )
    joint_jerk: tuple[float, ...] = parameter("largest jerk of each joint", "rad/s^3", low=1e-3, high=1e6)
    speed: float = parameter("largest speed of the tool on a line", "m/s", low=1e-3, high=10.0)
    acceleration: float = parameter("largest acceleration of the tool on a line", "m/s^2", low=1e-3, high=100.0)
    jerk: float = parameter("largest jerk of the tool on a line", "m/s^3", low=1e-3, high=1e4)


@dataclass(frozen=True)
class Shared:
    """The part of a configuration that every node reads."""

    timing: Timing
    ages: InputAges
    arm: Arm
    servo: Servo
    motion: MotionParameters
    model: ArmModel
    disturbance_force_limit: float = parameter("largest force of a push on sim/disturbance", "N", high=1e4)
    disturbance_torque_limit: float = parameter(
        "largest torque of a push on sim/disturbance, about the cover's origin", "N m", high=1e4
    )
    nodes: tuple[str, ...] = parameter("nodes of this bring-up; lockstep starts when all are present")

    def __post_init__(self) -> None:
        require(
            bool(self.nodes),
            "parameter 'nodes' is empty; list the nodes to start, for example "
            "[driver, transform, velocity_loop, gravity, force_loop, contact_estimator]",
        )
        outer = seconds(self.timing.outer_period_ns)
        require(
            self.ages.feedback >= outer,
            f"ages.feedback is {self.ages.feedback:g} s, less than an outer period, {outer:g} s (timing.period times "
            "timing.outer_divisor): commands of outer nodes would always count as absent; raise ages.feedback, or "
            "shorten the outer period",
        )
        self.arm.links.require_bodies()
        aligned("motion", self.arm.joints.names, self.motion)
        aligned("servo", self.arm.motors.names, self.servo)

    @property
    def is_simulated(self) -> bool:
        """Whether the driver is that of the simulated arm; another one is among the nodes as 'module:Class'."""
        return "driver" in self.nodes

    def push_excess(self, force: Sequence[float], torque: Sequence[float]) -> str:
        """Why a push is not allowed, '' where it is.

        Parameters
        ----------
        force : (3,), N.
        torque : (3,), N m, about the origin of the cover.
        """
        for what, vector, limit, unit in (
            ("force", force, self.disturbance_force_limit, "N"),
            ("torque", torque, self.disturbance_torque_limit, "N m"),
        ):
            size = math.hypot(*vector)
            if not size <= limit:
                return f"the {what} is {size:.4g} {unit}; allowed: up to disturbance_{what}_limit, {limit:g} {unit}"
        return ""

    @cached_property
    def model_arm(self) -> Arm:
        """The arm as the controllers model it: links, inertia, and friction as the mean of both directions."""
        arm, model = self.arm, self.model
        motors = replace(
            arm.motors,
            inertia=model.motors.inertia,
            dynamic_friction=_means(model.motors.coulomb_positive, model.motors.coulomb_negative),
            static_friction=_means(model.motors.static_positive, model.motors.static_negative),
            viscous_friction=model.motors.viscous,
        )
        joints = replace(
            arm.joints,
            armature=model.joints.armature,
            dynamic_friction=model.joints.coulomb,
            static_friction=model.joints.static,
            viscous_friction=model.joints.viscous,
        )
        links = replace(arm.links, **vars(model.links))
        return replace(arm, motors=motors, joints=joints, links=links)


def _means(first: tuple[float, ...], second: tuple[float, ...]) -> tuple[float, ...]:
    return tuple(0.5 * (a + b) for a, b in zip(first, second, strict=True))

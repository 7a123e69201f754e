"""A scenario: the steps of a task as data, played at the outer rate."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from wam_control.force.contact_place import pinned_position, torque_of_position
from wam_control.force.task import AxisKind, TaskCommand
from wam_control.task.motion import GoalMotion, LineMotion, PostureMotion
from wam_control.task.scenario_settings import NONE, Setting, checked_settings, require_settings, settings_of
from wam_control.task.scenario_values import (
    frame,
    is_one_of,
    known,
    number,
    numbers,
    plain,
    require_list,
    require_made,
    triple,
)
from wam_control.task.task_text import as_of_file, require_task, task_of_text, torque_task
from wam_control.thresholds import MOTION
from wam_description import yaml_text
from wam_description.arm import Arm, Covers, Shared
from wam_description.configuration import Configuration, named_file
from wam_description.parameters import ParameterError, parameter, require
from wam_description.rigid_body import RigidBody
from wam_description.signals import BASE, ZERO, Contact, ForceCommand, PathPoint, PosturePath, Triple, Wrench
from wam_description.small_matrices import cross

STEP_KEYS = {  # of a step in the file, with what each means; docs/running.md has them as a table
    "name": "text; required",
    "seconds": "duration, s of the arm's time; required. With `until_force` the longest duration",
    "posture": "the commanded angle of each joint at the end of the step, rad; the arm gets there a little later",
    "trajectory": "`{postures: [[...], ...], times: [...]}`, rad and s; `times` is optional",
    "tip": "`[x, y, z]`, m in the base frame; the tool goes there along a straight line",
    "force": "`{frame, newtons: [x, y, z], contact_position, rise}`: force of the arm on the world, N. `frame` is "
    "`base` or a cover. `rise` is the rise time, s. `contact_position`, m along the cover, needs the cover as `frame`, "
    "and a force nearly at right angles to it",
    "task": "`{frame, axes: [...]}`, see [tasks](tasks.md)",
    "torque": "torque of each joint on the world, N m; the scenario sends it as a `task`",
    "until_force": "force, N. The step ends when a contact with this force is detected, and fails if there is none. "
    "If the next step has neither motion nor force, the arm stays there",
    "chirp": "`{newtons, from, to}`: adds a sine to `force`, in the same direction. `newtons`: amplitude, N. The "
    "frequency goes from `from` to `to`, Hz",
    "push": "`{cover, contact_position, newtons: [x, y, z], begin, end}`: pushes a cover of the simulated arm. "
    "`contact_position` is in m along the cover, `newtons` in its frame. Optional: `begin` and `end`, s from the start "
    "of the step",
    "request": "called at the start of the step: `enable`, `disable` or `tare`. Before `tare` the arm must be at "
    "rest for half a second",
    "set": "`{force_loop: {force_gain: [0.01]}}`: sets parameters of driver or force_loop at the start of the "
    "step. Only *live* parameters can be set: they may change while the node runs",
}
MOTIONS = ("posture", "trajectory", "tip")  # keys of a step, one of which it may have
FORCES = ("force", "task", "torque")
REQUESTS = ("", "enable", "disable", "tare")
CHIRP_KEYS = ("newtons", "from", "to")
NO_FORCE = ForceCommand("base", ZERO)
FORCE_LOOP, FOLLOWED = "force_loop", "joint_speed_limit"
LARGEST = {"force_limit": "N", "torque_limit": "N m"}  # of the force loop
Motion = GoalMotion | PostureMotion | LineMotion


@dataclass(frozen=True)
class ScenarioParameters:
    """The task to play."""

    script: str = parameter("YAML file with the steps, or the name of a packaged scenario")


class Push(NamedTuple):
    """A push on a cover; times count from the start of the step.

    It acts on the tube's axis, which may be off the x axis of the cover's frame.
    """

    cover: str
    position: float  # m along the cover
    force: tuple[float, float, float]  # N, in the cover's frame
    begin: float  # s
    end: float  # s

    def torque(self, covers: Covers | None) -> Triple:
        """About the origin of the cover, N m; where no covers are known, the tube's axis is the x axis of its frame."""
        point = covers.on_axis(self.cover, self.position) if covers else (self.position, 0.0, 0.0)
        return cross(point, self.force)

    def acts(self, elapsed: float, dt: float) -> bool:
        """Whether it acts in the outer period that begins now; one within a single period acts for all of that.

        Parameters
        ----------
        elapsed : s from the start of the step.
        dt : outer period, s.
        """
        is_within = elapsed <= self.begin and self.end <= elapsed + dt + MOTION.rounding
        return is_within or self.begin <= elapsed + MOTION.rounding < self.end


class Chirp(NamedTuple):
    """A sine added to a step's force; its frequency grows exponentially."""

    newtons: float  # amplitude
    start: float  # Hz
    end: float  # Hz


class ScenarioStep(NamedTuple):
    """One step of a scenario."""

    name: str
    seconds: float
    posture: tuple[float, ...] = ()  # rad; empty keeps the last one
    until_force: float = 0.0  # N; above zero the step ends when a contact of this force is detected
    force: ForceCommand = NO_FORCE
    push: Push | None = None
    request: str = ""  # to driver or force loop, when the step begins
    chirp: Chirp | None = None  # along the force
    settings: tuple[Setting, ...] = ()  # applied when the step begins
    task: TaskCommand | None = None  # in place of a force
    trajectory: PosturePath | None = None  # in place of a posture
    tip: Triple | None = None  # m, base frame, to which the tool goes along a straight line, in place of a posture
    rise: float = 0.0  # s, in which the force goes from that of the step before to this one; 0: at once

    @property
    def moves(self) -> bool:
        """Whether the posture of the arm is commanded."""
        return bool(self.posture) or self.trajectory is not None or self.tip is not None

    @property
    def presses(self) -> bool:
        """Whether a force or a task is commanded, which moves the arm away from the posture."""
        return any(self.force.force) or self.task is not None

    @property
    def commands_arm(self) -> bool:
        """Whether a motion, a force or a task is commanded."""
        return self.moves or self.presses


PARTS = {"force": ForceCommand, "push": Push, "chirp": Chirp, "trajectory": PosturePath}  # classes of a step's fields


class ScenarioOutput(NamedTuple):
    """Commands of the scenario in one outer period."""

    step: ScenarioStep
    begins: bool  # the step, in this period
    done: bool
    failure: str
    posture: list[float]
    rate: Sequence[float]  # rad/s, of a posture that moves; empty where it is not known
    force: ForceCommand
    push: Wrench
    request: str


class Scenario:
    """Plays steps one after the other.

    Postures are reached along minimum-jerk paths.  If a step waits for a contact and none is
    detected, the scenario fails: it requests the brakes and ends.

    Parameters
    ----------
    steps : at least one.
    shared : of the arm, for motions that have limits; the values of the steps are checked against it as those of a
        file are.
    controllers : node classes by name that take the place of those in `shared.nodes`, for what the steps set.

    Attributes
    ----------
    steps : as they are played.

    Raises
    ------
    ParameterError
        names the step and the value that is not allowed.
    """

    def __init__(
        self, steps: Sequence[ScenarioStep], shared: Shared | None = None, controllers: Mapping[str, Any] = NONE
    ) -> None:
        require(isinstance(steps, Sequence), f"steps is {steps!r}; it must be a list of ScenarioStep")
        require(len(steps) > 0, "the scenario has no steps")
        given: Sequence[Any] = steps
        for i, step in enumerate(given):
            require(isinstance(step, ScenarioStep), f"step {i + 1} is {step!r}; give a ScenarioStep")
        if shared is not None:
            steps = [_checked(f"step {i + 1}", step, shared, controllers) for i, step in enumerate(given)]
        self.steps, self._shared = list(steps), shared
        self._covers = shared.arm.covers if shared else None
        self._motion: Motion | None = None
        self._index = -1
        self._elapsed = 0.0
        self._posture: list[float] = []
        self._before = NO_FORCE  # of the step before
        self.failure = ""
        self.done = False

    def step(self, q: Sequence[float], contact: Contact, dt: float) -> ScenarioOutput:
        """One outer period.

        Parameters
        ----------
        q : joint angles (n,), rad.
        contact : estimated contact.
        dt : outer period, s.
        """
        begins = self._index < 0
        if begins:
            self._posture = list(q)
            self._begin(0, q)
        else:
            self._elapsed += dt
            begins = self._advance(q, contact)
        step = self.steps[self._index]
        rate: Sequence[float] = ()
        if self._motion is not None and not self.done:
            self._posture, rate = self._motion.at(self._elapsed)
        push = step.push
        pushed = Wrench(push.cover if push else BASE, ZERO, ZERO)
        if push and push.acts(self._elapsed, dt) and not self.done:
            pushed = Wrench(push.cover, push.force, push.torque(self._covers))
        request = "disable" if self.failure else step.request
        return ScenarioOutput(
            step,
            begins and not self.done,
            self.done,
            self.failure,
            list(self._posture),
            rate,
            NO_FORCE if self.done else self._force(step),
            pushed,
            request if begins else "",
        )

    def _begin(self, index: int, q: Sequence[float]) -> None:
        """Begin a step; where its motion is not possible, the scenario fails before it moves."""
        before = self.steps[self._index] if self._index >= 0 else None
        self._before = self._force(before) if before else NO_FORCE
        self._index, self._elapsed = index, 0.0
        step = self.steps[index]
        rests = not step.commands_arm
        has_pressed = before is not None and (before.presses or (before.until_force > 0.0 and rests))
        if has_pressed and (step.moves or rests):
            self._posture = list(q)
        try:
            self._motion = motion_of(step, self._posture, self._shared)
        except ParameterError as error:
            self._motion, self.done, self.failure = None, True, str(error)

    def _advance(self, q: Sequence[float], contact: Contact) -> bool:
        """Go on to the next step if this one is over; whether a request may be due."""
        step = self.steps[self._index]
        if self.done:
            return False
        detected = bool(contact.cover) and math.hypot(*contact.force) >= step.until_force > 0.0
        if not detected and self._elapsed < step.seconds - MOTION.rounding:
            return False
        if step.until_force > 0.0 and not detected:
            self.failure = (
                f"step '{step.name}': no contact of {step.until_force:g} N detected within {step.seconds:g} s"
            )
            self.done = True
            return True
        if self._motion is not None and not detected:
            self._posture = self._motion.at(step.seconds).position
        if self._index + 1 == len(self.steps):
            self.done = True
            return False
        self._begin(self._index + 1, q)
        return True

    def _force(self, step: ScenarioStep) -> ForceCommand:
        force = step.force
        if step.chirp is not None:
            share = swept_sine(step.chirp, self._elapsed, step.seconds) / math.hypot(*force.force)
            force = _between(NO_FORCE, force, 1.0 + share)
        return _between(self._before, force, self._elapsed / step.rise) if self._elapsed < step.rise else force


def _between(before: ForceCommand, force: ForceCommand, share: float) -> ForceCommand:
    """A share of the way from one force to another, and from one place to another; in another frame the first is none.

    Where only one has a place, that of the new one counts, or none; a force that ends keeps its own.
    """
    start = before if before.frame == force.frame else NO_FORCE
    x, y, z = (a + share * (b - a) for a, b in zip(start.force, force.force, strict=True))
    pinned = pinned_position(force) or (None if any(force.force) else pinned_position(start))
    if pinned is None:
        return force._replace(force=(x, y, z))
    goal = pinned[1]
    _, place = pinned_position(start) or pinned
    return ForceCommand(force.frame, (x, y, z), torque_of_position((x, y, z), place + share * (goal - place)))


def motion_of(
    step: ScenarioStep, start: Sequence[float], shared: Shared | None, followed: float = math.inf
) -> Motion | None:
    """The motion of a step from joint angles (n,), rad; None where it has none.

    Parameters
    ----------
    shared : of the arm; None where its limits are not known.
    followed : largest joint speed of the force loop, rad/s, as far as it is known.

    Raises
    ------
    ParameterError
        where it leaves the limits, or does not end in the time of the step.
    """
    try:
        motion = _planned(step, start, shared)
        if motion is not None and shared is not None:
            require(
                motion.duration <= step.seconds + MOTION.rounding,
                f"the motion takes {motion.duration:.3g} s within its limits (motion); seconds is {step.seconds:g}: "
                "give the step more time",
            )
            _require_speed(step, motion, shared, followed)
    except ParameterError as error:
        raise ParameterError(f"step '{step.name}': {error}") from None
    return motion


def _planned(step: ScenarioStep, start: Sequence[float], shared: Shared | None) -> Motion | None:
    if step.posture:
        return GoalMotion(start, step.posture, step.seconds)
    if not step.moves:
        return None
    if shared is None:
        raise ParameterError("a motion needs the limits of the arm; give them: Scenario(steps, shared)")
    if step.trajectory is not None:
        return PostureMotion(start, step.trajectory, shared.arm, shared.motion)
    assert step.tip is not None
    return LineMotion(start, step.tip, shared.arm, RigidBody(shared.arm), shared.motion)


def _require_speed(step: ScenarioStep, motion: Motion, shared: Shared, followed: float) -> None:
    """Refuse a motion at which the driver would stop the arm, or with which the force loop would not keep up."""
    joints, allowed = shared.arm.joints, MOTION.caught_up if step.posture else 1.0
    loop = allowed * followed, (f"{allowed:g} times " if allowed > 1.0 else "") + f"{FORCE_LOOP}:{FOLLOWED}"
    found = []
    for k, (speed, fault) in enumerate(zip(motion.fastest, joints.speed_limit, strict=True)):
        most, limit = min((fault, "arm.joints.speed_limit"), loop)
        found.append((speed / most if most else math.copysign(math.inf, speed) if speed else 0.0, k, most, limit))
    excess, k, most, limit = max(found)
    if excess <= 1.0 + MOTION.rounding:
        return
    advice = f"lower motion.joint_speed to {most:g} rad/s"
    if step.posture and most:
        advice = f"give the step at least {math.ceil(1e3 * (excess * step.seconds - MOTION.rounding)) / 1e3:g} s"
        if followed == math.inf:
            advice += f", more where {FORCE_LOOP}:{FOLLOWED} is lower"
    elif step.trajectory is not None and any(point.time for point in step.trajectory.points):
        advice = f"give it {excess:.3g} times the time, or no times and {advice}"
    raise ParameterError(
        f"{joints.names[k]} turns at up to {motion.fastest[k]:.3g} rad/s; allowed: up to {limit}, {most:g} rad/s; "
        + (advice if most else "raise it")
    )


def _require_motions(
    where: str, steps: Sequence[ScenarioStep], shared: Shared, start: Sequence[float], followed: float
) -> None:
    """Refuse motions that are not possible, as far as it is known from where, (n,) rad, and how fast they go.

    A force, a task or a detected contact leaves the arm wherever it is.
    """
    for step in steps:
        followed = _set_to(step, FOLLOWED, followed)
        try:
            motion = motion_of(step, start, shared, followed) if start else None
        except ParameterError as error:
            raise ParameterError(f"{where}, {error}") from None
        before = start
        if motion is not None:
            start = motion.at(step.seconds).position
        elif step.moves:
            start = step.posture or (step.trajectory.points[-1].position if step.trajectory else ())
        if step.moves and step.task is not None and start:
            _require_free(f"{where}, step '{step.name}'", step.task, before, start, shared.arm.joints.names)
        if step.until_force or step.presses:
            start = ()


def _require_free(
    where: str, task: TaskCommand, start: Sequence[float], goal: Sequence[float], names: Sequence[str]
) -> None:
    """Refuse a posture (n,), rad, that moves joints which a task takes, as far as it is known from where, rad."""
    for axis in task.axes:
        if not axis.is_joint:
            continue
        taken = axis.value if axis.kind is AxisKind.POSITION else None
        if taken is None and start:
            taken = start[axis.joint]
        require(
            taken is None or abs(goal[axis.joint] - taken) <= MOTION.arrived,
            f"{where}: the posture moves {names[axis.joint]} to {goal[axis.joint]:.4g} rad, and has no effect on it "
            f"next to the axis '{axis.name}' of the task; leave one of them out",
        )


def swept_sine(chirp: Chirp, elapsed: float, seconds: float) -> float:
    """Force of a chirp of `seconds`, N, at the time `elapsed`, s."""
    growth = math.log(chirp.end / chirp.start)
    turns = chirp.start * seconds / growth * math.expm1(growth * elapsed / seconds)
    return chirp.newtons * math.sin(2.0 * math.pi * turns)


def script_file(script: str) -> Path:
    """The file of a scenario: a path that ends in '.yaml' or '.yml', or the name of one that comes with the package."""
    return named_file(script, "scenario")


def load(path: str | Path, shared: Shared) -> list[ScenarioStep]:
    """Read the steps of a scenario, for an arm that may be anywhere, with any parameters of the nodes.

    Parameters
    ----------
    path : of a YAML file; not its text.
    shared : of the arm whose joints and links the steps may name, and how it may be pushed.

    Raises
    ------
    ParameterError
        names the file, the step and the value that is not allowed.
    """
    steps = _read(path, shared)
    _require_motions(str(path), steps, shared, (), math.inf)
    return steps


def _read(path: str | Path, shared: Shared) -> list[ScenarioStep]:
    if "\n" in str(path):
        raise ParameterError("the scenario is given as a text of several lines; write it to a file and give its path")
    path = Path(path)
    if not path.is_file():
        raise ParameterError(f"scenario {path} is not a file; give the path of a YAML file with 'steps'")
    tree = yaml_text.read(path, "scenario")
    if isinstance(tree, dict):
        known(f"scenario {path}", tree, ("steps",), ("steps",))
    if not isinstance(tree, dict) or not isinstance(tree["steps"], list):
        raise ParameterError(f"scenario {path} has no list 'steps'; write the steps below 'steps:'")
    require(len(tree["steps"]) > 0, f"scenario {path} has no steps; give at least one")
    return [_step(f"{path}, step {i + 1}", body, shared) for i, body in enumerate(tree["steps"])]


def load_for(configuration: Configuration, script: str) -> list[ScenarioStep]:
    """Read the steps of a scenario as a configuration plays it: what they set and how they move fits its values.

    Parameters
    ----------
    configuration : of all nodes.
    script : as in `ScenarioParameters`.
    """
    path = script_file(script)
    steps = _read(path, configuration.shared)
    require_playable(str(path), steps, configuration)
    return steps


def require_playable(where: str, steps: Sequence[ScenarioStep], configuration: Configuration) -> None:
    """Refuse steps whose settings, forces or motions do not fit a configuration; its simulated arm begins at its start.

    Raises
    ------
    ParameterError
        names the step, the value and what is allowed.
    """
    require_settings(where, [step.settings for step in steps], configuration)
    shared = configuration.shared
    start = shared.arm.joints.start if shared.is_simulated else ()
    loop = configuration.sections.get(FORCE_LOOP, {}) if FORCE_LOOP in shared.nodes else {}
    _require_forces(where, steps, {name: float(loop.get(name, math.inf)) for name in LARGEST})
    _require_motions(where, steps, shared, start, float(loop.get(FOLLOWED, math.inf)))


def _set_to(step: ScenarioStep, name: str, before: float) -> float:
    """The number of a parameter of the force loop that a step sets, the one before where it sets none."""
    found = [setting.value for setting in step.settings if (setting.node, setting.name) == (FORCE_LOOP, name)]
    value = found[-1] if found else before
    assert isinstance(value, (int, float))
    return value


def _require_forces(where: str, steps: Sequence[ScenarioStep], limits: dict[str, float]) -> None:
    """Refuse forces and torques that the force loop would refuse in each pose; `limits` are those at the start."""
    for step in steps:
        limits = {name: _set_to(step, name, limit) for name, limit in limits.items()}
        largest = math.hypot(*step.force.force) + (abs(step.chirp.newtons) if step.chirp else 0.0)
        commanded = [("", "force_limit", largest)]
        for axis in step.task.axes if step.task else ():
            if axis.is_force:
                name = "torque_limit" if axis.is_joint else "force_limit"
                commanded.append((f"{axis.name}: ", name, abs(axis.value or 0.0)))
        for what, name, size in commanded:
            limit, unit = limits[name], LARGEST[name]
            require(
                size <= limit,
                f"{where}, step '{step.name}': {what}{size:.4g} {unit} is commanded; allowed: up to {name}, {limit:g} "
                f"{unit}; command less, or raise {FORCE_LOOP}:{name}",
            )


def _step(where: str, body: Any, shared: Shared) -> ScenarioStep:
    arm = shared.arm
    if not isinstance(body, dict):
        raise ParameterError(f"{where} is {body!r}; it must be a mapping with name and seconds")
    known(where, body, tuple(STEP_KEYS), ("name", "seconds"))
    for keys in (FORCES, MOTIONS):
        _require_one(where, [key for key in keys if key in body])
    step = ScenarioStep(
        name=body["name"],
        seconds=body["seconds"],
        posture=numbers(where, "posture", body["posture"], arm.n) if "posture" in body else (),
        until_force=body.get("until_force", 0.0),
        force=_force(where, body["force"], arm) if "force" in body else NO_FORCE,
        push=_push(where, body["push"], body["seconds"]) if "push" in body else None,
        request=body.get("request", ""),
        chirp=_chirp(where, body["chirp"]) if "chirp" in body else None,
        settings=tuple(settings_of(where, body["set"])) if "set" in body else (),
        task=_task(where, body, arm),
        trajectory=_trajectory(where, body["trajectory"]) if "trajectory" in body else None,
        tip=triple(where, "tip", body["tip"]) if "tip" in body else None,
        rise=body.get("force", {}).get("rise", 0.0),
    )
    return _checked(where, step, shared)


def _checked(where: str, step: Any, shared: Shared, controllers: Mapping[str, Any] = NONE) -> ScenarioStep:
    """A step of a file or made in Python, as it is played."""
    _require_step(where, step, shared)
    task, settings = step.task, checked_settings(where, step.settings, shared, controllers)
    whole: ScenarioStep = plain(step._replace(task=None, settings=()))
    return whole._replace(task=task and as_of_file(task), settings=settings)


def _require_one(where: str, keys: Sequence[str]) -> None:
    require(len(keys) <= 1, f"{where}: {' and '.join(keys)} are given; give one of them")


def _require_step(where: str, step: Any, shared: Shared) -> None:
    """Refuse a step whose values cannot be, whether it is from a file or made in Python: they may be of any type."""
    arm = shared.arm
    for key, kind in PARTS.items():
        if (part := getattr(step, key)) is not None or kind is ForceCommand:
            require_made(where, key, part, kind)
    require(
        isinstance(step.name, str) and step.name != "", f"{where}: name is {step.name!r}; it must be a text (quote it)"
    )
    require(
        is_one_of(step.request, REQUESTS), f"{where}: request is {step.request!r}; allowed: {', '.join(REQUESTS[1:])}"
    )
    seconds = number(where, "seconds", step.seconds)
    require(seconds > 0.0, f"{where}: seconds is {seconds:g}; it must be above 0")
    until = number(where, "until_force", step.until_force)
    require(until >= 0.0, f"{where}: until_force is {until:g}; it must be 0 (no contact expected) or above")
    frame(where, step.force.frame, arm)
    for key, values in (("newtons", step.force.force), ("torque", step.force.torque)):
        numbers(where, key, values, 3)
    if step.chirp is not None:
        _require_chirp(where, step.chirp)
        force, swing = math.hypot(*step.force.force), abs(step.chirp.newtons)
        require(0.0 < force >= swing, f"{where}: a chirp of {swing:g} N needs a force of as much; it has {force:g} N")
    require_list(where, "posture", step.posture, "joint angles")
    if step.tip is not None:
        triple(where, "tip", step.tip)
    moves = [key for key, given in zip(MOTIONS, (step.posture, step.trajectory, step.tip), strict=True) if given]
    forces = ["force"] * (step.force != NO_FORCE)
    if step.task is not None:
        require_task(where, step.task, arm)
        are_torques = all(axis.is_force and axis.is_joint for axis in step.task.axes)
        forces.append("torque" if are_torques else "task")
    _require_one(where, moves)
    _require_one(where, forces)
    require(
        not moves or step.task is None or len(step.task.axes) < arm.n,
        f"{where}: {' and '.join((*moves, *forces))} are given; the {' '.join(forces)} leaves no joint free to move; "
        "give one of them, or a task with fewer axes",
    )
    if step.posture:
        _require_posture(where, step.posture, arm)
    if step.trajectory is not None:
        _require_trajectory(where, step.trajectory, arm)
    rise = number(where + ", force", "rise", step.rise)
    require(0.0 <= rise <= seconds, f"{where}: rise is {rise:g} s; allowed: 0 to {seconds:g} s, the time of the step")
    if step.push is not None:
        _require_push(where, step.push, shared, seconds)


def _require_trajectory(where: str, trajectory: Any, arm: Arm) -> None:
    require_list(where, "points of the trajectory", trajectory.points, "PathPoint")
    require(len(trajectory.points) > 0, f"{where}: the trajectory has no points; give at least one")
    for i, point in enumerate(trajectory.points):
        require_made(where, f"point {i + 1} of the trajectory", point, PathPoint)
        _require_posture(where, point.position, arm)
        require_list(where, "velocity", point.velocity, "joint speeds")
        if point.velocity:
            numbers(where, "velocity", point.velocity, arm.n)
        number(where, "times", point.time)


def _trajectory(where: str, body: Any) -> PosturePath:
    known(f"{where}, trajectory", body, ("postures", "times"), ("postures",))
    postures = body["postures"]
    require(isinstance(postures, list) and len(postures) > 0, f"{where}: postures is {postures!r}; give a list of them")
    times = numbers(where, "times", body["times"], len(postures)) if "times" in body else (0.0,) * len(postures)
    return PosturePath(tuple(PathPoint(one, (), time) for one, time in zip(postures, times, strict=True)))


def _task(where: str, body: Any, arm: Arm) -> TaskCommand | None:
    if "torque" in body:
        return torque_task(where, body["torque"], arm)
    return task_of_text(where, body["task"], arm) if "task" in body else None


def _require_posture(where: str, given: Any, arm: Arm) -> None:
    beyond = arm.joints.beyond(numbers(where, "posture", given, arm.n))
    require(not beyond, f"{where}: posture: {beyond}")


def _force(where: str, body: Any, arm: Arm) -> ForceCommand:
    known(where + ", force", body, ("frame", "newtons", "contact_position", "rise"), ("frame", "newtons"))
    link, newtons = frame(where, body["frame"], arm), triple(where, "newtons", body["newtons"])
    if "contact_position" not in body:
        return ForceCommand(link, newtons)
    place = number(where, "contact_position", body["contact_position"])
    require(
        link != BASE and any(newtons[1:]),
        f"{where}: contact_position is in m along a cover: command a force across it, in its frame",
    )
    length = arm.covers.length_of(link)
    require(
        0.0 < place <= length,
        f"{where}: contact_position is {place:g} m; allowed: above 0, up to {length:g} m of {link}",
    )
    return ForceCommand(link, newtons, torque_of_position(newtons, place))


def _chirp(where: str, body: Any) -> Chirp:
    known(where + ", chirp", body, CHIRP_KEYS, CHIRP_KEYS)
    return Chirp(*(body[key] for key in CHIRP_KEYS))


def _require_chirp(where: str, chirp: Any) -> None:
    _, start, end = (number(where + ", chirp", key, value) for key, value in zip(CHIRP_KEYS, chirp, strict=True))
    require(0.0 < start < end, f"{where}: chirp goes from {start:g} to {end:g} Hz; it must begin above 0 and rise")
    require(
        start >= MOTION.slowest_chirp and end <= MOTION.fastest_chirp,
        f"{where}: chirp goes from {start:g} to {end:g} Hz; "
        f"allowed: {MOTION.slowest_chirp:g} to {MOTION.fastest_chirp:g} Hz",
    )


def _push(where: str, body: Any, seconds: Any) -> Push:
    needed = ("cover", "contact_position", "newtons")
    known(where + ", push", body, (*needed, "begin", "end"), needed)
    cover, place, newtons = (body[key] for key in needed)
    return Push(cover, place, newtons, body.get("begin", 0.0), body.get("end", seconds))


def _require_push(where: str, push: Any, shared: Shared, seconds: float) -> None:
    covers = shared.arm.covers
    require(
        is_one_of(push.cover, covers.names), f"{where}: cover is {push.cover!r}; allowed: {', '.join(covers.names)}"
    )
    place, length = number(where, "contact_position", push.position), covers.length_of(push.cover)
    require(
        0.0 <= place <= length,
        f"{where}: contact_position is {place:g} m; {push.cover} reaches from 0 to {length:g} m",
    )
    numbers(where, "newtons", push.force, 3)
    begin, end = number(where, "begin", push.begin), number(where, "end", push.end)
    require(
        0.0 <= begin < end <= seconds + MOTION.rounding,
        f"{where}: the push has begin {begin:g} s and end {end:g} s; allowed: begin from 0 s, end after it, up to the "
        f"{seconds:g} s of the step; a push ends with its step: to continue it, give it again in the next step",
    )
    excess = shared.push_excess(push.force, plain(push).torque(covers))
    require(not excess, f"{where}: push: {excess}")

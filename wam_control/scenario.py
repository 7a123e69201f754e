"""A scenario: the steps of a task as data, played at the outer rate."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from wam_description import yaml_text
from wam_description.arm import Arm
from wam_description.parameters import ParameterError, flatten, parameter, require
from wam_description.signals import Contact, ForceCommand

REQUESTS = ("", "enable", "disable")
TUNABLE = ("driver", "force_loop")  # in lockstep they wait for the scenario: a setting takes effect at its own stamp
NO_FORCE = ForceCommand("base", (0.0, 0.0, 0.0))
ROUNDING = 1e-9  # s, of a sum of periods


@dataclass(frozen=True)
class ScenarioParameters:
    """The task to play."""

    script: str = parameter(
        "YAML file with the steps; a name without a path is looked up in the folder of the configurations"
    )


class Push(NamedTuple):
    """A push on a cover; times count from the start of the step.

    It acts on the tube's axis, which may be off the x axis of the cover's frame.
    """

    cover: str
    place: float  # m along the cover
    force: tuple[float, float, float]  # N, in the cover's frame
    begin: float  # s
    end: float  # s
    aside: tuple[float, float] = (0.0, 0.0)  # m, y and z of the tube's axis there


class Chirp(NamedTuple):
    """A sine added to a step's force; its frequency grows exponentially."""

    newtons: float  # amplitude
    start: float  # Hz
    end: float  # Hz


class Setting(NamedTuple):
    """A live parameter of a node and its new value."""

    node: str
    name: str
    value: float | int | bool | str | tuple[float | int | bool | str, ...]


class ScenarioStep(NamedTuple):
    """One step of a scenario."""

    name: str
    seconds: float
    posture: tuple[float, ...] = ()  # rad; empty keeps the last one
    until_force: float = 0.0  # N; above zero the step ends when a contact of this force is detected
    force: ForceCommand = NO_FORCE
    push: Push | None = None
    request: str = ""  # to the driver, when the step begins
    chirp: Chirp | None = None  # along the force
    settings: tuple[Setting, ...] = ()  # applied when the step begins


class ScenarioOutput(NamedTuple):
    """Commands of the scenario in one outer period."""

    posture: list[float]
    force: ForceCommand
    push_cover: str
    push_force: tuple[float, float, float]
    push_torque: tuple[float, float, float]
    request: str
    settings: tuple[Setting, ...]
    step: str
    done: bool
    failure: str


class Scenario:
    """Plays steps one after the other.

    Postures are reached along minimum-jerk paths.  If a step waits for a contact and none is
    detected, the scenario fails: it requests the brakes and ends.
    """

    def __init__(self, steps: Sequence[ScenarioStep]) -> None:
        require(len(steps) > 0, "the scenario has no steps")
        self._steps = list(steps)
        self._index = -1
        self._elapsed = 0.0
        self._from: list[float] = []
        self._posture: list[float] = []
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
        step = self._steps[self._index]
        if step.posture and not self.done:
            self._posture = self._on_path(step)
        push = step.push
        pushing = push is not None and push.begin <= self._elapsed + ROUNDING < push.end and not self.done
        force = fx, fy, fz = push.force if push and pushing else (0.0, 0.0, 0.0)
        x, y, z = (push.place, *push.aside) if push and pushing else (0.0, 0.0, 0.0)
        request = "disable" if self.failure else step.request
        return ScenarioOutput(
            posture=list(self._posture),
            force=NO_FORCE if self.done else self._force(step),
            push_cover=push.cover if push else "",
            push_force=force,
            push_torque=(y * fz - z * fy, z * fx - x * fz, x * fy - y * fx),
            request=request if begins else "",
            settings=step.settings if begins and not self.done else (),
            step=step.name,
            done=self.done,
            failure=self.failure,
        )

    def _begin(self, index: int, q: Sequence[float]) -> None:
        pressed = self._index >= 0 and self._steps[self._index].force != NO_FORCE
        self._index, self._elapsed = index, 0.0
        step = self._steps[index]
        if pressed and (step.posture or step.force == NO_FORCE):
            self._posture = list(q)  # the arm has moved along the force, away from the posture
        self._from = list(self._posture)

    def _advance(self, q: Sequence[float], contact: Contact) -> bool:
        """Go on to the next step if this one is over; whether a request may be due."""
        step = self._steps[self._index]
        if self.done:
            return False
        detected = bool(contact.cover) and math.hypot(*contact.force) >= step.until_force > 0.0
        if not detected and self._elapsed < step.seconds - ROUNDING:
            return False
        if step.until_force > 0.0 and not detected:
            self.failure = (
                f"step '{step.name}': no contact of {step.until_force:g} N detected within {step.seconds:g} s"
            )
            self.done = True
            return True
        if step.posture and not detected:
            self._posture = list(step.posture)
        if self._index + 1 == len(self._steps):
            self.done = True
            return False
        self._begin(self._index + 1, q)
        return True

    def _force(self, step: ScenarioStep) -> ForceCommand:
        if step.chirp is None:
            return step.force
        share = swept_sine(step.chirp, self._elapsed, step.seconds) / math.hypot(*step.force.force)
        x, y, z = (newtons * (1.0 + share) for newtons in step.force.force)
        return ForceCommand(step.force.frame, (x, y, z))

    def _on_path(self, step: ScenarioStep) -> list[float]:
        s = min(self._elapsed / step.seconds, 1.0)
        blend = s * s * s * (10.0 - 15.0 * s + 6.0 * s * s)
        return [a + (b - a) * blend for a, b in zip(self._from, step.posture, strict=True)]


def swept_sine(chirp: Chirp, elapsed: float, seconds: float) -> float:
    """Force of a chirp of `seconds`, N, at the time `elapsed`, s."""
    growth = math.log(chirp.end / chirp.start)
    turns = chirp.start * seconds / growth * math.expm1(growth * elapsed / seconds)
    return chirp.newtons * math.sin(2.0 * math.pi * turns)


def load(path: Path, arm: Arm) -> list[ScenarioStep]:
    """Read the steps of a scenario.

    Raises
    ------
    ParameterError
        names the file, the step and the value that is not allowed.
    """
    if not path.is_file():
        raise ParameterError(f"scenario {path} is not a file; give the path of a YAML file with 'steps'")
    try:
        tree = yaml_text.parse(path.read_text(encoding="utf-8"))
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ParameterError(f"scenario {path} is not YAML: {error}") from error
    if not isinstance(tree, dict) or not isinstance(tree.get("steps"), list):
        raise ParameterError(f"scenario {path} has no list 'steps'")
    _known(f"scenario {path}", tree, ("steps",), ("steps",))
    require(len(tree["steps"]) > 0, f"scenario {path} has no steps; give at least one")
    return [_step(f"{path}, step {i + 1}", body, arm) for i, body in enumerate(tree["steps"])]


def _step(where: str, body: Any, arm: Arm) -> ScenarioStep:
    if not isinstance(body, dict):
        raise ParameterError(f"{where} is {body!r}; it must be a mapping with name and seconds")
    keys = ("name", "seconds", "posture", "until_force", "force", "chirp", "push", "request", "set")
    _known(where, body, keys, ("name", "seconds"))
    name = body["name"]
    require(isinstance(name, str) and name != "", f"{where}: name is {name!r}; it must be a text (quote it)")
    request = body.get("request", "")
    require(request in REQUESTS, f"{where}: request is {request!r}; allowed: enable, disable")
    seconds = _float(where, "seconds", body["seconds"])
    require(seconds > 0.0, f"{where}: seconds is {seconds:g}; it must be above 0")
    until_force = _float(where, "until_force", body.get("until_force", 0.0))
    require(until_force >= 0.0, f"{where}: until_force is {until_force:g}; it must be 0 (no contact expected) or above")
    force = _force(where, body["force"], arm) if "force" in body else NO_FORCE
    require("chirp" not in body or any(force.force), f"{where}: chirp needs a force above 0 N, along which it acts")
    return ScenarioStep(
        name=name,
        seconds=seconds,
        posture=_posture(where, body["posture"], arm) if "posture" in body else (),
        until_force=until_force,
        force=force,
        push=_push(where, body["push"], arm) if "push" in body else None,
        request=request,
        chirp=_chirp(where, body["chirp"]) if "chirp" in body else None,
        settings=tuple(_settings(where, body["set"])) if "set" in body else (),
    )


def _posture(where: str, body: Any, arm: Arm) -> tuple[float, ...]:
    joints = arm.joints
    posture = _floats(where, "posture", body, len(joints.names))
    for name, low, angle, high in zip(joints.names, joints.lower, posture, joints.upper, strict=True):
        require(low <= angle <= high, f"{where}: posture of {name} is {angle:g} rad; allowed: {low:g} to {high:g} rad")
    return posture


def _force(where: str, body: Any, arm: Arm) -> ForceCommand:
    _known(where + ", force", body, ("frame", "newtons"), ("frame", "newtons"))
    frames = ("base", *arm.covers.names)
    require(body["frame"] in frames, f"{where}: frame is {body['frame']!r}; allowed: {', '.join(frames)}")
    x, y, z = _floats(where, "newtons", body["newtons"], 3)
    return ForceCommand(body["frame"], (x, y, z))


def _chirp(where: str, body: Any) -> Chirp:
    keys = ("newtons", "from", "to")
    _known(where + ", chirp", body, keys, keys)
    newtons, start, end = (_float(where + ", chirp", key, body[key]) for key in keys)
    require(0.0 < start < end, f"{where}: chirp goes from {start:g} to {end:g} Hz; it must begin above 0 and rise")
    return Chirp(newtons, start, end)


def _settings(where: str, body: Any) -> Iterator[Setting]:
    _known(where + ", set", body, TUNABLE, ())
    for node, values in body.items():
        require(isinstance(values, Mapping), f"{where}: set, {node} is {values!r}; give names and values")
        for name, value in flatten(values).items():
            yield Setting(node, name, tuple(value) if isinstance(value, list) else value)


def _push(where: str, body: Any, arm: Arm) -> Push:
    names = ("cover", "place", "newtons", "begin", "end")
    _known(where + ", push", body, names, names)
    require(
        body["cover"] in arm.covers.names,
        f"{where}: cover is {body['cover']!r}; allowed: {', '.join(arm.covers.names)}",
    )
    x, y, z = _floats(where, "newtons", body["newtons"], 3)
    place, begin, end = (_float(where, key, body[key]) for key in ("place", "begin", "end"))
    length = arm.covers.length[arm.covers.names.index(body["cover"])]
    require(0.0 <= place <= length, f"{where}: place is {place:g} m; {body['cover']} reaches from 0 to {length:g} m")
    require(0.0 <= begin < end, f"{where}: begin is {begin:g} s, end {end:g} s; end must be later, begin 0 or later")
    return Push(body["cover"], place, (x, y, z), begin, end, arm.covers.aside(body["cover"], place))


def _known(where: str, body: Any, allowed: Sequence[str], needed: Sequence[str]) -> None:
    if not isinstance(body, Mapping):
        raise ParameterError(f"{where} is {body!r}; it must be a mapping with {', '.join(needed)}")
    for key in body:
        require(key in allowed, f"{where}: unknown key '{key}'; allowed: {', '.join(allowed)}")
    for key in needed:
        require(key in body, f"{where}: '{key}' is missing")


def _float(where: str, key: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise ParameterError(f"{where}: {key} is {value!r}; it must be a finite number")
    return float(value)


def _floats(where: str, key: str, value: Any, length: int) -> tuple[float, ...]:
    if not isinstance(value, list) or len(value) != length:
        raise ParameterError(f"{where}: {key} is {value!r}; it must be a list of {length} numbers")
    return tuple(_float(where, key, element) for element in value)

"""The simulated arm down to its motor shafts: rotors, elastic cables, friction with true sticking, contact.

State: angle and velocity of each rotor and each joint, and the creep of each circuit.  Cable circuit
i pulls with tau = k_tr (l - c) + d l', with l = theta_i - (row i of the inverse of (A.5)) q and creep c,
at the rotor and, through the same row, at the joints, until its loose strand is slack.  Dry
friction is MuJoCo's friction constraint, made stiff, its level set before every step by `DryFriction`.
"""

import ctypes
import dataclasses
import importlib
import math
from collections.abc import Callable, Sequence
from functools import partial
from operator import add, index
from struct import Struct
from typing import Any, SupportsIndex

import mujoco
import numpy as np
from mujoco import mj_step1, mj_step2

from wam_description.arm import Arm
from wam_description.cables import Circuit
from wam_description.effects import Effects
from wam_description.mjcf import mjcf
from wam_description.parameters import each
from wam_description.signals import Load, ObjectState
from wam_description.world import World
from wam_driver.circuits import CableCircuits
from wam_driver.dry_friction import DryFriction
from wam_driver.friction import COULOMB_STICTION, FrictionParameters
from wam_driver.loads import CoverLoads
from wam_driver.objects import MovingObstacle, TrueObjects
from wam_driver.pusher import Pusher
from wam_driver.step_size import require_fitting_step
from wam_driver.surfaces import Mover, Surfaces
from wam_driver.thresholds import PLANT

WARNINGS = {
    "inertia": "its inertia matrix is singular",
    "contactfull": "it has too many contacts",
    "cnstrfull": "it has too many constraints",
    "badqpos": "an angle is not finite or huge",
    "badqvel": "a velocity is not finite or huge",
    "badqacc": "an acceleration is not finite or huge",
    "badctrl": "a torque is not finite",
}  # what MuJoCo's warnings mean for the arm
OF_MASS = (
    "body_mass",
    "body_subtreemass",
    "body_ipos",
    "body_iquat",
    "body_inertia",
    "body_invweight0",
    "dof_invweight0",
    "dof_M0",
)  # what MuJoCo's model keeps of the masses


class _View:
    """Views into MuJoCo's memory of n rotors and n joints: to fetch them in each step costs more than its own work.

    Free bodies and doors come after rotors and joints.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, n: int) -> None:
        joints, shafts = slice(n, 2 * n), slice(2 * n)
        self.position, self.every_velocity, self.velocities = data.qpos, data.qvel, data.qvel[shafts]
        self.theta, self.thetad = data.qpos[:n], data.qvel[:n]
        self.q, self.qd, self.qdd = data.qpos[joints], data.qvel[joints], data.qacc[joints]
        self.bias, self.spring = data.qfrc_bias[joints], data.qfrc_spring[joints]
        self.constraint, self.applied = data.qfrc_constraint[shafts], data.qfrc_applied
        self.friction_loss, self.plastic, self.warnings = (
            model.dof_frictionloss[shafts],
            data.plastic,
            data.warning.number,
        )
        self.damping: list[float] = model.dof_damping[joints].tolist()
        self.armature: list[float] = model.dof_armature[joints].tolist()


class Plant:
    """The arm in MuJoCo, stepped with motor torques, without ROS and without a clock.

    Parameters
    ----------
    arm : the arm; the plant is built from these parameters alone.
    world : surfaces and springs to touch, pushers that touch.
    effects : which effects of the transmission are on.
    step : length of a step, s.
    friction : law of the dry friction.
    brake_torque : torque at which the brake of a rotor slips, N m.

    Raises
    ------
    ParameterError
        if the step is too long for the stiffest mode, or something is inside a link at power-up.
    """

    def __init__(
        self,
        arm: Arm,
        world: World,
        effects: Effects,
        step: float,
        friction: FrictionParameters = COULOMB_STICTION,
        brake_torque: float = PLANT.rigid_brake,
    ) -> None:
        self._xml_of = partial(mjcf, step=step, world=world, effects=effects)
        self.model = mujoco.MjModel.from_xml_string(self._xml_of(arm))
        self.data = mujoco.MjData(self.model)
        mujoco.set_mju_user_warning(_unheard)
        n = self._n = arm.n
        self._brakes, self._effects = [brake_torque] * n, effects
        self._arm, self._carried = arm, 0.0
        self._map = arm.transmission
        self._circuits = CableCircuits(self.data, arm, effects, step)
        self._friction = DryFriction(arm, effects, friction, step, self.model.dof_invweight0[: 2 * n].tolist())
        self._loads = CoverLoads(self.model, self.data, arm, world.springs)
        self._moving = [MovingObstacle(self.model, self.data, motion) for motion in world.motions.present]
        self._objects = TrueObjects(self.model, self.data, arm, world, {one.name: one for one in self._moving})
        self._pushers = [Pusher(self.model, self.data, arm, one, step) for one in world.pushers.present]
        movers: list[Mover] = [*self._pushers, *self._moving]
        self._surfaces = Surfaces(self.model, self.data, arm, world, movers, step)
        self._view = _View(self.model, self.data, n)
        self._write_torque = partial(Struct(f"{n}d").pack_into, memoryview(self.data.ctrl))
        # what the steps in C do
        is_plain = self._friction.is_steady and not movers and not self._circuits.is_bounded
        self._advance = self._compiled_steps(step) if is_plain else None
        # to look them up in each step costs 3 % of it
        bounds, after_step = (*self._friction.bounds, self._friction.direction), self._circuits.after_step
        velocities = self._view.velocities.tolist
        self._in_steps = self.model, self.data, self._loads.pushes, movers, velocities, *bounds, after_step
        self._rest()
        self._surfaces.require_free_start(arm)
        self._kept = self._view.position.tolist(), self._view.plastic.tolist()
        self.set_pretension(effects.pretension_share)
        require_fitting_step(self.model, arm, world, step)

    def _rest(self) -> None:
        """Put the arm at its start pose, braked, with the cables stretched so that they carry the links."""
        data, view, effects, arm = self.data, self._view, self._effects, self._arm
        mujoco.mj_resetData(self.model, data)
        self._circuits.rest()
        view.q[:] = arm.joints.start
        view.theta[:] = self._map.motor_from_joint @ view.q
        mujoco.mj_forward(self.model, data)
        load = view.bias - view.spring
        torque = np.linalg.solve(self._map.motor_from_joint.T, load)
        view.theta[:] += [
            _stretch(tau, circuit, effects.slack, effects.play(i))
            for i, (tau, circuit) in enumerate(zip(torque.tolist(), arm.circuits, strict=True))
        ]
        self._begin()

    def _begin(self) -> None:
        """Prepare the first step of an arm at rest: braked, its contacts and velocities computed."""
        data = self.data
        for one in self._moving:
            one.lead(data.time)
        self._friction.reset()
        self._circuits.reset()
        self._braked = True
        self._is_set = False  # whether MuJoCo has the present levels of friction
        self._set_friction()
        # of rotors and joints at the start of the last step, rad/s
        self._velocity: list[float] = self._view.velocities.tolist()
        mujoco.mj_step1(self.model, data)
        if data.ncon:
            self._surfaces.apply()
        mujoco.mj_forwardSkip(self.model, data, mujoco.mjtStage.mjSTAGE_VEL, 1)

    def reset(self) -> None:
        """Return to power-up: start pose, at rest, brakes on, no pushes."""
        self.release()
        self.carry(0.0)
        self._rest()

    def trouble(self) -> str:
        """Why the arm's simulation cannot go on; '' if it can: then the present angles are kept for `recover`."""
        counts = self._view.warnings.tolist()
        if any(counts):
            return " and ".join(text for text, count in zip(WARNINGS.values(), counts, strict=True) if count)
        position: list[float] = self._view.position.tolist()
        if not math.isfinite(sum(self._view.every_velocity.tolist()) + sum(position)):
            return WARNINGS["badqvel"]
        self._kept = position, self._view.plastic.tolist()
        return ""

    def recover(self) -> None:
        """Put the arm, braked and at rest, where it was when there was no trouble; end every push."""
        self.release()
        time = self.data.time
        mujoco.mj_resetData(self.model, self.data)
        self._view.position[:], self._view.plastic[:] = self._kept
        self.data.time = time
        self._begin()

    def brake(self, on: bool) -> None:
        """Put on or release the brakes, which hold the rotors up to the torque at which they slip."""
        self._is_set = self._is_set and on == self._braked
        self._braked = on

    def push(self, cover: str, force: Sequence[float], torque: Sequence[float]) -> None:
        """Push on a cover until the next push on it or `release`.

        Parameters
        ----------
        cover : name of the cover.
        force, torque : (3,) N and N m, in the cover's frame, about its origin; zero ends the push.

        Raises
        ------
        ValueError
            for a cover that the arm does not have.
        """
        self._loads.push(cover, force, torque)

    def release(self) -> None:
        """End every push."""
        self._loads.release()

    def pushes_in_words(self) -> str:
        """How hard which covers are pushed, by whom if a pusher does; '' where none is."""
        pressing = [pusher.words for pusher in self._pushers if pusher.is_pressing]
        return ", ".join([*self._loads.pushes_in_words(), *pressing])

    def carry(self, mass: float) -> None:
        """Carry a mass at the tool, kg, from now on, besides `arm.payload`: a point that already moves with it."""
        if mass != self._carried:
            self._carried = mass
            loaded = dataclasses.replace(self._arm, payload=self._arm.payload + mass)
            heavier = mujoco.MjModel.from_xml_string(self._xml_of(loaded))
            for name in OF_MASS:
                getattr(self.model, name)[:] = getattr(heavier, name)

    def set_added_friction(self, friction: Sequence[float]) -> None:
        """Set the added Coulomb friction of each joint, (n,), N m, static and dynamic alike."""
        self._friction.set_added(friction)
        self._is_set = False

    def heat(self, heat: Sequence[float]) -> None:
        """Take the heat of each motor, (n,), 1 at its thermal limit, for friction that falls with temperature."""
        self._friction.heat(heat)
        self._is_set = False

    def set_pretension(self, shares: Sequence[float]) -> None:
        """Set the pretension of the circuits now (6.5), as a part of the configured one: one for all, or (n,).

        Raises
        ------
        ValueError
            for a part that is below 0, or for another number of them; nothing is changed then.
        """
        self._friction.set_circuits(self._circuits.tighten(list(each(tuple(shares), self._n))))
        self._kept = self._kept[0], self._view.plastic.tolist()
        self._is_set = False

    def step(self, torque: Sequence[float], count: SupportsIndex = 1) -> None:
        """Advance by one step or several.

        Parameters
        ----------
        torque : torque of each motor on its rotor, N m.
        count : number of steps with this torque, 1 or more.

        Raises
        ------
        ValueError
            for another number of steps.
        """
        if index(count) < 1:
            raise ValueError(f"count is {count}; it must be 1 or more")
        self._write_torque(0, *torque)
        if self._advance is None:
            self._velocity = self._advance_in_python(count)
        else:
            self._velocity = self._advance(count, self._is_set, self._set_friction)

    def _compiled_steps(self, step: float) -> Callable[[SupportsIndex, bool, Callable[[], object]], list[float]] | None:
        """What advances the plant in C, by steps of this length, s; None where it is not built for this MuJoCo."""
        try:
            built: Any = importlib.import_module("wam_driver.fast_steps")
            library = ctypes.CDLL(f"libmujoco.so.{mujoco.__version__}")  # which mujoco has loaded already
            names = ("mj_step1", "mj_step2", "mj_applyFT", "_mjPRIVATE_setTlsLogHandler", "mjcb_time")
            found = [library[name] for name in names]
        except (ImportError, OSError, AttributeError):
            return None
        if mujoco.mj_version() != built.MUJOCO:
            return None
        friction, circuits = self._friction, self._circuits
        prepared = built.prepare(
            self.model._address,
            self.data._address,
            *[ctypes.cast(one, ctypes.c_void_p).value for one in found],
            mujoco.FatalError,
            self._surfaces.laws,
            *friction.bounds,
            friction.direction,
            circuits.each if circuits.after_step else [],
            circuits,
            self._loads.pushes,
            step,
            PLANT.smallest_depth,
            float(PLANT.sharpness),
        )
        return partial(built.advance, prepared)

    def _advance_in_python(self, count: SupportsIndex) -> list[float]:
        """Advance by steps with the torque that is set; velocities of rotors and joints before the last, rad/s."""
        model, data, pushes, movers, velocities, lows, highs, direction, after_step = self._in_steps
        velocity = before = velocities()
        for _ in range(count):
            if self._is_set:
                for speed, low, high in zip(velocity, lows, highs):  # noqa: B905 - stuck, or in motion as before
                    if not low < speed < high:
                        self._set_friction()
                        break
            else:
                self._set_friction()
            for mover in movers:
                mover.lead(data.time)
            before = velocity
            mj_step1(model, data)
            if pushes:
                self._loads.apply_pushes()
            if data.ncon:
                self._surfaces.apply()
            mj_step2(model, data)
            if pushes:
                self._view.applied.fill(0.0)
            velocity = velocities()
            if after_step and after_step(direction, velocity):
                self._is_set = False
        return before

    def _set_friction(self) -> None:
        """Give MuJoCo the level of friction of every shaft for the next step."""
        friction, circuits = self._friction, self._circuits
        velocity = self._view.velocities.tolist()
        changed = friction.follow(velocity, self._transmitted_torque(), self._friction_torque())
        if friction.elastic:
            self._view.applied[: 2 * self._n] = friction.elastic  # the rest is of free bodies and doors
        if changed or circuits.is_slack or not self._is_set:
            levels = friction.levels_with_slack(circuits.elastic_torque) if circuits.is_slack else friction.levels
            self._is_set = friction.is_steady and not circuits.is_slack
            self._view.friction_loss[:] = self._brakes + levels[self._n :] if self._braked else levels

    def _transmitted_torque(self) -> list[float]:
        """Elastic torque of the cables on rotors, then on joints, N m, (2 n,), at the start of the last step."""
        at_rotors = self._circuits.elastic_torque
        return at_rotors + [-torque for torque in self._map.joint_torques(at_rotors)]

    def _friction_torque(self) -> list[float]:
        """Dry friction on rotors, then on joints, N m, (2 n,), in the last step."""
        data = self.data
        elastic = self._friction.elastic
        if data.nefc == data.nf:  # no other constraint, so that MuJoCo's sum of all is that of dry friction
            dry_friction: list[float] = self._view.constraint.tolist()
            return [a + b for a, b in zip(elastic, dry_friction, strict=True)] if elastic else dry_friction
        torque = elastic.copy() or [0.0] * (2 * self._n)
        dry = slice(data.ne, data.ne + data.nf)
        for dof, friction in zip(data.efc_id[dry].tolist(), data.efc_force[dry].tolist(), strict=True):
            if dof < len(torque):  # not the hinge of a door
                torque[dof] += friction
        return torque

    @property
    def theta(self) -> list[float]:
        """Rotor angles, rad."""
        return self._view.theta.tolist()

    @property
    def thetad(self) -> list[float]:
        """Rotor velocities, rad/s."""
        return self._view.thetad.tolist()

    @property
    def q(self) -> list[float]:
        """Joint angles, rad: what an encoder at the joint reads."""
        return self._view.q.tolist()

    @property
    def qd(self) -> list[float]:
        """Joint velocities, rad/s."""
        return self._view.qd.tolist()

    @property
    def circuit_torque(self) -> list[float]:
        """Torque of each cable circuit at its motor, N m, (n,), at the start of the last step."""
        return self._circuits.torque

    @property
    def cable_pull(self) -> list[float]:
        """Size of the elastic torque of each cable circuit, N m, (n,), at the start of the last step."""
        return list(map(abs, self._circuits.elastic_torque))

    def tensions(self, pulls: Sequence[float]) -> list[float]:
        """Tension of the tight strand of each first stage, N, (n,), which grows with the `cable_pull`, N m, (n,)."""
        return self._circuits.tensions(pulls)

    @property
    def cable_torque(self) -> list[float]:
        """Torque of the cables on the joints, N m, (n,), at the start of the last step."""
        return self._map.joint_torques(self._circuits.torque)

    @property
    def strain_torque(self) -> list[float]:
        """Torque on the link side of the joints' friction, N m, (n,), at the start of the last step.

        The torque of cables and friction less what accelerates the pulleys.  A strain gauge at the
        root of the link reads it: M qdd + c(q, qd) + g - tau_ext of the links alone.
        """
        acceleration: list[float] = self._view.qdd.tolist()
        driven = [  # five lists at a time have types
            torque - damping * speed - armature * qdd
            for torque, damping, speed, armature, qdd in zip(  # noqa: B905 - as long as the work
                self.cable_torque, self._view.damping, self._velocity[self._n :], self._view.armature, acceleration
            )
        ]
        return list(map(add, driven, self._friction_torque()[self._n :]))

    def loads(self) -> list[Load]:
        """What the world does to each touched, sprung or pushed cover, in the order of the arm's covers."""
        return self._loads.measure()

    def sunk(self) -> str:
        """Which cover is too deep in what it touches for a contact force, and what to do; '' where none is."""
        return self._loads.sunk() if self.data.ncon else ""

    def objects(self) -> list[ObjectState]:
        """The true state of every free body, door and moving obstacle, in the order of `World.objects`."""
        return self._objects.measure()


def _unheard(_: str) -> None:
    """In place of MuJoCo's own report of a warning, which writes a file; `Plant.trouble` reports it."""


def _stretch(torque: float, circuit: Circuit, slack: bool, play: float) -> float:
    """Stretch at which a circuit gives a torque, rad."""
    stretch = torque / circuit.stiffness
    if play:
        return stretch + math.copysign(0.5 * play, torque) if torque else 0.0
    limit = circuit.slack_stretch
    if slack and abs(stretch) > limit:
        stretch += math.copysign(abs(stretch) - limit, stretch)
    return stretch

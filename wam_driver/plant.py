"""The simulated arm, true to the motor shafts: rotors, elastic cables, friction with true stick, contact.

State: angle and velocity of each rotor and each joint, and the creep of each circuit.  Cable circuit
i pulls with tau = k_tr (l - c) + d l', l = theta_i - (row i of the inverse of (A.5)) q, c its creep,
at the rotor and, through the same row, at the joints, until its loose strand is slack.  Dry
friction is MuJoCo's friction constraint, made stiff, its level switched before every step: F_static
while stuck, F_dynamic once moving until the velocity changes its sign (section 5.1, figure 5.1.b).
"""

import math
from collections.abc import Iterator, Sequence
from functools import partial
from struct import Struct

import mujoco
import numpy as np
from mujoco import mj_step1, mj_step2

from wam_description.arm import Arm
from wam_description.cables import Circuit
from wam_description.effects import Effects
from wam_description.mjcf import mjcf
from wam_description.signals import Load
from wam_description.world import Springs, World
from wam_driver.pusher import pushers

STUCK_ROTOR = 1e-5  # rad/s; below it a rotor counts as stuck: far under one step of any real motion
STUCK_JOINT = 1e-6  # rad/s; 1e-3 would make the limit cycle of (5.8) vanish
SHARPNESS = 32  # of the sharing between the ends of a tube: energy is kept to 0.2 %, equal depths within 2 % share
ALL_OF_IT = (1.0,)
BRAKE_TORQUE = 1e3  # N m at a rotor, far above any cable


class Plant:
    """The arm in MuJoCo, stepped with motor torques, without ROS and without a clock.

    Parameters
    ----------
    arm : the arm; the plant is built from these parameters alone.
    world : surfaces and springs to touch, pushers that touch.
    effects : which effects of the transmission are on.
    step : length of a step, s.
    """

    def __init__(self, arm: Arm, world: World, effects: Effects, step: float) -> None:
        self.model = mujoco.MjModel.from_xml_string(mjcf(arm, step, world, effects))
        self.data = mujoco.MjData(self.model)
        n = len(arm.motors.names)
        self._n = n
        self._step = step
        self._start = arm.joints.start
        self._arm = arm
        self._threshold = [STUCK_ROTOR] * n + [STUCK_JOINT] * n
        self._dofs = range(2 * n)
        self._direction = [0] * (2 * n)
        self._braked = True
        self._velocity = [0.0] * (2 * n)
        self._levels = [0.0] * (2 * n)  # friction of each dof without brakes
        self._is_set = False  # whether MuJoCo has these levels
        # views into MuJoCo's memory: asking for them anew in each step costs more than the step's own work
        self._qvel = self.data.qvel
        self._write_torque = partial(Struct(f"{n}d").pack_into, memoryview(self.data.ctrl))
        self._rotor_speed, self._rotor_pull = self.data.qvel[:n], self.data.qfrc_spring[:n]
        self._frictionloss, self._contact = self.model.dof_frictionloss, self.data.contact
        self._circuits = arm.circuits
        self._slack = effects.slack
        # stretches between which a strand is slack, two of each strand; the tight one reaches the upper, the loose
        # one, which stands next to it, the lower
        self._slack_ends = memoryview(self.data.plastic)
        self._tension_friction = effects.tension_friction
        self._grips = effects.slack and any(effects.tension_friction)
        self._pulls = [
            (
                4 * i + 1,
                step * circuit.loss_per_torque if effects.creep else 0.0,
                2.0 * circuit.pretension * circuit.radius if self._grips else math.inf,
            )
            for i, circuit in enumerate(arm.circuits)
        ]  # of each rotor: its first slack end, creep of a step per speed and torque, torque that makes a strand slack
        self._is_gripping = False  # whether a strand is slack, so that the friction depends on the torque
        self._depends_on_pull = effects.creep or self._grips
        self.rub(effects.rubbing_friction)
        self._motor_from_joint = np.linalg.inv(np.array(arm.joint_from_motor).reshape(n, n))
        self._pushes: dict[str, tuple[np.ndarray, np.ndarray]] = {}
        self._wrench = np.zeros(6)
        self._body = {
            name: self.model.body(link).id for name, link in zip(arm.covers.names, arm.covers.links, strict=True)
        }
        self._site = {name: self.model.site(f"{name}_frame").id for name in arm.covers.names}
        self._cover_of_geom = {self.model.geom(name).id: name for name in arm.covers.names}
        pairs = list(zip(self.model.pair_geom1.tolist(), self.model.pair_geom2.tolist(), strict=True))
        # MuJoCo may name the two geoms of a contact in either order
        self._pair = {geoms: i for i, pair in enumerate(pairs) for geoms in (pair, pair[::-1])}
        obstacles = world.obstacles
        self._pushers = pushers(self.model, self.data, arm, world.pushers, step)
        self._led = {self.model.geom(pusher.name).id: pusher for pusher in self._pushers}
        surfaces = zip(obstacles.stiffness, obstacles.damping, obstacles.hardening, strict=True)
        self._surface = [
            (*surface, size)
            for surface, size in zip(
                [*list(surfaces) * len(arm.covers.names), *(pusher.surface for pusher in self._pushers)],
                self.model.pair_dim.tolist(),
                strict=True,
            )
        ]
        self._springs = list(self._springs_on_covers(world.springs))
        self._rest()

    def _springs_on_covers(self, springs: Springs) -> Iterator[tuple[int, int, str, float, float, bool]]:
        """Tendon, body, cover, lever, rest length and kind of each spring whose link carries a cover."""
        arm = self._arm
        tendons = iter(range(2 * self._n, self.model.ntendon))  # behind the strands of the cables
        for i, joint in enumerate(springs.joints):
            if springs.stiffness[i] == 0.0:
                continue
            tendon = next(tendons)
            link = arm.links.names[arm.joints.names.index(joint)]
            if link in arm.covers.links:
                cover = arm.covers.names[arm.covers.links.index(link)]
                lever = springs.lever[i]
                yield tendon, self.model.body(link).id, cover, lever, lever * springs.rest[i], springs.bilateral[i]

    def _rest(self) -> None:
        """Put the arm at its start pose with the cables stretched so that they carry the links."""
        data, n = self.data, self._n
        mujoco.mj_resetData(self.model, data)
        data.qpos[n:] = self._start
        data.qpos[:n] = self._motor_from_joint @ data.qpos[n:]
        mujoco.mj_forward(self.model, data)
        load = data.qfrc_bias[n:] - data.qfrc_spring[n:]
        torque = np.linalg.solve(self._motor_from_joint.T, load)
        data.qpos[:n] = self._motor_from_joint @ data.qpos[n:] + [
            _stretch(tau, circuit, self._slack) for tau, circuit in zip(torque.tolist(), self._circuits, strict=True)
        ]
        self._direction = [0] * (2 * n)
        self._braked = True
        self._levels = self._static.copy()
        self._is_set = False
        self._is_gripping = self._grips
        self._set_friction()
        mujoco.mj_step1(self.model, data)
        if data.ncon:
            self._match_surfaces()
        mujoco.mj_forwardSkip(self.model, data, mujoco.mjtStage.mjSTAGE_VEL, 1)

    def reset(self) -> None:
        """Return to power-up: start pose, at rest, brakes on, no pushes."""
        self.release()
        self._rest()

    def brake(self, on: bool) -> None:
        """Put on or release the brakes, which hold the rotors."""
        self._is_set = self._is_set and on == self._braked
        self._braked = on

    def push(self, cover: str, force: np.ndarray, torque: np.ndarray) -> None:
        """Push on a cover until told otherwise.

        Parameters
        ----------
        cover : name of the cover.
        force, torque : (3,) N and N m, in the cover's frame, about its origin; zero ends the push.

        Raises
        ------
        ValueError
            for a cover that the arm does not have.
        """
        if cover not in self._site:
            raise ValueError(f"no cover is named '{cover}'; covers: {', '.join(self._site)}")
        if np.any(force) or np.any(torque):
            self._pushes[cover] = (np.array(force, float), np.array(torque, float))
        else:
            self._pushes.pop(cover, None)

    def release(self) -> None:
        """End every push."""
        self._pushes.clear()

    def step(self, torque: list[float]) -> None:
        """Advance by one step.

        Parameters
        ----------
        torque : torque of each motor on its rotor, N m.
        """
        model, data = self.model, self.data
        self._write_torque(0, *torque)
        self._set_friction()
        for pusher in self._pushers:
            pusher.lead(data.time)
        mj_step1(model, data)
        if self._pushes:
            self._apply_pushes()
        if data.ncon:
            self._match_surfaces()
        mj_step2(model, data)
        if self._pushes:
            data.qfrc_applied[:] = 0.0
        if self._depends_on_pull:
            self._follow_pull()

    def rub(self, friction: Sequence[float]) -> None:
        """Let something rub: extra dry friction at each joint (n,), N m, static and dynamic alike."""
        motors, joints = self._arm.motors, self._arm.joints
        tension = [2.0 * c.pretension * share for c, share in zip(self._circuits, self._tension_friction, strict=True)]
        extra = [*tension, *friction]
        static = [*motors.static_friction, *joints.static_friction]
        dynamic = [*motors.dynamic_friction, *joints.dynamic_friction]
        self._static = [level + more for level, more in zip(static, extra, strict=True)]
        self._dynamic = [level + more for level, more in zip(dynamic, extra, strict=True)]
        levels = zip(self._direction, self._static, self._dynamic, strict=True)
        self._levels = [moving if way else stuck for way, stuck, moving in levels]
        self._is_set = False

    def _follow_pull(self) -> None:
        """Let the cables creep on their pulleys, dc = loss |d theta| tau, (6.19) corrected; see who grips."""
        ends = self._slack_ends
        self._is_gripping = False
        # the pull on the rotor is minus the torque of the circuit
        speeds, pulls = self._rotor_speed.tolist(), self._rotor_pull.tolist()
        for (i, rate, most), way, speed, pull in zip(self._pulls, self._direction, speeds, pulls):  # noqa: B905
            if way:
                crept = rate * abs(speed) * pull
                ends[i] -= crept
                ends[i + 1] -= crept
            if abs(pull) > most:
                self._is_gripping = True

    def _set_friction(self) -> None:
        """Friction level of every dof for the next step: static while stuck, dynamic while moving."""
        direction, levels = self._direction, self._levels
        self._velocity = self._qvel.tolist()
        for i, velocity, way in zip(self._dofs, self._velocity, direction):  # noqa: B905 - costs 1 % of a step
            if velocity * way > 0.0:
                continue
            if way:
                direction[i] = 0
                levels[i] = self._static[i]
                self._is_set = False
            elif abs(velocity) > self._threshold[i]:
                direction[i] = 1 if velocity > 0.0 else -1
                levels[i] = self._dynamic[i]
                self._is_set = False
        if self._is_gripping:
            levels = self._grip_of_slack()
            self._is_set = False
        if not self._is_set:
            self._is_set = levels is self._levels
            self._frictionloss[:] = [BRAKE_TORQUE] * self._n + levels[self._n :] if self._braked else levels

    def _grip_of_slack(self) -> list[float]:
        """Friction levels where a strand is slack: only then is the sum of both tensions more than 2 T_0."""
        levels = self._levels.copy()
        for i, (pull, circuit) in enumerate(zip(self._rotor_pull.tolist(), self._circuits, strict=True)):
            excess = abs(pull) / circuit.radius - 2.0 * circuit.pretension
            levels[i] += self._tension_friction[i] * max(excess, 0.0)
        return levels

    def _apply_pushes(self) -> None:
        data = self.data
        for cover, (force, torque) in self._pushes.items():
            site = self._site[cover]
            rotation = data.site_xmat[site].reshape(3, 3)
            mujoco.mj_applyFT(
                self.model,
                data,
                rotation @ force,
                rotation @ torque,
                data.site_xpos[site],
                self._body[cover],
                data.qfrc_applied,
            )

    def _match_surfaces(self) -> None:
        """Make each contact's force k_c depth + b_c speed, and let it stick within its friction cone.

        MuJoCo's contact force is (a_ref - a)/R with R far above the inverse of the mass behind the contact, so
        that a_ref = R f gives f.  Several contacts of one pair share its stiffness, see `_shares`.  Along the surface
        a_ref stops the slip in one step, as for the joints; MuJoCo's own, 1/d times the damping, makes friction
        alternate between its limits from step to step.
        """
        data, contact = self.data, self._contact
        pairs = [self._pair[first, second] for first, second in contact.geom.tolist()]
        rows, distances = contact.efc_address.tolist(), contact.dist.tolist()
        reference, regularisation, velocity = data.efc_aref, data.efc_R, data.efc_vel.tolist()
        shares = ALL_OF_IT if len(pairs) == 1 else _shares(pairs, distances)
        if self._led:
            self._follow_pushers(velocity, rows, pairs)
        for pair, row, distance, share in zip(pairs, rows, distances, shares):  # noqa: B905 - one of each for a contact
            if row >= 0:
                stiffness, damping, hardening, size = self._surface[pair]
                if hardening and distance < 0.0:
                    stiffness *= 1.0 - hardening * distance
                force = -(stiffness * distance + damping * velocity[row]) * share
                reference[row] = force * regularisation[row]
                for k in range(row + 1, row + size):
                    reference[k] = -velocity[k] / self._step

    def _follow_pushers(self, velocity: list[float], rows: Sequence[int], pairs: Sequence[int]) -> None:
        """Make the contacts' velocities those against the pushers, which MuJoCo takes for standing still."""
        contact = self._contact
        for i, (row, pair) in enumerate(zip(rows, pairs, strict=True)):
            first, second = contact.geom[i].tolist()
            pusher = self._led.get(second) or self._led.get(first)
            if row >= 0 and pusher is not None:
                sign = 1.0 if second in self._led else -1.0
                along = (contact.frame[i].reshape(3, 3) @ pusher.velocity).tolist()
                for k in range(self._surface[pair][3]):
                    velocity[row + k] += sign * along[k]

    @property
    def theta(self) -> list[float]:
        """Rotor angles, rad."""
        return self.data.qpos[: self._n].tolist()

    @property
    def thetad(self) -> list[float]:
        """Rotor velocities, rad/s."""
        return self.data.qvel[: self._n].tolist()

    @property
    def q(self) -> list[float]:
        """Joint angles, rad: what an encoder at the joint reads."""
        return self.data.qpos[self._n :].tolist()

    @property
    def qd(self) -> list[float]:
        """Joint velocities, rad/s."""
        return self.data.qvel[self._n :].tolist()

    @property
    def circuit_torque(self) -> list[float]:
        """Torque of each cable circuit at its motor, N m, (n,), where the last step began."""
        data = self.data
        speeds = data.ten_velocity[: 2 * self._n : 2].tolist()
        return [
            circuit.damping * speed - pull
            for circuit, speed, pull in zip(self._circuits, speeds, data.qfrc_spring[: self._n].tolist(), strict=True)
        ]

    @property
    def tensions(self) -> list[tuple[float, float]]:
        """Tension of the tight and of the loose strand of each first stage, N, where the last step began."""
        result = []
        for circuit, pull in zip(self._circuits, self.data.qfrc_spring[: self._n].tolist(), strict=True):
            difference = abs(pull) / circuit.radius
            if self._slack and difference > 2.0 * circuit.pretension:
                result.append((difference, 0.0))
            else:
                result.append((circuit.pretension + difference / 2.0, circuit.pretension - difference / 2.0))
        return result

    @property
    def cable_torque(self) -> list[float]:
        """Torque of the cables on the joints, N m, (n,), where the last step began."""
        torque: list[float] = (self.circuit_torque @ self._motor_from_joint).tolist()
        return torque

    @property
    def strain_torque(self) -> list[float]:
        """Torque on the link side of the joints' friction, N m, (n,), where the last step began.

        Cables and friction together, inertia of the pulleys taken off: what a strain gauge at the
        root of the link reads, M qdd + c(q, qd) + g - tau_ext of the links alone.
        """
        data, n = self.data, self._n
        viscous = self.model.dof_damping[n:] * self._velocity[n:]
        torque = self.circuit_torque @ self._motor_from_joint - viscous - self.model.dof_armature[n:] * data.qacc[n:]
        dry = slice(data.ne, data.ne + data.nf)
        for dof, friction in zip(data.efc_id[dry].tolist(), data.efc_force[dry].tolist(), strict=True):
            if dof >= n:
                torque[dof - n] += friction
        result: list[float] = torque.tolist()
        return result

    def loads(self) -> list[Load]:
        """What the world does to each touched, sprung or pushed cover, in the order of the arm's covers."""
        data = self.data
        parts: dict[str, list[tuple[np.ndarray, np.ndarray, float]]] = {name: [] for name in self._site}
        for i in range(data.ncon):
            first, second = data.contact.geom[i].tolist()
            cover, sign = self._cover_of_geom.get(second), 1.0
            if cover is None:
                cover, sign = self._cover_of_geom[first], -1.0
            mujoco.mj_contactForce(self.model, data, i, self._wrench)
            rotation = data.site_xmat[self._site[cover]].reshape(3, 3)
            force = rotation.T @ (sign * (data.contact.frame[i].reshape(3, 3).T @ self._wrench[:3]))
            at = rotation.T @ (data.contact.pos[i] - data.site_xpos[self._site[cover]])
            parts[cover].append((force, np.cross(at, force), float(at[0])))
        for cover, (force, torque) in self._pushes.items():
            square = float(force[1] ** 2 + force[2] ** 2)  # a force along x goes through every place
            moment = float(force[1] * torque[2] - force[2] * torque[1])
            parts[cover].append((force, torque, moment / square if square > 0.0 else np.nan))
        for tendon, body, cover, lever, rest, bilateral in self._springs:
            squeeze = rest - float(data.ten_length[tendon])
            if squeeze > 0.0 or bilateral:
                along, across = data.xmat[body].reshape(3, 3).T[:2]
                rotation = data.site_xmat[self._site[cover]].reshape(3, 3)
                force = rotation.T @ across * (squeeze * float(self.model.tendon_stiffness[tendon]))
                at = rotation.T @ (data.xpos[body] + lever * along - data.site_xpos[self._site[cover]])
                parts[cover].append((force, np.cross(at, force), float(at[0])))
        result = []
        for cover, shares in parts.items():
            weights = [float(np.linalg.norm(force)) for force, *_ in shares]
            if sum(weights) > 0.0:
                place = sum(w * x for w, (*_, x) in zip(weights, shares, strict=True)) / sum(weights)
                force = np.sum([force for force, *_ in shares], axis=0)
                moment = np.sum([moment for _, moment, _ in shares], axis=0)
                result.append(Load(cover, place, tuple(force.tolist()), tuple(moment.tolist())))
        return result


def _shares(pairs: Sequence[int], distances: Sequence[float]) -> list[float]:
    """Shares of the contacts of each pair in the stiffness of its surface.

    Ends of a tube that are in equally deep carry alike, so that a tube that lies flat feels k_c; else the deepest
    carries nearly all.  Shares by number or by depth alone would give energy to a tube that tips from end to end.
    """
    deepest = dict.fromkeys(pairs, 1e-12)
    for pair, distance in zip(pairs, distances, strict=True):
        deepest[pair] = max(deepest[pair], -distance)
    weights = [(max(-d, 0.0) / deepest[pair]) ** SHARPNESS for pair, d in zip(pairs, distances, strict=True)]
    totals = dict.fromkeys(pairs, 0.0)
    for pair, weight in zip(pairs, weights, strict=True):
        totals[pair] += weight
    return [weight / totals[pair] if totals[pair] else 0.0 for pair, weight in zip(pairs, weights, strict=True)]


def _stretch(torque: float, circuit: Circuit, slack: bool) -> float:
    """Stretch at which a circuit gives a torque, rad."""
    stretch = torque / circuit.stiffness
    limit = circuit.slack_stretch
    if slack and abs(stretch) > limit:
        stretch += math.copysign(abs(stretch) - limit, stretch)
    return stretch

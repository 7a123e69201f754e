"""The simulated arm, true to the motor shafts: rotors, elastic cables, friction with true stick, contact.

State: angle and velocity of each rotor and each joint.  Cable circuit i pulls with
tau = k_tr l + d l', l = theta_i - (row i of the inverse of (A.5)) q, at the rotor and, through the
same row, at the joints.  Dry friction is MuJoCo's friction constraint, made stiff, its level
switched before every step: F_static while stuck, F_dynamic once moving until the velocity changes
its sign (section 5.1, figure 5.1.b).
"""

import mujoco
import numpy as np

from wam_description.arm import Arm
from wam_description.mjcf import Obstacles, mjcf
from wam_description.signals import Contact

STUCK_ROTOR = 1e-5  # rad/s; below it a rotor counts as stuck: far under one step of any real motion
STUCK_JOINT = 1e-6  # rad/s; 1e-3 would make the limit cycle of (5.8) vanish
BRAKE_TORQUE = 1e3  # N m at a rotor, far above any cable


class Plant:
    """The arm in MuJoCo, stepped with motor torques, without ROS and without a clock.

    Parameters
    ----------
    arm : the arm; the plant is built from these parameters alone.
    obstacles : surfaces to touch.
    step : length of a step, s.
    """

    def __init__(self, arm: Arm, obstacles: Obstacles, step: float) -> None:
        self.model = mujoco.MjModel.from_xml_string(mjcf(arm, step, obstacles))
        self.data = mujoco.MjData(self.model)
        n = len(arm.motors.names)
        self._n = n
        self._start = arm.joints.start
        self._static = [*arm.motors.static_friction, *arm.joints.static_friction]
        self._dynamic = [*arm.motors.dynamic_friction, *arm.joints.dynamic_friction]
        self._threshold = [STUCK_ROTOR] * n + [STUCK_JOINT] * n
        self._direction = [0] * (2 * n)
        self._braked = True
        self._motor_from_joint = np.linalg.inv(np.array(arm.joint_from_motor).reshape(n, n))
        self._pushes: dict[str, tuple[np.ndarray, np.ndarray]] = {}
        self._wrench = np.zeros(6)
        self._body = {
            name: self.model.body(link).id for name, link in zip(arm.covers.names, arm.covers.links, strict=True)
        }
        self._site = {name: self.model.site(f"{name}_frame").id for name in arm.covers.names}
        self._cover_of_geom = {self.model.geom(name).id: name for name in arm.covers.names}
        self._pair = {
            frozenset((int(self.model.pair_geom1[i]), int(self.model.pair_geom2[i]))): i
            for i in range(self.model.npair)
        }
        self._surface = [
            (obstacles.stiffness[i], obstacles.damping[i])
            for _ in arm.covers.names
            for i in range(len(obstacles.names))
        ]
        self._rest()

    def _rest(self) -> None:
        """Put the arm at its start pose with the cables stretched so that they carry the links."""
        data, n = self.data, self._n
        mujoco.mj_resetData(self.model, data)
        data.qpos[n:] = self._start
        mujoco.mj_forward(self.model, data)
        tension = np.linalg.solve(self._motor_from_joint.T, data.qfrc_bias[n:])
        data.qpos[:n] = self._motor_from_joint @ data.qpos[n:] + tension / self.model.tendon_stiffness
        self._direction = [0] * (2 * n)
        self._braked = True
        self._set_friction()
        mujoco.mj_forward(self.model, data)

    def reset(self) -> None:
        """Return to power-up: start pose, at rest, brakes on, no pushes."""
        self.release()
        self._rest()

    def brake(self, on: bool) -> None:
        """Put on or release the brakes, which hold the rotors."""
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
        data.ctrl[:] = torque
        self._set_friction()
        if self._pushes:
            mujoco.mj_step1(model, data)
            self._apply_pushes()
            mujoco.mj_step2(model, data)
            data.qfrc_applied[:] = 0.0
        else:
            mujoco.mj_step(model, data)
        if data.ncon:
            self._match_surfaces()

    def _set_friction(self) -> None:
        """Friction level of every dof for the next step: static while stuck, dynamic while moving."""
        direction, levels = self._direction, self._static.copy()
        for i, velocity in enumerate(self.data.qvel.tolist()):
            way = direction[i]
            if way == 0:
                if abs(velocity) > self._threshold[i]:
                    direction[i] = 1 if velocity > 0.0 else -1
                    levels[i] = self._dynamic[i]
            elif velocity * way <= 0.0:
                direction[i] = 0
            else:
                levels[i] = self._dynamic[i]
        if self._braked:
            levels[: self._n] = [BRAKE_TORQUE] * self._n
        self.model.dof_frictionloss[:] = levels

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
        """Scale each contact so that its force is k_c depth + b_c speed, whatever mass is behind it.

        With an impedance d << 1 MuJoCo's contact force is d/(A (1 - d)) (k/d) depth, A the inverse of the mass
        that the contact feels.  Several contacts of one pair share its stiffness.
        """
        model, data = self.model, self.data
        pairs = [self._pair[frozenset(geoms)] for geoms in data.contact.geom.tolist()]
        for pair, address in zip(pairs, data.contact.efc_address.tolist(), strict=True):
            if address >= 0:
                stiffness, damping = self._surface[pair]
                scale = data.efc_diagA[address] / pairs.count(pair)
                model.pair_solref[pair] = (-stiffness * scale, -damping * scale)

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
    def cable_torque(self) -> list[float]:
        """Torque of the cables on the joints, N m, where the last step began."""
        data, model = self.data, self.model
        tension = model.tendon_stiffness * data.ten_length + model.tendon_damping[:] * data.ten_velocity
        return (tension @ self._motor_from_joint).tolist()

    @property
    def strain_torque(self) -> list[float]:
        """Torque on the link side of the joints' friction, N m, where the last step began.

        Cables and friction together, inertia of the pulleys taken off: what a strain gauge at the
        root of the link reads, M qdd + c(q, qd) + g - tau_ext of the links alone.
        """
        data, n = self.data, self._n
        torque = data.qfrc_passive[n:] - self.model.dof_armature[n:] * data.qacc[n:]
        dry = slice(data.ne, data.ne + data.nf)
        for dof, friction in zip(data.efc_id[dry].tolist(), data.efc_force[dry].tolist(), strict=True):
            if dof >= n:
                torque[dof - n] += friction
        return torque.tolist()

    def loads(self) -> list[Contact]:
        """What the world does to each touched or pushed cover, in the order of the arm's covers."""
        data = self.data
        parts: dict[str, list[tuple[np.ndarray, float]]] = {name: [] for name in self._site}
        for i in range(data.ncon):
            first, second = data.contact.geom[i].tolist()
            cover, sign = self._cover_of_geom.get(second), 1.0
            if cover is None:
                cover, sign = self._cover_of_geom[first], -1.0
            mujoco.mj_contactForce(self.model, data, i, self._wrench)
            rotation = data.site_xmat[self._site[cover]].reshape(3, 3)
            force = sign * (data.contact.frame[i].reshape(3, 3).T @ self._wrench[:3])
            place = rotation[:, 0] @ (data.contact.pos[i] - data.site_xpos[self._site[cover]])
            parts[cover].append((rotation.T @ force, float(place)))
        for cover, (force, torque) in self._pushes.items():
            square = float(force @ force)
            parts[cover].append((force, float(np.cross(force, torque)[0] / square) if square > 0.0 else np.nan))
        result = []
        for cover, shares in parts.items():
            weights = [float(np.linalg.norm(force)) for force, _ in shares]
            if sum(weights) > 0.0:
                place = sum(w * x for w, (_, x) in zip(weights, shares, strict=True)) / sum(weights)
                force = np.sum([force for force, _ in shares], axis=0)
                result.append(Contact(cover, place, tuple(force.tolist())))
        return result

"""Which step of the plant fits its stiffest mode: rotors on their cables, links on a surface.

MuJoCo steps v' = v - h M^-1 (K x + C v), x' = x + h v'.  Without damping that is stable up to h = 2/w of the fastest
mode, with damping c on a mass m up to h = 2 m/c.  A contact begins and ends between two steps, which gives energy,
the more the larger h w is.
"""

import itertools
import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import mujoco
import numpy as np

from wam_description.arm import Arm
from wam_description.contact_pairs import contact_pairs, folded
from wam_description.parameters import ParameterError, rows
from wam_description.rigid_body import Array
from wam_description.world import World
from wam_driver.thresholds import PLANT
from wam_theory.rounding import rounded_down


class Linearised(NamedTuple):
    """A linear model of the plant near one state: inertia, stiffness and damping, (m, m), and where it is."""

    inertia: Array
    stiffness: Array
    damping: Array
    where: str


def require_fitting_step(model: Any, arm: Arm, world: World, step: float) -> None:
    """Refuse a step that is too long for the plant.

    Raises
    ------
    ParameterError
        names what is too stiff, and the longest step allowed.
    """
    modes = [mode for mode in _modes(model, arm, world) if _is_too_long(mode, step)]
    if not modes:
        return
    longest, where = min(longest_step(mode, step) for mode in modes), modes[0].where  # the arm alone comes first
    raise ParameterError(
        f"the plant's step, timing.period/timing.substeps, is {step:g} s, too long for {where}; "
        f"allowed: up to {longest:.3g} s; multiply timing.substeps by {math.ceil(step / longest)} or more, "
        "or lower the stiffness or damping there"
    )


def longest_step(mode: Linearised, step: float) -> float:
    """Longest step accepted for a mode that `step`, s, is too long for; rounded down to three digits."""
    below, above = 0.0, step
    while above - below > 1e-4 * above:
        middle = 0.5 * (below + above)
        below, above = (below, middle) if _is_too_long(mode, middle) else (middle, above)
    return rounded_down(below)


def _is_too_long(mode: Linearised, step: float) -> bool:
    kick, drag = np.linalg.solve(mode.inertia, np.stack([mode.stiffness, mode.damping]))
    return _grows(kick, 0.0 * drag, step / PLANT.undamped_step) or _grows(kick, drag, step / PLANT.damped_step)


def _grows(kick: Array, drag: Array, step: float) -> bool:
    """Whether a motion with the acceleration -kick x - drag v grows from step to step."""
    one = np.eye(len(kick))
    velocity = np.hstack([-step * kick, one - step * drag])
    position = np.hstack([one, np.zeros_like(one)]) + step * velocity
    return bool(np.abs(np.linalg.eigvals(np.vstack([position, velocity]))).max() > 1.0 + PLANT.on_the_circle)


def _modes(model: Any, arm: Arm, world: World) -> Iterator[Linearised]:
    """The arm alone, then with each cover pressed on each surface, at the start and with all joints at 0."""
    n = arm.n
    data, inertia = mujoco.MjData(model), np.zeros((model.nv, model.nv))
    cables = np.hstack([np.eye(n), -arm.transmission.motor_from_joint, np.zeros((n, model.nv - 2 * n))])
    stiffness = cables.T @ np.diag([circuit.stiffness for circuit in arm.circuits]) @ cables
    stiffness += np.diag(model.jnt_stiffness[model.dof_jntid])  # of doors
    damping = cables.T @ np.diag(arm.cables.damping) @ cables + np.diag(model.dof_damping)
    for spring in world.springs.present:
        at = n + arm.joints.names.index(spring.joint)
        stiffness[at, at] += spring.stiffness * spring.lever * spring.lever
    for q in (arm.joints.start, (0.0,) * n):
        data.qpos[n : 2 * n] = q
        mujoco.mj_forward(model, data)
        mujoco.mj_fullM(model, data, inertia)
        yield Linearised(inertia.copy(), stiffness, damping, "cables, rotors, springs and hinges")
        for reach, k, b, where in _contacts(model, data, arm, world, inertia):
            square = np.outer(reach, reach)
            yield Linearised(inertia.copy(), stiffness + k * square, damping + b * square, where)


def _contacts(
    model: Any, data: Any, arm: Arm, world: World, inertia: Array
) -> Iterator[tuple[Array, float, float, str]]:
    """Velocity of both ends of each cover per joint velocity, (m,), along each axis, and the surface there."""
    touched = list(contact_pairs(arm, world))
    loosest = {name: _loosest(model, data, name, inertia) for name in world.objects if name not in world.moving}
    for one in touched:
        if not one.is_shared:  # of one corner; where all others touch, too, the body moves as a whole
            reach = loosest[one.first] - loosest.get(one.second, 0.0)
            yield reach, one.stiffness, one.damping, one.what
    for cover in rows(arm.covers):
        site = model.site(f"{cover.name}_frame").id
        rotation, origin = data.site_xmat[site].reshape(3, 3), data.site_xpos[site]
        for end in (cover.start, cover.end):
            jacobian = _jacobian(model, data, cover.link, origin + rotation @ np.array(end))
            for axis, one in itertools.product(range(3), touched):
                if cover.name == one.first or folded(cover.name) == one.second:
                    k = one.stiffness * math.sqrt(1.0 + 4.0 * one.hardening * PLANT.hardened_at / one.stiffness)
                    reach = rotation[:, axis] @ jacobian - loosest.get(one.second, 0.0)
                    yield reach, k, one.damping, f"{one.what} on {cover.name}"


def _loosest(model: Any, data: Any, name: str, inertia: Array) -> Array:
    """Velocity per joint velocity, (m,), of the corner of an object, along the axis, where it has the least inertia."""
    geom = model.geom(name).id
    rotation, half = data.geom_xmat[geom].reshape(3, 3), model.geom_aabb[geom, 3:]
    corners = (data.geom_xpos[geom] + rotation @ (half * signs) for signs in itertools.product((-1.0, 1.0), repeat=3))
    reaches = [reach for corner in corners for reach in rotation.T @ _jacobian(model, data, name, corner)]
    return max(reaches, key=lambda reach: float(reach @ np.linalg.solve(inertia, reach)))


def _jacobian(model: Any, data: Any, body: str, point: Array) -> Array:
    """Velocity of a point of a body per joint velocity, (3, m)."""
    found = np.zeros((3, model.nv))
    mujoco.mj_jac(model, data, found, None, point, model.body(body).id)
    return found

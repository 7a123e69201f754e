"""Figure 3.2.6: backdriven inertia, its isotropy, the rotors' share and friction over the workspace."""

from typing import NamedTuple

import numpy as np

from wam_analysis.table import markdown
from wam_description.arm import Arm
from wam_description.configuration import Configuration, packaged
from wam_description.rigid_body import Array, RigidBody
from wam_studies.figures.conditions import CASE
from wam_studies.figures.panels import Panel, Panels, line_only


class Backdriven(NamedTuple):
    """What a push at the tip meets in one pose, over its directions.

    Attributes
    ----------
    isotropy : least over greatest effective mass, 1 for an isotropic arm, 0 in a singular pose.
    rotor_share : of the effective mass, mean over directions.
    friction : push that moves no joint, N, median over directions.
    """

    isotropy: float
    rotor_share: float
    friction: float


class Backdriving:
    """Inertia and friction at the tip of an arm that is pushed, its motors off.

    Parameters
    ----------
    arm : of a configuration.

    Attributes
    ----------
    rotors : inertia of the rotors, (joints, joints), kg m^2.
    friction : of each joint with its motors, N m.
    """

    def __init__(self, arm: Arm) -> None:
        self._body, gears = RigidBody(arm), arm.transmission.motor_from_joint
        self.rotors = arm.rotors
        self.friction = np.array(arm.joints.static_friction) + np.abs(gears.T) @ arm.motors.static_friction
        directions = np.random.default_rng(CASE.backdriven_seed).normal(size=(CASE.backdriven_directions, 3))
        self._directions = directions / np.linalg.norm(directions, axis=1, keepdims=True)

    def mobility(self, q: tuple[float, ...], payload: float, rotors: bool = True) -> Array:
        """Acceleration of the tip over a force on it, (3, 3), 1/kg: W (1 + m W)^-1 with W = J M^-1 J^T.

        Parameters
        ----------
        q : pose, rad.
        payload : m at the tip, kg.
        rotors : whether the motors' rotors are moved, too.
        """
        jacobian = self._body.tool_jacobian(q)
        inertia = self._body.mass_matrix(q) + self._body.arm.pulleys + (self.rotors if rotors else 0.0)
        free = jacobian @ np.linalg.solve(inertia, jacobian.T)
        return np.asarray(np.linalg.solve(np.eye(3) + payload * free, free), dtype=np.float64)

    def masses(self, q: tuple[float, ...], directions: Array, payload: float = 0.0, rotors: bool = True) -> Array:
        """Effective mass, (d,), kg, of the tip along each direction, (d, 3), in a pose q, rad, with a payload, kg."""
        along = np.einsum("di,ij,dj->d", directions, self.mobility(q, payload, rotors), directions)
        return 1.0 / along

    def pushes(self, q: tuple[float, ...], directions: Array) -> Array:
        """Greatest push along each direction, (d, 3), that moves no joint, each held by its own friction only, N."""
        levers = np.maximum(np.abs(directions @ self._body.tool_jacobian(q)), 1e-12)
        return (self.friction / levers).min(axis=1)

    def at(self, q: tuple[float, ...], payload: float) -> Backdriven:
        """What a push at the tip meets in a pose q, rad, with a payload, kg."""
        whole, links = (self.masses(q, self._directions, payload, rotors) for rotors in (True, False))
        principal = np.maximum(np.linalg.eigvalsh(self.mobility(q, payload)), 1e-12)
        share = float(np.mean(1.0 - links / whole))
        pushed = float(np.median(self.pushes(q, self._directions)))
        return Backdriven(float(principal[0] / principal[-1]), share, pushed)


PAYLOADS = {"none": 0.0, "2 kg": CASE.payload}
QUANTITIES = (
    ("smallest effective mass divided by largest [-]", "{:.2g}"),
    ("fraction of the effective mass due to the rotors [-]", "{:.2g}"),
    ("largest push that moves no joint [N]", "{:.3g}"),
)


def backdrivability() -> Panels:
    """Each quantity over random poses of config/wam.yaml, the least first, with and without payload."""
    arm = Configuration.load(packaged("wam")).shared.arm
    tip, low, high = Backdriving(arm), np.array(arm.joints.lower), np.array(arm.joints.upper)
    poses = np.random.default_rng(CASE.backdriven_seed).uniform(low, high, (CASE.backdriven_poses, 4))
    part = (np.arange(CASE.backdriven_poses) + 0.5) / CASE.backdriven_poses
    found = {name: np.array([tip.at(tuple(q), mass) for q in poses]) for name, mass in PAYLOADS.items()}
    return tuple(
        Panel(
            f"{'abc'[i]})",
            quantity,
            "fraction of the poses [-]",
            tuple((f"payload {name}", line_only(np.sort(values[:, i]), part)) for name, values in found.items()),
        )
        for i, (quantity, _) in enumerate(QUANTITIES)
    )


def table(found: Panels) -> str:
    """Quantiles over random poses as Markdown."""
    rows = []
    for panel, (quantity, digits) in zip(found, QUANTITIES, strict=True):
        for label, series in panel.lines:
            quantiles = np.quantile(series.x, (0.1, 0.5, 0.9))
            rows.append((quantity, label.removeprefix("payload "), *(digits.format(value) for value in quantiles)))
    return markdown(("at the tip", "payload", "10 % quantile over the poses", "median", "90 % quantile"), rows)

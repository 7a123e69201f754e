"""Figure 3.2.6: backdriven inertia, its isotropy, the rotors' share and friction over the workspace."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_analysis.table import markdown
from wam_description.arm import Arm
from wam_description.configuration import Configuration, packaged
from wam_description.rigid_body import RigidBody
from wam_description.transmission_map import TransmissionMap
from wam_studies.figures.conditions import CASE
from wam_studies.figures.series import Numbers
from wam_studies.figures.style import picture


class Backdriven(NamedTuple):
    """At the tip, in one pose, over directions.

    Attributes
    ----------
    isotropy : least over greatest effective mass, 1 for an isotropic arm, 0 in a singular pose.
    rotor_share : of the effective mass, mean over directions.
    friction : push that moves no joint, N, median over directions.
    mass : least and greatest effective mass, kg.
    """

    isotropy: float
    rotor_share: float
    friction: float
    mass: tuple[float, float]


class BackdrivabilityMap(NamedTuple):
    """Maps over the angles of joints 2 and 4, (n, n), theta_3 = 0, with 2 kg; the same in random poses, (poses, 3)."""

    pitch: Numbers
    elbow: Numbers
    isotropy: Numbers
    rotor_share: Numbers
    friction: Numbers
    random: Numbers
    random_unloaded: Numbers


class Backdriving:
    """Inertia and friction at the tip of an arm that is pushed, its motors off.

    Parameters
    ----------
    arm : of a configuration.
    """

    def __init__(self, arm: Arm) -> None:
        self._body, gears = RigidBody(arm), TransmissionMap.of(arm).motor_from_joint
        self._rotors = TransmissionMap.of(arm).at_joints(arm.motors.inertia)
        self._armature = np.diag(arm.joints.armature)
        self._friction = np.array(arm.joints.static_friction) + np.abs(gears.T) @ arm.motors.static_friction
        directions = np.random.default_rng(CASE.backdriven_seed).normal(size=(CASE.backdriven_directions, 3))
        self._directions = directions / np.linalg.norm(directions, axis=1, keepdims=True)

    def mobility(self, q: tuple[float, ...], payload: float, rotors: bool = True) -> NDArray[np.float64]:
        """Acceleration of the tip over a force on it, (3, 3), 1/kg: W (1 + m W)^-1 with W = J M^-1 J^T.

        Parameters
        ----------
        q : pose, rad.
        payload : m at the tip, kg.
        rotors : whether the motors' rotors are moved, too.
        """
        jacobian = self._body.tool_jacobian(q)
        inertia = self._body.mass_matrix(q) + self._armature + (self._rotors if rotors else 0.0)
        free = jacobian @ np.linalg.solve(inertia, jacobian.T)
        found: NDArray[np.float64] = np.asarray(np.linalg.solve(np.eye(3) + payload * free, free), dtype=np.float64)
        return found

    def at(self, q: tuple[float, ...], payload: float) -> Backdriven:
        """Inertia and friction in this pose; arguments as in `mobility`."""
        whole, links = (self.mobility(q, payload, rotors) for rotors in (True, False))
        n = self._directions
        of_whole, of_links = (np.einsum("di,ij,dj->d", n, matrix, n) for matrix in (whole, links))
        principal = np.maximum(np.linalg.eigvalsh(whole), 1e-12)
        share = float(np.mean(1.0 - of_whole / of_links))
        levers = np.maximum(np.abs(n @ self._body.tool_jacobian(q)), 1e-12)
        pushed = float(np.median((self._friction / levers).min(axis=1)))
        masses = 1.0 / principal[-1], 1.0 / principal[0]
        return Backdriven(float(principal[0] / principal[-1]), share, pushed, masses)


def backdrivability() -> BackdrivabilityMap:
    """Maps with the parameters of config/wam.yaml."""
    arm = Configuration.load(packaged("wam")).shared.arm
    tip, low, high = Backdriving(arm), np.array(arm.joints.lower), np.array(arm.joints.upper)
    pitch, elbow = (np.linspace(low[i], high[i], CASE.backdriven_grid) for i in (1, 3))
    rows = np.array([[tip.at((0.0, a, 0.0, b), CASE.payload)[:3] for a in pitch] for b in elbow])
    poses = np.random.default_rng(CASE.backdriven_seed).uniform(low, high, (CASE.backdriven_poses, 4))
    loaded, free = (np.array([tip.at(tuple(q), m)[:3] for q in poses], dtype=np.float64) for m in (CASE.payload, 0.0))
    return BackdrivabilityMap(pitch, elbow, rows[..., 0], rows[..., 1], rows[..., 2], loaded, free)


def table(numbers: BackdrivabilityMap) -> str:
    """Quantiles over random poses as Markdown."""
    rows = []
    for payload, values in (("none", numbers.random_unloaded), ("2 kg", numbers.random)):
        for name, column, digits in (
            ("least over greatest effective mass", 0, "{:.2g}"),
            ("rotors' share of the effective mass", 1, "{:.2g}"),
            ("push that moves no joint, N", 2, "{:.3g}"),
        ):
            quantiles = np.quantile(values[:, column], (0.1, 0.5, 0.9))
            rows.append((name, payload, *(digits.format(value) for value in quantiles)))
    return markdown(("at the tip", "payload", "a tenth of the poses below", "median", "a tenth above"), rows)


def draw(numbers: BackdrivabilityMap, file: Path) -> None:
    """Maps over the angles of joints 2 and 4."""
    pitch, elbow = np.degrees(numbers.pitch), np.degrees(numbers.elbow)
    with picture(file, 10.0, 3.2) as figure:
        axes = figure.subplots(1, 3, sharey=True)
        for place, title, values, levels in (
            (axes[0], "a) least over greatest effective mass", numbers.isotropy, np.linspace(0.0, 0.6, 13)),
            (axes[1], "b) rotors' share of the effective mass", numbers.rotor_share, np.linspace(0.0, 0.24, 13)),
            (axes[2], "c) push that moves no joint [N]", numbers.friction, np.linspace(2.0, 6.0, 9)),
        ):
            drawn = place.contourf(pitch, elbow, values, levels=levels, cmap="viridis", extend="max")
            figure.colorbar(drawn, ax=place)
            place.set(title=title, xlabel=r"$\theta_2$ [°]")
        axes[0].set_ylabel(r"$\theta_4$ [°]")

"""Play a scenario without ROS: the simulator's truth and the estimate in every outer period."""

from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from wam_control.contact.contact_inference import Hypothesis
from wam_description.arm import Arm
from wam_description.configuration import Configuration
from wam_description.effects import no_effects
from wam_description.mjcf import mjcf
from wam_description.parameters import ParameterError
from wam_description.signals import Load
from wam_description.world import NO_SPRINGS, Obstacles, World
from wam_driver.safety import Mode
from wam_sim.simulation import Simulation
from wam_studies.contact.scenarios import BenchmarkScenario

NOWHERE = Obstacles((), (), (), (), (), (), (), (), ())


class EstimatedHypothesis(NamedTuple):
    """One hypothesis of the estimator."""

    cover: str
    probability: float
    position: float  # m along the link, NaN if unknown
    position_sd: float  # m
    low: float  # m, ends of the 90 % set on this cover; NaN without one
    high: float
    force: tuple[float, float, float]  # N
    moment: tuple[float, float, float]  # N m


class Record(NamedTuple):
    """One outer period: the simulator's truth and the estimate.

    Attributes
    ----------
    stamp : ns.
    q, qd : (n,), true, rad and rad/s.
    thetad : (n,), of the motors, as measured, rad/s.
    load : true, of the world on the arm.
    torques : (n,), true external joint torques, N m, by the simulator's kinematics.
    external : (n,), the estimated ones.
    external_sd : (n,), their standard deviations; empty if not recorded.
    in_contact : whether a contact was detected.
    hypotheses : of the estimator, the most probable first.
    """

    stamp: int
    q: tuple[float, ...]
    qd: tuple[float, ...]
    thetad: tuple[float, ...]
    load: Load
    torques: tuple[float, ...]
    external: tuple[float, ...]
    external_sd: tuple[float, ...]
    in_contact: bool
    hypotheses: tuple[EstimatedHypothesis, ...]


class Played(NamedTuple):
    """A scenario with its records; `failure` is the reason of an early stop, else ''."""

    scenario: BenchmarkScenario
    records: list[Record]
    failure: str


class LoadTorques:
    """Joint torques of a load on a cover by the simulator's kinematics, independent of the estimator's."""

    def __init__(self, arm: Arm) -> None:
        self._model = mujoco.MjModel.from_xml_string(mjcf(arm, 1e-3, World(NOWHERE, NO_SPRINGS), no_effects(arm)))
        self._data = mujoco.MjData(self._model)
        self._n = len(arm.joints.names)
        sites = {name: self._model.site(f"{name}_frame").id for name in arm.covers.names}
        self._at = {name: (site, int(self._model.site_bodyid[site])) for name, site in sites.items()}

    def torques(self, q: Sequence[float], load: Load) -> tuple[float, ...]:
        """Torques on the joints, (n,), N m, of a load in pose q, rad."""
        if not load.cover:
            return (0.0,) * self._n
        data, model = self._data, self._model
        site, body = self._at[load.cover]
        data.qpos[self._n :] = q
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        rotation = data.site_xmat[site].reshape(3, 3)
        result = np.zeros(model.nv)
        force, moment = rotation @ np.array(load.force), rotation @ np.array(load.moment)
        mujoco.mj_applyFT(model, data, force, moment, data.site_xpos[site], body, result)
        return tuple(result[self._n :].tolist())


def _estimated(found: Hypothesis) -> EstimatedHypothesis:
    return EstimatedHypothesis(*(getattr(found, name) for name in EstimatedHypothesis._fields))


def play(configuration: Configuration, scenario: BenchmarkScenario) -> Played:
    """Play a scenario without ROS."""
    configured = configuration.with_values(scenario.values)
    try:
        run = Simulation(configured, scenario.steps)
    except ParameterError:  # the drawn arm is stiffer than the configured one; do what the refusal advises
        finer = {"timing.substeps": 2 * configured.shared.timing.substeps}
        run = Simulation(configured.with_values(finer), scenario.steps)
    load_torques = LoadTorques(configured.shared.arm)
    records: list[Record] = []
    done = False
    while not done:
        is_outer, stamp = run.driver.is_outer, run.driver.stamp
        joints, motors = run.driver.true_joint_state, run.driver.motor_state
        load = run.driver.true_contact if is_outer else None
        done = run.step()
        if load is None:
            continue
        estimate = run.estimate
        records.append(
            Record(
                stamp=stamp,
                q=tuple(joints.position),
                qd=tuple(joints.velocity),
                thetad=tuple(motors.velocity),
                load=load,
                torques=load_torques.torques(joints.position, load),
                external=estimate.external_torques,
                external_sd=estimate.torque_sd,
                in_contact=estimate.in_contact,
                hypotheses=tuple(map(_estimated, estimate.hypotheses)),
            )
        )
        if run.driver.safety.mode is Mode.FAULT:
            return Played(scenario, records, run.driver.safety.fault)
    return Played(scenario, records, run.scenario.failure)

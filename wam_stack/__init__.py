"""The Python API of the stack in one place; the packages below it can be imported as well.

========  ===================================================
load      a configuration, with values of your own
simulate  play a scenario on the simulated arm, without ROS
read      the numbers in a bag
analyse   what a recording shows, and what is wrong with it
guard     how stable the force loop of a configuration is
identify  the arm as the controllers know it, from a recording
arm       kinematics, Jacobians and gravity torques
========  ===================================================
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np

from wam_analysis.findings.analysis import Analysis
from wam_analysis.findings.analysis import analyse as _analyse
from wam_analysis.identification.contradictions import contradictions
from wam_analysis.identification.fit import identify as _identify
from wam_analysis.identification.motion import recorded_motion
from wam_analysis.identification.overlay import model_values
from wam_analysis.identification.report import report
from wam_bag.bag import Bag, read
from wam_control.force.force_loop import ForceLoop
from wam_control.force.force_loop_parameters import ForceLoopParameters
from wam_control.force.guard import Report
from wam_control.task.scenario import ScenarioStep, load_for
from wam_description.configuration import Configuration, named_file
from wam_description.rigid_body import RigidBody
from wam_sim.recorded_run import recorded_run
from wam_sim.simulated_bag import record
from wam_sim.simulation import Simulation

__all__ = ["IdentifiedModel", "analyse", "arm", "guard", "identify", "load", "read", "simulate"]

Named = str | Path | Configuration


def load(name: str | Path = "wam", values: Mapping[str, Any] | None = None) -> Configuration:
    """A configuration.

    Parameters
    ----------
    name : of a packaged configuration, or a YAML file.
    values : that replace its own, as ``{"timing.mode": "realtime", "force_loop:force_gain": [0.01]}``.

    Raises
    ------
    ParameterError
        names the parameter and what is allowed.
    """
    configuration = Configuration.load(named_file(str(name)))
    configuration = configuration.with_values(values) if values else configuration
    _ = configuration.shared  # checks it
    return configuration


def simulate(
    configuration: Named = "wam", scenario: str | Path | Sequence[ScenarioStep] = "demo_scenario"
) -> Simulation:
    """Play a scenario to its end on the simulated arm: the same nodes and numbers as in lockstep.

    Parameters
    ----------
    configuration : an object, a name or a file.
    scenario : a name, a file, or the steps.

    Returns
    -------
    Simulation
        `rows` has what was published on each topic, `nodes` and `driver` are what was simulated.

    Raises
    ------
    RuntimeError
        where the scenario could not be played to its end; the text gives the reason.
    """
    found = _loaded(configuration)
    steps = load_for(found, str(scenario)) if isinstance(scenario, str | Path) else scenario
    run = Simulation(found, steps)
    if reason := run.play():
        raise RuntimeError(reason)
    return run


def analyse(recording: str | Path | Bag | Mapping[str, Any] | np.ndarray | Simulation) -> Analysis:
    """Analyse a recording of this stack or of another robot.

    Parameters
    ----------
    recording : a bag, also as `read` returns it; a CSV file; a table, which is a DataFrame, a dict of arrays or a
        structured array; or a simulation, which is played again and recorded.

    Raises
    ------
    BagError
        where it cannot be read, or is empty.
    ValueError
        for a simulation that was not played to its end, or was changed by hand: played again it differs.
    """
    if isinstance(recording, Simulation):
        with TemporaryDirectory() as folder:
            path = Path(folder) / "simulation"
            record(recording.configuration, recording.steps, path)
            motors = read(path, ["motor_states"]).series("motor_states")
            before = [row.values for row in recording.rows["motor_states"]]
            if not np.array_equal(np.transpose(before), [values for name, values in motors.items() if name != "time"]):
                raise ValueError("the simulation differs when it is played again; give one as `simulate` returns it")
            return analyse(path)
    return _analyse(recording.path if isinstance(recording, Bag) else recording, lambda doing: None)


def guard(configuration: Named = "wam") -> Report:
    """Stability of the force loop at its configured posture: a line of text, whether it is a warning, and numbers.

    It assesses the gains as configured, also where ``guard.mode`` is ``limit`` and a running stack would lower them.

    Raises
    ------
    ParameterError
        where the guard does not accept the gains; the text names those that it does.
    """
    found = _loaded(configuration)
    shared, own = found.shared, found.node("force_loop", ForceLoopParameters)
    mode = own.guard.mode
    if mode == "limit":
        own = replace(own, guard=replace(own.guard, mode="refuse"))
    assessed = ForceLoop(shared.model_arm, shared.servo, own, shared.timing).supervision.report
    return assessed._replace(facts=assessed.facts | ({"guard.mode": mode} if "domain" in assessed.facts else {}))


class IdentifiedModel(NamedTuple):
    """The arm as the controllers know it, from a recording.

    Attributes
    ----------
    values : of the parameters, for `load`.
    contradictions : why it cannot be a model of the configured arm; empty where it can.
    text : the values with standard deviations, for people.
    """

    values: dict[str, Any]
    contradictions: list[str]
    text: str


def identify(bag: str | Path, configuration: Named = "wam") -> IdentifiedModel:
    """Friction, masses and centres of mass of the arm, from a bag of free motion.

    Raises
    ------
    BagError
        where the bag cannot be read.
    ValueError
        where the motion does not determine them.
    """
    shared = _loaded(configuration).shared
    motion = recorded_motion(recorded_run(read(bag, may_lack=True)), shared.arm)
    found = _identify(shared, motion)
    against = list(map(str, contradictions(shared, motion, found)))
    return IdentifiedModel(model_values(shared, found, Path(bag).name), against, report(shared, found, str(bag)))


def arm(configuration: Named = "wam") -> RigidBody:
    """Kinematics and dynamics of the arm of a configuration: poses, Jacobians, gravity torques, inertia."""
    return RigidBody(_loaded(configuration).shared.arm)


def _loaded(configuration: Named) -> Configuration:
    return configuration if isinstance(configuration, Configuration) else load(configuration)

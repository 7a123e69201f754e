"""The whole stack in one Python loop, without ROS: the same machines, the same numbers, much faster.

What is recorded here is what travels over the topics in lockstep, under the same names.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from wam_control.contact_estimator import ContactEstimator, ContactEstimatorParameters
from wam_control.dither import Dither
from wam_control.force_loop import ForceLoop, ForceLoopParameters, ForceOutput
from wam_control.scenario import Scenario, ScenarioOutput, Step
from wam_control.transform import Transform
from wam_control.velocity_loop import VelocityLoop, VelocityLoopParameters
from wam_description.arm import seconds
from wam_description.configuration import Configuration
from wam_description.parameters import build, values
from wam_description.rigid_body import RigidBody
from wam_description.signals import NO_CONTACT, Contact, State
from wam_driver.driver import Driver, DriverParameters


class Row(NamedTuple):
    """One message: time and numbers; the frame where there is one."""

    stamp: int  # ns
    values: tuple[float, ...]
    frame: str = ""


Rows = dict[str, list[Row]]


class DirectRun:
    """Machines of a configuration, wired as the nodes are.

    Parameters
    ----------
    configuration : the same that the nodes take.
    steps : the scenario to play.

    Attributes
    ----------
    rows : what was said on each topic, JointState as position, velocity and effort one after the other.
    driver : the driver, for a look at the plant.
    estimate : what the contact estimator said last, all of it.
    scenario : the scenario, for its failure.
    """

    def __init__(self, configuration: Configuration, steps: Sequence[Step]) -> None:
        shared = configuration.shared
        arm, self._timing = shared.arm, shared.timing
        node = configuration.node
        self.rows: Rows = {}
        self.driver = Driver(shared, node("driver", DriverParameters))
        self.scenario = Scenario(steps)
        self._transform = Transform(arm)
        self._body = RigidBody(arm)
        servo = node("velocity_loop", VelocityLoopParameters)
        self._velocity_loop = VelocityLoop(arm.motors, servo)
        self._dither = Dither(arm, self._timing, servo.dither)
        self._force_loop = ForceLoop(arm, node("force_loop", ForceLoopParameters), self._timing)
        estimation = node("contact_estimator", ContactEstimatorParameters)
        self._estimator = ContactEstimator(arm, self._timing, estimation)
        self.estimate = self._estimator.estimate()
        self._has_sensors, self._feels_sensors = arm.joint_sensors, estimation.use_joint_sensors
        zero = [0.0] * len(arm.joints.names)
        self._used: tuple[int, list[float], list[float]] = (0, zero, zero)  # stamp, velocity, effort
        self._newest = self._used
        self._flat = {
            "driver": values(node("driver", DriverParameters)),
            "force_loop": values(node("force_loop", ForceLoopParameters)),
        }

    def play(self) -> str:
        """Play the scenario to its end; returns why it failed, '' where it did not."""
        while not self.step():
            pass
        return self.scenario.failure

    def step(self) -> bool:
        """One inner period; True where the scenario is over."""
        driver, stamp = self.driver, self.driver.stamp
        motors = driver.motor_state
        sensors = driver.joint_sensors if self._has_sensors else None
        self._say_joints("motor_states", stamp, motors)
        if sensors is not None:
            self._say_joints("joint_sensors", stamp, sensors)
        period = seconds(self._timing.period_ns)
        self._estimator.observe(motors, sensors if self._feels_sensors else None, period)
        done = False
        delayed = self._timing.outer_delay == 1 and self._newest[0] > 0
        if delayed:
            self._used = self._newest
        if driver.is_outer:
            self._say_truth(stamp)
            done = self._outer(stamp, motors, sensors)
            if self._timing.outer_delay == 0:
                self._used = self._newest
        caused, velocity, effort = self._used
        feedforward = self._dither.added(stamp, effort)
        currents = self._velocity_loop.step(
            motors.velocity, motors.effort, velocity, seconds(stamp - (caused or stamp)), feedforward, period
        )
        self._say("motor_current_command", stamp, currents)
        if not done:
            driver.command(stamp, currents)
            driver.advance(0.0)
        return done

    def _outer(self, stamp: int, motors: State, sensors: State | None) -> bool:
        dt = seconds(self._timing.outer_period_ns)
        self.estimate = estimate = self._estimator.estimate()
        contact = NO_CONTACT
        if estimate.link:
            contact = Contact(estimate.link, estimate.place, estimate.force, estimate.place_sd, estimate.probability)
        joints = self._transform.joint_state(motors)
        played = self.scenario.step(joints.position, contact, dt)
        self._request(played)
        gravity = self._body.gravity_torque(joints.position).tolist()
        external = list(estimate.external_torques)
        out = self._force_loop.step(joints, sensors, contact, external, played.force, 0.0, played.posture, None, dt)
        velocity = self._transform.motor_velocity(out.velocity)
        effort = self._transform.motor_effort(gravity, out.effort)
        self._newest = (stamp, velocity, effort)
        self._say_joints("joint_states", stamp, joints)
        self._say("gravity_effort", stamp, gravity)
        self._say("external_joint_torques", stamp, external)
        self._say("external_joint_torques_sd", stamp, estimate.torque_sd)
        frame = estimate.link or "base"
        self._say("contact/wrench", stamp, [*estimate.force, *estimate.moment], frame)
        self._say("contact/point", stamp, [estimate.place, 0.0, 0.0], frame)
        self._say("contact/spread", stamp, [estimate.place_sd, estimate.probability, estimate.direction_sd], frame)
        self._say("joint_velocity_command", stamp, out.velocity)
        self._say("joint_effort_command", stamp, out.effort)
        self._say("motor_velocity_command", stamp, velocity)
        self._say("motor_effort_command", stamp, effort)
        self._say_played(stamp, played, out)
        return played.done

    def _request(self, played: ScenarioOutput) -> None:
        plant = self.driver.plant
        if played.request == "enable":
            self.driver.enable("")
        elif played.request == "disable":
            self.driver.disable()
        for node, name, value in played.settings:
            self._flat[node][name] = value
        if played.settings:
            self.driver.rub(build(DriverParameters, self._flat["driver"]).effects.rubbing_friction)
            self._force_loop.tune(build(ForceLoopParameters, self._flat["force_loop"]))
        if played.push_cover:
            plant.push(played.push_cover, np.array(played.push_force), np.array(played.push_torque))
        else:
            plant.release()

    def _say_truth(self, stamp: int) -> None:
        contact = self.driver.true_contact
        frame = contact.cover or "base"
        self._say("motor_currents", stamp, self.driver.currents)
        self._say_joints("sim/joint_states", stamp, self.driver.true_joint_state)
        self._say("sim/contact/wrench", stamp, [*contact.force, *contact.moment], frame)
        self._say("sim/contact/point", stamp, [contact.place, 0.0, 0.0], frame)

    def _say_played(self, stamp: int, played: ScenarioOutput, out: ForceOutput) -> None:
        none = [0.0, 0.0, 0.0]
        frame = played.force.frame
        self._say("joint_posture_command", stamp, played.posture)
        self._say("force_command", stamp, [*played.force.force, *none], frame)
        push = [*played.push_force, *played.push_torque]
        self._say("sim/disturbance", stamp, push, played.push_cover or "base")
        for topic, force in (
            ("force_measured", out.measured),
            ("force_error", out.error),
            ("force_error_limited", out.limited),
        ):
            self._say(topic, stamp, [*force, *none], frame)

    def _say_joints(self, topic: str, stamp: int, state: State) -> None:
        self._say(topic, stamp, [*state.position, *state.velocity, *state.effort])

    def _say(self, topic: str, stamp: int, values: Sequence[float], frame: str = "") -> None:
        self.rows.setdefault(topic, []).append(Row(stamp, tuple(values), frame))

"""Node `scenario`: plays a task into the stack, as a user's program would."""

from collections.abc import Sequence
from typing import Any

from wam_control.contact.contact_table import contact_of
from wam_control.force.task import table_of
from wam_control.task.scenario import Scenario, ScenarioOutput, ScenarioParameters, load, script_file
from wam_control.task.scenario_settings import Setting
from wam_description.arm import Shared
from wam_description.event import Code, Event, Level
from wam_description.event_text import sentences
from wam_description.signals import NodeStatus, State, Wrench
from wam_description.status import ENABLED
from wam_description.wiring import Call, Input, Inputs, Outputs, SetParameters, reaction

BRAKED = (
    "it commanded the arm, and the brakes were on; give it, or a step before it, 'request: enable', or enable the arm "
    "before the scenario starts"
)


class ScenarioNode:
    """Streams postures, forces and pushes; releases the brakes and puts them on.

    While a request is under way nothing is streamed, so that in lockstep the arm does not move
    until the driver has answered.  If it refuses, the scenario fails and ends.

    Parameters
    ----------
    shared, own : as for every node.
    scenario : what to play, instead of the script of the parameters.

    Attributes
    ----------
    done : whether the scenario is over.
    failure : why it failed, '' where it did not.
    """

    name, parameters = "scenario", ScenarioParameters
    starts_with_all = True

    def __init__(self, shared: Shared, own: ScenarioParameters, scenario: Scenario | None = None) -> None:
        self._scenario = scenario or Scenario(load(script_file(own.script), shared), shared)
        self._covers, self._is_simulated = shared.arm.covers.names, shared.is_simulated
        self._step, self._stamp = "", 0
        self._commands_arm, self._was_enabled = False, False
        self.requests: list[Call | SetParameters] = []
        self.done, self.failure = False, ""

    @reaction(
        Input("joint_states", "position"),
        Input("contact/hypotheses"),
        outputs=("joint_posture_command", "force_command", "task_command", "sim/disturbance"),
    )
    def step(self, inputs: Inputs) -> Outputs:
        """One outer period of the task."""
        if self.done:
            return {}
        self._stamp = inputs.stamp
        contact = contact_of(inputs["contact/hypotheses"], self._covers)
        out = self._scenario.step(inputs["joint_states"].position, contact, inputs.dt)
        if (out.begins or out.done) and self._commands_arm and not self._was_enabled:
            return self._end(f"step '{self._step}': {BRAKED}")
        step, force = out.step, out.force
        settings = step.settings if out.begins else ()
        if out.request or settings or out.done:
            self._request(out, settings)
        outputs: dict[str, Any] = {
            "joint_posture_command": State(out.posture, list(out.rate), []),
            "force_command": Wrench(force.frame, force.force, force.torque),
            "task_command": table_of(None if out.done else step.task, self._covers),
            "sim/disturbance": out.push,
        }
        if out.done:
            return {**outputs, **self._end(out.failure)}
        if out.begins:  # it may have the name of the one before
            self._step, self._commands_arm = step.name, step.commands_arm
            facts = {f"{s.node}:{s.name}": str(_plain(s)) for s in settings}
            outputs["status"] = NodeStatus(Level.OK, step.name, step=step.name, stamp=inputs.stamp, facts=facts)
        return outputs

    def _request(self, out: ScenarioOutput, settings: Sequence[Setting]) -> None:
        if out.request:
            self._was_enabled |= out.request == "enable"  # or this one fails
            is_tare = out.request == "tare"
            call = Call("force_loop", "tare") if is_tare else Call("driver", "enable", out.request == "enable")
            self.requests.append(call)
        for node in dict.fromkeys(setting.node for setting in settings):
            values = {setting.name: _plain(setting) for setting in settings if setting.node == node}
            self.requests.append(SetParameters(node, values))
        if out.done:  # all nodes end with this one; the time of a real arm cannot be stopped
            self.requests.append(Call("driver", *(("pause", True) if self._is_simulated else ("enable", False))))

    def refused(self, message: str) -> Outputs:
        """End the task where a request is refused."""
        return self._end(f"step '{self._step}': {message}" if self._step else message)

    def take_status(self, status: NodeStatus) -> Outputs:
        """End the task at a fault of the driver, as no further period may come; notice that the arm is enabled."""
        if self.done or status.node != "driver":
            return {}
        self._was_enabled |= status.mode == ENABLED
        if not status.fault:
            return {}
        when = f"in step '{self._step}'" if self._step else "before the first step"
        return self._end(f"the driver stopped {when}: {status.fault}")

    def _end(self, failure: str) -> Outputs:
        self.done, self.failure = True, self.failure or failure
        level = Level.ERROR if self.failure else Level.OK
        events = () if self.failure else (Event(Code.DONE),)
        return {"status": NodeStatus(level, self.failure or sentences(events), stamp=self._stamp, events=events)}


def _plain(setting: Setting) -> Any:
    """A value as ROS parameters have it."""
    return list(setting.value) if isinstance(setting.value, tuple) else setting.value

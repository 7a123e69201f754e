"""Node `scenario`: plays a task into the stack, as a person's program would."""

from pathlib import Path
from typing import Any

from rcl_interfaces.srv import SetParameters
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_srvs.srv import SetBool

from wam_control.scenario import TUNABLE, Scenario, ScenarioOutput, ScenarioParameters, Setting, load
from wam_description.arm import seconds
from wam_description.configuration import packaged
from wam_description.signals import State
from wam_ros.lockstep import Gate, Need
from wam_ros.messages import BASE, Wrench, contact_of, read_contact, read_joint_state, read_wrench, wrench_stamped
from wam_ros.parameters import declare
from wam_ros.ports import ERROR, OK, Ports
from wam_ros.run import run

PARAMETERS = ScenarioParameters
NO_TORQUE = (0.0, 0.0, 0.0)


class ScenarioNode(Node):
    """Streams postures, forces and pushes; asks the driver to enable and to brake.

    While a request is on its way nothing is streamed, so that in lockstep the arm stands still
    until the driver has answered; where it refuses, the scenario has failed and is over.

    Attributes
    ----------
    done : whether the scenario is over, which ends the process.
    failure : why it failed, '' where it did not.
    """

    def __init__(self, **ros: Any) -> None:
        super().__init__("scenario", **ros)
        shared, own = declare(self, PARAMETERS)
        path = Path(own.script) if own.script.endswith(".yaml") else packaged(own.script)
        self._scenario = Scenario(load(path, shared.arm))
        self._ports = ports = Ports(self, shared)
        self._outer_period = shared.timing.outer_period_ns
        self._no_torque = [0.0] * len(shared.arm.joints.names)
        self._last: int | None = None
        self._step = ""
        self._is_realtime = shared.timing.mode == "realtime"
        self._pending: list[tuple[int, ScenarioOutput]] = []
        self._asking = False
        self.done = False
        self.failure = ""
        self._enable = self.create_client(SetBool, "driver/enable")
        self._pause = self.create_client(SetBool, "driver/pause")
        self._set = {name: self.create_client(SetParameters, f"{name}/set_parameters") for name in TUNABLE}
        estimated = Need(True, streamed=ports.streamed("contact_estimator"))
        gate = Gate(shared.timing, "joint_states", {"contact/wrench": estimated, "contact/point": estimated})
        joints, frames = list(shared.arm.joints.names), (BASE, *shared.arm.covers.names)
        ports.watch_peers()
        ports.feed(gate, "joint_states", lambda m: read_joint_state(m, joints, "position"), self._work)
        ports.feed(gate, "contact/wrench", lambda m: read_wrench(m, frames), self._work)
        ports.feed(gate, "contact/point", lambda m: read_contact(m, frames), self._work)

    def _work(self, stamp: int, inputs: dict[str, Any]) -> None:
        if self.done or self._scenario.done or (self._is_realtime and self._ports.absent):
            return  # in lockstep the arm does not move before all are there
        if fault := self._ports.faults.get("driver"):
            self._end(stamp, f"the driver stopped in step '{self._step}': {fault}")
            return
        dt = self._outer_period if self._last is None else stamp - self._last
        self._last = stamp
        contact = contact_of(inputs["contact/wrench"], inputs["contact/point"])
        out = self._scenario.step(inputs["joint_states"].position, contact, seconds(dt))
        if self._asking:
            self._pending.append((stamp, out))
            return
        self._act(stamp, out)

    def _act(self, stamp: int, out: ScenarioOutput) -> None:
        """Ask what has to be asked first, then stream."""
        if out.request:
            self._ask(self._enable, out.request == "enable", stamp, out._replace(request=""))
        elif out.settings:
            self._tune(stamp, out)
        elif out.done and not self.done and not self._asking:
            self._ask(self._pause, True, stamp, out)
        else:
            self._stream(stamp, out)

    def _ask(self, client: Any, data: bool, stamp: int, out: ScenarioOutput) -> None:
        self._asking = True

        def answered(future: Any) -> None:
            answer = future.result()
            self._asking = False
            if not answer.success:
                self._end(stamp, answer.message)
                return
            if client is self._pause:
                self._stream(stamp, out)
                self._end(stamp, out.failure)
                return
            self._go_on(stamp, out)

        client.call_async(SetBool.Request(data=data)).add_done_callback(answered)

    def _tune(self, stamp: int, out: ScenarioOutput) -> None:
        """Set the parameters of one node, then go on with those of the next."""
        node = out.settings[0].node
        mine = [setting for setting in out.settings if setting.node == node]
        rest = tuple(setting for setting in out.settings if setting.node != node)
        self._asking = True

        def answered(future: Any) -> None:
            self._asking = False
            refused = [result.reason for result in future.result().results if not result.successful]
            if refused:
                self._end(stamp, f"step '{out.step}': {node} refuses: {'; '.join(refused)}")
                return
            self._ports.set_status(OK, out.step, stamp=str(stamp), **{f"{s.node}:{s.name}": _said(s) for s in mine})
            self._go_on(stamp, out._replace(settings=rest))

        parameters = [Parameter(setting.name, value=_plain(setting)).to_parameter_msg() for setting in mine]
        self._set[node].call_async(SetParameters.Request(parameters=parameters)).add_done_callback(answered)

    def _go_on(self, stamp: int, out: ScenarioOutput) -> None:
        """Act on what an answer has been waited for, and on what has come since."""
        self._act(stamp, out)
        while self._pending and not self._asking:
            self._act(*self._pending.pop(0))

    def _stream(self, stamp: int, out: ScenarioOutput) -> None:
        ports = self._ports
        if out.step != self._step:
            self._step = out.step
            ports.set_status(OK, out.step, stamp=str(stamp))
            self.get_logger().info(f"{stamp / 1e9:6.2f} s  {out.step}")
        force = out.force
        ports.publish_joints("joint_posture_command", stamp, State(out.posture, [], []))
        ports.publish("force_command", wrench_stamped(stamp, Wrench(force.frame, force.force, NO_TORQUE)))
        frame = out.push_cover or BASE
        ports.publish("sim/disturbance", wrench_stamped(stamp, Wrench(frame, out.push_force, out.push_torque)))
        ports.report(stamp)

    def _fail(self, stamp: int, reason: str) -> None:
        self.failure = self.failure or reason
        self.get_logger().error(reason)

    def _end(self, stamp: int, failure: str) -> None:
        if failure:
            self._fail(stamp, failure)
        self._ports.set_status(ERROR if self.failure else OK, self.failure or "done", stamp=str(stamp))
        self.done = True


def _plain(setting: Setting) -> Any:
    return list(setting.value) if isinstance(setting.value, tuple) else setting.value


def _said(setting: Setting) -> str:
    return str(_plain(setting))


def main() -> None:
    """Run the node as this process."""
    run(ScenarioNode)


if __name__ == "__main__":
    main()

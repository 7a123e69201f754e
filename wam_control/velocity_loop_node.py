"""Node `velocity_loop`: the inner loop, motor states in, motor currents out."""

from typing import Any, NamedTuple

from rclpy.node import Node

from wam_control.dither import Dither
from wam_control.velocity_loop import VelocityLoop, VelocityLoopParameters
from wam_description.arm import seconds
from wam_description.signals import State
from wam_ros.lockstep import Gate, Need
from wam_ros.messages import read_joint_state, stamp_of
from wam_ros.parameters import declare, follow
from wam_ros.ports import Ports
from wam_ros.run import raise_priority, run

PARAMETERS = VelocityLoopParameters


class _Command(NamedTuple):
    stamp: int
    values: list[float]


class VelocityLoopNode(Node):
    """Answers each motor state with currents, from the newest velocity and effort commands."""

    def __init__(self, **ros: Any) -> None:
        super().__init__("velocity_loop", **ros)
        shared, own = declare(self, PARAMETERS)
        if shared.timing.mode == "realtime":
            raise_priority(shared.timing.niceness)
        self._loop = VelocityLoop(shared.arm.motors, own)
        self._dither = Dither(shared.arm, shared.timing, own.dither)
        follow(self, own, self._loop.tune)
        self._ports = ports = Ports(self, shared)
        cost = self._dither.cost(shared.arm.joints.start)
        if cost.tip_motion:
            ports.facts |= {
                "dither, most tip motion": f"{cost.tip_motion * 1e3:.2g} mm",
                "dither, heat": f"{max(cost.heat):.2%} of what a winding stands",
            }
        motors = list(shared.arm.motors.names)
        self._still = _Command(0, [0.0] * len(motors))
        self._period = shared.timing.period_ns
        self._last: int | None = None
        delay = shared.timing.outer_delay
        gate = Gate(
            shared.timing,
            "motor_states",
            {
                "motor_velocity_command": Need(True, delay, ports.streamed("transform", "force_loop")),
                "motor_effort_command": Need(True, delay, ports.streamed("transform", "gravity")),
            },
        )
        ports.feed(gate, "motor_states", lambda m: read_joint_state(m, motors, "position velocity effort"), self._work)
        ports.feed(
            gate,
            "motor_velocity_command",
            lambda m: _Command(stamp_of(m), read_joint_state(m, motors, "velocity?").velocity),
            self._work,
        )
        ports.feed(
            gate,
            "motor_effort_command",
            lambda m: _Command(stamp_of(m), read_joint_state(m, motors, "effort").effort),
            self._work,
        )

    def _work(self, stamp: int, inputs: dict[str, Any]) -> None:
        motors: State = inputs["motor_states"]
        velocity = inputs["motor_velocity_command"] or self._still._replace(stamp=stamp)
        effort = inputs["motor_effort_command"] or self._still
        dt = self._period if self._last is None else stamp - self._last
        self._last = stamp
        currents = self._loop.step(
            motors.velocity,
            motors.effort,
            velocity.values,
            seconds(stamp - velocity.stamp),
            self._dither.added(stamp, effort.values),
            seconds(dt),
        )
        self._ports.publish_motors("motor_current_command", stamp, State([], [], currents))
        self._ports.report(stamp)


def main() -> None:
    """Run the node as this process."""
    run(VelocityLoopNode)


if __name__ == "__main__":
    main()

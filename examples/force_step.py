"""A node of your own: touch the foam box, press 5 N, then 10 N, print what was measured, brake.

Start the stack in one terminal, `wam up`, and this in another, `python3 examples/force_step.py`.
It does not import this package: it needs only topics and one service (docs/topics.md).
"""

import sys
import time
from collections.abc import Iterator

import rclpy
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import WrenchStamped
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool

ABOVE = [0.0, -1.8, 0.0, 1.45]  # rad, joint1..joint4, as in config/demo_scenario.yaml
BELOW = [0.0, -2.1, 0.0, 1.45]
DETECTED = 1.5  # N
PERIOD = 0.005  # s, of joint_states
PATIENCE = 10.0  # s, without joint_states
COMMANDS = {"joint_posture_command", "force_command"}


class ForceStep(Node):
    """Answers each joint state with a posture and a force; the task is a generator, one yield per period."""

    def __init__(self) -> None:
        super().__init__("force_step", namespace="wam")
        self.q: list[float] = []
        self.touch = self.measured = 0.0
        self.refusal = ""
        self.posture = self.create_publisher(JointState, "joint_posture_command", 10)
        self.force = self.create_publisher(WrenchStamped, "force_command", 10)
        self.enable = self.create_client(SetBool, "driver/enable")
        self.create_subscription(WrenchStamped, "contact/wrench", self.take_contact, 10)
        self.create_subscription(WrenchStamped, "force_measured", self.take_measured, 10)
        self.create_subscription(JointState, "joint_states", self.take_joints, 10)
        latched = QoSProfile(depth=20, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.create_subscription(DiagnosticStatus, "status", self.take_status, latched)
        self.wanted, self.newtons = [0.0] * 4, 0.0
        self.task = self.play()
        self.is_enabled = self.is_done = False
        self.last = time.monotonic()

    def take_contact(self, message: WrenchStamped) -> None:
        """Keep the size of the estimated contact force, N."""
        force = message.wrench.force  # of the world on the link
        self.touch = (force.x**2 + force.y**2 + force.z**2) ** 0.5

    def take_status(self, message: DiagnosticStatus) -> None:
        """Keep why the force loop refuses a command; end where the arm is no longer enabled."""
        facts = {item.key: item.value for item in message.values}
        if message.name == "force_loop":  # where it does not obey a command, its message is the reason
            self.refusal = message.message if COMMANDS.intersection(facts.get("refused", "").split(", ")) else ""
        if message.name != "driver":
            return
        if facts.get("mode") == "enabled":
            self.is_enabled = True
        elif self.is_enabled and facts.get("fault"):
            sys.exit(f"the driver stopped: {facts['fault']}; call reset_fault, then start again")
        elif self.is_enabled:
            sys.exit("another program put on the brakes; start again")

    def take_measured(self, message: WrenchStamped) -> None:
        """Keep the measured force of the arm along the commanded one, N."""
        self.measured = -message.wrench.force.y  # of the arm on the world

    def take_joints(self, message: JointState) -> None:
        """Answer a state of the arm with a posture and a force."""
        position = dict(zip(message.name, message.position, strict=True))
        self.last = time.monotonic()
        self.q = [position[f"joint{i}"] for i in (1, 2, 3, 4)]  # by name, never by index
        if next(self.task, "done") == "done":
            self.is_done = True
            return
        posture = JointState(name=["joint1", "joint2", "joint3", "joint4"], position=self.wanted)
        force = WrenchStamped()
        posture.header.stamp = force.header.stamp = message.header.stamp  # the state that caused them
        force.header.frame_id = "outer_link"
        force.wrench.force.y = -self.newtons
        self.posture.publish(posture)
        self.force.publish(force)

    def play(self) -> Iterator[None]:
        """Enable the arm, press twice and go back; each `yield` waits for the next state."""
        self.wanted = list(self.q)
        yield from self.ask(True)
        yield from self.move(ABOVE, 2.0)
        yield from self.move(BELOW, 4.0)
        if self.touch < DETECTED:
            sys.exit("no contact was detected; is the box at its position of config/wam.yaml?")
        for newtons in (5.0, 10.0):
            self.newtons, sum_of_all = newtons, 0.0
            for period in range(500):
                yield
                if self.refusal:
                    sys.exit(f"{newtons:g} N were refused: {self.refusal}")
                sum_of_all += self.measured / 200 if period >= 300 else 0.0
            print(f"commanded {newtons:5.2f} N, measured {sum_of_all:5.2f} N", flush=True)
        self.newtons, self.wanted = 0.0, list(self.q)
        yield from self.move(ABOVE, 2.0)
        self.is_enabled = False  # what the driver reports next is no surprise
        yield from self.ask(False)

    def ask(self, on: bool) -> Iterator[None]:
        """Enable or brake the arm."""
        while not self.enable.service_is_ready():
            yield
        answer = self.enable.call_async(SetBool.Request(data=on))
        while not answer.done():
            yield
        if not answer.result().success:
            sys.exit(answer.result().message)

    def move(self, goal: list[float], seconds: float) -> Iterator[None]:
        """Along a straight line; ends early if a contact is detected on the way down."""
        start, count = list(self.wanted), int(seconds / PERIOD)
        for i in range(1, count + 1):
            self.wanted = [a + (b - a) * i / count for a, b in zip(start, goal, strict=True)]
            yield
            if goal is BELOW and self.touch >= DETECTED:
                break
        if self.refusal:
            sys.exit(f"a command was refused: {self.refusal}")


def main() -> None:
    """Run the node until it has played all steps."""
    rclpy.init()
    node = ForceStep()
    while not node.is_done:
        rclpy.spin_once(node, timeout_sec=0.1)
        if time.monotonic() - node.last > PATIENCE:
            sys.exit(f"no /wam/joint_states for {PATIENCE:g} s; start the stack first: wam up")
    rclpy.try_shutdown()


if __name__ == "__main__":
    main()

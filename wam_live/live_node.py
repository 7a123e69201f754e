"""A running stack as the source of the page, and what the page asks of it.

The page must not disturb the run: it listens with the least demanding quality of service, looks at most `RATE` times a
second, and publishes nothing before somebody drags or presses.
"""

import time
from collections.abc import Callable, Mapping
from typing import Any, Final

from rcl_interfaces.srv import SetParameters as SetParametersService
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from std_srvs.srv import SetBool, Trigger

from wam_control.contact_table import contact_of, likely_of
from wam_description.arm import Shared
from wam_description.parameters import build, build_part, fields
from wam_description.signals import BASE, NO_CONTACT, Contact, NodeStatus, State, Table, Wrench
from wam_description.topics import BY_NAME, STATUS
from wam_description.wiring import Call, SetParameters
from wam_description.world import Obstacles
from wam_live.page import quiet, serve
from wam_live.panel import SLIDERS, Panel, Press, Request
from wam_live.scene import RELEASE, Push, Scene
from wam_live.snapshot import NAN, Snapshot, size
from wam_ros.messages import Refused, message_type, read_status
from wam_ros.remote_parameters import RemoteParameters
from wam_ros.run import Connection
from wam_ros.wire import decoder, encoder, stamp_of

RATE: Final = 30.0  # Hz, of the picture
PANEL_EVERY: Final = 6  # pictures, between changes of plots and texts
TOPICS: Final = (
    "joint_states",
    "sim/joint_states",
    "sim/contact/wrench",
    "sim/contact/point",
    "contact/hypotheses",
    "force_command",
    "force_measured",
)
NEWEST: Final = QoSProfile(reliability=ReliabilityPolicy.BEST_EFFORT, history=HistoryPolicy.KEEP_LAST, depth=1)
LATCHED: Final = QoSProfile(
    reliability=ReliabilityPolicy.RELIABLE,
    history=HistoryPolicy.KEEP_LAST,
    depth=50,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)


class StackSource:
    """The newest of each topic of a running stack.

    Parameters
    ----------
    context : of ROS.
    namespace : of the stack.
    shared : shared parameters of the driver.
    """

    def __init__(self, context: Any, namespace: str, shared: Shared) -> None:
        # its node is in no executor: what has come is taken when a picture is drawn
        self.node = Node("live_view", context=context, namespace=namespace)
        self._shared, self._covers = shared, shared.arm.covers.names
        self._topics = {
            name: (
                self.node.create_subscription(message_type(BY_NAME[name]), name, print, NEWEST, raw=True),
                decoder(BY_NAME[name], shared, "position?" if "joint" in name else ""),
            )
            for name in TOPICS
        }
        self._status = self.node.create_subscription(message_type(BY_NAME[STATUS]), STATUS, print, LATCHED)
        self._newest: dict[str, Any] = {}
        self._stamps: dict[str, int] = {}
        self._statuses: dict[str, NodeStatus] = {}
        self._publishers: dict[str, Any] = {}
        self._pace: tuple[float, int] = (time.monotonic(), 0)
        self._factor = NAN

    def snapshot(self) -> Snapshot:
        """What the stack shows now."""
        for name, (subscription, decode) in self._topics.items():
            if (data := _taken(subscription, raw=True)) is not None:
                try:
                    self._newest[name], self._stamps[name] = decode(data), stamp_of(data)
                except Refused:
                    continue
        while (message := _taken(self._status, raw=False)) is not None:
            status = read_status(message)
            self._statuses[status.node] = status
        truth = self._newest.get("sim/joint_states")
        joints: State | None = truth or self._newest.get("joint_states")
        table: Table | None = self._newest.get("contact/hypotheses")
        return Snapshot(
            stamp=self.stamp,
            q=tuple(joints.position) if joints else (),
            true=self._true(),
            estimated=contact_of(table, self._covers),
            likely=likely_of(table, self._covers),
            commanded=self._force("force_command"),
            measured=self._force("force_measured"),
            statuses=self._statuses,
            real_time_factor=self._real_time_factor(),
        )

    @property
    def stamp(self) -> int:
        """Time of the newest state of the arm, ns."""
        return max(self._stamps.get("joint_states", 0), self._stamps.get("sim/joint_states", 0))

    def publish(self, topic: str, value: Wrench) -> str:
        """Publish a command as the answer to the newest state; returns why that is not possible, '' where it is."""
        if topic not in self._publishers:
            if others := self.node.count_publishers(topic):
                return f"{others} publisher{'s' * (others > 1)} of {topic} is there already, as a scenario is"
            row = BY_NAME[topic]
            self._publishers[topic] = (
                self.node.create_publisher(message_type(row), topic, 10),
                encoder(row, self._shared),
            )
        publisher, encode = self._publishers[topic]
        publisher.publish(encode(self.stamp, value))
        return ""

    def _true(self) -> Contact:
        wrench, point = self._newest.get("sim/contact/wrench"), self._newest.get("sim/contact/point")
        if wrench is None or point is None or wrench.frame == BASE or wrench.frame != point.frame:
            return NO_CONTACT
        return Contact(wrench.frame, point.position[0], wrench.force)

    def _force(self, topic: str) -> float:
        wrench = self._newest.get(topic)
        return size(wrench.force) if wrench is not None and self.stamp - self._stamps[topic] < 500_000_000 else NAN

    def _real_time_factor(self) -> float:
        now, (then, stamp) = time.monotonic(), self._pace
        if now - then > 1.0:
            if 0 < stamp <= self.stamp:
                self._factor = (self.stamp - stamp) / 1e9 / (now - then)
            self._pace = now, self.stamp
        return self._factor


def _taken(subscription: Any, raw: bool) -> Any:
    with subscription.handle:
        taken = subscription.handle.take_message(subscription.msg_type, raw)
    return None if taken is None else taken[0]


class LivePage:
    """The page of a running stack.

    Parameters
    ----------
    namespace : of the stack.
    port : to listen on.
    say : called with lines for people.
    domain_id : ROS domain, the one of the environment where None.

    Attributes
    ----------
    scene, panel : what the page shows, None before the stack has answered.
    """

    scene: Scene | None = None
    panel: Panel | None = None

    def __init__(self, namespace: str, port: int, say: Callable[[str], None], domain_id: int | None = None) -> None:
        self._namespace, self._port, self._say = namespace, port, say
        self._connection = Connection(domain_id=domain_id)
        self._asking = Node("live", context=self._connection.context, namespace=namespace)
        self._connection.add(self._asking)
        self._clients: dict[tuple[str, str], Any] = {}
        self._server: Any = None
        self._wrench = Press(BASE, (0.0, 0.0, 0.0))
        self._push: Push | None = None
        self._live: dict[tuple[str, str], Any] = {}

    def run(self, until: Callable[[], bool]) -> None:
        """Serve the page until a condition holds; a stack that is not there yet is waited for."""
        self._server = serve(self._port)
        try:
            flat = self._parameters(until)
            if flat is None:
                return
            names = {field.name.partition(".")[0] for field in fields(Shared)}
            driver = flat["driver"]
            shared = build(Shared, {k: v for k, v in driver.items() if k.partition(".")[0] in names})
            obstacles = build_part(Obstacles, driver, "world.obstacles.")
            source = StackSource(self._connection.context, self._namespace, shared)
            self.scene = scene = Scene(self._server, shared.arm, obstacles, self._take_push)
            self._live = {key: flat[key[0]][key[1]] for key in SLIDERS if key[1] in flat.get(key[0], {})}
            self.panel = panel = Panel(self._server, shared.arm, self._live)
            self._server.on_client_disconnect(lambda _: scene.let_go())
            self._say(f"live page: http://{self._server.get_host()}:{self._port}")
            self._draw(source, scene, panel, until)
        finally:
            self.close()

    def close(self) -> None:
        """End the server and leave ROS."""
        if self._server is not None:
            with quiet():
                self._server.stop()
            self._server = None
        self._connection.close()

    def _parameters(self, until: Callable[[], bool]) -> Mapping[str, Mapping[str, Any]] | None:
        asked = RemoteParameters(self._asking, ["driver", *dict.fromkeys(node for node, _ in SLIDERS)])
        begin = time.monotonic()
        while not until():
            asked.ask()
            self._connection.executor.spin_once(timeout_sec=0.05)
            late = time.monotonic() - begin > 2.0
            if "driver" in asked.found and (late or not asked.missing):
                return asked.found
        return None

    def _draw(self, source: StackSource, scene: Scene, panel: Panel, until: Callable[[], bool]) -> None:
        count, next_time = 0, time.monotonic()
        while not until():
            next_time = max(next_time + 1.0 / RATE, time.monotonic())
            while (left := next_time - time.monotonic()) > 0.0:
                self._connection.executor.spin_once(timeout_sec=left)
            snapshot = source.snapshot()
            with self._server.atomic():
                scene.show(snapshot)
                pushing = scene.drag()
                if count % PANEL_EVERY == 0:
                    panel.show(snapshot, pushing)
            count += 1
            self._send(source, panel)
            while not panel.requests.empty():
                self._ask(panel.requests.get(), panel)

    # what the page asks for

    def _take_push(self, push: Push) -> None:
        self._push = push

    def _send(self, source: StackSource, panel: Panel) -> None:
        """Stream the force that is pressed with, and the push until it is released."""
        if any(self._wrench.force) and (
            refusal := source.publish("force_command", Wrench(*self._wrench, (0.0, 0.0, 0.0)))
        ):
            self._wrench = Press(BASE, (0.0, 0.0, 0.0))
            panel.say(f"not pressed: {refusal}", refused=True)
        push = self._push
        if push is None:
            return
        refusal = source.publish("sim/disturbance", Wrench(*push))
        if refusal:
            panel.say(f"not pushed: {refusal}", refused=True)
        if (push is RELEASE or refusal) and self._push is push:  # a newer one may have come from the browser meanwhile
            self._push = None

    def _ask(self, request: Request, panel: Panel) -> None:
        if isinstance(request, Press):
            self._wrench = request
            panel.say(f"pressing with {size(request.force):.1f} N" if any(request.force) else "letting go")
            return
        if isinstance(request, SetParameters):
            kind: Any = SetParametersService
            service = f"{request.node}/set_parameters"
            sent = [Parameter(name, value=value).to_parameter_msg() for name, value in request.values.items()]
            message: Any = SetParametersService.Request(parameters=sent)
        else:
            kind = Trigger if request.data is None else SetBool
            service = f"{request.node}/{request.service}"
            message = Trigger.Request() if request.data is None else SetBool.Request(data=request.data)
        if (service, kind) not in self._clients:
            self._clients[service, kind] = self._asking.create_client(kind, service)
            self._clients[service, kind].wait_for_service(0.5)
        client = self._clients[service, kind]
        if not client.service_is_ready():
            panel.say(f"{request.node} does not answer", refused=True)
            return
        client.call_async(message).add_done_callback(lambda future: self._answered(request, future.result(), panel))

    def _answered(self, request: Call | SetParameters, answer: Any, panel: Panel) -> None:
        if isinstance(request, Call):
            panel.say(answer.message, refused=not answer.success)
            return
        reasons = "; ".join(result.reason for result in answer.results if not result.successful)
        for name, value in request.values.items():
            if reasons:
                panel.set_slider(request.node, name, self._live[request.node, name])
            else:
                self._live[request.node, name] = value
            panel.say(reasons or f"{name} = {value}", refused=bool(reasons))

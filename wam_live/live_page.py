"""The page of a running stack, and what the page asks of it.

It publishes nothing before somebody drags or presses, and no longer than that.
"""

import time
from collections.abc import Callable, Mapping
from typing import Any

from wam_description.arm import Shared, Timing
from wam_description.parameters import build_part
from wam_description.signals import ZERO, Answer, Wrench
from wam_description.topics import BY_NAME
from wam_description.wiring import Call, SetParameters
from wam_description.world import World
from wam_live.hold import HeldTopic
from wam_live.page import name_page, quiet, serve, url
from wam_live.panel import DITHER, NO_PRESS, SLIDERS, Bend, Controls, Play, Press, Request, paragraph
from wam_live.push import release
from wam_live.scenario_player import ScenarioPlayer
from wam_live.scene import Scene
from wam_live.services import SERVICES
from wam_live.snapshot import size
from wam_live.stack_source import RunningStack
from wam_live.thresholds import LIVE
from wam_ros.client import StackClient
from wam_ros.messages import message_type
from wam_ros.requests import answer_of
from wam_ros.ros_topics import qos
from wam_ros.run import Connection
from wam_ros.wire import stamp_in


class LivePage:
    """The page of a running stack, served at once; it waits for the stack.

    Parameters
    ----------
    namespace : of the stack.
    port : to listen on.
    notify : called with lines for people.
    domain_id : ROS domain, the one of the environment where None.

    Attributes
    ----------
    shown : what the page shows, None before the stack has answered.
    """

    def __init__(self, namespace: str, port: int, notify: Callable[[str], None], domain_id: int | None = None) -> None:
        self._connection = Connection(domain_id=domain_id)
        self._client = StackClient(namespace, "live", self._connection)
        self._client.follow_statuses()
        self._server = serve(port)
        self._waiting = self._server.gui.add_html(paragraph("waiting for the arm; <code>wam up</code> starts one"))
        notify(f"live page: {url(port)}")
        self.shown: ShownStack | None = None

    def run(self, until: Callable[[], bool]) -> None:
        """Show the stack until a condition holds, then leave; it may start later."""
        try:
            flat = self._client.await_driver(until, dict.fromkeys(node for node, _ in SLIDERS))
            if not flat:
                return
            self._waiting.remove()
            self.shown = shown = ShownStack(self._server, self._client, self._connection.context, flat)
            next_time = time.monotonic()
            while not until():
                next_time = max(next_time + 1.0 / LIVE.rate, time.monotonic())
                while (left := next_time - time.monotonic()) > 0.0:
                    self._connection.executor.spin_once(timeout_sec=left)
                shown.draw()
            shown.release()
        finally:
            with quiet():
                self._server.stop()
            self._connection.close()


class ShownStack:
    """A stack on the page, and what the page asks of it.

    Parameters
    ----------
    server : of the page.
    client : of the stack.
    context : of ROS.
    flat : parameters of the nodes, by node.

    Attributes
    ----------
    scene, panel : what the page shows.
    player : of scenarios.
    """

    def __init__(self, server: Any, client: StackClient, context: Any, flat: Mapping[str, Mapping[str, Any]]) -> None:
        self._server, self._client, self._node = server, client, client.node
        shared, world = build_part(Shared, flat["driver"]), build_part(World, flat["driver"], "world.")
        namespace = self._node.get_namespace()
        more = f", {shared.arm.name}, since {time.strftime('%H:%M:%S')}"
        name_page(server, f"{namespace}, domain {context.get_domain_id()}", more)
        self._source = RunningStack(context, namespace, shared)
        self._press: Press | None = None
        self._states: Any = None  # subscription while somebody presses
        self._force, self._push = (HeldTopic(self._node, name, shared) for name in ("force_command", "sim/disturbance"))
        self.scene = Scene(server, shared.arm, world, draggable=True)
        sliders = [key for key in SLIDERS if key != DITHER or shared.timing.dither_cycle]
        self._live = {key: flat[key[0]][key[1]] for key in sliders if key[1] in flat.get(key[0], {})}
        self._bent = tuple(flat.get("force_loop", {}).get("guard.posture", ()))  # posture for a press, rad
        self.panel = Controls(server, shared.arm, self._live, dither_text(shared.timing))
        self.player = ScenarioPlayer(shared, namespace.strip("/"))
        self._pictures = 0
        for request in (call for _, calls in SERVICES.values() for call in calls):
            client.service(request)  # so that each is found before it is needed
        for node, _ in sliders:
            client.service(SetParameters(node, {}))
        server.on_client_disconnect(lambda _: self.panel.requests.put(NO_PRESS))  # nobody sees the force

    def draw(self) -> None:
        """Show the present instant, and do what was requested on the page."""
        snapshot = self._source.snapshot()._replace(statuses=self._client.statuses)
        with self._server.atomic():
            self.scene.show(snapshot)
            push = self.scene.push()
            self.panel.take(snapshot)
            if self._pictures % LIVE.panel_every == 0:
                pushing, pressing = (size(one.force) if one else 0.0 for one in (push, self._press))
                self.panel.show(snapshot, pushing, pressing)
        self._pictures += 1
        self._send(push)
        if ended := self.player.ended():
            self.panel.notify(ended)
            self._ask(Call("driver", "pause", False), ended)  # a scenario pauses the arm at its end
        while not self.panel.requests.empty():
            self._ask(self.panel.requests.get())

    def release(self) -> None:
        """End what the page commands."""
        self._end_press()
        self._send(None)
        self.player.close()

    @property
    def _is_enabled(self) -> bool:
        return self._client.mode == "enabled"

    def _send(self, push: Wrench | None) -> None:
        """Stream the push of a drag until its end; end a force whose arm has stopped."""
        if self._press is not None and not self._is_enabled:
            self._end_press()
            self.panel.notify("letting go: the arm is not enabled")
        if push is None:
            release(self._push, self._source.stamp)
        elif refusal := self._push.send(self._source.stamp, push):
            self.panel.notify(f"not pushed: {refusal}", refused=True)

    def _start_press(self, press: Press) -> None:
        """Answer each state with the force from now on."""
        self._press = press
        if self._states is None:
            row = BY_NAME["joint_states"]
            self._states = self._node.create_subscription(message_type(row), row.name, self._answer, qos(row), raw=True)

    def _answer(self, state: bytes) -> None:
        if self._press is None:
            return
        if refusal := self._force.send(stamp_in(state), Wrench(*self._press, ZERO)):
            self._press = None
            self.panel.notify(f"not pressed: {refusal}", refused=True)

    def _end_press(self) -> None:
        self._press = None
        if self._states is not None:
            self._node.destroy_subscription(self._states)
            self._states = None
            self._force.end()

    def _bend(self) -> str:
        """Move to the posture for a press; returns why that is not possible, '' where it is."""
        present = self._source.snapshot().q
        return self.player.move(present, self._bent) if len(self._bent) == len(present) else "no force loop runs"

    def _ask(self, request: Request, text: str = "") -> None:
        """Make a request, and show its answer, or a text in place of it."""
        refusal = ""
        match request:
            case Call() | SetParameters():
                self._call(request, text)
                return
            case Press(_, force) if not any(force):
                if self._press is None:
                    return
                self._end_press()
                text = "letting go"
            case Play(""):
                self.player.stop()
                text = "the scenario ends"
            case Play(script):
                refusal, text = self.player.play(script), f"playing {script}"
            case _ if not self._is_enabled:
                refusal = "enable the arm first"
            case Press():
                self._start_press(request)  # the status has what becomes of it
            case Bend():
                refusal, text = self._bend(), "bending the arm"
        self.panel.notify(refusal or text, refused=bool(refusal))

    def _call(self, request: Call | SetParameters, text: str) -> None:
        client, message = self._client.service(request)
        if not client.service_is_ready():  # the page waits for no node: the next request may be an emergency stop
            self.panel.notify(f"{request.node} does not answer", refused=True)
            return
        client.call_async(message).add_done_callback(
            lambda future: self._answered(request, answer_of(request, future.result()), text)
        )

    def _answered(self, request: Call | SetParameters, reply: Answer, text: str) -> None:
        if isinstance(request, Call):
            self.panel.notify(text or reply.message, refused=not reply.success)
            return
        for name, value in request.values.items():
            if not reply.success:
                self.panel.set_slider(request.node, name, self._live[request.node, name])
            else:
                self._live[request.node, name] = value
            self.panel.notify(reply.message or f"{name} = {value}", refused=not reply.success)


def dither_text(timing: Timing) -> str:
    """What the page shows of the dither, whose period is set when the nodes start: the estimator averages over it."""
    if timing.dither_cycle:
        return f"dither: {1.0 / (timing.dither_cycle * timing.period):.0f} Hz"
    return "dither: off; without joint sensors, contacts at rest need timing.dither_cycle=40 from the start"

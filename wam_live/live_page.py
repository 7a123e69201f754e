"""The page of a running stack, and what the page asks of it.

It publishes nothing before somebody drags or presses, and no longer than that.
"""

import time
from collections.abc import Callable
from typing import Any

from wam_description.arm import Shared, Timing
from wam_description.parameters import build_part
from wam_description.signals import Wrench
from wam_description.topics import BY_NAME
from wam_description.wiring import Call, SetParameters
from wam_description.world import World
from wam_live.hold import HeldTopic
from wam_live.object_meshes import ObjectMeshes, at_rest
from wam_live.page import name_page, quiet, serve, url
from wam_live.panel import DITHER, NO_PRESS, SLIDERS, Bend, Controls, Play, Press, Request, mode_of, paragraph
from wam_live.push import release
from wam_live.scenario_player import ScenarioPlayer
from wam_live.scene import Scene
from wam_live.snapshot import size
from wam_live.stack_source import RunningStack
from wam_live.thresholds import LIVE
from wam_ros.client import Reply, StackClient
from wam_ros.messages import message_type
from wam_ros.run import Connection
from wam_ros.topics import qos
from wam_ros.wire import stamp_of


class LivePage:
    """The page of a running stack.

    Parameters
    ----------
    namespace : of the stack.
    port : to listen on.
    notify : called with lines for people.
    domain_id : ROS domain, the one of the environment where None.

    Attributes
    ----------
    scene, objects, panel : what the page shows, None before the stack has answered.
    """

    scene: Scene | None = None
    objects: ObjectMeshes | None = None
    panel: Controls | None = None

    def __init__(self, namespace: str, port: int, notify: Callable[[str], None], domain_id: int | None = None) -> None:
        self._namespace, self._port, self._notify = namespace, port, notify
        self._connection = Connection(domain_id=domain_id)
        self._client = StackClient(namespace, "live", self._connection)
        self._client.follow_statuses()
        self._asking = self._client.node
        self._server: Any = None
        self._press: Press | None = None
        self._holds: dict[str, HeldTopic] = {}
        self._states: Any = None  # subscription while somebody presses
        self._live: dict[tuple[str, str], Any] = {}
        self._bent: tuple[float, ...] = ()  # posture for a press, rad
        self._player: ScenarioPlayer | None = None

    def open(self) -> None:
        """Serve a page that waits for the stack."""
        self._server = serve(self._port)
        self._waiting = self._server.gui.add_html(paragraph("waiting for the arm; <code>wam up</code> starts one"))
        self._notify(f"live page: {url(self._port)}")

    def run(self, until: Callable[[], bool]) -> None:
        """Show the stack until a condition holds; it may start later."""
        try:
            flat = self._client.await_driver(until, dict.fromkeys(node for node, _ in SLIDERS))
            if not flat:
                return
            self._waiting.remove()
            driver = flat["driver"]
            shared = build_part(Shared, driver)
            world = build_part(World, driver, "world.")
            domain = self._connection.context.get_domain_id()
            label = f"{self._asking.get_namespace()}, domain {domain}"
            more = f", {shared.arm.name}, since {time.strftime('%H:%M:%S')}"
            name_page(self._server, label, more)
            source = RunningStack(self._connection.context, self._namespace, shared, self._client.statuses)
            self._holds = {name: HeldTopic(self._asking, name, shared) for name in ("force_command", "sim/disturbance")}
            self.scene = scene = Scene(self._server, shared.arm, at_rest(world), draggable=True)
            self.objects = objects = ObjectMeshes(self._server, world)
            sliders = [key for key in SLIDERS if key != DITHER or shared.timing.dither_cycle]
            self._live = {key: flat[key[0]][key[1]] for key in sliders if key[1] in flat.get(key[0], {})}
            self._bent = tuple(flat.get("force_loop", {}).get("guard.posture", ()))
            self.panel = panel = Controls(self._server, shared.arm, self._live, dither_text(shared.timing))
            self._player = ScenarioPlayer(shared, self._namespace)
            self._server.on_client_disconnect(lambda _: panel.requests.put(NO_PRESS))  # nobody sees the force
            self._draw(source, scene, objects, panel, until)
            self._end_press()
            self._send(source, panel, None)
        finally:
            self.close()

    def close(self) -> None:
        """End the server and leave ROS; a scenario that was begun here ends."""
        if self._player is not None:
            self._player.close()
        if self._server is not None:
            with quiet():
                self._server.stop()
            self._server = None
        self._connection.close()

    def _draw(
        self,
        source: RunningStack,
        scene: Scene,
        objects: ObjectMeshes,
        panel: Controls,
        until: Callable[[], bool],
    ) -> None:
        count, next_time = 0, time.monotonic()
        while not until():
            next_time = max(next_time + 1.0 / LIVE.rate, time.monotonic())
            while (left := next_time - time.monotonic()) > 0.0:
                self._connection.executor.spin_once(timeout_sec=left)
            snapshot = source.snapshot()
            with self._server.atomic():
                scene.show(snapshot)
                objects.show(snapshot.objects)
                push = scene.push()
                panel.take(snapshot)
                if count % LIVE.panel_every == 0:
                    pushing, pressing = (size(one.force) if one else 0.0 for one in (push, self._press))
                    panel.show(snapshot, pushing, pressing)
            count += 1
            self._send(source, panel, push)
            if self._player is not None and (ended := self._player.ended()):
                panel.notify(ended)
                self._ask(Call("driver", "pause", False), source, panel, ended)  # a scenario pauses the arm at its end
            while not panel.requests.empty():
                self._ask(panel.requests.get(), source, panel)

    # requests of the page

    def _send(self, source: RunningStack, panel: Controls, push: Wrench | None) -> None:
        """Stream the push of a drag until its end; end a force whose arm has stopped."""
        if self._press is not None and mode_of(source.statuses) != "enabled":
            self._end_press()
            panel.notify("letting go: the brakes are on")
        hold = self._holds["sim/disturbance"]
        if push is not None:
            if refusal := hold.send(source.stamp, push):
                panel.notify(f"not pushed: {refusal}", refused=True)
        else:
            release(hold, source.stamp)

    def _start_press(self, press: Press, source: RunningStack, panel: Controls) -> None:
        """Answer each state with the force from now on."""
        if mode_of(source.statuses) != "enabled":
            panel.notify("not pressed: enable the arm first", refused=True)
            return
        self._press = press
        if self._states is None:
            row = BY_NAME["joint_states"]
            self._states = self._asking.create_subscription(
                message_type(row), row.name, lambda data: self._answer(data, panel), qos(row), raw=True
            )
        panel.notify("")  # the status has what becomes of it

    def _answer(self, state: bytes, panel: Controls) -> None:
        if self._press is None:
            return
        refusal = self._holds["force_command"].send(stamp_of(state), Wrench(*self._press, (0.0, 0.0, 0.0)))
        if refusal:
            self._press = None
            panel.notify(f"not pressed: {refusal}", refused=True)

    def _end_press(self) -> None:
        self._press = None
        if self._states is not None:
            self._asking.destroy_subscription(self._states)
            self._states = None
            self._holds["force_command"].end()

    def _play(self, script: str, panel: Controls) -> None:
        assert self._player is not None
        if not script:
            self._player.stop()
            return
        refusal = self._player.play(script)
        panel.notify(refusal or f"playing {script}", refused=bool(refusal))

    def _bend(self, source: RunningStack, panel: Controls) -> None:
        assert self._player is not None
        present = source.snapshot().q
        refusal = (
            "enable the arm first"
            if mode_of(source.statuses) != "enabled"
            else "no force loop runs"
            if len(self._bent) != len(present)
            else self._player.move(present, self._bent)
        )
        panel.notify(f"not moved: {refusal}" if refusal else "bending the arm", refused=bool(refusal))

    def _ask(self, request: Request, source: RunningStack, panel: Controls, text: str = "") -> None:
        """Make a request, and show its answer, or a text in place of it."""
        if isinstance(request, Play):
            self._play(request.script, panel)
            return
        if isinstance(request, Bend):
            self._bend(source, panel)
            return
        if isinstance(request, Press):
            if any(request.force):
                self._start_press(request, source, panel)
            elif self._press is not None:
                self._end_press()
                panel.notify("letting go")
            return
        client, message = self._client.service(request)
        if not client.wait_for_service(0.5):
            panel.notify(f"{request.node} does not answer", refused=True)
            return
        client.call_async(message).add_done_callback(
            lambda future: self._answered(request, Reply.of(request, future.result()), panel, text)
        )

    def _answered(self, request: Call | SetParameters, reply: Reply, panel: Controls, text: str) -> None:
        if isinstance(request, Call):
            panel.notify(text or reply.message, refused=not reply.success)
            return
        for name, value in request.values.items():
            if not reply.success:
                panel.set_slider(request.node, name, self._live[request.node, name])
            else:
                self._live[request.node, name] = value
            panel.notify(reply.message or f"{name} = {value}", refused=not reply.success)


def dither_text(timing: Timing) -> str:
    """What the page shows of the dither, whose period is set when the nodes start: the estimator averages over it."""
    if timing.dither_cycle:
        return f"dither: {1.0 / (timing.dither_cycle * timing.period):.0f} Hz"
    return "dither: off; contacts at rest need timing.dither_cycle=40 from the start"

"""The live page: drawn where the simulator has the arm, harmless to the run, usable in a real browser."""

import argparse
import asyncio
import json
import math
import os
import shutil
import signal
import socket
import subprocess
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
import pytest
from bag_comparison import compare
from browser import browser
from conftest import LONG, wait
from ros_network import Network

from wam_analysis.recording import AnalysedRecording
from wam_bag.bag import read
from wam_cli.commands.live import page_next_to
from wam_cli.options import take_page, take_stack
from wam_description.configuration import Configuration, packaged
from wam_description.effects import no_effects
from wam_description.event import Code, Level, holding
from wam_description.mjcf import mjcf
from wam_description.parameters import build_part
from wam_description.signals import (
    BASE,
    NO_CONTACT,
    Contact,
    LikelyRange,
    NodeStatus,
    ObjectState,
    Point,
    State,
    Wrench,
)
from wam_description.status import PAUSED
from wam_description.topics import BY_NAME
from wam_description.wiring import Call, SetParameters
from wam_description.world import NO_SPRINGS, World
from wam_live.page import HOST, NoPageError, port_is_free, serve
from wam_live.page import free_port as next_free_port
from wam_live.thresholds import LIVE
from wam_ros.testing import RunningArm

viser = pytest.importorskip("viser", reason="the live page needs viser: pip install 'wam_stack[live]'")
from geometry_msgs.msg import WrenchStamped  # noqa: E402

from wam_live.hold import HeldTopic  # noqa: E402
from wam_live.live_page import LivePage  # noqa: E402
from wam_live.panel import DITHER, FORCES, NO_PRESS, Bend, Controls, Play, Press, dot, sample, status_page  # noqa: E402
from wam_live.playback import BagSource  # noqa: E402
from wam_live.scene import Grip, Scene, band_push  # noqa: E402
from wam_live.snapshot import Snapshot  # noqa: E402
from wam_live.stack_source import RunningStack  # noqa: E402
from wam_ros.messages import message_type  # noqa: E402
from wam_ros.ros_topics import qos  # noqa: E402
from wam_ros.wire import encoder  # noqa: E402

CONFIGURATION = Configuration.load(packaged("wam"))
ARM = CONFIGURATION.shared.arm
WORLD = build_part(World, CONFIGURATION.sections["driver"], "world.")
MOVED = 3e-4  # rad, by which an arm that holds its posture gives way to a push
POSE = (0.3, -0.9, 0.2, 0.8)


def free_port() -> int:
    """A port of this machine that nobody listens on."""
    with socket.socket() as probe:
        probe.bind((HOST, 0))
        return int(probe.getsockname()[1])


@pytest.fixture
def server() -> Iterator[Any]:
    made = serve(free_port())
    yield made
    made.stop()


def turned(wxyz: Any, vector: Any) -> np.ndarray[Any, Any]:
    """A vector turned by a quaternion, written out."""
    w, x, y, z = map(float, wxyz)
    rotation = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    return np.asarray(rotation @ np.asarray(vector, float))


@pytest.mark.parametrize(
    ("name", "pose"), [("wam", POSE), ("barrett-wam7", (0.3, 0.9, 0.2, 0.8, -0.4, 0.5, 1.1)), ("testbed", (0.2,))]
)
def test_links_are_drawn_where_the_simulator_has_them(server: Any, name: str, pose: tuple[float, ...]) -> None:
    arm = Configuration.load(packaged(name)).shared.arm
    scene = Scene(server, arm, WORLD, draggable=False)
    scene.show(Snapshot(stamp=1, q=pose))
    model = mujoco.MjModel.from_xml_string(mjcf(arm, 0.001, World(WORLD.obstacles, NO_SPRINGS), no_effects(arm)))
    data = mujoco.MjData(model)
    for joint, angle in zip(arm.joints.names, pose, strict=True):
        data.joint(joint).qpos[0] = angle
    mujoco.mj_kinematics(model, data)
    for cover in arm.covers.names:
        geom = data.geom(cover)
        tube = server.scene.get_handle_by_name(f"/arm/{cover}/tube")
        frame = scene.links[cover]
        middle = np.array(frame.position) + turned(frame.wxyz, tube.position)
        assert middle == pytest.approx(geom.xpos, abs=1e-6)
        axis = turned(frame.wxyz, turned(tube.wxyz, (0.0, 0.0, 1.0)))
        assert abs(axis @ geom.xmat.reshape(3, 3)[:, 2]) == pytest.approx(1.0, abs=1e-6)
        length = 2.0 * (model.geom(cover).size[0] + model.geom(cover).size[1])
        assert np.ptp(tube.vertices[:, 2]) == pytest.approx(length, rel=1e-3)


def test_contacts_are_drawn_as_arrows_along_the_force_and_vanish(server: Any) -> None:
    scene = Scene(server, ARM, WORLD, draggable=False)
    contact = Contact("outer_link", 0.2, (0.0, 0.0, 10.0), 0.01)
    scene.show(Snapshot(1, POSE, true=contact, likely=(LikelyRange("outer_link", 0.1, 0.3),)))
    arrow, band = (server.scene.get_handle_by_name(f"/contact/{name}") for name in ("true", "likely0"))
    assert arrow.visible
    assert band.visible
    assert band.height == pytest.approx(0.2)
    start, end = arrow.points[0]
    assert start == pytest.approx(scene.point("outer_link", 0.2), abs=1e-6)
    frame = scene.links["outer_link"]
    assert end - start == pytest.approx(turned(frame.wxyz, (0.0, 0.0, 0.15)), abs=1e-6)
    scene.show(Snapshot(2, POSE))
    assert not arrow.visible
    assert not band.visible


START, END = np.zeros(3), np.array([0.5, 0.0, 0.0])


def test_a_drag_pushes_like_a_rubber_band_of_limited_strength() -> None:
    grip = Grip("outer_link", np.array([0.2, 0.0, 0.0]), START, END)
    push = band_push(grip, np.array([0.2, 0.1, 0.0]))
    assert push.force == pytest.approx((0.0, 6.0, 0.0))
    assert push.torque == pytest.approx((0.0, 0.0, 1.2))
    far = band_push(Grip("outer_link", START, START, END), np.array([0.0, 0.0, 9.0]))
    assert far.force == pytest.approx((0.0, 0.0, LIVE.strongest))


def test_a_drag_at_the_surface_pushes_at_the_axis_and_across_it_only() -> None:
    surface = np.array([0.2, 0.03, -0.02])
    push = band_push(Grip("outer_link", surface, START, END), surface + np.array([0.3, 0.1, 0.2]))
    assert push.force == pytest.approx((0.0, 6.0, 12.0))
    assert push.torque == pytest.approx((0.0, -0.2 * 12.0, 0.2 * 6.0))
    beyond = band_push(Grip("outer_link", np.array([0.52, 0.0, 0.02]), START, END), np.array([0.52, 0.1, 0.02]))
    assert beyond.torque[2] == pytest.approx(0.5 * 6.0)  # a grip at the round end acts at the end of the axis


def mouse(scene: Scene, phase: str, client: int = 0) -> None:
    """Report a drag of the outer link as viser does, from a thread of its own."""
    start = scene.point("outer_link", 0.2)
    event = SimpleNamespace(
        phase=phase, client_id=client, start_position=start, end_position=start + np.array([0.0, 0.5, 0.25])
    )
    reported = threading.Thread(target=lambda: asyncio.run(scene._dragged("outer_link", (START, END))(event)))
    reported.start()
    reported.join()


def test_a_drag_that_ends_while_its_push_is_computed_is_over(server: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = Scene(server, ARM, WORLD, draggable=True)
    scene.show(Snapshot(1, POSE))
    assert scene.push() is None
    mouse(scene, "start")
    pose_of = scene._body.cover_pose

    def slow(*of: Any) -> Any:
        mouse(scene, "end")
        return pose_of(*of)

    monkeypatch.setattr(scene._body, "cover_pose", slow)
    assert scene.push() is not None
    assert scene.push() is None
    mouse(scene, "update")  # late
    assert scene.push() is None
    scene.show(Snapshot(2, POSE))
    assert not server.scene.get_handle_by_name("/hand").visible


def test_a_link_that_one_browser_drags_no_other_one_drags_or_releases(server: Any) -> None:
    scene = Scene(server, ARM, WORLD, draggable=True)
    scene.show(Snapshot(1, POSE))
    mouse(scene, "start", 1)
    before = scene.push()
    for phase in ("start", "update", "end"):
        mouse(scene, phase, 2)
    assert scene.push() == before is not None
    mouse(scene, "end", 1)
    assert scene.push() is None


def test_the_status_escapes_what_comes_from_topics() -> None:
    status = NodeStatus(Level.ERROR, "<b>", node="driver", mode="fault", fault="<script>alert(1)</script>")
    page = status_page(Snapshot(statuses={"driver": status}), 0.0)
    assert "<script>" not in page
    assert "&lt;script&gt;" in page
    assert len(sample(Snapshot())) == 1 + len(FORCES) + 2


def test_a_lower_bound_of_the_force_is_no_estimate_and_an_unknown_position_a_gap(server: Any) -> None:
    panel = Controls(server, ARM, {})
    first = panel._force_plot
    bound, known = (Contact("inner_link", place, (0.0, 6.0, 8.0)) for place in (math.nan, 0.3))
    for i in range(40):
        panel.take(Snapshot(i * 100_000_000, POSE, estimated=bound if i < 20 else known))
    panel.show(Snapshot(4_000_000_000, POSE, estimated=bound))
    assert "at least 10.0 N</b> somewhere on the inner link" in panel._status.content
    lines = dict(zip(FORCES, panel._force_plot.data[1:], strict=True))
    assert np.isnan(lines["estimated"][:20]).all()
    assert lines["estimated"][20:40] == pytest.approx(10.0)
    assert np.nanmax(lines["at least"][:20]) == pytest.approx(10.0)
    assert np.isnan(lines["at least"][20:40]).all()
    assert np.isnan(panel._place_plot.data[2][:20]).all()
    assert panel._place_plot.data[2][20:40] == pytest.approx(0.3)
    assert panel._force_plot.scales["y"]["range"] == (0.0, 20.0)
    assert first.scales["y"]["range"] == (0.0, 5.0)  # the browser would leave a plot whose scales change empty
    assert panel._force_plot.order == first.order


def test_a_force_that_is_not_done_is_not_shown_as_done() -> None:
    loop = NodeStatus(
        Level.WARN,
        "another link is touched",
        node="force_loop",
        events=(holding(Code.UNEXPLAINED, "other_link", cover="outer_link", touched="inner_link"),),
    )
    page = status_page(Snapshot(measured=0.0, statuses={"force_loop": loop}), pressing=5.0)
    assert "commanded 5.0 N; the force loop reports: another link is touched" in page
    loop = loop._replace(events=())
    assert "measured 4.8 N" in status_page(Snapshot(measured=4.8, statuses={"force_loop": loop}), pressing=5.0)


def test_an_arm_that_is_not_heard_of_is_not_shown_as_enabled() -> None:
    driver = NodeStatus(Level.OK, "enabled", node="driver", mode="enabled")
    shown = lambda silent, status=driver: status_page(Snapshot(silent=silent, statuses={"driver": status}))  # noqa: E731
    assert "no state" not in shown(0.5)
    assert "no state of the arm for 5 s: the stack has ended, waits for a node, or has another arm" in shown(5.0)
    assert dot(Level.OK) in shown(0.5)
    assert dot(Level.OK) not in shown(5.0)
    paused = shown(5.0, driver._replace(facts={PAUSED: "paused"}))
    assert "no state" not in paused
    assert " · paused" in paused


def test_a_page_goes_beside_a_taken_port_and_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    said: list[str] = []
    with socket.create_server((HOST, 0)) as taken:
        port = taken.getsockname()[1]
        monkeypatch.setattr("wam_live.page.LIVE", replace(LIVE, port=port))
        ours = next_free_port(None, said.append)
        assert next_free_port(port, said.append) == port  # one that was asked for
    assert ours > port
    assert port_is_free(ours)
    assert len(said) == 1
    assert f"port {port} is taken by another program" in said[0]
    assert said[0].endswith(f"http://{HOST}:{ours}")
    assert next_free_port(None, said.append) == port
    assert len(said) == 1


def test_pages_of_other_sites_are_refused(server: Any) -> None:
    from websockets.exceptions import InvalidStatus
    from websockets.sync.client import connect

    address = f"ws://{HOST}:{server.get_port()}"
    with pytest.raises(InvalidStatus) as refused:
        connect(address, origin="http://evil.example")  # type: ignore[arg-type]
    assert refused.value.response.status_code == 403
    page = f"http://{HOST}:{server.get_port()}"
    with urllib.request.urlopen(page) as answer:
        assert answer.headers["Content-Security-Policy"] == "frame-ancestors 'none'"
    with pytest.raises(urllib.error.HTTPError, match="403"):
        urllib.request.urlopen(urllib.request.Request(page, headers={"Host": "evil.example"}))
    with pytest.raises(urllib.error.URLError):
        urllib.request.urlopen(f"http://127.0.0.2:{server.get_port()}", timeout=2.0)


# a running stack


class Shown:
    """A page of a running stack, in a thread of this process."""

    def __init__(self, domain_id: int) -> None:
        self.port = free_port()
        self._end = threading.Event()
        self.page = LivePage("wam", self.port, lambda line: None, domain_id)
        self._thread = threading.Thread(target=self.page.run, args=(self._end.is_set,))
        self._thread.start()

    @property
    def panel(self) -> Controls:
        """The panel of the page, once the stack has answered."""
        assert self.page.shown is not None
        return self.page.shown.panel

    def wait(self, holds: Callable[[], Any], spin: Callable[[], None]) -> None:
        """Let the stack run until something holds on the page."""
        end = time.monotonic() + LONG
        while not holds():
            assert time.monotonic() < end, "the page never showed it"
            spin()

    def close(self) -> None:
        """End the page."""
        self._end.set()
        self._thread.join()


@contextmanager
def running(domain_id: int, factor: float = 0.0, **values: Any) -> Iterator[tuple[Any, Shown]]:
    """A stack in lockstep and its page; a browser beside them wants a slow one."""
    from wam_ros.bring_up import Composition

    own = {name.replace("__", "."): value for name, value in values.items()}
    configuration = CONFIGURATION.with_values({"timing.real_time_factor": factor, "timing.timeout": LONG, **own})
    with Composition(configuration, domain_id=domain_id) as composition:
        shown = Shown(domain_id)
        try:
            yield composition, shown
        finally:
            shown.close()


@contextmanager
def ready(domain_id: int, factor: float = 0.0, **values: Any) -> Iterator[tuple[Any, Shown, Any, Any]]:
    """The same with the panel of the page, once it shows the braked arm, and what spins the stack meanwhile."""
    with running(domain_id, factor, **values) as (composition, shown):
        spin = lambda: composition.executor.spin_once(timeout_sec=0.01)  # noqa: E731
        shown.wait(lambda: mode_of(shown) == "braked" and shown.panel.snapshot.q, spin)
        yield composition, shown, shown.panel, spin


def mode_of(shown: Shown) -> str:
    """State of the driver as the page shows it."""
    driver = shown.panel.snapshot.statuses.get("driver") if shown.page.shown else None
    return driver.mode if driver else ""


def test_the_dither_has_a_slider_where_there_is_one(domain_id: int) -> None:
    with ready(domain_id, timing__dither_cycle=40) as (composition, shown, panel, spin):
        assert panel._sliders[DITHER].value == 1.4
        loop = composition.nodes["velocity_loop"].node
        before = loop._dither.amplitude
        panel.requests.put(SetParameters(DITHER[0], {DITHER[1]: 0.7}))
        shown.wait(lambda: loop._dither.amplitude == pytest.approx([0.5 * each for each in before]), spin)
        panel.requests.put(SetParameters(DITHER[0], {DITHER[1]: 4.0}))
        shown.wait(lambda: "refused" in panel._shown.content, spin)
        assert panel._sliders[DITHER].value == 0.7


def test_buttons_reach_the_driver_and_a_push_moves_the_arm(domain_id: int) -> None:
    with ready(domain_id) as (composition, shown, panel, spin):
        assert DITHER not in panel._sliders
        scene = shown.page.shown.scene
        panel.requests.put(Call("driver", "enable", True))
        shown.wait(lambda: mode_of(shown) == "enabled", spin)
        start = panel.snapshot.q
        mouse(scene, "start")
        shown.wait(lambda: math.dist(panel.snapshot.q, start) > MOVED, spin)
        assert panel.snapshot.true.cover == "outer_link"
        mouse(scene, "end")
        shown.wait(lambda: panel.snapshot.true.cover == "", spin)
        shown.wait(lambda: composition.nodes["driver"].count_publishers("sim/disturbance") == 0, spin)
        panel.requests.put(SetParameters("force_loop", {"posture_gain": -1.0}))
        shown.wait(lambda: "posture_gain" in panel._shown.content and "refused" in panel._shown.content, spin)
        panel.requests.put(Call("driver", "estop"))
        shown.wait(lambda: mode_of(shown) == "fault", spin)


def test_a_scenario_is_played_into_a_running_stack_and_a_wrong_one_is_refused(
    domain_id: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", str(domain_id))
    script = tmp_path / "short.yaml"
    steps = [
        {"name": "enable", "seconds": 0.05, "request": "enable"},
        {"name": "move", "seconds": 1.0, "posture": [0.1, -0.7, 0.0, 0.6]},
    ]
    script.write_text(json.dumps({"steps": steps}))
    with ready(domain_id, 0.3) as (_, shown, panel, spin):
        panel.requests.put(Play("nosuch"))
        shown.wait(lambda: "refused" in panel._shown.content and "nosuch" in panel._shown.content, spin)
        start = panel.snapshot.q
        panel.requests.put(Play(str(script)))
        shown.wait(lambda: "the scenario has ended" in panel._shown.content, spin)
        assert abs(panel.snapshot.q[0] - start[0]) > 0.02, panel.snapshot
        ended = panel.snapshot.stamp
        shown.wait(lambda: panel.snapshot.stamp > ended + 10**8, spin)  # time goes on
        panel.requests.put(Play(str(script)))
        player = shown.page.shown.player
        shown.wait(lambda: player._node, spin)
        (node := player._node).send_signal(signal.SIGSTOP)
        shown.wait(lambda: " T " in Path(f"/proc/{node.pid}/stat").read_text(), spin)
        panel.requests.put(Play(""))
        panel.requests.put(Call("driver", "estop"))
        shown.wait(lambda: mode_of(shown) == "fault", spin)
        assert node.poll() is None, "a scenario that does not end holds up no emergency stop"
        node.send_signal(signal.SIGCONT)
        shown.wait(lambda: "the scenario has ended" in panel._shown.content, spin)


@pytest.fixture(scope="module")
def alone(tmp_path_factory: pytest.TempPathFactory, domain_of_module: int) -> Path:
    """A run that nobody watched."""
    return recorded(tmp_path_factory.mktemp("alone"), domain_of_module)


def recorded(folder: Path, domain_id: int) -> Path:
    """A short run in lockstep, as a bag."""
    push = {"cover": "outer_link", "contact_position": 0.3, "newtons": [0.0, 9.0, 2.0], "begin": 0.1, "end": 0.4}
    steps = [
        {"name": "release", "seconds": 0.1, "request": "enable"},
        {"name": "move and be pushed", "seconds": 0.5, "posture": [0.1, -0.7, 0.05, 0.4], "push": push},
    ]
    return RunningArm(domain_id, folder).play(steps).path


@pytest.mark.slow
def test_a_page_changes_no_bit_of_a_run(alone: Path, domain_id: int, tmp_path: Path) -> None:
    shown = Shown(domain_id)
    try:
        watched = recorded(tmp_path, domain_id)
        assert shown.panel.snapshot.q
    finally:
        shown.close()
    assert compare(alone, watched) == []


def test_a_bag_is_played_as_it_was_recorded(alone: Path) -> None:
    bag = read(alone)
    source = BagSource(AnalysedRecording(bag))
    truth = bag.topics["/wam/sim/joint_states"]
    for at in (0, 40, 100):
        shown = source.snapshot(int(truth.stamp_ns[at]))  # type: ignore[union-attr]
        assert shown.q == pytest.approx(truth.position[at], abs=0.02)  # type: ignore[union-attr]
    pushed = source.snapshot(400_000_000)
    assert pushed.true.cover == "outer_link"
    assert pushed.true.position == pytest.approx(0.3, abs=1e-6)
    assert pushed.estimated.position_sd > 0.0
    assert source.snapshot(300_000_000).statuses["driver"].mode == "enabled"
    assert len(list(source.past(400_000_000))) == LIVE.points
    assert source.snapshot(400_000_000).statuses["force_loop"].level is Level.OK


def test_of_a_bag_without_hypotheses_the_estimated_contact_is_played_from_its_own_topics(alone: Path) -> None:
    bag = read(alone)
    whole = BagSource(AnalysedRecording(bag)).snapshot(400_000_000).estimated
    topics = {name: columns for name, columns in bag.topics.items() if not name.endswith("contact/hypotheses")}
    alike = BagSource(AnalysedRecording(bag._replace(topics=topics, counts={}))).snapshot(400_000_000).estimated
    assert (alike.cover, alike.position, alike.force) == (whole.cover, whole.position, whole.force)
    assert alike.cover == "outer_link"
    topics = {name: columns for name, columns in topics.items() if not name.endswith("/contact/point")}
    assert (
        BagSource(AnalysedRecording(bag._replace(topics=topics, counts={}))).snapshot(400_000_000).estimated
        == NO_CONTACT
    )


def test_a_topic_is_published_only_while_somebody_holds_on_and_not_beside_another(ros: Network) -> None:
    listener, page = ros.node("listener"), ros.node("page")
    heard: list[str] = []
    listener.create_subscription(
        WrenchStamped, "sim/disturbance", lambda message: heard.append(message.header.frame_id), 10
    )
    hold = HeldTopic(page, "sim/disturbance", CONFIGURATION.shared)
    count = lambda: listener.count_publishers("sim/disturbance")  # noqa: E731
    push = Wrench("outer_link", (0.0, 1.0, 0.0), (0.0, 0.0, 0.0))
    real = HeldTopic(page, "sim/disturbance", replace(CONFIGURATION.shared, nodes=("mine:Driver",)))
    assert "does not take sim/disturbance; a real arm is pushed by hand" in real.send(1, push)
    assert hold.send(1, push) == ""
    ros.wait(lambda: count() == 1 and (hold.send(1, push), heard)[1])
    hold.send(1, Wrench(BASE, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)))
    hold.end()
    ros.wait(lambda: count() == 0 and BASE in heard)
    hold.send(1, push)
    other = ros.node("other").create_publisher(WrenchStamped, "sim/disturbance", 10)
    ros.wait(lambda: hold.send(1, push), what="the page leaves the topic")
    assert not hold.is_on
    assert "another program publishes sim/disturbance" in hold.send(1, push)
    del other


def test_a_contact_of_which_nothing_comes_any_more_is_not_shown(ros: Network) -> None:
    node, shared = ros.node("driver"), CONFIGURATION.shared
    stack = RunningStack(ros.context, "wam", shared)
    rows = {name: BY_NAME[name] for name in ("sim/contact/wrench", "sim/contact/point", "sim/joint_states")}
    publishers = {name: node.create_publisher(message_type(row), name, qos(row)) for name, row in rows.items()}
    values = (
        Wrench("outer_link", (0.0, 9.0, 0.0), (0.0, 0.0, 0.0)), Point("outer_link", (0.2, 0.0, 0.0)),
        State([0.0] * 4, [0.0] * 4, [0.0] * 4),
    )  # fmt: skip

    def shown(number: int, stamp: int) -> Snapshot:
        for (name, row), value in list(zip(rows.items(), values, strict=True))[-number:]:
            publishers[name].publish(encoder(row, shared)(stamp, value))
        return stack.snapshot()

    ros.wait(lambda: shown(3, 1_000_000_000).true.cover == "outer_link")
    ros.wait(lambda: shown(1, 3_000_000_000).stamp == 3_000_000_000)
    assert stack.snapshot().true.cover == ""
    stack.node.destroy_node()


def test_the_page_bends_the_arm_where_a_press_needs_it(domain_id: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", str(domain_id))
    far = {"force_loop:limits.free_travel": 0.3}  # m; it is 0.15 m to the box
    with ready(domain_id, 1.0, **far) as (_, shown, panel, spin):
        panel.requests.put(Bend())
        shown.wait(lambda: "enable the arm first" in panel._shown.content, spin)
        panel.requests.put(Call("driver", "enable", True))
        shown.wait(lambda: mode_of(shown) == "enabled", spin)
        press = Press(BASE, (0.0, 0.0, -5.0))  # as the page opens
        events = lambda: panel.snapshot.statuses["force_loop"].events  # noqa: E731
        panel.requests.put(press)
        shown.wait(events, spin)
        panel.requests.put(NO_PRESS)
        panel.requests.put(Bend())
        shown.wait(lambda: "the scenario has ended" in panel._shown.content, spin)
        panel.requests.put(press)
        shown.wait(lambda: panel.snapshot.measured == pytest.approx(5.0, abs=0.25), spin)
        shown.wait(lambda: panel.snapshot.true.cover == "outer_link", spin)  # topics come one after the other


# beside a stack


def options(*given: str) -> Any:
    parser = argparse.ArgumentParser()
    take_page(parser, default=None)
    take_stack(parser)
    return parser.parse_args(given)


def test_a_page_that_was_asked_for_is_refused_where_there_can_be_none(capsys: pytest.CaptureFixture[str]) -> None:
    with socket.create_server((HOST, 0)) as taken:
        port = str(taken.getsockname()[1])
        with (
            pytest.raises(NoPageError, match=f"port {port} .* --port"),
            page_next_to(options("--live", "--port", port), bool),
        ):
            pass
        with page_next_to(options("--port", port), bool):
            assert f"no live page: port {port}" in capsys.readouterr().out
        with page_next_to(options("--no-live", "--port", port), bool):
            assert capsys.readouterr().out == ""


def test_a_page_that_is_late_is_reported_once_and_ends_with_its_stack(
    domain_id: int, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("wam_cli.commands.live.LATE", 0.0)  # no page is there at once
    with page_next_to(options("--port", str(port := free_port())), bool):
        until(lambda: not port_is_free(port))
    assert capfd.readouterr().out.count("still starting") == 1
    assert port_is_free(port)


def test_a_page_that_loses_its_port_is_reported_at_the_end(domain_id: int, capfd: pytest.CaptureFixture[str]) -> None:
    port = free_port()
    with page_next_to(options("--port", str(port)), lambda: True), socket.create_server((HOST, port)):
        until(lambda: os.waitid(os.P_ALL, 0, os.WEXITED | os.WNOHANG | os.WNOWAIT))
    said = capfd.readouterr()
    assert f"port {port} of {HOST} is taken" in said.err
    assert "ended too early; it printed the reason above" in said.out


# a real browser

FLAGS = (
    "--headless", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist",
    "--disable-quic", "--no-first-run", "--disable-background-networking", "--disable-component-update",
    "--disable-sync", "--disable-dev-shm-usage", "--remote-allow-origins=*", "--window-size=1280,800",
)  # fmt: skip

until = partial(wait, what="it never came", timeout=100.0)
ANSWERED = 40.0  # s, within which the browser answers on any machine that can draw


class Tab:
    """A page in Chromium, through its debugging protocol."""

    def __init__(self, tab: Any) -> None:
        self._socket, self._number = tab, 0

    def ask(self, method: str, **values: Any) -> dict[str, Any]:
        """One request and its answer."""
        self._number += 1
        self._socket.send(json.dumps({"id": self._number, "method": method, "params": values}))
        while True:
            try:
                answer: dict[str, Any] = json.loads(self._socket.recv(timeout=ANSWERED))
            except TimeoutError:
                pytest.skip(f"the browser has not answered for {ANSWERED:g} s beside all that runs here")
            if answer.get("id") == self._number:
                return answer["result"]

    def text(self) -> str:
        """Everything that can be read on the page."""
        found = self.ask("Runtime.evaluate", expression="document.body.innerText", returnByValue=True)
        return str(found["result"].get("value", ""))

    def mouse(self, kind: str, x: float, y: float, pressed: bool) -> None:
        """Move, press or release the left button."""
        button = {"button": "left" if pressed or kind == "mouseReleased" else "none", "buttons": int(pressed)}
        self.ask("Input.dispatchMouseEvent", type=kind, x=x, y=y, clickCount=1, **button)

    def click(self, label: str) -> None:
        """Press a button by its label."""
        find = f"[...document.querySelectorAll('button')].find(b => b.innerText.trim() === {label!r}).click()"
        self.ask("Runtime.evaluate", expression=find)


@contextmanager
def opened(address: str, folder: Path) -> Iterator[Tab]:
    """A page in a browser without a screen."""
    from websockets.sync.client import connect

    profile = folder / "profile"
    command = [browser(), *FLAGS, "--remote-debugging-port=0", f"--user-data-dir={profile}", address]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        end = time.monotonic() + LONG
        while not (profile / "DevToolsActivePort").exists():
            assert time.monotonic() < end, "the browser did not start"
            assert process.poll() is None, "the browser ended"
            time.sleep(0.1)
        port = (profile / "DevToolsActivePort").read_text().split()[0]
        with urllib.request.urlopen(f"http://{HOST}:{port}/json") as answer:
            page = next(tab for tab in json.load(answer) if tab["type"] == "page")
        with connect(page["webSocketDebuggerUrl"], max_size=2**27, ping_interval=None) as tab:
            yield Tab(tab)
    finally:
        process.terminate()
        process.wait()
        shutil.rmtree(profile, ignore_errors=True)


def pixel(camera: Any, size: tuple[float, float], point: Any) -> tuple[float, float]:
    """Where a camera of the page sees a point of the base frame, px."""
    w, x, y, z = camera.wxyz
    right, down, ahead = turned((w, -x, -y, -z), np.asarray(point) - np.asarray(camera.position))
    focal = 0.5 * size[1] / math.tan(0.5 * camera.fov)
    return 0.5 * size[0] + focal * right / ahead, 0.5 * size[1] + focal * down / ahead


@pytest.mark.slow
def test_in_a_browser_a_link_is_dragged_and_a_button_brakes(domain_id: int, tmp_path: Path) -> None:
    browser()
    with running(domain_id, 0.3) as (composition, shown):
        spin = lambda: composition.executor.spin_once(timeout_sec=0.01)  # noqa: E731
        shown.wait(lambda: mode_of(shown) == "braked" and shown.panel.snapshot.q, spin)
        panel, scene = shown.panel, shown.page.shown.scene
        server = shown.page._server

        def drive() -> None:
            with opened(f"http://{HOST}:{shown.port}/", tmp_path) as tab:
                until(lambda: "Emergency stop" in tab.text() and server.get_clients())
                tab.click("Enable")
                until(lambda: mode_of(shown) == "enabled" and "enabled" in tab.text())
                clients = list(server.get_clients().values())
                until(lambda: clients[0].camera.image_width > 0)
                camera = clients[0].camera
                window = (camera.image_width, camera.image_height)
                start = panel.snapshot.q
                x, y = pixel(camera, window, scene.point("outer_link", 0.25))
                tab.mouse("mouseMoved", x, y, False)
                tab.mouse("mousePressed", x, y, True)
                for i in range(1, 25):
                    tab.mouse("mouseMoved", x + 12.0 * i, y, True)
                    time.sleep(0.03)
                until(lambda: panel.snapshot.true.cover == "outer_link")
                until(lambda: math.dist(panel.snapshot.q, start) > MOVED)
                until(lambda: "your hand pushes with" in tab.text())
                tab.mouse("mouseReleased", x + 288.0, y, False)
                until(lambda: panel.snapshot.true.cover == "")
                tab.click("Brake")
                until(lambda: mode_of(shown) == "braked")

        with ThreadPoolExecutor() as threads:
            user = threads.submit(drive)
            while not user.done():
                spin()
        user.result()


def test_objects_of_the_world_are_drawn_where_the_simulator_has_them(server: Any) -> None:
    section = CONFIGURATION.sections["driver"]
    world = build_part(World, {**section, "world.doors.mass": (2.0,), "world.bodies.mass": (1.0,)}, "world.")
    scene = Scene(server, ARM, world, draggable=False)
    half = math.sqrt(0.5)
    block = ObjectState._make((0, 0.5, 0.1, 0.2, 0, 0, half, half, *[0.0] * 13))
    scene.show(Snapshot(objects=(block,)))
    assert scene.objects[0].position == pytest.approx((0.5, 0.1, 0.2))
    assert turned(scene.objects[0].wxyz, (1.0, 0.0, 0.0)) == pytest.approx((0.0, 1.0, 0.0), abs=1e-6)
    panel = server.scene.get_handle_by_name("/world/door/mesh")
    assert panel.position == pytest.approx((0.3, 0.0, 0.0))  # half its width from the hinge

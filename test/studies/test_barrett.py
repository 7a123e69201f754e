"""The production WAM, `barrett-wam4` and `barrett-wam7`, against the maker's tables, typed here once more.

The URDF is written from the maker's rows, in its own convention, and read by pinocchio: nothing of it comes from the
configuration, from the code that builds its model, or from the exporter.
"""

from collections.abc import Sequence

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from arms import NOWHERE

from wam_analysis.identification.regressor import about_origin
from wam_cli.main import main
from wam_control.contact.contact_estimator import ContactEstimatorParameters
from wam_control.contact.contact_inference import ContactInference
from wam_description.arm import Arm
from wam_description.configuration import Configuration, packaged
from wam_description.effects import no_effects
from wam_description.mjcf import mjcf
from wam_description.parameters import rows
from wam_description.parts import tensor
from wam_description.rigid_body import RigidBody
from wam_description.world import NO_SPRINGS, World
from wam_driver.limit_watch import LimitWatch
from wam_studies.contact.scenarios import ScenarioGenerator

# alpha / pi, a, d: joint i turns about z of frame i-1, then d along it, a along x, alpha about x
SHOULDER = [(-0.5, 0.0, 0.0), (0.5, 0.0, 0.0), (-0.5, 0.045, 0.55), (0.5, -0.045, 0.0)]
WRIST = [(-0.5, 0.0, 0.3), (0.5, 0.0, 0.0), (0.0, 0.0, 0.0609)]
PLATE = 0.36  # m along z of frame 4, of the arm without a wrist
# mass; centre of mass in frame i; inertia about it: xx yy zz xy xz yz
BODIES = """
10.7677   -.00443 .12189 -.00066        .13488033 .11328369 .09046330 -.00213041 -.00012485 .00068555
3.8749    -.00237 .03106 .01542         .02140958 .01377875 .01558906 .00027172 .00002461 -.00181920
1.8023    -.03826 .20751 .00003         .05911077 .00324550 .05927043 -.00249612 .00000738 -.00001767
"""
BLANK = "1.0651 .01095 -.00003 .14054   .01848577 .01891658 .00197517 .00000219 -.00160868 .00000515"
WRISTED = """
2.17266212 .00553408 .00006822 .11927695 .01067491 .01058659 .00282036 .00004503 -.00135557 -.00011002
.35655692 .00005483 .02886286 .00148493  .00037112 .00019434 .00038209 -.00000008 -.00000003 -.00001613
.40915886 -.00005923 -.01686123 .02419052 .00054889 .00023846 .00045133 .00000019 -.00000010 -.00004430
.07548270 .00014836 .00007252 -.00335185 .00003911 .00003877 .00007614 .00000019 0 0
"""
PEAK = (77.3, 160.6, 95.6, 29.4, 11.6, 11.6, 2.7)  # N m, of the joints
ARMS = {"barrett-wam4": (SHOULDER, BODIES + BLANK), "barrett-wam7": (SHOULDER + WRIST, BODIES + WRISTED)}

CONFIGURATIONS = {name.replace("-", "_"): Configuration.load(packaged(name)) for name in ARMS}


def motors_of(q: Sequence[float]) -> list[float]:
    """Motor angles by the maker's formula, rad."""
    shoulder = [-42.0 * q[0], 28.25 * q[1] - 16.8155 * q[2], -28.25 * q[1] - 16.8155 * q[2], -18.0 * q[3]]
    if len(q) == 4:
        return shoulder
    return [*shoulder, 9.7 * q[4] - 9.7 * q[5], 9.7 * q[4] + 9.7 * q[5], -14.93 * q[6]]


def written_urdf(name: str) -> str:
    """Link i turns with joint i; its mass is on a body that is fixed to it behind d, a and alpha."""
    rows, bodies = ARMS[name]
    parts, before, at = ['<link name="base"/>'], "base", '<origin xyz="0 0 0"/>'
    for i, ((alpha, a, d), line) in enumerate(zip(rows, filter(None, bodies.splitlines()), strict=True), start=1):
        mass, x, y, z, xx, yy, zz, xy, xz, yz = line.split()
        inertia = f'ixx="{xx}" iyy="{yy}" izz="{zz}" ixy="{xy}" ixz="{xz}" iyz="{yz}"'
        parts.append(
            f'<joint name="q{i}" type="revolute"><parent link="{before}"/><child link="turn{i}"/>{at}'
            '<axis xyz="0 0 1"/><limit lower="-9" upper="9" effort="1" velocity="1"/></joint>'
            f'<link name="turn{i}"/><joint name="fixed{i}" type="fixed"><parent link="turn{i}"/><child link="body{i}"/>'
            f'<origin xyz="{a} 0 {d}" rpy="{alpha * np.pi!r} 0 0"/></joint>'
            f'<link name="body{i}"><inertial><origin xyz="{x} {y} {z}"/><mass value="{mass}"/><inertia {inertia}/>'
            "</inertial></link>"
        )
        before = f"body{i}"
    plate = PLATE if len(rows) == 4 else 0.0
    parts.append(
        f'<link name="plate"/><joint name="mount" type="fixed"><parent link="{before}"/><child link="plate"/>'
        f'<origin xyz="0 0 {plate}"/></joint>'
    )
    return f'<robot name="written">{"".join(parts)}</robot>'


@pytest.fixture(scope="module", params=list(CONFIGURATIONS))
def arm(request: pytest.FixtureRequest) -> Arm:
    return CONFIGURATIONS[request.param].shared.arm


@pytest.fixture(scope="module")
def written(arm: Arm) -> pin.Model:
    model = pin.buildModelFromXML(written_urdf(arm.name.replace("_", "-")))
    model.gravity.linear = np.array([0.0, 0.0, -9.80665])
    return model


@pytest.fixture(scope="module")
def poses(arm: Arm) -> np.ndarray:
    return np.random.default_rng(5).uniform(arm.joints.lower, arm.joints.upper, (50, arm.n))


def test_tool_and_links_are_where_the_makers_rows_put_them(arm: Arm, written: pin.Model, poses: np.ndarray) -> None:
    body, data = RigidBody(arm), written.createData()
    end = "plate" if arm.n == len(SHOULDER) else "body5"
    shoulder, elbow, end_of_forearm = (written.getFrameId(name) for name in ("turn2", "body4", end))
    for q in poses:
        pin.framesForwardKinematics(written, data, q)
        plate = data.oMf[written.getFrameId("plate")].translation
        np.testing.assert_allclose(body.tool_pose(q).position, plate, rtol=0, atol=1e-9)
        length = dict(zip(arm.covers.names, arm.covers.length, strict=True))
        ends = {"upper_arm": (shoulder, None), "forearm": (elbow, end_of_forearm)}
        for cover, (first, last) in ends.items():
            np.testing.assert_allclose(body.point(q, cover, (0, 0, 0)), data.oMf[first].translation, rtol=0, atol=1e-9)
            if last is not None:
                found = body.point(q, cover, (length[cover], 0, 0))
                np.testing.assert_allclose(found, data.oMf[last].translation, rtol=0, atol=1e-9)


def test_gravity_and_inertia_are_those_of_the_makers_links(arm: Arm, written: pin.Model, poses: np.ndarray) -> None:
    body, data = RigidBody(arm), written.createData()
    for q in poses:
        gravity = pin.computeGeneralizedGravity(written, data, q)
        np.testing.assert_allclose(body.gravity_torque(q), gravity, rtol=0, atol=1e-9)
        np.testing.assert_allclose(body.mass_matrix(q), pin.crba(written, data, q), rtol=0, atol=1e-9)


def test_the_simulated_arm_has_them_too(arm: Arm, written: pin.Model, poses: np.ndarray) -> None:
    """MuJoCo turns the inertia into principal axes by itself."""
    n = arm.n
    model = mujoco.MjModel.from_xml_string(mjcf(arm, 0.0005, World(NOWHERE, NO_SPRINGS), no_effects(arm)))
    data, own, full = mujoco.MjData(model), written.createData(), np.zeros((2 * n, 2 * n))
    for q in poses[:10]:
        data.qpos[n:] = q
        mujoco.mj_forward(model, data)
        mujoco.mj_fullM(model, data, full)
        np.testing.assert_allclose(full[n:, n:], pin.crba(written, own, q), rtol=0, atol=1e-8)
        gravity = pin.computeGeneralizedGravity(written, own, q)
        np.testing.assert_allclose(data.qfrc_bias[n:], gravity, rtol=0, atol=1e-8)


def test_motors_turn_as_the_maker_says_and_power_passes_both_differentials(arm: Arm, poses: np.ndarray) -> None:
    through, random = arm.transmission, np.random.default_rng(6)
    for q in poses:
        assert through.motor_motion(q.tolist()) == pytest.approx(motors_of(q.tolist()), abs=1e-12)
        qd, tau = random.uniform(-2.0, 2.0, (2, len(q))).tolist()
        at_joints = float(np.dot(tau, qd))
        at_motors = float(np.dot(through.motor_torques(tau), through.motor_motion(qd)))
        assert at_motors == pytest.approx(at_joints, rel=1e-12, abs=1e-12)


def test_no_motor_may_give_more_than_its_controller_and_the_safety_module_let_it(arm: Arm) -> None:
    """4731 counts are the warning of the safety module, 4320, 3900 and 1600 the clipping of the controllers."""
    counts, gain = (4731, 4731, 4731, 4320, 3900, 3900, 1600), (2700, 2700, 2700, 2700, 6500, 6500, 17474)
    most = [count / each for count, each in zip(counts, gain, strict=True)][: arm.n]
    assert all(0.98 * limit < peak < limit + 1e-4 for peak, limit in zip(arm.motors.peak_torque, most, strict=True))
    found = arm.transmission.largest_joint_torques(arm.motors.peak_torque)
    assert all(torque < 1.001 * peak for torque, peak in zip(found, PEAK, strict=False)), "the published ones"


def test_the_identified_model_keeps_the_products_of_inertia(arm: Arm) -> None:
    for link in rows(arm.links):
        centre = np.array(link.centre)
        ten = about_origin(np.array([link.mass, *(link.mass * centre), *link.inertia]), link.product)
        expected = pin.Inertia(link.mass, centre, tensor(link)).toDynamicParameters()
        np.testing.assert_allclose(ten, expected, rtol=0, atol=1e-12)


def test_a_contact_is_found_on_every_link_that_shows_its_position(arm: Arm, written: pin.Model) -> None:
    """Torques by the written model; a push across the tube, at three places of each."""
    body, data, random = RigidBody(arm), written.createData(), np.random.default_rng(7)
    own = CONFIGURATIONS[arm.name].node("contact_estimator", ContactEstimatorParameters).inference
    inference = ContactInference(arm, body, own)
    precision = 1e4 * np.eye(arm.n)
    carriers = dict(zip(arm.covers.names, arm.covers.links, strict=True))
    for name in arm.covers.names[1:]:
        i = arm.covers.names.index(name)
        frame = written.getFrameId(f"turn{carriers[name].removeprefix('link')}")
        for share in (0.3, 0.5, 0.8):
            q = random.uniform(0.4, 0.9, arm.n)
            pose, place = body.cover_pose(q, name), share * arm.covers.length[i]
            force = pose.rotation @ [0.0, 6.0, 5.0]
            pin.computeJointJacobians(written, data, q)
            pin.updateFramePlacements(written, data)
            turning = pin.getFrameJacobian(written, data, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
            lever = body.point(q, name, (place, 0.0, 0.0)) - data.oMf[frame].translation
            torques = turning.T @ np.concatenate((force, np.cross(lever, force)))
            best = inference.infer(q.tolist(), torques.tolist(), precision)[0]
            assert best.cover == name
            assert best.position == pytest.approx(place, abs=2.0 * best.position_sd + 2e-3)
            assert best.position_sd < 0.025
            assert best.force == pytest.approx((0.0, 6.0, 5.0), abs=2.0 * best.force_sd)
            assert best.force_sd < 1.5


def test_the_upper_arm_shows_its_moment_only_and_elbow_and_wrist_are_watched(arm: Arm) -> None:
    body = RigidBody(arm)
    assert [name for name in arm.covers.names if not body.moves(name, (0.0, 0.0, 0.0))] == ["upper_arm"]
    q, qd = list(arm.joints.start), [0.5] * arm.n
    through = arm.transmission
    theta, thetad = through.motor_motion(q), through.motor_motion(qd)
    none = [0.0] * len(q)
    watched = {one.quantity: one.value for one in LimitWatch(arm, 1e-9, 1e-9).watched(theta, thetad, none, none)}
    for cover in arm.covers.names[1:]:
        before, after = (body.point(np.array(q) + s * 1e-6 * np.array(qd), cover, (0, 0, 0)) for s in (-1, 1))
        speed = float(np.linalg.norm(after - before)) / 2e-6
        assert watched[f"speed of {cover} at the end nearer the base"] == pytest.approx(speed, rel=1e-6)
    assert "speed of upper_arm at the end nearer the base" not in watched


@pytest.mark.slow
def test_the_force_loop_of_both_arms_is_within_the_guards_margin(arm: Arm, capsys: pytest.CaptureFixture[str]) -> None:
    name = arm.name.replace("_", "-")
    with pytest.raises(SystemExit) as accepted:
        main(["guard", "--config", name])
    assert accepted.value.code == 0
    assert ["guard.mode", "limit"] in [line.split() for line in capsys.readouterr().out.splitlines()]
    with pytest.raises(SystemExit) as refused:
        main(["guard", "--config", name, "--set", "force_loop:force_gain=[0.5]"])
    assert refused.value.code == 1


@pytest.mark.slow
def test_contacts_of_the_benchmark_are_on_every_link() -> None:
    """Also with more than two: the first has its share, the others divide the rest."""
    configuration = CONFIGURATIONS["barrett_wam7"]
    drawn = [one.cover for scenario in ScenarioGenerator(configuration, 1).contacts(300) for one in scenario.planned]
    shares = [drawn.count(name) / len(drawn) for name in configuration.shared.arm.covers.names]
    assert shares == pytest.approx([0.3, 0.35, 0.35], abs=0.08)


# pressing with the wrist while the elbow moves, in lockstep

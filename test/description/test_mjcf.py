"""The compiled MuJoCo model against the parameters, pinocchio and (A.5) written by hand."""

import mujoco
import numpy as np
import pytest
from arms import BODY, NOWHERE, WAM, box, ideal_mjcf
from contact_truth import motor_from_joint

from wam_description.arm import Arm
from wam_description.parameters import ParameterError, build, values
from wam_description.world import Obstacles

MOTORS, JOINTS, LINKS = WAM.motors.names, WAM.joints.names, WAM.links.names
FOAM = box((0.6, 0.1, -0.3), (0.1, 0.2, 0.1), 4000.0, friction=0.3, rotation=(0.1, 0.2, 0.3))


def compiled(arm: Arm = WAM, obstacles: Obstacles = NOWHERE) -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(ideal_mjcf(arm, 5e-4, obstacles))


def placed(model: mujoco.MjModel, q: np.ndarray) -> mujoco.MjData:
    data = mujoco.MjData(model)
    data.qpos[4:] = q
    mujoco.mj_forward(model, data)
    return data


def poses(count: int) -> np.ndarray:
    return np.random.default_rng(11).uniform(WAM.joints.lower, WAM.joints.upper, (count, 4))


def test_eight_degrees_of_freedom_are_four_rotors_and_then_four_joints() -> None:
    model = compiled()
    assert (model.nq, model.nv, model.nu, model.ntendon) == (8, 8, 4, 8)
    assert [model.joint(i).name for i in range(8)] == [*MOTORS, *JOINTS]
    assert all(model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE)


def test_rotors_have_the_inertia_and_friction_of_the_motors() -> None:
    model = compiled()
    mass = np.zeros((8, 8))
    mujoco.mj_fullM(model, placed(model, np.zeros(4)), mass)
    np.testing.assert_allclose(np.diag(mass)[:4], WAM.motors.inertia, rtol=1e-12)
    np.testing.assert_array_equal(model.dof_frictionloss[:4], WAM.motors.static_friction)
    np.testing.assert_array_equal(model.dof_damping[:4], WAM.motors.viscous_friction)
    assert not model.jnt_limited[:4].any()


def test_links_and_joints_have_their_parameters() -> None:
    model = compiled()
    for i, name in enumerate(LINKS):
        body = model.body(name)
        assert body.mass[0] == WAM.links.mass[i]
        np.testing.assert_allclose(body.ipos, WAM.links.centre[3 * i : 3 * i + 3], atol=1e-15)
        np.testing.assert_allclose(body.inertia, WAM.links.inertia[3 * i : 3 * i + 3], rtol=1e-12)
        np.testing.assert_allclose(body.iquat, [1, 0, 0, 0], atol=1e-15)
        joint = model.joint(JOINTS[i])
        np.testing.assert_array_equal(joint.axis, [0, 0, 1])
        np.testing.assert_array_equal(joint.range, [WAM.joints.lower[i], WAM.joints.upper[i]])
        assert model.jnt_limited[4 + i]
    np.testing.assert_array_equal(model.dof_armature[4:], WAM.joints.armature)
    np.testing.assert_array_equal(model.dof_damping[4:], WAM.joints.viscous_friction)
    np.testing.assert_array_equal(model.dof_frictionloss[4:], WAM.joints.static_friction)
    np.testing.assert_array_equal(model.opt.gravity, WAM.gravity)


def test_each_cable_is_a_row_of_the_inverse_map_with_its_stiffness_on_the_motor_side() -> None:
    model = compiled()
    stiffness, damping = model.tendon_stiffness.reshape(4, 2), model.tendon_damping.reshape(4, 2)
    np.testing.assert_allclose(stiffness.sum(axis=1), [34.0, 34.0, 34.0, 11.8], rtol=1e-4)
    np.testing.assert_array_equal(damping.sum(axis=1), WAM.cables.damping)
    for q in poses(20):
        data = placed(model, q)
        np.testing.assert_allclose(data.ten_length[::2], -motor_from_joint(q), atol=1e-12)
        np.testing.assert_array_equal(data.ten_length[::2], data.ten_length[1::2])
        data.qpos[:4] = motor_from_joint(q) + np.array([0.1, 0.2, 0.3, 0.4])
        mujoco.mj_forward(model, data)
        np.testing.assert_allclose(data.ten_length[::2], [0.1, 0.2, 0.3, 0.4], atol=1e-12)


def test_tubes_reach_from_start_to_end_of_their_cover() -> None:
    model = compiled()
    covers = WAM.covers
    for q in poses(50):
        data = placed(model, q)
        for i, cover in enumerate(covers.names):
            start = BODY.point(q, cover, covers.start[3 * i : 3 * i + 3])
            end = BODY.point(q, cover, covers.end[3 * i : 3 * i + 3])
            geom = data.geom(cover)
            assert model.geom(cover).size[0] == covers.radius[i]
            half = model.geom(cover).size[1] * geom.xmat.reshape(3, 3)[:, 2]
            ends = sorted([geom.xpos - half, geom.xpos + half], key=lambda e: float(np.linalg.norm(e - start)))
            np.testing.assert_allclose(ends, [start, end], atol=1e-9)


def test_obstacle_stands_where_its_parameters_say() -> None:
    model = compiled(obstacles=FOAM)
    data = placed(model, np.zeros(4))
    r, p, y = 0.1, 0.2, 0.3  # about fixed x, then y, then z
    about_x = np.array([[1, 0, 0], [0, np.cos(r), -np.sin(r)], [0, np.sin(r), np.cos(r)]])
    about_y = np.array([[np.cos(p), 0, np.sin(p)], [0, 1, 0], [-np.sin(p), 0, np.cos(p)]])
    about_z = np.array([[np.cos(y), -np.sin(y), 0], [np.sin(y), np.cos(y), 0], [0, 0, 1]])
    np.testing.assert_allclose(data.geom("block").xpos, [0.6, 0.1, -0.3])
    np.testing.assert_allclose(data.geom("block").xmat.reshape(3, 3), about_z @ about_y @ about_x, atol=1e-12)
    np.testing.assert_array_equal(model.geom("block").size, [0.1, 0.2, 0.1])


def test_covers_meet_obstacles_and_nothing_else() -> None:
    model = compiled(obstacles=FOAM)
    pairs = {(model.geom(a).name, model.geom(b).name) for a, b in zip(model.pair_geom1, model.pair_geom2, strict=True)}
    assert {frozenset(pair) for pair in pairs} == {frozenset((cover, "block")) for cover in WAM.covers.names}
    assert not model.geom_contype.any()
    assert not model.geom_conaffinity.any()
    folded = placed(compiled(), np.array([0.0, 0.0, 0.0, -np.pi / 2]))
    assert folded.ncon == 0


@pytest.mark.parametrize(("change", "named"), [
    ({"shapes": ("ball",)}, "shapes"),
    ({"shapes": ()}, "shapes"),
    ({"positions": (0.0, 0.0)}, "positions"),
    ({"rotations": (0.0,) * 6}, "rotations"),
    ({"sizes": (0.1, 0.0, 0.1)}, "block: world.obstacles.sizes"),
    ({"sizes": (0.1, -0.2, 0.1)}, "sizes"),
    ({"stiffness": (0.0,)}, "stiffness"),
    ({"damping": (-1.0,)}, "damping"),
    ({"friction": (float("nan"),)}, "friction"),
    ({"names": ("block", "post")}, "obstacles.stiffness"),
    ({"names": ("",)}, "obstacles.names' is ''; give each a name of its own"),
])  # fmt: skip
def test_bad_obstacle_is_refused_with_the_name_of_the_parameter(change: dict[str, object], named: str) -> None:
    assert build(Obstacles, values(FOAM)) == FOAM
    with pytest.raises(ParameterError, match=named):
        build(Obstacles, values(FOAM) | change)

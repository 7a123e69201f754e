"""A task as a picture: the arm and the objects when its longest step begins and ends, and the result's curves."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from matplotlib.axes import Axes

from wam_analysis import arm_picture
from wam_description.signals import ObjectState
from wam_description.world import Obstacles, World
from wam_studies.figures.style import panels
from wam_studies.tasks.object_traces import object_states, world_of
from wam_studies.thesis.definition import Experiment
from wam_studies.thesis.figure import draw_panel
from wam_studies.thesis.recording import Recording, recording
from wam_studies.thesis.rows import Result

AZIMUTH, ELEVATION = 150.0, -24.0  # degrees, of the camera
WIDTH, HEIGHT = 9.2, 6.4  # inches
MOST_PIXELS = 700  # of each picture of the arm, in width


def save(task: Experiment, bag: Path, result: Result, file: Path) -> None:
    """Draw a recorded task.

    Parameters
    ----------
    bag : of its run, or its sample.
    result : of its evaluation.
    file : picture; its suffix is the format.
    """
    run = recording(bag)
    longest = max(run.steps, key=lambda step: step.end - step.begin)
    with panels(file, 2, 2, WIDTH, HEIGHT) as (picture, axes):
        for one, time, when in ((axes[0], longest.begin, "begins"), (axes[1], longest.end, "ends")):
            _draw_arm(one, run, time)
            one.set_title(f"'{longest.name}' {when}, {time:.1f} s", fontsize=9)
        for one, panel in zip(axes[2:], result.panels, strict=False):
            draw_panel(one, panel)
        picture.suptitle(task.title, fontsize=10)


def _draw_arm(axes: Axes, run: Recording, time: float) -> None:
    """The arm and the objects at a time, s; drawn without MuJoCo's renderer where there is no OpenGL."""
    arm, world = run.shared.arm, world_of(run)
    joints = run.joints("sim/joint_states")
    q = joints.position[int(np.searchsorted(joints.time, time).clip(0, len(joints.time) - 1))].tolist()
    states = object_states(run, time)
    everything = _as_obstacles(world, states)
    view = arm_picture.side_view(arm, q, everything, 4.4 / 2.9, azimuth=AZIMUTH, elevation=ELEVATION)
    axes.set_axis_off()
    axes.set_xlim(-view.width / 2.0, view.width / 2.0)
    axes.set_ylim(-view.height / 2.0, view.height / 2.0)
    axes.set_aspect("equal")
    pixels = arm_picture.render(arm, q, world.obstacles, view, moved=(world, states))
    if pixels is None:
        arm_picture.draw(axes, arm, q, everything, view)
        return
    step = max(1, pixels.shape[1] // MOST_PIXELS)
    axes.imshow(pixels[::step, ::step], extent=(*axes.get_xlim(), *axes.get_ylim()), interpolation="lanczos", zorder=0)


class Solid(NamedTuple):
    """A thing that is drawn: its name and shape, centre, roll pitch yaw and size, three numbers each."""

    name: str
    shape: str
    position: tuple[float, ...]
    rotation: tuple[float, ...]
    size: tuple[float, ...]


def _as_obstacles(world: World, states: Sequence[ObjectState]) -> Obstacles:
    """Everything that there is, where it is, as obstacles; a ball as a cylinder of its radius."""
    given = world.obstacles
    solids = [
        Solid(
            name,
            given.shapes[i],
            *(each[3 * i : 3 * i + 3] for each in (given.positions, given.rotations, given.sizes)),
        )
        for i, name in enumerate(given.names)
        if name not in world.moving
    ]
    solids += [_solid(world, name, state) for name, state in zip(world.objects, states, strict=True)]
    one = (1.0,) * len(solids)
    return Obstacles(
        tuple(solid.name for solid in solids),
        tuple(solid.shape for solid in solids),
        tuple(x for solid in solids for x in solid.position),
        tuple(x for solid in solids for x in solid.rotation),
        tuple(x for solid in solids for x in solid.size),
        one,
        one,
        one,
        one,
    )


def _solid(world: World, name: str, state: ObjectState) -> Solid:
    turn = pin.Quaternion(state.qw, state.qx, state.qy, state.qz).toRotationMatrix()
    rotation, centre = tuple(pin.rpy.matrixToRpy(turn).tolist()), np.array((state.x, state.y, state.z))
    if name in world.moving:
        i, group = world.obstacles.names.index(name), world.obstacles
        return Solid(name, group.shapes[i], tuple(centre.tolist()), rotation, group.sizes[3 * i : 3 * i + 3])
    if name in world.doors.names:
        i = world.doors.names.index(name)
        size = world.doors.sizes[3 * i : 3 * i + 3]
        return Solid(name, "box", tuple((centre + turn @ (size[0], 0.0, 0.0)).tolist()), rotation, size)
    i = world.bodies.names.index(name)
    size, shape = world.bodies.sizes[3 * i : 3 * i + 3], world.bodies.shapes[i]
    if shape == "ball":
        size, shape = (size[0], size[0], 0.0), "cylinder"
    return Solid(name, shape, tuple(centre.tolist()), rotation, size)

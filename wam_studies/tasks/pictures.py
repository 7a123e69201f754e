"""A task as a picture: the arm and the objects when its longest step begins and ends, and the result's curves."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from wam_analysis import arm_picture
from wam_studies.figures.style import draw_panel, panels
from wam_studies.thesis.definition import Experiment
from wam_studies.thesis.recording import Recording, recording
from wam_studies.thesis.rows import Result

AZIMUTH, ELEVATION = 150.0, -24.0  # degrees, of the camera
MARGIN = 0.2  # m around what is seen: the objects by their centres
WIDTH, HEIGHT = 9.2, 6.4  # inches


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
    """The arm and the objects at a time, s."""
    arm, world = run.shared.arm, run.world
    joints = run.joints("sim/joint_states")
    q = joints.position[int(np.searchsorted(joints.time, time).clip(0, len(joints.time) - 1))].tolist()
    states = run.object_states(time)
    seen = [np.array((state.x, state.y, state.z)) for state in states]
    shown = arm_picture.scene(arm, q, world, states)
    view = arm_picture.side_view(shown, 4.4 / 2.9, MARGIN, AZIMUTH, ELEVATION, seen)
    arm_picture.draw(axes, shown, view)

"""Frames of the URDF, as robot_state_publisher reads them, against the table of (A.4) by hand and the page."""

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from contact_truth import cover_frame, frame

from wam_description.configuration import Configuration, packaged
from wam_description.urdf import urdf


def in_the_root(name: str, q: Sequence[float]) -> dict[str, np.ndarray]:
    """Every frame of an arm, (4, 4)."""
    model = pin.buildModelFromXML(urdf(Configuration.load(packaged(name)).shared.arm))
    data = model.createData()
    pin.framesForwardKinematics(model, data, np.array(q))
    return {one.name: data.oMf[i].homogeneous for i, one in enumerate(model.frames)}


def test_covers_and_links_of_the_thesis_are_where_its_table_puts_them() -> None:
    for q in ((0.3, -1.0, 0.2, 0.5), (-1.1, 0.4, -0.9, 1.9)):
        found = in_the_root("wam", q)
        for i in range(4):
            np.testing.assert_allclose(found[f"link{i + 1}"], frame(q, i + 1), atol=1e-9)
        for cover in ("inner_link", "outer_link"):
            np.testing.assert_allclose(found[cover], cover_frame(q, cover), atol=1e-9)


PAGE = Path(__file__).parents[2] / "docs/topics.md"
AXES = re.findall(r"^\| `(\w+)` of `(.*)` \| (.*) \| (.*) \| (.*) \|$", PAGE.read_text(), re.MULTILINE)


@pytest.mark.parametrize(("cover", "name", "axes"), [(cover, name, axes) for cover, name, *axes in AXES])
def test_the_axes_of_a_cover_point_where_the_page_states(cover: str, name: str, axes: list[str]) -> None:
    turn = in_the_root(name, [0.0] * 4)[cover][:3, :3]
    stated = [(-1.0 if axis[0] == "-" else 1.0) * np.eye(3)["xyz".index(axis[-1])] for axis in axes]
    np.testing.assert_allclose(turn.T, stated, atol=1e-9)

"""The objects of the world in the page: free bodies, doors and moving obstacles, where the simulator has them."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import viser

from wam_analysis.drawing import BLOCK_COLOUR, OBJECT_COLOUR, channels
from wam_description.signals import ObjectState
from wam_description.world import Obstacles, World


class ObjectMeshes:
    """A mesh for each object, moved to where it is.

    Parameters
    ----------
    server : of the page.
    world : as the driver's parameters have it.
    """

    def __init__(self, server: viser.ViserServer, world: World) -> None:
        self._scene = server.scene
        self.frames = [self._scene.add_frame(f"/world/{name}", show_axes=False) for name in world.objects]
        for name, shape, size, centre in world.solids:
            self._add(name, shape, size, centre, BLOCK_COLOUR if name in world.moving else OBJECT_COLOUR)

    def show(self, states: Sequence[ObjectState]) -> None:
        """Move every mesh to its place; without states they stay where they are."""
        for frame, state in zip(self.frames, states, strict=False):
            frame.position = (state.x, state.y, state.z)
            frame.wxyz = (state.qw, state.qx, state.qy, state.qz)

    def _add(
        self, name: str, shape: str, size: Sequence[float], centre: tuple[float, float, float], colour: str
    ) -> None:
        path, look = f"/world/{name}/mesh", channels(colour)
        place: dict[str, Any] = {"position": centre, "cast_shadow": False}
        if shape == "ball":
            self._scene.add_icosphere(path, size[0], look, **place)
        elif shape == "cylinder":
            self._scene.add_cylinder(path, size[0], 2.0 * size[1], look, **place)
        else:
            thick = size[2] if shape == "box" else 0.002
            self._scene.add_box(path, look, (2.0 * size[0], 2.0 * size[1], 2.0 * thick), **place)


def at_rest(world: World) -> Obstacles:
    """The obstacles that do not move."""
    obstacles = world.obstacles
    kept = [i for i, name in enumerate(obstacles.names) if name not in world.moving]
    picked: dict[str, Any] = {}
    for field in dataclasses.fields(obstacles):
        values = getattr(obstacles, field.name)
        width = len(values) // max(len(obstacles.names), 1)
        picked[field.name] = tuple(value for i in kept for value in values[width * i : width * (i + 1)])
    return Obstacles(**picked)

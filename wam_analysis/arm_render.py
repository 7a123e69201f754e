"""Renders one scene with MuJoCo in a separate process: scene as JSON on stdin, RGB as .npy in a file."""

import json
import sys
from typing import Any
from xml.etree import ElementTree

import numpy as np

from wam_analysis.thresholds import LAYOUT


def main() -> None:
    """Render the scene on stdin into the file named on the command line."""
    scene = json.load(sys.stdin)
    np.save(sys.argv[1], _render(scene))


def _render(scene: dict[str, Any]) -> np.ndarray:
    import mujoco

    width, height = scene["size"]
    model = mujoco.MjModel.from_xml_string(_lit(scene))
    data = mujoco.MjData(model)
    for joint, angle in scene["joints"].items():
        data.joint(joint).qpos[0] = angle
    for placed in scene["objects"]:
        body = model.body(placed["name"])
        if placed["hinge"]:
            data.joint(placed["hinge"]).qpos[0] = placed["angle"]
        elif body.mocapid[0] >= 0:
            data.mocap_pos[body.mocapid[0]] = placed["pose"][:3]
        else:
            data.qpos[model.jnt_qposadr[body.jntadr[0]] :][:7] = placed["pose"]
    mujoco.mj_kinematics(model, data)
    mujoco.mj_camlight(model, data)
    camera = mujoco.MjvCamera()
    camera.azimuth, camera.elevation = scene["azimuth"], scene["elevation"]
    camera.lookat[:] = scene["centre"]
    camera.distance = 3.0
    camera.orthographic = 1
    model.vis.global_.fovy = scene["extent"]
    with mujoco.Renderer(model, height, width) as renderer:
        renderer.update_scene(data, camera)
        return renderer.render()


def _lit(scene: dict[str, Any]) -> str:
    """The model with light, a white floor and a base."""
    root = ElementTree.fromstring(scene["xml"])
    world = root.find("worldbody")
    if world is None:
        raise ValueError("the model has no worldbody")
    floor, radius = scene["floor"], scene["pedestal"]
    width, height = scene["size"]
    visual = ElementTree.SubElement(root, "visual")
    _add(visual, "global", offwidth=width, offheight=height)
    _add(visual, "quality", shadowsize=8192, offsamples=8)
    _add(visual, "headlight", ambient="0.58 0.58 0.58", diffuse="0.18 0.18 0.18", specular="0 0 0")
    _add(visual, "map", znear=0.01, zfar=50)
    _add(root, "statistic", extent=1.5, center="0.4 0 0.1")
    asset = ElementTree.SubElement(root, "asset")
    _add(asset, "texture", type="skybox", builtin="flat", rgb1="1 1 1", rgb2="1 1 1", width=16, height=16)
    _add(asset, "material", name="floor", rgba="1 1 1 1", specular=0, shininess=0, reflectance=0)
    light = {"type": "directional", "pos": "-1 -1.6 3", "dir": "0.1 0.4 -0.9", "castshadow": "true"}
    _add(world, "light", diffuse="0.3 0.3 0.3", ambient="0.12 0.12 0.12", specular="0.15 0.15 0.15", **light)
    _add(world, "geom", type="plane", pos=f"0 0 {floor - LAYOUT.floor_gap}", size="20 20 1", material="floor")
    pillar = {"fromto": f"0 0 {floor} 0 0 0", "size": radius}
    _add(world, "geom", name="pedestal", type="capsule", **pillar)
    for geom in root.iter("geom"):
        colour = scene["colours"].get(geom.get("name", ""))
        if colour:
            geom.set("rgba", " ".join(map(str, [*colour, 1.0])))
    return ElementTree.tostring(root, encoding="unicode")


def _add(parent: ElementTree.Element, tag: str, **attributes: object) -> None:
    ElementTree.SubElement(parent, tag, {key: str(value) for key, value in attributes.items()})


if __name__ == "__main__":
    main()

"""The contact as RViz markers: an arrow for the force, a sphere for the place."""

from collections.abc import Sequence
from math import isnan

from geometry_msgs.msg import Point, Vector3
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from wam_ros.messages import header

METRES_PER_NEWTON = 0.02
RED, GREY = ColorRGBA(r=0.85, g=0.1, b=0.1, a=1.0), ColorRGBA(r=0.5, g=0.5, b=0.5, a=0.6)


def contact_markers(stamp: int, cover: str, place: float, force: Sequence[float]) -> MarkerArray:
    """Markers of a contact, in the frame of the cover.

    Parameters
    ----------
    stamp : time, ns.
    cover : touched cover, empty without contact, which deletes the markers.
    place : m along the cover; where it is NaN the markers are grey and stand at the cover's origin.
    force : (3,), N, of the world on the link; the arrow's tip is at the place.
    """
    if not cover:
        gone = Marker(header=header(stamp, "base"), action=Marker.DELETEALL)
        return MarkerArray(markers=[gone])
    x = 0.0 if isnan(place) else float(place)
    colour = GREY if isnan(place) else RED
    tip = Point(x=x, y=0.0, z=0.0)
    fx, fy, fz = (METRES_PER_NEWTON * float(component) for component in force)
    arrow = Marker(
        header=header(stamp, cover),
        ns="contact",
        id=0,
        type=Marker.ARROW,
        points=[Point(x=x - fx, y=-fy, z=-fz), tip],
        scale=Vector3(x=0.01, y=0.02, z=0.03),
        color=colour,
    )
    sphere = Marker(
        header=header(stamp, cover),
        ns="contact",
        id=1,
        type=Marker.SPHERE,
        scale=Vector3(x=0.03, y=0.03, z=0.03),
        color=colour,
    )
    sphere.pose.position = tip
    return MarkerArray(markers=[arrow, sphere])

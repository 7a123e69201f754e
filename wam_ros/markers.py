"""The contact as RViz markers: an arrow for the force, a sphere for the position, a band where it is likely."""

from math import isnan

from geometry_msgs.msg import Point, Vector3
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from wam_description.signals import BASE, ContactView
from wam_ros.ros_topics import header

METRES_PER_NEWTON = 0.02
HALF = 0.5**0.5  # sine and cosine of 45 deg
BAND = 0.06  # m, diameter, a little more than the tubes
RED, GREY = ColorRGBA(r=0.85, g=0.1, b=0.1, a=1.0), ColorRGBA(r=0.5, g=0.5, b=0.5, a=0.6)
LIKELY = ColorRGBA(r=0.95, g=0.6, b=0.1, a=0.45)


def contact_markers(stamp: int, view: ContactView) -> MarkerArray:
    """Markers of a contact, in the frames of the covers; each message replaces those before.

    The tip of the arrow is at the contact.  Where its position is NaN, arrow and sphere are grey and in the
    middle of the likely range.  Bands show the parts of covers that hold the position with 90 % probability in
    all.  Without contact the markers are deleted.

    Parameters
    ----------
    stamp : time, ns.
    view : what to draw.
    """
    cover, place, force, *_ = view.contact
    gone = Marker(header=header(stamp, BASE), action=Marker.DELETEALL)
    if not cover:
        return MarkerArray(markers=[gone])
    mine = next((0.5 * (part.low + part.high) for part in view.likely if part.cover == cover), 0.0)
    x, colour = (mine, GREY) if isnan(place) else (float(place), RED)
    tip = Point(x=x, y=0.0, z=0.0)
    fx, fy, fz = (METRES_PER_NEWTON * float(component) for component in force)
    arrow = _marker(stamp, cover, "contact", 0, Marker.ARROW, colour, (0.01, 0.02, 0.03))
    arrow.points = [Point(x=x - fx, y=-fy, z=-fz), tip]
    sphere = _marker(stamp, cover, "contact", 1, Marker.SPHERE, colour, (0.03, 0.03, 0.03))
    sphere.pose.position = tip
    bands = []
    for i, part in enumerate(view.likely):
        band = _marker(
            stamp, part.cover, "likely", i, Marker.CYLINDER, LIKELY, (BAND, BAND, float(part.high - part.low))
        )
        band.pose.position.x = 0.5 * float(part.low + part.high)
        band.pose.orientation.y, band.pose.orientation.w = HALF, HALF  # a cylinder is along z
        bands.append(band)
    return MarkerArray(markers=[gone, arrow, sphere, *bands])


def _marker(
    stamp: int, frame: str, group: str, number: int, kind: int, colour: ColorRGBA, size: tuple[float, float, float]
) -> Marker:
    x, y, z = size
    return Marker(
        header=header(stamp, frame), ns=group, id=number, type=kind, scale=Vector3(x=x, y=y, z=z), color=colour
    )

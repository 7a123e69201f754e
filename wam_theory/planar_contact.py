"""Position and force of a contact on a planar two-link arm, from its two joint torques (section 2.1.1)."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from wam_theory.arguments import Array, above_zero, finite


class PlanarContact(NamedTuple):
    """Force, N, normal to the outer link, and its position along that link, m, from the outer joint."""

    force: Array
    position: Array


def planar_contact(
    inner_torque: ArrayLike, outer_torque: ArrayLike, length: ArrayLike, elbow_angle: ArrayLike
) -> PlanarContact:
    """Contact on the outer link from joint torques, (2.1) and (2.2) in general form.

    F_c = (tau_1 - tau_2)/(L cos theta_2), x = tau_2/F_c; the print has cos theta_2 = 1, the straight
    arm of figure 2.1.  At rest, one contact, no friction in it: the force is normal to the outer link
    and the torques are those of the contact only.

    Parameters
    ----------
    inner_torque, outer_torque : tau_1, tau_2 of the force about the inner and the outer joint, N m.
    length : L of the inner link, m, above zero.
    elbow_angle : theta_2 between outer and inner link, rad, 0 for the straight arm.

    Returns
    -------
    PlanarContact
        arrays of the shape the arguments broadcast to.  At a right angle both joint torques are equal:
        force and position are NaN.  Without force the position is NaN.
    """
    (arm,) = above_zero(length=length)
    tau_1, tau_2, theta = finite(inner_torque=inner_torque, outer_torque=outer_torque, elbow_angle=elbow_angle)
    tau_1, tau_2, lever = np.broadcast_arrays(tau_1, tau_2, arm * np.cos(theta))
    singular = np.abs(lever) <= 1e-12 * arm
    force = np.divide(tau_1 - tau_2, lever, out=np.full(lever.shape, np.nan), where=~singular)
    position = np.divide(tau_2, force, out=np.full(lever.shape, np.nan), where=~singular & (force != 0.0))
    return PlanarContact(force, position)

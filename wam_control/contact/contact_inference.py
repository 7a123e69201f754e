"""Contact isolation and identification: which link, where and how hard, from the external joint torques.

Salisbury (1984): position and force from joint torques.  On the outer link there are four equations
for position, angle and force; on the inner link axes 1-3 meet in the shoulder and measure the
moment only.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wam_control.contact.contact_fit import ContactFit, Fit, log_evidence
from wam_control.contact.contact_fusion import ContactFusion, Torques
from wam_control.contact.inference_parameters import InferenceParameters
from wam_control.contact.thresholds import CONTACT
from wam_description.arm import Arm
from wam_description.parameters import lengths, require
from wam_description.reasons import NO_REASON, Reason
from wam_description.rigid_body import RigidBody
from wam_description.small_matrices import inverse
from wam_description.units import STANDARD_GRAVITY

Array = NDArray[np.float64]
Triple = tuple[float, float, float]


class Hypothesis(NamedTuple):
    """One contact on one link that may explain the torques.

    Attributes
    ----------
    cover : name of the cover.
    probability : of this hypothesis among all, 0..1.
    position : contact position, m along the cover's x axis, NaN where it cannot be observed.
    position_sd : m, NaN where the position is.
    low, high : m, ends of the part of the cover that is in the 90 % set of positions on all covers; NaN
        where no part is.
    force : (3,), N, of the world on the link, in the cover's frame; where the position is NaN the
        smallest force that explains the torques, that at the far end of the link.
    force_sd : N, standard deviation of its size; NaN where it is a lower bound.
    is_lower_bound : True where `force` is that smallest force.
    direction : rad, angle of the force about the link, from the cover's y to its z axis.
    direction_sd : rad.
    moment : (3,), N m, of the force about the origin of the cover's frame, in that frame.
    residual : chi^2 that the contact does not explain, per moment that counts.
    reasons : why the position is unknown or the estimate not reliable.
    """

    cover: str
    probability: float
    position: float
    position_sd: float
    low: float
    high: float
    force: Triple
    force_sd: float
    is_lower_bound: bool
    direction: float
    direction_sd: float
    moment: Triple
    residual: float
    reasons: Reason


class _Cover(NamedTuple):
    name: str
    start: float  # m, ends of the tube along the cover's x axis
    end: float
    wrenches: Array  # (6, 6), rows A_1, A_2, B_1, B_2, twist, axial: force and moment in the cover's frame
    is_moment_only: bool


def detection_statistic(torques: Sequence[float], precision: Array) -> float:
    """r^T S^-1 r of external torques r, (n,), N m, with the inverse of their covariance S, (n, n)."""
    r = np.array(torques)
    return float(r.dot(precision).dot(r))


class ContactInference:
    """Gives one hypothesis per cover, from the probabilities of contact positions along it.

    Any joints, links and covers will do.
    """

    def __init__(self, arm: Arm, body: RigidBody, parameters: InferenceParameters) -> None:
        self._body, self._parameters = body, parameters
        self._covers = [_cover(arm, body, i) for i in range(len(arm.covers.names))]
        lengths("inference", arm.covers.names, {"weights": parameters.weights})
        self._fit = ContactFit(arm.covers.start[::3], arm.covers.end[::3], arm.covers.radius, parameters)
        self._wrenches = np.array([cover.wrenches for cover in self._covers])

    def infer(
        self,
        q: ArrayLike,
        torques: Sequence[float],
        precision: Array,
        load: Array | None = None,
        fusion: ContactFusion | None = None,
        now: Torques | None = None,
    ) -> tuple[Hypothesis, ...]:
        """Explain external torques by one contact.

        Parameters
        ----------
        q : (n,), joint angles, rad.
        torques : (n,), external torques, N m.
        precision : (n, n), the inverse of their covariance, 1/(N^2 m^2); not below `smallest_sd`.
        load : (n,), torques of a mass of 1 kg at the tool, N m; None if none may have been picked up.
        fusion : earlier moments of the same contact, to which this one is added; None for this one alone.
        now : the same torques with what is known of their errors, for `fusion`.

        Returns
        -------
        tuple of Hypothesis
            one per cover, the most probable first; what their probabilities lack to 1 is that of a payload.
        """
        given, links = self._parameters, len(self._covers)
        if (size := float(precision.trace())) > (10.0 * CONTACT.smallest_sd) ** -2:
            fusion = None  # together they would be as exact
        if size > CONTACT.smallest_sd**-2:
            precision = inverse(inverse(precision) + CONTACT.smallest_sd**2 * np.eye(len(torques)))
        at = np.array(q)
        jacobians = np.array([self._body.cover_jacobian(at, cover.name) for cover in self._covers])
        rows = np.zeros((links + 1, 7, len(torques)))  # the last are those of a payload
        rows[:, 0] = torques
        np.matmul(self._wrenches, jacobians, out=rows[:links, 1:])
        if load is not None:
            rows[links, 1] = load
        gram = fusion.gram(rows, now) if fusion is not None and now is not None else None
        if gram is None:
            gram = rows @ precision @ rows.transpose(0, 2, 1)
        payload = -math.inf
        if load is not None and given.payload_weight:
            scale = np.array([1.0, given.force_scale / STANDARD_GRAVITY])
            found = gram[links, :2, :2] * np.outer(scale, scale)
            # a mass is positive: twice the probability that it is
            chance = math.erfc(-float(found[0, 1]) / math.sqrt(2.0 * (1.0 + float(found[1, 1]))))
            payload = math.log(given.payload_weight * max(chance, CONTACT.least_chance)) + float(log_evidence(found))
        fits = self._fit(gram[:links], payload)
        order = sorted(range(links), key=lambda i: -fits[i].probability)
        best, moments = fits[order[0]], 1
        if fusion is not None and now is not None:
            moments = fusion.count
            fusion.remember(rows, now, [(fit.position, fit.probability) for fit in fits], best.residual)
        reasons = NO_REASON
        if best.probability < given.identification_threshold:
            reasons |= Reason.LINKS
        if 1.0 - sum([fit.probability for fit in fits]) > CONTACT.noted_probability:
            reasons |= Reason.PAYLOAD
        return tuple([self._hypothesis(self._covers[i], fits[i], reasons, moments) for i in order])

    def _hypothesis(self, cover: _Cover, fit: Fit, reasons: Reason, moments: int) -> Hypothesis:
        is_unknown = cover.is_moment_only or fit.torque_position_sd > cover.end - cover.start
        residual = fit.residual / moments
        if fit.along > (CONTACT.noted_probability if reasons & ~Reason.PAYLOAD else 0.5):
            reasons |= Reason.ALONG
        if is_unknown:
            reasons |= Reason.MOMENT_ONLY if cover.is_moment_only else Reason.POSITION
        if residual > self._parameters.largest_residual:
            reasons |= Reason.MORE
        place = cover.end if is_unknown else fit.position
        f1, f2 = fit.force_at_end if is_unknown else fit.force
        x, y, z, m1, m2, m3 = np.array((f1, f2, place * f1, place * f2)).dot(cover.wrenches[:4]).tolist()
        return Hypothesis(
            cover=cover.name,
            probability=fit.probability,
            position=math.nan if is_unknown else place,
            position_sd=math.nan if is_unknown else fit.position_sd,
            low=fit.low,
            high=fit.high,
            force=(x, y, z),
            force_sd=math.nan if is_unknown else fit.force_sd,
            is_lower_bound=is_unknown,
            direction=math.atan2(f2, f1),
            direction_sd=fit.direction_sd,
            moment=(m1, m2, m3),
            residual=residual,
            reasons=reasons,
        )


def _cover(arm: Arm, body: RigidBody, i: int) -> _Cover:
    covers = arm.covers
    name = covers.names[i]
    start, end = np.array(covers.start[3 * i : 3 * i + 3]), np.array(covers.end[3 * i : 3 * i + 3])
    require(
        end[0] > start[0],
        f"cover '{name}': end x {end[0]:g} m is not beyond start x {start[0]:g} m; x runs along the link",
    )
    slope = (end - start) / (end[0] - start[0])
    axis = slope / np.linalg.norm(slope)
    first = np.array([0.0, 1.0, 0.0]) - axis[1] * axis
    first /= np.linalg.norm(first)
    across = np.stack((first, np.cross(axis, first)))
    origin, none = start - start[0] * slope, np.zeros((3, 3))
    forces = np.concatenate((across, none, axis[None]))
    moments = np.concatenate(
        (np.cross(origin, across), np.cross(slope, across), axis[None], np.cross(origin, axis)[None])
    )
    # where no joint moves the start of the tube, only the product of x and force is measured
    return _Cover(name, start[0], end[0], np.hstack((forces, moments)), not body.moves(name, origin))

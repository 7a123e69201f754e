"""Contact isolation and identification: which link, where and how hard, from the external joint torques.

Salisbury (1984): position and force from joint torques.  On the outer link there are four equations
for position, angle and force; on the inner link axes 1-3 meet in the shoulder and measure the
moment only.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from wam_control.contact.contact_fit import ContactFit, Fit, log_evidence_of_weight
from wam_control.contact.contact_fusion import ContactFusion, Torques
from wam_control.contact.inference_parameters import InferenceParameters
from wam_control.contact.thresholds import CONTACT
from wam_description.arm import Arm
from wam_description.parameters import require, require_fit, rows
from wam_description.reasons import NO_REASON, Reason
from wam_description.rigid_body import Array, RigidBody
from wam_description.signals import ZERO, Triple
from wam_description.small_matrices import cross, inverse
from wam_description.units import STANDARD_GRAVITY


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
        smallest force that explains the torques, that at the far end of the link, or at its start.
    force_sd : N, standard deviation of its size; NaN where it is a lower bound.
    is_lower_bound : True where `force` is that smallest force.
    direction : rad, angle of the force about the link, from the cover's y to its z axis.
    direction_sd : rad.
    moment : (3,), N m, of the force about the origin of the cover's frame, in that frame.
    residual : chi^2 that the contact does not explain, per instant that counts.
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


NO_HYPOTHESIS = Hypothesis(
    "", *(math.nan,) * 5, ZERO, math.nan, False, math.nan, math.nan, ZERO, math.nan, NO_REASON
)  # without contact


class _Cover(NamedTuple):
    name: str
    start: float  # m along x, ends of the tube
    end: float
    wrenches: Array  # (6, 6), rows A_1, A_2, B_1, B_2, twist, axial: force and moment in the cover's frame
    ways: list[list[float]]  # (3, 3), directions across the tube, near the cover's y and z, and along it
    is_moment_only: bool


def detection_statistic(torques: Array, precision: Array) -> float:
    """r^T S^-1 r of external torques r, (n,), N m, with the inverse of their covariance S, (n, n)."""
    return float(torques.dot(precision).dot(torques))


class ContactInference:
    """Gives one hypothesis per cover, from the probabilities of contact positions along it.

    Any joints, links and covers will do.

    Attributes
    ----------
    fusion : earlier instants of the present contact.
    """

    def __init__(self, arm: Arm, body: RigidBody, parameters: InferenceParameters) -> None:
        self._body, self._parameters = body, parameters
        self._covers = covers = [_cover(arm, body, cover) for cover in rows(arm.covers)]
        require_fit(parameters, arm)
        ends = [cover.start for cover in covers], [cover.end for cover in covers]
        self._fit = ContactFit(*ends, arm.covers.radius, parameters)
        self._wrenches = np.array([cover.wrenches for cover in covers])
        self.fusion = ContactFusion(parameters.fusion_time)

    def infer(
        self,
        q: ArrayLike,
        torques: ArrayLike,
        precision: Array,
        load: Array | None = None,
        now: Torques | None = None,
        late: float = 0.0,
    ) -> tuple[Hypothesis, ...]:
        """Explain external torques by one contact.

        Parameters
        ----------
        q : (n,), joint angles, rad.
        torques : (n,), external torques, N m.
        precision : (n, n), the inverse of their covariance, 1/(N^2 m^2).
        load : (n,), torques of a mass of 1 kg at the tool, N m; None if none may have been picked up.
        now : the same torques with what is known of their errors, to add them to `fusion`; None for them alone.
        late : change of the force that the torques do not show yet, as a fraction of it.

        Returns
        -------
        tuple of Hypothesis
            one per cover, the most probable first; what their probabilities lack to 1 is that of a payload.
        """
        given, links = self._parameters, len(self._covers)
        if sum(precision.diagonal().tolist()) > CONTACT.smallest_sd**-2:
            precision = inverse(inverse(precision) + CONTACT.smallest_sd**2 * np.eye(len(precision)))
        jacobians = np.array([self._body.cover_jacobian(q, cover.name) for cover in self._covers])
        rows = np.zeros((links + 1, 7, len(precision)))  # the last are those of a payload
        rows[:, 0] = torques
        np.matmul(self._wrenches, jacobians, out=rows[:links, 1:])
        if load is not None:
            rows[links, 1] = load
        gram = None if now is None else self.fusion.gram(rows, now)
        if gram is None:
            gram = rows @ precision @ rows.transpose(0, 2, 1)
        payload = -math.inf
        if load is not None and given.payload_weight:
            payload = math.log(given.payload_weight)
            (rr, ra), (_, aa) = gram[links, :2, :2].tolist()
            payload += log_evidence_of_weight(rr, ra, aa, given.force_scale / STANDARD_GRAVITY)
        fits = self._fit(gram[:links], payload)
        order = sorted(range(links), key=lambda i: -fits[i].probability)
        best, instants = fits[order[0]], 1
        if now is not None:
            instants = self.fusion.count
            self.fusion.remember(rows, now, [(fit.position, fit.probability) for fit in fits], best.residual)
        reasons, doubtful = NO_REASON, 0.5
        if best.probability < given.identification_threshold:
            reasons, doubtful = Reason.LINKS, CONTACT.noted_probability
        if 1.0 - sum([fit.probability for fit in fits]) > CONTACT.noted_probability:
            reasons |= Reason.PAYLOAD
        found = []
        for i in order:
            own = reasons | Reason.ALONG if fits[i].along > doubtful else reasons
            found.append(self._hypothesis(i, fits[i], own, instants, late))
        return tuple(found)

    def _hypothesis(self, i: int, fit: Fit, reasons: Reason, instants: int, late: float) -> Hypothesis:
        cover = self._covers[i]
        start, end = cover.start, cover.end
        is_unknown = cover.is_moment_only or fit.torque_position_sd > end - start
        residual = fit.residual / instants
        if cover.is_moment_only:
            reasons |= Reason.MOMENT_ONLY
        elif is_unknown and not fit.is_at_start:
            sd_of_usual = fit.torque_position_sd * math.hypot(*fit.force) / self._parameters.force_scale
            reasons |= Reason.POSE if sd_of_usual > end - start else Reason.WEAK
        if residual > self._parameters.largest_residual:
            reasons |= Reason.MORE
        place, (f1, f2, along) = fit.position, (*fit.force, 0.0)
        if is_unknown:
            place, (f1, f2, along) = start if fit.is_at_start else end, fit.smallest
        fx, fy, fz = [f1 * e1 + f2 * e2 + along * e3 for e1, e2, e3 in cover.ways]
        force = fx, fy, fz
        return Hypothesis(
            cover=cover.name,
            probability=fit.probability,
            position=math.nan if is_unknown else place,
            position_sd=math.nan if is_unknown else fit.position_sd,
            low=fit.low,
            high=fit.high,
            force=force,
            force_sd=math.nan if is_unknown else math.hypot(fit.force_sd, late * math.hypot(*force)),
            is_lower_bound=is_unknown,
            direction=math.atan2(f2, f1),
            direction_sd=fit.direction_sd,
            moment=cross(self._body.arm.covers.on_axis(cover.name, place), force),
            residual=residual,
            reasons=reasons,
        )


def _cover(arm: Arm, body: RigidBody, cover: Any) -> _Cover:
    name, start, end = cover.name, np.array(cover.start), np.array(cover.end)
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
    return _Cover(
        name=name,
        start=float(start[0]),
        end=float(end[0]),
        wrenches=np.hstack((forces, moments)),
        ways=np.column_stack((*across, axis)).tolist(),
        is_moment_only=not body.moves(name, origin),  # only the product of x and force is measured then
    )

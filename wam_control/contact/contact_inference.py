"""Contact isolation and identification: which link, where and how hard, from the external joint torques.

Salisbury (1984): position and force from joint torques.  On the outer link there are four equations
for position, angle and force; on the inner link axes 1-3 meet in the shoulder and measure the
moment only.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_control.contact.contact_fit import ContactFit, Fit, log_evidence_of_weight
from wam_control.contact.contact_fusion import ContactFusion, Guess, Torques
from wam_control.contact.inference_parameters import InferenceParameters
from wam_control.contact.thresholds import CONTACT
from wam_description.arm import Arm
from wam_description.parameters import lengths, require
from wam_description.reasons import NO_REASON, Reason
from wam_description.rigid_body import RigidBody
from wam_description.units import STANDARD_GRAVITY

Array = NDArray[np.float64]
Triple = tuple[float, float, float]

NEAR = math.cos(math.radians(20.0))  # how close to an ambiguous pose or direction that is given as the reason


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
    start: Triple  # m, ends of the tube's axis in the cover's frame
    end: Triple
    wrenches: Array  # (6, 6), rows A_1, A_2, B_1, B_2, twist, axial: force and moment in the cover's frame
    across: Array  # (3, 2), directions across the tube, near the cover's y and z
    directions: list[list[float]]  # the same
    hinge: Array  # (3,), axis of the link's joint in the cover's frame
    joints: int  # number of joints that move the cover
    is_moment_only: bool


class _Elbow(NamedTuple):
    """Indices of the covers at both sides of an elbow."""

    inner: int
    outer: int


def _elbow(covers: Sequence[_Cover]) -> _Elbow | None:
    """The one joint between a cover of which a moment alone is measured and one that is located, None without one."""
    for i, outer in enumerate(covers[1:], start=1):
        inner = covers[i - 1]
        if inner.is_moment_only and not outer.is_moment_only and inner.joints == outer.joints - 1:
            return _Elbow(i - 1, i)
    return None


def detection_statistic(torques: Sequence[float], precision: Array) -> float:
    """r^T S^-1 r of external torques r, (n,), N m, with the inverse of their covariance S, (n, n)."""
    r = np.array(torques)
    return float(r.dot(precision).dot(r))


class ContactInference:
    """One hypothesis per cover, by the probability of contact positions along it.

    Any joints, links and covers will do.  Where joints meet in a shoulder, with a cover from there to the next joint,
    the elbow, and a cover from that on, reasons name poses of these two.

    Attributes
    ----------
    jacobians : (covers, 6, n), of the covers in the last pose.
    """

    def __init__(self, arm: Arm, body: RigidBody, parameters: InferenceParameters) -> None:
        self._body, self._parameters = body, parameters
        self._covers = [_cover(arm, body, i) for i in range(len(arm.covers.names))]
        covers = self._covers
        lengths("inference", arm.covers.names, {"weights": parameters.weights})
        self._fit = ContactFit(
            [cover.start[0] for cover in covers],
            [cover.end[0] for cover in covers],
            arm.covers.radius,
            parameters.weights,
            force_scale=parameters.force_scale,
            moment_arm_offset=parameters.moment_arm_offset,
            friction=parameters.friction,
            positions=parameters.positions,
            end_weight=parameters.end_weight,
            along_weight=parameters.along_weight,
        )
        self._elbow = _elbow(covers)
        self._wrenches = np.array([cover.wrenches for cover in covers])
        self.jacobians = np.zeros((len(covers), 6, len(arm.joints.names)))  # at the last pose

    def infer(
        self,
        q: Sequence[float],
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
        if (size := sum(precision.diagonal().tolist())) > (10.0 * CONTACT.smallest_sd) ** -2:
            fusion = None  # together they would be as exact
        if size > CONTACT.smallest_sd**-2:
            precision = np.asarray(
                np.linalg.inv(np.linalg.inv(precision) + CONTACT.smallest_sd**2 * np.eye(len(torques))), np.float64
            )
        at, links = np.array(q), len(self._covers)
        self.jacobians = np.array([self._body.cover_jacobian(at, cover.name) for cover in self._covers])
        rows = np.zeros((links + 1, 7, len(torques)))  # the last are those of a payload
        rows[:, 0] = torques
        np.matmul(self._wrenches, self.jacobians, out=rows[:links, 1:])
        weight = self._parameters.payload_weight if load is not None else 0.0
        if load is not None:
            rows[links, 1] = load
        gram = fusion.gram(rows, now) if fusion is not None and now is not None else None
        if gram is None:
            gram = rows @ precision @ rows.transpose(0, 2, 1)
        picked = -math.inf
        if weight:
            least = (STANDARD_GRAVITY / self._parameters.force_scale) ** 2
            picked = math.log(weight) + log_evidence_of_weight(gram[links], least)
        fits = self._fit(gram[:links], picked)
        moments = 1
        if fusion is not None and now is not None:
            moments = fusion.count
            best = max(fits, key=lambda fit: fit.probability)
            fusion.remember(rows, now, [Guess(fit.position, fit.probability) for fit in fits], best.residual)
        is_payload = 1.0 - sum(fit.probability for fit in fits) > CONTACT.noted_probability
        ambiguity = (
            self._ambiguity(q, fits)
            if max(fit.probability for fit in fits) < self._parameters.identification_threshold
            else NO_REASON
        )
        each = zip(self._covers, fits, strict=True)
        found = [self._hypothesis(q, cover, fit, ambiguity, is_payload, moments) for cover, fit in each]
        return tuple(sorted(found, key=lambda hypothesis: -hypothesis.probability))

    def _hypothesis(
        self, q: Sequence[float], cover: _Cover, fit: Fit, ambiguity: Reason, is_payload: bool, moments: int
    ) -> Hypothesis:
        start, end = cover.start, cover.end
        length = end[0] - start[0]
        is_unknown = cover.is_moment_only or fit.torque_position_sd > length
        reasons = ambiguity | (self._why_unknown(q, cover, fit) if is_unknown else NO_REASON)
        if fit.along > (CONTACT.noted_probability if ambiguity else 0.5):
            reasons |= Reason.ALONG
        if fit.residual > moments * self._parameters.largest_residual:
            reasons |= Reason.MORE
        if is_payload:
            reasons |= Reason.PAYLOAD
        place = end[0] if is_unknown else fit.position
        f1, f2 = fit.force_at_end if is_unknown else fit.force
        force = _triple([f1 * e1 + f2 * e2 for e1, e2 in cover.directions])
        share = (place - start[0]) / length
        point = _triple([first + share * (last - first) for first, last in zip(start, end, strict=True)])
        return Hypothesis(
            cover=cover.name,
            probability=fit.probability,
            position=math.nan if is_unknown else place,
            position_sd=math.nan if is_unknown else fit.position_sd,
            low=fit.low,
            high=fit.high,
            force=force,
            force_sd=math.nan if is_unknown else fit.force_sd,
            is_lower_bound=is_unknown,
            direction=math.atan2(f2, f1),
            direction_sd=fit.direction_sd,
            moment=_cross(point, force),
            residual=fit.residual / moments,
            reasons=reasons,
        )

    def _why_unknown(self, q: Sequence[float], cover: _Cover, fit: Fit) -> Reason:
        if cover.is_moment_only:
            return Reason.MOMENT_ONLY
        if self._elbow is None or cover is not self._covers[self._elbow.outer]:
            return Reason.WEAK
        in_plane, straight, bent = self._at_elbow(q, self._elbow, fit)
        if in_plane > NEAR and bent > NEAR:
            return Reason.BENT
        if in_plane < math.sqrt(1.0 - NEAR**2) and straight > NEAR:
            return Reason.STRAIGHT
        axes = self.jacobians[self._elbow.inner][3:, : self._covers[self._elbow.inner].joints]
        if np.linalg.eigvalsh(axes @ axes.T)[0] < 1.0 - NEAR:  # of three axes 1 - cos of the angle of two, as theta2
            return Reason.SHOULDER
        return Reason.WEAK

    def _ambiguity(self, q: Sequence[float], fits: list[Fit]) -> Reason:
        """Why the link is not identified."""
        likely = sorted(range(len(fits)), key=lambda i: -fits[i].probability)[:2]
        if self._elbow is None or set(likely) != set(self._elbow):
            return Reason.LINKS
        outer, fit = self._covers[self._elbow.outer], fits[self._elbow.outer]
        in_plane, straight, _ = self._at_elbow(q, self._elbow, fit)
        if straight > NEAR and in_plane < math.sqrt(1.0 - NEAR**2):
            return Reason.STRAIGHT_LINK
        if fit.position - outer.start[0] < 2.0 * fit.position_sd:
            return Reason.ELBOW
        return Reason.LINKS

    def _at_elbow(self, q: Sequence[float], elbow: _Elbow, fit: Fit) -> tuple[float, float, float]:
        """How much, 0..1, the force lies in the plane of the links, the elbow is straight, the elbow is at 90 deg."""
        cover = self._covers[elbow.outer]
        inner = self._body.cover_pose(q, self._covers[elbow.inner].name).rotation[:, 0]
        outer = self._body.cover_pose(q, cover.name).rotation[:, 0]
        cosine = min(1.0, abs(float(inner @ outer)))
        vector = cover.across @ np.array(fit.force)
        size = float(np.linalg.norm(vector))
        out_of_plane = abs(float(vector @ cover.hinge)) / size if size > 0.0 else 1.0
        return math.sqrt(max(0.0, 1.0 - out_of_plane**2)), cosine, math.sqrt(1.0 - cosine**2)


def _triple(values: Sequence[float]) -> Triple:
    return values[0], values[1], values[2]


def _cross(a: Triple, b: Triple) -> Triple:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _cover(arm: Arm, body: RigidBody, i: int) -> _Cover:
    covers = arm.covers
    name, joints = covers.names[i], arm.links.names.index(covers.links[i]) + 1
    start, end = np.array(covers.start[3 * i : 3 * i + 3]), np.array(covers.end[3 * i : 3 * i + 3])
    require(
        end[0] > start[0],
        f"cover '{name}': end x {end[0]:g} m is not beyond start x {start[0]:g} m; x runs along the link",
    )
    slope = (end - start) / (end[0] - start[0])
    axis = slope / np.linalg.norm(slope)
    first = np.array([0.0, 1.0, 0.0]) - axis[1] * axis
    first /= np.linalg.norm(first)
    across = np.stack((first, np.cross(axis, first)), axis=1)
    origin = start - start[0] * slope
    return _Cover(
        name=name,
        start=_triple(start.tolist()),
        end=_triple(end.tolist()),
        wrenches=_wrenches(origin, slope, axis, across),
        across=across,
        directions=across.tolist(),
        hinge=_hinge(body, name, joints),
        joints=joints,
        is_moment_only=not body.moves(name, origin),  # only the product of x and force is measured then
    )


def _wrenches(origin: Array, slope: Array, axis: Array, across: Array) -> Array:
    """Rows A_1, A_2, B_1, B_2, twist, axial of `ContactFit`, as wrenches about the origin of the cover's frame."""
    at = [np.concatenate((e, np.cross(origin, e))) for e in across.T]
    per_metre = [np.concatenate((np.zeros(3), np.cross(slope, e))) for e in across.T]
    twist = np.concatenate((np.zeros(3), axis))
    axial = np.concatenate((axis, np.cross(origin, axis)))
    return np.stack((*at, *per_metre, twist, axial))


def _hinge(body: RigidBody, name: str, joints: int) -> Array:
    """Axis of the joint that carries the cover, in the cover's frame."""
    return body.cover_jacobian([0.0] * len(body.arm.joints.names), name)[3:, joints - 1]

"""Which link is touched, where and how hard, from the torques of the world on the joints.

Salisbury (1984): place and force from joint torques.  On the outer link there are four equations
for place, angle and force; on the inner link axes 1-3 meet in the shoulder and see the moment only.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_control.contact_fit import Fit, fit_contact
from wam_description.arm import Arm
from wam_description.parameters import parameter, require
from wam_description.rigid_body import RigidBody

Array = NDArray[np.float64]
Triple = tuple[float, float, float]

NEAR = math.cos(math.radians(20.0))  # how near to an ambiguous pose or direction it is named
SMALL = 1e-9  # m, lever arms that are zero but for rounding

MOMENT_ONLY = "sees only the moment: the place is unknown, the force is at least what is given"
BENT = "elbow at 90 deg and force in plane: place and force cannot be told apart"
STRAIGHT = "elbow straight and force out of plane: place and force cannot be told apart"
SHOULDER = "theta2 = 0: axes 1 and 3 are in line and one moment of the shoulder is not seen"
WEAK = "the torques are too small for their uncertainty to tell the place"
ELBOW = "tau3 and tau4 near 0: a contact at the elbow and one on the inner link cannot be told apart"
STRAIGHT_LINK = "elbow straight and force out of plane: the links cannot be told apart"
LINKS = "the torques do not tell which link is touched"
MORE = "one contact does not explain the torques"


@dataclass(frozen=True)
class InferenceParameters:
    """What is taken for likely before anything is felt."""

    force_scale: float = parameter("sd of each component of a contact's force before it is felt", "N", low=0.1)
    miss: float = parameter("sd by which a force misses the tube's axis, per radius: friction", low=0.0, high=2.0)
    places: int = parameter("places along a link from which the fit may start", low=2, high=200)
    sure: float = parameter("probability above which a link counts as told", low=0.5, high=1.0)
    largest_residual: float = parameter("chi^2 above which one contact does not explain the torques", low=0.0)


class Hypothesis(NamedTuple):
    """One contact on one link that may explain the torques.

    Attributes
    ----------
    cover : name of the touched cover.
    probability : of this hypothesis among all, 0..1.
    place : m along the cover's x axis, NaN where it cannot be observed.
    place_sd : m, NaN with the place.
    force : (3,), N, of the world on the link, in the cover's frame; where the place is NaN the
        least force that explains the torques, that at the far end of the link.
    is_lower_bound : True where `force` is that least force.
    direction : rad, angle of the force round the link, from the cover's y to its z axis.
    moment : (3,), N m, of the force about the origin of the cover's frame, in that frame.
    residual : chi^2 that the contact leaves unexplained.
    reason : why the place is not known or the answer not to be trusted, '' where neither.
    """

    cover: str
    probability: float
    place: float
    place_sd: float
    force: Triple
    is_lower_bound: bool
    direction: float
    moment: Triple
    residual: float
    reason: str


class _Cover(NamedTuple):
    name: str
    start: Triple  # m, ends of the tube's axis in the cover's frame
    end: Triple
    radius: float  # m
    points: tuple[Array, Array, Array]  # (3,), m, the axis at x = 0 and x = 1, and one metre beside x = 0
    across: Array  # (3, 2), directions across the tube, near the cover's y and z
    directions: list[list[float]]  # the same
    hinge: Array  # (3,), axis of the link's joint in the cover's frame
    joints: int  # that move the cover
    sees_moment_only: bool


def detection_statistic(torques: Sequence[float], covariance: Array) -> float:
    """r^T S^-1 r of external torques r, (n,), N m, with covariance S, (n, n)."""
    r = np.array(torques)
    return float(r @ np.linalg.solve(covariance, r))


class ContactInference:
    """One hypothesis for each cover, by weighted least squares on the arm's own kinematics.

    The joints, links and covers may be any; reasons name the WAM's poses where the arm has its
    geometry: four joints, an inner cover from shoulder to elbow, an outer one from the elbow on.
    """

    def __init__(self, arm: Arm, body: RigidBody, parameters: InferenceParameters) -> None:
        self._body, self._parameters = body, parameters
        self._covers = [_cover(arm, body, i) for i in range(len(arm.covers.names))]
        self._is_wam = (
            len(arm.joints.names) == 4
            and [cover.joints for cover in self._covers] == [3, 4]
            and self._covers[0].sees_moment_only
        )

    def infer(self, q: Sequence[float], torques: Sequence[float], covariance: Array) -> tuple[Hypothesis, ...]:
        """Explain external torques by one contact.

        Parameters
        ----------
        q : (n,), joint angles, rad.
        torques : (n,), external torques, N m.
        covariance : (n, n), their covariance, N^2 m^2.

        Returns
        -------
        tuple of Hypothesis
            one for each cover, the most probable first; probabilities add up to 1.
        """
        rows = np.concatenate([np.array([torques]), *(self._levers(q, cover) for cover in self._covers)])
        gram = (rows @ np.linalg.solve(covariance, rows.T)).tolist()
        fits = [self._fit(gram, i) for i in range(len(self._covers))]
        best = max(fit.log_evidence for fit in fits)
        weights = [math.exp(fit.log_evidence - best) for fit in fits]
        probabilities = [weight / sum(weights) for weight in weights]
        doubt = self._doubt(q, fits) if max(probabilities) < self._parameters.sure else ""
        found = [
            self._hypothesis(q, cover, fit, probability, doubt)
            for cover, fit, probability in zip(self._covers, fits, probabilities, strict=True)
        ]
        return tuple(sorted(found, key=lambda hypothesis: -hypothesis.probability))

    def _levers(self, q: Sequence[float], cover: _Cover) -> Array:
        """A_1, A_2, B_1, (zero), B_2, t as rows, (6, n): tau = (A + x B) f + twist t, f across the link."""
        jacobian, name = self._body.point_jacobian, cover.name
        across = self._body.cover_pose(q, name).rotation @ cover.across
        at = np.concatenate([jacobian(q, name, point) for point in cover.points], axis=1)
        levers = (across.T @ at).reshape(2, 3, -1)
        differences = (levers[:, 1:] - levers[:, :1]).reshape(4, -1)
        return np.concatenate((levers[:, 0], differences))

    def _fit(self, gram: list[list[float]], i: int) -> Fit:
        cover, parameters = self._covers[i], self._parameters
        first = 1 + 6 * i
        rows = (0, first, first + 1, first + 2, first + 4, first + 5)
        return fit_contact(
            [[gram[j][k] for k in rows] for j in rows],
            cover.start[0],
            cover.end[0],
            force_scale=parameters.force_scale,
            twist_arm=parameters.miss * cover.radius,
            places=parameters.places,
        )

    def _hypothesis(self, q: Sequence[float], cover: _Cover, fit: Fit, probability: float, doubt: str) -> Hypothesis:
        start, end = cover.start, cover.end
        length = end[0] - start[0]
        # a spread as wide as that of a place anywhere on the link says nothing of the place
        is_unknown = not fit.place_sd < length / math.sqrt(12.0)
        reasons = [self._why_unknown(q, cover, fit)] if is_unknown else []
        if doubt:
            reasons.append(doubt)
        if fit.residual > self._parameters.largest_residual:
            reasons.append(MORE)
        place = end[0] if is_unknown else fit.place
        f1, f2 = fit.force_at_end if is_unknown else fit.force
        force = _triple([f1 * e1 + f2 * e2 for e1, e2 in cover.directions])
        share = (place - start[0]) / length
        point = _triple([first + share * (last - first) for first, last in zip(start, end, strict=True)])
        return Hypothesis(
            cover=cover.name,
            probability=probability,
            place=math.nan if is_unknown else place,
            place_sd=math.nan if is_unknown else fit.place_sd,
            force=force,
            is_lower_bound=is_unknown,
            direction=math.atan2(f2, f1),
            moment=_cross(point, force),
            residual=fit.residual,
            reason="; ".join(reasons),
        )

    def _why_unknown(self, q: Sequence[float], cover: _Cover, fit: Fit) -> str:
        if cover.sees_moment_only:
            seer = "the shoulder" if self._is_wam else "the only joint" if cover.joints == 1 else "the pivot"
            return f"{seer} {MOMENT_ONLY}"
        if not self._is_wam:
            return WEAK
        in_plane, straight, bent = self._elbow(q, cover, fit)
        if in_plane > NEAR and bent > NEAR:
            return BENT
        if in_plane < math.sqrt(1.0 - NEAR**2) and straight > NEAR:
            return STRAIGHT
        if abs(math.cos(q[1])) > NEAR:
            return SHOULDER
        return WEAK

    def _doubt(self, q: Sequence[float], fits: list[Fit]) -> str:
        """Why no link stands out."""
        if not self._is_wam:
            return LINKS
        outer, fit = self._covers[1], fits[1]
        in_plane, straight, _ = self._elbow(q, outer, fit)
        if straight > NEAR and in_plane < math.sqrt(1.0 - NEAR**2):
            return STRAIGHT_LINK
        if fit.place - outer.start[0] < 2.0 * fit.place_sd:
            return ELBOW
        return LINKS

    def _elbow(self, q: Sequence[float], cover: _Cover, fit: Fit) -> tuple[float, float, float]:
        """How far, 0..1, the force lies in the plane of the links, the elbow is straight, is at 90 deg."""
        inner = self._body.cover_pose(q, self._covers[0].name).rotation[:, 0]
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
        radius=covers.radius[i],
        points=(origin, origin + slope, origin + first),
        across=across,
        directions=across.tolist(),
        hinge=_hinge(body, name, joints),
        joints=joints,
        sees_moment_only=_sees_moment_only(arm, body, name, origin),
    )


def _hinge(body: RigidBody, name: str, joints: int) -> Array:
    """Axis of the cover's own joint in the cover's frame, z = 1/2 sum e x (z x e)."""
    q = [0.0] * len(body.arm.joints.names)
    rotation = body.cover_pose(q, name).rotation
    origin = body.point_jacobian(q, name, np.zeros(3))
    turned = [rotation.T @ (body.point_jacobian(q, name, e) - origin)[:, joints - 1] for e in np.eye(3)]
    return 0.5 * np.sum(np.cross(np.eye(3), turned), axis=0)


def _sees_moment_only(arm: Arm, body: RigidBody, name: str, origin: Array) -> bool:
    """Whether all joint axes meet the tube's axis at x = 0, so that x and force come as a product."""
    poses = ([0.3 * (i + 1) * sign for i in range(len(arm.joints.names))] for sign in (1.0, -1.0))
    return all(float(np.abs(body.point_jacobian(q, name, origin)).max()) < SMALL for q in poses)

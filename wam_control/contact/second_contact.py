"""A second contact, by the change of the external torques against a steady first one.

One contact has three unknowns, two have six, and an arm of four joints gives four equations: the torques of one moment
do not separate two contacts from one.  Their change does: errors of the model that are the same in both moments drop
out.  What the first contact itself may change is no second one: it grows along its own torques, its friction follows
its force, it slides a little, and its torques turn with the arm, those of its friction, too.
"""

import math
from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_control.contact.contact_inference import ContactInference, Hypothesis
from wam_control.contact.model_errors import Observation
from wam_control.contact.momentum_observer import MomentumObserver
from wam_control.contact.thresholds import CONTACT
from wam_description.small_matrices import solution, solutions

Array = NDArray[np.float64]

RELEASED = 1.0 / 3.0  # of the threshold, below which the second contact has gone
UNMEASURED = 2e-5 * np.eye(3)  # m^2: a force of 30 N in a direction without a lever is as likely as errors of 0.14 N m


class _Moment(NamedTuple):
    """The first contact at one moment, `time` in s: its explanations, the best first, and the covers' Jacobians."""

    time: float
    seen: Observation
    hypotheses: tuple[Hypothesis, ...]
    jacobians: Array


class _Change(NamedTuple):
    """A change of the torques, (n,), N m, and its covariance without friction; of the first contact now.

    `force` : size, N; `own` : its torques, (n,), N m; `sides` : torques of a force there, (3, n), m.
    """

    torques: Array
    covariance: Array
    force: float
    own: Array
    sides: Array


class SecondContact:
    """Watches one contact while it lasts.

    Parameters
    ----------
    threshold : chi^2 of a change that the first contact does not explain, above which a second one is suspected;
        0 for never.

    Attributes
    ----------
    is_suspected : whether there seems to be a second contact.
    is_certain : whether the change was so large and so sudden that force control should not go on.
    """

    def __init__(self, threshold: float) -> None:
        self._threshold = threshold
        self.reset()

    def reset(self) -> None:
        """The contact has ended."""
        self.is_suspected = self.is_certain = False
        self._since = math.nan  # s, of the suspicion
        self._begin = self._last = math.nan
        self._recent: deque[_Moment] = deque()
        self._steady: deque[_Moment] = deque()
        self._sums: list[Array] = []  # of the steady moments
        self._found = 0

    def step(
        self, time: float, hypotheses: tuple[Hypothesis, ...], observer: MomentumObserver, inference: ContactInference
    ) -> None:
        """Take the explanation of one moment, `time` in s, by the observer's torques and pose."""
        if not self._threshold or time - self._last < CONTACT.change_interval:
            return
        self._last = time
        if math.isnan(self._begin):
            self._begin = time
        seen = observer.seen
        if seen is None or time - self._begin < CONTACT.settling:
            return
        if not self._sums:
            self._sums = [np.zeros_like(part) for part in seen]
        if not self.is_suspected:
            self._remember(_Moment(time, seen, hypotheses, inference.jacobians))
        if len(self._steady) < CONTACT.least_moments:
            return
        change = self._change(observer, inference)
        statistic = self._statistic(change, 0.0) if change else 0.0
        if self.is_suspected:
            if not change or statistic < RELEASED * self._threshold:
                self.reset()
                self._begin = time - CONTACT.settling
            elif time - self._since < CONTACT.oldest and not self.is_certain:
                self.is_certain = self._exceeds(
                    self._statistic(change, CONTACT.friction_turn / math.sqrt(self._threshold))
                )
            return
        if self._exceeds(statistic):
            self.is_suspected, self._since, self._found = True, time, 0

    def _exceeds(self, statistic: float) -> bool:
        """Whether so many changes in succession have exceeded the threshold."""
        self._found = self._found + 1 if statistic > self._threshold else 0
        return self._found >= CONTACT.changes

    def _remember(self, moment: _Moment) -> None:
        recent, steady = self._recent, self._steady
        recent.append(moment)
        while moment.time - recent[0].time > CONTACT.youngest:
            entering = recent.popleft()
            steady.append(entering)
            self._sums = [total + part for total, part in zip(self._sums, entering.seen, strict=True)]
        while steady and moment.time - steady[0].time > CONTACT.oldest:
            self._sums = [total - part for total, part in zip(self._sums, steady.popleft().seen, strict=True)]

    def _change(self, observer: MomentumObserver, inference: ContactInference) -> _Change | None:
        """The change of the torques since the steady moments, without the friction of the first contact.

        None for one that errors explain.  Friction may give the first contact a force along the link, which its
        explanations do not have: its force is that of all three components, at the place of each, that fits the
        steady torques.
        """
        count = len(self._steady)
        then = Observation(*(total / count for total in self._sums))
        change, covariance = observer.change(then)
        if change.dot(solution(covariance, change)) < RELEASED * self._threshold:
            return None
        first = self._steady[count // 2]
        best = first.hypotheses[0]
        then_sides, sides = inference.sides(first.hypotheses, (first.jacobians, inference.jacobians))
        levers = then_sides @ then_sides.transpose(0, 2, 1) + UNMEASURED
        forces = solutions(levers, then_sides @ observer.corrected(then))[:, None]
        turned, force = sides - then_sides, forces[0, 0]
        turns = (forces @ turned)[:, 0]
        weight = np.array([max(h.probability, CONTACT.least_probability) for h in first.hypotheses])
        weight /= weight.sum()
        turn = weight.dot(turns)
        change -= turn
        others, own = len(turns), force.dot(sides[0])
        changes = np.empty((others + 4, len(change)))  # of one sd each
        changes[:others] = (turns - turn) * np.sqrt(weight)[:, None]
        changes[others] = turns[0] - np.array(best.force).dot(turned[0])
        changes[others + 1] = CONTACT.torque_turn * turn
        changes[others + 2] = CONTACT.slide * inference.slide(best, force)
        changes[others + 3] = CONTACT.growth * own
        covariance += changes.T.dot(changes)
        return _Change(change, covariance, math.sqrt(force.dot(force)), own, sides[0])

    def _statistic(self, change: _Change, turned: float) -> float:
        """chi^2 of a change that the first contact does not explain; `turned` of its force may change across it."""
        torques, covariance = change.torques, change.covariance
        explained = solution(covariance, torques)
        statistic = float(torques.dot(explained))
        if statistic < RELEASED * self._threshold:
            return statistic
        grown = CONTACT.growth * CONTACT.growth * abs(float(change.own.dot(explained)))
        across = (CONTACT.friction * grown + turned) * change.force * change.sides
        return float(torques.dot(solution(covariance + across.T.dot(across), torques)))

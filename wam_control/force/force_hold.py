"""When the force loop holds its position instead of controlling the commanded force, and why."""

import math
from collections.abc import Callable, Iterable

import numpy as np
from numpy.typing import NDArray

from wam_control.force.contact_position import ForceCase, ForcePoint
from wam_control.force.force_axis import ForceAxis
from wam_control.force.force_loop_parameters import ForceLoopParameters
from wam_control.force.force_measurement import LowPass
from wam_control.force.force_swing import Reversals, Shake
from wam_control.force.sensing_advice import Advice, OtherForces
from wam_control.force.thresholds import FORCE
from wam_description.event import Code, Event, Value, warning

Array = NDArray[np.float64]
STILL = [0.0]  # m/s


SERIOUS = (Code.CONTACT_FORCE, Code.NOT_REACHED)  # of those that do not hold


def by_seriousness(found: Iterable[Event]) -> dict[Code, Event]:
    """The first event of each code, the most serious one first; one that holds is alone."""
    there: dict[Code, Event] = {}
    for event in found:
        if event.code.holds:
            return {event.code: event}
        if event.code is not Code.NONE:
            there.setdefault(event.code, event)
    return {one: there[one] for one in dict.fromkeys((*SERIOUS, *there)) if one in there}


class ForceHold:
    """Watches one commanded force.

    Attributes
    ----------
    is_touching : whether the measured force shows that something is touched.
    has_touched : whether it was, since the force is commanded.
    goes_back : whether the arm goes back against the force in this period, as what it presses pushes on.
    share : of the speed along the force: less where the late force of the motors was seen to swing.
    fed : fraction of the torque of the commanded force that is fed forward.
    """

    def __init__(self) -> None:
        self._turns, self._shake, self._pattern = Reversals(), Shake(FORCE.shake_samples), LowPass()
        self._pace = LowPass()
        self._advice = Advice()
        self.reset()

    @property
    def is_advised(self) -> bool:
        """Whether what would help a refused force is known."""
        return self._advice.is_complete

    def reset(self) -> None:
        """Another force is commanded."""
        self._shake.reset()
        self.share, self.fed = 1.0, 0.0
        self._bouncing = 0.0  # s, for which the force may still turn by an impact
        self._frequency = self._watched = self._shaking = self._blocked = 0.0
        self._is_watching = False
        self._is_sensed = self._is_detectable = self._is_kept = self.is_touching = self.has_touched = (
            self._has_settled
        ) = self._has_begun = False
        self.goes_back = self._is_led = False
        self._wanted = self._unloading = 0.0  # N, commanded before; s, for which the arm may still unload itself
        self._least = math.inf  # N, that has been measured meanwhile
        self._most = 0.0  # N, that has been measured
        self._is_slow = False
        self._over: Event | None = None  # why the arm holds until the command ends
        self._pace.reset()
        self._advice.reset()
        self._travel = self._conflict = self._double = self._assumed = self._strange = 0.0
        self._uncertain = self._missed = self._reached = self._identified = self._desired = self._turned = 0.0
        self._settled: Array | None = None  # torques per force, 1/m, once it has settled
        self._pattern.reset()
        self._forget_swings()

    def _forget_swings(self) -> None:
        """What the force was before something was touched shows nothing of how it is held."""
        self._strayed = self._within = 0.0
        self._report: Event | None = None
        self._returns = FORCE.left_after
        self._turns.reset()

    def approach_speed(
        self, axis: ForceAxis, point: ForcePoint, desired: float, parameters: ForceLoopParameters
    ) -> float:
        """Largest speed along the force, m/s: until something is touched, v = F_max/sqrt(m k_c) after (3.1).

        Then the force rises to the commanded one in no less than `known_rise` on the stiffest surface, `motors_rise`
        from these, unless friction would move the arm in jerks.  At a position that is not known, slower: what is
        touched has to be identified before the force is too large.
        """
        if not parameters.limits.impact:
            return math.inf
        stiffness = parameters.guard.contact_stiffness
        yielding = 1.0 / stiffness + axis.compliance
        is_known = point.is_pinned or point.is_certain
        slowest = FORCE.creep / parameters.limits.settling_time
        if self.is_touching:
            is_stiff = desired * yielding < FORCE.coarse_way
            is_slow = not is_known and not (is_stiff and self._identified >= FORCE.uncertain_time)
            rise = (
                FORCE.identified_rise if is_slow else FORCE.motors_rise if parameters.is_estimated else FORCE.known_rise
            )
            return max(desired * yielding / axis.speed_fraction / rise, slowest)
        fastest = parameters.limits.impact * desired / math.sqrt(axis.impact_mass * stiffness)
        if not is_known:  # no slower: the estimator would take a force that grows for seconds for an error of its model
            detected = FORCE.motors_rise if parameters.is_estimated else FORCE.detection_time
            fastest = min(fastest, max(desired * yielding / detected, slowest))
        return fastest / axis.speed_fraction

    def feed(self, point: ForcePoint, parameters: ForceLoopParameters, dt: float) -> float:
        """Fraction of the torque of the force that is fed forward in this period: `force_feedforward` at least.

        From the motors it rises after the touch: the velocity loop would take seconds to wind up to it on a stiff
        surface.  Without dither it would only wind up the friction of the arm.
        """
        is_fed = parameters.is_estimated and point.is_pinned and self.is_touching
        self.fed = min(self.fed + dt / FORCE.fed_time, 1.0) if is_fed else 0.0
        return max(parameters.force_feedforward, self.fed)

    def keeps(self, axis: ForceAxis, measured: float, desired: float, parameters: ForceLoopParameters) -> bool:
        """Whether the arm is to keep a force, N, that is nearly the commanded one.

        On a stiff surface a small error would wind up the velocity loop until friction lets go, with a jerk that
        changes the force by more than that error.
        """
        whole = desired * (1.0 / parameters.guard.contact_stiffness + axis.compliance)
        band = (FORCE.leave if self._is_kept else FORCE.settle) * desired * min(FORCE.fine_way / whole, 1.0)
        self._is_kept = self.is_touching and whole < FORCE.coarse_way and abs(desired - measured) < band
        return self._is_kept

    def travel(self, distance: float, dt: float, is_led: bool) -> None:
        """Count a way along the force, m, that the arm has moved in a period of dt, s.

        `is_led`: another motion is commanded besides, which may lead the arm along a slope of what it presses.
        """
        self._travel += distance
        self._pace.step([distance / dt], FORCE.steady_time, dt)
        self._is_led = is_led

    def excess(self, axis: ForceAxis, measured: float, desired: float, torque_error: float = 0.0) -> float:
        """Force above the commanded one, N, beyond the uncertainty of the measured one; 0 where it is not.

        An arm that holds its position goes back by it: it must not press harder than commanded either.
        """
        return max(measured - desired - math.hypot(axis.force_sd, torque_error), 0.0)

    def watch_shaking(self, axis: ForceAxis, moved: Array, frequency: float, dt: float) -> bool:
        """Watch the motion of the joints in a period (n,), rad, under a dither, rad/s; False where it is known.

        It is watched before the arm moves: what is touched would add its own motion.
        """
        samples = max(FORCE.shake_samples, round(2.0 * math.pi / (frequency * dt)))
        if samples != self._shake.samples:
            self._shake = Shake(samples)
        self._is_watching = self._watched < max(FORCE.watched_time, (samples + 1) * dt)
        if not self._is_watching:
            return False
        self._shake.step(moved)
        self._watched += dt
        self._frequency = frequency
        self._shaking, self._blocked = self._shaking_along(axis)
        return True

    def _shaking_along(self, axis: ForceAxis) -> tuple[float, float]:
        """How far the arm shakes along a force, m, and the force, N, that a hard surface takes from it."""
        shaking = self._shake.along(axis.lever)
        return shaking, axis.impact_mass * self._frequency * self._frequency * shaking

    def _shaken(self, axis: ForceAxis, desired: float, parameters: ForceLoopParameters) -> Event | None:
        """Why the arm shakes too much for the surface, None where it does not.

        A soft surface, in series with the cables, follows the swing of the position, and the force swings by k times
        its size; a hard one stops the swing with the force that moved the mass of the arm.  Where the two are alike,
        the arm swings on the surface in resonance, 1/F = |1/F_stopped - 1/F_followed|, and friction limits it.  Above
        twice the commanded force the contact is lost and hit again in every cycle of the dither.
        """
        yielding = 1.0 / parameters.guard.contact_stiffness + axis.compliance
        least = min(self._shaking / yielding, self._blocked)
        if self.is_touching or least <= 0.0:
            return None
        apart = 1.0 / self._blocked - yielding / self._shaking
        force = 1.0 / math.hypot(apart, 1.0 / (FORCE.resonance * least))
        if force <= parameters.limits.shake_force * desired:
            return None
        return warning(
            Code.SHAKEN,
            "shaken",
            shaking=self._shaking,
            stiffness=parameters.guard.contact_stiffness,
            force=force,
            allowed=parameters.limits.shake_force,
            desired=desired,
        )

    def step(
        self,
        case: ForceCase,
        external: Array,
        measured: float,
        parameters: ForceLoopParameters,
        dt: float,
        pushed: float | None = None,
        others: Callable[[], OtherForces] | None = None,
        given_way: float = 0.0,
    ) -> list[Event]:
        """What to do instead of what is commanded; nothing where it is obeyed.

        Parameters
        ----------
        case : the commanded force.
        external : torques of the world on the joints (n,), N m.
        measured : force along it, N.
        parameters : of the force loop.
        dt : outer period, s.
        pushed : force, N, without the inertia of the arm, by which something is touched; None: the measured one.
        others : the same force in other poses and of other sizes, for the advice where it is refused.
        given_way : how far the arm has given way to what pushes it, m, where it does not hold.
        """
        axis, point, desired = case.axis, case.point, case.desired
        self._identified = self._identified + dt if self.is_touching and point.is_identified else 0.0
        blind = self._not_sensed(case, parameters)
        is_loaded = not self._has_begun and abs(case.unknown) > FORCE.tolerance * desired
        pushed = measured if pushed is None else pushed
        self.is_touching = pushed >= FORCE.touch * desired and not is_loaded
        self._has_begun = self._has_begun or self.is_touching
        if self.is_touching and not self.has_touched:
            self.has_touched, self._bouncing = True, FORCE.bouncing_time
            self._forget_swings()
        self._count(measured, desired, given_way, parameters, dt)
        # tangential forces grow with the force
        unexplained = axis.unexplained(external) / max(1.0, measured / desired) ** 2
        is_strange = self._is_sensed and unexplained > FORCE.unexplained
        self._conflict = max(self._conflict + dt * self._against(point, is_strange), 0.0)
        if self._conflict > FORCE.conflict_time and (self._over is None or self._over.code is not Code.OTHER_LINK):
            self._over = (
                warning(Code.OTHER_LINK, "other_link", touched=point.conflict, cover=point.cover)
                if point.conflict
                else warning(Code.OTHER_LINK, "link_in_doubt", cover=point.cover)
            )
        weak = self._too_weak(case, parameters)
        if is_loaded:
            force, payload = case.unknown, case.payload
            return [
                warning(
                    Code.NOT_SENSED, "loaded", force=force, desired=desired, payload=payload, allowed=FORCE.tolerance
                )
            ]
        if ended := self._ended(parameters, is_blind=bool(blind or weak)):
            return [ended]
        if refusal := blind or weak or self._shaken(axis, desired, parameters) or self._too_slow(case, parameters):
            return [refusal.with_values(**self._advised(case, refusal, parameters, others))]
        self._advice.reset()
        is_double = not point.is_single and (is_strange or not point.is_pinned)
        self._double = self._double + dt if is_double else 0.0
        if self._double > FORCE.conflict_time:  # an impact looks like one for a moment, and a sudden hold is a jerk
            return [warning(Code.SECOND_CONTACT, "second_contact", cover=point.cover)]
        # what is off already leaves less of the tolerance to what is not known
        left = max(1.0 - abs(desired - measured) / (FORCE.tolerance * desired), 0.0)
        is_touching, known = self.is_touching, parameters.sensing.reported_fraction * desired * left
        self._strange = self._strange + dt if is_touching and is_strange else 0.0
        is_vague = not point.is_pinned and (axis.free_sd > known or not point.is_identified)
        self._assumed = self._assumed + dt if is_touching and is_vague else 0.0
        force_sd = math.hypot(_likely_sd(axis, case.torque_error, parameters), case.unknown)
        is_uncertain = force_sd > known
        self._uncertain = self._uncertain + dt if is_touching and is_uncertain else 0.0
        is_late, limits = parameters.is_estimated and self.share > FORCE.slowed, parameters.limits
        is_faint = is_late and not (limits.surface_speed or limits.slide_speed)  # such a surface swings the force, too
        swing = limits.cycle_force * desired * (FORCE.faint_swing if is_faint else 1.0)
        is_cycling = self._turns_again(measured, swing, limits.settling_time, dt) and is_touching
        missed = self._lasting(self._not_reached(axis, measured, desired, parameters, dt), parameters)
        turned = self._has_turned(axis, external, measured, desired, parameters, dt)
        if is_late and is_touching and self._turns.count > FORCE.few_turns:
            self.share = FORCE.slowed  # less would let the force creep away: motors at rest do not show it
            self._turns.reset()
            is_cycling = False
        found = [self._cycle(desired, parameters)] if is_cycling else []
        found += [one for one in (missed, turned) if one]
        return found or self._doubted(case, force_sd, unexplained, parameters)

    def _turns_again(self, measured: float, least: float, window: float, dt: float) -> bool:
        """Whether the measured force turns back again and again, as `Reversals.step`, and not by an impact."""
        if self._bouncing > 0.0:
            self._turns.reset()
        self._bouncing -= dt
        return self._turns.step(measured, least, window, dt)

    def _not_sensed(self, case: ForceCase, parameters: ForceLoopParameters) -> Event | None:
        """Why the force is not measured well enough, None where it is.

        What the estimator states of its torques counts until the force is controlled: it states more while the arm
        moves and presses, which is reported.
        """
        axis, point, desired, sensing = case.axis, case.point, case.desired, parameters.sensing
        limit, stated = sensing.sd_limit(desired, point.is_pinned), math.hypot(axis.force_sd, case.torque_error)
        is_known = self._is_sensed or not case.torque_error or stated <= sensing.stated_fraction * desired
        self._is_sensed = is_known and axis.force_sd <= (limit if self._is_sensed else FORCE.resume * limit)
        if self._is_sensed:
            return None
        if not is_known:
            return warning(
                Code.NOT_SENSED,
                "stated_sd",
                sd=stated,
                position=point.position,
                cover=point.cover,
                allowed=sensing.stated_fraction * desired,
                fraction=sensing.stated_fraction,
            )
        return warning(
            Code.NOT_SENSED,
            "sd",
            sd=axis.force_sd,
            position=point.position,
            cover=point.cover,
            allowed=FORCE.resume * limit,
            fraction=FORCE.resume,
        )

    def _advised(
        self,
        case: ForceCase,
        refusal: Event,
        parameters: ForceLoopParameters,
        others: Callable[[], OtherForces] | None,
    ) -> dict[str, Value]:
        """What to do in place of a refused command; nothing while that is looked for."""
        if others is None:
            return {"searched": "nothing"}
        if self._is_watching:
            return {}  # how the dither shakes the arm counts, too
        self._advice.step(case.desired, (refusal.code, parameters), others, lambda one: self._admits(one, parameters))
        if not self._advice.is_complete:
            return {}
        if self._advice.ways:
            return {"ways": ", or ".join(self._advice.ways)}
        return {"searched": "pinned" if case.point.is_pinned else "both", "turned": FORCE.turns[-1]}

    def _admits(self, case: ForceCase, parameters: ForceLoopParameters) -> bool:
        """Whether another force would be accepted in place of the commanded one, with a reserve."""
        hold, still = ForceHold(), np.zeros(len(case.axis.lever))
        hold._shaking, hold._blocked = self._shaking_along(case.axis)  # as if the joints shook there as they do here
        largest = min(parameters.force_limit, parameters.limits.contact_force)
        found = hold.step(case.worse(FORCE.reserve), still, 0.0, parameters, 0.0)
        return case.desired <= largest and not any(event.code.holds for event in found)

    def _too_weak(self, case: ForceCase, parameters: ForceLoopParameters) -> Event | None:
        """Why the contact estimator would not detect the force, None where it would or something is touched."""
        point, desired, sensing = case.point, case.desired, parameters.sensing
        name, least = ("least_signal", sensing.least_signal)
        if not point.is_pinned:
            name, least = "least_signal_unpinned", max(least, sensing.least_signal_unpinned)
        begins = FORCE.resume if self._is_detectable else 1.0
        is_weak, is_unseen = case.signal < begins * least, case.elsewhere < begins * sensing.least_signal
        self._is_detectable = self.has_touched or not (is_weak or is_unseen)
        if self._is_detectable:
            return None
        if is_weak:
            return warning(
                Code.NOT_SENSED,
                "weak",
                desired=desired,
                position=point.position,
                cover=point.cover,
                signal=case.signal,
                limit=name,
                allowed=least,
            )
        signal, allowed = case.elsewhere, sensing.least_signal
        return warning(
            Code.NOT_SENSED, "weak_elsewhere", desired=desired, cover=point.cover, signal=signal, allowed=allowed
        )

    def _against(self, point: ForcePoint, is_strange: bool) -> float:
        """How fast it counts that another link is touched: `conflict_time` is full after so many s at 1."""
        # at a pinned position the estimated link counts only where the torques are not those of the force
        if point.conflict and (is_strange or not point.is_pinned):
            return 1.0
        return FORCE.conflict_time / FORCE.uncertain_time if point.is_doubtful else -FORCE.free_rate

    def _ended(self, parameters: ForceLoopParameters, is_blind: bool) -> Event | None:
        """Why the arm holds until the command ends, None where it does not; `is_blind`: the force is not sensed."""
        if self._over or is_blind:
            return self._over
        way, free_travel = self._travel, parameters.limits.free_travel
        if way > free_travel:
            touched = float(self.has_touched)
            return warning(Code.NOTHING_TOUCHED, "free_travel", way=way, has_touched=touched, allowed=free_travel)
        if (
            not self.has_touched
            and self._missed > FORCE.crept * parameters.limits.settling_time
            and way < FORCE.little_way
        ):
            return warning(Code.NOTHING_TOUCHED, "creeping", time=self._missed, way_mm=1e3 * way)
        return None

    def _count(
        self, measured: float, desired: float, given_way: float, parameters: ForceLoopParameters, dt: float
    ) -> None:
        """End the way along the force where that is right or rises, and find the one back against it.

        What presses moves the arm back if it is too large, or the arm goes back all the same, and not because less is
        commanded than before.
        """
        limits, tolerated = parameters.limits, tolerance(desired, parameters)
        is_unloading = self._unloads(measured, desired, limits.settling_time, dt)
        # where it neither has the force nor takes more of it, it may be gone, or go away
        if self.is_touching and (
            self._is_led or measured >= min(desired - tolerated, self._most + FORCE.settle * desired)
        ):
            self._most = max(self._most, measured)
            if self._travel <= limits.free_travel:
                self._travel = 0.0
        slowest = limits.surface_speed + FORCE.creep / limits.settling_time
        is_pushed = measured > desired + tolerated or (self._pace.value or STILL)[0] < -slowest
        self.goes_back = self.is_touching and is_pushed and not (self._is_led or is_unloading)
        if self.goes_back and given_way > limits.free_travel and not self._over:
            self._over = warning(
                Code.NOTHING_TOUCHED,
                "gave_way",
                way=given_way,
                desired=desired,
                measured=measured,
                allowed=limits.free_travel,
            )

    def _unloads(self, measured: float, desired: float, lasting: float, dt: float) -> bool:
        """Whether less is commanded than before, N, and the force still falls, or did until `lasting`, s, ago."""
        self._unloading = max(self._unloading - dt, 0.0)
        if desired < self._wanted:
            self._unloading, self._least = lasting, math.inf
        if self._unloading and measured < self._least - FORCE.settle * desired:
            self._unloading, self._least = lasting, measured
        self._wanted = desired
        if self._unloading:
            self._most = min(self._most, measured)
        return self._unloading > 0.0

    def _too_slow(self, case: ForceCase, parameters: ForceLoopParameters) -> Event | None:
        """Why the arm would be too slow on its way or on the surface, None where it is not or something is touched."""
        axis, point, desired = case.axis, case.point, case.desired
        if self.is_touching:
            return None
        surface = parameters.guard.contact_stiffness
        stiffness = 1.0 / (1.0 / surface + axis.compliance)
        pace = max(parameters.force_gain) * axis.speed_fraction * stiffness
        self._is_slow = pace * parameters.limits.settling_time < FORCE.settled / (
            FORCE.resume if self._is_slow else 1.0
        )
        if self._is_slow:
            return warning(
                Code.TOO_SLOW, "settles_slowly", time_constant=1.0 / pace, allowed=FORCE.settled, **_slowness(axis)
            )
        way = desired / surface
        if parameters.is_estimated and not point.is_pinned and way < FORCE.coarse_way:
            return warning(
                Code.TOO_SLOW, "stiff", way_mm=1e3 * way, stiffness=surface, allowed_mm=1e3 * FORCE.coarse_way
            )
        if moves := _left_behind(axis, desired, parameters):
            return moves
        speed = self.approach_speed(axis, point, desired, parameters)
        if speed * parameters.limits.settling_time < FORCE.creep:
            slow, least = 1e3 * speed, 1e3 * FORCE.creep
            return warning(Code.TOO_SLOW, "creeps", stiffness=surface, speed_mm=slow, desired=desired, allowed_mm=least)
        return None

    def _doubted(
        self, case: ForceCase, force_sd: float, unexplained: float, parameters: ForceLoopParameters
    ) -> list[Event]:
        """Why the measured force may not be the true one, where that lasts."""
        point, desired, lasting = case.point, case.desired, parameters.limits.settling_time
        where: dict[str, Value] = {"position": point.position, "cover": point.cover}
        if self._strange > lasting:
            return [
                warning(Code.NOT_EXPLAINED, "torques_differ", **where, **_deviation(unexplained, FORCE.unexplained))
            ]
        if self._assumed > lasting:
            if not point.is_identified:
                return [warning(Code.POSITION_ASSUMED, "position_unknown", **where)]
            sd = math.hypot(case.axis.free_sd, case.torque_error)
            return [warning(Code.POSITION_ASSUMED, "position_from_torques", **where, sd=sd)]
        if self._uncertain > lasting:
            part, allowed = force_sd / desired, parameters.sensing.reported_fraction
            return [
                warning(Code.UNCERTAIN, "force_uncertain", sd=force_sd, fraction=part, desired=desired, allowed=allowed)
            ]
        return []

    def _cycle(self, desired: float, parameters: ForceLoopParameters) -> Event:
        swing, period = self._turns.cycle
        allowed = parameters.limits.cycle_force
        return warning(Code.CYCLE, "cycle", swing=swing, period=period, desired=desired, allowed=allowed)

    def _has_turned(
        self,
        axis: ForceAxis,
        external: Array,
        measured: float,
        desired: float,
        parameters: ForceLoopParameters,
        dt: float,
    ) -> Event | None:
        """Why something else seems to act since the force has settled, None where nothing does.

        The torques of one contact keep their proportions while the arm rests, unless its friction turns.
        """
        if not self.is_touching or (desired != self._desired and self._turned <= FORCE.conflict_time):
            self._settled, self._turned = None, 0.0
            self._pattern.reset()
        self._desired = desired
        if not self.is_touching:
            return None
        if self._settled is None:
            pattern, _ = self._pattern.step((external / measured).tolist(), FORCE.steady_time, dt)
            self._settled = (
                np.array(pattern) if self._within >= FORCE.left_after * parameters.limits.settling_time else None
            )
            return None
        change = axis.turned(external - measured * self._settled)
        lasts = change > (FORCE.turned_back if self._turned > FORCE.conflict_time else FORCE.turned)
        self._turned = self._turned + dt if lasts else 0.0
        if self._turned <= FORCE.conflict_time:
            return None
        return warning(Code.NOT_EXPLAINED, "torques_changed", desired=desired, **_deviation(change, FORCE.turned))

    def _lasting(self, missed: Event | None, parameters: ForceLoopParameters) -> Event | None:
        """A reason, or the last one until the force has been within the tolerance for as long as it may be off.

        A force that had been right before has to be right for the whole settling time: what takes it away comes again.
        """
        if missed:
            self._returns = 1.0 if self._has_settled else FORCE.left_after
        if missed or self._within >= self._returns * parameters.limits.settling_time:
            self._report = missed
        return self._report

    def _not_reached(
        self, axis: ForceAxis, measured: float, desired: float, parameters: ForceLoopParameters, dt: float
    ) -> Event | None:
        """Why the force counts as not reached, None where it does not: it is off on one side, or swings."""
        error, lasting = desired - measured, parameters.limits.settling_time
        is_off = abs(error) > tolerance(desired, parameters)
        self._within = 0.0 if is_off else self._within + dt
        if self._has_settled and desired - self._reached > tolerance(desired, parameters):
            self._has_settled, self._missed = False, 0.0  # more is commanded: that takes its time again
        if self.has_touched and not is_off:
            self._has_settled, self._reached = True, desired
        if not is_off or error * self._missed < 0.0:
            self._missed = 0.0
        self._missed += math.copysign(dt, error)
        has_rested = not self._has_settled or self._within >= FORCE.left_after * lasting
        self._strayed = 0.0 if has_rested else self._strayed + dt * is_off
        if not self.has_touched and abs(self._missed) > lasting:
            time, way = abs(self._missed), 1e3 * self._travel
            return warning(Code.NOT_REACHED, "nothing_touched_yet", time=time, way_mm=way)
        is_late = self._missed > 0.0 and not self._has_settled
        if abs(self._missed) > (lasting if is_late else FORCE.left_after * lasting):
            return warning(
                Code.NOT_REACHED,
                "force_off",
                measured=measured,
                desired=desired,
                error=error,
                time=abs(self._missed),
                **_slowness(axis),
            )
        if self._strayed > FORCE.left_after * lasting:
            return warning(Code.NOT_REACHED, "force_strays", desired=desired, allowed=tolerance(desired, parameters))
        return None


def tolerance(desired: float, parameters: ForceLoopParameters) -> float:
    """Error, N, up to which a force counts as reached."""
    return max(FORCE.tolerance * desired, parameters.limits.least_tolerance)


def _deviation(unexplained: float, most: float) -> dict[str, Value]:
    """A chi^2 and the largest one, in the standard deviations that they are."""
    return {"off_sd": math.sqrt(unexplained), "allowed_sd": math.sqrt(most)}


def _slowness(axis: ForceAxis) -> dict[str, Value]:
    """How slow the arm is along the force, nothing where it is not."""
    return {} if axis.speed_fraction > FORCE.not_slowed else {"speed_fraction": axis.speed_fraction}


def _likely_sd(axis: ForceAxis, torque_error: float, parameters: ForceLoopParameters) -> float:
    """Standard deviation of the measured force, N, with `likely` of what is stated of the torques themselves."""
    sensing = parameters.sensing
    each = sensing.estimated_torque_sd if parameters.is_estimated else sensing.torque_sd
    stated = math.hypot(each * float(np.linalg.norm(axis.sense)), torque_error)
    whole = math.hypot(axis.force_sd, torque_error)
    return math.sqrt(max(whole * whole - (1.0 - FORCE.likely * FORCE.likely) * stated * stated, 0.0))


def _left_behind(axis: ForceAxis, desired: float, parameters: ForceLoopParameters) -> Event | None:
    """Why a surface that moves would keep the force off, None where it would not.

    Along the force the integral law is v/G_I behind, and the force rises in no less than `known_rise`.
    A surface that moves across it comes nearer by a slope that nobody knows, if it is stiff by more than the force
    allows before the friction of the arm has turned round.
    """
    limits, stiffness = parameters.limits, parameters.guard.contact_stiffness
    yielding, speed = 1.0 / stiffness + axis.compliance, limits.surface_speed
    lag = speed / (max(parameters.force_gain) * axis.speed_fraction)
    most = parameters.sensing.reported_fraction * desired
    if lag > most:
        return warning(Code.TOO_SLOW, "surface_lag", speed=speed, off=lag, allowed=most)
    fastest = desired * yielding / (FORCE.motors_rise if parameters.is_estimated else FORCE.known_rise)
    if limits.impact and speed > fastest:
        return warning(
            Code.TOO_SLOW, "surface_fast", speed=speed, desired=desired, stiffness=stiffness, allowed=fastest
        )
    nearer = FORCE.friction_turn * FORCE.surface_slope * limits.slide_speed
    off = nearer / yielding
    if off > tolerance(desired, parameters):
        return warning(
            Code.TOO_SLOW,
            "surface_slope",
            speed=limits.slide_speed,
            nearer_um=1e6 * nearer,
            off=off,
            stiffness=stiffness,
            allowed=tolerance(desired, parameters),
        )
    return None

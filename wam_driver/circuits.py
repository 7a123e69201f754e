"""Cable circuits of the plant as MuJoCo simulates them: creep, slack, torque and tension."""

import math
from collections.abc import Callable, Sequence
from typing import Any

from wam_description.arm import Arm
from wam_description.cables import Circuit
from wam_description.effects import Effects
from wam_driver.thresholds import PLANT


class WoundCable:
    """Creep of a cable that ends on both pulleys (6.4.3).

    What is wound keeps the strain under which it was wound.  Whenever a part passes between the pulleys it takes
    that of the present load, on two strands instead of four, so that the creep is half of (6.19), and none once the
    part has the load.  The free strand is short against what is wound.

    Parameters
    ----------
    loss : of speed per torque, 1/(N m).
    """

    def __init__(self, loss: float) -> None:
        self._loss = 0.5 * loss * PLANT.wound_part
        self._torque: dict[float, float] = {}

    def creep(self, angle: float, travel: float, torque: float) -> float:
        """Creep, rad, at a rotor angle, rad, over a travel, rad, 0 or more, under a torque, N m."""
        part = angle / PLANT.wound_part // 1.0  # not a number where the simulation diverges
        before = self._torque.get(part, 0.0)
        change = (torque - before) * -math.expm1(-PLANT.passages * travel / PLANT.wound_part)
        self._torque[part] = before + change
        return self._loss * change


class CableCircuits:
    """The cable circuit of each motor; two tendons of the model, one per strand.

    MuJoCo computes the elastic torque.  Creep, which MuJoCo does not know, moves the stretch at which a strand goes
    slack: the plastic length of its tendon.

    Attributes
    ----------
    is_bounded : True if cables end on their pulleys or slip as a whole.
    is_slack : True if a strand is slack and friction depends on the tension.
    each : of each circuit the two slack ends between its strands, creep in a step per speed and torque, and the
        torque, N m, above which friction depends on the tension; it remains the same list, which the steps in C read,
        and is empty before `tighten`.
    """

    def __init__(self, data: Any, arm: Arm, effects: Effects, step: float) -> None:
        n = arm.n
        self._capstan = effects.capstan
        self.is_bounded = (effects.creep and effects.terminated) or effects.capstan > 0.0
        self.is_slack = False
        self._may_slacken = effects.slack
        self._friction_counts = effects.slack and any(effects.tension_friction)
        self._nominal = self._circuits = arm.circuits
        # views into MuJoCo's memory: to fetch them in each step costs more than the step's own work
        self._pulls: Callable[[], list[float]] = data.qfrc_spring[:n].tolist
        self._stretch_rate, self._theta, self._step = data.ten_velocity[: 2 * n : 2], data.qpos[:n], step
        # two of each strand: it is slack between them; the tight strand comes first and pulls beyond the second, the
        # loose one beyond the first
        self._slack_ends: Any = memoryview(data.plastic)
        # with backlash the ends are those of the play
        self._strands = [i for i in range(n) if effects.slack and not effects.play(i)]
        self._damping = arm.cables.damping
        creeps = effects.creep and not effects.terminated  # those of terminated cables are wound: `_creeps`
        self._losses = [step * circuit.loss_per_torque if creeps else 0.0 for circuit in arm.circuits]
        self.each: list[tuple[int, int, float, float]] = []

    def reset(self) -> None:
        """Return to power-up; the first step finds out whether a strand is slack."""
        self.is_slack = self._friction_counts

    def rest(self) -> None:
        """Give cables as they are configured the pretension that is set, all wound without a load."""
        self._wound = [WoundCable(circuit.loss_per_torque) for circuit in self._nominal]
        self._move_ends(self._nominal, self._circuits)

    def tighten(self, shares: Sequence[float]) -> tuple[Circuit, ...]:
        """Set the pretension of each circuit (6.5), parts of the configured one, (n,); the circuits with it.

        Raises
        ------
        ValueError
            for a part that is below 0, or for another number of them; nothing is changed then.
        """
        before = self._circuits
        if len(shares) != len(before) or not all(0.0 <= share < math.inf for share in shares):
            raise ValueError(
                f"effects.pretension_share is {shares}; give one for all or one for each of {len(before)} "
                "circuits, 0 or above"
            )
        self._circuits = tuple(
            circuit._replace(pretension=share * circuit.pretension)
            for circuit, share in zip(self._nominal, shares, strict=True)
        )
        self._move_ends(before, self._circuits)
        self.each[:] = [
            (
                4 * i + 1,
                4 * i + 2,
                loss,
                2.0 * circuit.pretension * circuit.radius if self._friction_counts else math.inf,
            )
            for i, (loss, circuit) in enumerate(zip(self._losses, self._circuits, strict=True))
        ]
        self.is_slack = self._friction_counts
        return self._circuits

    def _move_ends(self, before: Sequence[Circuit], now: Sequence[Circuit]) -> None:
        """Move the stretch at which either strand goes slack."""
        for i in self._strands:
            more = now[i].slack_stretch - before[i].slack_stretch
            if more:
                self._slack_ends[4 * i + 1] -= more
                self._slack_ends[4 * i + 2] += more

    @property
    def after_step(self) -> Callable[[Sequence[int], Sequence[float]], bool] | None:
        """What has to follow each step; None for nothing."""
        if self.is_bounded:
            return self._follow_bounded
        return self.follow if any(self._losses) or self._friction_counts else None

    def _follow_bounded(self, direction: Sequence[int], speeds: Sequence[float]) -> bool:
        """`follow` for cables that end on both pulleys, or slip as a whole at the capstan's limit (6.16)."""
        moved = self._slips() if self._capstan else self._creeps(speeds)
        for (first, second, _, _), more in zip(self.each, moved, strict=True):
            self._slack_ends[first] -= more
            self._slack_ends[second] -= more
        return self.follow(direction, speeds)

    def _creeps(self, speeds: Sequence[float]) -> list[float]:
        """Creep of each cable that ends on both pulleys, rad, in this step."""
        each = zip(self._wound, self._theta.tolist(), speeds, self._pulls(), strict=False)
        return [cable.creep(angle, abs(speed) * self._step, pull) for cable, angle, speed, pull in each]

    def _slips(self) -> list[float]:
        """Slip of each cable, rad, whose torque would be beyond its limit after this step."""
        found = []
        for circuit, rate, pull in zip(self._circuits, self._stretch_rate.tolist(), self._pulls(), strict=True):
            limit = 2.0 * circuit.pretension * circuit.radius * math.tanh(0.5 * self._capstan)
            after = pull - circuit.stiffness * rate * self._step
            found.append(math.copysign(max(abs(after) - limit, 0.0), after) / circuit.stiffness)
        return found

    def follow(self, direction: Sequence[int], speeds: Sequence[float]) -> bool:
        """Let the cables creep on their pulleys, dc = loss |d theta| tau, (6.19) corrected; look for slack strands.

        Parameters
        ----------
        direction : sign of the velocity of each rotor, 0 while it is stuck.
        speeds : of the rotors, rad/s; more may follow.

        Returns
        -------
        bool
            `is_slack`.
        """
        ends, is_slack = self._slack_ends, False
        for (first, second, rate, most), way, speed, pull in zip(  # noqa: B905 - costs 1 % of a step
            self.each, direction, speeds, self._pulls()
        ):
            if way:
                crept = rate * (speed if speed >= 0.0 else -speed) * pull  # half the time of abs()
                ends[first] -= crept
                ends[second] -= crept
            if not -most <= pull <= most:
                is_slack = True
        self.is_slack = is_slack
        return is_slack

    @property
    def elastic_torque(self) -> list[float]:
        """Elastic torque of each circuit on its rotor, N m, (n,), at the start of the last step."""
        return self._pulls()

    @property
    def torque(self) -> list[float]:
        """Torque of each circuit at its motor, elastic and damping, N m, (n,), at the start of the last step."""
        rates: list[float] = self._stretch_rate.tolist()
        each = zip(self._damping, rates, self._pulls())  # noqa: B905 - costs 1 % of a period
        return [damping * rate - pull for damping, rate, pull in each]

    def tensions(self, pulls: Sequence[float]) -> list[float]:
        """Tension of the tight strand of each first stage, N, (n,), at elastic torques of these sizes, N m, (n,)."""
        each = [(one.pretension, pull / one.radius) for one, pull in zip(self._circuits, pulls, strict=True)]
        # the whole difference of both tensions once the loose strand is slack
        return [max(half + other / 2.0, other if self._may_slacken else 0.0) for half, other in each]

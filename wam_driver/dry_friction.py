"""Dry friction of every rotor and joint: the torque up to which it resists, before each step of the plant."""

import math
from collections.abc import Sequence

from wam_description.arm import Arm
from wam_description.cables import Circuit
from wam_description.effects import Effects
from wam_description.parameters import require, require_fit
from wam_driver.friction import LAWS, FrictionParameters, Presliding, each_shaft
from wam_driver.thresholds import PLANT


class DryFriction:
    """Level of dry friction of every shaft, rotors first, then joints: its law, plus what `Effects` adds.

    A shaft is stuck from the moment its velocity changes its sign until it is faster than a threshold.

    Parameters
    ----------
    arm : F_s and F_d of motors and joints.
    effects : friction by the pretension of the cables, added Coulomb friction.
    parameters : the law.
    step : of the plant, s.
    compliance : inverse inertia of each shaft, 1/(kg m^2): it limits the presliding stiffness that a step can follow.

    Attributes
    ----------
    direction : sign of the velocity of each shaft, 0 while it is stuck.
    levels : torque up to which each shaft sticks rigidly, N m; 0 if it has elastic displacement.
    elastic : torque of friction on each shaft with elastic displacement, N m; empty if no shaft has any.
    bounds : velocities of each shaft, rad/s, above and below which `follow` has anything to do; they and `direction`
        remain the same lists, which the steps in C read.
    is_steady : True if `follow` looks neither at loads nor at held torques.

    Raises
    ------
    ParameterError
        if a list has neither one value nor one each, or a presliding stiffness is too large for the step.
    """

    def __init__(
        self, arm: Arm, effects: Effects, parameters: FrictionParameters, step: float, compliance: Sequence[float]
    ) -> None:
        motors, joints = effects.dry(arm), arm.joints
        size = 2 * arm.n
        require_fit(parameters, arm)
        static = [*motors.static_friction, *joints.static_friction]
        dynamic = [*motors.dynamic_friction, *joints.dynamic_friction]
        self._asymmetry = each_shaft(parameters.motor_asymmetry, parameters.joint_asymmetry, size)
        self._factors = each_shaft(parameters.motor_load_factor, parameters.joint_load_factor, size)
        stiffness = each_shaft(parameters.motor_presliding_stiffness, parameters.joint_presliding_stiffness, size)
        _refuse_too_stiff([*motors.names, *joints.names], stiffness, step, compliance)
        self._laws = list(LAWS[parameters.law](static, dynamic, parameters))
        self._presliding = {i: Presliding(sigma) for i, sigma in enumerate(stiffness) if sigma > 0.0}
        self._varying = [
            i
            for i, law in enumerate(self._laws)
            if not law.is_steady or stiffness[i] or self._factors[i] or self._asymmetry[i]
        ]
        self.is_steady = not self._varying
        self._tension_friction, self._circuits = effects.tension_friction, tuple(arm.circuits)
        self._added = tuple(effects.added_coulomb_friction)
        self._step = step
        self._shafts = range(size)
        self._warm_drop, self._warm = parameters.warm_drop, [1.0] * size
        # velocities between which a shaft remains as it is: stuck, in positive or in negative motion
        slowest = [
            math.nextafter(v, math.inf) for v in [PLANT.stuck_rotor] * (size // 2) + [PLANT.stuck_joint] * (size // 2)
        ]
        self._bounds = [((-v, v), (0.0, math.inf), (-math.inf, 0.0)) for v in slowest]
        self.direction = [0] * size
        self._low, self._high = self.bounds = [0.0] * size, [0.0] * size
        self._find_levels()
        self.reset()

    def reset(self) -> None:
        """Return to power-up: every shaft is stuck, none is displaced."""
        for i in self._shafts:
            self._set_direction(i, 0)
        for presliding in self._presliding.values():
            presliding.torque = 0.0
        self.elastic = [0.0] * len(self._shafts) if self._presliding else []

    def _set_direction(self, i: int, way: int) -> None:
        """Let a shaft be stuck, 0, or move in the direction of a sign."""
        self.direction[i] = way
        self._low[i], self._high[i] = self._bounds[i][way]
        self.levels[i] = self._dynamic[i] if way else self._static[i]

    def set_circuits(self, circuits: Sequence[Circuit]) -> None:
        """Take the pretension of each circuit, (n,), for the friction by tension (6.5)."""
        self._circuits = tuple(circuits)
        self._find_levels()

    def set_added(self, friction: Sequence[float]) -> None:
        """Set the added Coulomb friction of each joint, (n,), N m, static and dynamic alike."""
        self._added = tuple(friction)
        self._find_levels()

    def _find_levels(self) -> None:
        """Find the static and dynamic friction of each shaft, N m, from pretension, what is added, and heat.

        Those that vary in motion are computed in each step.
        """
        each_circuit = zip(self._tension_friction, self._circuits, strict=True)
        from_tension = [2.0 * circuit.pretension * per_tension for per_tension, circuit in each_circuit]
        self._extra = [*from_tension, *self._added]
        each = list(zip(self._laws, self._warm, self._extra, strict=True))
        self._static = [law.level(0.0) * warm + extra for law, warm, extra in each]
        self._dynamic = [law.level(1.0) * warm + extra for law, warm, extra in each]
        by_shaft = zip(self.direction, self._static, self._dynamic, strict=True)
        self.levels = [moving if way else stuck for way, stuck, moving in by_shaft]

    def heat(self, heat: Sequence[float]) -> None:
        """Take the heat of each motor, (n,), 1 at its thermal limit, for friction that falls with temperature."""
        left = [1.0 - self._warm_drop * min(w, 1.0) for w in heat]
        self._warm[: len(left)] = left
        self._find_levels()

    def follow(self, velocity: Sequence[float], load: Sequence[float], held: Sequence[float]) -> bool:
        """Bring `levels` and `elastic` up to date for the next step.

        Parameters
        ----------
        velocity : of each shaft, rad/s.
        load : torque that the cables transmit to each shaft, N m.
        held : torque of friction on each shaft in the last step, N m.

        Returns
        -------
        bool
            True if a level has changed.
        """
        changed = False
        for i, speed, low, high in zip(self._shafts, velocity, self._low, self._high):  # noqa: B905 - costs 1 % of a step
            if low < speed < high:
                continue
            # one that moved is stuck before it turns
            self._set_direction(i, 0 if self.direction[i] else 1 if speed > 0.0 else -1)
            changed = True
        self._evaluate(velocity, load, held)
        return changed or not self.is_steady

    def levels_with_slack(self, transmitted: Sequence[float]) -> list[float]:
        """Levels while a strand is slack, when the sum of both tensions is more than 2 T_0.

        Parameters
        ----------
        transmitted : torque that the cables transmit to each rotor, N m.
        """
        levels = self.levels.copy()
        each_circuit = zip(self._tension_friction, self._circuits, transmitted, strict=False)
        for i, (per_tension, circuit, torque) in enumerate(each_circuit):
            excess = abs(torque) / circuit.radius - 2.0 * circuit.pretension
            levels[i] += per_tension * max(excess, 0.0)
        return levels

    def _evaluate(self, velocity: Sequence[float], load: Sequence[float], held: Sequence[float]) -> None:
        """Levels of the shafts whose law depends on more than whether they move; elastic torques."""
        for i in self._varying:
            way, speed = self.direction[i], velocity[i]
            if not way:  # friction holds the torque that is opposite to its own
                way, speed = (held[i] < 0.0) - (held[i] > 0.0), 0.0
            level = self._laws[i].level(speed) + self._factors[i] * abs(load[i])
            level = level * (1.0 + self._asymmetry[i] * way) * self._warm[i] + self._extra[i]
            if i in self._presliding:
                # the plant's integrator moves a shaft by step times its new velocity
                self.elastic[i] = -self._presliding[i].advance(velocity[i] * self._step, level)
                level = 0.0
            self.levels[i] = level


def _refuse_too_stiff(
    names: Sequence[str], stiffness: Sequence[float], step: float, compliance: Sequence[float]
) -> None:
    for name, sigma, inverse_inertia in zip(names, stiffness, compliance, strict=True):
        largest = (PLANT.largest_phase / step) ** 2 / inverse_inertia
        require(
            sigma <= largest,
            f"{name}: its presliding stiffness in 'friction' is {sigma:g} N m/rad; a step of {step:g} s allows up to "
            f"{largest:.3g}, raise timing.substeps for more",
        )

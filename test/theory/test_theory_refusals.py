"""Values out of range are refused with their name, the value and what is allowed."""

import math
from collections.abc import Callable

import pytest

from wam_theory import cable, linear_loop, requisites, stiction
from wam_theory import tension_element as element
from wam_theory.arguments import above_zero, finite, zero_or_more
from wam_theory.backlash_cycle import GearedTorqueLoop, exact_cycle
from wam_theory.friction_model import IntegralLoop


@pytest.mark.parametrize(("check", "refused", "allowed", "what"), [
    (above_zero, (0.0, -1.0, math.nan, math.inf, [1.0, -2.0]), [1.0, 2.0], "above zero"),
    (zero_or_more, (-1e-9, math.nan, [0.0, -2.0]), [0.0, 2.0], "zero or more"),
    (finite, (math.nan, -math.inf), [-1.0, 0.0], "a number"),
])  # fmt: skip
def test_an_argument_out_of_range_is_refused_by_its_name(
    check: Callable[..., list[object]], refused: tuple[object, ...], allowed: object, what: str
) -> None:
    for value in refused:
        with pytest.raises(ValueError, match=rf"^inertia is .*; it must be finite and {what}"):
            check(damping=1.0, inertia=value)
    assert len(check(damping=1.0, inertia=allowed)) == 2


@pytest.mark.parametrize(("call", "names"), [
    (lambda: cable.creep(-1.0, 1.0, 1.0, 1.0), "travel is -1"),
    (lambda: cable.tensions([1.0, math.nan], 1.0, 1.0), "torque is .*nan"),
    (lambda: exact_cycle(GearedTorqueLoop(1.0, -0.1, 1.0, 0.0, 1.0, 1.0, 1.0)), "play is -0.1"),
    (lambda: exact_cycle(GearedTorqueLoop(1.0, 0.1, 1.0, -0.1, 1.0, 1.0, 1.0)), "damping is -0.1"),
    (lambda: element.speed_ratio(2.0, 1.0, 9.0), "tight is 1.0 N; it must be at least loose"),
    (lambda: element.output_power(1.0, 9.0, 9.0), "difference is 9.0 N; it must be below ea"),
    (lambda: linear_loop.sampled_margin(1.0, 1.0, 1.0, 1.0, 0.1, -1), "delay_samples is -1"),
    (lambda: linear_loop.sampled_margin(1.0, 1.0, 1.0, 1.0, 0.1, math.inf), "delay_samples is inf"),  # type: ignore[arg-type]
    (lambda: IntegralLoop(1.0, sample_period=0.1, delay_samples=math.nan), "delay_samples is nan"),  # type: ignore[arg-type]
    (lambda: requisites.useful_length(5.0, 3.2), "angle is 3.2 rad"),
    (lambda: stiction.breakaway_delay(1.0, 1.0, 1.0, 1.0, 1.5), "spring_force is 1.5"),
    (lambda: stiction.breakaway_delay(1.0, 1.0, 1.0, math.nan), "error is nan"),
    (lambda: stiction.slip_force(1.0, 1.0, 9.0, 1.0, 1.0, 1.0), "damping is 9.0; zeta is .*; it must be below 1"),
    (lambda: stiction.stiction_cycle_force(1.0, 1.0, 0.9, 1.0, 0.1), "static_friction is 0.9"),
])  # fmt: skip
def test_what_contradicts_another_argument_is_refused(call: Callable[[], object], names: str) -> None:
    with pytest.raises(ValueError, match=names):
        call()

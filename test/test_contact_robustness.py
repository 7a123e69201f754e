"""The benchmark of contact estimation on arms that differ from what the estimator states."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from arms import CONFIGURATION, WAM

from wam_experiments.contact_robustness.degradations import NAMES, drawn
from wam_experiments.contact_robustness.evaluation import drives, evaluate, page, report_text

STATED, COARSE, LOADED = "as stated", "encoder 4096", "payload 0.3 kg"
EXACT = ("moving", "asymmetry", "load", "shape", "payload", "mass")
BELIEVING = {f"contact_estimator:observer.{name}_uncertainty": 0.0 for name in EXACT} | {
    "contact_estimator:observer.motor_noise": 0.0
}


@pytest.mark.parametrize("name", NAMES)
def test_a_degradation_is_drawn_from_its_seed_and_changes_the_arm_or_its_signals(name: str) -> None:
    first, again = (drawn(name, WAM, np.random.default_rng(5)) for _ in range(2))
    assert first == again
    assert (drawn(STATED, WAM, np.random.default_rng(5)) == first) is (name == STATED)


def test_a_degradation_that_does_not_exist_is_refused_with_those_that_do() -> None:
    with pytest.raises(ValueError, match=r"no degradation is named 'wind'; degradations: as stated, friction 0\.8"):
        drives(CONFIGURATION, [1], ["wind"], 10.0)


@pytest.mark.slow
def test_a_coarse_encoder_and_an_unknown_payload_make_no_false_alarms_and_the_payload_is_named() -> None:
    with ThreadPoolExecutor(1) as executor:
        groups = evaluate(drives(CONFIGURATION, [901], [COARSE, LOADED], 10.0)[0], executor)
        believing = evaluate(drives(CONFIGURATION.with_values(BELIEVING), [901], [LOADED], 10.0)[0], executor)
    for name in (COARSE, LOADED):
        (score,) = groups[name]
        assert not score.failure
        assert score.free_seconds > 3.0
        assert score.alarms == 0
        assert len(score.outcomes) >= 1
    assert believing[LOADED][0].alarms > 0
    assert groups[LOADED][0].warnings > 0.5
    assert groups[COARSE][0].warnings == 0.0
    text = page(report_text(groups, groups, {}), "wam evaluate robustness")
    assert all(f"| {name} | " in text for name in (COARSE, LOADED))

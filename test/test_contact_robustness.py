"""The benchmark of contact estimation on arms that differ from what the estimator states."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from arms import CONFIGURATION, WAM

from wam_experiments.contact_robustness.degradations import NAMES, drawn
from wam_experiments.contact_robustness.evaluation import drives, evaluate, page, report_text

STATED, COARSE = "as stated", "encoder 4096"


@pytest.mark.parametrize("name", NAMES)
def test_a_degradation_is_drawn_from_its_seed_and_changes_the_arm_or_its_signals(name: str) -> None:
    first, again = (drawn(name, WAM, np.random.default_rng(5)) for _ in range(2))
    assert first == again
    assert (drawn(STATED, WAM, np.random.default_rng(5)) == first) is (name == STATED)


def test_a_degradation_that_does_not_exist_is_refused_with_those_that_do() -> None:
    with pytest.raises(ValueError, match=r"no degradation is named 'wind'; degradations: as stated, friction 0\.8"):
        drives(CONFIGURATION, [1], ["wind"], 10.0)


@pytest.mark.slow
def test_a_coarse_encoder_makes_false_alarms_that_the_table_shows() -> None:
    with ThreadPoolExecutor(1) as executor:
        groups = evaluate(drives(CONFIGURATION, [901], [STATED, COARSE], 10.0), executor)
    (stated,), (coarse,) = groups[STATED], groups[COARSE]
    assert not stated.failure
    assert stated.free_seconds > 3.0
    assert coarse.alarms > 10 * max(stated.alarms, 1)
    assert len(stated.outcomes) >= 1
    text = page(report_text(groups), "wam evaluate robustness")
    assert all(f"| {name} | " in text for name in (STATED, COARSE))

"""The velocity of a shaft from counts, against the motion that made them."""

import numpy as np

from wam_control.contact.thresholds import CONTACT
from wam_control.contact.velocity_fit import VelocityFit
from wam_description.signals import State

DT = 1e-3


def fitted(counts: int, seconds: float = 1.5, kept: float = 1.0) -> tuple[VelocityFit, np.ndarray]:
    """Error of the velocity after half a second, a row per sample, of a swing that an encoder reads."""
    fit, errors, random = VelocityFit(2, 0.05), [], np.random.default_rng(4)
    step, before, since = 2.0 * np.pi / counts if counts else 0.0, None, 0.0
    for k in range(round(seconds / DT)):
        time, since = k * DT, since + DT
        swing = np.array([4.0, 9.0])
        true = 3.0 * np.sin(swing * time)
        angle = np.round(true / step) * step if step else true
        velocity = 3.0 * swing * np.cos(swing * time) if not step or before is None else (angle - before) / DT
        before = angle
        if random.random() > kept:
            continue
        found = fit.take(State(angle.tolist(), velocity.tolist(), [time, 0.0]), since)
        since = 0.0
        if found is not None and time > 0.5:
            at = time - fit.delay
            errors.append(np.array(found[0].velocity) - 3.0 * swing * np.cos(swing * at))
            np.testing.assert_allclose(found[0].position, 3.0 * np.sin(swing * at), atol=max(2.0 * step, 1e-3))
    return fit, np.array(errors)


def test_a_perfect_velocity_is_passed_on_without_delay() -> None:
    fit, errors = fitted(0)
    assert fit.delay == 0.0
    assert np.abs(errors).max() == 0.0
    assert max(fit.sd) < 0.01


def test_a_coarse_encoder_takes_a_longer_window_and_the_stated_error_is_that_of_the_fit() -> None:
    delays = []
    for counts in (65536, 16384, 4096):
        fit, errors = fitted(counts)
        differences = 2.0 * np.pi / counts / np.sqrt(6.0) / DT
        assert errors.std(axis=0).max() < differences
        assert np.all(errors.std(axis=0) < 1.5 * np.array(fit.sd))
        assert np.all(errors.std(axis=0) > 0.3 * np.array(fit.sd))
        delays.append(round(fit.delay / DT))
    assert delays == sorted(delays)
    assert delays[-1] == CONTACT.half_windows[-1]


def test_lost_samples_are_bridged_and_time_is_kept() -> None:
    _, errors = fitted(4096, kept=0.9)
    assert errors.std(axis=0).max() < 0.3
    assert len(errors) > 800


def test_a_reset_forgets_samples_and_keeps_the_error_of_the_encoder() -> None:
    fit, _ = fitted(4096)
    before = fit.sd
    fit.reset()
    assert fit.take(State([0.0, 0.0], [0.0, 0.0], [0.0, 0.0]), DT) is None
    assert fit.sd == before

"""Every transition of the driver's safety."""

import pytest

from wam_description.event import fault
from wam_driver.safety import Mode, Safety


def in_mode(mode: Mode) -> Safety:
    safety = Safety(list, list)
    if mode is Mode.ENABLED:
        assert safety.enable("").success
    elif mode is Mode.FAULT:
        safety.trip(fault("test", reason="first"))
    assert safety.mode is mode
    return safety


@pytest.mark.parametrize(("mode", "request_name", "after", "success"), [
    (Mode.BRAKED, "enable", Mode.ENABLED, True),
    (Mode.ENABLED, "enable", Mode.ENABLED, True),
    (Mode.FAULT, "enable", Mode.FAULT, False),
    (Mode.BRAKED, "disable", Mode.BRAKED, True),
    (Mode.ENABLED, "disable", Mode.BRAKED, True),
    (Mode.FAULT, "disable", Mode.FAULT, True),
    (Mode.BRAKED, "reset_fault", Mode.BRAKED, True),
    (Mode.ENABLED, "reset_fault", Mode.ENABLED, True),
    (Mode.FAULT, "reset_fault", Mode.BRAKED, True),
])  # fmt: skip
def test_request_leads_where_it_should(mode: Mode, request_name: str, after: Mode, success: bool) -> None:
    safety = in_mode(mode)
    answer = getattr(safety, request_name)(*([""] if request_name == "enable" else []))
    assert safety.mode is after
    assert answer.success is success
    assert answer.message.startswith("refused" if not success else after.value)


def test_first_fault_is_kept_until_reset_and_restated_as_more_is_known() -> None:
    safety, named = in_mode(Mode.FAULT), fault("test", reason="first", nodes="both")
    safety.trip(fault("test", reason="second"))
    safety.disable()
    for one in (fault("test", reason="second"), named):
        safety.restate(one)
    assert safety.events == (named,)
    safety.reset_fault()
    assert not safety.fault
    safety.trip(fault("test", reason="third"))
    assert safety.fault == "third"

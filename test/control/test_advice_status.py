"""What would help a refused force is in the status of the force loop, which looks for it in several periods."""

import pytest

from wam_control.task.scenario import ScenarioStep
from wam_description.configuration import Configuration, packaged
from wam_description.event import Code, Event
from wam_description.event_text import sentence
from wam_description.signals import BASE, ForceCommand
from wam_sim.simulation import Simulation


@pytest.mark.slow
def test_the_status_of_a_refused_force_states_what_would_help() -> None:
    steps = [
        ScenarioStep("release", 0.05, request="enable"),
        ScenarioStep("press", 1.0, force=ForceCommand(BASE, (0.6, 0.0, 0.0))),
    ]
    run = Simulation(Configuration.load(packaged("wam")), steps)
    seen: list[Event] = []
    run.listen("status", lambda _, status: seen.extend(status.events), "force_loop")
    assert run.play() == ""
    refused = [event for event in seen if event.code is Code.REFUSED]
    assert "searched" not in refused[0].values, "at once"
    assert {"pin", "no_pin"} & set(refused[0].values), "a pinned position is not advised untried"
    assert refused[-1].values["searched"]
    assert {"turn", "more_force", "pin"} & set(refused[-1].values)


def test_a_refusal_is_reported_for_each_command_with_its_own_number() -> None:
    def pressing(newtons: float) -> ScenarioStep:
        return ScenarioStep("press", 0.1, force=ForceCommand("outer_link", (0.0, -newtons, 0.0)))

    steps = [ScenarioStep("release", 0.05, request="enable"), pressing(70.0), pressing(90.0)]
    run = Simulation(Configuration.load(packaged("wam")), steps)
    seen: list[Event] = []
    run.listen("status", lambda _, status: seen.extend(status.events), "force_loop")
    assert run.play() == ""
    refusals = [sentence(event).partition(";")[0] for event in seen if event.code is Code.REFUSED]
    assert refusals == [f"{newtons} N is commanded" for newtons in (70, 90)]


@pytest.mark.slow
def test_a_force_that_began_while_the_arm_moved_has_the_reason_of_the_arm_at_rest() -> None:
    heavy = Configuration.load(packaged("wam")).with_values({"driver:mismatch.payload": 0.3})
    steps = [
        ScenarioStep("release", 0.1, request="enable"),
        ScenarioStep("move", 0.8, posture=(0.0, -1.2, 0.0, 1.6)),
        ScenarioStep("press", 1.5, force=ForceCommand("outer_link", (0.0, -8.0, 0.0))),
    ]
    run = Simulation(heavy.with_values({"force_loop:joint_speed_limit": 2.0}), steps)
    seen: list[Event] = []
    run.listen("status", lambda _, status: seen.extend(status.events), "force_loop")
    assert run.play() == ""
    reasons = [(event.cause, event.values.get("part")) for event in seen]
    assert reasons.index(("moved_fast", None)) < reasons.index(("error", "resting"))
    assert run.unmet.startswith("press refused: ")

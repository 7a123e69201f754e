"""The stack over the simulated bus, in bus time: its demonstration against the plain driver, and an identification."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import wam_sim.simulation
from wam_analysis.identification.contradictions import contradictions
from wam_analysis.identification.fit import identify
from wam_analysis.identification.motion import recorded_motion
from wam_analysis.recording import AnalysedRecording
from wam_bag.bag import read
from wam_control.task.scenario import load_for
from wam_description.arm import Shared
from wam_description.configuration import SHARED, Configuration, packaged
from wam_driver.bus.arm_bus import ArmBus
from wam_driver.bus.simulator import SimulatedBus
from wam_driver.bus.start_up import Wait
from wam_driver.driver import Driver, DriverParameters
from wam_driver.plant import Plant
from wam_sim.recorded_run import recorded_run
from wam_sim.simulated_bag import record
from wam_studies.identification.excitation import scenario

MORE = 0.03  # of the commanded force, by which the true force may be further off over the bus
WRIST = 0.08  # the same, by which that of the wrist may be off; a refused one is off by a quarter and more
FRICTION = 0.1  # of the configured friction, which is the true one, by which that of a recording may differ


class PlantOnBus:
    """A plant whose motors are reached over the bus only; a person holds it until it is enabled."""

    def __init__(self, plant: Plant, shared: Shared, own: DriverParameters) -> None:
        self._plant, self._constant, self._is_braked = plant, shared.arm.motors.torque_constant, True
        line, arm = SimulatedBus(shared, own, plant=plant), shared.arm
        self._arm = ArmBus(line, arm, shared.timing.period, arm.joints.start)
        plant.brake(True)
        while self._arm.wait is not Wait.NOTHING:
            self._exchange()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._plant, name)

    @property
    def theta(self) -> list[float]:
        return self._arm.state.position

    @property
    def thetad(self) -> list[float]:
        return self._arm.state.velocity

    def brake(self, on: bool) -> None:
        if on != self._is_braked:
            self._is_braked = on
            self._plant.brake(on)
            self._arm.brake(on)

    def step(self, torque: Sequence[float], substeps: int) -> None:
        self._arm.command([each / k for each, k in zip(torque, self._constant, strict=True)])
        self._exchange()

    def _exchange(self) -> None:
        self._arm.exchange()
        assert self._arm.trouble is None, self._arm.trouble


class DriverOnBus(Driver):
    def __init__(self, shared: Shared, parameters: DriverParameters) -> None:
        super().__init__(shared, parameters)
        self.plant = PlantOnBus(self.plant, shared, parameters)  # type: ignore[assignment]
        self._measure()


def at_rates_of_the_bus(name: str) -> Configuration:
    """The configuration of the plain arm with rates and gains of that on its bus."""
    plain, on_bus = Configuration.load(packaged(name)), Configuration.load(packaged(f"{name}-bus"))
    own = ("interface", "channel", "home", "nodes", "timing.mode")
    changed = {
        (key if node == SHARED else f"{node}:{key}"): value
        for node, flat in on_bus.sections.items()
        for key, value in flat.items()
        if key not in own and plain.sections[node].get(key) != value
    }
    return plain.with_values(changed)


def played(configuration: Configuration, bag: Path, without: str = "none") -> AnalysedRecording:
    """The scenario of a configuration, but for steps with a word in their names."""
    steps = load_for(configuration, str(configuration.sections["scenario"]["script"]))
    assert record(configuration, [step for step in steps if not re.search(without, step.name)], bag) == ""
    return AnalysedRecording(read(bag))


def force_errors(recording: AnalysedRecording) -> list[float]:
    """Of the true force in the last second of each hold, as a part of what is commanded."""
    traces, found = recording.traces, []
    for hold in recording.holds:
        at = (traces.stamp > hold.end - 10**9) & (traces.stamp <= hold.end)
        found.append(abs(float(np.linalg.norm(traces.true.force[at].mean(axis=0))) / hold.commanded - 1.0))
    return found


@pytest.mark.slow
def test_forces_over_the_bus_are_those_of_the_plain_driver(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    configuration = at_rates_of_the_bus("barrett-wam4")
    plain = force_errors(played(configuration, tmp_path / "plain", without="push|again|lift"))
    monkeypatch.setattr(wam_sim.simulation, "Driver", DriverOnBus)
    over_bus = force_errors(played(configuration, tmp_path / "bus", without="push|again|lift"))
    assert len(plain) == len(over_bus) == 2
    assert max(over_bus) < max(plain) + MORE, (plain, over_bus)


@pytest.mark.slow
def test_the_arm_with_the_wrist_presses_over_the_bus_where_its_contact_is_pinned(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    configuration = at_rates_of_the_bus("barrett-wam7")
    monkeypatch.setattr(wam_sim.simulation, "Driver", DriverOnBus)
    over_bus = force_errors(played(configuration, tmp_path / "bus", without="push|5 N|lift"))
    assert len(over_bus) == 2
    assert max(over_bus) < WRIST, over_bus


@pytest.mark.slow
def test_exciting_moves_over_the_bus_identify_the_arm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    configuration = at_rates_of_the_bus("barrett-wam4").with_values({"timing.dither_cycle": 0})
    script = tmp_path / "moves.yaml"
    script.write_text(yaml.safe_dump(scenario(configuration, seed=1, seconds=12.0)))
    steps = load_for(configuration, str(script))
    monkeypatch.setattr(wam_sim.simulation, "Driver", DriverOnBus)
    assert record(configuration, steps, tmp_path / "bag") == ""
    bag = read(tmp_path / "bag")
    assert bag.losses.sentences(0) == []
    shared = configuration.shared
    motion = recorded_motion(recorded_run(bag), shared.arm)
    found = identify(shared, motion)
    assert contradictions(shared, motion, found) == []
    for direction in ("positive", "negative"):
        places = found.unknowns.places(f"motors.coulomb_{direction}")
        assert found.values[places] == pytest.approx(found.unknowns.present[places], rel=FRICTION)

"""Scenarios of the contact benchmark on the nodes in this process, in lockstep; their records come from the bag."""

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import yaml

from wam_description.configuration import Configuration
from wam_ros.bring_up import Composition
from wam_sim.batch import Report
from wam_studies.contact_benchmark.over_topics import recorded, script
from wam_studies.contact_benchmark.scenarios import BenchmarkScenario
from wam_studies.contact_benchmark.score import ScenarioScore, score
from wam_studies.contact_benchmark.simulation import Played


def scores(configuration: Configuration, chosen: Sequence[BenchmarkScenario], report: Report) -> list[ScenarioScore]:
    """Play scenarios one after the other and score the recordings."""
    found: list[ScenarioScore] = []
    for scenario in chosen:
        report(len(found), len(chosen))
        found.append(score(play(configuration, scenario), configuration.shared.arm))
    report(len(found), len(chosen))
    return found


def play(configuration: Configuration, scenario: BenchmarkScenario, domain_id: int | None = None) -> Played:
    """Play one scenario in a ROS domain, the one of the environment where None."""
    shared = configuration.shared
    with TemporaryDirectory(prefix="wam_benchmark_") as folder:
        steps = Path(folder) / "scenario.yaml"
        steps.write_text(yaml.safe_dump(script(scenario)), encoding="utf-8")
        own = {
            "nodes": [*shared.nodes, "scenario", "recorder"],
            "timing.mode": "lockstep",
            "timing.real_time_factor": 0.0,
            "timing.timeout": 60.0,
            "timing.display_divisor": 1,
            "scenario:script": str(steps),
            "recorder:directory": folder,
            "recorder:name": "scenario",
        }
        with Composition(configuration.with_values({**scenario.values, **own}), domain_id=domain_id) as composition:
            failure = composition.play().failure
        return recorded(scenario, Path(folder) / "scenario", shared.arm, failure)

"""`wam evaluate`: judge a part of the stack by a battery of its own."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import yaml

from wam_analysis.contact_battery.compute import section, times
from wam_analysis.contact_battery.figure import figure
from wam_analysis.contact_battery.judgement import Extent, Judgement, judge, scenes
from wam_analysis.contact_battery.over_topics import recorded, script
from wam_analysis.contact_battery.page import missed, page, report
from wam_analysis.contact_battery.run import Played
from wam_analysis.contact_battery.scenes import Scene, dither_values
from wam_analysis.contact_battery.score import SceneScore, score
from wam_analysis.progress import Progress
from wam_description.configuration import Configuration
from wam_ros.bring_up import Composition
from wam_ros.commands import batch_of, configuration_of, take_batch, take_configuration

SEEDS = (1, 2, 3)
PARTS = ("contact",)


def over_topics(configuration: Configuration, drawn: Sequence[Scene], report: Progress) -> list[SceneScore]:
    """Play scenes with the nodes, in lockstep, and score what was recorded."""
    found: list[SceneScore] = []
    for scene in drawn:
        report(len(found), len(drawn))
        found.append(score(play_over_topics(configuration, scene), configuration.shared.arm))
    report(len(found), len(drawn))
    return found


def play_over_topics(configuration: Configuration, scene: Scene, domain_id: int | None = None) -> Played:
    """Play a scene with the nodes in this process, in lockstep; what was recorded is what counts."""
    shared = configuration.shared
    with TemporaryDirectory(prefix="wam_battery_") as folder:
        steps = Path(folder) / "scene.yaml"
        steps.write_text(yaml.safe_dump(script(scene)), encoding="utf-8")
        own = {
            "nodes": [*shared.nodes, "scenario", "recorder"],
            "timing.mode": "lockstep",
            "timing.timeout": 60.0,
            "timing.display_divisor": 1,
            "scenario:script": str(steps),
            "recorder:directory": folder,
            "recorder:name": "scene",
        }
        with Composition(configuration.with_values({**scene.values, **own}), domain_id=domain_id) as composition:
            scenario: Any = composition.nodes["scenario"]
            composition.spin(lambda: scenario.done)
            failure = str(scenario.failure)
        return recorded(scene, Path(folder) / "scene", shared.arm, failure)


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument("part", choices=PARTS, help="contact: the estimation of contacts on the whole arm")
    parser.add_argument("--seed", type=int, nargs="+", default=list(SEEDS), help="seeds of the battery, default 1 2 3")
    parser.add_argument("--contacts", type=int, default=200, help="contacts in motion for each seed, default 200")
    parser.add_argument("--resting", type=int, default=30, help="contacts at rest for each seed, default 30")
    parser.add_argument("--free", type=float, default=200.0, help="seconds of motion without contact for each seed")
    parser.add_argument("--joint-sensors", action="store_true", help="feel with the joint sensors")
    parser.add_argument(
        "--mode",
        choices=("direct", "lockstep"),
        default="direct",
        help="direct: without ROS; lockstep: over topics, one scene at a time",
    )
    parser.add_argument("--write", type=Path, help="page to write, for example docs/contact.md")
    take_configuration(parser)
    take_batch(parser)


def _write(given: argparse.Namespace, configuration: Configuration, judgement: Judgement, scene: Scene) -> None:
    """The page, and its picture in a folder of the page's name."""
    arm, file = configuration.shared.arm, Path(given.write)
    picture = file.with_suffix("") / "battery.png"
    figure(judgement.total, arm, picture)
    defaults = f"--contacts {given.contacts} --resting {given.resting} --free {given.free:g}"
    seeds = " ".join(map(str, given.seed))
    sensors = " --joint-sensors" * given.joint_sensors
    command = f"wam evaluate contact --seed {seeds} {defaults}{sensors} --mode {given.mode} --write {file}"
    compute = section(times(configuration, scene))
    text = page(judgement, arm, command, compute, f"{picture.parent.name}/{picture.name}")
    file.write_text(text, encoding="utf-8")


def run(given: argparse.Namespace) -> int:
    """Judge; 1 where a must is missed."""
    configuration = configuration_of(given)
    arm = configuration.shared.arm
    extent = Extent(given.contacts, given.resting, given.free)
    dither = dither_values(configuration)
    drawn = {seed: scenes(configuration, seed, extent, given.joint_sensors, dither) for seed in given.seed}
    order = [(seed, scene) for seed, own in drawn.items() for scene in own]
    scenes_of_all = [scene for _, scene in order]
    if given.mode == "direct":
        with batch_of(given) as batch:
            scored = judge(configuration, scenes_of_all, *batch)
    else:
        scored = over_topics(configuration, scenes_of_all, Progress("scenes", sys.stderr))
    judgement = Judgement(tuple(given.seed), {seed: [] for seed in given.seed})
    for (seed, _), scene in zip(order, scored, strict=True):
        judgement.scores[seed].append(scene)
    text = report(judgement, arm)
    print(text)
    if given.write:
        _write(given, configuration, judgement, drawn[given.seed[0]][0])
    short = missed(judgement, arm)
    if short:
        print(f"missed: {'; '.join(short)}", file=sys.stderr)
    return 1 if short else 0

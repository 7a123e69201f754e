"""`wam evaluate`: benchmark a part of the stack."""

import argparse
import sys
from pathlib import Path

from wam_cli.commands import (
    BASE_CONFIGURATION,
    at_least,
    batch_of,
    evaluation_of,
    refuse_overridden,
    take_evaluation,
)
from wam_cli.commands import evaluate_faults as faults
from wam_cli.commands import evaluate_force as force
from wam_cli.commands import evaluate_identify as identify
from wam_cli.commands import evaluate_robustness as robustness
from wam_cli.commands import evaluate_soak as soak
from wam_description.configuration import Configuration
from wam_sim.progress import Progress
from wam_studies.contact_benchmark.evaluation import BenchmarkExtent, BenchmarkResult, evaluate, scenarios
from wam_studies.contact_benchmark.figure import figure
from wam_studies.contact_benchmark.page import missed, page, report
from wam_studies.contact_benchmark.scenarios import BenchmarkScenario, dither_values
from wam_studies.contact_benchmark.timing import section, times
from wam_studies.contact_scenarios import scores

SEEDS = (1, 2, 3)


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parts = parser.add_subparsers(dest="part", required=True, metavar="PART")
    _contact_arguments(parts.add_parser("contact", help="contact estimation on the whole arm"))
    robustness.arguments(
        parts.add_parser("robustness", help="contact estimation on arms that differ from what the estimator states")
    )
    force.arguments(parts.add_parser("force", help="force control on random surfaces in random poses"))
    faults.arguments(parts.add_parser("faults", help="wrong messages, lost nodes, full disks, Ctrl-C"))
    identify.arguments(parts.add_parser("identify", help="identified against true friction of many plants"))
    soak.arguments(parts.add_parser("soak", help="a long run: memory and lost messages"))


def _contact_arguments(parser: argparse.ArgumentParser) -> None:
    take_evaluation(parser, SEEDS, "the scenarios", "docs/contact.md")
    parser.add_argument("--contacts", type=int, default=200, help="contacts in motion per seed, default 200")
    parser.add_argument("--resting", type=int, default=30, help="contacts at rest per seed, default 30")
    parser.add_argument("--free", type=float, default=200.0, help="seconds of motion without contact per seed")
    parser.add_argument("--joint-sensors", action="store_true", help="estimate from the joint sensors")
    parser.add_argument(
        "--mode",
        choices=("direct", "lockstep"),
        default="direct",
        help="direct: without ROS; lockstep: over topics, one scenario at a time",
    )


def _write(
    given: argparse.Namespace, configuration: Configuration, result: BenchmarkResult, scenario: BenchmarkScenario
) -> None:
    """Write the page, and its figure into a folder of the page's name."""
    arm, file = configuration.shared.arm, Path(given.write)
    picture = file.with_suffix("") / "benchmark.png"
    figure(result.total, arm, picture)
    defaults = f"--contacts {given.contacts} --resting {given.resting} --free {given.free:g}"
    seeds = " ".join(map(str, given.seed))
    sensors = " --joint-sensors" * given.joint_sensors
    of = "" if given.config == BASE_CONFIGURATION else f"--config {given.config} "
    command = f"wam evaluate contact {of}--seed {seeds} {defaults}{sensors} --mode {given.mode} --write {file}"
    compute = section(times(configuration, scenario))
    text = page(result, arm, command, compute, f"{picture.parent.name}/{picture.name}")
    file.write_text(text, encoding="utf-8")


def run(given: argparse.Namespace) -> int:
    """Evaluate; 1 if a required value is missed."""
    parts = {
        "contact": _run_contact,
        "force": force.run,
        "robustness": robustness.run,
        "faults": faults.run,
        "identify": identify.run,
        "soak": soak.run,
    }
    return parts[given.part](given)


def _run_contact(given: argparse.Namespace) -> int:
    at_least("--contacts", given.contacts, 1)
    at_least("--resting", given.resting, 0)
    at_least("--free", given.free, 0.0)
    configuration = evaluation_of(given)
    arm = configuration.shared.arm
    extent = BenchmarkExtent(given.contacts, given.resting, given.free)
    dither = dither_values(configuration)
    chosen = {seed: scenarios(configuration, seed, extent, given.joint_sensors, dither) for seed in given.seed}
    order = [(seed, scenario) for seed, own in chosen.items() for scenario in own]
    every_scenario = [scenario for _, scenario in order]
    refuse_overridden(given, {name for one in every_scenario for name in one.values}, "each scenario")
    if given.mode == "direct":
        with batch_of(given, len(every_scenario)) as batch:
            scored = evaluate(configuration, every_scenario, *batch)
    else:
        scored = scores(configuration, every_scenario, Progress("scenarios", sys.stderr))
    result = BenchmarkResult(tuple(given.seed), {seed: [] for seed in given.seed})
    for (seed, _), scenario in zip(order, scored, strict=True):
        result.scores[seed].append(scenario)
    text = report(result, arm)
    print(text)
    if given.write:
        _write(given, configuration, result, chosen[given.seed[0]][0])
    short = missed(result, arm)
    if short:
        print(f"missed: {'; '.join(short)}", file=sys.stderr)
    return 1 if short else 0

"""`wam evaluate`: benchmark a part of the stack."""

import argparse
import shlex
import sys
from collections.abc import Iterator
from dataclasses import Field, fields
from pathlib import Path
from typing import Any

from wam_cli.commands import (
    BASE_CONFIGURATION,
    PAGE,
    at_least,
    batch_of,
    configuration_of,
    evaluation_of,
    refuse_overridden,
    refuse_source,
    require_effect,
    take_batch,
    take_configuration,
    take_evaluation,
    writable_file,
)
from wam_cli.commands import evaluate_faults as faults
from wam_cli.commands import evaluate_figures as figures
from wam_cli.commands import evaluate_robustness as robustness
from wam_cli.commands import evaluate_soak as soak
from wam_description.configuration import Configuration, option_values
from wam_sim.progress import Progress
from wam_studies import contact_benchmark
from wam_studies.contact_benchmark.evaluation import BenchmarkExtent, BenchmarkResult, scenarios
from wam_studies.contact_benchmark.figure import figure
from wam_studies.contact_benchmark.page import missed, page
from wam_studies.contact_benchmark.page import report as contact_report
from wam_studies.contact_benchmark.scenarios import BenchmarkScenario, dither_values
from wam_studies.contact_benchmark.timing import section, times
from wam_studies.contact_scenarios import scores
from wam_studies.harness import STUDIES, Measurement, Study, chosen_cases, evaluate, load
from wam_studies.page import block, report, with_section

SEEDS = (1, 2, 3)


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parts = parser.add_subparsers(dest="part", required=True, metavar="PART")
    _contact_arguments(parts.add_parser("contact", help="contact estimation on the whole arm"))
    robustness.arguments(
        parts.add_parser("robustness", help="contact estimation on arms that differ from what the estimator states")
    )
    faults.arguments(parts.add_parser("faults", help="wrong messages, lost nodes, full disks, Ctrl-C"))
    soak.arguments(parts.add_parser("soak", help="a long run: memory and lost messages"))
    figures.arguments(parts.add_parser("figures", help="draw the figures of chapters 3 to 6 with the simulated plant"))
    for name in STUDIES:
        kind = load(name)
        study_arguments(parts.add_parser(name, help=kind.title), name, kind)


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


def _write_contact(
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
    if given.part in STUDIES:
        return run_study(given)
    parts = {
        "contact": _run_contact,
        "robustness": robustness.run,
        "faults": faults.run,
        "soak": soak.run,
        "figures": figures.run,
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
            scored = contact_benchmark.evaluation.evaluate(configuration, every_scenario, *batch)
    else:
        scored = scores(configuration, every_scenario, Progress("scenarios", sys.stderr))
    result = BenchmarkResult(tuple(given.seed), {seed: [] for seed in given.seed})
    for (seed, _), scenario in zip(order, scored, strict=True):
        result.scores[seed].append(scenario)
    text = contact_report(result, arm)
    print(text)
    if given.write:
        _write_contact(given, configuration, result, chosen[given.seed[0]][0])
    short = missed(result, arm)
    if short:
        print(f"missed: {'; '.join(short)}", file=sys.stderr)
    return 1 if short else 0


def study_arguments(parser: argparse.ArgumentParser, name: str, kind: type[Study[Any, Any]]) -> None:
    """Options of a study: those of all, and its own."""
    seeds = " ".join(map(str, kind.seeds))
    parser.add_argument("--seeds", type=int, nargs="+", default=list(kind.seeds), help=f"of the cases, default {seeds}")
    parser.add_argument("--cases", type=int, metavar="N", help=f"the first of each seed, default {kind.count or 'all'}")
    parser.add_argument("--only", type=int, nargs="+", metavar="NUMBER", help="cases of these numbers, each in full")
    parser.add_argument("--write", type=Path, help=f"page whose section is written, for example {kind.page}")
    for one in _options(kind):
        _add(parser, one)
    take_configuration(parser)
    take_batch(parser, name)
    parser.set_defaults(part=name, config=kind.base, study=kind)


def _options(kind: type[Study[Any, Any]]) -> Iterator[Field[Any]]:
    """The fields of a study that are options."""
    return (one for one in fields(kind) if "text" in one.metadata)


def _add(parser: argparse.ArgumentParser, one: Field[Any]) -> None:
    """Add the option of a field; its type is that of its default."""
    name, default, text = f"--{one.name.replace('_', '-')}", one.default, one.metadata["text"]
    if isinstance(default, bool):
        parser.add_argument(name, action="store_true", help=text)
    elif isinstance(default, tuple):
        parser.add_argument(name, nargs="+", default=default, metavar="NAME", help=f"{text}; default: all")
    else:
        parser.add_argument(name, type=type(default), default=default, help=f"{text}, default {default}")


def run_study(given: argparse.Namespace) -> int:
    """Evaluate, print, write; 1 if a required value is missed."""
    study = _study(given)
    cases = {seed: chosen_cases(study, seed, given.cases, given.only or ()) for seed in given.seeds}
    every = [case for own in cases.values() for case in own]
    if given.values:
        refuse_overridden(given, {name for case in every for name in study.sets(case)}, "each case")
    with batch_of(given, max(len(every), 1)) as batch:
        measured = evaluate(study, cases, *batch)
    if given.only:
        print("\n".join(map(study.details, measured.total)))
    else:
        print(report(measured, _words(given, study)))
    if given.write:
        _write(given, measured)
    missed = measured.scores.missed
    if missed:
        print(f"missed: {'; '.join(missed)}", file=sys.stderr)
    return 1 if missed else 0


def program(name: str, kind: type[Study[Any, Any]]) -> int:
    """A study of your own as a program with these options; the exit code."""
    parser = argparse.ArgumentParser(description=kind.title)
    study_arguments(parser, name, kind)
    given = parser.parse_args()
    given.command = sys.argv[0]
    try:
        return run_study(given)
    except ValueError as error:
        parser.error(str(error))


def _study(given: argparse.Namespace) -> Study[Any, Any]:
    """The study with its options; refuses what could not be done after the work."""
    kind: type[Study[Any, Any]] = given.study
    for name, low, values in (("--seeds", 0, given.seeds), ("--only", 0, given.only), ("--cases", 1, [given.cases])):
        for value in values or ():
            if value is not None:
                at_least(name, value, low)
    require_effect("--set", option_values(given.values))
    if given.write:
        writable_file("--write", given.write, PAGE)
        refuse_source(given, "--write", given.write)
        with_section(given.write, given.part, "")
    own = {one.name: getattr(given, one.name) for one in _options(kind)}
    return kind(configuration_of(given), **{name: tuple(v) if isinstance(v, list) else v for name, v in own.items()})


def _words(given: argparse.Namespace, study: Study[Any, Any]) -> str:
    """The study with its options that are not the default, as a command."""
    words = ["wam", "evaluate", given.part] if given.command == "evaluate" else ["python3", given.command]
    words += ["--config", given.config] if given.config != study.base else []
    words += [word for value in given.values for word in ("--set", value)]
    for one in _options(type(study)):
        value, name = getattr(study, one.name), f"--{one.name.replace('_', '-')}"
        if value != one.default:
            words += [name] if value is True else [name, *(value if isinstance(value, tuple) else [f"{value:g}"])]
    return shlex.join(words)


def _write(given: argparse.Namespace, measured: Measurement) -> None:
    """Write the section, and the picture into a folder of the page's name."""
    page, study = Path(given.write), measured.study
    picture = page.with_suffix("") / f"{given.part}.png"
    shown = f"{picture.parent.name}/{picture.name}" if study.picture(measured.total, picture) else ""
    repeats = _words(given, study)
    numbers = " ".join(map(str, given.seeds))
    command = f"{repeats} --seeds {numbers}" + (f" --cases {given.cases}" if given.cases else "") + f" --write {page}"
    text = block(measured, command, repeats, shown)
    page.write_text(with_section(page, given.part, text, study.title), encoding="utf-8")

"""`wam evaluate`: benchmark a part of the stack."""

import argparse
import shlex
import sys
from collections.abc import Iterator
from dataclasses import Field, fields
from pathlib import Path
from typing import Any

from wam_cli.options import (
    COUNT,
    PAGE,
    SEED,
    batch_of,
    bounded,
    configuration_of,
    refuse_overridden,
    require_effect,
    take_batch,
    take_configuration,
    writable_directory,
)
from wam_description.configuration import option_values
from wam_studies.figures.catalogue import FIGURES, file_of, known, numbers, table
from wam_studies.figures.style import draw_panels
from wam_studies.harness import STUDIES, Measurement, Study, chosen_cases, evaluate, load
from wam_studies.page import block, report, with_section


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `wam evaluate` to its parser."""
    parts = parser.add_subparsers(dest="part", required=True, metavar="STUDY")
    for name in STUDIES:
        kind = load(name)
        study_arguments(parts.add_parser(name, help=kind.title), name, kind)
    figures = parts.add_parser("figures", help="draw the figures of chapters 1 to 6 with the simulated plant")
    figures.add_argument(
        "names", nargs="*", metavar="NAME", help=f"figures to draw, of {', '.join(FIGURES)}; default: all"
    )
    figures.add_argument(
        "--to", type=writable_directory, default="docs/figures", help="directory for the figures; default: %(default)s"
    )
    take_batch(figures, "figures")


def run(given: argparse.Namespace) -> int:
    """Evaluate a study or draw the figures; 1 if a required value is missed."""
    return run_study(given) if given.part in STUDIES else draw_figures(given)


def draw_figures(given: argparse.Namespace) -> int:
    """Compute and draw figures of the thesis, and print how far the plant is from their lines."""
    names = known(given.names or list(FIGURES))  # before anything is started
    with batch_of(given, len(names)) as batch:
        found = numbers(names, *batch)
    given.to.mkdir(parents=True, exist_ok=True)
    for name, values in found.items():
        draw_panels(values, file_of(name, given.to))
    print(table(found), end="")
    return 0


def study_arguments(parser: argparse.ArgumentParser, name: str, kind: type[Study[Any, Any]]) -> None:
    """Options of a study: those of all, and its own."""
    seeds = " ".join(map(str, kind.seeds))
    parser.add_argument(
        "--seeds", type=SEED, nargs="+", default=list(kind.seeds), help=f"seeds of the cases, default {seeds}"
    )
    parser.add_argument(
        "--cases", type=COUNT, metavar="N", help=f"number of cases of each seed, default {kind.count or 'all'}"
    )
    parser.add_argument(
        "--only",
        type=bounded(int),
        nargs="+",
        metavar="NUMBER",
        help="run only the cases with these numbers, and print everything about each",
    )
    parser.add_argument(
        "--write", type=PAGE, help=f"write the result into a page, for example {kind.page or 'docs/PAGE.md'}"
    )
    for one in _options(kind):
        _add(parser, one)
    take_configuration(parser, kind.base)
    take_batch(parser, name)
    parser.set_defaults(part=name, study=kind)


def _options(kind: type[Study[Any, Any]]) -> Iterator[Field[Any]]:
    """The fields of a study that are options."""
    return (one for one in fields(kind) if "doc" in one.metadata)


def _add(parser: argparse.ArgumentParser, one: Field[Any]) -> None:
    """Add the option of a field; its type is that of its default."""
    name, default, allowed = f"--{one.name.replace('_', '-')}", one.default, one.metadata
    text = ", ".join(filter(None, (allowed["doc"], allowed["unit"]))).replace("%", "%%")
    if isinstance(default, bool):
        parser.add_argument(name, action="store_true", help=text)
    elif isinstance(default, tuple):
        choices = allowed["choices"]
        given = ", ".join(shlex.quote(choice) for choice in choices).replace("%", "%%")
        chosen = "all of them" if default == choices else " ".join(default) or "none"
        text = f"{text}: {given}; default: {chosen}"
        parser.add_argument(name, nargs="+", choices=choices, default=default, metavar="NAME", help=text)
    else:
        kind: Any = type(default)
        text += f", default {default}"
        parser.add_argument(name, type=bounded(kind, allowed["low"], allowed["high"]), default=default, help=text)


def run_study(given: argparse.Namespace) -> int:
    """Evaluate a study, print and write its result; 1 if a required value is missed."""
    study = _study(given)
    cases = {seed: chosen_cases(study, seed, given.cases, given.only or ()) for seed in given.seeds}
    every = [case for own in cases.values() for case in own]
    if not every:
        raise ValueError(f"no case has a number of --only; give 0 to {len(chosen_cases(study, given.seeds[0])) - 1}")
    if given.values:
        refuse_overridden(given, {name for case in every for name in study.own_values(case)}, "each case")
    with batch_of(given, 1 if study.over_topics else len(every)) as batch:
        measured = evaluate(study, cases, *batch)
    if given.only:
        print(*measured.total, sep="\n")
    else:
        print(report(measured, _words(given, study)))
    if given.write:
        _write(given, measured)
    if missed := measured.scores.missed:
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
    if not kind.over_topics:
        require_effect("--set", option_values(given.values))
    if given.write:
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
            words += [name] if value is True else [name, *map(str, value if isinstance(value, tuple) else (value,))]
    return shlex.join(words)


def _write(given: argparse.Namespace, measured: Measurement) -> None:
    """Write the section, and the picture into a folder of the page's name."""
    page, study, shown = Path(given.write), measured.study, ""
    if panels := study.panels(measured.total):
        picture = page.with_suffix("") / f"{given.part}.png"
        picture.parent.mkdir(parents=True, exist_ok=True)
        draw_panels(panels, picture, 2)
        shown = f"{picture.parent.name}/{picture.name}"
    repeats = _words(given, study)
    numbers = " ".join(map(str, given.seeds))
    command = f"{repeats} --seeds {numbers}" + (f" --cases {given.cases}" if given.cases else "") + f" --write {page}"
    text = block(measured, command, shown)
    page.write_text(with_section(page, given.part, text, study.title), encoding="utf-8")

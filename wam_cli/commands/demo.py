"""`wam demo`: the demonstration, or a whole-arm task, from start to report; with ROS nodes, or without ROS."""

import argparse
import math
import os
import shlex
import sys
from pathlib import Path
from typing import Any

from wam_bag.bag_name import dated
from wam_bag.errors import BagError
from wam_cli.options import (
    ARM,
    exit_code_of,
    filled,
    processes_of,
    recording_folder,
    take_configuration,
    take_page,
    take_time,
    timed,
)
from wam_control.task.scenario import ScenarioStep, load_for, script_file
from wam_description.configuration import Configuration
from wam_description.interface import Interface, require_parameters
from wam_description.nodes import ONE
from wam_ros.process_signals import Stop, end_at_once_on_signals
from wam_sim.simulated_bag import record
from wam_studies.thesis.definition import Experiment, load, tasks, with_run

EXIT_CODES = (
    "Exit code: 0 if the run was complete and every result is right; 1 if the run failed or a result is NO (with "
    "--task: MISSED); 128 + the number of the signal if you stopped it, so 130 after Ctrl-C."
)
PLAIN_LOG = "[{severity}] [{name}]: {message}"  # of ROS, without the wall clock
WITHOUT_ROS = (
    "ROS is not installed (no rclpy): the same nodes run in this process and give the same numbers, but there are no "
    "topics and no live page; for these: pip install 'wam_stack[ros,live]'"
)


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `wam demo` to its parser."""
    parser.epilog = EXIT_CODES
    take_time(parser)
    played = parser.add_mutually_exclusive_group()
    played.add_argument(
        "--task",
        type=_task,
        metavar="NAME",
        help=f"play this task instead of the demonstration: {', '.join(tasks())}, or a YAML file of your own",
    )
    played.add_argument("--scenario", type=filled, help="play these steps instead of the demonstration: a YAML file")
    parser.add_argument(
        "--name", type=filled, help="name of the bag; default: 'demo' or the name of the task, date and time"
    )
    take_page(parser, default=None)
    take_configuration(parser)
    parser.set_defaults(namespace=ARM, log_level="info")


def _task(name: str) -> str:
    """The name of a packaged task, or the path of a YAML file."""
    if name.endswith(".yaml") or filled(name) in tasks():
        return name
    raise argparse.ArgumentTypeError(
        f"no task is named '{name}'; choose from {', '.join(tasks())}, or name a YAML file"
    )


def run(given: argparse.Namespace) -> int:
    """Play and record a demonstration, then print its report."""
    task = load(given.task) if given.task else None
    base = timed(given)
    if given.scenario:
        base = base.with_values({"scenario:script": given.scenario})
    name = given.name or dated(task.name if task else "demo")
    directory = recording_folder(base, name)
    bag = directory / name
    if task:
        base = with_run(base, task.runs[0]._replace(name=name), directory)
    configuration = base.with_nodes("scenario", "recorder").with_values({"recorder:name": name})
    Interface(configuration.shared)  # refused before anything is printed, as are the values
    require_parameters(configuration)
    steps = report_task(configuration, task.name if task else "")
    failures, stopped = play(configuration, steps, bag, given)
    if stopped:
        print(f"stopped; what was recorded until then is in {bag}" if bag.exists() else "stopped before anything moved")
        return stopped
    unmet, bag_word = stoppable_report(bag, bool(failures), task), shlex.quote(str(bag))
    if failures or unmet is None:
        stream = sys.stderr if unmet is None else sys.stdout  # that of the report
        print(f"\nthe demonstration failed: {', '.join(failures)}", file=stream)
        if unmet is not None:
            print(f"next: wam analyse {bag_word}", file=stream)
        if configuration.shared.timing.mode == "realtime":
            print("next: wam demo    # without --realtime: lockstep waits for a busy computer", file=stream)
        return 1
    print(f"next     wam live {bag_word}       # the recording in the browser")
    print(f"         wam analyse {bag_word}    # measured and compared with theory")
    return exit_code_of(unmet)


def report_task(configuration: Configuration, task: str = "") -> list[ScenarioStep]:
    """Print what is about to happen, and refuse a task that cannot be played before anything is started.

    Returns
    -------
    list
        its steps.

    Raises
    ------
    ParameterError
        which names the file, the step and the value.
    """
    script = str(configuration.sections["scenario"]["script"])
    steps = load_for(configuration, script)
    seconds = sum(step.seconds for step in steps)
    pushes = [step.push for step in steps if step.push]
    presses = [math.hypot(*step.force.force) for step in steps if any(step.force.force)]
    pushed = ", ".join(f"{math.hypot(*push.force):g} N on the {push.cover.replace('_', ' ')}" for push in pushes)
    count = f"{len(steps)} step{'s' * (len(steps) != 1)}"
    name = f"Task {task}" if task else f"Scenario {script_file(script).stem}"
    print(f"{name}: {count}, up to {seconds:g} s of the arm's time")
    if pushes:
        print(f"  the simulator pushes the arm: {pushed}; the estimator finds link and position from the torques")
    if presses:
        who = "the force loop presses with" if "force_loop" in configuration.shared.nodes else "commanded forces:"
        print(f"  {who} {', '.join(f'{newtons:g}' for newtons in presses)} N")
    sys.stdout.flush()
    return list(steps)


def stoppable_report(bag: Path, failed: bool, task: Experiment | None) -> tuple[str, ...] | None:
    """Print the report; returns what is wrong in it, None where there is none.  A signal ends the program cleanly."""
    again = f"wam analyse {shlex.quote(str(bag))} --steps"
    stated = "stopped before the report was finished"
    end_at_once_on_signals(f"\n{stated}; the recording is in {bag}; to print the report: {again}\n")
    return _report(bag, failed, task)


def _report(bag: Path, failed: bool, task: Experiment | None) -> tuple[str, ...] | None:
    """Print the report; what in it is not as it should be, None where a demonstration that failed has no report."""
    from wam_analysis.findings.analysis import analyse_steps  # not before the nodes
    from wam_analysis.findings.text import text

    try:
        found = analyse_steps(bag)
        report, unmet = _report_of_task(task, bag, found) if task else (text(found), found.unmet)
        print(report, flush=True)
    except (BagError, OSError) as error:
        if not failed:
            raise
        print(f"no report{f' of task {task.name}' if task else ''}: {error}", file=sys.stderr)
        return _report(bag, failed, None) if task else None  # how far it came
    return unmet


def _report_of_task(task: Experiment, bag: Path, found: Any) -> tuple[str, tuple[str, ...]]:
    from wam_studies.tasks.pictures import save
    from wam_studies.thesis.evaluation import evaluate, text

    result = evaluate(task, bag)
    save(task, bag, result, bag / "task.png")
    wrong = [f"  {one}" for section in found.sections for one in section.wrong]
    stated = "\n".join([text(task, result), *["", "Problems of the recording"][: 2 * bool(wrong)], *wrong])
    missed = tuple(f"{row.quantity}: MISSED" for row in result.rows if not row.agrees)
    return f"{stated}\n\nbag      {bag}\npicture  {bag / 'task.png'}", missed


def play(
    configuration: Configuration, steps: list[ScenarioStep], bag: Path, given: argparse.Namespace
) -> tuple[list[str], int]:
    """Play the scenario of a configuration and record it into a bag; why that failed, and the code of who stopped it.

    Raises
    ------
    ValueError
        if an option needs the nodes and there is no ROS.
    """
    end_at_once_on_signals()
    try:
        import rclpy  # noqa: F401 - whether there is ROS
    except ModuleNotFoundError:
        return _simulated(configuration, steps, bag, given)
    from wam_cli.commands.up import run_nodes

    os.environ.setdefault("RCUTILS_CONSOLE_OUTPUT_FORMAT", PLAIN_LOG)
    stop = Stop()
    ended = run_nodes(configuration, given, stop)
    return [*filter(None, (*ended.failures, ended.failure))], stop.code


def _simulated(
    configuration: Configuration, steps: list[ScenarioStep], bag: Path, given: argparse.Namespace
) -> tuple[list[str], int]:
    if processes_of(configuration, given) != ONE or given.live:
        option = "--live" if given.live else "--processes" if given.processes else "--realtime"
        raise ValueError(f"{option} needs ROS; pip install 'wam_stack[ros,live]', or leave it out")
    print(WITHOUT_ROS, flush=True)
    stop, stated = Stop(), lambda seconds, step: print(f"{seconds:5.1f} s  {step}", flush=True)
    failure = record(configuration, steps, bag, report=stated, is_stopped=lambda: stop.is_set)
    if failure:
        print(f"error: {failure}", file=sys.stderr, flush=True)
    return [failure] * bool(failure), stop.code

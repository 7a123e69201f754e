"""`wam identify`: from a recording of free motion to the model of the controllers."""

import argparse
import os
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path

import yaml

from wam_analysis.identification.contradictions import contradictions
from wam_analysis.identification.fit import identify
from wam_analysis.identification.motion import LOADS, loaded, recorded_motion
from wam_analysis.identification.overlay import HEADING as MODEL_HEADING
from wam_analysis.identification.overlay import estimator_values, impossibility, model_values, write_overlay
from wam_analysis.identification.report import report
from wam_bag.bag import read
from wam_bag.bag_name import dated
from wam_cli.options import (
    SEED,
    bounded,
    configuration_of,
    output_file,
    recording_folder,
    require_option,
    take_arm,
    take_configuration,
)
from wam_control.task.scenario import load_for
from wam_description.arm import Shared
from wam_description.configuration import YAML, Configuration, files_of, named_file
from wam_description.parameters import ParameterError
from wam_ros.process_signals import Stop
from wam_sim.progress import Progress
from wam_sim.recorded_run import RecordedRun, recorded_run
from wam_sim.simulated_bag import record
from wam_studies.identification.excitation import scenario

HEADING = "# Moves that show the arm's parameters"  # of a scenario that this command wrote
MODEL = output_file("a configuration", YAML, MODEL_HEADING)
MOVES = output_file("a scenario", YAML, HEADING)
TOPICS = ("motor_states", "status", *LOADS)


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `wam identify` to its parser."""
    parser.add_argument("bag", nargs="?", type=Path, help="recording of free motion, without contact")
    parser.add_argument(
        "--excite",
        metavar="SCENARIO",
        type=MOVES,
        help="write a scenario that moves all joints, play it in the simulation and identify from its bag",
    )
    length = bounded(float, 10.0, 3600.0, "s")  # the choice of its moves takes minutes
    parser.add_argument("--seconds", type=length, help="with --excite: length of the motion in s, default 60")
    parser.add_argument("--seed", type=SEED, help="with --excite: seed of the moves, default 1")
    either = parser.add_mutually_exclusive_group()
    either.add_argument(
        "--only-write", action="store_true", help="with --excite: write the scenario and do not play it"
    )
    either.add_argument("--write", type=MODEL, metavar="YAML", help="write the model as a configuration")
    parser.add_argument(
        "--force", action="store_true", help="with --write: write the model even if it contradicts the configured arm"
    )
    take_arm(parser)
    take_configuration(parser)


def run(given: argparse.Namespace) -> int:
    """Identify the model from a bag."""
    if (given.bag is None) == (given.excite is None):
        raise ValueError("give a bag, or --excite SCENARIO to make one")
    require_option(given, "--excite", "--seconds", "--seed", "--only-write")
    configuration = configuration_of(given)
    if given.write and given.write.resolve() in [one.resolve() for one in files_of(named_file(given.config))]:
        raise ValueError(f"{given.write} would be overwritten, but this command reads it; give another file")
    bag = given.bag
    if given.excite is not None:
        bag = _excite(configuration, given)
        if bag is None:
            return 0
    run_in_bag = recorded_run(read(bag, TOPICS, may_lack=True), given.namespace or "")
    if run_in_bag.others:
        print(f"{run_in_bag.others}\n", flush=True)
    shared = configuration.shared
    _refuse_other_arm(run_in_bag, shared)
    motion = recorded_motion(run_in_bag, shared.arm)
    found = identify(shared, motion)
    against = list(map(str, contradictions(shared, motion, found)))
    values = model_values(shared, found, bag.name) | estimator_values(configuration)
    impossible = impossibility(configuration, values, str(bag))
    if impossible:
        print(f"NOT A POSSIBLE MODEL: {impossible}\n")  # before a report of many lines, and as the last line
    print(report(shared, found, str(bag)), flush=True)
    _warn(run_in_bag, against)
    if against and not given.force:
        raise ValueError(
            f"{bag} contradicts the configuration, so no model is written: {against[0]} Correct the recording or the "
            "configuration; --force writes the model anyway"
        )
    if impossible:
        raise ParameterError(impossible)
    if given.write is not None:
        command = shlex.join(["wam", "identify", str(bag), "--config", given.config])
        folder, base = given.write.resolve().parent, given.config
        if base.endswith(YAML):
            base = os.path.relpath(Path(base).resolve(), folder)
        write_overlay(given.write, base, values, command)
        print(
            f"written: {given.write}; use it with --config {given.write}, or as `base` of a configuration of your own"
        )
    return 0


def _warn(run: RecordedRun, against: Sequence[str]) -> None:
    """Print what is wrong with a recording."""
    for text in against:
        print(f"CONTRADICTS the configuration: {text}")
    if run.parameters.nodes.get("driver", {}).get("timing.dither_cycle", 0):
        print("warning: recorded with dither, so all values are wrong; record with timing.dither_cycle 0")
    if loads := " and ".join(loaded(run)):
        print(
            f"warning: {loads} of the recording. This changes the values above, and their standard errors do not show "
            "it; identify from motion without contact. If nothing touched the arm, the present model is wrong"
        )


def _refuse_other_arm(run: RecordedRun, shared: Shared) -> None:
    """Refuse a bag of an arm with another transmission, as far as the bag has it."""
    if "driver" not in run.parameters.nodes:
        return
    there = tuple(run.parameters.node("driver").get("arm.joint_from_motor", shared.arm.joint_from_motor))
    if there != shared.arm.joint_from_motor:
        raise ValueError(
            f"{run.bag.path} was recorded with another arm: its joint_from_motor is {list(there)}, in the "
            f"configuration it is {list(shared.arm.joint_from_motor)}; give the configuration of that arm with --config"
        )


def _excite(configuration: Configuration, given: argparse.Namespace) -> Path | None:
    """Write the scenario and play it; the bag, None with --only-write."""
    seconds, seed = given.seconds or 60.0, 1 if given.seed is None else given.seed
    text = yaml.safe_dump(scenario(configuration, seed, seconds), sort_keys=False, default_flow_style=None)
    command = f"wam identify --excite {shlex.quote(str(given.excite))} --seed {seed} --seconds {seconds:g}"
    given.excite.write_text(f"{HEADING}: {command}\n{text}", encoding="utf-8")
    still = " --set timing.dither_cycle=0" if configuration.shared.timing.dither_cycle else ""
    on_arm = f"wam up --config {shlex.quote(given.config)} --record --scenario {shlex.quote(str(given.excite))}{still}"
    print(f"written: {given.excite}; on a real arm: {on_arm}", flush=True)
    if given.only_write:
        return None
    bag = recording_folder(configuration, "") / dated("identify")
    stop, progress = Stop(), Progress("seconds of motion", sys.stderr)
    played = configuration.with_values({"timing.dither_cycle": 0})
    failure = record(
        played,
        load_for(played, str(given.excite)),
        bag,
        report=lambda now, step: progress(min(int(now), int(seconds)), int(seconds)),
        is_stopped=lambda: stop.is_set,
    )
    if failure:
        raise ValueError(f"the motion failed: {failure}")
    if stop.is_set:
        raise SystemExit(stop.code)
    return bag

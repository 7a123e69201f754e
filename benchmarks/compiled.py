"""The inner loop compiled to C by mypyc against the same source as plain Python: a direct run, substeps of the plant.

The compiled one is what is installed, if it is of the same source; otherwise a copy of the tree is compiled
(`WAM_COMPILE`, see setup.py).  Both answer in turns, and every number that the run publishes has to have the same bits.
With `--folder` the compiled copy stays there for the next time.
"""

import filecmp
import hashlib
import json
import os
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import yaml
from comparing import Quartiles, machine, mark, options, quartiles, ratios, save, table
from plant import FREE, Case, pose_in_contact
from speed import ROWS, scenario

from wam_control.task.scenario import load
from wam_description.configuration import Configuration, packaged
from wam_sim.simulation import Simulation

ROOT = Path(__file__).resolve().parents[1]
DIRECT = "direct run"
COMPILER = str(sysconfig.get_config_var("CC")).split()[0]
SUBSTEP = (1.15, 1.05)  # ratio to a bare mj_step: must, aim
STEPS = 40  # of the plant at a time
CASES = {
    "arm free, moving": lambda: Case(FREE, extra=0.2),
    "arm free, pushed": lambda: Case(FREE, extra=0.2, pushed=True),
    "in contact": lambda: Case(pose_in_contact(), extra=0.0),
    "testbed, moving": lambda: Case((0.1,), extra=0.2, name="testbed"),
}


def installed() -> Path | None:
    """Where the compiled packages of this source are installed; None where they are not."""
    site = Path(sysconfig.get_path("purelib"))
    if not any(site.glob("wam_driver/fast_steps.*.so")):
        return None
    sources = [path.relative_to(ROOT) for path in ROOT.glob("wam_*/**/*.py")]
    _, differing, missing = filecmp.cmpfiles(ROOT, site, map(str, sources), shallow=False)
    return None if differing or missing else site


def compiled(folder: Path) -> Path:
    """A copy of the tree with compiled modules; what is there already is used."""
    if not (folder / "setup.py").exists():
        for name in ("setup.py", "setup.cfg", "pyproject.toml", "package.xml"):
            shutil.copy(ROOT / name, folder)
        for path in [ROOT / "config", ROOT / "scripts", *ROOT.glob("wam_*")]:
            shutil.copytree(path, folder / path.name, ignore=shutil.ignore_patterns("__pycache__"))
        build = [sys.executable, "setup.py", "-q", "build_ext", "--inplace"]
        done = subprocess.run(
            build, cwd=folder, env={**os.environ, "WAM_COMPILE": "1"}, capture_output=True, text=True, check=False
        )
        if done.returncode:
            raise SystemExit(f"{done.stdout[-2000:]}{done.stderr[-2000:]}")
    return folder


def serve(seconds: float) -> None:
    """Answer requests on standard input with what they measure, one line of JSON each."""
    cases = {name: make() for name, make in CASES.items()}
    with tempfile.TemporaryDirectory(prefix="wam_bench_") as folder:
        script = Path(folder) / "script.yaml"
        script.write_text(yaml.safe_dump(scenario(seconds)), encoding="utf-8")
        configuration = Configuration.load(packaged("wam"))
        for line in sys.stdin:
            request = line.strip()
            answer: Any = cases[request].measure(STEPS) if request in cases else _direct(configuration, script)
            print(json.dumps(answer), flush=True)


def _direct(configuration: Configuration, script: Path) -> tuple[float, str]:
    """Simulated seconds per second of the processor, and a hash of all numbers of the run."""
    run = Simulation(configuration, load(script, configuration.shared))
    begin = time.process_time()  # which other programs disturb less
    if failure := run.play():
        raise SystemExit(failure)
    speed = run.driver.stamp / 1e9 / (time.process_time() - begin)
    return speed, hashlib.sha256(repr(sorted(run.rows.items())).encode()).hexdigest()


@contextmanager
def server(tree: Path, seconds: float) -> Iterator[subprocess.Popen[str]]:
    """A process that answers with the packages of a tree."""
    command = [sys.executable, __file__, "--serve", str(seconds)]
    environment = {**os.environ, "PYTHONPATH": str(tree)}
    pipe = subprocess.PIPE
    with subprocess.Popen(command, env=environment, stdin=pipe, stdout=pipe, text=True) as child:
        yield child


def ask(child: subprocess.Popen[str], request: str) -> Any:
    """The answer of a server."""
    assert child.stdin is not None
    assert child.stdout is not None
    child.stdin.write(f"{request}\n")
    child.stdin.flush()
    if not (answer := child.stdout.readline()):
        raise SystemExit(f"the process that measures has ended at '{request}'")
    return json.loads(answer)


def main() -> None:
    """Measure in turns, print the table."""
    parser = options(__doc__ or "", rounds=20)
    parser.add_argument("--folder", type=Path, help="of the compiled copy")
    parser.add_argument("--serve", type=float, help="answer as the tree on PYTHONPATH; used by this program")
    given = parser.parse_args()
    if given.serve:
        serve(given.serve)
        return
    if not (shutil.which(COMPILER) and Path(sysconfig.get_path("include"), "Python.h").exists()):
        print(f"left out: mypyc needs {COMPILER} and the headers of Python; on Debian: apt install gcc python3-dev")
        return
    given.rounds = given.rounds or (1 if given.quick else 20)
    seconds = 1.0 if given.quick else 5.0
    with ExitStack() as stack:
        folder = given.folder or Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="wam_bench_")))
        folder.mkdir(parents=True, exist_ok=True)
        trees = [(not given.folder and installed()) or compiled(folder), ROOT]
        children = [stack.enter_context(server(tree, seconds)) for tree in trees]
        direct: list[list[Any]] = [[], []]
        substeps: dict[str, list[list[Any]]] = {name: [[], []] for name in CASES}
        for _ in range(given.rounds):
            for i, child in enumerate(children):
                direct[i].append(ask(child, DIRECT))
            for name, taken in substeps.items():
                for _ in range(1 if given.quick else 10):
                    for i, child in enumerate(children):
                        taken[i].append(ask(child, name))
    if len(hashes := {digest for each in direct for _, digest in each}) != 1:
        raise SystemExit(f"the runs differ: {len(hashes)} kinds of numbers")
    fast, plain = ([speed for speed, _ in each] for each in direct)
    rows, measured = [], dict[str, Any]()

    def add(name: str, ours: list[float], theirs: list[float], gain: Quartiles, limits: tuple[float, float]) -> None:
        middle, usual = quartiles(ours).median, quartiles(theirs).median
        rows.append([name, f"{middle:.2f}", f"{usual:.2f}", f"{gain:.2f}", mark(middle, *limits)])
        measured[name] = {"compiled": quartiles(ours), "plain": quartiles(theirs), "gain": gain}

    add(f"{DIRECT}, times real time", fast, plain, ratios(fast, plain), ROWS[DIRECT])
    for name, (ours, theirs) in substeps.items():
        over, under = ([plant / bare for plant, bare in each] for each in (ours, theirs))
        add(f"substep over mj_step, {name}", over, under, ratios(under, over), SUBSTEP)
    print(machine().rpartition(", ")[0])
    print(table(["equal bits", "compiled", "plain", "faster by (middle half)", "[must, aim]"], rows))
    save("compiled", given, measured)


if __name__ == "__main__":
    main()

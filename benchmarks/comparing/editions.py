"""The benchmarks of another checkout and of this one in turns, and what each row is here over there.

    .venv/bin/python benchmarks/comparing/editions.py ../before speed plant --rounds 5

Each checkout runs its own scripts in its own environment (`make install` in both), one round at a time; a row is
compared where both have it.  Of times and of ratios to a reference the smaller is the better, of times real time the
larger.
"""

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from comparing import machine, options, ratios, table

HERE = Path(__file__).resolve().parents[2]
ROUNDS = 5


def measured(checkout: Path, script: str) -> dict[str, float]:
    """Rows of one round of a benchmark of a checkout, by name; its results gain a line."""
    command = [str(checkout / ".venv/bin/python"), str(checkout / f"benchmarks/{script}.py"), "--rounds", "1"]
    done = subprocess.run(command, check=False, cwd=checkout, capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f"{' '.join(command)} ended with {done.returncode}:\n{done.stderr[-2000:]}")
    line = (checkout / f"benchmarks/results/{script}.jsonl").read_text(encoding="utf-8").splitlines()[-1]
    return dict(rows(json.loads(line)))


def rows(tree: Any, name: str = "") -> Iterator[tuple[str, float]]:
    """Numbers of a line of results, by their names; of quartiles the median."""
    if isinstance(tree, dict):
        for key, value in tree.items():
            yield from rows(value, f"{name}: {key}" if name else key)
    elif isinstance(tree, list) and tree and isinstance(tree[0], int | float):
        yield name, float(tree[0])


def main() -> None:
    """Measure in turns, print the table."""
    parser = options(__doc__, ROUNDS)
    parser.add_argument("checkout", type=Path, help="folder of the other checkout, with its .venv")
    parser.add_argument("scripts", nargs="+", help="names of benchmarks: speed, plant, round_trip")
    given = parser.parse_args()
    print(machine())
    for script in given.scripts:
        turns = [(measured(given.checkout, script), measured(HERE, script)) for _ in range(given.rounds or ROUNDS)]
        lines = []
        for row in turns[0][0].keys() & turns[0][1].keys():
            there, here = ([turn[i][row] for turn in turns] for i in (0, 1))
            lines.append([row, f"{ratios(here, there):.3f}", f"{min(there):.4g}", f"{min(here):.4g}"])
        print(table([script, "here / there (middle half)", "least there", "least here"], sorted(lines)))


if __name__ == "__main__":
    main()

"""Import this first: the packages are those of the tree, in plain Python, even where the installed ones are compiled.

Clocks and replacements cannot be put into compiled classes, and the rows of these benchmarks are about the plain way.
A PYTHONPATH that is set goes first.
"""

import os
import sys
from pathlib import Path

if not os.environ.get("PYTHONPATH"):
    sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

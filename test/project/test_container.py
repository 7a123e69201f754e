"""The container: its files name what is there.  Docker itself is not needed here; nothing is built."""

import json
import re
import shlex
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DOCKERFILE = (ROOT / "Dockerfile").read_text(encoding="utf-8")
DEVCONTAINER = json.loads((ROOT / ".devcontainer" / "devcontainer.json").read_text(encoding="utf-8"))
INSTRUCTIONS = re.sub(r"\\\n", " ", re.sub(r"^#.*\n", "", DOCKERFILE, flags=re.MULTILINE)).splitlines()
TARGETS = set(re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))


def test_every_file_that_is_copied_is_there() -> None:
    copied = [shlex.split(line)[2:] for line in INSTRUCTIONS if line.startswith("COPY")]
    assert copied
    missing = [source for *sources, _ in copied for source in sources if not (ROOT / source).exists()]
    assert missing == []


def test_every_target_of_make_exists() -> None:
    called = set(re.findall(r"make (\w+)", DOCKERFILE.replace("make procps", ""))) | {"demo"}
    called |= set(re.findall(r"make (\w+)", DEVCONTAINER["postCreateCommand"]))
    assert {"install", "dependencies"} <= called <= TARGETS

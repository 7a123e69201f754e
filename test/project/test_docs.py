"""The documentation agrees with the code; test_doc_commands.py runs its commands, test_site.py builds its site."""

import ast
import difflib
import re
import runpy
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import pytest
import yaml

from wam_description.topics import BY_NAME
from wam_ros.testing import RunningArm

ROOT = Path(__file__).resolve().parents[2]
HANDBOOK = {
    path.name: path.read_text(encoding="utf-8")
    for path in [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *ROOT.glob("docs/*.md"), ROOT / "docs" / "thesis.csv"]
}

ACTIONS = {"/wam/follow_joint_trajectory"}  # of `wam live --trajectories`, where control_msgs is installed


@pytest.fixture(scope="module")
def generate() -> Any:
    return SimpleNamespace(**runpy.run_path(str(ROOT / "docs" / "generate.py")))


@pytest.mark.slow
def test_generated_pages_are_current(generate: Any) -> None:
    pages = generate.pages()
    stale = [f"docs/{path.name}" for path, text in pages.items() if path.read_text(encoding="utf-8") != text]
    assert stale == [], "these pages are not what the code says; run docs/generate.py --pages with them, and commit"
    assert {path.name for path in pages} >= {"running.md", "topics.md", "parameters.md", "thesis.md"}


def test_a_changed_block_is_noticed_and_a_changed_sentence_is_kept(generate: Any) -> None:
    text = HANDBOOK["topics.md"]
    assert generate.filled(text.replace("| `motor_states`", "| `motor_status`")) == text, "make docs ARGS=--pages"
    own = text.replace("# Topics\n", "# Our topics\n")
    assert generate.filled(own) == own


def test_topics_and_services_named_in_the_handbook_exist(arm: RunningArm) -> None:
    from wam_description.nodes import NODES

    arm.start(nodes=[name for name in NODES if name != "recorder"])
    services = {service.service_name for node in arm.nodes.values() for service in node.services}
    topics = {name if name.startswith("/") else f"/wam/{name}" for name in BY_NAME}
    for page, text in HANDBOOK.items():
        named = set(re.findall(r"/wam/[a-z_/]*[a-z]", text))
        assert named <= topics | services | {f"/wam/{node}" for node in NODES} | ACTIONS, page


NO_TOPICS = {"use_joint_sensors", "needs_joint_sensors"}  # which look like some


def test_topics_in_backticks_exist() -> None:
    looks_like_a_topic = re.compile(r"(sim|contact)/\w+|\w+_(command|states|sensors|effort|currents|torques)")
    for page, text in HANDBOOK.items():
        if page == "parameters.md":
            continue
        for name in set(re.findall(r"`([\w/]+)`", text)) - BY_NAME.keys() - NO_TOPICS:
            meant = difflib.get_close_matches(name, BY_NAME, cutoff=0.85)
            assert not meant, f"{page}: `{name}`, is {meant[0]} meant?"
            assert not looks_like_a_topic.fullmatch(name), f"{page}: there is no topic `{name}`"


def test_files_that_the_handbook_links_to_exist() -> None:
    for page, text in HANDBOOK.items():
        folder = ROOT if page in ("README.md", "CONTRIBUTING.md") else ROOT / "docs"
        for target in re.findall(r"\]\(([^)#:]+)\)", text):
            assert (folder / target).is_file(), f"{page}: {target}"


def spoken(path: Path) -> Iterator[str]:
    """Every text in a module; what an f-string fills in becomes <>."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.JoinedStr):
            yield "".join(str(part.value) if isinstance(part, ast.Constant) else "<>" for part in node.values)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value


@pytest.mark.slow
def test_refusals_in_the_handbook_are_those_of_the_code() -> None:
    table = HANDBOOK["safety.md"].partition("<!-- messages:")[2]
    messages = re.findall(r"^\|[^|]+\| `(.+)` \|$", table, re.MULTILINE)
    assert len(messages) >= 19
    texts = [text for path in ROOT.glob("wam_*/**/*.py") for text in spoken(path)]
    for message in messages:
        whole = message.removeprefix("refused: ")  # the driver puts it before an obstacle
        parts = re.split(r"<\w+>", whole)
        pattern = re.compile(".*?".join(map(re.escape, parts)))
        assert any(pattern.search(text) for text in texts if all(part in text for part in parts)), message


def test_the_version_is_that_of_the_package_wherever_it_is_written() -> None:
    version = ElementTree.parse(ROOT / "package.xml").getroot().findtext("version")
    assert yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))["version"] == version
    assert re.findall(r"^## (.+)$", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)[0] == version
    assert f"from {version} on" in (ROOT / "QUALITY_DECLARATION.md").read_text(encoding="utf-8")

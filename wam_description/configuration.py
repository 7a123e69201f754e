"""Configurations: one ROS parameter file with the values of every node, read without ROS."""

import difflib
import os
import re
import sys
import textwrap
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple, TypeVar

import yaml

from wam_description import yaml_text
from wam_description.arm import Shared
from wam_description.nodes import NODES
from wam_description.parameters import ParameterError, build, fields, given_once, listed, nested, require_fit
from wam_description.thresholds import FILES

GIVEN = "a value that you set"  # what is at fault where the file is right
T = TypeVar("T")
SHARED = "/**"
BASE = "base"  # key of an overlay that names the configuration it changes
PARAMETERS = "ros__parameters"
LENGTHS = ("arm.covers.length", "arm.joints.length", "arm.joints.offset")
MASSES = ("arm.links.mass", "arm.links.centre", "arm.links.inertia")
YAML = (".yaml", ".yml")  # endings of files
SCENARIO_KEY = "steps"  # a file with this at its top is a scenario
_NOT_REQUIRED = frozenset(field.name for field in fields(Shared) if not field.is_required)  # a file need not give them


class Configuration(NamedTuple):
    """The values of one parameter file, or of one with some values replaced.

    Attributes
    ----------
    path : of the file.
    sections : flat ``{dotted name: value}`` of every section; '/**' is shared, the others are
        named like their node.
    """

    path: Path
    sections: Mapping[str, Mapping[str, Any]]

    @classmethod
    def load(cls, path: str | Path) -> "Configuration":
        """Read a ROS parameter file.

        Raises
        ------
        ParameterError
            if the file is missing, is not YAML or does not have the structure of a parameter file.

        Notes
        -----
        A file with ``base: NAME`` at its top, the name of a configuration of the package or a path relative to the
        file, holds only what differs from that one: values, and sections of nodes that the base does not have.
        """
        path = Path(path)
        (first, tree), *overlays = reversed(_chain(path))
        whole = _made(first, _sections(first, tree))
        for overlay, changes in overlays:
            whole = whole.with_sections(_sections(overlay, changes, whole=False), overlay)
        return whole

    def __repr__(self) -> str:
        """Path and sections, not every value."""
        return f"Configuration({str(self.path)!r}, sections {', '.join(self.sections)})"

    @property
    def text(self) -> str:
        """YAML with these values as ROS reads them: no aliases, and no list of whole and other numbers."""
        tree = {}
        for name, flat in self.sections.items():
            values = {key: list(map(float, value)) if _is_mixed(value) else value for key, value in flat.items()}
            tree[name if name == SHARED else f"{SHARED}/{name}"] = {PARAMETERS: nested(values)}
        return yaml_text.dump(tree)

    @property
    def shared(self) -> Shared:
        """The parameters of every node, from the section '/**'."""
        return self._build(SHARED, Shared)

    def node(self, name: str, cls: type[T]) -> T:
        """The parameters of one node, from its section '/**/name'."""
        return self._build(self._section(name), cls)

    def with_nodes(self, *entries: str) -> "Configuration":
        """The same configuration with more nodes; one that it lists already is not added again."""
        nodes = self.shared.nodes
        return self.with_values({"nodes": [*nodes, *(entry for entry in entries if entry not in nodes)]})

    def with_values(self, values: Mapping[str, Any]) -> "Configuration":
        """The same configuration with some values replaced.

        Parameters
        ----------
        values : ``'timing.mode'`` names a shared parameter, ``'driver:seed'`` one of a node; a number in place of a
            list is that of each of its values.

        Raises
        ------
        ParameterError
            if the configuration has no such parameter.
        """
        sections = {name: dict(flat) for name, flat in self.sections.items()}
        has_own = any(":" in str(entry) for entry in sections.get(SHARED, {}).get("nodes", []))
        for key, value in values.items():
            node, colon, parameter = key.rpartition(":")
            flat = sections[self._section(node) if colon else SHARED]
            # a node of your own, whose class is not known here, refuses what it does not have
            is_open = has_own and node not in NODES if colon else parameter in _NOT_REQUIRED
            if parameter not in flat and not is_open:
                where = f"node '{node}'" if colon else "section '/**'"
                likely, groups = self._likely_keys(key), sorted({re.sub(r"\..*", ".*", name) for name in flat})
                raise ParameterError(
                    f"{self.path}: {where} has no parameter '{parameter}' to set to {value!r}; "
                    + (
                        f"did you mean {likely}?"
                        if likely
                        else f"it has: {', '.join(groups) or 'none'} (write node:parameter for one of a node)"
                    )
                )
            flat[parameter] = shaped_like(flat.get(parameter), value)
        return _made(self.path, sections)

    def _likely_keys(self, key: str) -> str:
        """Parameters that `key` may mean: of this name in another section, or the one that is most like it."""
        keys = {
            name if section == SHARED else f"{section.rpartition('/')[2]}:{name}": name
            for section, names in self.sections.items()
            for name in names
        }
        alike = difflib.get_close_matches(key.rpartition(":")[2], keys.values(), n=1)
        found = sorted(one for one, name in keys.items() if name in alike or one == key.replace(".", ":", 1))
        # a parameter of all nodes is none of this one, so that its name alone would be what was given
        return " or ".join(f"'{one}'" + f" of section '{SHARED}'" * (":" in key and ":" not in one) for one in found)

    def with_sections(self, changes: Mapping[str, Mapping[str, Any]], path: Path | None = None) -> "Configuration":
        """The same configuration with some values replaced, and with sections of further nodes.

        Parameters
        ----------
        changes : flat ``{dotted name: value}`` by section, as `sections`.
        path : of the file that changes them, by default that of this one.

        Raises
        ------
        ParameterError
            if the configuration has no such parameter, or a new section is of no node.
        """
        path = path or self.path
        new = {name: flat for name, flat in changes.items() if name not in self.sections}
        sections = {**new, **self.sections}
        listed = list(map(str, changes.get(SHARED, {}).get("nodes", self.sections[SHARED].get("nodes", []))))
        has_own = any(":" in entry for entry in listed)  # whose name is known once it is imported
        for name in new:
            if not (has_own or name in listed):
                known = ", ".join(section for section in self.sections if section != SHARED)
                raise ParameterError(
                    f"{path}: section '{SHARED}/{name}' belongs to no node in 'nodes'; sections of the {BASE}: {known}"
                )
        if has_own:  # it may have more parameters than a node of the base
            sections |= {name: {**flat, **sections[name]} for name, flat in changes.items() if name != SHARED}
        return _made(path, sections).with_values(
            {
                key if name == SHARED else f"{name}:{key}": value
                for name, flat in changes.items()
                if name in self.sections
                for key, value in flat.items()
            }
        )

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle plain mappings: read-only ones cannot be pickled, and are made read-only again on the other side."""
        return _made, (self.path, {name: dict(flat) for name, flat in self.sections.items()})

    def _section(self, node: str) -> str:
        if node == SHARED or node not in self.sections:
            known = ", ".join(name for name in self.sections if name != SHARED)
            raise ParameterError(f"{self.path}: no section '/**/{node}' for node '{node}'; sections: {known or 'none'}")
        return node

    def _build(self, section: str, cls: type[T]) -> T:
        """Parameters of a section that their class takes, and that fit the arm."""
        try:
            own = build(cls, self.sections[section])
            if section != SHARED:
                require_fit(own, self.shared.arm)
            return own
        except ParameterError as error:
            where = f"section '{SHARED if section == SHARED else f'/**/{section}'}'"
            given = GIVEN if self._file_is_right(section, cls) else self.path
            raise ParameterError(f"{given}, {where}: {error}") from error

    def _file_is_right(self, section: str, cls: type[Any]) -> bool:
        """Whether the file itself has usable parameters, or none, so that what was given besides is at fault."""
        try:
            written = Configuration.load(self.path)
            if section in written.sections and written.sections != self.sections:
                written._build(section, cls)
        except ParameterError:
            return False
        return written.sections != self.sections


def files_of(path: str | Path) -> list[Path]:
    """The files that a configuration is read from: its own, then its base, the base of that and so on.

    Raises
    ------
    ParameterError
        as `Configuration.load`.
    """
    return [one for one, _ in _chain(Path(path))]


def differences(path: Path, loaded: Configuration) -> list[str]:
    """What a file of your own changes in the packaged configuration that it is based on, as lines for people.

    Parameters
    ----------
    path : of the configuration; of a packaged one, or one without a base, there are no lines.
    loaded : from it.
    """
    folders = _present_folders()
    base_file = next((one for one in files_of(path) if one.resolve().parent in folders), path)
    if base_file == path:
        return []
    own, base = loaded.sections, Configuration.load(base_file).sections
    changed = {
        key if section == SHARED else f"{section}:{key}": (base.get(section, {}).get(key), value)
        for section, flat in own.items()
        for key, value in flat.items()
        if base.get(section, {}).get(key) != value
    }
    rows = [row for name, (old, new) in changed.items() for row in _changes(name, old, new)]
    more = [f"  and {len(rows) - FILES.differences} more"] if len(rows) > FILES.differences else []
    lengths = [name for name in LENGTHS if name in changed]
    is_open = lengths and not any(name in changed for name in MASSES)
    question = (
        f"{', '.join(lengths)} changed: does arm.covers.end still fit, and is the link as heavy as before? "
        f"If not, change {', '.join(MASSES)}"
    )
    return [
        f"{path} differs from {base_file.stem}:",
        *rows[: FILES.differences],
        *more,
        *([question] if is_open else []),
    ]


def _changes(name: str, old: Any, new: Any) -> list[str]:
    """A line for a value that has changed; of two lists of one length, a line for each element that has.

    Of a list of nodes, what is gone and what is new.
    """
    is_list = isinstance(old, list) and isinstance(new, list)
    if is_list and name == "nodes" and {*old} != {*new}:
        gone, more = (", ".join(one for one in a if one not in b) for a, b in ((old, new), (new, old)))
        return [f"  {name}: {'; '.join([f'without {gone}'] * bool(gone) + [f'also {more}'] * bool(more))}"]
    if is_list and len(old) == len(new):
        pairs = enumerate(zip(old, new, strict=True))
        return [f"  {name}[{i}]: {one}, now {other}" for i, (one, other) in pairs if one != other]
    change = f"added, {new}" if old is None else f"{old}, now {new}"
    return [f"  {name}: {textwrap.shorten(change, FILES.longest_difference)}"]


def option_values(texts: Iterable[str], option: str = "--set") -> dict[str, Any]:
    """Parameters and values as an option gives them, for `Configuration.with_values`; each '[node:]parameter=value'.

    Raises
    ------
    ParameterError
        where one is none.
    """
    found: dict[str, Any] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not (name.strip() and equals and value.strip()):
            raise ParameterError(
                f"{option} is '{text}'; write [node:]parameter=value, e.g. force_loop:force_gain=[0.01]"
            )
        try:
            parsed = yaml_text.parse(value)
        except yaml.YAMLError as error:
            reason = str(error).partition("\n")[0]
            shown = repr(value if len(value) <= FILES.longest_value else f"{value[: FILES.longest_value]}...")
            raise ParameterError(f"{option} {name.strip()}: {shown} is no value of YAML: {reason}") from error
        first = found.setdefault(name.strip(), parsed)
        if first is not parsed and first != parsed:
            raise ParameterError(f"{option} has {name.strip()} twice, with two values; give one of them")
    return found


def named_file(name: str, kind: str = "configuration", folder: Path = Path()) -> Path:
    """What a name means: a file, relative to a folder, where it ends as one of YAML; else one of the package."""
    return folder / name if name.endswith(YAML) else packaged(name, kind)


def packaged(name: str, kind: str = "configuration") -> Path:
    """The file of a configuration or scenario that comes with the package, as ``packaged('wam')``.

    It is searched next to the packages (source tree), then in ``share/wam_stack/config`` of every folder
    above this file, of the prefixes in AMENT_PREFIX_PATH and of Python's own prefix.

    Raises
    ------
    ParameterError
        if there is none of this name; the message lists those that exist.
    """
    folders = _present_folders()
    for folder in folders:
        if (folder / f"{name}.yaml").is_file():
            return folder / f"{name}.yaml"
    raise ParameterError(
        f"no {kind} '{name}' comes with wam_stack; there are: {', '.join(packaged_names(kind)) or 'none'} "
        f"(looked in {', '.join(map(str, folders)) or 'share/wam_stack/config of every prefix'}); "
        f"give the path of a file of your own"
    )


def packaged_names(kind: str) -> list[str]:
    """Names of the configurations, or of the scenarios, that come with the package."""
    wanted = kind == "scenario"
    files = (path for folder in _present_folders() for path in folder.glob("*.yaml"))
    scenarios = {path: f"\n{SCENARIO_KEY}" in "\n" + path.read_text(encoding="utf-8") for path in files}
    return sorted({path.stem for path, is_scenario in scenarios.items() if is_scenario == wanted})


def _present_folders() -> list[Path]:
    return [folder for folder in dict.fromkeys(_folders()) if folder.is_dir()]


def _folders() -> Iterator[Path]:
    here = Path(__file__).resolve()
    yield here.parents[1] / "config"
    ament = [Path(prefix) for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if prefix]
    for prefix in (*here.parents, *ament, Path(sys.prefix)):
        yield prefix / "share" / "wam_stack" / "config"


def shaped_like(present: Any, value: Any) -> Any:
    """A new value in the place of a present one: in that of a list, a number is each of its values."""
    if isinstance(present, list | tuple) and isinstance(value, int | float) and not isinstance(value, bool):
        return [value] * max(len(present), 1)
    return listed(value)


def _chain(path: Path, above: tuple[Path, ...] = ()) -> list[tuple[Path, Any]]:
    """A file and those that it builds on, its base, the base of that and so on, with their further content."""
    if not path.is_file():
        raise ParameterError(f"configuration {path} is not a file; give the path of a ROS parameter file (YAML)")
    tree = yaml_text.read(path, "configuration")
    if not isinstance(tree, dict) or BASE not in tree:
        return [(path, tree)]
    name, above = tree.pop(BASE), (*above, path.resolve())
    if not isinstance(name, str):
        raise ParameterError(
            f"{path}: {BASE} is {name!r}; give the name of a configuration or a path relative to the file"
        )
    base = named_file(name, folder=path.parent)
    if base.resolve() in above:
        raise ParameterError(f"{path}: {BASE} is the file itself, or one that builds on it; name another configuration")
    return [(path, tree), *_chain(base, above)]


def _sections(path: Path, tree: Any, whole: bool = True) -> Mapping[str, Mapping[str, Any]]:
    """Flat sections of a parameter file; `whole` where it must have the shared one, as its last."""
    keys = list(tree) if isinstance(tree, dict) else []
    if SCENARIO_KEY in keys:
        raise ParameterError(
            f"{path} is a scenario, no configuration; play it with 'wam up --scenario {path}', "
            "or set scenario:script to it"
        )
    if near := [key for key in keys if difflib.get_close_matches(str(key), [BASE])]:
        raise ParameterError(f"{path} has the key '{near[0]}'; did you mean '{BASE}'?")
    if not isinstance(tree, dict) or (whole and SHARED not in keys):
        raise ParameterError(
            f"{path} has no section '{SHARED}'; it needs '{SHARED}: {PARAMETERS}: ...' at its top level, or "
            f"'{BASE}: wam' if it only changes another configuration"
        )
    if whole and keys[-1] != SHARED:
        raise ParameterError(
            f"{path}: section '{keys[-1]}' comes after '{SHARED}'; make '{SHARED}' the last one, "
            "otherwise ROS prefers the file to values given on a command line"
        )
    sections = {}
    for key, body in tree.items():
        name = SHARED if key == SHARED else str(key).removeprefix(SHARED + "/")
        if name == key != SHARED or "/" in name.replace(SHARED, ""):
            raise ParameterError(
                f"{path}: section {key!r} is not allowed; write '{SHARED}' for all nodes or '{SHARED}/<node name>' for "
                "one"
            )
        if not isinstance(body, dict) or list(body) != [PARAMETERS] or not isinstance(body[PARAMETERS], dict):
            raise ParameterError(
                f"{path}: section '{key}' needs '{PARAMETERS}:' with names and values below it, and nothing else"
            )
        sections[name] = given_once(f"{path}: section '{key}'", body[PARAMETERS])
    return sections


def _made(path: Path, sections: Mapping[str, Mapping[str, Any]]) -> Configuration:
    """A configuration of values that cannot be changed in their place."""
    return Configuration(
        path, MappingProxyType({name: MappingProxyType(dict(flat)) for name, flat in sections.items()})
    )


def _is_mixed(value: Any) -> bool:
    """Whether a value is a list of whole and other numbers, which ROS refuses."""
    return isinstance(value, list) and {*map(type, value)} == {int, float}

"""Configurations: one ROS parameter file that holds the values of every node, read without ROS."""

import hashlib
import os
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple, TypeVar

import yaml

from wam_description import yaml_text
from wam_description.arm import Shared
from wam_description.parameters import ParameterError, build, flatten

T = TypeVar("T")
SHARED = "/**"
PARAMETERS = "ros__parameters"


class Configuration(NamedTuple):
    """The values of one parameter file, or of one with some values replaced.

    Attributes
    ----------
    path : where the file lies.
    text : YAML that gives these values; the file's own text where nothing was replaced.
    sections : flat ``{dotted name: value}`` of every section; '/**' is shared, the others are
        named like their node.
    """

    path: Path
    text: str
    sections: Mapping[str, Mapping[str, Any]]

    @classmethod
    def load(cls, path: str | Path) -> "Configuration":
        """Read a ROS parameter file.

        Raises
        ------
        ParameterError
            where the file is missing, is not YAML or is not built like a parameter file.
        """
        path = Path(path)
        if not path.is_file():
            raise ParameterError(f"configuration {path} is not a file; give the path of a ROS parameter file (YAML)")
        try:
            text = path.read_text(encoding="utf-8")
        except UnicodeDecodeError as error:
            raise ParameterError(f"configuration {path} is not a text file: {error}") from error
        return cls(path, text, _sections(path, text))

    @property
    def sha256(self) -> str:
        """Checksum of `text`, hexadecimal."""
        return hashlib.sha256(self.text.encode()).hexdigest()

    @property
    def shared(self) -> Shared:
        """What every node reads, from the section '/**'."""
        return self._build(SHARED, Shared)

    def node(self, name: str, cls: type[T]) -> T:
        """The parameters of one node, from its section '/**/name'."""
        return self._build(self._section(name), cls)

    def with_values(self, values: Mapping[str, Any]) -> "Configuration":
        """The same configuration with some values replaced.

        Parameters
        ----------
        values : ``'timing.mode'`` names a shared parameter, ``'driver:seed'`` one of a node.

        Raises
        ------
        ParameterError
            where the configuration has no such parameter.
        """
        sections = {name: dict(flat) for name, flat in self.sections.items()}
        for key, value in values.items():
            node, colon, parameter = key.rpartition(":")
            flat = sections[self._section(node) if colon else SHARED]
            if parameter not in flat:
                where = f"node '{node}'" if colon else "section '/**'"
                raise ParameterError(
                    f"{self.path}: {where} has no parameter '{parameter}' to set to {value!r}; "
                    f"it has: {', '.join(sorted(flat)) or 'none'} (write node:parameter for one of a node)"
                )
            flat[parameter] = list(value) if isinstance(value, tuple) else value
        return Configuration(self.path, _text(sections), _frozen(sections))

    def __reduce__(self) -> tuple[Any, ...]:
        """Read-only mappings cannot be pickled; other processes get plain ones and make them read-only again."""
        return _thawed, (self.path, self.text, {name: dict(flat) for name, flat in self.sections.items()})

    def _section(self, node: str) -> str:
        if node == SHARED or node not in self.sections:
            known = ", ".join(name for name in self.sections if name != SHARED)
            raise ParameterError(f"{self.path}: no section '/**/{node}' for node '{node}'; sections: {known or 'none'}")
        return node

    def _build(self, section: str, cls: type[T]) -> T:
        try:
            return build(cls, self.sections[section])
        except ParameterError as error:
            where = SHARED if section == SHARED else f"/**/{section}"
            raise ParameterError(f"{self.path}, section '{where}': {error}") from error


def packaged(name: str) -> Path:
    """The file of a configuration that comes with the package, as ``packaged('wam')``.

    Looked for beside the packages (source tree), below ``share/wam_stack/config`` of every folder
    that holds this file, of the prefixes in AMENT_PREFIX_PATH and of Python's own prefix.

    Raises
    ------
    ParameterError
        where there is none of this name; the message lists those that exist.
    """
    folders = [folder for folder in dict.fromkeys(_folders()) if folder.is_dir()]
    for folder in folders:
        if (folder / f"{name}.yaml").is_file():
            return folder / f"{name}.yaml"
    found = sorted({path.stem for folder in folders for path in folder.glob("*.yaml")})
    raise ParameterError(
        f"no configuration '{name}' comes with wam_stack; there are: {', '.join(found) or 'none'} "
        f"(looked in {', '.join(map(str, folders)) or 'share/wam_stack/config of every prefix'}); "
        f"a file of your own is given by its path"
    )


def _folders() -> Iterator[Path]:
    here = Path(__file__).resolve()
    yield here.parents[1] / "config"
    ament = [Path(prefix) for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if prefix]
    for prefix in (*here.parents, *ament, Path(sys.prefix)):
        yield prefix / "share" / "wam_stack" / "config"


def _sections(path: Path, text: str) -> Mapping[str, Mapping[str, Any]]:
    try:
        tree = yaml_text.parse(text)
    except yaml.YAMLError as error:
        raise ParameterError(f"{path} is not YAML: {error}") from error
    if not isinstance(tree, dict) or SHARED not in tree:
        raise ParameterError(f"{path} has no section '{SHARED}'; it needs '{SHARED}: {PARAMETERS}: ...' at its top")
    if list(tree)[-1] != SHARED:
        raise ParameterError(
            f"{path}: section '{list(tree)[-1]}' stands after '{SHARED}'; let '{SHARED}' be the last one, "
            "else ROS lets the file win over what is given on a command line"
        )
    sections = {}
    for key, body in tree.items():
        name = SHARED if key == SHARED else str(key).removeprefix(SHARED + "/")
        if name == key != SHARED or "/" in name.replace(SHARED, ""):
            raise ParameterError(f"{path}: section {key!r} is not allowed; write '{SHARED}' or '{SHARED}/<node name>'")
        if not isinstance(body, dict) or list(body) != [PARAMETERS] or not isinstance(body[PARAMETERS], dict):
            raise ParameterError(
                f"{path}: section '{key}' needs '{PARAMETERS}:' and below it names and values, no more"
            )
        sections[name] = flatten(body[PARAMETERS])
    return _frozen(sections)


def _thawed(path: Path, text: str, sections: Mapping[str, Mapping[str, Any]]) -> Configuration:
    return Configuration(path, text, _frozen(sections))


def _frozen(sections: Mapping[str, Mapping[str, Any]]) -> Mapping[str, Mapping[str, Any]]:
    return MappingProxyType({name: MappingProxyType(dict(flat)) for name, flat in sections.items()})


def _text(sections: Mapping[str, Mapping[str, Any]]) -> str:
    tree = {
        (name if name == SHARED else f"{SHARED}/{name}"): {PARAMETERS: _nested(flat)} for name, flat in sections.items()
    }
    return yaml.safe_dump(tree, sort_keys=False, allow_unicode=True, default_flow_style=None, width=110)


def _nested(flat: Mapping[str, Any]) -> dict[str, Any]:
    tree: dict[str, Any] = {}
    for name, value in flat.items():
        *groups, leaf = name.split(".")
        branch = tree
        for group in groups:
            branch = branch.setdefault(group, {})
        branch[leaf] = value
    return tree

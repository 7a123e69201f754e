"""Live parameters that a step of a scenario sets, checked against their declarations before anything moves."""

from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Any, Final, NamedTuple

from wam_control.task.scenario_values import known, require_list
from wam_description.arm import Shared
from wam_description.configuration import Configuration
from wam_description.interface import Interface
from wam_description.parameters import ParameterError, build, checked, fields, given_once, meant, require, require_fit

NONE: Final[Mapping[str, Any]] = MappingProxyType({})
TUNABLE = ("driver", "force_loop")  # in lockstep they wait for the scenario: a setting takes effect at its own stamp


class Setting(NamedTuple):
    """A live parameter of a node and its new value."""

    node: str
    name: str
    value: float | int | bool | str | tuple[float | int | bool | str, ...]


def settings_of(where: str, body: Any) -> Iterator[Setting]:
    """Those of a step of a file: values by parameter, by node; `where` begins a refusal: file and step."""
    known(where + ", set", body, TUNABLE, ())
    for node, values in body.items():
        require(isinstance(values, Mapping), f"{where}: set, {node} is {values!r}; give names and values")
        for name, value in given_once(f"{where}: set, {node}", values).items():
            yield Setting(node, name, value)


def checked_settings(
    where: str, settings: Sequence[Setting], shared: Shared, controllers: Mapping[str, Any] = NONE
) -> tuple[Setting, ...]:
    """Settings of a step, each of a live parameter of its node, with a value of its type and range.

    Parameters
    ----------
    where : what begins a refusal: file and step.
    settings : of the step.
    shared : lists the nodes.
    controllers : node classes by name that take the place of those in `shared.nodes`, or come on top.

    Raises
    ------
    ParameterError
        names the node, the parameter and what is allowed.
    """
    require_list(where, "settings", settings, "Setting(node, name, value), () for none")
    found: dict[tuple[str, str], Setting] = {}
    for one in settings:
        is_named = isinstance(one, Setting) and isinstance(one.node, str) and isinstance(one.name, str)
        require(is_named, f"{where}: settings has {one!r}; give Setting(node, name, value), node and name as texts")
        node, name, value = one
        known(where + ", set", {node: value}, TUNABLE, ())
        live = {field.name: field for field in fields(_parameter_class(where, node, shared, controllers)) if field.live}
        has = meant(name, live).strip() or f"it has: {', '.join(sorted(live)) or 'none'}"
        require(
            name in live, f"{where}: set, {node}: it has no parameter '{name}' that may change while it runs; {has}"
        )
        require((node, name) not in found, f"{where}: set, {node}: '{name}' is given twice; remove one")
        try:
            found[node, name] = Setting(node, name, checked(live[name], value))
        except ParameterError as error:
            raise ParameterError(f"{where}: set, {node}: {error}") from None
    return tuple(found.values())


def require_settings(
    where: str,
    settings: Sequence[Sequence[Setting]],
    configuration: Configuration,
    controllers: Mapping[str, Any] = NONE,
) -> None:
    """Refuse settings, those of each step, that do not fit the other values that their node has by then.

    What a class of parameters refuses itself is refused, and what does not fit the arm.

    Raises
    ------
    ParameterError
        names the step, the node and the value.
    """
    shared = configuration.shared
    sections: dict[str, dict[str, Any]] = {}
    for i, of_step in enumerate(settings):
        for setting in of_step:
            present = sections.setdefault(setting.node, dict(configuration.sections.get(setting.node, {})))
            present[setting.name] = setting.value
        for node in dict.fromkeys(setting.node for setting in of_step):
            try:
                own = build(_parameter_class(where, node, shared, controllers), sections[node])
                require_fit(own, shared.arm)
            except ParameterError as error:
                raise ParameterError(f"{where}, step {i + 1}: set, {node}: {error}") from None


def _parameter_class(where: str, node: str, shared: Shared, controllers: Mapping[str, Any]) -> Any:
    """Of the node of this name: that of the package, or one of your own."""
    found = Interface(shared, dict(controllers)).declarations.get(node)
    if found is None:
        raise ParameterError(f"{where}: set, {node}: no node is named so; nodes: {', '.join(shared.nodes)}")
    return found.parameter_class

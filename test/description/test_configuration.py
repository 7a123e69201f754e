"""Configurations read from parameter files without ROS."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import yaml

from wam_control.task.scenario_values import number
from wam_description import yaml_text
from wam_description.configuration import Configuration, differences, option_values, packaged
from wam_description.parameters import ParameterError, build, parameter
from wam_sim.simulation import Simulation

WAM = Configuration.load(packaged("wam"))


@dataclass(frozen=True)
class Loop:
    """Parameters of a node in these tests."""

    gain: float = parameter("gain", low=0.0)
    names: tuple[str, ...] = parameter("names")


LOOP = "/**/loop:\n  ros__parameters:\n    gain: 2.5\n    names: [a, b]\n"


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """The WAM's configuration with one more node."""
    path = tmp_path / "mine.yaml"
    path.write_text(LOOP + packaged("wam").read_text())
    return path


def test_lists_of_whole_and_other_numbers_become_what_ros_reads(file: Path, tmp_path: Path) -> None:
    overlay = tmp_path / "overlay.yaml"
    overlay.write_text("base: mine.yaml\n/**: {ros__parameters: {arm.gravity: [0, 0.5, -9]}}\n")
    whole = tmp_path / "whole.yaml"
    whole.write_text(file.read_text().replace("gravity: [0.0, 0.0, -9.80665]", "gravity: [0, 0.5, -9]"))
    set_later = Configuration.load(file).with_values({"arm.gravity": [0, 0.5, -9]})
    for configuration in (Configuration.load(overlay), Configuration.load(whole), set_later):
        written = yaml.safe_load(configuration.text)["/**"]["ros__parameters"]["arm"]["gravity"]
        assert [repr(value) for value in written] == ["0.0", "0.5", "-9.0"]
        assert configuration.shared.arm.gravity == (0.0, 0.5, -9.0)
    twice = [0.0, 0.0, -2.0]
    assert "&id" not in Configuration.load(file).with_values({"arm.gravity": twice, "arm.tool": twice}).text


@pytest.mark.slow
def test_replaced_values_leave_the_original_alone(file: Path) -> None:
    original = Configuration.load(file)
    changed = original.with_values({"timing.mode": "realtime", "loop:gain": 3.0, "loop:names": ("c",)})
    assert changed.shared.timing.mode == "realtime"
    assert changed.node("loop", Loop) == Loop(3.0, ("c",))
    assert original.shared.timing.mode == "lockstep"
    assert original.node("loop", Loop).gain == 2.5
    assert changed.text != original.text
    assert changed.path == original.path


def test_a_number_in_place_of_a_list_is_each_of_its_values() -> None:
    changed = WAM.with_values(
        {"force_loop:force_gain": 0.01, "arm.tool": 0.5, "force_loop:guard.stability_fraction": 1}
    )
    assert changed.sections["force_loop"]["force_gain"] == [0.01]
    assert changed.sections["/**"]["arm.tool"] == [0.5] * 3
    assert changed.sections["force_loop"]["guard.stability_fraction"] == 1
    assert WAM.with_values({"force_loop:force_gain": "abc"}).sections["force_loop"]["force_gain"] == "abc"


def test_a_node_of_your_own_may_have_more_parameters_than_the_file() -> None:
    own = WAM.with_sections({"/**": {"nodes": ["driver", "mine:Own"]}, "own": {"gain": 1.0}})
    assert own.with_values({"own:optional": 2.0}).sections["own"] == {"gain": 1.0, "optional": 2.0}
    with pytest.raises(ParameterError, match="node 'driver' has no parameter 'sed'"):
        own.with_values({"driver:sed": 2})


def test_sections_cannot_be_written(file: Path) -> None:
    with pytest.raises(TypeError):
        Configuration.load(file).sections["loop"]["gain"] = 1.0  # type: ignore[index]


@pytest.mark.parametrize(("key", "message"), [
    ("timing.mod", r"section '/\*\*' has no parameter 'timing.mod' to set to 1; did you mean 'timing.mode'"),
    ("loop:gian", r"mine\.yaml: node 'loop' has no parameter 'gian' to set to 1; did you mean 'loop:gain'"),
    ("lop:gain", r"mine\.yaml: no section '/\*\*/lop' for node 'lop'; sections: .*loop"),
])  # fmt: skip
def test_unknown_key_is_refused_by_name(file: Path, key: str, message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        Configuration.load(file).with_values({key: 1})


@pytest.mark.parametrize(("text", "message"), [
    ("a: [1,", "is not YAML"),
    ("/**: !!map x", "is not YAML: one of its values cannot be read"),
    ("/**:\n  ros__parameters:\n    1: 2", "is not YAML: the key 1 is no text; write it in quotes.*\n.*line 3"),
    (
        "/**:\n  ros__parameters:\n    a: &a [*a]",
        r"is not YAML: \*a is inside of what it refers to.*\n  in \".*\.yaml\", line 3",
    ),
    ("/**:\n  ros__parameters:\n    a.b: 1\n    a: {b: 2}", "'a.b' is given twice, with dots and without"),
    ("/**:\n  ros__parameters:\n    a: {b: {}, c: 1}", "section '/.*': 'a.b' is empty; give it a value, or leave it"),
    ("/**:\n  ros__parameters:\n    a: {b: 1, b: 2}", "'b' is given twice; remove one of the two.*\n.*line 3"),
    ("", r"has no section '/\*\*'"),
    ("/**/driver: {ros__parameters: {}}", r"has no section '/\*\*'"),
    ("bsae: wam", r"has the key 'bsae'; did you mean 'base'\?"),
    ("steps: []", r"is a scenario, no configuration; play it with 'wam up --scenario /.*/odd\.yaml'"),
    ("/**: {parameters: {}}", r"section '/\*\*' needs 'ros__parameters:'"),
    ("/**: {ros__parameters: 3}", r"section '/\*\*' needs 'ros__parameters:'"),
    ("driver: {ros__parameters: {}}\n/**: {ros__parameters: {}}", r"section 'driver' is not allowed; write"),
    ("/**/a/b: {ros__parameters: {}}\n/**: {ros__parameters: {}}", r"section '/\*\*/a/b' is not allowed; write"),
    ("base: wam\n/**/driver: {ros__parameters: {watchdgo: 1}}\n", "node 'driver' has no parameter 'watchdgo'"),
    ("base: odd.yaml\n", "base is the file itself"),
    ("base: wam\n/**/drivr: {ros__parameters: {a: 2}}\n", r"section '/\*\*/drivr' belongs to no node in 'nodes'"),
    (packaged("wam").read_text() + LOOP, r"section '/\*\*/loop' comes after '/\*\*'"),  # it would win over -p
    ("base: wam\n/**: {ros__parameters: {timin: {}}}\n", r"section '/\*\*': 'timin' is empty; give it a value"),
    ("base: [wam]\n", r"base is \['wam'\]; give the name of a configuration"),
])  # fmt: skip
def test_file_that_is_no_configuration_is_refused_by_name(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "odd.yaml"
    path.write_text(text)
    with pytest.raises(ParameterError, match=rf"odd\.yaml.*{message}"):
        Configuration.load(path)


def test_a_value_of_the_file_is_blamed_on_it(tmp_path: Path) -> None:
    path = tmp_path / "odd.yaml"
    path.write_text("base: wam\n/**: {ros__parameters: {timing: {real_time_factor: -3.0}}}\n")
    with pytest.raises(ParameterError, match=rf"^{path}, section"):
        Configuration.load(path).with_values({"timing.timeout": 3.0}).shared  # noqa: B018 - it is built here


def test_misspelt_parameter_is_refused_with_file_section_and_name(file: Path) -> None:
    file.write_text(file.read_text().replace("gain:", "gian:").replace("period:", "perod:"))
    configuration = Configuration.load(file)
    with pytest.raises(ParameterError, match=r"mine\.yaml, section '/\*\*/loop': missing .*'gain'.*unknown .*'gian'"):
        configuration.node("loop", Loop)
    with pytest.raises(ParameterError, match=r"mine\.yaml, section '/\*\*': missing parameter 'timing.period'"):
        _ = configuration.shared
    with pytest.raises(ParameterError, match="no section"):
        configuration.node("pool", Loop)


def test_unknown_packaged_configuration_is_refused_with_those_that_exist() -> None:
    assert packaged("wam").name == "wam.yaml"
    with pytest.raises(ParameterError, match=r"none\.yaml is not a file"):
        Configuration.load("none.yaml")
    with pytest.raises(ParameterError, match=r"no configuration 'wum' comes with wam_stack; there are: .*wam"):
        packaged("wum")


def test_an_overlay_changes_values_and_adds_sections(tmp_path: Path) -> None:
    overlay = tmp_path / "mine.yaml"
    overlay.write_text(
        "base: wam\n/**/mine: {ros__parameters: {gain: 2.0}}\n/**/driver: {ros__parameters: {watchdog: 0.03}}\n"
        "/**: {ros__parameters: {timing: {mode: realtime}, nodes: [driver, 'my_package.mine:Mine']}}\n"
    )
    found, base = Configuration.load(overlay), Configuration.load(packaged("wam"))
    assert found.sections["mine"] == {"gain": 2.0}
    assert found.sections["driver"] == {**base.sections["driver"], "watchdog": 0.03}
    assert found.shared.timing.mode == "realtime"
    assert yaml.safe_load(found.text)["/**/driver"]["ros__parameters"]["watchdog"] == 0.03
    assert list(found.sections)[-1] == "/**", "the shared section is the last one, else it would win over -p"
    other = tmp_path / "other.yaml"
    other.write_text("base: mine.yaml\n/**/mine: {ros__parameters: {gain: 3.0}}\n")
    assert Configuration.load(other).sections["mine"] == {"gain": 3.0}


def test_a_misspelt_section_next_to_a_node_of_ones_own_is_refused(tmp_path: Path) -> None:
    path, message = tmp_path / "mine.yaml", r"section '/\*\*/force_lop' belongs to no node.*did you mean 'force_loop'"
    path.write_text(
        "base: wam\n/**/force_lop: {ros__parameters: {force_limit: 5.0}}\n"
        "/**: {ros__parameters: {nodes: [driver, transform, 'wam_control.velocity.gravity_node:GravityNode']}}\n"
    )
    found = Configuration.load(path)
    with pytest.raises(ParameterError, match=message):
        Simulation(found, [])


def test_the_section_of_a_node_without_parameters_is_empty(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text("base: wam\n/**/gravity: {ros__parameters: {}}\n/**: {ros__parameters: {}}\n")
    assert Configuration.load(path).sections == WAM.sections


IN_PLACE = "a value that you set, section '/**': "


@pytest.mark.parametrize(("values", "message"), [
    ({"nodes": []}, f"{IN_PLACE}parameter 'nodes' is empty; list the nodes to start, for example"),
    ({"timing.real_time_factor": 9e-4}, "timing.real_time_factor is 0.0009; allowed: 0.001 to 100, or 0 for"),
    ({"timing.outer_divisor": 36, "ages.feedback": 0.035}, "ages.feedback is 0.035 s, less than an outer period"),
    ({"arm.tool": [0.3, 0.0, 0.0]}, "outer_link ends at (0.4064, 0, 0) m"),
    ({"arm.covers.length": [0.5588, 0.5]}, "but arm.tool is at (0.4064, 0, 0) m"),
    ({"arm.covers.length": [0.6, 0.4064]}, "but joint4 is at (0, 0, 0) m"),
    ({"arm.covers.end": [0.5588, 0.0, 0.0, 0.5, 0.0, 0.0]}, "arm.covers.start and end reach up to 0.5 m"),
    ({"arm.joints.offset": [0.0, 0.0, 0.7, 0.0]}, "allowed: (0, 0, 0), or (0, 0, -0.7), where joint3 begins"),
])  # fmt: skip
def test_values_that_do_not_fit_each_other_are_refused_with_the_others_to_change(
    values: dict[str, Any], message: str
) -> None:
    with pytest.raises(ParameterError) as refused:
        _ = WAM.with_values(values).shared
    assert message in str(refused.value)
    assert ("to change the length of " in str(refused.value)) == next(iter(values)).startswith("arm.")


def test_values_at_their_bounds_a_longer_link_whose_numbers_meet_and_a_tool_beyond_it_are_accepted() -> None:
    assert WAM.with_values({"timing.real_time_factor": 0.001, "ages.feedback": 0.005}).shared.ages.feedback == 0.005
    longer = {"arm.covers.length": [0.5588, 0.5], "arm.covers.end": [0.5588, 0.0, 0.04064, 0.5, 0.0, 0.0]}
    assert WAM.with_values({**longer, "arm.tool": [0.6, 0.0, 0.0]}).shared.arm.covers.length == (0.5588, 0.5)


@pytest.mark.parametrize(("value", "reason"), [
    ("{a: 1, a: 2}", "'a' is given twice; remove one of the two"),
    ("[" * 3000, "nested more than 50 levels deep"),
    ("2001-99-99", "one of its values cannot be read: month must be in 1..12"),
    ("9" * 5000, "one of its values cannot be read"),
    ("0x" + "f" * 5000, "a number of 5002 digits is beyond every float"),
    ("\udcff", "cannot be read: .utf-8. codec"),
    ("&a [*a]", r"\*a is inside of what it refers to"),
    ("010", "010 is 8 in YAML; write that number, or a text in quotes"),
    ("[1.0, 1:30]", "1:30 is 90 in YAML"),
])  # fmt: skip
def test_an_odd_value_of_an_option_is_refused_with_its_name_as_in_a_file(value: str, reason: str) -> None:
    with pytest.raises(ParameterError, match=rf"--set loop:gain: '.*' is no value of YAML: .*{reason}") as refusal:
        option_values([f"loop:gain={value}"])
    assert len(str(refusal.value)) < 300


@pytest.mark.parametrize(("value", "hint"), [
    ("1e-3", "; YAML reads '1e-3' as a text: write 0.001"),
    (".5e3", "; YAML reads '.5e3' as a text: write 500"),
    ("'4'", "; YAML reads '4' as a text: write 4"),
    ("fast", ""),
    ("nan", ""),
])  # fmt: skip
def test_a_text_that_looks_like_a_number_is_refused_with_what_to_write(value: str, hint: str) -> None:
    read = option_values([f"gain={value}"])["gain"]
    with pytest.raises(ParameterError) as refusal:
        build(Loop, {"gain": read, "names": ["a"]})
    assert str(refusal.value) == f"parameter 'gain' is {read!r}; allowed: a number{hint}"
    if hint:
        written = option_values([f"gain={hint.rpartition(' ')[2]}"])["gain"]
        assert build(Loop, {"gain": written, "names": ["a"]}).gain == float(read)
    with pytest.raises(ParameterError) as refusal:
        number("step 1", "seconds", read)
    assert str(refusal.value) == f"step 1: seconds is {read!r}; it must be a finite number{hint}"


@pytest.mark.parametrize("value", [{}, {"a": 1}, {"a"}, b"a", bytearray(b"a"), memoryview(b"a"), "a"])
def test_what_is_no_list_is_none_for_a_parameter_either(value: Any) -> None:
    with pytest.raises(ParameterError, match=r"parameter 'names' is .*; it must be a list of str"):
        build(Loop, {"gain": 1.0, "names": value})


@pytest.mark.parametrize(("text", "value"), [
    ("07", 7), ("0", 0), ("-00", 0), ("0x10", 16), ("1_000", 1000), ("-8", -8), ("True", True), ("null", None),
    *((word, word) for word in ("on", "off", "Yes", "no", "Off")),
])  # fmt: skip
def test_other_numbers_of_yaml_are_read_and_only_true_and_false_are_no_texts(text: str, value: object) -> None:
    assert option_values([f"a={text}"]) == {"a": value}
    assert yaml.safe_load(yaml_text.dump(value)) == value  # as ROS reads it


def test_a_node_that_is_listed_already_is_not_added_again() -> None:
    listed = Configuration.load(packaged("wam")).with_nodes("scenario", "recorder")
    assert listed.shared.nodes[-2:] == ("scenario", "recorder")
    assert listed.with_nodes("recorder", "scenario").shared.nodes == listed.shared.nodes


LONGER = "covers: {length: [0.5588, 0.5]}, tool: [0.5, 0.0, 0.0]"


@pytest.mark.parametrize(
    ("arm", "is_open"), [(LONGER, True), (f"{LONGER}, links: {{mass: [7.68, 3.59, 1.95, 1.2]}}", False)]
)
def test_a_file_shows_what_it_changes_and_asks_about_the_mass_of_a_longer_link(
    arm: str, is_open: bool, tmp_path: Path
) -> None:
    file = tmp_path / "mine.yaml"
    nodes = [name.replace("gravity", "scenario") for name in Configuration.load(packaged("wam")).shared.nodes]
    file.write_text(f"base: wam\n/**: {{ros__parameters: {{arm: {{{arm}}}, nodes: {nodes}}}}}\n")
    lines = differences(file, Configuration.load(file))
    assert lines[0] == f"{file} differs from wam:"
    assert {"  arm.covers.length[1]: 0.4064, now 0.5", "  arm.tool[0]: 0.4064, now 0.5"} <= set(lines)
    assert "  nodes: without gravity; also scenario" in lines
    assert ("as heavy as before?" in lines[-1]) == is_open
    for name in ("wam", "barrett-wam7"):
        assert differences(packaged(name), Configuration.load(packaged(name))) == []

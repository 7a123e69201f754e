"""Tables as recordings: CSV files and maps of columns, with the times and units that they have."""

import csv
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import zip_longest
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from wam_analysis.foreign.clocks import dates, joined_times, nanoseconds
from wam_analysis.foreign.reading import checked
from wam_analysis.foreign.topic_map import COMMAND, COMMANDED, QUANTITIES, UNITS, TopicMap, unit_of
from wam_analysis.thresholds import STREAM
from wam_bag.arrays import Mask, Numbers, Times
from wam_bag.bag import Bag, BagError, JointColumns, WrenchColumns
from wam_bag.columns import JOINT_FIELDS, joint_names

TITLE = re.compile(r"[#\s]*(.*?)\s*(?:[\[(](?!\d+[\])])(.*)[\])]\s*)?")  # and the unit behind it; q[0] has none
ABOVE = re.compile(r"#|sep=")  # begins a line above the titles
DELIMITERS = " ,;\t|"  # blanks, if the titles have none of the others
NO_NUMBER = ("", "nan", "na", "n/a", "null", "none", "-")  # cells of what was not recorded
COMMANDS = f"Columns of commands have the titles {COMMANDED}position.JOINT, {COMMANDED}force.x and so on"
UNUSED = "unused column"  # in place of the type of a topic
RENAMED = (
    f"position.JOINT, velocity.JOINT, effort.JOINT, force.x to torque.z, a command {COMMANDED}position.JOINT; for a "
    "single joint, give --map position=COLUMN instead"
)
TIMES = ("t", "timestamp")  # titles of a time that has no column 'time'
WRENCH = ("force", "torque")  # quantities along x, y and z


def series_of_csv(path: Path) -> dict[str, tuple[str, ...]]:
    """Columns of a CSV file, as text, by their titles; the delimiter is the one that the titles have.

    Raises
    ------
    BagError
        if it cannot be opened, has no row, or one with more cells than titles, as where decimal commas divide numbers.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as stream:
            lines = [line for line in stream if line.strip()]
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", "") or f"{error}; save it as text in UTF-8"
        raise BagError(f"{path} cannot be read: {reason}") from error
    while len(lines) > 1 and ABOVE.match(lines[0]) and not lines[1].lstrip(' "+-.')[:1].isdigit():
        del lines[0]  # a comment above the titles, which may begin with '#', too, or what names the delimiter
    if len(lines) < 2:
        raise BagError(f"{path} has no row below the names of its columns")
    delimiter = max(DELIMITERS, key=lines[0].replace(" ", "").count)
    try:  # line by line, so that a quote that is not closed ends with its row
        head, *rows = [next(csv.reader([line], delimiter=delimiter, skipinitialspace=True)) for line in lines]
    except csv.Error as error:
        raise BagError(f"{path} is no table: {error}") from error
    if wide := next((row for row in rows if any(map(str.strip, row[len(head) :]))), None):
        raise BagError(
            f"{path} has a row of {len(wide)} cells below {len(head)} titles, its first line; remove the lines "
            "above the titles, or separate cells by ';' or tabs"
        )
    if not math.isnan(_number(head[0])):
        raise BagError(f"{path} has numbers in its first row; put the titles of the columns above them")
    if not any(map(str.isdecimal, "".join(rows[0]))):
        units, *rows = rows  # below the titles
        head = [
            f"{title} [{unit.strip()}]" if unit.strip() else title for title, unit in zip(head, units, strict=False)
        ]
    _require_once(path, head)
    return dict(zip(head, zip_longest(*rows, fillvalue=""), strict=False))


def series_of_frame(table: Any) -> Mapping[str, Any]:
    """Columns of a DataFrame with its index, the time if that is of dates without a name, of a map, or named fields."""
    if isinstance(table, np.ndarray) and table.dtype.names:
        return {name: table[name] for name in table.dtype.names}
    if isinstance(table, Mapping):
        return table
    if not hasattr(table, "reset_index"):
        raise BagError(f"{type(table).__name__} is no table; give columns by title: a DataFrame, or a dict of arrays")
    is_time = table.index.name is None and table.index.dtype.kind in "mM" and "time" not in table
    table = (table.rename_axis("time") if is_time else table).reset_index()
    return table.set_axis([".".join(map(str, np.atleast_1d(one))).strip(".") for one in table], axis=1)


def table_bag(path: Path, series: Mapping[str, Any], given: TopicMap) -> tuple[Bag, TopicMap]:
    """A recording of a table with 'time', s, and columns as position.JOINT, velocity.JOINT, effort.JOINT or force.x.

    Commands are in columns as command.position.JOINT or command.force.x.

    Parameters
    ----------
    series : columns by title, (k,), such as a DataFrame; a map gives other titles of a quantity, and of the time as its
        stamp.  A title may end in a unit, as 'time [ms]'.

    Returns
    -------
    tuple
        the recording, and the map with the units that the titles have.

    Raises
    ------
    BagError
        if it has no time, no column that is named, nothing that can be analysed, or a title twice.
    ValueError
        if a topic or a field of names is given, or a joint that it has not.
    """
    if given.topics or given.commands or given.fields.keys() - QUANTITIES:
        raise ValueError(f"{path} is a table: leave out --topic, --command and --map of names or commands. {COMMANDS}")
    _require_once(path, [*map(str, series)])
    given = _with_time(series, given)
    units = dict(given.units)
    found = {quantity: _columns(series, quantity, given) for quantity in QUANTITIES}
    found |= {quantity: [one for one in found[quantity] if one.name in tuple("xyz")] for quantity in WRENCH}
    found["stamp"] = [one for one in found["stamp"] if not one.name]
    title = given.fields.get("stamp", "time")
    for quantity, wanted in {"stamp": title, **given.fields}.items():
        if not found[quantity]:
            raise BagError(
                f"{path} has no column '{wanted}{'.x' * (quantity in WRENCH)}'; name that of {quantity} with "
                f"--map {quantity}=COLUMN: {', '.join(map(str, series))}"
            )
    every = [one for columns in found.values() for one in columns]
    used = {one.title for one in every} | {"index", *title.split(",")}  # a data frame has an index
    for quantity in (*JOINT_FIELDS, *WRENCH):
        if any(one.has_unit for one in found[quantity]):
            units[quantity] = found[quantity][0][:2]
    clock = found["stamp"][0]
    given = given._replace(units=units | ({"stamp": clock[:2]} if clock.has_unit else {}))
    times, known = _times(f"{path}: the column '{title}'", clock.values, given)
    _require_one_run(path, times, series)
    for one in every:
        if (number := np.size(one.values)) != len(known):
            raise BagError(
                f"column '{one.title}' has {number} numbers for {len(known)} times; it needs one for each time"
            )
    topics: dict[str, Any] = {}
    for is_command, suffix in ((False, ""), (True, "_command")):
        parts = {q: {one.name: one for one in columns if one.is_command is is_command} for q, columns in found.items()}
        topics |= {f"{name}{suffix}": one for name, one in _topics(parts, times, known, given)}
    if not topics:
        raise BagError(f"{path} has the columns {', '.join(map(str, series))}; rename those that you need: {RENAMED}")
    types = {topic: COMMAND if topic.endswith("_command") else "table" for topic in topics}
    types |= {str(one): UNUSED for one in series if str(one) not in used and str(one).strip()}
    return checked(Bag(path, topics, types, {}, {}, dict.fromkeys(topics, len(times))), given), given


def _with_time(series: Mapping[str, Any], given: TopicMap) -> TopicMap:
    """The map with the title of the time: without a column 'time', of the only one with its title or unit."""
    if "stamp" in given.fields or _columns(series, "stamp", given):
        return given
    titles = map(_split, map(str, series))
    timed = [name for name, unit in titles if name.lower() in TIMES or UNITS.get(unit, ("", ""))[1] == "s"]
    return given._replace(fields={**given.fields, "stamp": timed[0]}) if len(timed) == 1 else given


def _topics(
    parts: Mapping[str, Mapping[str, "_Column"]], times: Times, known: Mask, given: TopicMap
) -> Iterator[tuple[str, JointColumns | WrenchColumns]]:
    """The joints and the wrench of some columns by quantity and name, at their times."""
    nothing = np.full(len(times), "", object)

    def stacked(quantity: str, names: Iterable[str]) -> Numbers:
        blank = np.full(len(known), np.nan)
        own = parts[quantity]
        return np.column_stack([own[n].numbers if n in own else blank for n in names])[known]

    if joints := tuple(dict.fromkeys(name for q in JOINT_FIELDS for name in parts[q])):
        mapped = [_split(given.fields[q])[0] for q in JOINT_FIELDS if q in given.fields]
        alone = given.joints[0] if len(given.joints) == 1 else next(iter(mapped), "")
        names = joint_names([name or alone for name in joints], 0)
        p, v, e = (stacked(q, joints) for q in JOINT_FIELDS)
        yield "joints", JointColumns(times, times, nothing, names, p, v, e)
    if parts["force"] or parts["torque"]:
        yield "wrench", WrenchColumns(times, times, nothing, *(stacked(q, "xyz") for q in WRENCH))


def _require_one_run(path: Path, times: Times, series: Mapping[str, Any]) -> None:
    """Refuse a table whose time is constant or begins again; rows that are only in another order are put in order.

    Refused, too, is one with several rows at each time, which a column distinguishes, as by the name of a joint.
    """
    if len(times) > 1 and not np.ptp(times):
        raise BagError(
            f"{path}: the time is the same in all {len(times)} rows; name its column with --map stamp=COLUMN"
        )
    steps = np.diff(times)
    behind = np.maximum.accumulate(times) - times > STREAM.filled * np.median(np.abs(steps)) if len(steps) else steps
    back = np.count_nonzero(steps < -STREAM.reset)
    is_run = np.count_nonzero(behind) >= STREAM.near and np.mean(steps >= 0) >= STREAM.evenly
    if is_run or 0 < back <= STREAM.repeated * len(times):
        row = int(np.argmin(steps)) + 1
        raise BagError(
            f"{path}: after {row} rows the time goes back by {-steps[row - 1] / 1e9:.4g} s, as where a second "
            "recording begins; give each by itself"
        )
    rows = times.tolist()
    instants = len({*rows})
    for title, column in series.items() if instants < len(rows) else ():
        names = [*map(str, np.ravel(column))]
        is_even = len(rows) >= STREAM.evenly * instants * len({*names})
        if is_even and len({*zip(rows, names, strict=False)}) == len(rows):
            raise BagError(f"{path} has several rows at each time, by '{title}'; give each its own columns or table")


def _require_once(path: Path, titles: Sequence[str]) -> None:
    """Refuse a table in which two columns have one title."""
    if twice := [one for i, one in enumerate(titles) if one.strip() and one in titles[:i]]:
        raise BagError(f"{path} has two columns '{twice[0]}'; give each a title of its own")


class _Column(NamedTuple):
    """A column of a quantity.

    Attributes
    ----------
    factor, shown, has_unit : factor and shown unit, and whether its title has them.
    name : joint or axis in its title, '' for none.
    is_command : whether it was commanded.
    title, values : its title, and its cells.
    """

    factor: float
    shown: str
    has_unit: bool
    name: str
    is_command: bool
    title: str
    values: Any

    @property
    def numbers(self) -> Numbers:
        """Its numbers in the unit that is shown."""
        try:
            return self.factor * _numbers(self.values)
        except BagError as error:
            raise BagError(f"column '{self.title}': {error}") from None


def _columns(series: Mapping[str, Any], quantity: str, given: TopicMap) -> list[_Column]:
    """The columns of a quantity: those whose title is its own, or begins with it and a dot.

    Raises
    ------
    ValueError
        if they are in units of different kinds.
    """
    wanted, _ = _split(given.fields.get(quantity, "time" if quantity == "stamp" else quantity))
    parts = wanted.split(",")
    if quantity == "stamp" and len(parts) == 2 and all(part in series for part in parts):
        numbers = (_Column(1.0, "s", False, "", False, part, series[part]).numbers for part in parts)
        return [_Column(*UNITS["ns"], True, "", False, wanted, joined_times(*numbers))]
    found = []
    for title in series:
        whole, unit = _split(str(title))
        name = whole.removeprefix(COMMANDED)
        begin = name[: len(wanted)]
        if wanted == (begin if quantity in given.fields else begin.lower()) and name[len(wanted) :][:1] in ("", "."):
            is_given = quantity in given.units
            factor, shown = given.scaled(quantity) if is_given or not unit else unit_of(quantity, unit)
            titled = unit_of(quantity, unit) if is_given and unit in UNITS else (factor, shown)
            is_constant = titled == UNITS["A"] and (factor, shown) not in UNITS.values()  # N m per A
            if titled != (factor, shown) and not is_constant:
                raise ValueError(
                    f"'{title}' has the unit {unit}, and --unit gives another one for {quantity}; leave out --unit, or "
                    "take the unit out of the title"
                )
            has_unit = bool(unit) and not is_given
            own = name[len(wanted) + 1 :]
            found.append(_Column(factor, shown, has_unit, own, name != whole, str(title), series[title]))
    if len(shown_in := dict.fromkeys(one.shown for one in found)) > 1:
        raise ValueError(f"the columns of {quantity} are in {' and in '.join(shown_in)}; leave out those of one unit")
    return found


def _split(title: str) -> tuple[str, str]:
    """A title without its unit, and the unit, '' for none."""
    match = TITLE.fullmatch(title)
    return (match[1], match[2] or "") if match else (title, "")


def _numbers(column: Any) -> Numbers:
    """The numbers of a column, also with a decimal comma and separators of thousands; NaN where there is none.

    Raises
    ------
    BagError
        if a cell has something else.
    """
    try:
        cells = np.asarray(column) if isinstance(column, (list, tuple)) else column  # numpy.ma looks at each of these
        return np.ma.filled(np.ma.asarray(cells, np.float64), np.nan).ravel()
    except (TypeError, ValueError):
        texts = [str(one).strip() for one in column]
    last = next((one for one in texts if "," in one and "." in one), "")
    of_thousands = "." if last.rfind(",") > last.rfind(".") else "," * bool(last)
    found = [_number(one.replace(of_thousands, "")) for one in texts]
    for text, number in zip(texts, found, strict=True):
        if math.isnan(number) and text.lower() not in NO_NUMBER:
            raise BagError(f"a cell has '{text}', which is no number; leave it empty, or give each number its column")
    return np.array(found)


def _number(text: str) -> float:
    try:
        return float(text.replace(",", "."))
    except ValueError:
        return np.nan


def _times(label: str, column: Any, given: TopicMap) -> tuple[Times, Mask]:
    """Times of the rows that have one, ns, and which these are: of numbers, or of dates."""
    times = np.asarray(column)
    if times.dtype.kind in "mM":
        known = ~np.isnat(times)
        return times[known].astype(f"{times.dtype.kind}8[ns]").astype(np.int64), known
    try:
        numbers = _numbers(column)
    except BagError as error:
        try:
            return _times(label, dates(column), given)
        except ValueError:
            raise BagError(f"{label}: {error}; dates are read as 2026-05-01T12:00:00.5") from None
    known = np.isfinite(numbers)
    if not np.any(known):
        raise BagError(f"{label} has no times")
    return nanoseconds(label, numbers[known], given), known

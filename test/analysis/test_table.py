"""Tables of text."""

from wam_analysis.table import markdown, plain

ROWS = [("a", "1.5", "N"), ("a long name of a row", "12.25", "N m")]


def test_columns_are_as_wide_as_they_need_and_aligned() -> None:
    assert plain([("", "value", "unit")], ROWS, left=(0, 2)) == [
        "                      value  unit",
        "a                       1.5  N",
        "a long name of a row  12.25  N m",
    ]


def test_a_long_first_column_is_wrapped() -> None:
    assert plain([("", "value", "")], ROWS, first=11, least=7) == [
        "               value",
        "a                1.5        N",
        "a long name    12.25      N m",
        "  of a row",
    ]


def test_markdown_keeps_bars_and_line_ends_out_of_its_cells() -> None:
    assert markdown(("force", "text"), [("|F|", "a\nb")]) == "| force | text |\n| --- | --- |\n| \\|F\\| | a b |\n"

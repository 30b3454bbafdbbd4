"""The one reader of tables, behind every command that takes codes or readings."""

from pathlib import Path

import numpy as np
import pytest

from spectral_core.display.measuring.tables import COLOURS, parse_table, unit_codes
from spectral_core.errors import DisplayError

HERE = Path("readings.csv")


def test_delimiters_comments_and_blank_lines() -> None:
    table = parse_table("# by hand\nR; G ;B\n\n1;0,5;2\n#\n3; 4 ;5\n", HERE, "")
    assert table.header == ("R", "G", "B")
    assert table.rows == (("1", "0,5", "2"), ("3", "4", "5"))
    assert [table.where(row) for row in (0, 1)] == ["readings.csv, line 4", "readings.csv, line 6"]
    with pytest.raises(DisplayError, match=r"line 4: '0,5' is no finite number"):
        table.numbers(("R", "G"))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "holds no rows"),
        ("X,Y,Z\n", "holds no rows"),
        ("X,Y,Z\n1,2,3\n1,2\n", r"line 3: 2 columns, the header has 3"),
        ('X,Y,Z\n1,2,"3\n1,2,3"\n', "a quoted cell runs over several lines"),
        ("X,Y,Z\n1,2," + "3" * 200_000 + "\n", "is no CSV"),
    ],
)
def test_what_is_no_table_is_refused(text: str, message: str) -> None:
    with pytest.raises(DisplayError, match=message):
        parse_table(text, HERE, "give one")


def test_xyY_becomes_XYZ_and_black_may_have_no_chromaticity() -> None:
    table = parse_table("x,y,Y\n0.25,0.5,10\n0,0,0\n", HERE, "")
    # X = x Y / y, Z = (1 - x - y) Y / y, exact in binary.
    np.testing.assert_array_equal(table.XYZ(COLOURS[1], table.numbers(COLOURS[1])), [[5, 10, 5], [0, 0, 0]])


@pytest.mark.parametrize(("row", "message"), [("0.3,0,3", "chromaticity y"), ("0.3,0.3,-1", "luminance Y")])
def test_readings_that_cannot_be_are_told_with_their_line(row: str, message: str) -> None:
    table = parse_table(f"x,y,Y\n0.3,0.3,1\n{row}\n", HERE, "")
    with pytest.raises(DisplayError, match=f"line 3: the {message} is not above 0"):
        table.XYZ(COLOURS[1], table.numbers(COLOURS[1]))


def test_codes_up_to_255_are_scaled_and_others_are_not() -> None:
    np.testing.assert_array_equal(unit_codes(np.array([[0.0, 51.0, 255.0]])), [[0, 0.2, 1]])
    np.testing.assert_array_equal(unit_codes(np.array([[0.0, 0.2, 1.0]])), [[0, 0.2, 1]])

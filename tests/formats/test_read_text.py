"""Text tables: the dialects we read, and what is wrong with the others."""

import gzip

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from near import assert_near
from numpy.testing import assert_allclose, assert_array_equal
from said import data_error, request_error, warned

from seakeep.campaign import read_table
from seakeep.campaign.settings import FileSettings
from seakeep.formats import read_columns

PLAIN = "Time [s],Heave [mm],Pitch (deg),WP 1\n0,1.5,2,3\n0.1,-1.5,2e-3,4\n0.2,.5,+2,5\n"

ROWS = PLAIN.split("\n", 1)[1]


@pytest.fixture
def read(tmp_path):
    """Read a text as a file, by stated settings."""

    def table(text, name="run.csv", columns=None, **stated):
        path = tmp_path / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return read_table(path, FileSettings(**stated), columns)

    return table


def with_comma(text):
    return text.replace(",", ";").replace(".", ",")


@pytest.mark.parametrize(
    "text",
    [
        PLAIN,
        PLAIN.rstrip(),
        PLAIN.replace("\n", "\r\n"),
        "\ufeff" + PLAIN,
        PLAIN.replace(",", ";"),
        PLAIN.replace(",", "\t"),
        PLAIN.replace(",", " , "),
        with_comma(PLAIN),
        "# a remark\n# another, with a comma\n" + PLAIN,
        "% MATLAB's mark\n\n" + PLAIN + "\n\n",
        PLAIN.replace("\n", ",\n"),
        '"Time [s]","Heave [mm]","Pitch (deg)","WP 1"\n' + ROWS,
        "Time,Heave,Pitch,WP 1\ns,mm,deg,\n" + ROWS,
        "Time,Heave,Pitch,WP 1\n[s],[mm],[deg],\n" + ROWS,
        "Time;Heave;Pitch;WP 1\ns;mm;deg;\n" + with_comma(ROWS),
        # Heads of loggers: a mark with units or a remark, rules of signs, and ranges.
        "#Time [s],Heave [mm],Pitch (deg),WP 1\n" + ROWS,
        "# Time\tHeave\tPitch\tWP 1\n# s\tmm\tdeg\t-\n" + ROWS,
        "# Time [s],Heave [mm],Pitch (deg),WP 1\n# made by a logger\n" + ROWS,
        "# Time [s],Heave [mm],Pitch (deg),WP 1\n#-------------\n" + ROWS,
        "# Time,Heave,Pitch,WP 1\ns,mm,deg,-\n" + ROWS,
        "Time [s],Heave [mm],Pitch (deg),WP 1\n-----,-----,-----,----\n" + ROWS,
        "Time [s],Heave [mm],Pitch (deg),WP 1\n\n---,---,---,---\n" + ROWS,
        "======\nTime [s],Heave [mm],Pitch (deg),WP 1\n" + ROWS,
        "Time,Heave,Pitch,WP 1\ns,mm,deg,-\n--------------\n" + ROWS,
        "Time [s],Heave [mm],Pitch (deg),WP 1\n0 : -0,0 : -0,0 : -0,0 : -0\n" + ROWS,
        "Time [s],Heave [mm],Pitch (deg),WP 1\n0 : -0\n" + ROWS,
    ],
)
def test_dialects(read, text):
    run = read(text)
    assert list(run.data_vars) == ["Heave", "Pitch", "WP 1"]
    for name, expected in {
        "time": [0.0, 0.1, 0.2],
        "Heave": [1.5, -1.5, 0.5],
        "Pitch": [2, 2e-3, 2],
        "WP 1": [3, 4, 5],
    }.items():
        assert_array_equal(run[name], expected)
    units = [each.attrs.get("units") for each in run.values()]
    assert units == ["mm", "deg", "-" if ",-\n" in text or "\t-\n" in text else None]


def test_blanks(read):
    run = read("  Time [s]   Heave [mm]  Pitch\n  0.0   1.5  -2\n 0.1  1  2\n", "run.txt")
    assert list(run.data_vars) == ["Heave", "Pitch"]
    assert run["Heave"].attrs["units"] == "mm"
    assert_array_equal(run["Pitch"], [-2, 2])


@pytest.mark.parametrize("words", [" of four words here\n\n", "\n three words here\n"])
@pytest.mark.parametrize("mark", [" ", "\t"])
def test_words_stand_above_the_header(read, mark, words):
    table = "Time Heave Pitch WP\n(s) (mm) (kN-m) (-)\n0 1.5 -2 3\n0.1 1 2 4\n"
    run = read(f"Made by a program, on a day: no 7\n{words}{table.replace(' ', mark)}", "run.out")
    units = {str(name): each.attrs.get("units") for name, each in run.items()}
    assert units == {"Heave": "mm", "Pitch": "kN-m", "WP": "-"}
    assert_array_equal(run["Pitch"], [-2, 2])


def test_words_stand_above_a_header_that_holds_another_mark(read):
    run = read("Made by a program\n\nTime Heave WP,1\n0 1.5 3\n0.1 1 4\n", delimiter=" ")
    assert list(run.data_vars) == ["Heave", "WP,1"]


@pytest.mark.parametrize("units", ["", "s,m,m\n"])
@pytest.mark.parametrize("apart", ["\n", "# remark\n"])
@pytest.mark.parametrize("bad", ["0.00,OVR,1.0", "nan,OVR,nan", "(sec),(mtr),(mtr)"])
def test_a_header_stands_apart_from_a_row_that_is_no_header(tmp_path, units, apart, bad):
    path = tmp_path / "run.csv"
    path.write_text(f"time,WP fwd,heave\n{units}{apart}{bad}\n0.05,0.1,1.1\n0.10,0.2,1.2\n")
    columns = read_columns(path)
    assert list(columns.headers) == ["time", "WP fwd", "heave"]
    line = 4 if units else 3
    assert f"line {line}, column 'WP fwd'" in columns.faults["WP fwd"]


def test_options(read):
    text = "made by a logger\nRecord 7\n! remark\nclock|heave\n".replace("|", ";") + "0;1\n50;2\n"
    stated = {"skip_rows": 2, "comment": "!"}
    run = read(text, **stated, time="clock", time_unit="ms", delimiter=";")
    assert_allclose(run["time"], [0, 0.05], rtol=1e-15)
    message = (
        r"has no column with a usual name of times\. State time = 'NAME' or sampling_rate "
        r"\(Hz\) in \[files\]\. Its columns: clock, heave"
    )
    with request_error(message):
        read(text, **stated)


@pytest.mark.parametrize("name", ["time_ms", "Tid_ms", "t ms"])
@pytest.mark.parametrize("stated", [None, "stated"])
def test_time_in_the_unit_that_its_name_ends_on(read, name, stated):
    text = f"{name};heave\n0;1\n20;2\n"
    assert_allclose(read(text, time=stated and name)["time"], [0, 0.02], rtol=1e-15)
    slow = read(text, time=name, time_unit="s")  # a name is no header
    assert_array_equal(slow["time"], [0, 20])


@pytest.mark.parametrize(
    "text",
    [
        "Zeit;heave [m]\n2024-05-03T23:59:59.900;1,5\n2024-05-04T00:00:00.100;1,6\n",
        "Zeit;heave [m]\n2024-05-03 23:59:59,900;1,5\n2024-05-04 00:00:00,100;1,6\n",
        "A logger\n\nDay and hour,heave\nUTC,m\n"
        "2024-05-04T01:59:59.9+02:00,1.5\n2024-05-04T00:00:00.1Z,1.6\n",
        "A logger\nof two words\n\ntime heave[m]\n86399.9 1.5\n0.1 1.6\n0.3 1\n0.5 1\n",
        "time [d],heave [m]\n45415.9999988426,1.5\n45416.0000011574,1.6\n",
        "datenum [days],heave [m]\n739375.99999884,1.5\n739376.00000116,1.6\n",
    ],
)
def test_dates_count_from_the_midnight_before_the_first(read, text):
    run = read(text, time="datenum" if "datenum" in text else None)
    assert_near(run["time"][:2], [86399.9, 86400.1], 3e-4)
    assert_array_equal(run["heave"][:2], [1.5, 1.6])
    assert run["heave"].attrs["units"] == "m"


def test_a_unit_of_time_stated_against_the_header(read):
    text = "Zeit [s],heave\n0,1\n0.02,2\n"
    for unit in ("s", "sec"):
        assert read(text, time_unit=unit)["time"][1] == 0.02
    with request_error(
        r"time_unit: 'ms' is stated, and .*run\.csv says 's' for its time column 'Zeit'\. "
        "Leave time_unit out where the files say it; or, if the file is wrong, correct its header"
    ):
        read(text, time="Zeit", time_unit="ms")
    with request_error("'dy' is not known.* of times, 's', 'ms', 'min', 'h' or 'd'"):
        read("t [dy],heave\n0,1\n1,2\n")
    with request_error("the unit 'm' does not fit the time column 't'"):
        read("t [m],heave\n0,1\n1,2\n")
    rated = read(text, sampling_rate=10)  # what the message proposes
    assert_array_equal(rated["time"], [0, 0.1])


def test_latin_1_is_read_and_said(read):
    text = "tid [s],bølge [°]\n0,1\n1,2\n".encode("latin-1")
    with warned(r"is not UTF-8 and was read as Windows-1252 \(Latin-1\); check"):
        run = read(text)
    assert run["bølge"].attrs["units"] == "°"
    assert read(text, encoding="latin-1").identical(run)


@pytest.mark.parametrize("row", ["s,mm,deg", "s,-,deg", "s,cm,rad"])
def test_a_header_and_a_row_that_state_other_units_are_refused(read, row):
    unit, said = ("cm", row.split(",")[1]) if row.endswith("deg") else ("deg", "rad")
    name = {"cm": "HEAVE_MRU", "deg": "Pitch"}[unit]
    text = f"Time [s],HEAVE_MRU [cm],Pitch (deg)\n{row}\n0,1,2\n1,2,3\n"
    with data_error(
        rf"the header says '{unit}' for the column '{name}', and the row of units below it "
        rf"'{said}'\. Correct the wrong one of them"
    ):
        read(text)


def test_a_header_and_a_row_that_spell_one_unit_in_two_ways(read):
    run = read("Time [s],acc [m/s2],h [MRU]\nsec,m/s^2,mm\n0,1,2\n1,2,3\n")
    units = {str(name): each.attrs["units"] for name, each in run.items()}
    assert units == {"acc": "m/s^2", "h": "mm"}


def test_commas_that_may_divide_thousands_are_refused(read):
    text = "t;h\n0;999\n1;1,234\n2;12,345\n"
    with data_error(r"comma of '1,234' may divide thousands or decimals.* state decimal = ','"):
        read(text)
    run = read(text, decimal=",")  # what the message proposes
    assert_array_equal(run["h"], [999, 1.234, 12.345])
    for cell in ("0,512", ",512", "1,5", "1234,567", "1,2345", "-0,500"):  # decimals for certain
        run = read(f"t;h\n0;1,234\n1;{cell}\n")
        assert_array_equal(run["h"], [1.234, float(cell.replace(",", "."))])


def test_missing_values_are_nan(read):
    run = read("t,a,b\n0,,nan\n1,NaN,1\n2,3,\n")
    assert_array_equal(run["a"], [np.nan, np.nan, 3])
    assert_array_equal(run["b"], [np.nan, 1, np.nan])


def test_a_column_by_its_full_header(read):
    run = read("t,WP [m],WP [mm]\n0,1,2\n1,1,2\n", columns=["WP [mm]"])
    assert list(run.data_vars) == ["WP [mm]"]
    assert run["WP [mm]"].attrs == {"long_name": "WP [mm]", "units": "mm"}


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    values=st.lists(
        st.tuples(*3 * [st.floats(allow_nan=False, allow_infinity=False)]), min_size=2, max_size=8
    ),
    delimiter=st.sampled_from([",", ";", "\t", " "]),
    comma=st.booleans(),
    bracketed=st.booleans(),
    compressed=st.booleans(),
)
def test_round_trip(read, values, delimiter, comma, bracketed, compressed):
    """Whatever the dialect, the same bits come back."""
    names, units = ["time", "heave", "a_b", "c"], ["s", "mm", "m/s2", "-"]
    both = [f"{name} [{unit}]" for name, unit in zip(names, units, strict=True)]
    point = "," if comma and delimiter != "," else "."
    lines = [both] if bracketed else [names, units]
    for i, row in enumerate(values):
        lines.append([repr(float(x)).replace(".", point) for x in (i, *row)])
    raw = "".join(delimiter.join(line) + "\n" for line in lines).encode()
    run = read(gzip.compress(raw, mtime=0) if compressed else raw)
    assert_array_equal(np.column_stack([each for _, each in run.items()]), values)
    assert [each.attrs["units"] for _, each in run.items()] == units[1:]


NO_TABLE = {
    b"": r"is empty \(0 bytes\)\. Export the run again",
    b" \n\n": r"is empty\. Export the run again",
    b"# only\n# remarks\n": "holds no rows, only comments and blank lines",
    b"t,heave\n": "has a header and no rows of numbers",
    b"t,heave\ns,m\n": "has a header and no rows of numbers",
    b"t\n0\n1\n": "holds times and no channel",
    b"\x93\x00\x01PNG" * 9:
        "holds binary data of a kind that is not known, or UTF-16 without its mark. Export the",
    gzip.compress(PLAIN.encode(), mtime=0)[:-12]: r"cut off or damaged \(gzip: ",
    "t,heave\n0,1\n1,x7\n2,3\n":
        r"line 3, column 'heave': 'x7' is not a number\. Correct the cell, leave it empty",
    "t;heave\n0;1,5\n1;1.5\n":
        r"line 3, column 'heave': '1\.5' is not a number\. Correct .* state decimal and del",
    "t,heave\n0,1\n1\n2,3\n3\n4,5\n":
        r"line 3: 1 cells where the header has 2 \(2 such line\(s\), columns divided by ','\)\."
        r" Correct the lines, or state in \[files\]: delimiter, decimal, or skip_rows where",
    "Basin 2\nBy: us\ntime,heave\n0,1\n1,2\n":
        r"line 3: 1 cells where the header has 2 .* every line has 2 cells divided by commas: ",
    "Basin 2, my run\n\nt\theave\npitch\n":
        r"skip_rows where words stand above the header; seakeep init takes them as --delimit",
    "Basin 2 A\n\nt\theave\n0,0\t1,5\n0,1\t1,6\n":
        r"line 3: .* From line 3 on, every line has 2 cells divided by tabs: state skip_rows ="
        r" 2 in \[files\] of the campaign, or give --skip-rows 2 to seakeep init",
    "t,heave\n0,0,1,5\n0,1,1,6\n":
        r"4 cells where the header has 2 .* decimal commas in a file divided by",
    "time,0,0.1,0.2\nheave,1,2,3\n":
        r"the first line is 'time' and 3 numbers, which looks transposed \(2 rows, 4 columns\);"
        " expected a header, then one row per instant and one column per channel",
    "0,0.1,0.2\n1,2,3\n":
        r"run\.csv: no header and more columns than rows, which looks transposed \(2 rows, 3",
    "time,heave\n01.05.2024 12:00:00.1,1\n01.05.2024 12:00:00.2,2\n":
        "line 2, column 'time': '01.05.2024 12:00:00.1' is not a number. Write instants as in 2024-"
        "05-03T10:00:00.1 .ISO 8601., or as seconds. Or, only where no row is lost, leave time out",
    "time,heave\n2024-05-01 12:00:00.1,1\n2024-05-01 12:00:0x,2\n":
        "line 3, column 'time': '2024-05-01 12:00:0x' is not a number. Write instants as in",
    "time,heave\n,1\n2024-05-01 12:00:00.1,2\n2024-05-01 12:00:00.2,3\n":
        r"the times of .*run\.csv hold a value that is not finite at sample 0 \(1 in all\)",
    "time,heave\n86399.9,1\n0.6,2\n0.7,3\n0.8,3\n": r"not sorted: 0\.6 s follows 86399\.9 s",
    "t,heave,pitch\n0,1,2\n1,2,3\n2,":
        r"line 4: 2 cells where the header has 3 .*It is the last line: the file was cut off",
    "t,heave,heave\n0,1,2\n1,2,3\n":
        "2 columns have the name 'heave'. Rename them in the file's header",
    "t,heave\n0,1\n0,2\n":
        r"the times of .*run.csv repeat: 0 s stands at samples 0 and 1 \(1 repetitions .* and "
        r"the readings .* leave time out of \[files\] and state sampling_rate \(Hz\) there",
    "t,heave\n1700000000.25,1\n1700000000.25,2\n":
        r"repeat: 1700000000\.25 s stands at samples 0 and 1 \(1 .* the clock stood",
    "t,heave,pitch\n0,1,\n0,1,\n1,2,3\n":
        "the times of .*run.csv repeat: 0 s .* Remove the double rows, or raise the",
    "t,heave,pitch\n0,1,\n1,2,3\n2,2,3\n0,1,\n1,2,3\n3,2,3\n":
        r"^2 row\(s\) of .*run.csv are there twice, .* first is sample 3, of 0 s, which stands at s"
        "ample 0 too. Remove the double",
    "t,heave\n0,1\n1,2\n0,1\n1,3\n": "not sorted: 0 s follows 1 s at sample 2",
    "t,t,heave\n0,0,1\n1,1,2\n": "2 columns have the name 't'",
}  # fmt: skip


@pytest.mark.parametrize(("text", "message"), NO_TABLE.items())
def test_what_is_no_table(read, text, message):
    with data_error(message):
        read(text)

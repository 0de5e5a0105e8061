"""One reader for all our TOML files: what it says about files that are wrong."""

import pickle

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import Field

from seakeep import RequestError
from seakeep.toml import Length, Names, Positive, Table, parse_length, read_toml, validated


class Probe(Table):
    """A probe."""

    height: Positive
    names: Names = ()


class Whole(Table):
    """A whole file."""

    probes: dict[str, Probe] = Field(default_factory=dict)
    depth: Positive = 1.0


def refused(path, content=None):
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(RequestError) as caught:
        validated(Whole, read_toml(path, "tank"), path, "tank")
    return str(caught.value)


def test_every_mistake_has_its_line(tmp_path):
    content = b'depht = 3\n\n[probes.bow]\nheight = -1  # m\n[probes."at stern"]\nnames = [1]\n'
    assert refused(tmp_path / "tank.toml", content).splitlines()[1:] == [
        "  line 4, probes.bow.height: received -1, which should be greater than 0.",
        "  line 5, probes.at stern.height: missing. Add it.",
        "  line 6, probes.at stern.names: received 1, which should be a string.",
        "  line 1, depht: unknown key, received 3. Did you mean 'depth'? Keys here: probes, depth.",
    ]


@pytest.mark.parametrize(
    ("content", "message"),
    {
        b"name = 'K\xf6ln'\n": "tank.toml, line 1: not UTF-8, which TOML asks for. Save the file",
        b"[a\n": "is not valid TOML: ",
        b"a = 1979-99-99\n": "is not valid TOML: ",
        b"depth = 1979-01-01\n": "depth: received 1979-01-01, which should be a number",
        b"depth = " + b"[" * 200 + b"]" * 200: "depth: received [[[",
        b"[study]\n": "is a study file (it has [study]), and a tank file is expected here",
        b"[channels]\n[rig]\n": "is a campaign file (it has [channels], [rig]), and a tank file",
    }.items(),
    ids=lambda x: repr(x)[:20],
)
def test_a_file_that_is_wrong_is_refused_in_words(tmp_path, content, message):
    assert message in refused(tmp_path / "tank.toml", content)


@pytest.mark.parametrize(
    ("text", "value", "unit"),
    [("1.5T", 1.5, "T"), (" 2e1 T ", 20, "T"), ("inf T", float("inf"), "T"),
     ("-.5 T", -0.5, "T"), ("4 / T", 4, "/T"), ("1 T\u0302", 1, "T")],
)  # fmt: skip
def test_lengths_in_periods(text, value, unit):
    assert parse_length(text) == Length(value, unit)


@given(st.floats(1e-6, 1e6), st.sampled_from(["T", "/T"]), st.floats(0.1, 20))
def test_a_length_written_and_read_again(value, unit, period):
    stated = Length(value, unit)
    again = parse_length(str(stated))
    assert again.unit == unit
    expected = value * period if unit == "T" else value / period
    assert again.at(period) == pytest.approx(expected, rel=1e-14)  # 15 digits
    assert pickle.loads(pickle.dumps(stated)) == stated

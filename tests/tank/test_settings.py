import pytest
from said import request_error

from seakeep.tank.settings import default_settings, read_tank


def read(tmp_path, text):
    path = tmp_path / "tank.toml"
    path.write_text(text, "utf-8")
    return read_tank(path)


def test_a_file_changes_what_it_states_and_keeps_the_rest(tmp_path):
    settings = read(tmp_path, "seed = 7\n[moorings.bow]\nstiffness = 2.5\npretension = 0.5\n"
                    "eye = [-0.72, 0.06]\npole = [48.42, 0.06]\n[instruments.clocks.mru]\n"
                    "offset = 0.1\n")  # fmt: skip
    assert settings.seed == 7
    assert list(settings.moorings) == ["bow"]  # a table of lines replaces the default one
    assert settings.instruments.clocks["mru"].offset == 0.1
    assert settings.instruments.clocks["mru"].rate == 50.0
    assert settings.vessel == default_settings().vessel


@pytest.mark.parametrize(
    ("text", "message"),
    {
        "[moorings.bow]\nstiffness = -1.0\npretension = 0.8\neye = [0, 0]\npole = [1, 0]":
            r"line 2, moorings\.bow\.stiffness: received -1\.0, which should be greater than 0",
        "[facility]\nwater_depth = 0": r"water_depth: received 0, .* Give a depth of 0\.01 to",
        "[facility]\nwave_band = [1.4, 0.1]": r"wave_band: a band is \[low, high\] in Hz",
        "[runs.'a/b']\nwavelength = 2.0\nheight = 0.1": r"runs\.a/b: the name of a run is",
        "[runs.a]\nwavelength = 2.0": r"either a spectrum \(irregular\) or wavelength and height",
        "[runs.a]\nwavelength = 2.0\nheight = 0.1\nspectrum = { height = 0.1, peak_period = 2 }":
            r"either a spectrum \(irregular\) or wavelength and height",
        "[runs.a]\nspectrum = { kind = 'jonswap', height = 0.1 }":
            r"a jonswap spectrum needs height \(m\) and peak_period \(s\)",
        "[runs.a]\nspectrum = { kind = 'table', frequencies = [1.0], densities = [1.0] }":
            r"as many frequencies .* two at least; there are 1 and 1",
        "[runs.a]\nspectrum = { kind = 'table', frequencies = [1, 0.5], densities = [1, 1] }":
            "frequencies of a spectrum must increase",
        "[instruments]\ntrigger_width = 30.0": "must be shorter than trigger_period",
        "seed = 18446744073709551616": r"seed: .* Give a number from 0 to 2\^64",
        "[channels.a]\ncolumn = 'a'\n[rig]\n": "is a campaign file",
    }.items(),
)  # fmt: skip
def test_bad_settings_say_what_and_how_to_mend(tmp_path, text, message):
    with request_error(message):
        read(tmp_path, text)


def test_a_measured_spectrum_comes_from_a_file(tmp_path):
    (tmp_path / "sea.csv").write_text("f,E\n0.3,0.001\n0.6,0.003\n1.0,0.0\n", "utf-8")
    settings = read(
        tmp_path, '[runs.a]\nspectrum = { file = "sea.csv", band = [0.3, 1.0] }\nstartup = 1\n'
    )
    assert settings.runs["a"].spectrum.frequencies == (0.3, 0.6, 1.0)
    assert settings.runs["a"].spectrum.densities == (0.001, 0.003, 0.0)
    with request_error(r"runs\.a\.spectrum\.file: .*none\.csv does not exist"):
        read(tmp_path, '[runs.a]\nspectrum = { file = "none.csv" }\n')
    (tmp_path / "odd.csv").write_text("0.3,0.001\n0.6;0.003\n", "utf-8")
    with request_error(r"runs\.a\.spectrum\.file: .*Two columns of numbers"):
        read(tmp_path, '[runs.a]\nspectrum = { file = "odd.csv" }\n')

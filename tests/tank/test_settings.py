import pytest

from seakeep.errors import RequestError
from seakeep.tank.hydrodynamics import load_hydrodynamics
from seakeep.tank.settings import default_settings, read_settings


def read(tmp_path, text):
    path = tmp_path / "tank.toml"
    path.write_text(text, encoding="utf-8")
    return read_settings(path)


def test_a_file_changes_what_it_states_and_keeps_the_rest(tmp_path):
    settings = read(tmp_path, "seed = 7\n[moorings.bow]\nstiffness = 2.5\npretension = 0.5\n"
                    "eye = [-0.72, 0.06]\npole = [48.42, 0.06]\n[instruments.clocks.mru]\n"
                    "offset = 0.1\n")  # fmt: skip
    assert settings.seed == 7
    assert list(settings.moorings) == ["bow"]  # a table of lines replaces the default one
    assert settings.instruments.clocks["mru"].offset == 0.1
    assert settings.instruments.clocks["mru"].rate == 50.0
    assert settings.vessel == default_settings().vessel


def test_hydrodynamics_file_is_found_beside_the_settings(tmp_path):
    settings = read(tmp_path, '[vessel]\nhydrodynamics = "mine.nc"\n')
    assert settings.hydrodynamics_path == tmp_path / "mine.nc"
    with pytest.raises(RequestError, match=r"mine\.nc does not exist\. Correct vessel"):
        load_hydrodynamics(settings.hydrodynamics_path)


def test_default_hull_settings_are_those_of_the_default_file():
    from seakeep.tank.settings import HullSettings, InstrumentSettings

    settings = default_settings()
    assert settings.hull == HullSettings()
    for name in ("rate_noise", "angle_noise", "heave_noise", "surge_noise", "load_noise"):
        default = InstrumentSettings.model_fields[name].default
        assert getattr(settings.instruments, name) == default


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[moorings.bow]\nstiffness = -1.0\npretension = 0.8\neye = [0, 0]\npole = [1, 0]",
         r"moorings\.bow\.stiffness: input should be greater than 0; received -1\.0\. Correct"),
        ("[facility]\nwater_depth = 0", r"facility\.water_depth: .*greater than 0; received 0"),
        ("[facility]\nwave_band = [1.4, 0.1]", r"wave_band must be \(low, high\) in Hz"),
        ("[simulation]\nstepp = 0.1", r"simulation\.stepp is not a setting\. Did you mean 'step'"),
        ("[vesel]\nposition = 1", r"vesel is not a setting\. Did you mean 'vessel'\?"),
        ("[runs.a]\nwavelenght = 2", r"runs\.a\.wavelenght .* Did you mean 'wavelength'\?"),
        ("[runs.a]\nwavelength = 2.0", r"either a spectrum \(irregular\) or wavelength and height"),
        ("[runs.a]\nwavelength = 2.0\nheight = 0.1\nspectrum = { height = 0.1, peak_period = 2 }",
         r"either a spectrum \(irregular\) or wavelength and height"),
        ("[runs.a]\nspectrum = { kind = 'jonswap', height = 0.1 }",
         r"a jonswap spectrum needs height \(m\) and peak_period \(s\)"),
        ("[runs.a]\nspectrum = { kind = 'table', frequencies = [1.0], densities = [1.0] }",
         r"as many frequencies .* two at least; received 1 and 1"),
        ("[runs.a]\nspectrum = { kind = 'table', frequencies = [1, 0.5], densities = [1, 1] }",
         "frequencies of a spectrum must increase"),
        ("[runs.a]\nspectrum = { height = 0.1, peak_period = 2, band = [1.0, 0.5] }",
         r"band must be \(low, high\)"),
        ("[instruments]\ntrigger_width = 30.0", "must be shorter than trigger_period"),
        ("[instruments.probes.a]\nposition = 50", r"probes\.a\.noise is missing\. Add the key"),
        ("[hull.pool]\nbottom_length = 0.6", "bottom opening must fit inside its free surface"),
        ("[hull.pool]\nshelf = -0.005", "shelf must lie below its lid"),
        ("seed = ", "is not valid TOML"),
        ("seed = -1", r"seed: input should be greater than or equal to 0; received -1"),
    ],
)  # fmt: skip
def test_bad_settings_say_what_and_how_to_mend(tmp_path, text, message):
    with pytest.raises(RequestError, match=message):
        read(tmp_path, text)


def test_missing_file(tmp_path):
    with pytest.raises(RequestError, match=r"does not exist\. Correct the path"):
        read_settings(tmp_path / "none.toml")


def test_a_measured_spectrum_comes_from_a_file(tmp_path):
    (tmp_path / "sea.csv").write_text("f,E\n0.3,0.001\n0.6,0.003\n1.0,0.0\n", encoding="utf-8")
    settings = read(
        tmp_path, '[runs.a]\nspectrum = { file = "sea.csv", band = [0.3, 1.0] }\nstartup = 1\n'
    )
    assert settings.runs["a"].spectrum.frequencies == (0.3, 0.6, 1.0)
    assert settings.runs["a"].spectrum.densities == (0.001, 0.003, 0.0)
    with pytest.raises(RequestError, match=r"runs\.a\.spectrum\.file: .*none\.csv cannot be read"):
        read(tmp_path, '[runs.a]\nspectrum = { file = "none.csv" }\n')
    (tmp_path / "odd.csv").write_text("0.3,0.001\n0.6;0.003\n", encoding="utf-8")
    with pytest.raises(RequestError, match=r"row 2 of .* is '0\.6;0\.003'; two numbers"):
        read(tmp_path, '[runs.a]\nspectrum = { file = "odd.csv" }\n')

"""Models on disk: the same bits, and what a wrong file is told."""

import numpy as np
import pytest
import xarray as xr
from said import data_error
from scipy import io

from seakeep import DataError, HankelDMDc, load_live, load_model
from seakeep.files import FORMAT, write_netcdf, write_sealed


@pytest.fixture
def model(make_run, channels):
    return HankelDMDc(3, 8, 1.0, window=np.int64(200)).fit(make_run(), **channels)


@pytest.fixture
def saved(model, tmp_path):
    return model.save(tmp_path / "rom.nc")


@pytest.mark.parametrize("part", [0.0, 0.3, 0.95])
def test_a_truncated_file_is_refused(saved, part):
    content = saved.read_bytes()
    saved.write_bytes(content[: int(part * len(content))])
    with data_error(r"was cut off, altered .*no checksum at its end"):
        load_model(saved)


def test_a_file_of_another_kind_is_named(run, saved, tmp_path):
    (tmp_path / "run.csv").write_text("t,heave\n0,1\n")
    with data_error(r"run\.csv is no NetCDF file, as seakeep writes"):
        load_model(tmp_path / "run.csv")
    write_netcdf(tmp_path / "table.nc", run)
    write_sealed(run, tmp_path / "run.nc", "prepared run")
    for name, kind in (("table", "table"), ("run", "prepared run")):
        with data_error(rf"{name}\.nc holds a {kind}, and a model is expected"):
            load_model(tmp_path / f"{name}.nc")
    model = load_model(saved)
    with data_error("holds a model, and a live state is expected here"):
        load_live(model, saved)
    with data_error("holds a live state, and a model is expected here"):
        load_model(model.live().save(tmp_path / "live.nc"))


@pytest.mark.parametrize("number", [FORMAT - 1, FORMAT + 1])
def test_another_format_is_refused_in_one_line(saved, number):
    attrs = {"seakeep_format": number, "seakeep_version": "9.0"}
    write_netcdf(saved, xr.load_dataset(saved, engine="h5netcdf").assign_attrs(attrs))
    with pytest.raises(DataError) as refused:
        load_model(saved)
    assert str(refused.value) == (
        f"{saved} has format {number}, written by seakeep 9.0, and this seakeep reads format "
        f"{FORMAT}. Make the file again with this version, or update seakeep."
    )


def test_a_single_bit_that_changed_is_noticed(saved):
    content = saved.read_bytes()
    for place in np.linspace(8, len(content) - 1, 20, dtype=int):  # after the mark of HDF5
        damaged = bytearray(content)
        damaged[place] ^= 1
        saved.write_bytes(damaged)
        with data_error("its checksum is another one"):
            load_model(saved)


def test_a_mat_file_carries_what_idss_asks_for(model, tmp_path):
    content = io.loadmat(model.to_mat(tmp_path / "rom.mat"), simplify_cells=True)
    names = content["StateName"].tolist()
    assert len(names) == len(content["A"])
    assert names[:3] + names[7:10] == [
        *("heave(k)", "pitch(k)", "heave(k-1)"),
        *("pitch(k-3)", "eta_fwd(k-1)", "eta_cog(k-1)"),
    ]
    lists = [content[key].tolist() for key in ("InputName", "OutputName", "OutputUnit")]
    assert lists == [["eta_fwd", "eta_cog"], ["heave", "pitch"], ["m", "rad"]]
    assert content["Ts"] == model.dt
    assert content["D"].shape == (2, 2)

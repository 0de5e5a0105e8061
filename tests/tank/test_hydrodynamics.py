import shutil

import numpy as np
import pytest
import xarray as xr
from hull import Built, HullSettings, hull_mesh, hydrostatics
from near import assert_near
from numpy.testing import assert_allclose
from said import request_error

from seakeep.tank.hydrodynamics import (
    SHIPPED,
    excitation_at,
    kernel_coefficients,
    load_hydrodynamics,
    passive_damping,
    radiation_kernel,
)
from seakeep.tank.settings import default_settings
from seakeep.toml import validated
from seakeep.waves import GRAVITY, phase_speed

HULL = HullSettings.model_validate(default_settings().hull)


def test_mesh_is_the_one_of_the_shipped_coefficients(hydro):
    assert hull_mesh(HULL).digest == hydro.attrs["mesh_sha256"]


def test_mesh_has_the_mass_area_and_trim_asked_for():
    mesh = hull_mesh(HULL)
    statics = hydrostatics(mesh, HULL)
    # Solved by root finding to 1e-12 m of draft.
    assert_allclose(statics.volume, 0.0607, rtol=1e-9)
    assert_allclose(statics.waterplane, 0.9035, rtol=1e-9)
    assert_near(statics.buoyancy[0], 0.0, 1e-9)
    assert_near(mesh.draft, 0.0830, 5e-5)


@pytest.mark.parametrize(
    ("pool", "message"),
    [
        ({"bottom_length": 0.6}, r"hull\.pool: .*bottom opening must fit inside its free surface"),
        ({"shelf": -0.005}, "shelf must lie below its lid"),
        ({"shelv": -0.005}, r"hull\.pool\.shelv: unknown key, .* Did you mean 'shelf'"),
    ],
)
def test_a_pool_that_cannot_be_built_is_refused(pool, message):
    hull = default_settings().hull
    with request_error(message):
        validated(Built, {"hull": hull | {"pool": hull["pool"] | pool}}, "mine.toml", "tank")


def test_low_frequency_limits(hydro):
    lowest = hydro.omega[0]
    force = excitation_at(hydro, hydro.omega[:1])[0]
    # At 0.3 rad/s waves are 63 m long: radiation and diffraction still take half a per cent.
    assert_allclose(abs(force[1]), 1000 * GRAVITY * hydro.attrs["waterplane_area"], rtol=0.01)
    assert_allclose(abs(force[3]), 1000 * GRAVITY * hydro.attrs["pool_area"], rtol=0.01)
    inertia = -(lowest**2) * (hydro.mass + hydro.added_mass[0]) - 1j * lowest * hydro.damping[0]
    motion = np.abs(np.linalg.solve(inertia + hydro.stiffness, force))
    assert_near(motion[[1, 3]], 1.0, 0.005)
    # In shallow, long waves water moves 1/tanh(kh) times its height to and fro.
    wavenumber = lowest / phase_speed(lowest, 3.6)
    assert_allclose(motion[0], 1 / np.tanh(wavenumber * 3.6), rtol=0.01)
    assert_allclose(motion[2], wavenumber, rtol=0.02)


def test_damping_of_the_kernel_is_passive(hydro):
    omega, damping = passive_damping(hydro)
    assert omega[0] == 0.0
    assert np.all(damping[0] == 0.0)
    assert np.array_equal(damping, damping.swapaxes(1, 2))
    values = np.linalg.eigvalsh(damping)
    assert values.min() > -1e-9 * values.max()  # rounding of the projection


def test_kernel_gives_the_damping_of_the_file_back(hydro):
    band = (hydro.omega >= 1.0) & (hydro.omega <= 8.0)  # the kernel's pool rows end above
    _, found = kernel_coefficients(radiation_kernel(hydro, 0.01, 12.0), hydro.omega[band])
    wanted = 0.5 * (hydro.damping + hydro.damping.swapaxes(1, 2))
    largest = np.sqrt(np.abs(np.diagonal(wanted, axis1=1, axis2=2)).max(axis=0))
    # 12 s of kernel lose less than 1 %; of slosh 3.3 % are not passive and taken away.
    error = np.abs(found - wanted[band]).max(axis=0) / np.outer(largest, largest)
    assert error[4, 4] < 0.04
    error[4, 4] = 0.0
    assert error.max() < 0.01


def changed(tmp_path, change):
    path = tmp_path / "hull.nc"
    data = xr.load_dataset(SHIPPED, engine="h5netcdf")
    change(data).to_netcdf(path, engine="h5netcdf")
    return path


def test_incomplete_and_damaged_files_are_refused(tmp_path):
    with request_error(r"misses damping, .*Build the file again"):
        load_hydrodynamics(changed(tmp_path, lambda d: d.drop_vars("damping")))
    with request_error(r"misses added_mass, .* not finite"):
        load_hydrodynamics(
            changed(tmp_path, lambda d: d.assign(added_mass=d.added_mass.where(d.omega > 1)))
        )
    with request_error("does not exist"):
        load_hydrodynamics(tmp_path / "none.nc")
    other = tmp_path / "text.nc"
    shutil.copy(__file__, other)
    with request_error("is not a readable NetCDF file"):
        load_hydrodynamics(other)


@pytest.mark.oracle
def test_coefficients_are_reproduced_by_the_builder(hydro):
    pytest.importorskip("capytaine")
    from build_hydrodynamics import build_hydrodynamics

    made = build_hydrodynamics(HULL, frequencies=[6.0])
    at = int(np.argmin(np.abs(hydro.omega - 6.0)))
    assert made.attrs["mesh_sha256"] == hydro.attrs["mesh_sha256"]
    for name, shipped in (("added_mass", hydro.added_mass), ("damping", hydro.damping)):
        # Rounding of a linear solve with a condition number of about 1e3, by any BLAS.
        assert_near(made[name][0], shipped[at], 1e-8 * np.abs(shipped[at]).max())
    force = made["excitation"].values[:, 0]
    assert_allclose(force[0] + 1j * force[1], hydro.excitation[at], rtol=1e-8)
    outgoing = made["far_field"].values[0].astype(float)
    outgoing = outgoing[0] + 1j * outgoing[1]
    # Written in single precision; the least elements are sums that all but cancel.
    assert_near(outgoing, hydro.far_field[at], 1e-6 * np.abs(outgoing).max())


COARSE = "panels_along = 6\npanels_across = 6\npanels_down = 3\npanels_bottom = 2\n"


@pytest.mark.oracle
def test_another_hull_is_built_and_played_from_a_settings_file(tmp_path):
    """No code: its dimensions, one command, its file in the settings."""
    pytest.importorskip("capytaine")
    pytest.importorskip("numba")
    from build_hydrodynamics import main

    from seakeep.tank.play import play_run
    from seakeep.tank.settings import read_tank

    settings = tmp_path / "hull.toml"
    settings.write_text(
        '[vessel]\nhydrodynamics = "hull.nc"\n'
        f"[hull]\nmass = 55.0\nwaterplane_area = 1.05\npool = false\n{COARSE}"
        "[runs.one]\nwavelength = 2.8\nheight = 0.1\nstartup = 5.0\nduration = 10.0\n",
        "utf-8",
    )
    frequencies = [str(0.5 * i) for i in range(1, 21)]
    out = tmp_path / "hull.nc"
    assert main([str(settings), "-o", str(out), "--frequencies", *frequencies]) == 0
    made = load_hydrodynamics(out)
    assert made.names == ("surge", "heave", "pitch")
    assert made.mass[0, 0] == 55.0
    played = play_run(read_tank(settings), "one")
    assert played.rig.names == made.names
    assert 0.01 < played.motion.position[1, -500:].std() < 0.05

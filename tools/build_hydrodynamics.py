"""Hydrodynamic coefficients of the virtual hull by a boundary element solver.

Needs capytaine 3.0.0. The result is a small NetCDF file that the tank reads,
so that running the tank needs no solver. Run it as ``python tools/build_hydrodynamics.py``.
"""

from __future__ import annotations

import argparse
import sys
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy
import xarray as xr
from hull import Built, HullMesh, HullSettings, hull_mesh, hydrostatics

from seakeep.arrays import FloatArray
from seakeep.errors import RequestError, SeakeepError
from seakeep.files import write_netcdf
from seakeep.tank.hydrodynamics import CONVENTIONS, POOL_MODES, RIGID
from seakeep.tank.settings import default_settings, read_tank
from seakeep.toml import validated
from seakeep.waves import GRAVITY, group_speed, wavenumber

DIRECTIONS = 96
FAR_FIELD = ("omega", "part", "moment", "wave_or_motion", "wave_or_motion_too")


def default_frequencies() -> FloatArray:
    """Return the fifty frequencies of the shipped file, rad/s: dense where the pool resonates."""
    slow, middle = np.arange(0.3, 2.0, 0.4), np.arange(2.0, 9.0, 0.25)
    return np.round(np.concatenate([slow, middle, np.arange(9.0, 15.01, 6 / 16)]), 6)


def _modes(mesh: HullMesh, hull: HullSettings, centres: FloatArray) -> dict[str, FloatArray]:
    """Displacement of each panel in each degree of freedom, shape (face, 3)."""
    rigid = (~mesh.pool_lid)[:, None]
    x, z = centres[:, 0], centres[:, 2] - hull.centre_of_gravity
    zero, one = np.zeros_like(x), np.ones_like(x)
    modes = {
        "surge": np.column_stack([one, zero, zero]) * rigid,
        "heave": np.column_stack([zero, zero, one]) * rigid,
        "pitch": np.column_stack([z, zero, -x]) * rigid,
    }
    if hull.pool is not None:
        shape = np.sin(np.pi * (x - hull.pool.centre) / hull.pool.length)
        modes["piston"] = np.column_stack([zero, zero, one]) * ~rigid
        modes["slosh"] = np.column_stack([zero, zero, shape]) * ~rigid
    return modes


def build_hydrodynamics(
    hull: HullSettings,
    frequencies: npt.ArrayLike | None = None,
    water_depth: float = 3.6,
    density: float = 1000.0,
    progress: bool = False,
) -> xr.Dataset:
    """Solve the radiation and diffraction problems of a hull; see :func:`load_hydrodynamics`.

    Frequencies are angular (rad/s), by default :func:`default_frequencies`; depth in m, density
    in kg/m³. Raises RequestError if capytaine is not installed or the hull cannot be built.
    """
    try:
        import capytaine as cpt
    except ImportError as error:
        raise RequestError(
            "hydrodynamic coefficients need capytaine, which is not installed. "
            "Install the extra: pip install 'seakeep[tank-build]'. The tank itself runs without."
        ) from error
    mesh = hull_mesh(hull, density)
    surface = cpt.Mesh(mesh.vertices, mesh.faces, auto_clean=False, auto_check=False)
    lid = cpt.Mesh(*mesh.internal_lid, auto_clean=False, auto_check=False)
    modes = _modes(mesh, hull, np.asarray(surface.faces_centers))
    body = cpt.FloatingBody(surface, dofs=modes, lid_mesh=lid, name="hull")
    omegas = default_frequencies() if frequencies is None else np.asarray(frequencies, dtype=float)
    case = {"body": body, "water_depth": water_depth, "rho": density, "g": GRAVITY}
    problems = []
    for omega in omegas:
        problems.append(cpt.DiffractionProblem(omega=omega, wave_direction=0.0, **case))
        problems += [cpt.RadiationProblem(omega=omega, radiating_dof=m, **case) for m in modes]
    # The indirect method breaks reciprocity at the shelf of the pool. The default fit of the
    # finite-depth Green function draws random numbers; the compiled one gives the same each time.
    green = cpt.Delhommeau(finite_depth_prony_decomposition_method="fortran")
    solver = cpt.BEMSolver(green_function=green, method="direct")
    results = solver.solve_all(problems, progress_bar=progress, _check_wavelength=False)
    solved = cpt.assemble_dataset(results, hydrostatics=False)
    far_field = _far_field(results, surface, list(modes), water_depth, density)
    data = _dataset(solved, hull, mesh, density)
    data["far_field"] = FAR_FIELD, far_field.astype("f4")  # single precision: panels leave 1 %
    return data.assign_attrs(
        water_depth=water_depth,
        density=density,
        solver=f"capytaine {metadata.version('capytaine')}, method direct",
    )


def _far_field(
    results: list[Any], surface: Any, names: list[str], depth: float, density: float
) -> FloatArray:
    r"""Power of the waves that go out, as quadratic forms in (wave, motions), and its part along x.

    Kochin's function of each potential, :math:`H(\theta) = \int (\varphi\,\partial_n w
    - w\,\partial_n\varphi)\,dS` with :math:`w = e^{-ik(x\cos\theta + y\sin\theta)}
    \cosh k(z+h) / \cosh kh`, by Green's theorem over the panels.
    """
    centres, normals, areas = (
        np.asarray(getattr(surface, f"faces_{name}")) for name in ("centers", "normals", "areas")
    )
    angle = 2 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    along = np.stack([np.cos(angle), np.sin(angle)])

    def rank(result: Any) -> int:
        """Diffraction first, then the motions in their order."""
        dof = getattr(result, "radiating_dof", None)
        return 0 if dof is None else 1 + names.index(dof)

    by_omega: dict[float, list[Any]] = {}
    for result in results:
        by_omega.setdefault(float(result.omega), []).append(result)
    forms = np.zeros((len(by_omega), 2, 2, len(names) + 1, len(names) + 1))
    for form, (omega, group) in zip(forms, sorted(by_omega.items()), strict=True):
        k, speed = float(wavenumber(omega, depth)), float(group_speed(omega, depth))
        up, down = np.exp(k * centres[:, 2]), np.exp(-k * (centres[:, 2] + 2 * depth))
        profile, slope = (up + down) / (1 + np.exp(-2 * k * depth)), k * (up - down)
        slope = slope / (1 + np.exp(-2 * k * depth))
        wave = np.exp(-1j * k * along.T @ centres[:, :2].T)
        outward = wave * (slope * normals[:, 2] - 1j * k * (along.T @ normals[:, :2].T) * profile)
        kochin = np.stack([
            outward @ (result.potential[: areas.size] * areas)
            - (wave * profile) @ (result.boundary_condition[: areas.size] * areas)
            for result in sorted(group, key=rank)
        ])  # fmt: skip
        kappa = k * GRAVITY / (2 * omega * speed)
        scale = density * (omega * kappa) ** 2 * speed / (4 * np.pi * GRAVITY * k)
        for part, weight in enumerate((np.ones(DIRECTIONS), along[0])):
            # The mean over uniform directions: exact for a function of so few harmonics.
            total = 2 * np.pi * scale * (kochin.conj() * weight) @ kochin.T / DIRECTIONS
            form[:, part] = total.real, total.imag
    return forms


def _dataset(solved: xr.Dataset, hull: HullSettings, mesh: HullMesh, density: float) -> xr.Dataset:
    """Put the solver's results, the matrices of inertia and restoring, and dimensions together."""
    statics = hydrostatics(mesh, hull, density)
    inertia = [hull.mass, hull.mass, hull.mass * hull.pitch_gyradius**2]
    stiffness = statics.stiffness
    dimensions = {}
    if (pool := hull.pool) is not None:
        area = pool.length * pool.beam
        layer = density * area * -pool.lid  # the thin layer of water above the lid
        inertia = [inertia[0] + layer, *inertia[1:], layer, 0.5 * layer]
        springs = density * GRAVITY * area * np.array([1.0, 0.5])
        stiffness = scipy.linalg.block_diag(stiffness, np.diag(springs))
        opening = pool.bottom_length * pool.bottom_beam
        dimensions = {"pool_centre": pool.centre, "pool_area": area, "pool_opening": opening}
    names = [*RIGID, *POOL_MODES][: len(inertia)]
    order = ("omega", "influenced_dof", "radiating_dof")
    both = {"radiating_dof": names, "influenced_dof": names}
    force = (solved["Froude_Krylov_force"] + solved["diffraction_force"]).sel(
        influenced_dof=names, wave_direction=0.0
    )
    excitation = force.transpose("omega", "influenced_dof").values
    return xr.Dataset(
        {
            "added_mass": (order, solved["added_mass"].sel(both).transpose(*order).values),
            "damping": (order, solved["radiation_damping"].sel(both).transpose(*order).values),
            "excitation": (("part", *order[:2]), np.stack([excitation.real, excitation.imag])),
            "mass": (order[1:], np.diag(inertia)),
            "stiffness": (order[1:], stiffness),
        },
        coords={"omega": solved["omega"].values, "part": ["re", "im"], **both},
        attrs={
            **CONVENTIONS,
            **dimensions,
            "centre_of_gravity": hull.centre_of_gravity,
            "draft": mesh.draft,
            "waterplane_area": statics.waterplane,
            "mesh_sha256": mesh.digest,
            "hull_settings": hull.model_dump_json(),
        },
    )


def main(arguments: list[str] | None = None) -> int:
    """Build the file of the default hull (or of the ``[hull]`` table of a settings file)."""
    parser = argparse.ArgumentParser(prog="build_hydrodynamics.py", description=__doc__)
    parser.add_argument("settings", nargs="?", type=Path, help="tank settings (TOML)")
    parser.add_argument("-o", "--out", type=Path, default=Path("hydrodynamics.nc"))
    parser.add_argument(
        "--frequencies", type=float, nargs="+", help="angular frequencies (rad/s) instead of fifty"
    )
    options = parser.parse_args(arguments)
    try:
        settings = default_settings() if options.settings is None else read_tank(options.settings)
        built = validated(Built, {"hull": settings.hull}, options.settings or "the default", "tank")
        data = build_hydrodynamics(
            built.hull,
            options.frequencies,
            settings.facility.water_depth,
            settings.facility.density,
            progress=sys.stderr.isatty(),
        )
        write_netcdf(options.out, data)
    except SeakeepError as error:
        sys.stderr.write(f"Error: {error}\n")
        return error.exit_status
    sys.stdout.write(f"{options.out}: {options.out.stat().st_size / 1000:.0f} kB\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())

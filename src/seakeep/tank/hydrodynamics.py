r"""Hydrodynamic coefficients: the file, its checks, the radiation kernel and the linear response.

Time convention :math:`e^{-i\omega t}`; waves run along +x, their phase is zero at the centre of
gravity. Degrees of freedom: surge, heave, pitch about the centre of gravity, and, for a hull with
a moon pool, the absolute elevations of its piston and of its first longitudinal sloshing mode.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import scipy
import xarray as xr

from seakeep.arrays import ComplexArray, FloatArray
from seakeep.errors import RequestError, SeakeepError
from seakeep.files import reading
from seakeep.signals.calculus import rising

CONVENTIONS = {
    "format": "seakeep-hydrodynamics 2",
    "time_convention": "exp(-i omega t)",
    "wave_direction": "+x",
    "frame": "x downstream, z up, pitch positive bow up, origin at the centre of gravity",
    "pool_modes": "absolute elevations; rigid modes do not move the pool's lid",
    "units": "SI, radians",
}
"""Attributes that a file of coefficients must carry, with these values."""

RIGID = ("surge", "heave", "pitch")
POOL_MODES = ("piston", "slosh")
VARIABLES = ("added_mass", "damping", "excitation", "mass", "stiffness", "far_field")
SHIPPED = Path(__file__).with_name("data") / "ck14e.nc"
"""The file of coefficients that ships with the package."""
TAIL_END = 40.0  # rad/s; the damping is continued as ω⁻³ from the last frequency to here
POOL_TAPER = (9.0, 12.0)  # rad/s; above 12 rad/s the solver's pool rows are not clean


@dataclass(frozen=True)
class Hydrodynamics:
    """Frequency-domain coefficients of a hull, as the solver gave them.

    `added_mass` and `damping` have the shape (frequency, dof, dof), `excitation` (force per metre
    of wave amplitude) (frequency, dof), `mass` and `stiffness` (dof, dof). `far_field` holds two
    Hermitian forms in the vector (1, motions per metre), shape (frequency, 2, 1 + dof, 1 + dof):
    the power of the waves that go out, and its part along x, W/m². `attrs` are those of the file:
    conventions, versions, digest of the mesh, dimensions.
    """

    names: tuple[str, ...]
    omega: FloatArray
    added_mass: FloatArray
    damping: FloatArray
    excitation: ComplexArray
    mass: FloatArray
    stiffness: FloatArray
    far_field: ComplexArray
    attrs: dict[str, Any]


@dataclass(frozen=True)
class Kernel:
    """Radiation memory: K (kg/s²) at uniform lags (s), the added mass at infinite frequency."""

    lags: FloatArray
    values: FloatArray
    infinite_mass: FloatArray


def load_hydrodynamics(path: Path | str = "") -> Hydrodynamics:
    """Read and check a file of coefficients, by default the one that ships with the package.

    Raises
    ------
    RequestError
        If the file does not exist, misses a variable, has values that are not finite, or was made
        under another convention.
    """
    source = Path(path or SHIPPED)
    try:
        with reading(source) as place:
            data = xr.load_dataset(place, engine="h5netcdf")
    except (SeakeepError, OSError, ValueError) as error:
        raise RequestError(
            f"{source} is not a readable NetCDF file ({error}). Correct vessel.hydrodynamics, or "
            "build a file: tools/build_hydrodynamics.py SETTINGS.toml -o FILE.nc, in the source"
        ) from None
    for key, expected in CONVENTIONS.items():
        if data.attrs.get(key) != expected:
            raise RequestError(
                f"{source} was made under another convention: {key} is {data.attrs.get(key)!r}, "
                f"the tank needs {expected!r}. Convert the coefficients, or build the file with "
                "tools/build_hydrodynamics.py of the source."
            )
    bad = [n for n in VARIABLES if n not in data or not np.isfinite(data[n].values).all()]
    if bad:
        raise RequestError(
            f"{source} misses {', '.join(bad)}, or holds values there that are not finite. Build "
            "the file again."
        )
    names = tuple(str(n) for n in data["influenced_dof"].values)
    if names not in (RIGID, (*RIGID, *POOL_MODES)):
        raise RequestError(
            f"{source} has the degrees of freedom {', '.join(names)}; the tank needs "
            f"{', '.join(RIGID)}, with piston and slosh after them for a hull with a moon pool."
        )
    force, far_field = data["excitation"].values, data["far_field"].values.astype(float)
    as_stored = ("omega", "added_mass", "damping", "mass", "stiffness")
    return Hydrodynamics(
        names=names,
        excitation=force[0] + 1j * force[1],
        far_field=far_field[:, 0] + 1j * far_field[:, 1],
        attrs=dict(data.attrs),
        **{key: data[key].values for key in as_stored},
    )


def _passive(matrices: FloatArray) -> FloatArray:
    """Nearest symmetric positive semi-definite matrices (Frobenius norm)."""
    values, vectors = np.linalg.eigh(0.5 * (matrices + matrices.swapaxes(-1, -2)))
    clipped = np.maximum(values, 0.0)[..., None, :]
    projected = (vectors * clipped) @ vectors.swapaxes(-1, -2)
    return 0.5 * (projected + projected.swapaxes(-1, -2))


def passive_damping(hydro: Hydrodynamics) -> tuple[FloatArray, FloatArray]:
    """Damping for the kernel: symmetric, passive, from 0 to the end of its tail.

    Zero at zero frequency, shape-preserving cubics between the solver's frequencies, ω⁻³ beyond
    them; the moon pool's rows are tapered to zero over 9–12 rad/s: the solver is not clean there.
    Returns a grid of 0.02 rad/s and matrices of shape (grid, dof, dof).
    """
    omega = np.arange(0.0, TAIL_END + 0.01, 0.02)
    last = hydro.omega[-1]
    known = np.concatenate([np.zeros((1, *hydro.mass.shape)), _passive(hydro.damping)])
    inside = scipy.interpolate.PchipInterpolator(np.append(0.0, hydro.omega), known, axis=0)(
        np.minimum(omega, last)
    )
    tail = np.where(omega > last, (last / np.maximum(omega, last)) ** 3, 1.0)
    weight = np.ones((omega.size, len(hydro.names)))
    low, high = POOL_TAPER
    weight[:, len(RIGID) :] -= rising((omega - low) / (high - low))[:, None]
    # A congruence keeps the matrices passive.
    tapered = weight[:, :, None] * inside * tail[:, None, None] * weight[:, None, :]
    return omega, _passive(tapered)


def trapezoid(count: int, step: float) -> FloatArray:
    """Weights of the trapezoidal rule."""
    weights = np.full(count, step)
    weights[[0, -1]] *= 0.5
    return weights


def radiation_kernel(hydro: Hydrodynamics, step: float, length: float) -> Kernel:
    r"""Radiation kernel :math:`K(t) = \frac{2}{\pi}\int B(\omega)\cos\omega t\,d\omega` and A∞.

    Step and length of the lags are in seconds; A∞ by Ogilvie's relation, averaged over 2–9 rad/s.
    """
    omega, damping = passive_damping(hydro)
    lags = step * np.arange(round(length / step) + 1, dtype=float)
    flat = damping.reshape(omega.size, -1) * trapezoid(omega.size, omega[1])[:, None]
    values = (2.0 / np.pi) * np.cos(np.outer(lags, omega)) @ flat
    band = (hydro.omega >= 2.0) & (hydro.omega <= POOL_TAPER[0])
    if not np.any(band):
        band = np.ones(hydro.omega.size, bool)
    added = 0.5 * (hydro.added_mass + hydro.added_mass.swapaxes(1, 2))[band]
    sines = np.sin(np.outer(hydro.omega[band], lags)) * trapezoid(lags.size, step)
    sines /= hydro.omega[band, None]
    infinite = added + (sines @ values).reshape(added.shape)
    return Kernel(lags, values.reshape(-1, *hydro.mass.shape), infinite.mean(axis=0))


def kernel_coefficients(kernel: Kernel, omega: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Added mass and damping that a kernel reproduces, each of shape (frequency, dof, dof)."""
    weights = trapezoid(kernel.lags.size, kernel.lags[1])
    flat = kernel.values.reshape(kernel.lags.size, -1) * weights[:, None]
    phase = np.outer(omega, kernel.lags)
    shape = (-1, *kernel.infinite_mass.shape)
    added = kernel.infinite_mass - (np.sin(phase) @ flat / omega[:, None]).reshape(shape)
    return added, (np.cos(phase) @ flat).reshape(shape)


def _between(hydro: Hydrodynamics, values: ComplexArray, omega: FloatArray) -> ComplexArray:
    """Values between the solver's frequencies, by cubic splines."""
    low, high = hydro.omega[0], hydro.omega[-1]
    if omega.size and (omega.min() < low or omega.max() > high):
        raise RequestError(
            f"frequencies from {omega.min():g} to {omega.max():g} rad/s leave the band of the "
            f"hydrodynamics file, {low:g} to {high:g} rad/s. Narrow the spectrum, or build a file "
            "with more frequencies."
        )
    return scipy.interpolate.CubicSpline(hydro.omega, values, axis=0)(omega)


def excitation_at(hydro: Hydrodynamics, omega: FloatArray) -> ComplexArray:
    """Wave excitation per metre of amplitude, shape (frequency, dof), by cubic splines.

    Raises RequestError if a frequency lies outside the file's band.
    """
    return _between(hydro, hydro.excitation, omega)


def far_field_at(hydro: Hydrodynamics, omega: FloatArray) -> ComplexArray:
    """Forms of the outgoing waves between the solver's frequencies, by cubic splines."""
    return _between(hydro, hydro.far_field, omega)

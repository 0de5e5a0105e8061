"""The hull of the virtual tank: a parametric mesh of quadrilaterals and its hydrostatics.

The hull is a superellipse at the waterline whose sections shrink towards a flat bottom; a
recessed moon pool (a wide basin above a shelf, a narrower opening below it) is optional. The
origin is the centre of gravity's projection on the still water surface; the midship section is
moved until the buoyancy acts under it.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import Annotated, Self

import numpy as np
import numpy.typing as npt
import scipy
from pydantic import BeforeValidator, Field, model_validator

from seakeep.arrays import FloatArray
from seakeep.errors import RequestError
from seakeep.toml import Finite, Positive, Table
from seakeep.waves import GRAVITY

IntArray = npt.NDArray[np.int64]
Below = Annotated[float, Field(lt=0, ge=-1e4)]
Panels = Annotated[int, Field(ge=4)]


class PoolGeometry(Table):
    """Moon pool: a basin at the free surface above a shelf, a narrower opening below it (m)."""

    centre: Finite = -0.09
    length: Positive = 0.45
    beam: Positive = 0.36
    bottom_length: Positive = 0.36
    bottom_beam: Positive = 0.28
    shelf: Below = -0.035
    lid: Below = -0.01

    @model_validator(mode="after")
    def _nested(self) -> Self:
        if self.bottom_length > self.length or self.bottom_beam > self.beam:
            raise ValueError("the pool's bottom opening must fit inside its free surface")
        if self.shelf >= self.lid:
            raise ValueError("the pool's shelf must lie below its lid")
        return self


class HullSettings(Table):
    """Dimensions of the hull and the panels of its mesh; read by the mesh builder alone.

    ``pool = false`` in TOML is a hull without a moon pool.
    """

    mass: Positive
    centre_of_gravity: Finite
    pitch_gyradius: Positive
    length_waterline: Positive
    beam_waterline: Positive
    waterplane_area: Positive
    bottom_taper: Annotated[float, Field(ge=0, lt=0.6)]
    pool: Annotated[
        PoolGeometry | None, BeforeValidator(lambda value: None if value is False else value)
    ] = PoolGeometry()
    internal_lid: Below = -0.005
    panels_along: Panels = 14
    panels_across: Panels = 10
    panels_down: Annotated[int, Field(ge=2)] = 5
    panels_bottom: Annotated[int, Field(ge=2)] = 4


class Built(Table):
    """What the builder reads of the settings of a tank."""

    hull: HullSettings


@dataclass(frozen=True)
class HullMesh:
    """Wetted surface of a hull at rest, in metres: x downstream (the bow points to −x), z up.

    `faces` are counter-clockwise seen from the water; `pool_lid` marks those that close the moon
    pool just below its free surface. `internal_lid` (vertices and faces inside the hull) removes
    irregular frequencies. `draft`, `midship` and the waterline's `exponent` were solved for.
    """

    vertices: FloatArray
    faces: IntArray
    pool_lid: npt.NDArray[np.bool_]
    internal_lid: tuple[FloatArray, IntArray]
    draft: float
    midship: float
    exponent: float

    @property
    def digest(self) -> str:
        """SHA-256 of the mesh, coordinates rounded to a nanometre."""
        parts = [np.round(self.vertices, 9) + 0.0, self.faces, self.pool_lid]
        parts += [np.round(self.internal_lid[0], 9) + 0.0, self.internal_lid[1]]
        return hashlib.sha256(
            b"".join(np.ascontiguousarray(p).tobytes() for p in parts)
        ).hexdigest()


@dataclass(frozen=True)
class Hydrostatics:
    """Volume (m³), centre of buoyancy (m), waterplane (m²) and restoring of surge, heave, pitch.

    All net of the moon pool.
    """

    volume: float
    buoyancy: FloatArray
    waterplane: float
    stiffness: FloatArray


def _square(nx: int, ny: int) -> FloatArray:
    """Points on the boundary of the square [−1, 1]², counter-clockwise, shape (point, 2)."""
    x, y = np.linspace(-1, 1, nx + 1)[:-1], np.linspace(-1, 1, ny + 1)[:-1]
    below, right = _at(x[:, None], -1.0), np.column_stack([np.full(ny, 1.0), y])
    return np.concatenate([below, right, -below, -right])


def _superellipse(square: FloatArray, half: tuple[float, float], exponent: float) -> FloatArray:
    radius = (np.abs(square) ** exponent).sum(axis=1) ** (1.0 / exponent)
    points: FloatArray = square / radius[:, None] * np.asarray(half)
    return points


def _ring(rings: list[FloatArray]) -> tuple[FloatArray, IntArray]:
    """Quadrilaterals between successive closed rings of points, each of shape (point, 3)."""
    count, levels = rings[0].shape[0], len(rings)
    level, point = np.meshgrid(np.arange(levels - 1), np.arange(count), indexing="ij")
    ahead = (point + 1) % count
    corners = [
        level * count + point,
        level * count + ahead,
        (level + 1) * count + ahead,
        (level + 1) * count + point,
    ]
    return np.concatenate(rings), np.stack([c.ravel() for c in corners], axis=1)


def _rectangle(
    half: tuple[float, float], centre: float, z: float, shape: tuple[int, int]
) -> tuple[FloatArray, IntArray]:
    """Quadrilaterals of a level rectangle with upward normals."""
    nx, ny = shape
    x = centre + half[0] * np.linspace(-1, 1, nx + 1)
    y = half[1] * np.linspace(-1, 1, ny + 1)
    grid = np.stack([*np.meshgrid(x, y, indexing="ij"), np.full((nx + 1, ny + 1), z)], axis=-1)
    i, j = (g.ravel() for g in np.meshgrid(np.arange(nx), np.arange(ny), indexing="ij"))
    corner = i * (ny + 1) + j
    return grid.reshape(-1, 3), np.stack([corner, corner + ny + 1, corner + ny + 2, corner + 1], 1)


def _at(points: FloatArray, z: float) -> FloatArray:
    return np.column_stack([points, np.full(points.shape[0], z)])


def _between(first: FloatArray, last: FloatArray, count: int) -> list[FloatArray]:
    return [first + (last - first) * s for s in np.linspace(0.0, 1.0, count + 1)]


def _patches(
    hull: HullSettings, draft: float, midship: float, exponent: float
) -> tuple[list[tuple[FloatArray, IntArray]], tuple[FloatArray, IntArray]]:
    """Patches of the wetted surface (the last one is the pool's lid or the bottom's middle)."""
    nx, ny = hull.panels_along, hull.panels_across
    square = _square(nx, ny)
    waterline = _superellipse(
        square, (0.5 * hull.length_waterline, 0.5 * hull.beam_waterline), exponent
    )

    def contour(z: float) -> FloatArray:
        scale = 1.0 - hull.bottom_taper * (z / draft) ** 2
        return _at(waterline * scale + [midship, 0.0], z)

    # Rows are closer together near the surface, where the waves are.
    levels = -draft * np.linspace(0.0, 1.0, hull.panels_down + 1) ** 1.2
    pool = hull.pool
    opening = PoolGeometry() if pool is None else pool
    half_low = (0.5 * opening.bottom_length, 0.5 * opening.bottom_beam)
    low = square * half_low + [opening.centre, 0.0]
    bottom = _at(low, -draft)
    patches = [_ring([contour(z) for z in levels][::-1])]
    patches.append(_ring(_between(bottom, contour(-draft), hull.panels_bottom)))
    if pool is None:
        middle = _rectangle(half_low, opening.centre, -draft, (nx, ny))
        patches.append((middle[0], middle[1][:, ::-1]))
    else:
        half_high = (0.5 * pool.length, 0.5 * pool.beam)
        high = square * half_high + [pool.centre, 0.0]
        patches.append(_ring(_between(_at(low, pool.shelf), bottom, 2)))
        patches.append(_ring(_between(_at(high, pool.shelf), _at(low, pool.shelf), 2)))
        patches.append(_ring(_between(_at(high, pool.lid), _at(high, pool.shelf), 1)))
        lid = _rectangle(half_high, pool.centre, pool.lid, (nx, ny))
        patches.append((lid[0], lid[1][:, ::-1]))
    # As fine as the hull: a coarser one lets irregular frequencies through above 14 rad/s.
    centre = _rectangle(half_low, opening.centre, hull.internal_lid, (nx, ny))
    ring = _ring(_between(_at(low, hull.internal_lid), contour(hull.internal_lid), 7))
    internal = (
        np.concatenate([ring[0], centre[0]]),
        np.concatenate([ring[1], centre[1][:, ::-1] + len(ring[0])]),
    )
    return patches, internal


def _quadrature(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, FloatArray]:
    """Weighted normals and points, shape (6 × face, 3): exact for quadratics on plane panels.

    Each quadrilateral is two triangles, each integrated at the middles of its edges.
    """
    corners = [vertices[faces[:, i]] for i in range(4)]
    normals, points = [], []
    for i, j, k in ((0, 1, 2), (0, 2, 3)):
        a, b, c = corners[i], corners[j], corners[k]
        normal = np.cross(b - a, c - a) / 6
        normals += [normal] * 3
        points += [0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)]
    return np.stack(normals, 1).reshape(-1, 3), np.stack(points, 1).reshape(-1, 3)


def _volume(patches: list[tuple[FloatArray, IntArray]]) -> tuple[float, float]:
    """Displaced volume of all patches, and its first moment about x = 0."""
    volume = moment = 0.0
    for vertices, faces in patches:
        normal, point = _quadrature(vertices, faces)
        volume += float(np.sum(normal[:, 2] * point[:, 2]))
        moment += float(np.sum(normal[:, 2] * point[:, 2] * point[:, 0]))
    return volume, moment


def _waterplane(hull: HullSettings, exponent: float) -> float:
    square = _square(hull.panels_along, hull.panels_across)
    half = (0.5 * hull.length_waterline, 0.5 * hull.beam_waterline)
    x, y = _superellipse(square, half, exponent).T
    gross = 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))
    return gross - (0.0 if hull.pool is None else hull.pool.length * hull.pool.beam)


def _solve_shape(hull: HullSettings, density: float) -> tuple[float, float, float]:
    """Draft, midship and exponent that give the mass, an upright hull and the waterplane area."""
    if not _waterplane(hull, 1.5) < hull.waterplane_area < _waterplane(hull, 40.0):
        raise RequestError(
            f"no waterline of {hull.length_waterline:g} × {hull.beam_waterline:g} m has a net area "
            f"of {hull.waterplane_area:g} m²; between {_waterplane(hull, 1.5):.3f} and "
            f"{_waterplane(hull, 40.0):.3f} m² is possible. Change waterplane_area."
        )
    exponent = float(
        scipy.optimize.brentq(lambda n: _waterplane(hull, n) - hull.waterplane_area, 1.5, 40.0)
    )
    target = hull.mass / density

    # The thin layer between the pool's lid and its free surface is water, not hull.
    layer = 0.0 if hull.pool is None else hull.pool.length * hull.pool.beam * -hull.pool.lid

    def volume(draft: float) -> float:
        return _volume(_patches(hull, draft, 0.0, exponent)[0])[0] - layer

    lowest = 0.02 if hull.pool is None else 0.005 - hull.pool.shelf
    if volume(lowest) > target or volume(1.0) < target:
        raise RequestError(
            f"no draft between {lowest:g} and 1 m displaces {target:g} m³; received a mass of "
            f"{hull.mass:g} kg. Check the mass, the waterline's length and beam, and the shelf."
        )
    draft = float(scipy.optimize.brentq(lambda d: volume(d) - target, lowest, 1.0, xtol=1e-12))

    def lever(midship: float) -> float:
        moment = _volume(_patches(hull, draft, midship, exponent)[0])[1]
        return moment - (0.0 if hull.pool is None else layer * hull.pool.centre)

    quarter = 0.25 * hull.length_waterline
    midship = float(scipy.optimize.brentq(lever, -quarter, quarter, xtol=1e-12))
    return draft, midship, exponent


def hull_mesh(hull: HullSettings, density: float = 1000.0) -> HullMesh:
    """Mesh the hull: solve draft, waterline and trim, then lay the panels.

    Raises RequestError if no draft or waterline gives the mass or area asked for.
    """
    draft, midship, exponent = _solve_shape(hull, density)
    patches, internal = _patches(hull, draft, midship, exponent)
    offsets = np.cumsum([0] + [len(vertices) for vertices, _ in patches])
    faces = [f + offset for (_, f), offset in zip(patches, offsets[:-1], strict=True)]
    lid = np.zeros(sum(map(len, faces)), dtype=bool)
    if hull.pool is not None:
        lid[-len(faces[-1]) :] = True
    return HullMesh(
        vertices=np.concatenate([vertices for vertices, _ in patches]),
        faces=np.concatenate(faces),
        pool_lid=lid,
        internal_lid=internal,
        draft=draft,
        midship=midship,
        exponent=exponent,
    )


def hydrostatics(mesh: HullMesh, hull: HullSettings, density: float = 1000.0) -> Hydrostatics:
    """Integrate volume, centre of buoyancy, waterplane and restoring over a mesh."""
    normal, point = _quadrature(mesh.vertices, mesh.faces[~mesh.pool_lid])
    nz, x, z = -normal[:, 2], point[:, 0], point[:, 2]
    volume = float(np.sum(nz * -z))
    # Level waterplane: its area and moments are those of the vertical projection of the hull.
    area, first, second = (float(np.sum(nz * x**power)) for power in (0, 1, 2))
    buoyancy = np.array([np.sum(nz * -z * x), 0.0, np.sum(nz * -0.5 * z**2)]) / volume
    heave = density * GRAVITY * area
    coupling = -density * GRAVITY * first
    # For small angles the restoring of pitch is ρg (∫x² dS + V (z_B − z_G)).
    pitch = density * GRAVITY * (second + volume * (buoyancy[2] - hull.centre_of_gravity))
    stiffness = np.array([[0.0, 0, 0], [0, heave, coupling], [0, coupling, pitch]])
    return Hydrostatics(volume, buoyancy, area, stiffness)

r"""Motions of points of a rigid body, and readings of accelerometers on it.

Axes: x along the waves, y, z up; roll, pitch and yaw are right-handed about them. With
:math:`R = R_z(\psi) R_y(\theta) R_x(\phi)` a vector r fixed in the body is :math:`R r` in space.
Angular velocities and accelerations are those a gyroscope fixed in the body gives.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from seakeep.arrays import ArrayLike, FloatArray, as_real
from seakeep.errors import RequestError
from seakeep.waves import GRAVITY


def _vectors(**values: ArrayLike) -> list[FloatArray]:
    """Vectors of one length in time, or of one instant; names are those of the arguments."""
    arrays = [as_real(each, name) for name, each in values.items()]
    lengths = {len(array) for array in arrays if array.ndim == 2} - {1}
    if any(array.ndim != 2 or array.shape[1] != 3 for array in arrays) or len(lengths) > 1:
        received = ", ".join(f"{name}: {a.shape}" for name, a in zip(values, arrays, strict=True))
        raise RequestError(
            "vectors have the shape (time, 3), one column for each of x, y and z, and the same "
            f"length; received {received}. Use zeros for what was not measured."
        )
    return arrays


def _offset(offset: ArrayLike) -> FloatArray:
    array = as_real(offset, "the offset")
    if array.shape != (3,) or not np.all(np.isfinite(array)):
        raise RequestError(
            f"the offset between two points is (x, y, z) in metres; received {offset!r}."
        )
    return array


def rotation_matrix(angles: ArrayLike) -> FloatArray:
    """Rotation from the body's axes to those of space.

    Parameters
    ----------
    angles : array_like, shape (time, 3)
        Roll, pitch and yaw, rad.

    Returns
    -------
    ndarray, shape (time, 3, 3)
        Yaw after pitch after roll.

    Raises
    ------
    RequestError
        If the shape is another.

    Examples
    --------
    >>> import numpy as np
    >>> bow = rotation_matrix([[0.0, 0.1, 0.0]])[0] @ [-1.0, 0.0, 0.0]
    >>> bool(bow[2] > 0)  # a positive pitch lifts the bow, which points against the waves
    True
    """
    return Rotation.from_euler("xyz", _vectors(angles=angles)[0]).as_matrix()


def transfer_position(position: ArrayLike, angles: ArrayLike, offset: ArrayLike) -> FloatArray:
    """Displacement of one point of a body from that of another.

    Parameters
    ----------
    position : array_like, shape (time, 3)
        Displacement of the measured point from its place at rest, m.
    angles : array_like, shape (time, 3)
        Roll, pitch and yaw, rad.
    offset : array_like, shape (3,)
        From the measured point to the wanted one, in the body's axes, m.

    Returns
    -------
    ndarray, shape (time, 3)
        Displacement of the wanted point from its place at rest, m.

    Raises
    ------
    RequestError
        If a shape is wrong.

    Examples
    --------
    >>> import numpy as np
    >>> moved = transfer_position([[0.025, 0, 0]], [[0, 0.1, 0]], [0, 0, -0.25])
    >>> bool(abs(moved[0, 0]) < 1e-4)  # the mast leans back, the centre stays
    True
    """
    r = _offset(offset)
    moved, turn = _vectors(position=position, angles=angles)
    return moved + rotation_matrix(turn) @ r - r


def transfer_velocity(
    velocity: ArrayLike,
    angles: ArrayLike,
    rates: ArrayLike,
    offset: ArrayLike,
) -> FloatArray:
    """Velocity of one point of a body from that of another.

    Parameters
    ----------
    velocity : array_like, shape (time, 3)
        Of the measured point, in the axes of space, m/s.
    angles, rates : array_like, shape (time, 3)
        Roll, pitch and yaw, rad; angular velocity about the body's axes, rad/s.
    offset : array_like, shape (3,)
        From the measured point to the wanted one, in the body's axes, m.

    Returns
    -------
    ndarray, shape (time, 3)
        Of the wanted point, m/s.

    Raises
    ------
    RequestError
        If a shape is wrong.
    """
    v, turned, omega = _vectors(velocity=velocity, angles=angles, rates=rates)
    turn = np.cross(omega, _offset(offset))
    return v + np.einsum("tij,tj->ti", rotation_matrix(turned), turn)


def transfer_acceleration(
    acceleration: ArrayLike,
    angles: ArrayLike,
    rates: ArrayLike,
    angular_acceleration: ArrayLike,
    offset: ArrayLike,
) -> FloatArray:
    r"""Acceleration of one point of a body from that of another.

    Parameters
    ----------
    acceleration : array_like, shape (time, 3)
        Of the measured point, in the axes of space, without gravity, m/s².
    angles, rates, angular_acceleration : array_like, shape (time, 3)
        Roll, pitch and yaw, rad; angular velocity, rad/s, and acceleration, rad/s², about the
        body's axes.
    offset : array_like, shape (3,)
        From the measured point to the wanted one, in the body's axes, m.

    Returns
    -------
    ndarray, shape (time, 3)
        :math:`a + R(\alpha \times r + \omega \times (\omega \times r))`, m/s².

    Raises
    ------
    RequestError
        If a shape is wrong.
    """
    r = _offset(offset)
    a, turned, omega, alpha = _vectors(
        acceleration=acceleration,
        angles=angles,
        rates=rates,
        angular_acceleration=angular_acceleration,
    )
    turn = np.cross(alpha, r) + np.cross(omega, np.cross(omega, r))
    return a + np.einsum("tij,tj->ti", rotation_matrix(turned), turn)


def remove_gravity(
    specific_force: ArrayLike,
    angles: ArrayLike,
    zeroed: bool = False,
) -> FloatArray:
    r"""Acceleration in space from what three accelerometers on the body read.

    Parameters
    ----------
    specific_force : array_like, shape (time, 3)
        Readings along the body's axes, m/s²: :math:`f = R^T (a + g \hat z)`, (0, 0, g) at rest.
    angles : array_like, shape (time, 3)
        Roll, pitch and yaw, rad.
    zeroed : bool, optional
        Whether the readings were set to zero at rest, upright: g is then added to z first.

    Returns
    -------
    ndarray, shape (time, 3)
        Acceleration of the place of the accelerometers, in the axes of space, m/s².

    Raises
    ------
    RequestError
        If a shape is wrong.

    Examples
    --------
    >>> import numpy as np
    >>> at_rest = remove_gravity([[-9.81 * np.sin(0.1), 0, 9.81 * np.cos(0.1)]], [[0, 0.1, 0]])
    >>> bool(np.allclose(at_rest, 0.0))  # tilted, and not moving
    True
    """
    upward = np.array([0.0, 0.0, GRAVITY])
    read, angles = _vectors(specific_force=specific_force, angles=angles)
    force = read + (upward if zeroed else 0.0)
    return np.einsum("tij,tj->ti", rotation_matrix(angles), force) - upward

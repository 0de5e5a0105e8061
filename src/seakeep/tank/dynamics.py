r"""Motion of the moored vessel in a sea: Cummins' equation in the time domain.

.. math::

   (M + A_\infty)\ddot q + \int_0^{T} K(\tau)\dot q(t-\tau)\,d\tau + K_h q + C\dot q
   + F_\mathrm{visc} = F_\mathrm{exc} + F_\mathrm{drift} + F_\mathrm{moor} + F_\mathrm{wdd}

Wave forces act at the slow part of surge (surge less its linear wave-frequency part): taken at
the full surge they would feign a mean force.
"""

from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np

from seakeep.arrays import ArrayLike, ComplexArray, FloatArray
from seakeep.errors import RequestError, SeakeepError, needing
from seakeep.tank.hydrodynamics import (
    RIGID,
    Hydrodynamics,
    Kernel,
    excitation_at,
    far_field_at,
    kernel_coefficients,
    load_hydrodynamics,
    radiation_kernel,
    trapezoid,
)
from seakeep.tank.seas import Sea
from seakeep.tank.settings import DriftSettings, LineSettings, TankSettings
from seakeep.waves import GRAVITY, wavenumber

LIMITS = {"surge": 20.0, "heave": 2.0, "pitch": 1.2, "piston": 2.0, "slosh": 2.0}
"""Beyond these (m, rad) a simulation has left the physics it was made for."""

STABLE = 2.7  # RK4 is stable for |λ|·dt up to 2.78 on the imaginary and 2.785 on the real axis
ITERATIONS = 100  # of the losses in a sea; some twenty are enough
SLOPE = 0.02  # rad/s, to either side for the slope of the drift force
KERNEL_RATE = 40.0  # rad/s, the fastest motion in the radiation kernel


class DivergenceError(SeakeepError):
    """A simulation left the range in which its physics holds."""


@dataclass(frozen=True)
class Rig:
    """Vessel and moorings, ready for the time loop.

    `linear` and `quadratic` are the viscous damping of each degree of freedom; `pool` the centre
    of the moon pool (m), quadratic and linear loss of the flow through its opening; `lines` the
    moorings as in `line_table`; `step` and `ramp` are in seconds.
    """

    hydro: Hydrodynamics
    kernel: Kernel
    linear: FloatArray
    quadratic: FloatArray
    pool: FloatArray
    lines: FloatArray
    drift: DriftSettings
    step: float
    ramp: float

    @property
    def names(self) -> tuple[str, ...]:
        """Degrees of freedom."""
        return self.hydro.names

    @property
    def inertia(self) -> FloatArray:
        """Mass and added mass at infinite frequency, shape (dof, dof)."""
        return self.hydro.mass + self.kernel.infinite_mass

    @property
    def mooring_stiffness(self) -> FloatArray:
        """Stiffness and geometric stiffness of the taut lines at rest, shape (dof, dof)."""
        total = np.zeros_like(self.hydro.mass)
        for eye_x, eye_z, pole_x, pole_z, stiffness, unstretched, _ in self.lines:
            along = np.array([pole_x - eye_x, pole_z - eye_z])
            length = np.hypot(*along)
            stretch = length - unstretched
            if stretch <= 0:
                continue
            unit = along / length
            tension = stiffness * stretch
            local = stiffness * np.outer(unit, unit)
            local += tension / length * (np.eye(2) - np.outer(unit, unit))
            arm = np.array([[1.0, 0.0, eye_z], [0.0, 1.0, -eye_x]])
            total[:3, :3] += arm.T @ local @ arm
            # A turned eye keeps its tension: its second derivative with pitch is minus the arm.
            total[2, 2] += tension * (unit @ np.array([eye_x, eye_z]))
        return total

    @property
    def flow(self) -> FloatArray:
        """Flows that lose energy per velocity: of each motion and out of the pool's opening."""
        through = np.zeros(len(self.names))
        if through.size > len(RIGID):
            through[1:4] = -1.0, self.pool[0], 1.0
        return np.vstack([np.eye(len(self.names)), through])

    @property
    def linear_damping(self) -> FloatArray:
        """Linear viscous damping, the pool's coupling included, shape (dof, dof)."""
        return (self.flow.T * np.append(self.linear, self.pool[2])) @ self.flow


@dataclass(frozen=True)
class Motion:
    """What a simulation gives: arrays of shape (dof, time), SI and radians.

    `memory` is the radiation memory force (on the left-hand side of the equation), `slow_surge`
    surge less its linear wave-frequency part, shape (time,).
    """

    time: FloatArray
    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    memory: FloatArray
    slow_surge: FloatArray


def _loop() -> ModuleType:
    with needing("the virtual tank", "tank"):
        from seakeep.tank import _loop
    return _loop


def line_table(
    lines: dict[str, LineSettings], position: float, centre_of_gravity: float
) -> FloatArray:
    """Lines as rows of numbers for the time loop.

    Columns: x and z of eye and pole, stiffness, length at rest without tension, and damping.
    Lengths count from the centre of gravity at rest: `position` from the wave maker, the other
    above still water.

    Raises
    ------
    RequestError
        If eye and pole coincide, or the pretension stretches a line beyond its length at rest.
    """
    table = np.zeros((len(lines), 7))
    for row, (name, line) in zip(table, lines.items(), strict=True):
        eye = (line.eye[0], line.eye[1] - centre_of_gravity)
        pole = (line.pole[0] - position, line.pole[1] - centre_of_gravity)
        rest = np.hypot(line.pole[0] - position - line.eye[0], line.pole[1] - line.eye[1])
        stretch = line.pretension / line.stiffness
        length = rest - stretch
        if length <= 0:
            raise RequestError(
                f"moorings.{name} has no length left: at rest eye and pole are {rest:.3f} m apart "
                f"and a pretension of {line.pretension:g} N stretches it by {stretch:.3f} "
                "m. Lower the pretension, stiffen the line, or move its pole."
            )
        row[:] = [*eye, *pole, line.stiffness, length, line.damping]
    return table


def _check_step(rig: Rig) -> None:
    """Refuse a step beyond the stability of the integrator or the resolution of the kernel."""
    dofs = len(rig.names)
    forces = np.hstack([rig.hydro.stiffness + rig.mooring_stiffness, rig.linear_damping])
    # Velocity and acceleration by position and velocity.
    system = np.vstack([np.eye(dofs, 2 * dofs, dofs), -np.linalg.solve(rig.inertia, forces)])
    fastest = np.max(np.abs(np.linalg.eigvals(system)))
    largest = min(STABLE / fastest, 2.0 / KERNEL_RATE)
    if rig.step > largest:
        raise RequestError(
            f"simulation.step = {rig.step:g} s is too large: the integration is stable and "
            f"resolves the radiation kernel up to {largest:.3g} s (fastest natural frequency "
            f"{fastest:.3g} rad/s). Take a smaller step; 0.01 s is usual."
        )


def assemble_rig(settings: TankSettings, hydro: Hydrodynamics | None = None) -> Rig:
    """Put vessel, hydrodynamics and moorings together.

    Raises
    ------
    RequestError
        If depth or density differ from the hydrodynamics file's, a line has no length, or the
        step is too large.
    """
    coefficients = hydro or load_hydrodynamics(settings.vessel.hydrodynamics)
    for name in ("water_depth", "density"):
        wanted, built = getattr(settings.facility, name), coefficients.attrs[name]
        if abs(wanted - built) > 1e-6 * built:
            raise RequestError(
                f"facility.{name} is {wanted:g} and the hydrodynamics file was made for {built:g}. "
                "Set facility to the file's value, or build a file for this one: "
                "tools/build_hydrodynamics.py SETTINGS.toml -o FILE.nc, in the source"
            )
    vessel, losses = settings.vessel, settings.vessel.pool
    linear, quadratic = (
        [each.surge, each.heave, each.pitch]
        for each in (vessel.linear_damping, vessel.quadratic_damping)
    )
    flow = np.zeros(3)
    if len(coefficients.names) > len(RIGID):
        linear += [0.0, losses.slosh_linear]
        quadratic += [0.0, losses.slosh_quadratic]
        hull = coefficients.attrs
        contraction = (hull["pool_area"] / hull["pool_opening"]) ** 2
        quadratic_loss = 0.5 * hull["density"] * losses.loss_coefficient * contraction
        flow[:] = hull["pool_centre"], quadratic_loss * hull["pool_area"], losses.piston_linear
    step = settings.simulation.step
    height = coefficients.attrs["centre_of_gravity"]
    rig = Rig(
        hydro=coefficients,
        kernel=radiation_kernel(coefficients, step, settings.simulation.kernel_length),
        linear=np.array(linear),
        quadratic=np.array(quadratic),
        pool=flow,
        lines=line_table(settings.moorings, vessel.position, height),
        drift=settings.drift,
        step=step,
        ramp=settings.simulation.ramp,
    )
    _check_step(rig)
    return rig


def sea_losses(rig: Rig, sea: Sea) -> FloatArray:
    r"""Linear damping that takes as much energy as all viscous losses do in a sea, (dof, dof).

    Quadratic drag of the speed v is worth :math:`E|v|^3 / E v^2` times its coefficient:
    :math:`8/(3\pi)` amplitudes of a regular wave, :math:`\sqrt{8/\pi}` standard deviations of an
    irregular sea. The speeds are those of the linear response with the same losses.
    """
    losses, drag = rig.linear_damping, np.append(rig.quadratic, rig.pool[1])
    weights = np.zeros(drag.size)
    for _ in range(ITERATIONS):
        motion = linear_response(rig, sea.omega, losses)
        power = 0.5 * np.abs(sea.omega * sea.amplitude * (rig.flow @ motion.T)) ** 2
        total = power.sum(axis=1)
        steady = power.max(axis=1, initial=0.0) > 0.5 * total
        damping = drag * np.where(steady, 8 * np.sqrt(2) / (3 * np.pi), np.sqrt(8 / np.pi))
        damping = damping * np.sqrt(total)
        if np.allclose(damping, weights, rtol=1e-9, atol=1e-12):
            break
        weights = damping
        losses = rig.linear_damping + (rig.flow.T * weights) @ rig.flow
    return losses


def _drift_terms(
    rig: Rig, omega: FloatArray, losses: FloatArray
) -> tuple[ComplexArray, ComplexArray]:
    r"""Wave and motions u per metre of amplitude, and F u, whose product u*·F u is the mean force.

    A wave carries k/ω of momentum per energy. What the incident wave loses is absorbed by
    `losses` or goes out again, and what goes out takes momentum along with it (Maruo, Newman):
    :math:`D = \frac{k}{\omega}\,[P_\mathrm{absorbed} + \int p(\theta)(1 - \cos\theta)\,d\theta]`.
    Every part is a quadratic form in u. Shape (frequency, 1 + dof) each.
    """
    both = np.column_stack([np.ones(omega.size), linear_response(rig, omega, losses)])
    out, along = far_field_at(rig.hydro, omega).swapaxes(0, 1)
    form = out - along
    form[:, 1:, 1:] += 0.5 * omega[:, None, None] ** 2 * losses
    ratio = rig.drift.scale * wavenumber(omega, rig.hydro.attrs["water_depth"]) / omega
    return both, ratio[:, None] * np.einsum("nij,nj->ni", form, both)


def mean_drift(rig: Rig, omega: FloatArray, losses: FloatArray) -> FloatArray:
    """Mean drift force per metre² of amplitude, N/m², from the balance of energy and momentum."""
    both, force = _drift_terms(rig, omega, losses)
    return np.maximum(np.sum(both.conj() * force, axis=1).real, 0.0)


def drift_coefficient(rig: Rig, sea: Sea) -> tuple[FloatArray, FloatArray]:
    r"""Mean drift force and wave-drift damping per metre² of amplitude, N/m² and N s/m³.

    Both for each component of a sea; the damping is Aranha's
    :math:`(\omega^2/g)\,D' + 4\omega D/g`.
    """
    losses, w = sea_losses(rig, sea), sea.omega
    low, high = (np.clip(w + d, rig.hydro.omega[0], rig.hydro.omega[-1]) for d in (-SLOPE, SLOPE))
    force = mean_drift(rig, w, losses)
    slope = (mean_drift(rig, high, losses) - mean_drift(rig, low, losses)) / (high - low)
    return force, w**2 / GRAVITY * slope + 4.0 * w / GRAVITY * force


def drift_envelopes(rig: Rig, sea: Sea) -> tuple[FloatArray, ComplexArray]:
    r"""Slow drift force of a sea as a sum of squared envelopes.

    With the phases :math:`\theta_n` of the components at the vessel, the force is
    :math:`\sum_r s_r |\sum_n e_{rn}\,e^{i\theta_n}|^2`. Newman's law is one envelope,
    :math:`\sqrt{D_n}\,a_n`. The law ``qtf`` is the balance of :func:`mean_drift` for each pair of
    components, :math:`D_{mn} = \frac12 u_m^* (F_m + F_n)\, u_n` with wave and motions u: it keeps
    the phases of the motions, and its diagonal is the mean force. It holds neither the
    second-order potential nor what the water near the hull stores within a group of waves.

    Returns
    -------
    tuple of ndarray
        The signs s, N, shape (envelope,), and e, shape (envelope, component).
    """
    losses = sea_losses(rig, sea)
    if rig.drift.law == "newman":
        single = np.sqrt(mean_drift(rig, sea.omega, losses)) * sea.amplitude
        return np.ones(1), single[None].astype(complex)
    # D is of rank 2 (1 + dof) at most: its envelopes are the eigenvectors of a small matrix.
    both, force = _drift_terms(rig, sea.omega, losses)
    basis, factor = np.linalg.qr(np.hstack([both, force]).conj() * sea.amplitude[:, None])
    first, second = np.hsplit(factor, 2)
    mixed = first @ second.conj().T
    values, vectors = np.linalg.eigh(0.5 * (mixed + mixed.conj().T))
    significant = np.abs(values) > 1e-6 * np.abs(values).max(initial=0.0)
    return values[significant], (basis @ vectors[:, significant]).conj().T


def linear_response(rig: Rig, omega: FloatArray, losses: FloatArray | None = None) -> ComplexArray:
    r"""Linear response of the moored vessel as the time loop sees it, shape (frequency, dof).

    Per metre of wave amplitude, q of :math:`(-\omega^2 (M + A) - i\omega (B + C) + K)\,q = X`,
    with the kernel's A and B, the stiffness K of water and taut lines, and as damping C `losses`,
    by default the linear part of the viscous ones. Raises RequestError if a frequency lies
    outside the hydrodynamics file's band.
    """
    force = excitation_at(rig.hydro, omega)[..., None]
    added, radiated = kernel_coefficients(rig.kernel, omega)
    damping = radiated + (rig.linear_damping if losses is None else losses)
    w = omega[:, None, None]
    dynamic = -(w**2) * (rig.hydro.mass + added) - 1j * w * damping
    dynamic = dynamic + rig.hydro.stiffness + rig.mooring_stiffness
    return np.asarray(np.linalg.solve(dynamic, force)[..., 0], complex)


def _waves(rig: Rig, sea: Sea, begin: float) -> Any:
    """Waves of a sea as the loop takes them, for a run whose first instant is `begin`."""
    force = excitation_at(rig.hydro, sea.omega) * sea.amplitude[:, None]
    surge = linear_response(rig, sea.omega)[:, 0] * sea.amplitude
    signs, envelopes = drift_envelopes(rig, sea)
    damping = 0.0
    if rig.drift.damping:
        damping = np.sum(drift_coefficient(rig, sea)[1] * sea.amplitude**2)
    parts = (np.concatenate([x.real, x.imag]) for x in (force.T, envelopes))
    excitation, drift = (np.ascontiguousarray(x) for x in parts)
    components = np.stack([sea.omega, sea.wavenumber, surge.real, surge.imag])
    phase = sea.phase - sea.omega * begin
    return _loop().Waves(components, phase, excitation, signs, drift, damping)


def simulate(
    rig: Rig, sea: Sea, duration: float, start: ArrayLike | None = None, begin: float = 0.0
) -> Motion:
    """Simulate a run.

    Parameters
    ----------
    rig : Rig
        Vessel and moorings.
    sea : Sea
        The waves; they grow from rest over ``rig.ramp``.
    duration : float
        s.
    start : array_like, shape (2, dof), optional
        Position and velocity at the start; the default is rest.
    begin : float, optional
        Time of the first instant, s; the sea's phases refer to time zero.

    Raises
    ------
    RequestError
        If numba is missing, or the sea leaves the band of the hydrodynamics file.
    DivergenceError
        If the simulation diverges; the message names the time and the degree of freedom.
    """
    loop = _loop()
    dofs = len(rig.names)
    steps = max(1, round(duration / rig.step))
    # Pairs of degrees of freedom that have a memory, and their weights from the oldest lag.
    memories = rig.kernel.values * trapezoid(rig.kernel.lags.size, rig.step)[:, None, None]
    pairs = np.argwhere(np.any(memories != 0.0, axis=0))
    kernel = np.ascontiguousarray(memories[::-1, pairs[:, 0], pairs[:, 1]].T)
    state = np.zeros((2, dofs)) if start is None else np.array(start, float)
    inverse, hydro = np.linalg.inv(rig.inertia), rig.hydro
    body = (inverse, hydro.stiffness, rig.linear, rig.quadratic, rig.pool, rig.lines)
    q, v, a, memory, slow, failed, which = loop.integrate(
        steps,
        rig.step,
        rig.ramp,
        state,
        # Contiguous, so that every hull runs the same compiled code.
        loop.Body(*map(np.ascontiguousarray, body)),
        pairs,
        kernel,
        _waves(rig, sea, begin),
        np.array([LIMITS[name] for name in rig.names]),
    )
    if failed >= 0:
        name = rig.names[which]
        raise DivergenceError(
            f"the simulation diverged at t = {begin + failed * rig.step:.2f} s in {name}, which "
            f"passed {LIMITS[name]:g} {'rad' if name == 'pitch' else 'm'}. Lower the waves, raise "
            "the damping, stiffen the moorings, or take a smaller simulation.step."
        )
    time = begin + rig.step * np.arange(steps + 1, dtype=float)
    return Motion(time, q, np.ascontiguousarray(v), a, memory, slow)


def tensions(rig: Rig, position: FloatArray, velocity: FloatArray) -> FloatArray:
    """Tension of each line along a motion of shape (dof, time), N, shape (line, time)."""
    return _loop().line_tensions(
        rig.lines, np.ascontiguousarray(position), np.ascontiguousarray(velocity)
    )

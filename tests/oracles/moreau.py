"""Moreau's implicit time stepping of order one, for several contacts with dry friction.

Moreau, *Unilateral contact and dry friction in finite freedom dynamics*, CISM 302 (1988); Acary &
Brogliato, *Numerical Methods for Nonsmooth Dynamical Systems* (2008), chapter 10. No event is
located and no regularisation is made: in every step the contact impulses solve a convex problem.
The force, threshold and surface speed enter as samples on a uniform grid of n steps, row 0 at t = 0
and row n at t = T.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from stickslip.arrays import Array, Matrix, Vector
from stickslip.machine_code.functions import entry_point
from stickslip.translator import compiled

TOLERANCE = 1e-12
RELAXATION = 1.2
SWEEPS = 100_000


def moreau(
    M: Array,
    C: Array,
    K: Array,
    J: Array,
    force: Array,
    threshold: Array,
    surface_speed: Array,
    q0: Array,
    v0: Array,
    T: float,
    n: int,
) -> tuple[Array, Array, Array]:
    """Motion of M q'' + C q' + K q = f + Jᵀλ, λᵢ ∈ −sᵢ Sign(uᵢ), u = J q' − w.

    Each step of length h solves, with everything taken at its end,

        M(v⁺ − v) + h C v⁺ + h K(q + h v⁺) = h f⁺ + h Jᵀλ,    q⁺ = q + h v⁺.

    Parameters
    ----------
    M, C, K : ndarray, shape (d, d)
        Mass, viscosity and stiffness; M + hC + h²K has to be regular.
    J : ndarray, shape (c, d)
        Directions of the contacts.
    force : ndarray, shape (n + 1, d)
        Samples of f.
    threshold, surface_speed : ndarray, shape (n + 1, c)
        Samples of s ≥ 0 and of w.
    q0, v0 : ndarray, shape (d,)
        Initial position and velocity.
    T : float
        Final time.
    n : int
        Number of steps.

    Returns
    -------
    q, v : ndarray, shape (n + 1, d)
        Position and velocity on the grid.
    contact_force : ndarray, shape (n, c)
        Row i is λ in the step from i to i + 1.

    Raises
    ------
    ValueError
        If a sampled input has another shape.
    RuntimeError
        If Gauss-Seidel does not reach its tolerance.
    """
    (c, d), h = np.shape(J), T / n
    for name, samples, width in (
        ("force", force, d),
        ("threshold", threshold, c),
        ("surface_speed", surface_speed, c),
    ):
        if np.shape(samples) != (n + 1, width):
            raise ValueError(f"{name} has the shape {np.shape(samples)}, expected {(n + 1, width)}")
    inverse = np.linalg.inv(M + h * C + h**2 * K)
    M, K, J, inverse, W = map(_dense, (M, K, J, inverse, J @ inverse @ np.transpose(J)))
    force, threshold, surface_speed = map(_dense, (force, threshold, surface_speed))
    q = np.empty((n + 1, d))
    v = np.empty((n + 1, d))
    contact_force = np.empty((n, c))
    q[0], v[0] = q0, v0
    work = Work(np.empty(d), np.empty(d), np.empty(c), np.empty(c), np.zeros(c))
    if not _steps(
        M, K, J, inverse, W, h, force, threshold, surface_speed, q, v, contact_force, work
    ):
        raise RuntimeError(f"Gauss-Seidel did not converge in {SWEEPS} sweeps")
    return q, v, contact_force


def first_order(
    C: Array,
    K: Array,
    J: Array,
    force: Array,
    threshold: Array,
    surface_speed: Array,
    z0: Array,
    T: float,
    n: int,
) -> tuple[Array, Array, Array]:
    """Motion of the viscous system C z' + K z = f + Jᵀλ, λᵢ ∈ −sᵢ Sign(uᵢ), u = J z' − w: `moreau`
    without mass.

    Returns
    -------
    z : ndarray, shape (n + 1, d)
        Position on the grid.
    v, contact_force : ndarray, shapes (n, d) and (n, c)
        Row i is the velocity and λ in the step from i to i + 1.
    """
    z, v, contact_force = moreau(
        np.zeros_like(C), C, K, J, force, threshold, surface_speed, z0, np.zeros_like(z0), T, n
    )
    return z, v[1:], contact_force


def rate_independent(A: Array, load: Array, threshold: Array, z0: Array) -> Array:
    """Rate-independent evolution A z ∋ ℓ − s Sign(z'), by incremental minimisation.

    z_k = argmin ½⟨Az, z⟩ − ⟨ℓ_k, z⟩ + Σ sᵢ|zᵢ − zᵢ,ₖ₋₁| (Mielke & Roubíček, *Rate-Independent
    Systems*, 2015). In one coordinate the minimiser is a clip, the play operator; Gauss-Seidel over
    the coordinates does the rest.

    Parameters
    ----------
    A : ndarray, shape (d, d)
        Symmetric positive definite.
    load, threshold : ndarray, shape (n + 1, d)
        Samples of ℓ and of s ≥ 0.
    z0 : ndarray, shape (d,)
        Initial value, returned as row 0 whether or not it is stable.

    Returns
    -------
    z : ndarray, shape (n + 1, d)

    Raises
    ------
    RuntimeError
        If Gauss-Seidel does not reach its tolerance.
    """
    A, load, threshold = map(_dense, (A, load, threshold))
    z = np.empty(load.shape)
    z[0] = z0
    if not _increments(A, load, threshold, z):
        raise RuntimeError(f"Gauss-Seidel did not converge in {SWEEPS} sweeps")
    return z


def _dense(a: ArrayLike) -> Array:
    """The one memory layout that the kernels are compiled for."""
    return np.require(a, np.float64, ("C", "A", "W"))


class Work(NamedTuple):
    """Work space of a step.

    Attributes
    ----------
    free, pull : arrays, shape (d,)
        Velocity without contacts, and momenta.
    slip, bound, impulse : arrays, shape (c,)
        The impulse is kept from step to step as a start for the next.
    """

    free: Vector
    pull: Vector
    slip: Vector
    bound: Vector
    impulse: Vector


@compiled()
def dot_product(a: Vector, b: Vector) -> float:
    """⟨a, b⟩."""
    total = 0.0
    for i in range(len(a)):
        total += a[i] * b[i]
    return total


@entry_point()
def _steps(
    M: Matrix, K: Matrix, J: Matrix, inverse: Matrix, W: Matrix, h: float, force: Matrix,
    threshold: Matrix, surface_speed: Matrix, q: Matrix, v: Matrix, contact_force: Matrix,
    work: Work,
) -> bool:  # fmt: skip
    """Time loop of `moreau`, W = J(M + hC + h²K)⁻¹Jᵀ: fills q and v after their first rows, and the
    contact forces. Whether all steps are solved."""
    free = work.free
    pull = work.pull
    impulse = work.impulse
    c = len(J)
    d = len(M)
    for i in range(len(contact_force)):
        for a in range(d):
            pull[a] = dot_product(M[a], v[i]) + h * (force[i + 1, a] - dot_product(K[a], q[i]))
        for a in range(d):
            free[a] = dot_product(inverse[a], pull)
        for k in range(c):
            work.slip[k] = dot_product(J[k], free) - surface_speed[i + 1, k]
            work.bound[k] = h * threshold[i + 1, k]
        if not _box(W, work.slip, work.bound, impulse):
            return False
        for k in range(c):
            contact_force[i, k] = impulse[k] / h
        for a in range(d):
            pull[a] = 0.0
            for k in range(c):
                pull[a] += J[k, a] * impulse[k]
        for a in range(d):
            v[i + 1, a] = free[a] + dot_product(inverse[a], pull)
            q[i + 1, a] = q[i, a] + h * v[i + 1, a]
    return True


@compiled()
def _box(W: Matrix, u: Vector, bound: Vector, p: Vector) -> bool:
    """Minimise ½⟨Wp, p⟩ + ⟨u, p⟩ over |pᵢ| ≤ boundᵢ in place, by projected Gauss-Seidel with
    over-relaxation."""
    scale = 0.0
    for i in range(len(p)):
        p[i] = min(max(p[i], -bound[i]), bound[i])
        scale = max(scale, bound[i])
    for _ in range(SWEEPS):
        residual = 0.0
        for i in range(len(p)):
            optimum = p[i] - (u[i] + dot_product(W[i], p)) / W[i, i]
            # The residual is the unrelaxed move: relaxation must not hide how far the optimum is.
            residual = max(residual, abs(min(max(optimum, -bound[i]), bound[i]) - p[i]))
            p[i] = min(max(p[i] + RELAXATION * (optimum - p[i]), -bound[i]), bound[i])
        if residual <= TOLERANCE * scale:
            return True
    return False


@entry_point()
def _increments(A: Matrix, load: Matrix, threshold: Matrix, z: Matrix) -> bool:
    """Loop of `rate_independent`: fills z after its first row. Whether all steps are solved."""
    d = len(A)
    for k in range(1, len(load)):
        for i in range(d):
            z[k, i] = z[k - 1, i]
        solved = False
        for _ in range(SWEEPS):
            residual = 0.0
            size = 0.0
            for i in range(d):
                centre = z[k, i] + (load[k, i] - dot_product(A[i], z[k])) / A[i, i]
                radius = threshold[k, i] / A[i, i]
                value = min(max(z[k - 1, i], centre - radius), centre + radius)
                residual = max(residual, abs(value - z[k, i]))
                z[k, i] = value
                size = max(size, abs(value))
            if residual <= TOLERANCE * (1.0 + size):
                solved = True
                break
        if not solved:
            return False
    return True

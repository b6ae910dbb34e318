"""Moreau's implicit time stepping of order one, for several contacts with dry friction.

Moreau, *Unilateral contact and dry friction in finite freedom dynamics*, CISM 302 (1988); Acary &
Brogliato, *Numerical Methods for Nonsmooth Dynamical Systems* (2008), chapter 10. No event is
located and no regularisation is made: in every step the contact impulses solve a convex problem.
The force, threshold and surface speed enter as samples on a uniform grid of n steps, row 0 at t = 0
and row n at t = T.
"""

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

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
    samples = map(_dense, (force, threshold, surface_speed, q0, v0))
    q, v, contact_force, solved = _steps(M, K, J, inverse, W, h, *samples)
    if not solved:
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
    z, solved = _increments(*map(_dense, (A, load, threshold, z0)))
    if not solved:
        raise RuntimeError(f"Gauss-Seidel did not converge in {SWEEPS} sweeps")
    return z


def _dense(a: ArrayLike) -> Array:
    """The one memory layout that the kernels are compiled for."""
    return np.ascontiguousarray(a, dtype=np.float64)


@njit(cache=True)
def _steps(
    M: Array, K: Array, J: Array, inverse: Array, W: Array, h: float,
    force: Array, threshold: Array, surface_speed: Array, q0: Array, v0: Array,
) -> tuple[Array, Array, Array, bool]:  # fmt: skip
    """Time loop of `moreau`, W = J(M + hC + h²K)⁻¹Jᵀ."""
    steps, (c, d) = force.shape[0] - 1, J.shape
    q = np.empty((steps + 1, d))
    v = np.empty((steps + 1, d))
    contact_force = np.empty((steps, c))
    q[0], v[0] = q0, v0
    impulse = np.zeros(c)  # kept from step to step as a start for the next
    for i in range(steps):
        free = inverse @ (M @ v[i] + h * (force[i + 1] - K @ q[i]))
        if not _box(W, J @ free - surface_speed[i + 1], h * threshold[i + 1], impulse):
            return q, v, contact_force, False
        contact_force[i] = impulse / h
        v[i + 1] = free + inverse @ (J.T @ impulse)
        q[i + 1] = q[i] + h * v[i + 1]
    return q, v, contact_force, True


@njit(cache=True)
def _box(W: Array, u: Array, bound: Array, p: Array) -> bool:
    """Minimise ½⟨Wp, p⟩ + ⟨u, p⟩ over |pᵢ| ≤ boundᵢ in place, by projected Gauss-Seidel with
    over-relaxation."""
    p[:] = np.minimum(np.maximum(p, -bound), bound)
    scale = np.max(bound)
    for _ in range(SWEEPS):
        residual = 0.0
        for i in range(p.size):
            optimum = p[i] - (u[i] + W[i] @ p) / W[i, i]
            # The residual is the unrelaxed move: relaxation must not hide how far the optimum is.
            residual = max(residual, abs(min(max(optimum, -bound[i]), bound[i]) - p[i]))
            p[i] = min(max(p[i] + RELAXATION * (optimum - p[i]), -bound[i]), bound[i])
        if residual <= TOLERANCE * scale:
            return True
    return False


@njit(cache=True)
def _increments(A: Array, load: Array, threshold: Array, z0: Array) -> tuple[Array, bool]:
    """Loop of `rate_independent`."""
    z = np.empty_like(load)
    z[0] = z0
    for k in range(1, load.shape[0]):
        z[k] = z[k - 1]
        residual = np.inf
        for _ in range(SWEEPS):
            residual = 0.0
            for i in range(z0.size):
                centre = z[k, i] + (load[k, i] - A[i] @ z[k]) / A[i, i]
                radius = threshold[k, i] / A[i, i]
                value = min(max(z[k - 1, i], centre - radius), centre + radius)
                residual = max(residual, abs(value - z[k, i]))
                z[k, i] = value
            if residual <= TOLERANCE * (1 + np.max(np.abs(z[k]))):
                break
        else:
            return z, False
    return z, True

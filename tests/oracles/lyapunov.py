"""First Lyapunov coefficient by another road: real Jordan coordinates and the formula for the
plane.

J. Guckenheimer and P. Holmes, *Nonlinear Oscillations, Dynamical Systems, and Bifurcations of
Vector Fields*, (3.4.11): for x' = −ωy + f(x, y), y' = ωx + g(x, y) the radius grows like r' = a r³
+ ... with

    16 a = f_xxx + f_xyy + g_xxy + g_yyy
           + (f_xy (f_xx + f_yy) − g_xy (g_xx + g_yy) − f_xx g_xx + f_yy g_yy)/ω.

More dimensions are first reduced to the plane by the quadratic part of the centre manifold, w =
h(x, y), which is found from its invariance. With x + iy = ζ for the unit eigenvector q, y = ζq +
ζ̄q̄, the coefficient is l₁ = a/ω.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import sympy as sp


def first_lyapunov(
    rates: list[sp.Expr], state: list[sp.Symbol], at: list[float]
) -> tuple[float, float]:
    """(ω, l₁) of a field at an equilibrium with a pair of imaginary eigenvalues."""
    A = np.array(
        sp.Matrix(rates).jacobian(state).subs(dict(zip(state, at, strict=True))).evalf(),
        dtype=float,
    )
    values, vectors = np.linalg.eig(A)
    upper = np.flatnonzero(np.imag(values) > 1e-6 * np.max(np.abs(values)))
    k = upper[np.argmin(np.abs(np.real(values[upper])))]
    omega = float(np.imag(values[k]))
    q = vectors[:, k] / np.linalg.norm(vectors[:, k])
    # y = 2 Re(ζq) = x (2 Re q) + y (−2 Im q); the other columns span the invariant complement.
    plane = np.column_stack([2 * q.real, -2 * q.imag])
    left = np.linalg.eig(A.T)
    p = left[1][:, np.argmin(np.abs(left[0] - values[k]))]
    rest = np.linalg.svd(np.vstack([np.real(p), np.imag(p)]))[2][2:].T
    basis = np.column_stack([plane, rest])
    x, y, *w = sp.symbols(f"x y w0:{len(state) - 2}")
    moved: Any = dict(
        zip(state, sp.Matrix(at) + sp.Matrix(basis) * sp.Matrix([x, y, *w]), strict=True)
    )
    local = sp.Matrix(np.linalg.inv(basis)) * sp.Matrix(
        [r.subs(moved, simultaneous=True) for r in rates]
    )
    f, g = _on_the_centre_manifold(local, x, y, w, omega)
    return omega, _radial(f, g, x, y, omega) / omega


def _on_the_centre_manifold(
    local: Any, x: sp.Symbol, y: sp.Symbol, w: list[sp.Symbol], omega: float
) -> tuple[Any, Any]:
    """The field of the plane with w = h(x, y) to second order."""
    if not w:
        return local[0], local[1]
    zero: Any = dict.fromkeys([x, y, *w], 0)
    B = sp.Matrix(local[2:]).jacobian(w).subs(zero).evalf()
    unknown = sp.symbols(f"c0:{3 * len(w)}")
    h = [
        unknown[3 * i] * x**2 + unknown[3 * i + 1] * x * y + unknown[3 * i + 2] * y**2
        for i in range(len(w))
    ]
    equations = []
    for i, e in enumerate(local[2:]):
        quadratic = sum(
            sp.diff(e, *pair).subs(zero) * monomial
            for pair, monomial in (((x, x), x**2 / 2), ((x, y), x * y), ((y, y), y**2 / 2))
        )
        driven = sum(B[i, j] * h[j] for j in range(len(w))) + quadratic
        invariance: Any = sp.expand(
            sp.diff(h[i], x) * (-omega * y) + sp.diff(h[i], y) * omega * x - driven
        )
        equations += [invariance.coeff(x, a).coeff(y, b) for a, b in ((2, 0), (1, 1), (0, 2))]
    found = sp.solve(equations, unknown, dict=True)[0]
    surface = {s: e.subs(found) for s, e in zip(w, h, strict=True)}
    return local[0].subs(surface), local[1].subs(surface)


def _radial(f: sp.Expr, g: sp.Expr, x: sp.Symbol, y: sp.Symbol, omega: float) -> float:
    def at(e: sp.Expr, *names: sp.Symbol) -> float:
        return float(sp.diff(e, *names).subs({x: 0, y: 0}))

    cubic = at(f, x, x, x) + at(f, x, y, y) + at(g, x, x, y) + at(g, y, y, y)
    quadratic = at(f, x, y) * (at(f, x, x) + at(f, y, y)) - at(g, x, y) * (
        at(g, x, x) + at(g, y, y)
    )
    quadratic += -at(f, x, x) * at(g, x, x) + at(f, y, y) * at(g, y, y)
    return (cubic + quadratic / omega) / 16

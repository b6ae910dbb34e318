"""The scaling limit of the spring slider: the Poincaré maps Φ⁺, Φ⁻ and Ψ = Φ⁻∘Φ⁺ of [M] section 3.

On the axis β = 0 (in (3.3): on U = μ̃(α)) slip maps γ below μ₀v̂ to Φ⁺(γ) above it, and stick maps
it back. At lowest order in ν both have closed forms; for (3.6), (3.5) and (3.3) they are evaluated
from the exact motion between two switches. The study is specific to three systems of the catalogue,
so it belongs to the companion of the paper.

References
----------
A. Mielke, *Three examples concerning the interaction of dry friction and oscillations*, WIAS
preprint 2405 (2017), section 3, with the corrections: μ̃ = μ + √ν B, the constant (v̂/ν)(1 − b√ν)
in (3.6), the duration π√ν/ω_b of a slip.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
from numpy import ndarray as Array

import stickslip as ss
from stickslip import catalogue

if TYPE_CHECKING:
    import xarray


EQUATIONS = ("(3.6)", "(3.5)", "(3.3)")  # the motions that (3.6) simplifies, simplest first
_ROUNDS = 40  # largest number of secant iterations
_DOUBLINGS = 6  # largest number of doublings of the time of a slip or a stick


@dataclass(frozen=True)
class Passage:
    """A slip or a stick: γ when it starts and when it ends, and how long it lasts."""

    start: float
    end: float
    duration: float


@dataclass(frozen=True)
class FixedPoint:
    """The cycle as a fixed point of Ψ.

    Attributes
    ----------
    gamma : float
        γ_b, at the start of slip.
    slip, stick : Passage
        From γ_b up and back.
    """

    gamma: float
    slip: Passage
    stick: Passage

    @property
    def period(self) -> float:
        """Duration of both."""
        return self.slip.duration + self.stick.duration


@dataclass(frozen=True)
class ReturnMap:
    """Ψ = Φ⁻∘Φ⁺ with its two halves.

    Attributes
    ----------
    name : str
        Where the maps come from: ``"lowest order"`` or an equation number.
    slip, stick : function of γ
        Φ⁺ and Φ⁻, each with the duration, as a :class:`Passage`.
    centre : float
        μ₀v̂, steady sliding: Φ⁺ takes γ below it, Φ⁻ takes γ above it (at lowest order).
    """

    name: str
    slip: Callable[[float], Passage]
    stick: Callable[[float], Passage]
    centre: float

    def __call__(self, gamma: float) -> float:
        """Ψ(γ)."""
        return self.stick(self.slip(gamma).end).end

    def fixed_point(self) -> FixedPoint:
        """The fixed point γ_b below μ₀v̂: the stick-slip cycle.

        Notes
        -----
        Ψ is convex and increasing with Ψ(0) > 0, so that secants from 0 climb to the lower fixed
        point and never pass it.

        Raises
        ------
        ConvergenceError
            If they do not arrive; the last γ is named.
        """
        a = 0.0
        b = self(0.0)
        excess = new = b
        for _ in range(_ROUNDS):
            new = self(b) - b
            if abs(new) <= 4e-16 * b or new >= excess or b >= self.centre:
                break
            a, b, excess = b, b + new * (b - a) / (excess - new), new
            if b - a <= 4e-16 * b:
                break
        else:
            raise ss.ConvergenceError(
                f"gamma_b of {self.name}", f"reached {b:.6g} with Psi(gamma) - gamma = {new:.1e}"
            )
        slip = self.slip(b)
        return FixedPoint(b, slip, self.stick(slip.end))


def stick_time(q: float) -> float:
    """𝒞(q): the inverse of 𝓑: T ↦ (1 − e^{−T})/T, which maps [0, ∞[ onto ]0, 1].

    Raises
    ------
    DeclarationError
        If q is not in ]0, 1].
    """
    from scipy.special import lambertw

    if not 0.0 < q <= 1.0:
        raise ss.DeclarationError(
            "q", f"{q:g} is not in ]0, 1]", "A stick starts at mu_0*v_hat or above"
        )
    if q == 1.0:
        return 0.0
    # Next to its branch point, q near 1, Lambert's function keeps half the digits; 2(1 − q) is
    # close there.
    T = 2.0 * (1.0 - q) if q > 0.99 else 1.0 / q + float(lambertw(-math.exp(-1.0 / q) / q).real)
    for _ in range(4):
        T -= (q * T + math.expm1(-T)) / (q - math.exp(-T))
    return T


def lowest_order(b: float, mu_0: float = 1.0, v_hat: float = 1.0, nu: float = 0.0) -> ReturnMap:
    """The maps at lowest order: Φ⁺(γ) = μ₀v̂ + ρ_b(μ₀v̂ − γ) and Φ⁻(γ) = γ exp(−𝒞(μ₀v̂/γ)).

    Parameters
    ----------
    b, mu_0, v_hat : float
        With 0 < b < 2.
    nu : float
        For the duration π√ν/ω_b of a slip only.

    Raises
    ------
    DeclarationError
        If a parameter is out of range.
    """
    _check(nu, b, mu_0, v_hat)
    centre = mu_0 * v_hat
    omega_b = math.sqrt(1.0 - b**2 / 4.0)
    rho_b = math.exp(math.pi * b / (2.0 * omega_b))
    slip_duration = math.pi * math.sqrt(nu) / omega_b

    def slip(gamma: float) -> Passage:
        return Passage(gamma, centre + rho_b * (centre - gamma), slip_duration)

    def stick(gamma: float) -> Passage:
        T = stick_time(centre / gamma)
        return Passage(gamma, gamma * math.exp(-T), T)

    return ReturnMap("lowest order", slip, stick, centre)


def exact(equation: str, nu: float, b: float, mu_0: float = 1.0, v_hat: float = 1.0) -> ReturnMap:
    """The maps of the exact motion of (3.6), (3.5) or (3.3), with μ(s) = μ₀ exp(−s/μ₀²), which
    satisfies (3.4).

    Parameters
    ----------
    nu, b, mu_0, v_hat : float
        With √ν < b < 2: otherwise slip may never end.

    Raises
    ------
    DeclarationError
        If an argument is wrong.
    """
    _check(nu, b, mu_0, v_hat)
    if equation not in EQUATIONS:
        raise ss.DeclarationError(
            "equation", f"{equation!r} is none", f"Give one of {', '.join(EQUATIONS)}"
        )
    if not 0.0 < nu < b**2:
        raise ss.DeclarationError(
            "nu", f"{nu:g} is not in ]0, b**2[", "Slip is an unstable focus for sqrt(nu) < b only"
        )
    model = _in_original_variables if equation == "(3.3)" else _in_scaled_variables
    flow = model(equation, {"nu": nu, "b": b, "mu_0": mu_0, "v_hat": v_hat})
    centre = mu_0 * v_hat
    turn = math.pi * math.sqrt(nu) / math.sqrt(1.0 - b**2 / 4.0)
    return ReturnMap(
        equation,
        lambda gamma: flow.passage(gamma, True, 2.0 * turn),
        lambda gamma: flow.passage(gamma, False, 1.0 + gamma / centre),
        centre,
    )


def scaling_study(
    nus: Sequence[float],
    b: float = 1.0,
    mu_0: float = 1.0,
    v_hat: float = 1.0,
    equations: Sequence[str] = EQUATIONS,
) -> xarray.Dataset:
    """Convergence of the exact maps and cycles to those of lowest order as ν → 0.

    Parameters
    ----------
    nus : sequence of float
        At least two values.
    equations : sequence of str
        Equations accepted by :func:`exact`.

    Returns
    -------
    xarray.Dataset
        Dimensions ``equation`` and ``nu``. Of the cycle: ``gamma`` (γ_b), ``top``,
        ``slip_duration``, ``stick_duration``; ``gamma_error`` against lowest order;
        ``slip_map_error`` and ``stick_map_error``, the largest over [0, μ₀v̂/2] and its image.
        ``order_…``: the exponents of ν that fit them.

    Raises
    ------
    DeclarationError
        If an argument is wrong.
    """
    import xarray as xr

    if len(set(nus)) < 2:
        raise ss.DeclarationError("nus", "not two different values", "A rate needs at least two")
    limit = lowest_order(b, mu_0, v_hat)
    lowest = limit.fixed_point()
    below = np.linspace(0.0, 0.5 * limit.centre, 6)
    above = [limit.slip(g).end for g in below]
    fields: dict[str, Array] = {name: np.zeros((len(equations), len(nus))) for name in _MEASURED}
    for place, (equation, nu) in zip(
        np.ndindex(len(equations), len(nus)), product(equations, nus), strict=True
    ):
        maps = exact(equation, nu, b, mu_0, v_hat)
        found = maps.fixed_point()
        measured = (
            found.gamma,
            found.slip.end,
            found.slip.duration,
            found.stick.duration,
            abs(found.gamma - lowest.gamma),
            max(abs(maps.slip(g).end - limit.slip(g).end) for g in below),
            max(abs(maps.stick(g).end - limit.stick(g).end) for g in above),
        )
        for name, value in zip(_MEASURED, measured, strict=True):
            fields[name][place] = value
    data = {name: (("equation", "nu"), values) for name, values in fields.items()}
    scale = np.log(np.asarray(nus, float))
    orders = {
        f"order_{name}": (
            "equation",
            np.array([np.polyfit(scale, np.log(row), 1)[0] for row in fields[name]]),
        )
        for name in _MEASURED[2:]
    }
    attributes = {
        "b": b,
        "mu_0": mu_0,
        "v_hat": v_hat,
        "gamma_b": lowest.gamma,
        "source": "Mielke 2017, section 3.3",
    }
    return xr.Dataset(
        {**data, **orders}, {"equation": list(equations), "nu": np.asarray(nus, float)}, attributes
    )


_MEASURED = (
    "gamma",
    "top",
    "slip_duration",
    "stick_duration",
    "gamma_error",
    "slip_map_error",
    "stick_map_error",
)


@dataclass(frozen=True)
class _Flow:
    """A system with numbers, and γ on its axis between slip and stick."""

    system: ss.System
    parameters: dict[str, float]
    state: Callable[[float], dict[str, float]]
    gamma: Callable[[Array], float]

    def passage(self, gamma: float, slipping: bool, span: float) -> Passage:
        """From γ on the axis through one phase."""
        for _ in range(_DOUBLINGS):
            motion = ss.simulate(
                self.system, (0.0, span), initial=self.state(gamma), parameters=self.parameters
            )
            found = _phase(motion, slipping)
            if found is not None:
                knots = motion.knots
                return Passage(
                    gamma,
                    self.gamma(knots.state[found[1]]),
                    float(np.diff(knots.time[list(found)])[0]),
                )
            span *= 2.0
        what = "slip" if slipping else "stick"
        raise ss.ConvergenceError(
            f"the {what} from gamma = {gamma:g}", f"it does not end before t = {span / 2:.3g}"
        )


def _phase(motion: ss.Trajectory, slipping: bool) -> tuple[int, int] | None:
    """First and last knot of the first slip or stick; a start on the axis may be off it by
    rounding."""
    knots = motion.knots
    slips = np.any(np.hstack([knots.mode != 0, knots.region == 1]), axis=1)
    first = int(np.argmax(slips == slipping))
    ends = np.flatnonzero(slips[first:] != slipping)
    return (first, first + int(ends[0])) if slips[first] == slipping and len(ends) else None


def _in_scaled_variables(equation: str, parameters: dict[str, float]) -> _Flow:
    """(3.6) and (3.5)."""
    system = catalogue.scaled_slider_limit() if equation == "(3.6)" else catalogue.scaled_slider()
    return _Flow(
        system, parameters, lambda gamma: {"beta": 0.0, "gamma": gamma}, lambda y: float(y[1])
    )


def _in_original_variables(equation: str, parameters: dict[str, float]) -> _Flow:
    """(3.3) with V = νv̂, α = 1 + νγ, and slip where U = μ̃(α)."""
    nu, b, mu_0, v_hat = (parameters[name] for name in ("nu", "b", "mu_0", "v_hat"))
    shift = math.sqrt(nu) * b * mu_0
    values = {"nu": nu, "V": nu * v_hat, "mu_0": mu_0, "shift": shift}

    def state(gamma: float) -> dict[str, float]:
        return {"U": mu_0 * math.exp(-nu * gamma / mu_0**2) + shift, "alpha": 1.0 + nu * gamma}

    return _Flow(unfolded_slider(), values, state, lambda y: (float(y[1]) - 1.0) / nu)


@cache
def unfolded_slider() -> ss.System:
    """The spring slider (3.3) with μ̃(α) = μ₀ exp((1 − α)/μ₀²) + shift: one declaration for all ν
    and b."""
    base = catalogue.spring_slider()
    more = {
        "mu_0": ss.Parameter(1.0, "", "friction at rest", "(0, inf)"),
        "shift": ss.Parameter(0.0, "", "sqrt(nu)*B"),
    }
    functions = {"mu(alpha)": "mu_0*exp((1 - alpha)/mu_0**2) + shift"}
    return replace(base, parameters={**base.parameters, **more}, functions=functions)


def _check(nu: float, b: float, mu_0: float, v_hat: float) -> None:
    ranges = {"nu": (nu, 0.0 <= nu < math.inf, "[0, inf)"), "b": (b, 0.0 < b < 2.0, "(0, 2)")}
    ranges |= {
        name: (x, 0.0 < x < math.inf, "(0, inf)") for name, x in (("mu_0", mu_0), ("v_hat", v_hat))
    }
    for name, (value, inside, interval) in ranges.items():
        if not inside:
            raise ss.DeclarationError(
                name, f"{value:g} is not in {interval}", "Section 3 of [M] is about these"
            )

"""Thirty-digit end states of the three motions that ``benchmarks/motion.py`` times.

The stored strings are what an error is measured against. :func:`compute` makes them again from the
equations alone, in sixty-digit arithmetic and with no code of the package: where a mode is affine
by its closed form, where it is not by a Taylor series, with every switch as a root refined to the
working precision. ``python benchmarks/reference_values.py`` compares the two.

Equation numbers are those of A. Mielke, *Three examples concerning the interaction of dry friction
and oscillations*, WIAS preprint 2405 (2017).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
from mpmath import cos, exp, mp, mpf, sin, sqrt
from numpy.typing import ArrayLike

DIGITS = 60
"""Working precision: twice the digits kept, since a motion through many switches loses some."""

Real = Any
"""An mpmath number; mpmath declares no types."""

State = tuple[Real, ...]
Path = Callable[[Real], State]
Indicator = Callable[[State], Real]
Mode = Callable[[State], tuple[Path, Indicator]]
"""Entry state -> the motion as a function of the time since then, and a quantity that is positive
inside the mode."""


@dataclass(frozen=True)
class Problem:
    """One timed motion and its end.

    Attributes
    ----------
    title : str
        What moves, with its equation number.
    variables : tuple of str
        Names of the components of a state.
    parameters : mapping of str to float
        Values in the symbols of the paper; each is meant as the decimal number that it prints as.
    initial : tuple of float
        State at time 0.
    span : float
        Time of the end state.
    cycles : float
        Stick-slip cycles within `span`, the unit of the timings.
    final : tuple of str
        End state, 30 significant digits.
    switches : tuple of str
        Times in ]0, span[ of all changes between stick and slip, 30 significant digits.
    """

    title: str
    variables: tuple[str, ...]
    parameters: Mapping[str, float]
    initial: tuple[float, ...]
    span: float
    cycles: float
    final: tuple[str, ...]
    switches: tuple[str, ...]

    def error(self, state: ArrayLike) -> float:
        """Return the largest difference from the end state: absolute for components below 1,
        relative above."""
        reference = np.array([float(value) for value in self.final])
        return float(
            np.max(np.abs(np.asarray(state) - reference) / np.maximum(1.0, np.abs(reference)))
        )


# --- Following a motion ---------------------------------------------------------------------------


def first_fall(path: Path, indicator: Indicator, end: Real, step: Real) -> Real | None:
    """Return the first time in ]0, end[ at which `indicator` falls through zero along `path`, or
    None.

    A mode that has just begun stands on its boundary, so nothing is asked of time 0 itself; from
    the first grid point on the indicator has to be positive. `step` has to be shorter than the
    shortest stay beyond the boundary.
    """

    def value(time: Real) -> Real:
        return indicator(path(time))

    before = min(step, end)
    if value(before) <= 0:
        raise ArithmeticError(
            f"the mode is left within its first {mp.nstr(before, 3)}: take a shorter step"
        )
    while before < end:
        after = min(before + step, end)
        if value(after) <= 0:
            return mp.findroot(
                value, (before, after), solver="anderson", tol=mpf(10) ** (10 - 2 * DIGITS)
            )
        before = after
    return None


def follow(
    modes: Sequence[Mode], initial: State, span: Real, step: Real
) -> tuple[State, list[Real]]:
    """Alternate between two modes, beginning with the first; return the end state and the times of
    the switches."""
    time = mpf(0)
    state = initial
    switches = []
    while True:
        path, indicator = modes[len(switches) % 2](state)
        duration = first_fall(path, indicator, span - time, step)
        if duration is None:
            return path(span - time), switches
        time = time + duration
        state = path(duration)
        switches.append(time)


# --- The modes ------------------------------------------------------------------------------------


class TaylorPath:
    """Solution of an autonomous equation by Taylor series, continued as far as it is asked for.

    Parameters
    ----------
    series : callable
        ``series(state, order)`` returns, for each component, the Taylor coefficients 0 ... `order`
        of the solution through `state`.
    initial : tuple of Real
        State at time 0.
    order : int
        Length of the series.
    """

    def __init__(
        self, series: Callable[[State, int], list[list[Real]]], initial: State, order: int = 50
    ) -> None:
        self._series, self._order = series, order
        self._starts: list[Real] = []
        self._pieces: list[list[list[Real]]] = []
        self._reach = mpf(0)
        self._extend(initial)

    def __call__(self, time: Real) -> State:
        """Return the state at `time`."""
        while time > self._reach:
            self._extend(self._evaluate(len(self._pieces) - 1, self._reach))
        return self._evaluate(max(i for i, start in enumerate(self._starts) if start <= time), time)

    def _extend(self, state: State) -> None:
        piece = self._series(state, self._order)
        self._starts.append(self._reach)
        self._pieces.append(piece)
        # The step at which the last terms no longer count: two of them, lest one vanish by chance.
        self._reach += min(
            (mp.eps / max(abs(component[n]) for component in piece)) ** (mpf(1) / n)
            for n in (self._order - 1, self._order)
        )

    def _evaluate(self, i: int, time: Real) -> State:
        return tuple(
            mp.polyval(component[::-1], time - self._starts[i]) for component in self._pieces[i]
        )


def slider(p: SimpleNamespace) -> Sequence[Mode]:
    """Return stick and slip of (3.3) with k = alpha_0 = 1; the state is (U, alpha)."""

    def mu(alpha: Real) -> Real:
        return p.mu_inf + p.mu_1 * exp(-(alpha - 1) / p.alpha_mu)

    def series(state: State, order: int) -> list[list[Real]]:
        U = [state[0]]
        alpha = [state[1]]
        G = []
        mu_ = [mu(alpha[0])]
        for n in range(order):
            G.append((U[n] - mu_[n]) / p.nu)
            U.append(((p.V if n == 0 else 0) - G[n]) / (n + 1))
            power = sum(U[j] * G[n - j] for j in range(n + 1))
            alpha.append(((1 if n == 0 else 0) - alpha[n] + power) / (n + 1))
            # alpha_mu mu' = -alpha' (mu - mu_inf), coefficient by coefficient.
            excess = [mu_[0] - p.mu_inf, *mu_[1:]]
            mu_.append(
                -sum((j + 1) * alpha[j + 1] * excess[n - j] for j in range(n + 1))
                / (p.alpha_mu * (n + 1))
            )
        return [U, alpha]

    def stick(state: State) -> tuple[Path, Indicator]:
        U, alpha = state
        return lambda t: (U + p.V * t, 1 + (alpha - 1) * exp(-t)), lambda x: mu(x[1]) - x[0]

    def slip(state: State) -> tuple[Path, Indicator]:
        return TaylorPath(series, state), lambda x: x[0] - mu(x[1])

    return stick, slip


def scaled_slider(p: SimpleNamespace) -> Sequence[Mode]:
    """Return slip and stick of (3.6); the state is (beta, gamma)."""
    drive = p.v_hat / p.nu * (1 - p.b * sqrt(p.nu))
    growth = p.b / sqrt(p.nu)
    healing = 1 / (p.nu * p.mu_0)

    def slip(state: State) -> tuple[Path, Indicator]:
        # Around the steady state: the matrix [[growth, -healing], [mu_0, -1]] has the eigenvalues
        # sigma +- i omega.
        sigma = (growth - 1) / 2
        omega = sqrt(healing * p.mu_0 - ((growth + 1) / 2) ** 2)
        beta = state[0] - p.v_hat
        gamma = state[1] - p.mu_0 * p.v_hat
        beta_ = ((growth - sigma) * beta - healing * gamma) / omega
        gamma_ = (p.mu_0 * beta + (-1 - sigma) * gamma) / omega

        def path(t: Real) -> State:
            C, S = exp(sigma * t) * cos(omega * t), exp(sigma * t) * sin(omega * t)
            return p.v_hat + C * beta + S * beta_, p.mu_0 * p.v_hat + C * gamma + S * gamma_

        return path, lambda x: x[0]

    def stick(state: State) -> tuple[Path, Indicator]:
        beta, gamma = state
        return lambda t: (
            beta + drive * t - (1 - exp(-t)) * gamma * healing,
            gamma * exp(-t),
        ), lambda x: -x[0]

    return slip, stick


def rocking_toy(p: SimpleNamespace) -> Sequence[Mode]:
    """Return "both legs stick" and "one leg slides" of (4.2); the state is (psi, d_psi, x_R, x_L).

    The force balances tie each bound of d = x_R - x_L to one leg and one direction: d = G_R^- the
    right leg forward, G_R^+ the right leg backward, G_L^+ the left leg forward, G_L^- the left leg
    backward.
    """

    def H_R(psi: Real) -> Real:
        return min(max(p.H_star * (psi + p.psi_star) / (2 * p.psi_star), mpf(0)), p.H_star)

    def bounds(psi: Real, leg: str) -> tuple[Real, ...]:
        pull, threshold = (p.P, p.rho + H_R(psi)) if leg == "R" else (-p.P, p.rho + H_R(-psi))
        return (pull + p.c * psi - threshold) / p.a, (pull + p.c * psi + threshold) / p.a

    def inside(x: State) -> Real:
        """Return the distance of d to its nearest bound. In a corner that is only touched it is
        zero for an instant."""
        psi, _, x_R, x_L = x
        return min(
            distance
            for leg in "RL"
            for bound in [bounds(psi, leg)]
            for distance in (x_R - x_L - bound[0], bound[1] - (x_R - x_L))
        )

    def oscillation(
        psi: Real, d_psi: Real, stiffness: Real, force: Real
    ) -> Callable[[Real], tuple[Real, ...]]:
        """Solve I_b psi'' + delta psi' + stiffness psi = force."""
        sigma = p.delta / (2 * p.I_b)
        omega = sqrt(stiffness / p.I_b - sigma**2)
        rest = force / stiffness
        A = psi - rest
        B = (d_psi + sigma * (psi - rest)) / omega

        def path(t: Real) -> tuple[Real, ...]:
            C, S = exp(-sigma * t) * cos(omega * t), exp(-sigma * t) * sin(omega * t)
            return rest + A * C + B * S, omega * (B * C - A * S) - sigma * (A * C + B * S)

        return path

    def stick(state: State) -> tuple[Path, Indicator]:
        psi, d_psi, x_R, x_L = state
        rock = oscillation(psi, d_psi, p.b, p.c * (x_R - x_L))
        return lambda t: (*rock(t), x_R, x_L), inside

    def slide(state: State) -> tuple[Path, Indicator]:
        psi, d_psi, x_R, x_L = state
        # rocking to the right the left leg moves, to the left the right one
        side = 1 if d_psi > 0 else -1
        bound = bounds(psi, "L")[1] if side > 0 else bounds(psi, "R")[0]
        if abs(x_R - x_L - bound) > mpf(10) ** (10 - DIGITS) or abs(psi) > p.psi_star:
            raise ArithmeticError("the motion is not in the simple regime of section 4.3")
        # of both bounds between -psi_star and psi_star
        slope = (p.c - p.H_star / (2 * p.psi_star)) / p.a
        rock = oscillation(psi, d_psi, p.b - p.c * slope, p.c * (x_R - x_L - slope * psi))

        def path(t: Real) -> State:
            x = rock(t)
            moved = slope * (x[0] - psi)
            return (*x, x_R, x_L - moved) if side > 0 else (*x, x_R + moved, x_L)

        # The bound recedes from d as soon as psi leaves the ramp of H_R or turns back.
        return path, lambda x: min(p.psi_star - side * x[0], side * x[1])

    return stick, slide


MODES: Mapping[str, Callable[[SimpleNamespace], Sequence[Mode]]] = {
    "A": slider,
    "B": scaled_slider,
    "C": rocking_toy,
}
STEPS: Mapping[str, str] = {"A": "0.004", "B": "0.002", "C": "0.02"}
"""Grid on which the first fall is looked for: shorter than any stay beyond a boundary, as a third
of it confirms."""


def compute(name: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Compute the end state and the switches of one problem again.

    Parameters
    ----------
    name : {"A", "B", "C"}
        Key of `PROBLEMS`.

    Returns
    -------
    final : tuple of str
        End state, 30 significant digits.
    switches : tuple of str
        Times of the changes between stick and slip, 30 significant digits.
    """
    problem = PROBLEMS[name]
    with mp.workdps(DIGITS):
        parameters = SimpleNamespace(
            **{symbol: mpf(str(value)) for symbol, value in problem.parameters.items()}
        )
        initial = tuple(mpf(str(value)) for value in problem.initial)
        final, switches = follow(
            MODES[name](parameters), initial, mpf(str(problem.span)), mpf(STEPS[name])
        )
        return tuple(str(mp.nstr(value, 30)) for value in final), tuple(
            str(mp.nstr(time, 30)) for time in switches
        )


# --- The problems ---------------------------------------------------------------------------------

PROBLEMS: Mapping[str, Problem] = {
    "A": Problem(
        title="spring slider (3.3)",
        variables=("U", "alpha"),
        parameters={"V": 0.18, "nu": 0.02, "mu_inf": 0.5, "mu_1": 1.0, "alpha_mu": 0.4},
        initial=(0.5, 1.0),
        span=50.0,
        cycles=9.0,
        final=(
            "1.46095009524994659020545792053",
            "1.00803438488112296572997574577",
        ),
        switches=(
            "5.55555555555555555555555555556",
            "5.75360943559884630077608356058",
            "10.5363823294809930219183816421",
            "10.7351572441555312147788221643",
            "15.4844974867744191574939468859",
            "15.6832823080372460561015049568",
            "20.4322480744527661375902702795",
            "20.6310330105515048323473607175",
            "25.3799944447233340457009059123",
            "25.5787793821510840950376293823",
            "30.3277407661864316921228120571",
            "30.5265257036295622800713986022",
            "35.275487087084684671877315478",
            "35.4742720245279932574901197754",
            "40.2232334079764007524027605673",
            "40.4220183454197113979673771662",
            "45.1709797288680411819500177317",
            "45.3697646663113518513542812582",
        ),
    ),
    "B": Problem(
        title="scaled slider (3.6)",
        variables=("beta", "gamma"),
        parameters={"nu": 1e-3, "b": 0.5, "mu_0": 1.0, "v_hat": 1.0},
        initial=(0.0, 0.4),
        span=26.0,
        cycles=10.5,
        final=(
            "-692.535690433685323753778258016",
            "1.11333203802660752670876485514",
        ),
        switches=(
            "0.105514889394688264705779274227",
            "2.11683134105287967581222200037",
            "2.22201031074844005947782000076",
            "4.48666679814989824938011037056",
            "4.59170896546155180975429912897",
            "6.98103751827011175122751732174",
            "7.08602475259097147562228173754",
            "9.52980357374850645333943317904",
            "9.63476892629236479730276166894",
            "12.1010106769812950420449599046",
            "12.2059673454908303616641445777",
            "14.6812510534190860440653100125",
            "14.7862042809509973600754378006",
            "17.2650911341322188949029410798",
            "17.3700429990693788678122981152",
            "19.8503598766651063222296966326",
            "19.9553112021643773810417300734",
            "22.4361947173554885466537932096",
            "22.5411458293181132610647728498",
            "25.0222537273826549125902758832",
            "25.1272047548201125311911817105",
        ),
    ),
    "C": Problem(
        title="rocking toy (4.2)",
        variables=("psi", "d_psi", "x_R", "x_L"),
        parameters={
            "I_b": 1.0,
            "delta": 0.04,
            "a": 1.0,
            "b": 1.0,
            "c": 0.3,
            "rho": 0.2,
            "psi_star": 1.0,
            "H_star": 3.0,
            "P": 1.0,
        },
        initial=(-1.67, 0.0, 0.5, 0.0),
        span=63.0,
        cycles=10.5,
        final=(
            "1.54883288617451449683980710193",
            "-0.52050797726563669776682848942",
            "10.5",
            "11.0",
        ),
        switches=(
            "1.60057145279765272420812748259",
            "2.10867952729698180264062772064",
            "4.58831588493709242177067558393",
            "5.09809821816217116371213046745",
            "7.57570347482439280272272503859",
            "8.08698559652536707046688143407",
            "10.5627724358894996838457381975",
            "11.0753967150051965208225482102",
            "13.5495570803826410580664245967",
            "14.0633813760918330220197979487",
            "16.5360881776024410484296448143",
            "17.0509845396352941641789984882",
            "19.522393287807373915154205968",
            "20.0382467185217926686904747717",
            "22.508497071486462054540942396",
            "23.0252043579857273729042604957",
            "25.4944215742549785938234006009",
            "26.0118901954041867489047311705",
            "28.4801864880741800769905439607",
            "28.9983335985679530970989510843",
            "31.4658093897999848414224366845",
            "31.984560881343516629280159598",
            "34.4513059582695278177152111912",
            "34.9705955963629468166599845744",
            "37.4366901712584322542491627601",
            "37.9564588049313790346730505697",
            "40.4219744837036874486851978249",
            "40.9421693247528131879488433848",
            "43.4071699886022539396480824508",
            "43.9277439563690534894504972528",
            "46.3922865619761607147258528429",
            "46.9131976894063130841808240568",
            "49.3773329932507139591318778541",
            "49.8985438898486645253242900772",
            "52.3623171023312551394544144706",
            "52.8837944696236254445013751221",
            "55.3472458445917341251060377028",
            "55.8689600398064970568087735862",
            "58.332125404909847569738637532",
            "58.8540500487379401152826862459",
            "61.3169612818021463136799387668",
            "61.8390729063128480693914922034",
        ),
    ),
}

if __name__ == "__main__":
    for name, problem in PROBLEMS.items():
        final, switches = compute(name)
        agree = (final, switches) == (problem.final, problem.switches)
        print(
            f"{name}  {problem.title}: {len(switches)} switches, "
            f"{'as stored' if agree else 'NOT as stored'}"
        )
        if not agree:
            print(f"final={final},\nswitches={switches},")

"""The plot of a friction law: its force under a prescribed motion."""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from stickslip.arrays import Array
from stickslip.figures.drawing.style import (
    STICK_LINE,
    UNSTABLE,
    axis_label,
    legend_above,
    line_colours,
    new_figure,
    paper_style,
)
from stickslip.symbolic import expressions as ex

if TYPE_CHECKING:
    from stickslip.model.laws import FrictionLaw

_SHARES = (1.0, 0.5, 0.25)  # fractions of the largest amplitude
_RATIOS = (100.0, 10.0, 3.0)  # ratios of the rates before and after a step
_SAMPLES = 401  # samples of a quarter of a period, and of half a period after it
_REST = 1e-9  # fraction of the largest speed at which a jump at rest is drawn


def plot_law(law: FrictionLaw, values: Mapping[str, float] | None = None) -> Figure:
    """Plot loops of the force against the displacement and against the velocity, for sines of three
    amplitudes: the first loading and the following period. For rate-and-state laws, plot the
    response to steps of the rate, and the steady state.

    Parameters
    ----------
    values : mapping of str to float, optional
        Its parameters; by default those of its example.
    """
    with paper_style():
        figure = new_figure(8.4, 3.8)
        figure.suptitle(law.title, x=0.01, ha="left", fontsize=13)
        left, right = figure.subplots(1, 2, sharey=True)
        if law.increasing:
            _draw_steps(law, values, left, right)
            return figure
        amplitude, omega = law.stroke
        for share, colour in zip(_SHARES, line_colours(len(_SHARES)), strict=True):
            _, x, u, force = loop(law, share * amplitude, omega, values)
            label = f"$A = {_number(share * amplitude)}$"
            left.plot(x, force, color=colour, label=label)
            right.plot(u, force, color=colour, label=label)
        left.set_xlabel(axis_label(["x"], "m"))
        right.set_xlabel(axis_label(["u"], "m/s"))
        left.set_ylabel("friction force  [N]")
        for axes in (left, right):
            axes.ticklabel_format(axis="x", scilimits=(-2, 3), useMathText=True)
            axes.locator_params(axis="x", nbins=5)
        for axes in (left, right):
            _through_zero(axes)
        legend_above(left)
        return figure


def loop(
    law: FrictionLaw, amplitude: float, omega: float, values: Mapping[str, float] | None = None
) -> tuple[Array, Array, Array, Array]:
    """Time, displacement, velocity and force of a law under x = A sin ωt, from the unloaded state,
    for one and a quarter periods.

    Parameters
    ----------
    values : mapping of str to float, optional
        The law's parameters; by default those of its example.

    Returns
    -------
    t, x, u, force : arrays, shape (n,)
        The force is positive where it resists u > 0. Where u vanishes there are two entries, of
        just before and just after.
    """
    quarter = math.pi / (2.0 * omega)
    ends = np.array([0.0, 1.0, 3.0, 5.0]) * quarter
    t = np.concatenate([np.linspace(a, b, _SAMPLES) for a, b in pairwise(ends)])
    side = np.repeat([1.0, -1.0, 1.0], _SAMPLES)  # the direction of motion
    x = amplitude * np.sin(omega * t)
    u = amplitude * omega * np.cos(omega * t)
    u = side * np.maximum(side * u, 0.0)
    if law.dry:
        return t, x, u, side * _sliding(law, np.abs(u), values)
    system = law.driven(amplitude, omega, values)
    from stickslip.motion.simulate import simulate

    motion = simulate(system, (0.0, float(ends[-1])))
    at = motion.at(t)
    if law.stiffness:
        force = -sum(at[name] for name in at if name.startswith("friction_"))
        return t, x, u, np.asarray(force)
    d = system.declaration
    formula = d.scope.parse("force_law", "law")
    known = {**system.values, "t": 0.0}
    rows = np.stack([at[name] for name in d.state], axis=1)
    states = (dict(zip(d.state, map(float, row), strict=True)) for row in rows)
    found = [
        ex.evaluate(formula, {**known, **state, "t": float(time)})
        for time, state in zip(t, states, strict=True)
    ]
    return t, x, u, np.array(found)


def _draw_steps(
    law: FrictionLaw, values: Mapping[str, float] | None, left: Axes, right: Axes
) -> None:
    """Plot the force against slip for steps of the rate up and down, and against the rate:
    instantaneous and steady-state values."""
    for ratio, colour in zip(_RATIOS, line_colours(len(_RATIOS)), strict=True):
        _, x, _, force = steps(law, ratio, values)
        left.plot(x, force, color=colour, label=f"rate $\\times {_number(ratio)}$")
    known = law.specimen(values).values
    rates = known["v_0"] * np.logspace(-3, 5, _SAMPLES)
    steady = law_force(law, rates, known["D_c"] / rates, values)
    held = law_force(law, rates, np.full(_SAMPLES, known["D_c"] / known["v_0"]), values)
    right.plot(rates, steady, color=STICK_LINE, label="steady sliding")
    right.plot(rates, held, color=STICK_LINE, linestyle=UNSTABLE, label="at once, from $v_0$")
    right.set_xscale("log")
    left.ticklabel_format(axis="x", scilimits=(-2, 3), useMathText=True)
    left.set_xlabel(axis_label(["x"], "m"))
    right.set_xlabel(axis_label(["u"], "m/s"))
    left.set_ylabel("friction force  [N]")
    for axes in (left, right):
        legend_above(axes)


def steps(
    law: FrictionLaw, ratio: float, values: Mapping[str, float] | None = None
) -> tuple[Array, Array, Array, Array]:
    """Time, slip, rate and force of a rate-and-state law whose rate steps from v_0 to a multiple
    and back.

    Returns
    -------
    t, x, u, force : arrays, shape (n,)
    """
    from stickslip.motion.simulate import simulate

    system = law.stepped(ratio, values)
    known = system.values
    D_c, v_0 = known["D_c"], known["v_0"]
    times = D_c / v_0 * np.cumsum([0.0, 10.0, 20.0 / ratio, 20.0])
    slips = D_c * np.array([0.0, 10.0, 30.0, 50.0])
    t = np.concatenate([np.linspace(a, b, _SAMPLES) for a, b in pairwise(times)])
    x = np.concatenate([np.linspace(a, b, _SAMPLES) for a, b in pairwise(slips)])
    u = np.repeat(v_0 * np.array([1.0, ratio, 1.0]), _SAMPLES)
    motion = simulate(system, (0.0, float(times[-1])))
    return t, x, u, law_force(law, u, motion.at(t)["theta_law"], values)


def law_force(
    law: FrictionLaw, u: Array, theta: Array, values: Mapping[str, float] | None
) -> Array:
    """The force of a rate-and-state law at rates and states."""
    system = law.specimen(values)
    d = system.declaration
    formula = d.scope.parse("force_law", "law")
    known = {**system.values, "t": 0.0, "x": 0.0}
    return np.array(
        [
            ex.evaluate(formula, {**known, "d_x": float(v), "theta_law": float(state)})
            for v, state in zip(u, theta, strict=True)
        ]
    )


def _sliding(law: FrictionLaw, speed: Array, values: Mapping[str, float] | None) -> Array:
    """The kinetic friction force of a dry contact; at zero velocity its threshold."""
    system = law.specimen(values)
    (contact,) = system.declaration.contacts
    fastest = float(np.max(speed))
    given = system.values
    return np.array(
        [
            ex.evaluate(contact.kinetic_plus, {**given, "speed": float(v)})
            if v > _REST * fastest
            else ex.evaluate(contact.plus, given)
            for v in speed
        ]
    )


def _number(value: float) -> str:
    """A number in mathtext."""
    digits, _, exponent = f"{value:.3g}".partition("e")
    return rf"{digits}\cdot 10^{{{int(exponent)}}}" if exponent else digits


def _through_zero(axes: Axes) -> None:
    axes.axhline(0.0, color="0.8", lw=0.6, zorder=0)
    axes.axvline(0.0, color="0.8", lw=0.6, zorder=0)

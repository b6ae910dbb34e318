"""The plate compactor: the force that moves a vibrating plate, from full static friction to nearly
zero.

A plate of 100 kg is pulled by a spring while an imbalance modulates its normal force, N(t) = (mg +
F cos Ωt)⁺. By averaging ([M] Theorem 2.2) it moves under the force μ(mg − F)⁺: only the minimum of
the normal force matters. The resolved motion with inertia, switch by switch, converges to this law
as the pull becomes slow. Under a fast pull there is no reduction: a plate that never rests has the
mean friction. Without inertia the motion is a play, which is exact.

[M] A. Mielke, *Three examples concerning the interaction of dry friction and oscillations*, WIAS
preprint 2405 (2017).
"""

from pathlib import Path

import numpy as np

import stickslip as ss

WEIGHT = 981.0  # [N]
MU = 0.6
STIFFNESS = 5000.0  # [N/m]
OMEGA = 60.0  # [rad/s]
PERIOD = 2 * np.pi / OMEGA
PERIODS = 400  # of vibration in each motion
LAST = 17  # periods over which forces are averaged: two periods of the spring
SPEEDS = (0.1, 0.02, 0.004, 0.001)  # [m/s]


def threshold(amplitude):
    """μN(s) [N], a formula of the phase."""
    return f"{MU}*max({WEIGHT} + {amplitude}*cos(2*pi*s), 0)"


def averaged_law(amplitude):
    """Ψ_av(1), the force that moves the plate on average [N]."""
    return ss.WeightedL1([threshold(amplitude)]).average().support([1.0])


def instants(periods, each):
    """Times in the last periods [s], with the given number in each."""
    return np.linspace(PERIODS - periods, PERIODS, each * periods + 1) * PERIOD


def start(amplitude):
    """Position at which the spring force equals the averaged law [m]."""
    return -averaged_law(amplitude) / STIFFNESS


def resolved(amplitude, speed, periods=LAST, each=32):
    """Spring force [N] of the motion with inertia over the last periods."""
    system = ss.catalogue.plate_compactor(F=amplitude, V=speed)
    motion = ss.simulate(system, (0.0, PERIODS * PERIOD), initial={"x": start(amplitude)})
    assert motion.certificate.ok, motion.certificate.verdict
    t = instants(periods, each)
    return STIFFNESS * (speed * t - np.asarray(motion.at(t)["x"]))


def without_inertia(amplitude, speed, periods=LAST, each=32):
    """The same without inertia: an exact play."""
    load = f"{STIFFNESS * speed}*t"
    span = (0.0, PERIODS * PERIOD)
    motion = ss.play(
        load,
        threshold(amplitude),
        span,
        initial=start(amplitude),
        epsilon=PERIOD,
        stiffness=STIFFNESS,
    )
    assert motion.certificate.ok, motion.certificate.verdict
    t = instants(periods, each)
    return STIFFNESS * (speed * t - motion.position(t))


slowest = {F: float(resolved(F, SPEEDS[-1]).mean()) for F in (300.0, 900.0)}
exact = {F: float(without_inertia(F, SPEEDS[-1]).mean()) for F in (300.0, 900.0)}


def plot_forces(axes):
    """Mean force over the amplitude of the vibration."""

    amplitudes = np.append(np.linspace(0.0, 975.0, 14), [1020.0, 1065.0, 1110.0])
    for speed, colour in zip(SPEEDS, ss.style.line_colours(len(SPEEDS)), strict=True):
        forces = [resolved(F, speed).mean() for F in amplitudes]
        axes.plot(amplitudes, forces, "o-", color=colour, ms=4, lw=1.2, label=f"{speed:g} m/s")
    play = [without_inertia(F, SPEEDS[-1]).mean() for F in amplitudes]
    axes.plot(
        amplitudes,
        play,
        "s",
        color=ss.style.STICK_LINE,
        mfc="none",
        ms=7,
        mew=1.1,
        label="no inertia",
    )
    law = [averaged_law(F) for F in amplitudes]
    axes.plot(amplitudes, law, color=ss.style.STICK_LINE, lw=2.2, zorder=1, label="averaged law")
    axes.axvline(WEIGHT, color=ss.style.STICK_LINE, lw=0.8, ls=":")
    axes.text(WEIGHT - 12, 640, "$F = mg$", ha="right")
    axes.set_xlim(0, 1120)
    axes.set_ylim(0, 670)
    axes.set_xlabel("shaking amplitude $F$  [N]")
    axes.set_ylabel("mean pulling force  [N]")
    axes.legend(loc="lower left", fontsize=10, title="pulled at", alignment="left")


def plot_steps(axes, amplitude=600.0, speed=0.02, periods=3, each=300):
    """Pulling force, and the largest friction that the ground could provide."""

    t = instants(periods, each)
    friction = MU * np.maximum(WEIGHT + amplitude * np.cos(OMEGA * t), 0.0)
    s = t / PERIOD - (PERIODS - periods)
    axes.fill_between(
        s, 0.0, friction, fc=ss.style.BAND, ec=ss.style.THRESHOLD, lw=0.8, label=r"$\mu N(t)$"
    )
    axes.plot(
        s, resolved(amplitude, speed, periods, each), color=ss.style.BLUE, label="with inertia"
    )
    axes.plot(
        s,
        without_inertia(amplitude, speed, periods, each),
        color=ss.style.VERMILION,
        label="no inertia",
    )
    axes.axhline(
        averaged_law(amplitude), color=ss.style.STICK_LINE, lw=1.2, ls="--", label="averaged"
    )
    axes.set_xlim(0, periods)
    axes.set_ylim(0, 1150)
    axes.set_xlabel(r"time  [periods]")
    axes.set_ylabel("force  [N]")
    axes.text(0.5 * periods, 1060, f"$F$ = {amplitude:g} N, pulled at {speed:g} m/s", ha="center")
    ss.style.legend_above(axes)


if __name__ == "__main__":
    path = Path("out/plate-compactor/force.png")
    path.parent.mkdir(parents=True, exist_ok=True)
    with ss.style.paper_style():
        figure = ss.style.new_figure(10.4, 4.6)
        left, right = figure.subplots(1, 2)
        plot_forces(left)
        plot_steps(right)
        figure.savefig(path, dpi=200)
    for F in exact:
        law = averaged_law(F)
        print(
            f"F = {F:g} N: averaged {law:.1f} N, no inertia {exact[F]:.1f} N, resolved "
            f"{slowest[F]:.1f} N"
        )
    print(path)

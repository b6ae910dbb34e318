"""A brake with a tabulated friction coefficient: stability of steady sliding in the speed of the
disc and the force on the pad, and limit cycles.

Steady sliding loses its stability if friction decreases faster than the damping compensates; the
boundary N μ′(V) + c = 0 is a curve of Hopf points. With increasing speed of the disc, stick-slip
persists beyond this curve, up to a speed at which the cycle merges with an unstable one; in
between, both are possible. The script prints both speeds at the declared force, the cycle, and the
law fitted to the points, and plots the measurement, the map, the branch at the declared force, and
cycles.
"""

from pathlib import Path

import numpy as np

import stickslip as ss

HERE = Path(__file__).parent
SPEEDS, FORCES = (0.05, 1.5), (2.0, 40.0)  # m/s, N
brake = ss.load(HERE / "brake.toml")


def branches(speeds=SPEEDS):
    """Branches of steady sliding and of stick-slip over the speed, at the declared force."""
    steady = ss.continue_equilibrium(brake, "V", speeds)
    return steady, ss.continue_cycle(ss.find_cycle(brake), "V", speeds)


def boundary(steady):
    """Stability boundary of steady sliding in speed and force."""
    (hopf,) = steady.of_kind("Hopf")
    return ss.hopf_curve(brake, hopf, "V", "N", ranges={"V": SPEEDS, "N": FORCES})


def speeded_up(speeds=59, forces=39):
    """Amplitude and stick fraction with increasing speed of the disc: each motion starts from the
    final state of the previous one."""
    over = {"V": np.linspace(*SPEEDS, speeds), "N": np.linspace(*FORCES, forces)}
    return ss.sweep(brake, over, ["amplitude:x", "stick_fraction"], carry="V up")


def law():
    """Stribeck's law through the points, in place of the table."""
    measured = brake.tables["mu"]
    return ss.fit_law((measured.points[1:], measured.values[1:]), ss.laws.stribeck, starts=8)


def picture(swept, curve, steady, cycles, fitted, speeds=(0.1, 0.4, 0.7, 1.0)):
    """Plot the measurement and its law, the map with its boundary, the branch, and cycles."""
    measured = brake.tables["mu"]
    with ss.style.paper_style():
        figure = ss.style.new_figure(9.6, 7.6)
        axes = figure.subplot_mosaic("aabbb;cccdd")
        points, plane, branch, phase = axes.values()

        v = np.linspace(0.0, measured.points[-1], 801)
        points.plot(v, measured(v), color=ss.style.BLUE, label="monotone cubic")
        points.plot(v[1:], fitted.at(v[1:]), "--", color=ss.style.VERMILION, label="Stribeck's law")
        points.plot(measured.points, measured.values, "ko", ms=4, label="measured")
        points.set(xlabel="sliding speed  [m/s]", ylabel="friction coefficient", ylim=(0.0, 0.5))
        points.legend(frameon=False, loc="lower right")

        swept.plot("amplitude:x", ax=plane)
        plane.plot(curve.points.V, curve.points.N, "w-", lw=2.0)
        (end,) = cycles.of_kind("stick onset")
        plane.plot(end.value, end.parameters["N"], "wo")
        plane.set(xlim=SPEEDS, ylim=FORCES, xlabel="speed of the disc  [m/s]")
        plane.set_ylabel("force on the pad  [N]")
        for x, y, text in (
            (0.2, 33.0, "stick-slip"),
            (0.72, 27.0, "either"),
            (1.08, 8.0, "steady sliding"),
        ):
            plane.text(x, y, text, color="white")

        steady.plot("x", others=[cycles], ax=branch)
        branch.set_xlim(SPEEDS)
        for V in speeds:
            # the end of stick, where the pad begins to slip
            start = {"x": brake.evaluate("N*mu(0)/k"), "d_x": V}
            motion = ss.find_cycle(brake, start, parameters={"V": V}).trajectory
            seen = motion.at(np.linspace(*motion.t_span, 801))
            phase.plot(seen["x"], seen["d_x"], color=ss.style.BLUE)
            phase.text(seen["x"].mean(), V + 0.04, f"V = {V:g} m/s", ha="center")
        phase.set(
            xlabel="position of the pad  [m]", ylabel="velocity of the pad  [m/s]", ylim=(-1.1, 1.2)
        )
        for letter, ax in axes.items():
            ax.text(-0.02, 1.03, f"({letter})", transform=ax.transAxes, ha="right")
    return figure


if __name__ == "__main__":
    steady, cycles = branches()
    (hopf,), (onset,) = steady.of_kind("Hopf"), cycles.of_kind("stick onset")
    print(f"steady sliding is stable above V = {hopf.value:.6f} m/s ({hopf.note})")
    print(f"stick-slip ends at V = {onset.value:.6f} m/s")
    cycle = ss.find_cycle(brake)
    V = brake.values["V"]
    print(f"cycle at {V} m/s: {cycle.period:.6f} s, certified: {cycle.certificate.ok}")
    fitted = law()
    print("\n".join(fitted.unknowns_in_words()))
    swept = speeded_up()
    print(swept.certificate.verdict)
    picture(swept, boundary(steady), steady, cycles, fitted).savefig("brake-map.png")

"""Figure 3.3 of [M]: long stick and short slip of the spring slider."""

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Patch

import stickslip as ss
from stickslip_paper.drawing.entry import FigureEntry
from stickslip_paper.drawing.style import shade


def draw() -> Figure:
    """U and α over three periods of (3.3), stick in grey."""
    slider = ss.catalogue.spring_slider(mu="exp(-(alpha - 1)) + 0.1", nu=0.01, V=0.01)
    settled = ss.simulate(slider, (0.0, 100.0)).final
    motion = ss.simulate(slider, (0.0, 20.0), initial=settled)
    starts = motion.events.query("to == 'stick'")["time"].to_numpy()
    t = np.linspace(starts[0] + 1.0, starts[3] + 1.0, 6001)
    values = motion.at(t)
    t -= t[0]
    with ss.style.paper_style():
        figure = ss.style.new_figure(7.2, 4.0)
        upper, lower = figure.subplots(2, 1, sharex=True)
        for axes in (upper, lower):
            shade(axes, t, values["mode_block"] == 0)
        upper.plot(
            t,
            values["threshold_plus_block"],
            color=ss.style.THRESHOLD,
            lw=1.2,
            label=r"threshold $\tilde\mu(\alpha)$",
        )
        upper.plot(t, values["U"], color=ss.style.BLUE, label="$U$")
        lower.plot(t, values["alpha"], color=ss.style.VERMILION)
        upper.set_ylabel("stretch $U$")
        lower.set_ylabel(r"state $\alpha$")
        lower.set_xlabel("time $t$")
        lower.set_xlim(0.0, t[-1])
        ss.style.legend_above(
            upper,
            [
                *upper.get_legend_handles_labels()[0][::-1],
                Patch(color=ss.style.STICK_SHADE, label="stick"),
            ],
        )
        figure.align_ylabels()
    return figure


ENTRY = FigureEntry(
    "3.3",
    "Long stick, short slip",
    "Three periods of the spring slider (3.3) in the original variables. In stick (grey) the "
    "spring is stretched with the rate V and the state α decays; when U reaches the threshold "
    "μ̃(α), a short slip releases the spring and heats the surface. [M] leaves the numbers "
    "open; here k = α₀ = 1 and the scaling of section 3.3 with ν = 0.01, v̂ = 1, b = 1 and "
    "μ(s) = e^(−s), which is V = νv̂ = 0.01 and μ̃(α) = e^(−(α − 1)) + √ν b (with the sign of "
    "√ν B corrected). A slip lasts 0.32, which is π√ν/ω_b = 0.36 at lowest order; a stick lasts "
    "ten times as long.",
    draw,
)

"""A package that adds a friction law, a measure, a figure and a command to stickslip.

`pip install .` in this folder adds `stickslip law wet`, `stickslip skid`, the measure
`longest_stick` of maps, and, once this module is imported, `motion.plot("speeds")`.
"""

import numpy as np

import stickslip as ss

wet = ss.laws.FrictionLaw(
    "wet",
    "A wet contact: a film carries more and more of the load",
    "this example",
    "Friction falls with the speed as the film builds up, and grows again with its viscosity.",
    parameters={
        "F_s": ss.Parameter(1.0, "N", "friction at rest", "[0, inf)"),
        "v_film": ss.Parameter(
            0.2, "m/s", "speed at which half of the load is carried", "(0, inf)"
        ),
        "b": ss.Parameter(0.05, "N*s/m", "viscous friction of the film", "[0, inf)"),
    },
    threshold="F_s",
    kinetic="F_s*v_film/(v_film + speed) + b*speed",
)


def longest_stick(motion):
    """The longest time for which some contact sticks without a break."""
    events = motion.events
    begun = events["time"][events["to"] == "stick"].to_numpy()
    ended = events["time"][events["from"] == "stick"].to_numpy()
    if not len(begun) or not len(ended):
        return 0.0
    ended = ended[ended > begun[0]]
    return float(np.max(ended - begun[: len(ended)], initial=0.0))


def block():
    """A block on a wet belt."""
    return ss.System(
        "wet block",
        parameters={"V": ss.Parameter(0.1, "m/s", "speed of the belt")},
        coordinates={"x": ss.Inertial("m")},
        kinetic="d_x**2/2",
        potential="x**2/2",
        contacts={
            "belt": ss.laws.by_name("wet")("d_x", F_s=1.0, v_film=0.2, b=0.05, surface_speed="V")
        },
        time_unit="s",
        span=(0.0, 40.0),
    )


@ss.figures.register(ss.Trajectory)
def speeds(motion, ax=None):
    """How often each rate occurs."""
    with ss.style.paper_style():
        ax = ss.style.new_figure(5.0, 3.5).subplots() if ax is None else ax
        start, end = motion.t_span
        rates = motion.at(np.linspace(start, end, 4001))["d_x"]
        share = np.full(len(rates), 100.0 / len(rates))
        ax.hist(rates, bins=50, weights=share, log=True, color=ss.style.BLUE)
        ax.set(xlabel="velocity of the block  [m/s]", ylabel="fraction of time  [%]")
    return ax.figure


def skid(speed: float = 0.1, out: str = "skid.png") -> None:
    """Draw how often each rate occurs on a belt of some speed."""
    motion = ss.simulate(block(), parameters={"V": speed})
    motion.plot("speeds").savefig(out)
    print(f"{motion.n_switches} switches, certified: {motion.certificate.ok}, {out}")

"""Rate-and-state friction: velocity steps and holds of a laboratory sample, a law fitted to a step,
and the events of two coupled faults and of a chain of 50 blocks with their recurrence times.

Prints the friction step compared with (a − b) ln(V₂/V₁), the healing in holds, the fitted law, and
the number of events and the times between them.
"""

import numpy as np

import stickslip as ss

LAW = {"a": 0.010, "b": 0.014, "D_c": 10.0}  # D_c in um
SPEEDS = [(200.0, 1.0), (60.0, 10.0), (200.0, 1.0)]  # s, um/s
HOLDS = [(10.0, 0.0), (60.0, 10.0), (100.0, 0.0), (60.0, 10.0), (1000.0, 0.0), (60.0, 10.0)]
YEAR = 3.156e7  # s


def sample(history):
    """A sample pushed by a stiff spring, whose end moves at given speeds."""
    times, speeds = np.array(history).T
    t = np.concatenate([[0.0], np.cumsum(times)])
    pushed = ss.Samples(t, np.concatenate([[0.0], np.cumsum(times * speeds)]), unit="um")
    return ss.System(
        "sample",
        parameters={
            "a": ss.Parameter(LAW["a"]),
            "b": ss.Parameter(LAW["b"]),
            "D_c": ss.Parameter(LAW["D_c"], "um"),
            "k": ss.Parameter(0.01, "1/um", "stiffness per normal force"),
            "v_0": ss.Parameter(1.0, "um/s"),
        },
        drives={"X": pushed},
        coordinates={"x": ss.Viscous("um")},
        potential="k/2*(0.6/k + X - x)**2",
        contacts={
            "gouge": ss.laws.rate_and_state(
                "d_x", a="a", b="b", D_c="D_c", N=1.0, mu_0=0.6, v_0="v_0"
            )
        },
        outputs={"mu": ss.Output("k*(0.6/k + X - x)", "", "coefficient of friction")},
        initial={"theta_gouge": 10.0},
        time_unit="s",
    )


def fitted(starts=4, seed=1):
    """The law fitted to a record of one step, at 10 Hz, with a noise of 0.0005.

    `velocity_step` is the same sample with friction as a part of the state; that has derivatives.
    """
    system = ss.catalogue.velocity_step(**LAW, k=0.01)
    t = np.arange(0.0, 60.0, 0.1)
    noise = 5e-4 * np.random.default_rng(seed).standard_normal(len(t))
    record = {"t": t, "friction": ss.simulate(system).at(t)["mu"] + noise}
    free = {"a": (0.003, 0.03), "b": (0.003, 0.03), "D_c": (2.0, 50.0)}
    return ss.fit(system, record, free, {"friction": "mu"}, starts=starts)


def chained(blocks=50, until=400.0):
    """The events of a chain on a slow belt (Burridge and Knopoff)."""
    chain = ss.catalogue.block_chain(N=blocks, V=0.01)
    return ss.simulate(chain, (0.0, until)).event_catalogue()


if __name__ == "__main__":
    stepped = ss.simulate(sample(SPEEDS))
    slow, fast = stepped.at([199.0, 259.0])["mu"]
    expected = (LAW["a"] - LAW["b"]) * np.log(10.0)
    print(f"step of friction {fast - slow:.6f}, (a - b) ln 10 = {expected:.6f}")
    stepped.plot("mu").savefig("velocity-steps.png")

    held = ss.simulate(sample([(60.0, 10.0), *HOLDS]))
    t = np.linspace(*held.t_span, 20_001)
    mu = held.at(t)["mu"]
    ends = 60.0 + np.cumsum([times for times, _ in HOLDS])
    for (hold, _), begin, end in zip(HOLDS[::2], ends[::2], ends[1::2], strict=True):
        peak = mu[(t >= begin) & (t <= end)].max()
        print(f"held for {hold:5.0f} s: peak {peak - mu[-1]:.5f} above sliding")
    held.plot("mu").savefig("holds.png")

    fit = fitted()
    for name, (low, high) in fit.interval.items():
        print(f"{name} = {fit.estimate[name]:.5g} (95 %: {low:.5g} to {high:.5g})")

    # Two faults of the same size that load each other: they never stick, so an event is an
    # interval in which a slip rate exceeds 1 mm/s.
    pair = ss.simulate(ss.catalogue.two_block_rate_and_state())
    quakes = pair.event_catalogue(faster_than=1e-3)
    waits = quakes.table["interevent"].dropna() / YEAR
    print(f"{len(quakes)} earthquakes, {waits.min():.1f} to {waits.max():.1f} years apart")
    quakes.plot().savefig("earthquakes.png")

    events = chained()
    waits = events.table["interevent"].dropna()
    print(f"chain: {len(events)} events, {waits.median():.3g} s apart in the median")
    events.plot().savefig("chain.png")

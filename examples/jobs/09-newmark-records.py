"""The slip of a block under 100 records, as a function of the friction and the scale of the
records, and the motion of a floor on sliding bearings under two components of a record.

Prints the scale at which half of the records exceed 10 cm, and the displacement of the floor.
"""

import numpy as np

import stickslip as ss


def record(seed):
    """A record of 10 s of noise with an envelope, with a peak acceleration of 1 m/s²."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, 10.0, 0.02)
    noise = np.convolve(rng.standard_normal(len(t)), np.hanning(rng.integers(8, 32)), "same")
    a = noise * (t / 3.0) ** 2 * np.exp(2.0 - 2.0 * t / 3.0)
    return ss.Samples(t, a / np.abs(a).max())


def slips(records=100, scales=11):
    """The largest slip in either direction. A scale is the peak acceleration, in m/s²."""
    over = {
        "record": ss.Records({f"record {i:02}": record(i) for i in range(records)}),
        "scale": np.linspace(1.0, 6.0, scales),
        "mu": [0.1, 0.15, 0.2],
    }
    return ss.sweep(ss.catalogue.sliding_base(), over, ["slip = max(high:x, -low:x)"])


def floor():
    """A floor on bearings under two simultaneous records with peaks of 1 m/s²."""
    bearing = ss.catalogue.isolated_floor()
    return ss.simulate(bearing.configure({"a_x": record(1), "a_y": record(2)}))


if __name__ == "__main__":
    found = slips()
    fragility = found.fragility("slip", limit=0.1)
    print("median scale over friction:", fragility["median"].values.round(2).tolist(), "m/s²")
    found.plot().savefig("slips.png")
    fragility.plot().savefig("fragility.png")
    moved = floor()
    print(moved.summary())
    moved.plot().savefig("floor.png")

"""A bowed string: its sound as a WAV file, and the bow forces and speeds at which it sounds
(after Schelleng).

Prints the pitch for several bow forces, and the fraction of the map in which the string sounds.
"""

import numpy as np

import stickslip as ss

string = ss.catalogue.bowed_string()


def pitches(forces=(0.01, 0.05, 0.2)):
    """The frequency of the sound, in Hz: too large a force flattens it."""
    return {F: 1.0 / ss.find_cycle(string, parameters={"F": F}).period for F in forces}


def schelleng(forces=24, speeds=16):
    """The fraction of the time in which the string sticks to the bow: 0 if it does not sound."""
    over = {"F": f"log:0.002:2:{forces}", "V": f"log:0.02:0.5:{speeds}"}
    return ss.sweep(string, over, ["stick_fraction", "pitch = 1/period"])


def sound(seconds=1.0):
    return ss.simulate(string, (0.0, seconds), parameters={"F": 0.05})


if __name__ == "__main__":
    for F, pitch in pitches().items():
        print(f"{1e3 * F:.0f} mN: {pitch:.2f} Hz")
    ss.export(sound(), "string.wav", "x")
    found = schelleng()
    sticks = found["stick_fraction"].values
    print(
        f"sounds at {np.mean(sticks > 0):.0%} of the points, no value at "
        f"{np.mean(np.isnan(sticks)):.0%}"
    )
    found.plot().savefig("schelleng.png")

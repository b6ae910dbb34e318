"""A tip that is pulled over a lattice, in one direction and in the plane: mean friction over the
speed and the direction of the pull.

Prints the friction of slow and fast pulls, and draws both.
"""

import numpy as np

import stickslip as ss

line = ss.catalogue.prandtl_tomlinson()
plane = ss.System(
    "tip on a square lattice",
    parameters={
        "V": ss.Parameter(0.1, "", "speed of the pull", "(0, inf)"),
        "angle": ss.Parameter(0.0, "rad", "direction of the pull"),
        "k": ss.Parameter(1.0, "", "stiffness", "(0, inf)"),
        "U": ss.Parameter(0.1, "", "height of the lattice"),
    },
    coordinates={"x": ss.Inertial(), "y": ss.Inertial()},
    kinetic="(d_x**2 + d_y**2)/2",
    viscous="0.5*(d_x**2 + d_y**2)",
    potential=(
        "-U*cos(2*pi*x)*cos(2*pi*y)"
        " + k/2*((x - V*t*cos(angle))**2 + (y - V*t*sin(angle))**2)"
    ),
    outputs={"pull": "k*(cos(angle)*(V*t*cos(angle) - x) + sin(angle)*(V*t*sin(angle) - y))"},
    span=(0.0, 200.0),
)


def along_the_line(points=15):
    """The mean friction over the speed, F(V)."""
    slow = ss.find_cycle(line, parameters={"V": 0.01})
    branch = ss.continue_cycle(slow, "V", (0.01, 10.0))
    return branch.points["V"].values, branch.points["energy_per_distance"].values


def over_the_plane(speeds=8, angles=7):
    """The mean pull along its direction, over speed and direction."""
    over = {"V": f"log:0.02:2:{speeds}", "angle": np.linspace(0.0, np.pi / 4, angles)}
    return ss.sweep(plane, over, ["mean:pull"])


if __name__ == "__main__":
    V, F = along_the_line()
    print(f"line: F = {F[0]:.6f} at V = {V[0]:.3g}, {F[-1]:.6f} at {V[-1]:.3g}")
    found = over_the_plane()
    pull = found["mean:pull"].values
    print("plane: slowest", pull[0].round(4), "fastest", pull[-1].round(4))
    found.plot().savefig("lattice-friction.png")

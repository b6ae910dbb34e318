"""A tip pulled across a lattice, along a line and in the plane: its mean friction as a function of
the speed and the direction of the pull.

Prints the friction of slow and fast pulls, and plots both. All directions are those of lattice
vectors, because in other directions motions are not periodic and means converge slowly.
"""

import stickslip as ss

line = ss.catalogue.prandtl_tomlinson()
plane = ss.System(
    "tip on a square lattice",
    parameters={
        "V": ss.Parameter(0.1, "", "speed of the pull", "(0, inf)"),
        "q": ss.Parameter(0.0, "", "slope of the pull"),
        "k": ss.Parameter(1.0, "", "stiffness", "(0, inf)"),
        "U": ss.Parameter(0.1, "", "height of the lattice"),
    },
    functions={"X": "V*t/sqrt(1 + q**2)", "Y": "V*t*q/sqrt(1 + q**2)"},
    coordinates={"x": ss.Inertial(), "y": ss.Inertial()},
    kinetic="(d_x**2 + d_y**2)/2",
    potential="-U*cos(2*pi*x)*cos(2*pi*y) + k/2*((x - X)**2 + (y - Y)**2)",
    viscous="0.5*(d_x**2 + d_y**2)",
    outputs={"pull": "k*(X - x + q*(Y - y))/sqrt(1 + q**2)"},
    span=(0.0, 200.0),
)


def along_the_line():
    """Cycles of the catalogue's tip over the speed: their energy per distance is F(V)."""
    slow = ss.find_cycle(line, parameters={"V": 0.01})
    return ss.continue_cycle(slow, "V", (0.01, 10.0))


def over_the_plane(speeds=12, slopes=(0, 1 / 4, 1 / 3, 1 / 2, 2 / 3, 3 / 4, 1)):
    """The mean force in the direction of the pull, over speed and direction."""
    over = {"V": f"log:0.01:2:{speeds}", "q": list(slopes)}
    return ss.sweep(plane, over, ["mean:pull"])


if __name__ == "__main__":
    branch = along_the_line()
    V, F = (branch.points[name].values for name in ("V", "energy_per_distance"))
    branch.plot("energy_per_distance").savefig("line-friction.png")
    print(f"line: F = {F[0]:.6f} at V = {V[0]:.3g}, {F[-1]:.6f} at {V[-1]:.3g}")
    found = over_the_plane()
    pull = found["mean:pull"].values
    print("plane: slowest", pull[0].round(4), "fastest", pull[-1].round(4))
    print(found.certificate.verdict)
    found.plot().savefig("lattice-friction.png")

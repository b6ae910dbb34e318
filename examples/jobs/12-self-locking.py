"""Self-locking of a capstan, a wedge, a lever shoe and a screw jack: from which friction on nothing
moves, or how much a turn of rope holds, beside the closed forms.

Prints each limit and its closed form.
"""

import math

import stickslip as ss


def wedge():
    """A block on a slope of angle a; it stays where μ > tan a."""
    return ss.System(
        "wedge",
        parameters={"a": ss.Parameter(0.3, "rad", "slope"), "mu": ss.Parameter(0.3)},
        coordinates={"x": ss.Inertial("m"), "y": ss.Inertial("m")},
        kinetic="(d_x**2 + d_y**2)/2",
        potential="9.81*(y*cos(a) - x*sin(a))",
        contacts={"slope": ss.Unilateral("y", "d_x", mu="mu")},
        span=(0.0, 1.0),
    )


def capstan(parts=40, turn=math.pi):
    """A rope on a drum in so many parts, pulled with 1 and with F; it holds to F = exp(μ·turn).

    Of a part between tensions S and S', the drum takes the normal force (S + S')·tan(turn/2n).
    """
    share = 2.0 * math.tan(turn / parts / 2.0)
    tensions = ["1", *(f"S{i}" for i in range(1, parts)), "F"]
    return ss.System(
        "capstan",
        parameters={"F": ss.Parameter(1.5, "N"), "mu": ss.Parameter(0.2)},
        coordinates={f"u{i}": ss.Inertial("m") for i in range(parts)},
        kinetic=" + ".join(f"d_u{i}**2/2" for i in range(parts)),
        functions={f"S{i}": f"1 + 1000*(u{i} - u{i - 1})" for i in range(1, parts)},
        potential="u0 - F*u%d + " % (parts - 1)
        + " + ".join(
            f"(u{i} - u{i - 1}) + 500*(u{i} - u{i - 1})**2" for i in range(1, parts)
        ),
        viscous=" + ".join(f"10*d_u{i}**2" for i in range(parts)),
        contacts={
            f"c{i}": ss.Contact(f"d_u{i}", f"mu*{share}*({tensions[i]} + {tensions[i + 1]})/2")
            for i in range(parts)
        },
        span=(0.0, 50.0),
    )


def lever_shoe():
    """A lever with a brake shoe at its end, at (l, h) from its pivot, on a drum that drives it.

    The shoe jams where μ > l/h: friction presses it more than the drum lifts it.
    """
    return ss.System(
        "lever shoe",
        parameters={"mu": ss.Parameter(0.3), "l": ss.Parameter(1.0, "m"), "h": ss.Parameter(2.0, "m")},
        coordinates={"x": ss.Inertial("m", "way of the drum"), "phi": ss.Inertial("rad")},
        kinetic="d_x**2/2 + d_phi**2/2",
        potential="-x + 0.1*phi",
        contacts={
            "shoe": ss.Unilateral("l*phi", "d_x - h*d_phi", mu="mu"),
        },
        span=(0.0, 1.0),
    )


def screw_jack():
    """A load on a thread of slope tan a = lead/(2π r); it stays where μ > tan a."""
    return ss.System(
        "screw jack",
        parameters={"lead": ss.Parameter(5e-3, "m"), "r": ss.Parameter(0.01, "m"), "mu": ss.Parameter(0.1)},
        coordinates={"phi": ss.Inertial("rad"), "z": ss.Inertial("m")},
        kinetic="1e-3*d_phi**2/2 + 10*d_z**2/2",
        potential="1000*z",
        contacts={
            "thread": ss.Bilateral(
                "(z - lead*phi/(2*pi))*cos(atan(lead/(2*pi*r)))",
                "r*d_phi*cos(atan(lead/(2*pi*r))) + d_z*sin(atan(lead/(2*pi*r)))",
                mu="mu",
            )
        },
        span=(0.0, 1.0),
    )


def limit(system, name, low, high, tolerance=1e-9, **others):
    """The value of a parameter on one side of which the system stays, by bisection."""

    def moves(value):
        motion = ss.simulate(system, parameters={name: value, **others})
        return any(contact != "stick" for contact in motion.events["to"]) or any(
            abs(v) > 0.0 for x, v in motion.final.items() if x.startswith("d_")
        )

    first = moves(low)
    if moves(high) == first:
        raise ValueError(f"{system.name}: the same at {low} and {high}")
    while high - low > tolerance * high:
        middle = (low + high) / 2
        low, high = (middle, high) if moves(middle) == first else (low, middle)
    return (low + high) / 2


if __name__ == "__main__":
    print(f"wedge: {limit(wedge(), 'mu', 0.1, 1.0):.9f}, tan a = {math.tan(0.3):.9f}")
    slope = 5e-3 / (2 * math.pi * 0.01)
    print(f"screw jack: {limit(screw_jack(), 'mu', 0.01, 0.5):.9f}, lead/(2πr) = {slope:.9f}")
    print(f"lever shoe: {limit(lever_shoe(), 'mu', 0.1, 1.0):.9f}, l/h = {1 / 2:.9f}")
    print(f"capstan: {limit(capstan(), 'F', 1.1, 4.0, 1e-6):.6f}, exp(0.2π) = {math.exp(0.2 * math.pi):.6f}")

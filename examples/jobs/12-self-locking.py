"""Self-locking of a capstan, a wedge, a lever shoe and a screw jack: the coefficient of friction
above which nothing moves, or the force that a turn of rope holds.

Prints each limit and its closed form.
"""

import math

import stickslip as ss


def wedge():
    """A block on a slope of angle a; it rests if μ > tan a."""
    return ss.System(
        "wedge",
        parameters={"a": ss.Parameter(0.3, "rad", "slope"), "mu": ss.Parameter(0.3)},
        coordinates={"x": ss.Inertial("m"), "y": ss.Inertial("m")},
        kinetic="(d_x**2 + d_y**2)/2",
        potential="9.81*(y*cos(a) - x*sin(a))",
        contacts={"slope": ss.Unilateral("y", "d_x", mu="mu")},
        span=(0.0, 1.0),
    )


def capstan(parts=12, turn=math.pi):
    """A rope on a drum, in parts, pulled with 1 and with F; it holds up to F = exp(μ·turn).

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
        potential=f"u0 - F*u{parts - 1} + "
        + " + ".join(f"(u{i} - u{i - 1}) + 500*(u{i} - u{i - 1})**2" for i in range(1, parts)),
        viscous=" + ".join(f"d_u{i}**2" for i in range(parts)),
        contacts={
            f"c{i}": ss.Contact(f"d_u{i}", f"mu*{share}*({tensions[i]} + {tensions[i + 1]})/2")
            for i in range(parts)
        },
        span=(0.0, 50.0),
    )


def lever_shoe():
    """A lever, pressed by the moment p, with a shoe on a bar that is pulled with 1 N.

    The shoe is at (l, h) from the pivot: friction presses it, too. The bar stays where
    μ > l/(p + h), for any pull where μ > l/h.
    """
    return ss.System(
        "lever shoe",
        parameters={
            "mu": ss.Parameter(0.3),
            "l": ss.Parameter(1.0, "m"),
            "h": ss.Parameter(2.0, "m"),
            "p": ss.Parameter(0.1, "N*m"),
        },
        coordinates={"x": ss.Inertial("m", "way of the bar"), "phi": ss.Inertial("rad")},
        kinetic="d_x**2/2 + d_phi**2/2",
        potential="-x + p*phi",
        contacts={"shoe": ss.Unilateral("l*phi", "d_x + h*d_phi", mu="mu")},
        span=(0.0, 1.0),
    )


def screw_jack():
    """A load on a thread of slope tan a = lead/(2π r); it rests if μ > tan a."""
    return ss.System(
        "screw jack",
        parameters={
            "lead": ss.Parameter(5e-3, "m"),
            "r": ss.Parameter(0.01, "m"),
            "mu": ss.Parameter(0.1),
        },
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


def limit(system, name, low, high, tolerance=1e-9):
    """The value of a parameter on one side of which the system comes to rest, by bisection."""

    def moves(value):
        final = ss.simulate(system, parameters={name: value}).final
        return any(final[x] != 0.0 for x in final if x.startswith("d_"))

    first = moves(low)
    if moves(high) == first:
        raise ValueError(f"{system.name}: the same at {low} and {high}")
    while high - low > tolerance * high:
        middle = (low + high) / 2
        low, high = (middle, high) if moves(middle) == first else (low, middle)
    return (low + high) / 2


def closed_forms():
    """The limits at the declared numbers; the capstan has 12 parts (in the limit, exp(0.2π))."""
    slope = 5e-3 / (2 * math.pi * 0.01)
    half = 0.2 * math.tan(math.pi / 24)
    rope = ((1 + half) / (1 - half)) ** 12
    return {"wedge": math.tan(0.3), "screw jack": slope, "lever shoe": 1 / 2.1, "capstan": rope}


if __name__ == "__main__":
    found = {
        system.name: limit(system, "mu", 0.01, 1.0)
        for system in (wedge(), screw_jack(), lever_shoe())
    }
    found["capstan"] = limit(capstan(), "F", 1.1, 4.0)
    for name, expected in closed_forms().items():
        print(f"{name}: {found[name]:.9f}, closed form {expected:.9f}")

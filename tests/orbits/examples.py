"""Systems whose cycles are known in closed form, or in the literature."""

from __future__ import annotations

from functools import cache

from stickslip import Contact, Inertial, Internal, RateIndependent, System, catalogue
from systems import parameters

SLIDER = catalogue.spring_slider(mu="2/sqrt(alpha)", nu=0.05)
HALF_TURN = {"A": 1.0, "a": 0.15, "b": 0.2}


@cache
def planar() -> System:
    """Motions about (A cos t, A sin t), in a frame w that makes half a turn in 2π: w' = diag(a, −b)
    w + q w |w|².

    With b = −a and A = 0 it is autonomous: r' = r (a + q r²), and the cycle has the period 4π and
    the multiplier exp(−8πa).
    """
    u = "(x - A*cos(t))"
    v = "(y - A*sin(t))"
    m = "((a - b)/2 + q*s)"
    h = "(a + b)/2"
    m = m.replace("s", f"({u}**2 + {v}**2)")
    return System(
        name="planar",
        parameters=parameters(a=0.1, b=-0.1, A=0.0, q=-1.0),
        internal={
            "x": Internal(f"{m}*{u} + {h}*(cos(t)*{u} + sin(t)*{v}) - {v}/2 - A*sin(t)"),
            "y": Internal(f"{m}*{v} + {h}*(sin(t)*{u} - cos(t)*{v}) + {u}/2 + A*cos(t)"),
        },
        initial={"x": 1.5},
        span=(0, 60),
    )


@cache
def isola() -> System:
    """r' = r (1 − a² − (r² − 2)²)/10, θ' = 1: the cycles over a form a closed curve, r² = 2 ± √(1 −
    a²)."""
    growth = "(1 - a**2 - (x**2 + y**2 - 2)**2)/10"
    return System(
        name="isola",
        parameters=parameters(a=0.0),
        internal={"x": Internal(f"{growth}*x - y"), "y": Internal(f"{growth}*y + x")},
        initial={"x": 1.7},
        span=(0, 100),
    )


@cache
def duffing() -> System:
    """x'' + c x' − x + x³ = F cos ωt, in one of its two wells."""
    return System(
        name="Duffing",
        parameters=parameters(F=0.2, c=0.3, omega=1.2),
        internal={"x": Internal("v"), "v": Internal("x - x**3 - c*v + F*cos(omega*t)")},
        initial={"x": 1.0},
        span=(0, 200),
    )


@cache
def damped_block() -> System:
    """A block with a damper on a belt, static above kinetic friction."""
    return System(
        name="damped block",
        parameters=parameters(V=0.3, c=0.1, F_s=1.0, F_k=0.6),
        coordinates={"x": Inertial()},
        kinetic="d_x**2/2",
        potential="x**2/2",
        viscous="c/2*d_x**2",
        contacts={"belt": Contact("d_x", "F_s", surface_speed="V", kinetic="F_k")},
        span=(0, 60),
    )


@cache
def dragged() -> System:
    """The block on a belt, seen from the ground: dragged by a spring whose end moves with V and
    shakes with A."""
    return System(
        name="dragged block",
        parameters=parameters(V=0.3, A=0.0, F_s=1.0, F_k=0.6),
        coordinates={"x": Inertial()},
        kinetic="d_x**2/2",
        potential="(V*t + A*sin(2*t) - x)**2/2",
        contacts={"ground": Contact("d_x", "F_s", kinetic="F_k")},
        span=(0, 60),
    )


@cache
def mass_on_belt() -> System:
    """A mass on a belt with friction that first falls and then rises with the speed, 1 − au + bu³.

    J. J. Thomsen, A. Fidlin, *Analytical approximations for stick-slip vibration amplitudes*, Int.
    J. Non-Linear Mechanics 38 (2003) 389-403. Steady sliding loses its stability at V² = (a −
    c)/(3b), supercritically; averaging gives the amplitude 2√(V_H² − V²) of the speed, which meets
    the belt, so that the mass begins to stick, at √0.8 V_H.
    """
    return System(
        name="mass on belt",
        parameters=parameters(V=0.5, a=0.3, b=0.2, c=0.1),
        coordinates={"x": Inertial()},
        kinetic="d_x**2/2",
        potential="x**2/2",
        viscous="c/2*d_x**2",
        contacts={
            "belt": Contact("d_x", "1", surface_speed="V", kinetic="1 - a*speed + b*speed**3")
        },
        span=(0, 100),
    )


@cache
def stribeck_belt() -> System:
    """A mass on a spring on a belt, the friction of which falls with the speed from F_s towards
    F_k.

    Steady sliding loses its stability, subcritically, where the slope of the friction is that of
    the damper: V = v_s log((F_s - F_k)/(c v_s)).
    """
    return System(
        name="Stribeck belt",
        parameters=parameters(V=0.5, F_s=1.0, F_k=0.5, v_s=0.5, m=1.0, k=1.0, c=0.05),
        coordinates={"x": Inertial()},
        kinetic="m*d_x**2/2",
        potential="k*x**2/2",
        viscous="c/2*d_x**2",
        contacts={
            "belt": Contact(
                "d_x", "F_s", surface_speed="V", kinetic="F_k + (F_s - F_k)*exp(-speed/v_s)"
            )
        },
        span=(0, 100),
    )


@cache
def jenkins() -> System:
    """A lightly damped, driven oscillator with a damper of a spring and a dry contact in series."""
    return System(
        name="Jenkins element",
        parameters=parameters(m=1.0, k=1.0, c=0.02, k_d=0.5, F_c=1.0, F=0.3, omega=0.7),
        coordinates={"x": Inertial(), "z": RateIndependent()},
        kinetic="m*d_x**2/2",
        potential="k*x**2/2 + k_d*(x - z)**2/2 - F*cos(omega*t)*x",
        viscous="c/2*d_x**2",
        contacts={"damper": Contact("d_z", "F_c")},
        span=(0, 100),
    )

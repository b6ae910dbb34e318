"""One coordinate on a spring with one contact: declared for the library, and written by hand for
the reference."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

from stickslip import Contact, Inertial, Parameter, RateIndependent, System, Viscous

from ..case import Rng
from ..references.mechanics import Mechanics, Zone

KINDS = {"inertial": Inertial, "viscous": Viscous, "rate-independent": RateIndependent}


@cache
def declared(
    kind: str,
    load: str = "0",
    *,
    potential: str = "0",
    threshold: str = "mu",
    kinetic: str | None = None,
    belt: str = "0",
    extra: str = "",
) -> System:
    """Declaration of m x'' + c x' + k x + potential' + threshold Sign(x' − belt) ∋ load.

    Parameters
    ----------
    extra : str
        Names of further parameters with defaults, such as ``"A=1 w=0.1"``.
    """
    numbers = dict(entry.split("=") for entry in extra.split())
    own = {"k": 1.0, "mu": 0.5} | ({"c": 1.0} if kind != "rate-independent" else {})
    own |= {"m": 1.0} if kind == "inertial" else {}
    parameters = {name: Parameter(float(value)) for name, value in (own | numbers).items()}
    return System(
        name=f"{kind} coordinate",
        parameters=parameters,
        coordinates={"x": KINDS[kind]()},
        kinetic="m/2*d_x**2" if kind == "inertial" else 0.0,
        potential=f"k/2*x**2 + {potential} - ({load})*x",
        viscous="c/2*d_x**2" if kind != "rate-independent" else 0.0,
        contacts={"ground": Contact("d_x", threshold, belt, kinetic)},
    )


def by_hand(
    kind: str,
    numbers: dict[str, float],
    load: Callable[[Any], Any],
    *,
    push: Callable[[Any], Any] | None = None,
    bound: Callable[[Any, Any], Any] | None = None,
    kinetic: Callable[[Any], Any] | None = None,
    belt: Callable[[Any], Any] | None = None,
    zones: tuple[Zone, ...] = (),
    step: float = 0.3,
) -> Mechanics:
    """The same by hand.

    Parameters
    ----------
    load : function of t
    push : function of x, optional
        −potential'.
    bound : function of (t, x), optional
        The threshold, by default mu.
    kinetic : function of the speed, optional
    belt : function of t, optional
    """
    k, mu, c, m = (numbers.get(name, 0.0) for name in ("k", "mu", "c", "m"))
    drag = c if kind == "inertial" else 0.0
    kinds = {"inertial": (1, 0, 0, 0), "viscous": (0, 1, 0, 0), "rate-independent": (0, 0, 1, 0)}[
        kind
    ]

    def force(t: Any, x: Any, v: Any, a: Any, side: Any) -> list[Any]:
        total = load(t) - k * x[0] + (push(x[0]) if push else 0.0)
        return [total - drag * v[0]] if drag else [total]

    def threshold(t: Any, x: Any, v: Any, a: Any, side: Any) -> list[Any]:
        return [bound(t, x[0]) if bound else mu]

    def sliding(t: Any, x: Any, v: Any, a: Any, side: Any, speed: Any) -> list[Any]:
        assert kinetic is not None
        return [kinetic(speed[0])]

    def surface(t: Any) -> list[Any]:
        assert belt is not None
        return [belt(t)]

    return Mechanics(
        kinds=kinds,
        inertia={"inertial": [[m]], "viscous": [[c]], "rate-independent": []}[kind],
        J=[[1.0]],
        force=force,
        threshold=threshold,
        kinetic=sliding if kinetic else None,
        belt=surface if belt else None,
        zones=zones,
        step=step,
    )


def ordinary(rng: Rng, kind: str) -> dict[str, float]:
    """Ordinary numbers of such a system."""
    numbers = {"k": rng.uniform(0.5, 2.0), "mu": rng.uniform(0.2, 0.8)}
    if kind != "rate-independent":
        numbers["c"] = (
            float(rng.choice([0.0, 0.1, 0.3])) if kind == "inertial" else rng.uniform(0.3, 2.0)
        )
    if kind == "inertial":
        numbers["m"] = rng.uniform(0.5, 2.0)
    return numbers

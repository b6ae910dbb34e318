"""A body without mass that is dragged across a table by a spring."""

from stickslip.model.system import (
    Condition,
    Contact,
    DefaultSpan,
    Parameter,
    RateIndependent,
    System,
)


def tractrix(**given: float | str) -> System:
    """Body dragged across a table by a spring whose end moves along a line. The body moves along
    the spring force, whose magnitude is that of the friction, so that it follows the end at a
    constant distance. Its path is the tractrix, that of a watch drawn across a table by its chain.

    Parameters
    ----------
    **given : float or str
        Parameters ``k``, ``F_c``, ``V``; drives ``p_x``, ``p_y`` (place of the spring's end, of t).

    References
    ----------
    G. W. Leibniz, *Supplementum geometriae dimensoriae*, Acta Eruditorum (1693) 385-392. With the
    length a = F_c/k and τ = Vt/a the body is at x = a (τ − tanh τ), y = a/cosh τ.
    """
    return System(
        name="tractrix",
        title="Body dragged by a spring: the tractrix",
        source="Leibniz 1693",
        parameters={
            "k": Parameter(10.0, "N/m", "stiffness of the spring", "(0, inf)"),
            "F_c": Parameter(1.0, "N", "friction", "(0, inf)"),
            "V": Parameter(0.1, "m/s", "speed of the spring's end", "(0, inf)"),
        },
        drives={"p_x": "V*t", "p_y": "0"},
        coordinates={
            "x": RateIndependent("m", "position of the body along the line"),
            "y": RateIndependent("m", "distance from the line"),
        },
        potential="k/2*((x - p_x)**2 + (y - p_y)**2)",
        contacts={"table": Contact(("d_x", "d_y"), threshold="F_c", unit="N")},
        initial={"y": 0.1},
        span=DefaultSpan((0, 5)),
        time_unit="s",
        conditions={"spring": Condition("k > 0", "nothing drags the body")},
        facts={"length": "F_c/k"},
    ).configure(given)

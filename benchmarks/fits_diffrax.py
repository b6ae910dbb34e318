"""Regularised fields, and their motions with derivatives by diffrax."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np

os.environ.setdefault(
    "XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"
)

from stickslip.arrays import Array

diffrax: Any = import_module("diffrax")
jax: Any = import_module("jax")
jnp: Any = import_module("jax.numpy")
jax.config.update("jax_enable_x64", True)


class Smooth(NamedTuple):
    """A field in which tanh(u/width) stands for the sign of the speed of slip.

    Attributes
    ----------
    system : {"oscillator", "belt"}
    width : float
    """

    system: str
    width: float

    def field(self, p: Mapping[str, Any], xp: Any) -> Callable[[Any, Any], Any]:
        """Rates (t, y), with the functions of NumPy or of JAX."""
        if self.system == "oscillator":
            return lambda t, y: xp.stack(
                [
                    y[1],
                    (
                        p["P"] * xp.cos(p["omega"] * t)
                        - p["k"] * y[0]
                        - p["F_c"] * xp.tanh(y[1] / self.width)
                    )
                    / p["m"],
                ]
            )

        def belt(t: Any, y: Any) -> Any:
            u = y[1] - p["V"]
            friction = p["F_c"] + (p["F_s"] - p["F_c"]) * xp.exp(-xp.abs(u) / p["v_s"])
            force = -friction * xp.tanh(u / self.width) - p["c"] * y[1] - p["k"] * y[0]
            return xp.stack([y[1], force / p["m"]])

        return belt


class Motion(NamedTuple):
    """Positions at the times of a record, and their derivatives by the unknowns."""

    values: Callable[[Array], Array]
    slopes: Callable[[Array], Array]


def regularised_motion(
    smooth: Smooth,
    parameters: Mapping[str, float],
    names: list[str],
    times: Array,
    tolerance: float = 1e-5,
) -> Motion:
    """A motion from rest, implicit because the regularised sign is stiff."""
    when = jnp.asarray(times)

    def positions(p: Any) -> Any:
        values = {**parameters, **dict(zip(names, p, strict=True))}
        found = diffrax.diffeqsolve(
            diffrax.ODETerm(lambda t, y, args: smooth.field(args, jnp)(t, y)),
            diffrax.Kvaerno5(),
            float(times[0]),
            float(times[-1]),
            1e-3,
            jnp.zeros(2),
            values,
            saveat=diffrax.SaveAt(ts=when),
            stepsize_controller=diffrax.PIDController(rtol=tolerance, atol=1e-2 * tolerance),
            adjoint=diffrax.ForwardMode(),
            max_steps=200_000,
        )
        return found.ys[:, 0]

    run, slopes = jax.jit(positions), jax.jit(jax.jacfwd(positions))
    return Motion(
        lambda p: np.asarray(run(jnp.asarray(p))), lambda p: np.asarray(slopes(jnp.asarray(p)))
    )

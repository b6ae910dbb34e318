"""The scaled slider (3.6) by diffrax: many motions at once, `vmap` over points on one core, in
double precision.

A motion is a `lax.while_loop` over its modes: each is solved by an eighth-order method up to the
event β = 0, whose root is found on the dense output, and the next one starts there. diffrax is told
which boundary ends which mode. Steps across the kink of (3.6) without events, the other way to do
it, took one and a half times as long.
"""

from __future__ import annotations

import os
from collections.abc import Callable

import numpy as np

os.environ.setdefault(
    "XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"
)

import diffrax  # type: ignore[import]
import jax
import jax.numpy as jnp
import optimistix  # type: ignore[import]

from stickslip.arrays import Array

jax.config.update("jax_enable_x64", True)
MOST_STEPS = 4096  # of a mode


def follower(span: float, tolerance: float) -> Callable[[Array, Array], tuple[Array, Array]]:
    """Follow the motions from (0, 0.4) with μ₀ = v̂ = 1.

    Returns
    -------
    callable
        (b, ν), both of shape (points,), -> end states, shape (points, 2), and numbers of switches.
    """
    term = diffrax.ODETerm(_rates)
    crossing = diffrax.Event(_height, optimistix.Newton(1e-12, 1e-12), direction=False)
    controller = diffrax.PIDController(rtol=tolerance, atol=tolerance)

    def motion(b: jax.Array, nu: jax.Array) -> tuple[jax.Array, jax.Array]:
        def go_on(state: tuple[jax.Array, ...]) -> jax.Array:
            return state[0] < span

        def mode(state: tuple[jax.Array, ...]) -> tuple[jax.Array, ...]:
            t, y, side, switches = state
            found = diffrax.diffeqsolve(
                term,
                diffrax.Dopri8(),
                t,
                span,
                0.1 * jnp.sqrt(nu),
                y,
                (b, nu, side),
                stepsize_controller=controller,
                event=crossing,
                adjoint=diffrax.ForwardMode(),
                max_steps=MOST_STEPS,
            )
            assert found.ts is not None and found.ys is not None
            crossed = found.event_mask
            end = jnp.where(crossed, found.ts[-1], span)
            last = found.ys[-1]
            last = jnp.where(crossed, last.at[0].set(0.0), last)
            return end, last, jnp.where(crossed, -side, side), switches + crossed

        start = (jnp.array(0.0), jnp.array([0.0, 0.4]), jnp.array(1.0), jnp.array(0))
        _, last, _, switches = jax.lax.while_loop(go_on, mode, start)
        return last, switches

    many = jax.jit(jax.vmap(motion))

    def run(b: Array, nu: Array) -> tuple[Array, Array]:
        last, switches = many(b, nu)
        return np.asarray(last), np.asarray(switches)

    return run


def _rates(t: jax.Array, y: jax.Array, p: tuple[jax.Array, ...]) -> jax.Array:
    """(3.6), with side = 1 in slip and −1 in stick."""
    b, nu, side = p
    slip = jnp.where(side > 0.0, y[0], 0.0)
    drive = (1.0 - b * jnp.sqrt(nu)) / nu
    return jnp.stack([drive + b / jnp.sqrt(nu) * slip - y[1] / nu, slip - y[1]])


def _height(t: jax.Array, y: jax.Array, args: tuple[jax.Array, ...], **_: object) -> jax.Array:
    return args[2] * args[1] * y[0]  # in units in which its slope is about 1

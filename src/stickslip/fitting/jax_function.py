"""Residuals of a fit as a JAX function, with exact derivatives."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.errors import StickslipError

if TYPE_CHECKING:
    from stickslip.fitting.problem import FitProblem


def as_jax(problem: FitProblem) -> Callable[[Any], Any]:
    """The residuals of a problem as a function of JAX, differentiable once, forward and backward.

    Motions are computed on the host, sequentially under ``vmap``. Numbers have double precision if
    it is enabled in JAX (``jax.config.update("jax_enable_x64", True)``).

    Raises
    ------
    StickslipError
        If JAX is not installed.
    """
    try:
        jax: Any = import_module("jax")
    except ImportError:
        raise StickslipError("JAX is not installed: pip install 'stickslip[jax]'") from None
    jnp = jax.numpy
    count, unknowns = len(problem.data), len(problem.unknowns)

    def called(function: Callable[[Any], Any], shape: tuple[int, ...], p: Any) -> Any:
        kind = jnp.result_type(float)
        return jax.pure_callback(
            lambda q: np.asarray(function(np.asarray(q, float)), dtype=kind),
            jax.ShapeDtypeStruct(shape, kind),
            p,
            vmap_method="sequential",
        )

    @jax.custom_jvp
    def residuals(p: Any) -> Any:
        problem.check_shape(jnp.shape(p))
        return called(problem.residuals, (count,), p)

    @jax.custom_jvp
    def jacobian(p: Any) -> Any:
        return called(problem.jacobian, (count, unknowns), p)

    @residuals.defjvp
    def _(primals: tuple[Any], tangents: tuple[Any]) -> tuple[Any, Any]:
        return residuals(*primals), jacobian(*primals) @ tangents[0]

    @jacobian.defjvp
    def _(primals: tuple[Any], tangents: tuple[Any]) -> tuple[Any, Any]:
        raise StickslipError(
            "residuals of motions have first derivatives only. For least squares use JᵀJ "
            "instead of the Hessian"
        )

    return residuals

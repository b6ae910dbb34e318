"""Signatures of the compiled functions of a system, as the engine calls them.

:mod:`stickslip.equations.codegen.generate` describes what they compute, and
:class:`stickslip.motion.steps.arrays.Space` the arrays.
"""

# No `from __future__ import annotations`: the translator reads annotations as types, not as text.

from functools import cache
from typing import Any

from stickslip.arrays import IntVector, Matrix, Vector
from stickslip.translator import FunctionAddress


class SystemFunction(FunctionAddress):
    """A compiled function of a system: its address.

    Attributes
    ----------
    code : Code
        The machine code that contains the function; it stays in memory as long as the function is
        referenced.
    """

    code: Any

    def __call__(self, *arguments: Any) -> Any:
        """Call the function from Python, as the engine does if it is not compiled.

        Raises
        ------
        TypeError
            If an argument has the wrong type.
        """
        return _caller(type(self))(self, *arguments)


@cache
def _caller(kind: type[SystemFunction]) -> Any:
    """Function that calls functions with the signature of `kind` by their address."""
    from stickslip.machine_code.objects import addresses
    from stickslip.machine_code.words import Prepared
    from stickslip.translator.modules import caller_of
    from stickslip.translator.values import function_type

    function = function_type(kind)
    names, types = zip(*function.arguments, strict=True)
    (address,) = addresses(caller_of(function), [f"call_{function}"])
    given = (("address", *names), (function, *types))
    return Prepared(str(function), *given, function.result, address)


class Setup(SystemFunction):
    """Constants and matrices for a set of parameters."""

    @staticmethod
    def signature(p: Vector, K: Vector, M: Matrix, C: Matrix, J: Matrix, omega: Vector) -> None:
        """Write all arrays except `p`, the parameters."""


class Jets(SystemFunction):
    """Taylor coefficients of all rows of the tape."""

    @staticmethod
    def signature(
        t: float,
        y: Vector,
        mode: IntVector,
        reg: IntVector,
        K: Vector,
        Rq: Matrix,
        Rz: Matrix,
        N: int,
        W: Matrix,
        A: Matrix,
        B: Matrix,
        mag: Vector,
    ) -> int:
        """Write coefficients up to order `N` to `W`, and sizes of their terms to `mag`. Return 0,
        or 1 if the rates are not determined."""
        ...


class Residuals(SystemFunction):
    """Residual of the rate-independent coordinates."""

    @staticmethod
    def signature(
        t: float, y: Vector, mode: IntVector, reg: IntVector, K: Vector, G: Vector, P: Matrix
    ) -> None:
        """Write to `G` and `P`."""


class Powers(SystemFunction):
    """Energy, dissipated power and supplied power."""

    @staticmethod
    def signature(W: Matrix, reg: IntVector, K: Vector, out: Vector) -> None:
        """Write to `out`."""


class Landings(Powers):
    """New values of the state in declared jumps."""


class Supports(SystemFunction):
    """Support functions of the forces of contacts whose dissipation is a formula."""

    @staticmethod
    def signature(w: Vector, K: Vector, out: Vector) -> None:
        """Write the values at the vector `w` to `out`."""


INTERFACE: dict[str, type[SystemFunction]] = {
    "setup": Setup,
    "jets": Jets,
    "residual": Residuals,
    "powers": Powers,
    "landings": Landings,
    "supports": Supports,
}
"""Functions of a system by their names in its machine code."""

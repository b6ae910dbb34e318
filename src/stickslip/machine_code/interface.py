"""The functions of a system, as the engine calls them."""

# Annotations are objects, not text: nothing is evaluated to read a signature.

from functools import cache
from typing import Any

from stickslip.arrays import IntVector, Matrix, Vector
from stickslip.translator import FunctionAddress


class SystemFunction(FunctionAddress):
    """A compiled function of a system; it keeps its machine code in memory.

    Attributes
    ----------
    code : Code
        To which it belongs.
    """

    code: Any

    def __call__(self, *arguments: Any) -> Any:
        """Call it from Python, as compiled functions do that run as Python.

        Raises
        ------
        TypeError
            If an argument is of another type.
        """
        return _caller(type(self))(self, *arguments)


@cache
def _caller(kind: type[SystemFunction]) -> Any:
    """Caller of functions of a kind by their address."""
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
        """Write to all but `p`."""


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
        """A status; 0 where there are coefficients."""
        ...


class Residuals(SystemFunction):
    """Residual of the rate-independent coordinates."""

    @staticmethod
    def signature(
        t: float, y: Vector, mode: IntVector, reg: IntVector, K: Vector, G: Vector, P: Matrix
    ) -> None:
        """Write to `G` and `P`."""


class Powers(SystemFunction):
    """Energy, dissipated and supplied power."""

    @staticmethod
    def signature(W: Matrix, reg: IntVector, K: Vector, out: Vector) -> None:
        """Write to `out`."""


class Landings(Powers):
    """New values of the state in jumps."""


class Supports(SystemFunction):
    """Support functions of the forces of contacts that have a formula."""

    @staticmethod
    def signature(w: Vector, K: Vector, out: Vector) -> None:
        """Write to `out`."""


INTERFACE: dict[str, type[SystemFunction]] = {
    "setup": Setup,
    "jets": Jets,
    "residual": Residuals,
    "powers": Powers,
    "landings": Landings,
    "supports": Supports,
}
"""By name in the machine code of a system."""

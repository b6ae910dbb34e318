"""Mean speeds of faces that slide and spin: a disc and a ring under an even pressure.

A face of radius 1 that slides with (u, v) and spins with w dissipates its friction times the mean
of |(u, v) + w e_z × r| over its points. With complete elliptic integrals of parameter m, the square
of the ratio of |(u, v)| and |w| or its inverse, whichever is at most 1,

    ring   (2/π) (2 E − (1 − m) K) max(|(u, v)|, |w|)
    disc   |w| (4 (4 − 2m) E + 4 (m − 1) K + 12 m (E + K − D))/(9π),   |(u, v)| ≤ |w|
           |(u, v)| (4 (4 E − 5 K + 3m K + 2 D) + 12 (E + K − D))/(9π),   else

where D = (K − E)/m (Z. Farkas, G. Bartels, T. Unger & D. E. Wolf, Phys. Rev. Lett. 90, 248302,
2003, in other words). They have a logarithm where some point of the rim is at rest, x = 1 − m = 0:

    P(x) + xᵖ log x Q(x),   p = 2 (ring), 3 (disc)

with polynomials, as K and E have in the tables of W. J. Cody (Math. Comp. 19, 105, 1965). They were
fitted with 60 digits to values and slopes at 25 Chebyshev points, and are exact to 1e-16, their
first derivatives to 4e-16. In the variable x their coefficients are small, which keeps enclosures
narrow.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from stickslip.symbolic.formulas import Definition

# Added to x in the logarithm, so that a motion passes through x = 0 in steps. Its effect is
# subtracted to first order: the rest is below 1e-16, except in the derivatives of a ring, which
# change by 4e-10 while x is about 1e-8.
_PASSING = 1e-8
# Coefficients of P and Q: of a disc that spins faster than it slides, of one that slides faster,
# and of a ring.
_DISC_SPINS = (
    1.1317684842090334,
    -0.4244131815783876,
    -0.0530516476972876,
    -0.0008056503751249655,
    0.001524278099921106,
    0.0014899577114719528,
    0.0012466098777401224,
    0.0011860672683881974,
    0.0017095403825211973,
    0.0025886664499812887,
    0.0023275228861032,
    0.0009506645953859946,
    0.0001406837128440029,
    4.6711240762397185e-06,
)
_DISC_SPINS_LOG = (
    -0.013262911916631738,
    -0.01243397745366871,
    -0.01087952665537274,
    -0.009513389812526394,
    -0.008327703357452724,
    -0.006941374541226224,
    -0.004767490681835661,
    -0.0021660119739726597,
    -0.0005114670272767552,
    -4.6638955840144566e-05,
    -9.003154591584591e-07,
)
_DISC_SLIDES = (
    1.1317684842090334,
    -0.14147106052612915,
    0.01768388256570622,
    0.00964759142338943,
    0.005748808252243312,
    0.0037739851897084548,
    0.0025564594865356673,
    0.0008671340150980438,
    -0.003715949488230743,
    -0.010406384569966015,
    -0.010967044429792216,
    -0.004741526522114855,
    -0.0007201290618569203,
    -2.4250543624724395e-05,
)
_DISC_SLIDES_LOG = (
    0.01326291188172715,
    0.020723286134250236,
    0.025384894769324623,
    0.028523532007897826,
    0.030361509027054333,
    0.02926800603908898,
    0.02209770779327527,
    0.01060623803732234,
    0.0025831540805167207,
    0.00023984411069588702,
    4.6821471093090765e-06,
)
_RING = (
    1.2732395447351628,
    -0.3183098861837903,
    0.010845960648210059,
    0.008134472384532958,
    0.005189573042145811,
    0.0035202399498490133,
    0.0026329249232755823,
    0.0026711031928678694,
    0.003916255991754768,
    0.004613562916287747,
    0.0028038969610210494,
    0.0006928034323223486,
    4.9333593004226924e-05,
    2.144133561694917e-07,
)
_RING_LOG = (
    -0.039788735772389325,
    -0.029841551486825563,
    -0.023313665533738797,
    -0.0190373076074237,
    -0.016020244099671278,
    -0.013468938798373567,
    -0.010247284583588446,
    -0.005806394927460523,
    -0.0019256485772120547,
    -0.00028511316326677974,
    -1.2043559900684977e-05,
)


@cache
def mean_speeds() -> dict[str, Definition]:
    """The functions ``disc(u, v, w)`` and ``ring(u, v, w)`` of the formula language, with the
    functions from which they are composed."""
    from stickslip.symbolic.formulas import Definition

    def either(above: str, below: str) -> str:
        return f"piecewise(u**2 + v**2 <= w**2, {above}, {below})"

    # Written as 1 − m, x has a narrow enclosure if m is small.
    lesser, larger = either("u**2 + v**2", "w**2"), either("w**2", "u**2 + v**2")
    found = {"_rim": Definition("disc", ("u", "v", "w"), f"1 - {lesser}/{larger}")}
    for part, P, Q, p in (
        ("_disc_spins", _DISC_SPINS, _DISC_SPINS_LOG, 3),
        ("_disc_slides", _DISC_SLIDES, _DISC_SLIDES_LOG, 3),
        ("_ring", _RING, _RING_LOG, 2),
    ):
        logarithm = f"(x**{p}*log(x + {_PASSING}) - {_PASSING}*x**{p - 1})"
        text = f"({_polynomial(P)} + {logarithm}*({_polynomial(Q)}))/sqrt(2 - x)"
        found[part] = Definition(part[1:5], ("x",), text)
    x = "_rim(u, v, w)"
    # the larger of |(u, v)| and |w| is the length of (u, v, w) over √(2 − x)
    length = "sqrt(u**2 + v**2 + w**2)"
    disc = f"{length}*{either(f'_disc_spins({x})', f'_disc_slides({x})')}"
    found["disc"] = Definition("disc", ("u", "v", "w"), disc)
    found["ring"] = Definition("ring", ("u", "v", "w"), f"{length}*_ring({x})")
    return found


@cache
def norms_instead() -> dict[str, Definition]:
    """Replace these functions by norms, one for each call, so that the convexity of a formula with
    them can be proved by its form."""
    from stickslip.symbolic.formulas import Definition

    given = {"disc": (1.0457, 0.6181), "ring": (1.1283, 1.2746)}
    return {
        name: Definition(name, ("u", "v", "w"), f"sqrt({a}*(u**2 + v**2) + {b}*w**2)")
        for name, (a, b) in given.items()
    }


def _polynomial(coefficients: tuple[float, ...]) -> str:
    """A polynomial in x by its powers; the derivatives of a nested form would grow with the square
    of its length."""
    return " + ".join(f"({c!r})*x**{k}" for k, c in enumerate(coefficients))

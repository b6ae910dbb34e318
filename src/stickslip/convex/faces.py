"""Mean speeds of faces that slide and spin: a disc and a ring under an even pressure.

A face of radius 1 that slides with (u, v) and spins with w dissipates its friction times the mean
of |(u, v) + w e_z × r| over its points. With complete elliptic integrals of parameter m, the square
of the ratio of |(u, v)| and |w| or its inverse,

    ring   (2/π) (2 E − (1 − m) K) max(|(u, v)|, |w|)
    disc   |w| (4 (4 − 2m) E + 4 (m − 1) K + 12 m (E + K − D))/(9π),   |(u, v)| ≤ |w|
           |(u, v)| (4 (4 E − 5 K + 3m K + 2 D) + 12 (E + K − D))/(9π),   else

where D = (K − E)/m (Z. Farkas, G. Bartels, T. Unger & D. E. Wolf, Phys. Rev. Lett. 90, 248302,
2003, in other words). They are functions of q = (w² − u² − v²)/(w² + u² + v²) and of the length of
(u, v, w) alone, with a logarithm where some point of the rim is at rest, q = 0:

    P(|q|) + q² log|q| Q(|q|)

with polynomials, for each sign of q; they were fitted at 84 Chebyshev points with 60 digits, and
are exact to 1e-16, their first derivatives to 4e-16.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from stickslip.symbolic.formulas import Definition

# Beside q² in the logarithm: so a motion passes through q = 0 in steps. It changes the mean speed
# by less than 5e-19; and its derivatives by 1e-9, but only while |q| is about 1e-9.
_PASSING = 1e-18
# Coefficients of P and Q, for q > 0 (it spins faster than it slides) and q < 0.
_DISC_SPINS = (
    0.8002811699174276,
    -0.20007029247935487,
    0.05001757318037292,
    -0.006544125902172194,
    0.011136620019618166,
    -0.0009184945611533082,
    0.03426443999633527,
    0.39454844882494144,
    2.3702349250852377,
    5.718824625635913,
    2.665279809790514,
    -5.967095761843658,
    -4.434932799745507,
    -0.7445190327390342,
    -0.023840438512814536,
)
_DISC_SPINS_LOG = (
    7.400400261124447e-12,
    -0.07502635047351766,
    0.046894014082460696,
    -0.08182313475153687,
    0.07062621842051797,
    0.07416027468808911,
    1.4049519337878011,
    5.3911756483105515,
    10.634312799729168,
    8.537270843668605,
    2.561446405157638,
    0.24610291516718663,
    0.004524246375026567,
)
_DISC_SLIDES = (
    0.8002811699174276,
    0.2000702924793567,
    0.050017573113652805,
    0.006544177903089432,
    0.01112262378719224,
    0.0017951186007159265,
    0.0022989978182201415,
    -0.031243606557567593,
    -0.17736959160965282,
    -0.40000743289307855,
    -0.14694243119885347,
    0.39723413801671165,
    0.24941729014114863,
    0.03581684299173923,
    0.0009648374898980547,
)
_DISC_SLIDES_LOG = (
    -7.589740119379791e-13,
    0.07502635876554316,
    0.04689123206622484,
    0.08203838253648216,
    0.06075180876740513,
    0.07144680471487289,
    -0.03621354325835202,
    -0.32024382359024745,
    -0.6673374675915152,
    -0.5004617013340191,
    -0.13447920798403543,
    -0.011296059471586661,
    -0.00017732791997051125,
)
_RING = (
    0.9003163161571061,
    -3.2192092404768445e-16,
    0.06521008426986198,
    -8.592706029861199e-09,
    0.013860312473535856,
    -0.00013137089872480216,
    0.0021342776048598865,
    -0.04808046659469699,
    -0.26454309933902354,
    -0.5853554964839679,
    -0.17794697097802417,
    0.6442333836863123,
    0.3928133769663751,
    0.055985296198149404,
    0.0015043655309430967,
)
_RING_LOG = (
    -0.1125395395207837,
    -1.3789756186229993e-09,
    -0.052753274993033256,
    -3.266640510432744e-05,
    -0.035811333685758846,
    -0.019754445229509983,
    -0.18245514692910114,
    -0.6011138138893237,
    -1.0941133836217034,
    -0.7941396889318313,
    -0.21100029776877996,
    -0.017640627396249983,
    -0.0002764571851917147,
)


@cache
def mean_speeds() -> dict[str, Definition]:
    """The functions ``disc(u, v, w)`` and ``ring(u, v, w)`` of the formula language, and what they
    are made of."""
    from stickslip.symbolic.formulas import Definition

    side = "(w**2 - u**2 - v**2)/(w**2 + u**2 + v**2)"
    found = {"_side": Definition("disc", ("u", "v", "w"), side)}
    for name, spins, slides in (
        ("disc", (_DISC_SPINS, _DISC_SPINS_LOG), (_DISC_SLIDES, _DISC_SLIDES_LOG)),
        ("ring", (_RING, _RING_LOG), (_RING, _RING_LOG)),
    ):
        for part, (P, Q) in ((f"_{name}_spins", spins), (f"_{name}_slides", slides)):
            text = f"{_polynomial(P)} + q**2/2*log(q**2 + {_PASSING})*({_polynomial(Q)})"
            found[part] = Definition(name, ("q",), text)
        q = "_side(u, v, w)"
        length = "sqrt(u**2 + v**2 + w**2)"
        pieces = f"piecewise(u**2 + v**2 <= w**2, _{name}_spins({q}), _{name}_slides(-{q}))"
        found[name] = Definition(name, ("u", "v", "w"), f"{length}*{pieces}")
    return found


@cache
def norms_instead() -> dict[str, Definition]:
    """Norms in place of these functions, each of its own, for proofs that a formula made of them is
    convex by its form."""
    from stickslip.symbolic.formulas import Definition

    given = {"disc": (1.0457, 0.6181), "ring": (1.1283, 1.2746)}
    return {
        name: Definition(name, ("u", "v", "w"), f"sqrt({a}*(u**2 + v**2) + {b}*w**2)")
        for name, (a, b) in given.items()
    }


def _polynomial(coefficients: tuple[float, ...]) -> str:
    """A polynomial in q, by its powers: derivatives of what is nested grow with its square."""
    return " + ".join(f"({c!r})*q**{k}" for k, c in enumerate(coefficients))

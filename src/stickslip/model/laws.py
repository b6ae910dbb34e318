"""Named friction laws from the literature, for use in place of a contact.

>>> import stickslip as ss
>>> ss.laws.all_names()[:3]
['bouc_wen', 'coulomb', 'dahl']
>>> foot = ss.laws.stribeck("d_x", F_s=2.0, F_c=1.0, v_s=0.1)

In a model file the same is ``contacts.foot = {law = "stribeck", direction = "d_x", F_s = 2.0, F_c =
1.0, v_s = 0.1}``. ``stickslip law stribeck`` shows the equations of a law and its loops.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from stickslip.errors import DeclarationError, StickslipError, short, suggestion
from stickslip.model.system import Formula, Inertial, Internal, LawContact, Parameter, System

LAWS_GROUP = "stickslip.laws"
"""Entry points by which other packages add laws."""

_SHARES = {
    "F_c": (0.3, 0.4, 0.3),
    "k": (0.6, 0.3, 0.1),
    "F": (1.4, 1.15, 0.9, 1.0, 1.2),
}  # fractions of the sums over the elements, or of the forces at the points, of an example
_SPEEDS = (0.0, 0.1, 0.4, 1.0, 2.0)  # speeds of these points, in units of the largest speed


@dataclass(frozen=True)
class FrictionLaw:
    """A friction law: the declaration of a contact, with parameters.

    Its formulas use ``u``, the relative velocity of the contact, ``speed`` = |u| (in `kinetic`),
    and the names that it declares: parameters, functions and internal variables. In a system each
    of these is followed by the name of the contact, so that ``z`` of a contact named foot is
    ``z_foot``.

    Attributes
    ----------
    name, title, source, about : str
        Its name, one line of description, the literature, and further remarks.
    parameters : mapping of str to Parameter
        Required parameters; their defaults are only used to plot the law.
    options : mapping of str to Parameter
        Optional parameters.
    functions : mapping of str to formula
    internal : mapping of str to Internal
    threshold, kinetic : str
        Those of a dry contact with the velocity u; of the sliders, if there is a `stiffness`.
    stiffness : str
        Stiffness of the springs that connect sliders, as elements in parallel. Its formulas may use
        ``i``, the number of the element, and ``elements``, the number of elements.
    force : str
        A force opposing u that is not dry friction.
    increasing : bool
        Whether that force increases with u, so that it may also act on a coordinate without mass.
    start : mapping of str to str
        Initial values of internal variables, formulas of the parameters of the law; others are 0.
    several : tuple of str
        Parameters that are lists, an entry for each element.
    points : (str, str) or ()
        Parameters that contain speeds and forces of points of the kinetic friction force, which
        `kinetic` uses as ``curve``.
    stroke : (float, float)
        Amplitude and angular frequency of the motion in the plot of the law.
    """

    name: str
    title: str
    source: str
    about: str
    parameters: Mapping[str, Parameter]
    options: Mapping[str, Parameter] = field(default_factory=dict[str, Parameter])
    functions: Mapping[str, str] = field(default_factory=dict[str, str])
    internal: Mapping[str, Internal] = field(default_factory=dict[str, Internal])
    threshold: str = ""
    kinetic: str = ""
    stiffness: str = ""
    force: str = ""
    increasing: bool = False
    start: Mapping[str, str] = field(default_factory=dict[str, str])
    several: tuple[str, ...] = ()
    points: tuple[str, ...] = ()
    stroke: tuple[float, float] = (1.0, 1.0)

    def __call__(
        self,
        direction: str,
        *,
        surface_speed: Formula = 0.0,
        unit: str = "",
        **values: Formula | tuple[Formula, ...],
    ) -> LawContact:
        """A contact with this law.

        Parameters
        ----------
        direction : str
            Linear combination of rates, such as ``"d_x"`` or ``"d_x2 - d_x1"``.
        surface_speed : str or float
            Speed w(t) of the surface: u = direction − w.
        unit : str
            Unit of the friction force.
        **values : float, str or list of these
            The law's parameters: numbers, or formulas of the system's parameters.
        """
        return LawContact(self.name, direction, values, surface_speed, unit)

    def known(self) -> dict[str, Parameter]:
        """All parameters of the law."""
        return {**self.parameters, **self.options}

    @property
    def dry(self) -> bool:
        """Whether the law consists of a threshold and a kinetic friction force, without internal
        variables."""
        return bool(self.threshold) and not self.stiffness

    def specimen(self, values: Mapping[str, float] | None = None) -> System:
        """A mass that slides under this law with the parameters of its example, or others."""
        return self._example(
            values,
            coordinates={"x": Inertial("m", "position of a mass")},
            parameters={"m": Parameter(1.0, "kg", "mass", "(0, inf)")},
            kinetic="m/2*d_x**2",
            contacts={"law": LawContact(self.name, "d_x", self._by_name(), unit="N")},
        )

    def driven(
        self, amplitude: float, omega: float, values: Mapping[str, float] | None = None
    ) -> System:
        """A system of this law alone, whose surface is displaced by A sin ωt against u."""
        return self._alone(
            "-d_X",
            values,
            {"amplitude": Parameter(amplitude, "m"), "omega": Parameter(omega, "1/s")},
            drives={"X": "amplitude*sin(omega*t)"},
        )

    def stepped(self, ratio: float, values: Mapping[str, float] | None = None) -> System:
        """A system of this law alone at the rate v_0, at another rate after a slip of 10 D_c, and
        at v_0 again after another 20 D_c: the velocity-stepping test that identifies rate-and-state
        laws."""
        return self._alone(
            "-v_0*piecewise(t < t_up, 1, t < t_down, ratio, 1)",
            values,
            {"ratio": Parameter(ratio)},
            functions={"t_up": "10*D_c/v_0", "t_down": "t_up + 20*D_c/(ratio*v_0)"},
        )

    def _alone(
        self,
        speed: str,
        values: Mapping[str, float] | None,
        parameters: Mapping[str, Parameter],
        **parts: Any,
    ) -> System:
        contact = LawContact(self.name, "0", self._by_name(), speed, "N")
        return self._example(values, parameters=parameters, contacts={"law": contact}, **parts)

    def _repr_html_(self) -> str:
        from stickslip import page
        from stickslip.display.system_page import law_page

        return law_page(self, page.drawn(self._loops))

    def _loops(self) -> Any:
        from stickslip.figures.law import plot_law

        return plot_law(self)

    def _by_name(self) -> dict[str, Formula | tuple[Formula, ...]]:
        """Parameters by their names; list parameters are divided among the elements."""
        return {
            name: _SPEEDS
            if name in self.points[:1]
            else tuple(f"{share}*{name}" for share in _SHARES[name])
            if name in self.several
            else int(p.default)
            if name == "elements"
            else name
            for name, p in self.known().items()
        }

    def _example(self, values: Mapping[str, float] | None, **parts: Any) -> System:
        plain = {"elements", *self.points[:1]}  # numbers, not parameters
        own = {name: p for name, p in self.known().items() if name not in plain}
        parameters = {**parts.pop("parameters", {}), **own}
        system = System(
            self.name,
            self.title,
            self.source,
            parameters=parameters,
            time_unit="s",
            span=(0.0, 1.0),
            **parts,
        )
        return system.configure(values or {})


_F_C = Parameter(1.0, "N", "kinetic friction force", "(0, inf)")
_F_S = Parameter(1.5, "N", "static friction force", "(0, inf)")
_V_S = Parameter(0.2, "m/s", "speed over which friction decreases", "(0, inf)")
_K = Parameter(4.0, "N/m", "stiffness before slip", "(0, inf)")
_B = Parameter(0.0, "N*s/m", "coefficient of viscous friction", "[0, inf)")

coulomb: FrictionLaw = FrictionLaw(
    "coulomb",
    "Coulomb's friction",
    "Coulomb 1785",
    "The force is F_c against the motion, independent of the speed, and at most F_c at rest.",
    parameters={"F_c": _F_C},
    options={"b": _B},
    threshold="F_c",
    kinetic="F_c + b*speed",
)

static_kinetic: FrictionLaw = FrictionLaw(
    "static_kinetic",
    "Static above kinetic friction",
    "Coulomb 1785; Popov 2010, chapter 12",
    "The force is at most F_s at rest, and F_c in slip.",
    parameters={"F_s": _F_S, "F_c": _F_C},
    options={"b": _B},
    threshold="F_s",
    kinetic="F_c + b*speed",
)

stribeck: FrictionLaw = FrictionLaw(
    "stribeck",
    "Stribeck's curve, exponential",
    "Tustin 1947; Bo and Pavelescu 1982",
    "Friction falls from F_s to F_c as the speed exceeds v_s: exp(−|u|/v_s).",
    parameters={"F_s": _F_S, "F_c": _F_C, "v_s": _V_S},
    options={"b": _B},
    threshold="F_s",
    kinetic="F_c + (F_s - F_c)*exp(-speed/v_s) + b*speed",
)

stribeck_gaussian: FrictionLaw = FrictionLaw(
    "stribeck_gaussian",
    "Stribeck's curve, Gaussian",
    "Armstrong-Hélouvry 1991",
    "Friction falls from F_s to F_c as the speed exceeds v_s: exp(−(u/v_s)²).",
    parameters={"F_s": _F_S, "F_c": _F_C, "v_s": _V_S},
    options={"b": _B},
    threshold="F_s",
    kinetic="F_c + (F_s - F_c)*exp(-(speed/v_s)**2) + b*speed",
)

stribeck_lorentzian: FrictionLaw = FrictionLaw(
    "stribeck_lorentzian",
    "Stribeck's curve, Lorentzian",
    "Hess and Soom 1990",
    "Friction falls from F_s to F_c as the speed exceeds v_s: 1/(1 + (u/v_s)²).",
    parameters={"F_s": _F_S, "F_c": _F_C, "v_s": _V_S},
    options={"b": _B},
    threshold="F_s",
    kinetic="F_c + (F_s - F_c)/(1 + (speed/v_s)**2) + b*speed",
)

dahl: FrictionLaw = FrictionLaw(
    "dahl",
    "Dahl's solid friction",
    "Dahl 1968, exponent 1",
    "The force depends on the displacement x only: dF/dx = k (1 − sgn(u) F/F_c). At rest it is "
    "constant.",
    parameters={"F_c": _F_C, "k": _K},
    internal={"z": Internal("u - abs(u)*k*z/F_c", meaning="deflection")},
    force="k*z",
)

bouc_wen: FrictionLaw = FrictionLaw(
    "bouc_wen",
    "Bouc's and Wen's hysteresis",
    "Bouc 1967; Wen 1976; Ikhouane and Rodellar 2005, normalised form",
    "With w = F/F_c: dw/dx = (k/F_c)(1 − (σ sgn(uw) − σ + 1)|w|ⁿ). A large n gives a sharp "
    "knee; n = σ = 1 is Dahl's law. In Wen's notation A = 1, β + γ = (k/F_c)ⁿ, β = σ(β + γ).",
    parameters={"F_c": _F_C, "k": _K},
    options={
        "n": Parameter(2.0, "", "sharpness of the knee", "[1, inf)"),
        "sigma": Parameter(
            0.5, "", "β as a fraction of β + γ; smaller values would create energy", "[0.5, inf)"
        ),
    },
    functions={"w": "k*z/F_c"},
    internal={
        "z": Internal("u - (sigma*abs(u)*sign(w) - (sigma - 1)*u)*abs(w)**n", meaning="deflection")
    },
    force="k*z",
)

lugre: FrictionLaw = FrictionLaw(
    "lugre",
    "LuGre: bristles on Stribeck's curve",
    "Canudas de Wit, Olsson, Åström and Lischinsky 1995",
    "Bristles of stiffness sigma_0 deflect by z; in steady sliding the force is g(u) + sigma_2 "
    "u, where g is Stribeck's curve.",
    parameters={
        "F_s": _F_S,
        "F_c": _F_C,
        "v_s": Parameter(1e-3, "m/s", "speed over which friction decreases", "(0, inf)"),
        "sigma_0": Parameter(1e5, "N/m", "stiffness of the bristles", "(0, inf)"),
        "sigma_1": Parameter(316.2277660168379, "N*s/m", "damping of the bristles", "[0, inf)"),
    },
    options={"sigma_2": Parameter(0.0, "N*s/m", "viscous friction", "[0, inf)")},
    functions={
        "g": "F_c + (F_s - F_c)*exp(-(u/v_s)**2)",
        "bending": "u - sigma_0*abs(u)*z/g",
    },
    internal={"z": Internal("bending", meaning="deflection of the bristles")},
    force="sigma_0*z + sigma_1*bending + sigma_2*u",
    stroke=(1e-4, 30.0),
)

elasto_plastic: FrictionLaw = FrictionLaw(
    "elasto_plastic",
    "Elasto-plastic bristles without drift",
    "Dupont, Hayward, Armstrong and Altpeter 2002",
    "Like the Dahl and LuGre laws, but the bristles are purely elastic below a fraction of F_c, "
    "so that a body does not creep under small loads; at F_c they slide.",
    parameters={
        "F_c": _F_C,
        "sigma_0": Parameter(4.0, "N/m", "stiffness of the bristles", "(0, inf)"),
    },
    options={
        "sigma_1": Parameter(0.0, "N*s/m", "damping of the bristles", "[0, inf)"),
        "sigma_2": Parameter(0.0, "N*s/m", "viscous friction", "[0, inf)"),
        "elastic": Parameter(
            0.7, "", "fraction of F_c below which bristles do not slide", "(0, 1)"
        ),
    },
    functions={
        "share(s)": "piecewise(s < elastic, 0, s < 1, "
        "1/2 + sin(pi*(s - (1 + elastic)/2)/(1 - elastic))/2, 1)",
        "w": "sigma_0*z/F_c",
        "bending": "piecewise(u > 0, u*(1 - share(w)*w), u*(1 + share(-w)*w))",
    },
    internal={"z": Internal("bending", meaning="deflection of the bristles")},
    force="sigma_0*z + sigma_1*bending + sigma_2*u",
)

jenkins: FrictionLaw = FrictionLaw(
    "jenkins",
    "Jenkins element: a slider behind a spring",
    "Jenkins 1962",
    "Elastic with stiffness k up to the force F_c, then constant. It tends to Coulomb friction "
    "as k increases.",
    parameters={"F_c": _F_C, "k": _K},
    stiffness="k",
    threshold="F_c",
)

maxwell_slip: FrictionLaw = FrictionLaw(
    "maxwell_slip",
    "Maxwell slip: several sliders in parallel",
    "Iwan 1966; Lampaert, Swevers and Al-Bender 2002",
    "Jenkins elements in parallel; k and F_c are lists of their stiffnesses and forces.",
    parameters={"F_c": _F_C, "k": _K},
    stiffness="k",
    threshold="F_c",
    several=("F_c", "k"),
)

iwan: FrictionLaw = FrictionLaw(
    "iwan",
    "Iwan's sliders with distributed strength",
    "Iwan 1966; Segalman 2005 for the power law",
    "Jenkins elements of equal stiffness k/elements that begin to slide at displacements "
    "between 0 and phi = F_c/k (2 + chi)/(1 + chi), with a density proportional to the power "
    "chi of the displacement. With many elements the force of the first loading is k x (1 − "
    "(x/phi)^(1 + chi)/(2 + chi)); the total strength of all elements is F_c.",
    parameters={"F_c": _F_C, "k": _K},
    options={
        "chi": Parameter(0.0, "", "exponent of the distribution; 0 is uniform", "(-1, inf)"),
        "elements": Parameter(10, "", "number of sliders", "[1, 1000]"),
    },
    functions={"phi": "F_c/k*(2 + chi)/(1 + chi)"},
    stiffness="k/elements",
    threshold="k/elements*phi*((i - 1/2)/elements)**(1/(1 + chi))",
)

table: FrictionLaw = FrictionLaw(
    "table",
    "Kinetic friction force given at points",
    "measured points",
    "Between the points (v, F) the force is interpolated by a table of the given kind (linear, "
    "pchip, cubic). Below the lowest speed it is constant; above the highest speed it is "
    "undefined, unless 'outside' extrapolates. Negative speeds, with negative forces, are those of "
    "backward slip. At rest the force is at most N F_s; a list gives different values forward and "
    "backward.",
    parameters={
        "F_s": _F_S,
        "v": Parameter(1.0, "m/s", "speeds of the points, a list"),
        "F": Parameter(1.0, "N", "forces there, a list"),
    },
    options={"N": Parameter(1.0, "", "factor of all forces, such as a normal force", "[0, inf)")},
    threshold="N*F_s",
    kinetic="N*curve(speed)",
    several=("v", "F"),
    points=("v", "F"),
)


_RATE_AND_STATE = {
    "a": Parameter(0.010, "", "direct effect", "(0, inf)"),
    "b": Parameter(0.015, "", "evolution effect", "[0, inf)"),
    "D_c": Parameter(1e-5, "m", "slip distance over which the state evolves", "(0, inf)"),
    "N": Parameter(1.0, "N", "normal force", "[0, inf)"),
}
_REFERENCE = {
    "mu_0": Parameter(0.6, "", "friction at the rate v_0", "(0, inf)"),
    "v_0": Parameter(1e-6, "m/s", "reference rate", "(0, inf)"),
    "eta": Parameter(0.0, "N*s/m", "radiation damping", "[0, inf)"),
}
_REGULAR = "N*a*asinh(u/(2*v_0)*exp((mu_0 + b*log({state}))/a)) + eta*u"
_STEADY = {"theta": "D_c/v_0"}

rate_and_state: FrictionLaw = FrictionLaw(
    "rate_and_state",
    "Rate-and-state friction, ageing law",
    "Dieterich 1979; Ruina 1983; Rice, Lapusta and Ranjith 2001 for the form with asinh",
    "Friction increases at once with the logarithm of the rate, and then decreases over the "
    "slip D_c as the state theta evolves; in steady sliding the net decrease is (b − a) "
    "ln(u/v_0). The initial state is that of steady sliding at v_0. The law can act on a "
    "coordinate without mass.",
    parameters=_RATE_AND_STATE,
    options=_REFERENCE,
    internal={"theta": Internal("1 - abs(u)*theta/D_c", "s", "state")},
    force=_REGULAR.format(state="v_0*theta/D_c"),
    increasing=True,
    start=_STEADY,
)

rate_and_state_slip: FrictionLaw = FrictionLaw(
    "rate_and_state_slip",
    "Rate-and-state friction, slip law",
    "Ruina 1983; Rice, Lapusta and Ranjith 2001 for the form with asinh",
    "Like the ageing law, but the state evolves with slip only: theta' = −Ω ln Ω, Ω = uθ/D_c. At "
    "zero rate the slope is infinite, and the motion ends there.",
    parameters=_RATE_AND_STATE,
    options=_REFERENCE,
    functions={"Omega": "abs(u)*theta/D_c"},
    internal={"theta": Internal("-Omega*log(Omega)", "s", "state")},
    force=_REGULAR.format(state="v_0*theta/D_c"),
    increasing=True,
    start=_STEADY,
)

rate_and_state_cutoff: FrictionLaw = FrictionLaw(
    "rate_and_state_cutoff",
    "Rate-and-state friction with a cut-off at high rates",
    "Okubo 1989; Weeks 1993",
    "The ageing law with a cut-off: ln(v_0θ/D_c) becomes ln(v_0/v_c + v_0θ/D_c), so that in "
    "steady sliding faster than v_c friction increases again.",
    parameters={
        **_RATE_AND_STATE,
        "v_c": Parameter(1e-5, "m/s", "cut-off rate", "(0, inf)"),
    },
    options=_REFERENCE,
    internal={"theta": Internal("1 - abs(u)*theta/D_c", "s", "state")},
    force=_REGULAR.format(state="v_0/v_c + v_0*theta/D_c"),
    increasing=True,
    start=_STEADY,
)


def all_names() -> list[str]:
    """Names of all laws, including those added by other packages."""
    return sorted({*_own(), *(entry.name for entry in entry_points(group=LAWS_GROUP))})


def by_name(name: str, where: str = "laws") -> FrictionLaw:
    """Return a law by name; `where` names the input in error messages.

    Other packages may add laws by entry points of the group ``stickslip.laws``; built-in names take
    precedence.

    Raises
    ------
    DeclarationError
        If there is no such law.
    StickslipError
        If a law of another package cannot be loaded, or is not a law of that name.
    """
    own = _own()
    if name in own:
        return own[name]
    added = [*entry_points(group=LAWS_GROUP, name=name)]
    if not added:
        raise DeclarationError(
            where,
            f"unknown law '{short(name)}'",
            suggestion(name.replace("-", "_").lower(), all_names()),
        )
    return _loaded(added[0])


def _own() -> dict[str, FrictionLaw]:
    return {name: law for name, law in globals().items() if isinstance(law, FrictionLaw)}


def _loaded(entry: EntryPoint) -> FrictionLaw:
    """The law that another package adds."""
    try:
        law = entry.load()
    except Exception as error:
        reason = f"{entry.value} cannot be loaded ({type(error).__name__}: {short(str(error))})"
        raise StickslipError(f"law {entry.name}: {reason}") from None
    if not isinstance(law, FrictionLaw) or law.name != entry.name:
        raise StickslipError(
            f"law {entry.name}: {entry.value} is not a FrictionLaw of that name. Use the same "
            "name for both"
        )
    return law

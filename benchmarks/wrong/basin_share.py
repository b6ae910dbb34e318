"""How much of a region of initial states slides steadily in the end.

The friction oscillator of M. Stender and N. Hoffmann (bSTAB, Nonlinear Dynamics 2021; its case
``case_friction``), also in pyBasin: ẍ + 2ξẋ + x = friction of a belt, from 5000 random states each.
In bSTAB what is slower than 1e-4 relative to the belt sticks; pyBasin takes tanh(200 v) for the
sign. pyBasin's repository has the shares of three samples (commit 925877c and before): 0.304 and
0.312, in which both tools classify every state alike, and 0.3165 of 4000.

But there are two attractors, and one unstable cycle between them: the share is the area inside it.
It stays 0.25 away from the speed of the belt, so that neither band nor tanh matters: only the
sampling does. ``python benchmarks/wrong/basin_share.py``
"""

from __future__ import annotations

from importlib import import_module
from itertools import pairwise
from time import perf_counter
from typing import Any

import numpy as np
from table import table, versions

import stickslip as ss

BELT = ss.System(
    name="friction oscillator of bSTAB",
    parameters={
        "V": ss.Parameter(1.5, "", "speed of the belt"),
        "xi": ss.Parameter(0.05, "", "damping"),
        "mu_d": ss.Parameter(0.5, "", "friction at high speed"),
        "ratio": ss.Parameter(2.0, "", "friction at rest over that"),
        "v_0": ss.Parameter(0.5, "", "speed over which it decreases"),
    },
    coordinates={"x": ss.Inertial()},
    kinetic="d_x**2/2",
    potential="x**2/2",
    viscous="xi*d_x**2",
    contacts={
        "belt": ss.Contact(
            "d_x", "mu_d*ratio", "V", kinetic="mu_d + mu_d*(ratio - 1)*exp(-speed/v_0)"
        )
    },
)
REGION = 4.0 * 2.0  # [-2, 2] × [0, 2]


def branches() -> tuple[ss.Branch, ss.Branch]:
    """Steady sliding over the speed of the belt, and the cycles from its Hopf point on."""
    steady = ss.continue_equilibrium(BELT, "V", (1.0, 3.0))
    return steady, ss.continue_cycle(
        ss.find_cycle(BELT, steady.of_kind("Hopf")[0]), "V", (0.8, 3.0)
    )


def unstable_cycle(branch: ss.Branch, V: float) -> ss.Cycle:
    """The cycle that repels, from the point of the branch before the fold that is nearest."""
    points = branch.points
    before = int(np.argmax(points["V"].values))
    nearest = int(np.argmin(np.abs(points["V"].values[:before] - V)))
    state = {name: float(points[name][nearest]) for name in ("x",)}
    near = ss.find_cycle(
        BELT,
        {**state, "d_x": float(points["d_x"][nearest])},
        parameters={"V": float(points["V"][nearest])},
    )
    return ss.find_cycle(BELT, near, parameters={"V": V})


def area_above(cycle: ss.Cycle) -> float:
    """Area inside a cycle in the half plane ẋ > 0: ∫ ẋ dx = ∫ ẋ² dt over the times at which ẋ > 0,
    by Gauss's quadrature between the zeros of ẋ."""
    motion = cycle.trajectory
    t0, t1 = (float(motion.knots.time[i]) for i in (0, -1))
    grid = np.linspace(t0, t1, 4001)
    rate = np.asarray(motion.at(grid)["d_x"])
    cuts = [t0]
    for i in np.flatnonzero(rate[:-1] * rate[1:] < 0):
        low, high = grid[i], grid[i + 1]
        for _ in range(60):
            middle = 0.5 * (low + high)
            if rate[i] * float(motion.at(middle)["d_x"]) > 0:
                low = middle
            else:
                high = middle
        cuts.append(0.5 * (low + high))
    cuts.append(t1)
    nodes, weights = np.polynomial.legendre.leggauss(60)
    area = 0.0
    for a, b in pairwise(cuts):
        t = 0.5 * (a + b) + 0.5 * (b - a) * nodes
        v = np.asarray(motion.at(t)["d_x"])
        if v[len(v) // 2] > 0:
            area += 0.5 * (b - a) * float(weights @ v**2)
    return area


def sampled(n: int = 5000, step: float = 0.01, end: float = 150.0) -> float:
    """The share as pyBasin finds it, from random states and with tanh(200 v) for the sign: the runs
    that are slow in the end slide steadily."""
    p = BELT.values
    random = np.random.default_rng(0)
    state = np.stack([random.uniform(-2.0, 2.0, n), random.uniform(0.0, 2.0, n)])

    def rates(y: np.ndarray) -> np.ndarray:
        v = y[1] - p["V"]
        friction = p["mu_d"] * (1.0 + (p["ratio"] - 1.0) * np.exp(-np.abs(v) / p["v_0"]))
        return np.stack([y[1], -y[0] - 2.0 * p["xi"] * y[1] - np.tanh(200.0 * v) * friction])

    largest = np.zeros(n)
    steps = round(end / step)
    for i in range(steps):
        a = rates(state)
        b = rates(state + 0.5 * step * a)
        c = rates(state + 0.5 * step * b)
        d = rates(state + step * c)
        state = state + step / 6.0 * (a + 2.0 * b + 2.0 * c + d)
        if i > steps - round(7.0 / step):  # the last period
            largest = np.maximum(largest, np.abs(state[1]))
    return float(np.mean(largest < 1.0))


def by_pybasin(n: int = 1000) -> float:
    """The share that pyBasin finds with its default solver, for a model like its case study.

    Raises
    ------
    ImportError
        If it is not there: it needs Python 3.12 and PyTorch.
    """
    torch: Any = import_module("torch")
    basin: Any = import_module("pybasin")
    parts: Any = import_module("pybasin.solvers.torch_ode_system")
    samplers: Any = import_module("pybasin.sampler")
    solvers: Any = import_module("pybasin.solvers")
    features: Any = import_module("pybasin.feature_extractors.feature_extractor")
    templates: Any = import_module("pybasin.template_integrator")
    neighbours: Any = import_module("sklearn.neighbors")
    values = BELT.values

    class Belt(parts.ODESystem):
        def ode(self, t: Any, y: Any, p: Any) -> Any:
            x, speed = y[..., 0], y[..., 1]
            v = speed - values["V"]
            falling = 1.0 + (values["ratio"] - 1.0) * torch.exp(-torch.abs(v) / values["v_0"])
            force = values["mu_d"] * falling * torch.tanh(200.0 * v)
            return torch.stack([speed, -x - 2.0 * values["xi"] * speed - force], dim=-1)

        def get_str(self) -> str:
            return "a block on a belt"

    class Moves(features.FeatureExtractor):
        def extract_features(self, solution: Any) -> Any:
            late = self.filter_time(solution)[..., 1].abs().amax(dim=0)
            return (late > 1.0).to(torch.float64)[:, None]

    torch.manual_seed(0)
    parameters = {"V": values["V"]}
    solver = solvers.TorchDiffEqSolver(
        t_span=(0, 500), t_steps=500, t_eval=(400.0, 500.0), rtol=1e-6, atol=1e-6, cache_dir=None
    )
    estimator = basin.BasinStabilityEstimator(
        n=n,
        ode_system=Belt(parameters),
        sampler=samplers.UniformRandomSampler(min_limits=[-2.0, 0.0], max_limits=[2.0, 2.0]),
        solver=solver,
        feature_extractor=Moves(time_steady=400),
        predictor=neighbours.KNeighborsClassifier(n_neighbors=1),
        template_integrator=templates.TemplateIntegrator(
            template_y0=[[1.0, 1.0], [2.0, 2.0]], labels=["slides", "sticks"], ode_params=parameters
        ),
        feature_selector=None,
    )
    estimator.run()
    return float(estimator.result["basin_stability"]["slides"])


def _with_error(share: float, n: int) -> str:
    return f"{share:.4f} ± {(share * (1.0 - share) / n) ** 0.5:.4f}"


def report() -> str:
    """The table."""
    began = perf_counter()
    _, branch = branches()
    fold = branch.of_kind("fold")[0].value
    cycle = unstable_cycle(branch, 1.5)
    share = area_above(cycle) / REGION
    seconds = perf_counter() - began
    low, high = cycle.extrema["x"]
    assert low > -2.0 and high < 2.0 and cycle.extrema["d_x"][1] < 1.5, "inside, and never at rest"
    rows = [
        ["published: bSTAB and pyBasin, 5000 runs", "0.304 ± 0.0065", ""],
        ["published: bSTAB and pyBasin, another 5000", "0.312 ± 0.0066", ""],
        ["published: pyBasin, 4000 runs", "0.3165 ± 0.0074", ""],
    ]
    began = perf_counter()
    found = sampled()
    spent = perf_counter() - began
    rows.append(["here: 5000 runs with tanh(200 v)", _with_error(found, 5000), f"{spent:.2g}"])
    assert abs(found - share) < 4.0 * (share * (1.0 - share) / 5000) ** 0.5
    try:
        began = perf_counter()
        found = by_pybasin()
    except ImportError as error:
        rows.append([f"pyBasin is not here ({error})", "", ""])
    else:
        spent = perf_counter() - began
        rows.append(["here: pyBasin, 1000 runs", _with_error(found, 1000), f"{spent:.2g}"])
    for n in (40,):
        began = perf_counter()
        basin = ss.basin(
            BELT,
            {"x": f"{2 / n - 2}:{2 - 2 / n}:{n}", "d_x": f"{1 / n}:{2 - 1 / n}:{n}"},
            settings=ss.Settings(rtol=1e-8),
        )
        kinds = dict(
            zip(
                basin.dataset["kind"].values.tolist(),
                basin.dataset["share"].values.tolist(),
                strict=True,
            )
        )
        steady = kinds.get("sliding", 0.0)
        spent = perf_counter() - began
        rows.append([f"stickslip, a map of {n} × {n} states", f"{steady:.4f}", f"{spent:.2g}"])
    rows.append(
        ["**stickslip, area inside the unstable cycle**", f"{share:.10f}", f"{seconds:.2g}"]
    )
    head = ["method", "fraction of steady sliding", "seconds"]
    period = f"The cycle: period {cycle.period:.10f}, multiplier {cycle.nontrivial[0].real:.6f}."
    jump = f"Above V = {fold:.9f}, where the cycles end in a fold, all motions converge to "
    jump += "steady sliding."
    return table(head, rows) + f"\n\n{period} {jump} {versions('pybasin')}\n"


if __name__ == "__main__":
    print(report())

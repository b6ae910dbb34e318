"""The oracles against the printed numbers of their sources, and against each other."""

import itertools
import math

import numpy as np
import pytest
from mpmath import mp

from . import (
    belt_block,
    coulomb_oscillator,
    crawler,
    den_hartog,
    dither,
    prandtl_tomlinson,
    rate_and_state,
    scaled_slider,
)
from .moreau import Array, first_order, moreau, rate_independent


@pytest.mark.parametrize(
    ("r", "beta", "X"), [(0.8, 0.3, 2.626105), (1.2, 0.3, 2.072384), (2, 0.4, 0.266667)]
)
def test_den_hartog_amplitude(r: float, beta: float, X: float) -> None:
    assert den_hartog.amplitude(r, beta) == pytest.approx(X, abs=5e-7)
    x, v = den_hartog.state(den_hartog.phase(r, beta), r, beta)
    assert x == pytest.approx(X, abs=5e-7)
    assert v == pytest.approx(0, abs=1e-14)


def test_den_hartog_limit() -> None:
    assert den_hartog.beta_lim(0.8) == pytest.approx(0.81741, abs=5e-6)


@pytest.mark.parametrize("r", [1, 0.5, 1 / 3, 0.25, 1 / 49])
def test_den_hartog_refuses_resonances(r: float) -> None:
    with pytest.raises(ValueError, match="resonance"):
        den_hartog.response(r)


@pytest.mark.parametrize(("r", "beta"), [(0.8, 0.3), (0.8, 0.8), (1.2, 0.3), (2, 0.4), (0.4, 0.1)])
def test_den_hartog_motion_solves_the_equation(r: float, beta: float) -> None:
    x_0, v_0 = den_hartog.state(0, r, beta)
    T = 4 * math.pi / r
    motion = coulomb_oscillator.phases(T, mu=beta, omega=r, x_0=float(x_0), v_0=float(v_0))
    assert [phase.mode for phase in motion[:2]] in ([1, -1], [-1, 1])
    assert all(phase.mode for phase in motion)
    t = np.linspace(0, T, 101)
    np.testing.assert_allclose(
        coulomb_oscillator.state(t, motion), den_hartog.state(r * t, r, beta), rtol=0, atol=1e-12
    )


@pytest.mark.parametrize("r", [0.4, 0.8, 1.2])
@pytest.mark.parametrize("excess", [-0.01, 0.01])
def test_den_hartog_limit_separates_motions_with_stops(r: float, excess: float) -> None:
    beta = den_hartog.beta_lim(r) + excess
    x_0, v_0 = den_hartog.state(0, r, den_hartog.beta_lim(r) - 0.01)
    T = 40 * math.pi / r
    motion = coulomb_oscillator.phases(T, mu=beta, omega=r, x_0=float(x_0), v_0=float(v_0))
    assert any(phase.mode == 0 for phase in motion) == (excess > 0)


def test_belt_block() -> None:
    cycle = {"m": 1, "k": 1, "V": 0.3, "F_s": 1, "F_k": 0.6}
    period = belt_block.period(**cycle)
    assert period == pytest.approx(7.0952615, abs=5e-8)
    assert belt_block.force_range(**cycle) == pytest.approx((0.1, 1.1), abs=1e-15)
    x, _ = belt_block.state(np.linspace(0, period, 100_001), **cycle)
    assert (x.min(), x.max()) == pytest.approx((0.1, 1.1), abs=1e-8)
    slip = belt_block.slip_duration(**cycle)
    ends = np.array([0, slip - 1e-12, slip, period - 1e-12])
    np.testing.assert_allclose(
        belt_block.state(ends, **cycle), [[1, 0.2, 0.2, 1], [0.3] * 4], rtol=0, atol=1e-11
    )


def test_belt_block_slip_solves_the_equation() -> None:
    cycle = {"m": 2, "k": 3, "V": 0.4, "F_s": 1.5, "F_k": 0.9}
    h = 1e-4
    t = np.linspace(2 * h, belt_block.slip_duration(**cycle) - 2 * h, 100)
    (x, v), (_, before), (_, after) = (belt_block.state(t + shift, **cycle) for shift in (0, -h, h))
    np.testing.assert_allclose(2 * (after - before) / (2 * h) + 3 * x, 0.9, atol=1e-7)
    assert np.all(v < 0.4)


@pytest.mark.parametrize("v_r", [-1.5, -1, -0.4, 0, 0.3, 0.99, 2])
def test_dither(v_r: float) -> None:
    tau = (np.arange(200_000) + 0.5) / 200_000 * 2 * np.pi
    assert dither.mean_sign(v_r, 1.0) == pytest.approx(
        np.mean(np.sign(v_r + np.cos(tau))), abs=2e-5
    )


def test_prandtl_tomlinson_jumps_at_the_force_of_the_jump() -> None:
    k = 0.7
    V_0 = 1.3
    a = 2.5
    support = prandtl_tomlinson.support_at_jump(k, V_0, a)
    X = np.concatenate([np.linspace(0, support - 1e-9, 200), [support + 1e-9]])
    x = prandtl_tomlinson.quasistatic(X, k, V_0, a)
    force = k * (X - x)
    assert force[-2] == pytest.approx(prandtl_tomlinson.force_at_jump(k, V_0, a), rel=1e-4)
    assert x[-1] - x[-2] > a / 2
    assert force.max() == pytest.approx(2 * math.pi * V_0 / a, rel=1e-3)


def test_prandtl_tomlinson_follows_a_stiff_spring() -> None:
    k = 4 * math.pi**2 / 0.9
    V_0 = 1.0
    a = 1.0
    assert prandtl_tomlinson.eta(k, V_0, a) == pytest.approx(0.9)
    assert prandtl_tomlinson.force_at_jump(k, V_0, a) == 0
    x = prandtl_tomlinson.quasistatic(np.linspace(0, 1, 1001), k, V_0, a)
    assert np.diff(x).max() < 0.02
    assert x[-1] == pytest.approx(1, abs=1e-12)


@pytest.mark.parametrize(("f_plus", "f_minus"), [(0.3, 0.8), (0.8, 0.3), (1.9, 5), (2.1, 5)])
def test_crawler(f_plus: float, f_minus: float) -> None:
    k, D = 1.0, 4.0
    L = 1 + D / 2 * np.sin(np.linspace(0, 4 * np.pi, 801))
    x1, x2 = crawler.simulate(L, k, f_plus, f_minus, 0, 1)
    expected = crawler.net_displacement(D, k, f_plus, f_minus)
    assert (x1[-1] - x1[400], x2[-1] - x2[400]) == pytest.approx((expected, expected), abs=1e-12)

    # Energetic solution: the pulls on the legs stay between −f₋ and f₊, and no energy is lost
    # beside the friction.
    tension = k * (x2 - x1 - L)
    for pull in (tension, -tension):
        assert -f_minus - 1e-12 <= pull.min() <= pull.max() <= f_plus + 1e-12
    steps = np.diff([x1, x2])
    dissipated = np.sum(f_plus * steps.clip(min=0) - f_minus * steps.clip(max=0))
    work = -np.sum((tension[1:] + tension[:-1]) / 2 * np.diff(L))
    assert dissipated + tension[-1] ** 2 / (2 * k) - tension[0] ** 2 / (2 * k) == pytest.approx(
        work, rel=1e-4
    )


def test_crawler_refuses_equal_thresholds() -> None:
    assert crawler.net_displacement(4, 1, 0.5, 0.5) == 0
    with pytest.raises(ValueError, match="not unique"):
        crawler.simulate([0, 1], 1, 0.5, 0.5)


@pytest.mark.parametrize("log_velocity", [0.01, 0.1, 1])
@pytest.mark.parametrize(("ratio", "order"), [(0.98, 1), (1, 0), (1.02, -1)])
def test_rate_and_state_growth(ratio: float, order: int, log_velocity: float) -> None:
    growth = rate_and_state.growth(ratio, 0.01, 0.015, log_velocity)
    assert growth == pytest.approx(1, abs=1e-9) if order == 0 else order * (growth - 1) > 0.01


def test_rate_and_state_is_periodic_at_the_critical_stiffness() -> None:
    a = 0.008
    b = 0.013
    sigma = 5e6
    D_c = 1e-5
    V = 1e-6
    k_c = rate_and_state.critical_stiffness(a, b, sigma, D_c)
    assert k_c == pytest.approx((b - a) * sigma / D_c)
    t = np.linspace(0, 2000, 2001)
    phi, theta, peaks = rate_and_state.simulate(t, k_c, a, b, sigma, D_c, V, 1.0)
    assert peaks.size > 10
    assert np.ptp(peaks) < 1e-8
    assert np.ptp(rate_and_state.first_integral(phi, theta, a, b)) < 1e-8

    # Small oscillations have the frequency ω_c.
    omega_c = rate_and_state.critical_frequency(a, b, D_c, V)
    t = np.linspace(0, 2 * math.pi / omega_c, 3)
    phi, theta, _ = rate_and_state.simulate(t, k_c, a, b, sigma, D_c, V, 1e-4)
    assert (phi[-1], theta[-1]) == pytest.approx((1e-4, 0), abs=1e-8)
    assert phi[1] == pytest.approx(-1e-4, abs=1e-7)


@pytest.mark.parametrize("m", [0.1, 3.0])
def test_rate_and_state_mass(m: float) -> None:
    a = 0.2
    b = 0.5
    sigma = 1.1
    D_c = 0.7
    V = 0.9
    k = rate_and_state.critical_stiffness(a, b, sigma, D_c, m, V)
    # Perturbations of (τ, ln v, ln θ) in mV φ' = τ − aσφ − bσϑ.
    jacobian = np.array(
        [
            [0, -k * V, 0],
            [1 / (m * V), -a * sigma / (m * V), -b * sigma / (m * V)],
            [0, -V / D_c, -V / D_c],
        ]
    )
    omega_c = rate_and_state.critical_frequency(a, b, D_c, V)
    pair = [value for value in np.linalg.eigvals(jacobian) if value.imag != 0]
    np.testing.assert_allclose(
        sorted(pair, key=np.imag), [-1j * omega_c, 1j * omega_c], rtol=0, atol=1e-12
    )


COULOMB = [
    2.318558961454817,
    2.941257811266674,
    7.229012432035236,
    7.642859644307301,
    12.770734250106242,
    13.804354019542556,
]


def test_coulomb_oscillator() -> None:
    assert coulomb_oscillator.switch_times(14.0) == pytest.approx(COULOMB, rel=0, abs=2e-15)
    assert [phase.mode for phase in coulomb_oscillator.phases(14.0)] == [1, 0, -1, 0, 1, 0, -1]


def test_coulomb_oscillator_joins_its_phases() -> None:
    motion = coulomb_oscillator.phases(
        60, m=1.3, k=0.9, mu=0.11, F=1.1, omega=0.23, x_0=0.4, v_0=-0.7
    )
    assert {phase.mode for phase in motion} == {-1, 0, 1}
    for before, after in itertools.pairwise(motion):
        for order in (0, 1):
            assert float(abs(before.x(before.end, order) - after.x(after.start, order))) < 1e-14
    t = np.linspace(0, 60, 5001)
    _, v = coulomb_oscillator.state(t, motion)
    for phase in motion:
        inside = (t > float(phase.start) + 1e-9) & (t < float(phase.end) - 1e-9)
        assert np.all(np.sign(v[inside]) == phase.mode)


def test_scaled_slider() -> None:
    cycle = scaled_slider.cycle("0.01", 1, digits=40)
    printed = (
        "0.0054267655331678199637",
        "6.366083565301879946",
        "0.38862420022020717876",
        # The reference prints ...879457179, two groups of digits interchanged: only this is
        # ln(γ_stick/γ_slip).
        "7.0673964441874579179",
        "0.028162086887829495",
    )
    for value, text in zip(cycle, printed, strict=True):
        assert mp.nstr(value, len(text.replace(".", "").lstrip("0"))) == text
    assert float(
        mp.log(cycle.gamma_stick / cycle.gamma_slip) - cycle.stick_duration
    ) == pytest.approx(0, abs=1e-15)


def test_scaled_slider_is_homogeneous() -> None:
    one = scaled_slider.cycle(0.02, 0.7)
    two = scaled_slider.cycle(0.02, 0.7, mu_0=1.5, v_hat=2)
    assert float(two.gamma_slip / one.gamma_slip) == pytest.approx(3, rel=1e-15)
    assert tuple(map(float, two[2:])) == pytest.approx(tuple(map(float, one[2:])), rel=1e-15)


def test_scaled_slider_multiplier_is_the_slope() -> None:
    def image(gamma: float) -> float:
        return scaled_slider.stick(scaled_slider.slip(gamma, 0.02, 0.7)[1], 0.02, 0.7)[1]

    cycle = scaled_slider.cycle(0.02, 0.7)
    h = mp.mpf("1e-4") * cycle.gamma_slip
    slope = (image(cycle.gamma_slip + h) - image(cycle.gamma_slip - h)) / (2 * h)
    assert float(slope) == pytest.approx(float(cycle.multiplier), rel=1e-6)


def test_scaled_slider_lowest_order() -> None:
    assert float(scaled_slider.lowest_order_fixed_point(1)) == pytest.approx(
        0.00590569826359391, abs=5e-18
    )
    gaps = [
        abs(float(scaled_slider.cycle(nu, 1).gamma_slip) - 0.00590569826359391)
        for nu in (1e-6, 1e-8)
    ]
    assert gaps[1] < gaps[0] / 8  # the maps differ by O(√ν)


def test_scaled_slider_refuses_endless_slip() -> None:
    with pytest.raises(ValueError, match="unstable focus"):
        scaled_slider.slip(0, 0.01, 0.05)


def _coulomb_by_moreau(n: int) -> Array:
    """Positions of reference 7 at 261 equidistant times in [0, 13]."""
    one = np.eye(1)
    column = np.ones((n + 1, 1))
    force = np.cos(0.5 * np.linspace(0, 13, n + 1))[:, None]
    q, _, _ = moreau(
        one, 0 * one, one, one, force, 0.5 * column, 0 * column, np.zeros(1), np.zeros(1), 13, n
    )
    return q[:: n // 260, 0]


def test_moreau_is_of_order_one() -> None:
    exact, _ = coulomb_oscillator.state(np.linspace(0, 13, 261), coulomb_oscillator.phases(13))
    errors = [np.abs(_coulomb_by_moreau(n) - exact).max() for n in (2600, 5200, 10_400, 20_800)]
    assert np.log2(np.divide(errors[:-1], errors[1:])) == pytest.approx(1, abs=0.02)
    assert errors[-1] < 2e-3


def test_moreau_solves_the_inclusion_of_several_contacts() -> None:
    rng = np.random.default_rng(1)
    d = 3
    c = 5
    n = 400
    T = 20.0
    M, C, K = (root @ root.T + np.eye(d) for root in rng.normal(size=(3, d, d)))
    J = rng.normal(size=(c, d))
    t = np.linspace(0, T, n + 1)[:, None]
    force = 3 * np.cos(t * rng.uniform(0.3, 1, d) + rng.uniform(0, 6, d))
    threshold = 0.6 + 0.5 * np.cos(t * rng.uniform(0.3, 1, c))
    speed = 0.2 * np.sin(t * rng.uniform(0.3, 1, c))
    q, v, contact_force = moreau(M, C, K, J, force, threshold, speed, np.ones(d), np.zeros(d), T, n)

    balance = np.diff(v, axis=0) * n / T @ M + v[1:] @ C + q[1:] @ K - force[1:] - contact_force @ J
    np.testing.assert_allclose(balance, 0, atol=1e-10)
    u = v[1:] @ J.T - speed[1:]
    s = threshold[1:]
    slips = np.abs(u) > 1e-9
    assert 0.1 < slips.mean() < 0.9
    np.testing.assert_allclose(contact_force[slips], -(s * np.sign(u))[slips], atol=1e-12)
    assert np.all(np.abs(contact_force) <= s * (1 + 1e-15))


def test_moreau_refuses_other_shapes() -> None:
    one = np.eye(1)
    with pytest.raises(ValueError, match="threshold has the shape"):
        moreau(
            one,
            one,
            one,
            one,
            np.zeros((11, 1)),
            np.zeros(11),
            np.zeros((11, 1)),
            np.zeros(1),
            np.zeros(1),
            1,
            10,
        )


def test_first_order_on_a_belt() -> None:
    # Stuck to the belt, z = wt, until Kz + Cw = s; then Cz' + Kz = s.
    C = 0.4
    K = 2.0
    w = 0.5
    s = 1.0
    T = 2.0
    start = (s - C * w) / (K * w)
    errors = []
    for n in (1000, 2000, 4000):
        column = np.ones((n + 1, 1))
        t = np.linspace(0, T, n + 1)
        z, v, contact_force = first_order(
            C * np.eye(1),
            K * np.eye(1),
            np.eye(1),
            0 * column,
            s * column,
            w * column,
            np.zeros(1),
            T,
            n,
        )
        slip = s / K - C * w / K * np.exp(-K / C * (t - start))
        errors.append(np.abs(z[:, 0] - np.where(t < start, w * t, slip)).max())
    assert errors[0] < 1e-3
    assert np.log2(np.divide(errors[:-1], errors[1:])) == pytest.approx(1, abs=0.05)
    assert v[0, 0] == pytest.approx(w, abs=1e-10)
    assert contact_force[-1, 0] == pytest.approx(s)


def test_rate_independent_scalar() -> None:
    # [M], section 2.2: ℓ = 5t − t², here with one constant threshold.
    rho = 0.75
    t = np.linspace(0, 5, 1001)
    load = 5 * t - t**2
    z = rate_independent(np.eye(1), load[:, None], np.full((t.size, 1), rho), np.zeros(1))
    rising = np.maximum(0, load - rho)
    exact = np.where(t < 2.5, rising, np.minimum(25 / 4 - rho, load + rho))
    np.testing.assert_allclose(z[:, 0], exact, rtol=0, atol=1e-12)


def test_rate_independent_is_the_inviscid_limit() -> None:
    A = np.array([[2, -1, 0], [-1, 2, -0.9], [0, -0.9, 1.5]])
    n = 4000
    T = 12.0
    t = np.linspace(0, T, n + 1)[:, None]
    load = np.hstack([2 * np.sin(t), np.cos(1.3 * t) - 1, 1.5 * np.sin(0.7 * t)])
    threshold = 0.4 + np.hstack([0.2 * np.sin(2 * t), 0.1 * np.cos(t), 0 * t])
    z = rate_independent(A, load, threshold, np.zeros(3))

    pull = load[1:] - z[1:] @ A
    moves = np.diff(z, axis=0)
    np.testing.assert_allclose(np.abs(pull).clip(max=threshold[1:]), np.abs(pull), atol=1e-10)
    np.testing.assert_allclose(pull * moves, threshold[1:] * np.abs(moves), atol=1e-12)
    assert 0.1 < np.mean(moves != 0) < 0.9

    viscous, _, _ = first_order(
        1e-9 * np.eye(3), A, np.eye(3), load, threshold, 0 * threshold, np.zeros(3), T, n
    )
    np.testing.assert_allclose(viscous, z, atol=1e-6)

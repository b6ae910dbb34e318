"""Which law: decided where data decide, and not where they do not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import stickslip as ss
from fitting import synthetic


def laws() -> dict[str, ss.System]:
    stribeck = ss.catalogue.belt_stribeck()
    return {"Stribeck": stribeck, "Coulomb": ss.catalogue.belt_block(F_s=1.0, F_k=0.5)}


FREE = {
    "Stribeck": {"F_s": (0.5, 3.0), "F_c": (0.1, 1.0), "v_s": (0.05, 2.0)},
    "Coulomb": {"F_s": (0.9, 3.0), "F_k": (0.1, 0.9)},
}


def test_the_law_that_made_the_data_is_preferred() -> None:
    record = synthetic.stribeck(0)
    systems = laws()
    systems["Coulomb"] = systems["Coulomb"].with_parameters(V=systems["Stribeck"].values["V"])
    found = ss.compare(systems, record.data, FREE, record.observe, starts=4)
    assert found.decided
    assert found.names[int(np.argmin(found["aicc"].values))] == "Stribeck"
    assert found.best is found.fits[0]
    assert found["weight"].values.sum() == pytest.approx(1.0)
    assert "prefer Stribeck" in found.message


def test_data_that_do_not_decide() -> None:
    """Two models that differ by a parameter which the data do not feel: AICc differs by what that
    costs alone, and the flat profile is named."""
    system = ss.System(
        name="drag",
        parameters={
            "c": ss.Parameter(0.1, range="[0, inf)"),
            "e": ss.Parameter(1e-3, range="[0, inf)"),
        },
        coordinates={"x": ss.Inertial(drag="c*d_x + e*d_x**3")},
        kinetic="d_x**2/2",
        potential="x**2/2",
        contacts={"ground": ss.Contact("d_x", 0.01)},
        initial={"x": 1.0},
    )
    t = np.linspace(0.0, 20.0, 100)
    x = np.asarray(ss.simulate(system, (0, 20), parameters={"e": 0.0}).at(t)["x"])
    data = {"t": t, "x": x + 0.05 * np.random.default_rng(1).standard_normal(100)}
    free = [{"c": (0.0, 1.0)}, {"c": (0.0, 1.0), "e": (0.0, 1.0)}]
    found = ss.compare([system, system], data, free, starts=2)
    assert found.names == ["drag 1", "drag 2"]
    assert not found.decided
    assert "do not discriminate" in found.verdict
    assert found.flat["drag 1"] == ()
    assert found.flat["drag 2"] == ("e",)
    assert "the data do not determine e" in found.message


def test_stored_and_opened(tmp_path: Path) -> None:
    record = synthetic.forced(0)
    systems = {"one": record.system, "other": record.system.with_parameters(P=0.9)}
    found = ss.compare(systems, record.data, {"F_c": (0.1, 0.9)}, starts=1)
    found.save(tmp_path / "comparison.nc")
    again = ss.open(tmp_path / "comparison.nc")
    assert again.message == found.message
    assert again.fits[1].estimate == found.fits[1].estimate
    assert (
        again.fits[1].problem.log_likelihood(again.fits[1].values) == found.fits[1].log_likelihood
    )
    assert again.summary().to_json() == found.summary().to_json()
    figure = again.plot()
    legend = figure.axes[0].get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()] == ["data", "one", "other"]


def test_one_system_is_no_comparison() -> None:
    record = synthetic.forced(0)
    with pytest.raises(ss.DeclarationError, match="Give at least two"):
        ss.compare([record.system], record.data, record.free)
    with pytest.raises(ss.DeclarationError, match="differs from the number of systems"):
        ss.compare([record.system] * 2, record.data, [record.free])

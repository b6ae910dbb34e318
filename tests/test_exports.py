"""Results as files for other programs."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.io import wavfile

import stickslip as ss

TONE = ss.System(
    "tone",
    parameters={"omega": 2 * math.pi * 440.0},
    coordinates={"x": ss.Inertial("m")},
    kinetic="d_x**2/2",
    potential="omega**2*(x - 0.25)**2/2",
    initial={"x": 1.25},
    span=(0, 0.5),
    time_unit="s",
)


def test_a_motion_is_sampled_at_even_times(tmp_path: Path) -> None:
    motion = ss.simulate(ss.catalogue.belt_block(), (0.0, 8.0))
    ss.export(motion, tmp_path / "x.csv", "x", "mode_belt_contact", step=0.1, units=True)
    table = pd.read_csv(tmp_path / "x.csv")
    assert list(table.columns) == ["time [s]", "x [m]", "mode_belt_contact"]
    times = table["time [s]"].to_numpy()
    assert len(times) == 81 and times[-1] == 8.0
    np.testing.assert_allclose(table["x [m]"], motion.at(times)["x"], rtol=1e-15)
    assert set(table["mode_belt_contact"]) == {"stick", "slip-"}


def test_a_file_of_samples_is_read_as_a_drive(tmp_path: Path) -> None:
    """What is written is what a model file reads."""
    motion = ss.simulate(TONE, (0.0, 0.01))
    ss.export(motion, tmp_path / "x.csv", "x", step=1e-4)
    drive = ss.Samples.read(tmp_path / "x.csv", time="time", value="x")
    np.testing.assert_array_equal(drive.values, motion.at(drive.times)["x"])
    assert len(drive.times) == 101


def test_sound_has_the_pitch_and_the_length_of_the_motion(tmp_path: Path) -> None:
    motion = ss.simulate(TONE)
    ss.export(motion, tmp_path / "tone.wav", "x", rate=8000)
    rate, sound = wavfile.read(tmp_path / "tone.wav")
    assert rate == 8000 and len(sound) == 4001 and sound.dtype == np.int16
    heard = np.fft.rfftfreq(4000, 1 / rate)[np.argmax(np.abs(np.fft.rfft(sound[:4000])))]
    assert heard == 440.0
    assert 0.89 < np.max(np.abs(sound)) / 2**15 <= 0.9
    ss.export(motion, tmp_path / "slow.wav", "x", rate=8000, seconds=2.0)
    assert len(wavfile.read(tmp_path / "slow.wav")[1]) == 8001


@pytest.mark.parametrize(
    ("write", "reason"),
    [
        (lambda m, p: ss.export(m, p / "a.csv", step=0.0), "step: 0 is not"),
        (lambda m, p: ss.export(m, p / "a.csv", step=1e-12), "rows"),
        (lambda m, p: ss.export(m, p / "nowhere" / "a.csv"), "cannot be written"),
        (lambda m, p: ss.export(m, p / "a.wav", "y"), "unknown quantity 'y'"),
        (lambda m, p: ss.export(m, p / "a.wav", "x", rate=0), "rate: 0 is out of range"),
        (lambda m, p: ss.export(m, p / "a.wav", "x", seconds=-1.0), "seconds"),
        (lambda m, p: ss.export(m, p / "a.wav", "energy"), "is constant"),
        (lambda m, p: ss.export(ss.equilibria(TONE), p / "a.wav", "x"), "not a motion"),
        (lambda m, p: ss.export(ss.equilibria(TONE), p / "a.csv", step=0.1), "not a motion"),
    ],
)
def test_refusals(write, reason: str, tmp_path: Path) -> None:
    motion = ss.simulate(TONE)
    (tmp_path / "a.csv").write_text("before")
    with pytest.raises(ss.StickslipError, match=reason):
        write(motion, tmp_path)
    assert (tmp_path / "a.csv").read_text() == "before"

"""The work of ``stickslip run``: compute, summarise, write."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stickslip import __version__
from stickslip.cli.folder import add_picture, result_folder
from stickslip.progress import watched
from stickslip.storage import plain

if TYPE_CHECKING:
    from stickslip.model.system import System
    from stickslip.motion.trajectory import Trajectory


def compute(
    system: System, initial: Mapping[str, float], until: float | None, rtol: float, out: Path | None
) -> tuple[dict[str, Any], Path]:
    """Simulate a system and write the results.

    Parameters
    ----------
    system : System
    initial : mapping of str to float
        Initial values that replace the declared ones.
    until : float or None
        End of the time span (the declared one if None).
    rtol : float
    out : Path or None
        Folder for the results, ``out/<name>`` if None.

    Returns
    -------
    summary : dict
        What ``summary.json`` holds.
    folder : Path
        Where the results are.
    """
    from stickslip.motion.simulate import simulate

    span = (system.span[0], system.span[1] if until is None else until)
    folder = out or Path("out") / re.sub(r"[^\w.-]+", "_", system.name)
    with result_folder(folder) as place:
        with watched("moving") as progress:
            trajectory = simulate(system, span, initial, rtol=rtol, progress=progress)
        summary = summarise(trajectory, rtol)
        trajectory.save(place / "trajectory.nc")
        trajectory.events.to_csv(place / "events.csv", index=False)
        text = json.dumps(summary, indent=2, ensure_ascii=False)
        (place / "summary.json").write_text(text + "\n", encoding="utf-8")
    add_picture(folder, trajectory.plot)
    return summary, folder


def summarise(trajectory: Trajectory, rtol: float) -> dict[str, Any]:
    """Everything about a result that fits on a page; plain data."""
    system, certificate = trajectory.system, trajectory.certificate
    return plain(
        {
            "program": "stickslip",
            "version": __version__,
            "system": system.name,
            "title": system.title,
            "outcome": trajectory.outcome.label,
            "message": trajectory.message,
            "complete": trajectory.outcome.ok,
            "certified": certificate.ok,
            "t_span": list(trajectory.t_span),
            "end": float(trajectory.dataset["time"][-1]),
            "switches": trajectory.n_switches,
            "final": trajectory.final,
            "parameters": trajectory.parameters,
            "functions": {**system.functions, **system.drives},
            "certificate": certificate.to_dict(),
            "warnings": trajectory.warnings,
            "rtol": rtol,
            "wall_time": trajectory.wall_time,
        }
    )

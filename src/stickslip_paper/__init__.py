"""[M] as a computation: every figure drawn, every statement that can be computed checked, with a
measured number.

A. Mielke, *Three examples concerning the interaction of dry friction and oscillations*, WIAS
preprint 2405 (2017). This package uses only the public names of :mod:`stickslip`; its further
requirements (SymPy, Pillow) are the extra ``stickslip[paper]``. The figures are
``stickslip_paper.figures.FIGURES``, the animations
``stickslip_paper.moving.animations.ANIMATIONS``.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from stickslip_paper.sections.claim import Claim

SECTIONS = (
    "section2_scalar",
    "section2_averaging",
    "section3_slider",
    "section3_scaling",
    "section3_maps",
    "section4_model",
    "section4_walking",
)


def claims() -> list[Claim]:
    """All claims, section by section."""
    from stickslip_paper.sections.claim import Claim

    modules = [import_module(f"stickslip_paper.sections.{name}") for name in SECTIONS]
    return [item for module in modules for item in vars(module).values() if isinstance(item, Claim)]

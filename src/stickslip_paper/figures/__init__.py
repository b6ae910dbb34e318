"""The figures of [M], in its order, and three more.

>>> from stickslip_paper.figures import FIGURES
>>> FIGURES["4.4"].draw().savefig("figure-4-4.svg")

A. Mielke, *Three examples concerning the interaction of dry friction and oscillations*, WIAS
preprint 2405 (2017), [M].
"""

from stickslip_paper.drawing.entry import FigureEntry
from stickslip_paper.figures import (
    averaging,
    bifurcation,
    figure_1_1,
    figure_2_1,
    figure_3_1,
    figure_3_2,
    figure_3_3,
    figure_4_1,
    figure_4_2,
    figure_4_3,
    figure_4_4,
    speed,
)

__all__ = ["FIGURES", "FigureEntry"]

_MODULES = (
    figure_1_1,
    figure_2_1,
    averaging,
    figure_3_1,
    figure_3_2,
    figure_3_3,
    bifurcation,
    figure_4_1,
    figure_4_2,
    figure_4_3,
    figure_4_4,
    speed,
)
FIGURES: dict[str, FigureEntry] = {module.ENTRY.key: module.ENTRY for module in _MODULES}

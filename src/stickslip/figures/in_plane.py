"""Contacts in a plane: the path, coloured by stick and slip, and the friction force in its
admissible set."""

from __future__ import annotations

from typing import TYPE_CHECKING

from matplotlib.axes import Axes

from stickslip.errors import DeclarationError, suggestion
from stickslip.figures.drawing.planes import InPlane, PlaneCurves
from stickslip.figures.drawing.sampling import SampledMotion
from stickslip.figures.drawing.style import paper_style
from stickslip.figures.drawing.thinning import FEW

if TYPE_CHECKING:
    from stickslip.motion.trajectory import Trajectory


def in_plane(motion: Trajectory, contact: str = "") -> InPlane:
    """A contact in a plane; by default the first one.

    Raises
    ------
    DeclarationError
        If there is no such contact.
    """
    planes = motion.system.planes
    if not planes:
        raise DeclarationError(
            "contacts",
            f"{motion.system.name} has no contact in a plane",
            "Declare a contact with two directions, like direction = ['d_x', 'd_y']",
        )
    if contact and contact not in planes:
        raise DeclarationError(
            "contact", f"unknown contact in a plane '{contact}'", suggestion(contact, [*planes])
        )
    return InPlane(motion, contact or next(iter(planes)))


def path_in_plane(axes: Axes, motion: Trajectory, contact: str = "") -> None:
    """Draw the path of a contact in a plane: slips blue, stick phases black.

    Parameters
    ----------
    axes : matplotlib.axes.Axes
        Axes to draw into; their scales are made equal.
    motion : Trajectory
    contact : str
        By default the first contact in a plane.

    Raises
    ------
    DeclarationError
        If there is no such contact, or its directions vary, so that it has no path.

    Examples
    --------
    >>> import stickslip as ss
    >>> motion = ss.simulate(ss.catalogue.puck())
    >>> figure = ss.style.new_figure(4.0, 4.0)
    >>> ss.figures.path_in_plane(figure.add_subplot(), motion)
    """
    plane = in_plane(motion, contact)
    if plane.directions is None:
        raise DeclarationError(
            "contact",
            f"the directions of '{plane.name}' vary or are zero, so it has no path",
            "Plot coordinates or the force instead",
        )
    with paper_style():
        _collected(plane).draw_path(axes, plane)


def force_in_plane(axes: Axes, motion: Trajectory, contact: str = "") -> None:
    """Draw the friction force of a contact in a plane, inside the disc or ellipse of admissible
    forces; if this set varies, draw the smallest and the largest one.

    Parameters
    ----------
    axes : matplotlib.axes.Axes
        Axes to draw into; their scales are made equal.
    motion : Trajectory
    contact : str
        By default the first contact in a plane.

    Raises
    ------
    DeclarationError
        If there is no such contact.

    Examples
    --------
    >>> import stickslip as ss
    >>> motion = ss.simulate(ss.catalogue.turntable())
    >>> figure = ss.style.new_figure(4.0, 4.0)
    >>> ss.figures.force_in_plane(figure.add_subplot(), motion, "disc")
    """
    plane = in_plane(motion, contact)
    with paper_style():
        _collected(plane).draw_force(axes, plane)


def _collected(plane: InPlane) -> PlaneCurves:
    """Collect the curves of one contact."""
    motion = plane.trajectory
    sampled = SampledMotion(motion)
    curves = PlaneCurves([plane], sampled, sampled.count <= FEW)
    sticks = {plane.key: motion.modes[plane.key]}
    for _, steps, values in sampled.sampled([*motion.system.declaration.state, *plane.traced]):
        curves.absorb(steps, values, sticks)
    return curves

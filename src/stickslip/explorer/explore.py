"""Opening the explorer: from the command line, from Python, in a notebook."""

from __future__ import annotations

import os
import webbrowser
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import quote, unquote

from stickslip import catalogue
from stickslip.arguments import validated
from stickslip.errors import DeclarationError, StickslipError
from stickslip.explorer.asking.limits import MOST_PAGES
from stickslip.explorer.asking.request import FIRST_MODEL, GIVEN, packed_text
from stickslip.explorer.serving.server import HERE, Explorer, Listening
from stickslip.progress import in_notebook

if TYPE_CHECKING:
    from stickslip.model.system import System


@validated
def explore(
    system: System | str | None = None, *, port: int | None = None, browser: bool | None = None
) -> Explorer:
    """Open the explorer on a system: a page in the browser, or in the output of a notebook's cell.

    Parameters
    ----------
    system : System or str, optional
        A system, a name of the catalogue, a model file, or the part after # of a URL of the
        explorer. By default the page starts with the gallery.
    port : int, optional
        Port to listen on; by default 5106, or a free port.
    browser : bool, optional
        Whether to open the page in a browser. By default it is opened, except in a notebook.

    Returns
    -------
    Explorer
        It serves the page in the background until ``close()`` is called or the program ends;
        ``wait()`` waits until then. ``address`` is its address.

    Raises
    ------
    DeclarationError
        If the system is unknown.
    StickslipError
        If bokeh is not installed.
    """
    explorer = listening_explorer(system, port=port).start()
    if not in_notebook() if browser is None else browser:
        webbrowser.open(explorer.address)
    return explorer


def listening_explorer(
    system: System | str | None,
    *,
    port: int | None = None,
    host: str = HERE,
    names: tuple[str, ...] = (),
    most_pages: int = MOST_PAGES,
) -> Explorer:
    """An explorer that listens, but does not serve yet.

    Parameters
    ----------
    port : int, optional
    host : str
        The address on which to listen.
    names : tuple of str
        Additional accepted host names.
    most_pages : int
        Maximum number of open pages.

    Raises
    ------
    DeclarationError
        If there is no such system, or the port is taken.
    StickslipError
        If bokeh is not installed.
    """
    try:
        from importlib.metadata import version

        version("bokeh")
    except ImportError:
        raise StickslipError(
            "the explorer requires bokeh. Install it with: pip install 'stickslip[explorer]'"
        ) from None
    given, start = _start(system)
    place = Listening(host, port, names, given, start, most_pages)
    place.bind()
    return Explorer(place)


def _start(system: System | str | None) -> tuple[str, str]:
    """The text of a model, and the state that the page begins with."""
    if system is None:
        return "", ""
    if not isinstance(system, str):
        return system.to_toml(), GIVEN
    text = system.rpartition("#")[2]
    model, _, rest = text.partition("?")
    if model in ("own", GIVEN) and rest:
        return "", text
    name = unquote(model)
    if name in catalogue.names():
        return "", quote(name) + (f"?{rest}" if rest else "")
    if name.endswith(".toml") or os.sep in name or Path(name).is_file():
        from stickslip.model.system_file import load

        if (evolution := _evolution(name)) is not None:
            return "", f"{FIRST_MODEL}?.panel=friction&evolution={packed_text(evolution)}"
        return load(name).to_toml(), GIVEN + (f"?{rest}" if rest else "")
    return "", catalogue.get(name).name  # raises an error that lists the names


def named_system(text: str) -> System:
    """The system of a name, a model file or a URL, with the settings of the URL.

    Raises
    ------
    DeclarationError
        If there is no such system, or something in it is wrong.
    """
    from dataclasses import replace

    from stickslip.explorer.asking.request import read_state
    from stickslip.explorer.subject.systems import shown_span, system_of
    from stickslip.model.system_file import load

    state = text.rpartition("#")[2]
    model, _, rest = state.partition("?")
    if model in ("own", GIVEN) and rest:
        reason = "the URL contains a model"
        raise DeclarationError("MODEL", reason, "Export its model file, and name that")
    setting = read_state(state)
    name = unquote(model)
    if name.endswith(".toml") or os.sep in name or Path(name).is_file():
        if _evolution(name) is not None:
            reason = "an evolution has no motions to store"
            raise DeclarationError("MODEL", reason, "Name a system of the catalogue or its file")
        setting = replace(setting, model="", toml=load(name).to_toml())
    system, numbers = system_of(setting)
    own = system.configure(numbers)
    initial = {**own.initial, **setting.initial}
    return replace(own, initial=initial, span=shown_span(own, setting))


def _evolution(path: str) -> str | None:
    """The text of a model file if it declares an evolution; raises an error if it is invalid."""
    from stickslip.model.formats.toml import parse, read_text, said_of

    with said_of(path):
        text = read_text(path)
        if "dissipation" not in parse(text):
            return None
    from stickslip.rate_independent.evolution.evolution_file import load_evolution

    return load_evolution(path).to_toml()

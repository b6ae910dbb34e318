"""The command-line program: the table of commands, and the implementation of short ones."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from stickslip import __version__
from stickslip.cli.added import add_commands
from stickslip.cli.commands import evolving, exploring, fitting, orbits, shaking, sweeping
from stickslip.cli.common.ending import NOT_CERTIFIED, guarded
from stickslip.cli.common.options import Model, Out, ParameterOptions, with_single_options
from stickslip.results import Summary, certificate_rows

app: typer.Typer = typer.Typer(
    name="stickslip",
    help="Exact stick-slip motion of systems with dry friction.",
    epilog="Start with: stickslip run rocking_toy",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)


_PAPER = (
    "A. Mielke, Three examples concerning the interaction of dry friction and oscillations, "
    "WIAS preprint 2405, Berlin 2017."
)


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"stickslip {__version__}")
        raise typer.Exit()


@app.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_version, is_eager=True, help="Show the version and exit."
        ),
    ] = False,
) -> None:
    pass


@app.command("list")
@guarded
def list_() -> None:
    """List the systems of the catalogue."""
    from stickslip import catalogue

    systems = {name: catalogue.about(name) for name in catalogue.names()}
    names, titles = max(map(len, systems)), max(len(title) for title, _ in systems.values())
    for name, (title, source) in systems.items():
        typer.echo(f"{name:<{names}}   {title:<{titles}}   {source}".rstrip())


@app.command()
@guarded
def show(
    model: Model,
    settings: ParameterOptions = None,
    latex: Annotated[bool, typer.Option("--latex", help="Equations in LaTeX.")] = False,
    toml: Annotated[
        bool, typer.Option("--toml", help="The model file, as a template for your own.")
    ] = False,
) -> None:
    """Show the equations, parameters and source of a system."""
    from stickslip.cli.common.models import load_model

    system = load_model(model, settings or [])
    if toml:
        typer.echo(system.to_toml(), nl=False)
    elif latex:
        typer.echo(system.equations(latex=True))
    else:
        typer.echo(str(system.equations()), nl=False)


@app.command()
@guarded
def law(
    name: Annotated[str | None, typer.Argument(metavar="[LAW]", help="Name of a law.")] = None,
    settings: ParameterOptions = None,
    out: Out = None,
) -> None:
    """List the friction laws, or show one: its equations, its source, and a plot of its loops.

    Writes overview.png into the folder DIR.
    """
    from stickslip.cli.commands.laws import list_laws, show_law

    if name is None:
        list_laws()
    else:
        show_law(name, settings or [], out)


@app.command()
@guarded
def cite(
    model: Annotated[
        str | None,
        typer.Argument(metavar="[MODEL]", help="Name of a catalogue system, or a model file."),
    ] = None,
) -> None:
    """Show what to cite: this program, the paper it is based on, and the source of a system."""
    from stickslip.cli.common.models import references

    typer.echo(
        f"The stickslip developers, stickslip {__version__}: exact motions of systems with dry "
        "friction."
    )
    typer.echo(_PAPER)
    for reference in [] if model is None else references(model):
        typer.echo(reference)


@app.command()
@guarded
def check(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A stored result.")],
    model: Annotated[
        str | None,
        typer.Option("--model", metavar="MODEL", help="The expected model of the result."),
    ] = None,
    settings: ParameterOptions = None,
    json_: Annotated[
        bool, typer.Option("--json", help="Print only the certificate, as JSON.")
    ] = False,
) -> None:
    """Check a stored result.

    The certificate of a motion or a play is recomputed from the stored data; for other results the
    stored certificate is shown. With --model (and the --set options of the computation) the result
    is compared with a model that may have been edited since. Exit code: 0 certified, 1 not
    certified or a different model, 2 not a result.
    """
    from stickslip import open as open_result
    from stickslip.cli.common.report import print_summary
    from stickslip.storage import plain

    result = open_result(file)
    certificate = result.certificate
    changed: list[str] = []
    if model is not None:
        from stickslip.cli.common.models import differences, load_model

        changed = differences(result, load_model(model, settings or []), model)
    if json_:
        said = plain(certificate.to_dict()) | ({"differs": changed} if model is not None else {})
        typer.echo(json.dumps(said, indent=2))
    else:
        rows = (
            ("file", str(file)),
            ("result", f"{result.KIND}, {result.message}"),
            *certificate_rows(certificate),
            *((f"{model} differs" if i == 0 else "", line) for i, line in enumerate(changed)),
            *([("model", f"as in {model}")] if model is not None and not changed else []),
        )
        print_summary(Summary(result.title, rows, {}, certificate.ok and not changed))
    raise typer.Exit(0 if certificate.ok and not changed else NOT_CERTIFIED)


@app.command()
@guarded
def warmup() -> None:
    """Load the engine, compile missing parts, and show where machine code is stored.

    Useful once after an installation, or on each node of a cluster.
    """
    from stickslip import Contact, Inertial, System, find_cycle, simulate
    from stickslip.machine_code.store import cache_folder

    block = System(
        "block",
        coordinates={"x": Inertial()},
        kinetic="d_x**2/2",
        potential="x**2/2",
        contacts={"belt": Contact("d_x", 1.0, 0.3, kinetic=0.6)},
        span=(0.0, 20.0),
    )
    for flow in ("auto", "taylor"):
        simulate(block, flow=flow).audit  # noqa: B018
    find_cycle(block).extrema  # noqa: B018
    typer.echo(f"ready; machine code of systems is stored in {cache_folder()}")


for _name, _command in {
    "run": orbits.run_command,
    "events": orbits.events_command,
    "average": evolving.average_command,
    "evolve": evolving.evolve_command,
    "equilibria": orbits.equilibria_command,
    "cycle": orbits.cycle_command,
    "branch": orbits.branch_command,
    "response": orbits.response_command,
    "ring-down": orbits.ring_down_command,
    "backbone": orbits.backbone_command,
    "basin": orbits.basin_command,
    "fit": fitting.fit_command,
    "sweep": sweeping.sweep_command,
    "records": shaking.records_command,
    "plot": sweeping.plot_command,
    "export": sweeping.export_command,
    "explore": exploring.explore_command,
}.items():
    app.command(_name)(guarded(with_single_options(_command)))
add_commands(app, guarded)

"""Commands on motion and what is beyond the edge: `simulate`, `cycles`, `threshold`, `response`, `hunt`, `verdicts`."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from steadyslip.cli.answers import output_result
from steadyslip.cli.options import AsJson, Changes, Journal, Pieces, RigFile, Until, outputs


def simulate(
    rig: RigFile,
    changes: Changes = None,
    until: Until = None,
    pieces: Pieces = None,
    start: Annotated[
        list[str] | None,
        typer.Option("--initial", metavar="NAME=VALUE", help="start elsewhere than in steady sliding; SI; repeatable"),
    ] = None,
    output: Annotated[list[Path] | None, outputs("write .nc, .csv, .html, .png, .svg or .pdf")] = None,
    journal: Journal = False,
    samples: Annotated[int | None, typer.Option(min=2, max=10_000_000, help="report at this many even times")] = None,
    phase: Annotated[bool, typer.Option("--phase", help="draw the phase plane instead of the history")] = False,
    contact: Annotated[
        str | None,
        typer.Option(help="of a machine: draw its phase plane; that which moves most unless given"),
    ] = None,
    method: Annotated[str, typer.Option(help="auto, explicit, rosenbrock, dop853 or rodas5p")] = "auto",
    rtol: Annotated[float, typer.Option(help="error allowed per step")] = 1e-7,
    as_json: AsJson = False,
) -> None:
    """What does this rig do, under the protocol of its file and of the command line?"""
    from steadyslip.cli.run_files import ENDINGS, run_file, write_history
    from steadyslip.files.output import check_output
    from steadyslip.linear.status import stability

    check_output(output or (), ENDINGS)
    history = run_file(rig, changes or (), pieces or (), start or (), until, samples, method, rtol, contact)
    if history.undisturbed and stability(history.rig) == "unstable":
        begin, end = history.nudge
        typer.secho(f"nothing disturbs this unstable rig, so that its drive is faster for a while: {begin}", err=True)
        pieces = [*(pieces or ()), begin, end]
        history = run_file(rig, changes or (), pieces, start or (), until, samples, method, rtol, contact)
    output_result(
        history,
        output or (),
        as_json,
        partial(write_history, kind="phase" if phase or contact else "history", source=rig, contact=contact),
    )


def cycles(
    rig: RigFile,
    changes: Changes = None,
    along: Annotated[
        str | None,
        typer.Option(
            help="the parameter that is varied; stiffness unless given, of a machine the one of a link or the drive "
            "whose edge of oscillation is nearest"
        ),
    ] = None,
    between: Annotated[
        tuple[str, str] | None, typer.Option(metavar="LOW HIGH", help="range of it, such as '1 GPa/m' '50 GPa/m'")
    ] = None,
    doublings: Annotated[int, typer.Option(min=0, help="how many period doublings to follow")] = 1,
    output: Annotated[list[Path] | None, outputs("write .nc, .csv, .html, .png, .svg or .pdf")] = None,
    journal: Journal = False,
    as_json: AsJson = False,
) -> None:
    """Which stick-slip cycles does this rig have, as a parameter varies? Ctrl-C keeps what there is."""
    from steadyslip.cli.cycle_files import ENDINGS, cycles_of_file, write_branch
    from steadyslip.files.output import check_output

    check_output(output or (), ENDINGS)
    branch = cycles_of_file(rig, changes or (), along, between, doublings, partial(typer.secho, err=True))
    output_result(branch, output or (), as_json, partial(write_branch, source=rig))


def threshold(
    rig: RigFile,
    changes: Changes = None,
    kick: Annotated[
        list[str] | None,
        typer.Option(
            "--kick",
            help="velocity, displacement, normal-stress or impulse; repeatable; the first two unless given; of "
            "a machine velocity, displacement, force, normal-force or impulse",
        ),
    ] = None,
    at: Annotated[str | None, typer.Option(help="of a machine: the body or contact that is kicked")] = None,
    reverse: Annotated[bool, typer.Option("--reverse", help="slower, backward, pressed less")] = False,
    reference: Annotated[
        str, typer.Option(help="whether the rig's drive is the velocity 'before' or 'after' a velocity step")
    ] = "before",
    up_to: Annotated[
        float | None,
        typer.Option("--up-to", help="largest size of interest, as `size` of --json; 1e4 times the drive, or so"),
    ] = None,
    output: Annotated[
        list[Path] | None, outputs("write .html, or draw the basin in the phase plane: .png, .svg or .pdf")
    ] = None,
    journal: Journal = False,
    as_json: AsJson = False,
) -> None:
    """How large a kick does steady sliding survive? Ctrl-C keeps what there is."""
    from steadyslip.cli.cycle_files import KICKED, thresholds_of_file, write_thresholds
    from steadyslip.files.output import check_output

    check_output(output or (), KICKED)
    found = thresholds_of_file(rig, changes or (), kick or (), reverse, reference, at, up_to)
    wanted = [path for path in output or () if not found.interrupted or path.suffix == ".html"]
    if len(wanted) < len(output or ()):
        typer.secho("stopped: the basin is not drawn", err=True)
    output_result(found, wanted, as_json, partial(write_thresholds, source=rig))


def response(
    rig: RigFile,
    changes: Changes = None,
    swings: Annotated[
        str, typer.Option("--input", help="what swings: normal-stress, drive-velocity, push or injection")
    ] = "normal-stress",
    answers: Annotated[
        str | None, typer.Option("--output", help="observable that answers: friction, shear-stress, v, guide.friction")
    ] = None,
    on: Annotated[str | None, typer.Option(help="of a machine: the contact or body on which the input acts")] = None,
    periods: Annotated[tuple[str, str], typer.Option(help="shortest and longest, such as 0.1s 1000s")] = (
        "0.1 s", "1000 s",
    ),
    points: Annotated[int, typer.Option(min=2, max=1000, help="periods from the one to the other")] = 41,
    amplitudes: Annotated[
        list[str] | None, typer.Option("--amplitude", help="simulate it, such as '1 MPa'; repeatable")
    ] = None,
    limits: Annotated[
        bool, typer.Option("--limits", help="amplitudes up to which it is linear and from which sliding is lost")
    ] = False,
    files: Annotated[
        list[Path] | None, typer.Option("-o", help="write .csv, .html, or a Bode plot: .png, .svg or .pdf; repeatable")
    ] = None,
    journal: Journal = False,
    as_json: AsJson = False,
) -> None:  # fmt: skip
    """Gain and phase of steady sliding under an input that swings: exact for small amplitudes, simulated for large."""
    from steadyslip.cli.cycle_files import ANSWERED, response_of_file, write_answers
    from steadyslip.files.output import check_output

    check_output(files or (), ANSWERED)
    found = response_of_file(rig, changes or (), periods, points, amplitudes or (), swings, answers, on, limits)
    output_result(found, files or (), as_json, partial(write_answers, title="Response", source=rig))


def hunt(
    rig: RigFile,
    changes: Changes = None,
    until: Annotated[
        str | None, typer.Option(help="end, such as '200 s'; where it rests or a cycle repeats itself unless given")
    ] = None,
    pieces: Pieces = None,
    output: Annotated[list[Path] | None, outputs("write .csv, .html, .png, .svg or .pdf")] = None,
    journal: Journal = False,
    rtol: Annotated[float, typer.Option(help="error of the motion allowed per step, with bristles")] = 1e-8,
    require_settled: Annotated[
        bool, typer.Option("--require-settled", help="exit with status 1 unless it settles")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Does an axis that is held (velocity = 0) hunt about its target, how far and how often, or settle?"""
    from steadyslip.cli.cycle_files import ANSWERED, hunt_of_file, write_answers
    from steadyslip.files.output import check_output

    check_output(output or (), ANSWERED)
    found = hunt_of_file(rig, changes or (), pieces or (), until, rtol)
    output_result(found, output or (), as_json, partial(write_answers, title="Hunting", source=rig))
    if require_settled and found.hunts is not False:
        raise typer.Exit(1)


def verdicts(
    rig: RigFile,
    changes: Changes = None,
    until: Until = None,
    pieces: Pieces = None,
    output: Annotated[list[Path] | None, outputs("write .csv, .html, .png, .svg or .pdf")] = None,
    journal: Journal = False,
    rtol: Annotated[float, typer.Option(help="error of the motion allowed per step")] = 1e-7,
    as_json: AsJson = False,
) -> None:
    """Is it stable at every moment of a protocol of slow changes, and when does motion depart?"""
    from steadyslip.cli.cycle_files import ANSWERED, verdicts_of_file, write_answers
    from steadyslip.files.output import check_output

    check_output(output or (), ANSWERED)
    found = verdicts_of_file(rig, changes or (), pieces or (), until, rtol)
    output_result(found, output or (), as_json, partial(write_answers, title="Verdicts", source=rig))

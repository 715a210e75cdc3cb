"""``hippodrome eval``, ``render`` and ``report``: the whole chain, its recordings alone, and its report alone."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

from hippodrome.eval.commands.arguments import (
    DONE,
    THRESHOLD_FAILED,
    add_command,
    add_methods,
    add_out,
    add_scenarios,
    add_workers,
)


def add_run_commands(commands: Any) -> None:
    """Adds them to the parser's ``commands``."""
    evaluate = add_command(
        commands, "eval", _evaluate, "run scenarios end to end and score them",
        """Drive, render, map, refine, localize and score one or more scenarios.

        For each scenario a town is generated or read, and two drives are simulated in it. A map is built from the first drive,
        refined with the road network, and the second drive is localized in it. All methods are scored against the simulator's
        truth.

        Writes DIR/results.json (every figure with its definition), DIR/table1.md, DIR/report.html (one page that needs no
        network) and, for each scenario, a folder with maps (.pbstream), trajectories (TUM) and figures (PNG, SVG, PDF).

        Exits with 1 if a threshold of a scenario does not hold.""",
        ["hippodrome eval scenarios/towns/rural.yaml --out out/rural",
         "hippodrome eval my-town.yaml --network my_town.net.xml --seed 7 --workers 2",
         "hippodrome eval scenarios/towns/grid.yaml --method my_package.my_module:MyMapper"],
    )  # fmt: skip
    add_scenarios(evaluate, several=True)
    add_methods(evaluate)
    add_workers(evaluate)
    add_out(evaluate, "out/eval")

    render = add_command(
        commands, "render", _render, "make the recordings of a scenario only",
        """Simulate and draw the two drives of one scenario, without mapping or scoring anything.

        Writes two recordings, DIR/recordings/NAME-mapping-KEY and NAME-localization-KEY, each with its frames, the sensed
        self-motion and the truth, and prints where they are. `hippodrome map` and `localize` read them. The town's network lies
        in DIR/towns.""",
        ["hippodrome render scenarios/towns/grid.yaml --out out/grid"],
    )  # fmt: skip
    add_scenarios(render, several=False)
    add_workers(render)
    add_out(render, "out/render")

    report = add_command(
        commands, "report", _report, "write the report of a run anew",
        """Make DIR/report.html anew from DIR/results.json and the files beside it, and print where it is.

        The report is one page that needs no network: tables, figures, an interactive map, and the worst places with their
        frames. With --figures all figures of the run are gathered in a folder too, for a paper: as PDF and SVG, whose lines and
        letters stay sharp at any size, and as PNG.""",
        ["hippodrome report out/eval",
         "hippodrome report out/eval --open",
         "hippodrome report out/eval --figures out/figures"],
    )  # fmt: skip
    report.add_argument(
        "--figures", type=Path, metavar="FOLDER",
        help="copy every figure to this new folder as SCENARIO-FIGURE.pdf, .svg and .png (default: they stay in the scenarios' "
             "folders)",
    )  # fmt: skip
    report.add_argument("--open", action="store_true", help="show the page in the browser, too (default: say where it is)")
    report.add_argument(
        "results", type=Path, metavar="DIR", help="the folder that `hippodrome eval` wrote, with results.json in it"
    )


def _evaluate(options: argparse.Namespace) -> int:
    from hippodrome.eval.run import evaluate

    holds = evaluate(options.scenarios, options.network, options.seed, options.workers, options.out, options.method)
    return DONE if holds else THRESHOLD_FAILED


def _render(options: argparse.Namespace) -> int:
    from hippodrome.eval.run import render

    render(options.scenarios, options.network, options.seed, options.workers, options.out)
    return DONE


def _report(options: argparse.Namespace) -> int:
    from hippodrome.eval.report.report import write_report

    page = write_report(options.results)
    print(page)
    if options.figures is not None:
        from hippodrome.eval.report.export import export_figures

        print("\n".join(export_figures(options.results, options.figures)))
    if options.open:
        show(page.resolve().as_uri())
    return DONE


def show(address: str) -> None:
    """Show a page in the user's browser; where there is none, say so on standard error."""
    import webbrowser

    if not webbrowser.open(address):
        print(f"{address}: no browser to show it in was found; open it in one", file=sys.stderr)

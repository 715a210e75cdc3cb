"""``hippodrome eval``, ``render`` and ``report``: the whole chain."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from hippodrome.eval.commands.arguments import DONE, THRESHOLD_FAILED, add_out, add_scenarios, add_workers


def add_run_commands(commands: Any) -> None:
    """Adds them to the parser's ``commands``."""
    evaluate = commands.add_parser("eval", help="run scenarios end to end and score them", description=_evaluate.__doc__)
    add_scenarios(evaluate, several=True)
    add_workers(evaluate)
    add_out(evaluate, "out/eval")
    evaluate.set_defaults(command=_evaluate)

    render = commands.add_parser("render", help="make the recordings of a scenario only", description=_render.__doc__)
    add_scenarios(render, several=False)
    add_workers(render)
    add_out(render, "out/render")
    render.set_defaults(command=_render)

    report = commands.add_parser("report", help="write DIR/report.html anew", description=_report.__doc__)
    report.add_argument("results", type=Path, metavar="DIR", help="folder with results.json")
    report.set_defaults(command=_report)


def _evaluate(options: argparse.Namespace) -> int:
    """Drive, render, map, refine, localize and score each scenario; writes DIR/results.json, tables and figures."""
    from hippodrome.eval.run import evaluate

    return DONE if evaluate(options.scenarios, options.network, options.seed, options.workers, options.out) else THRESHOLD_FAILED


def _render(options: argparse.Namespace) -> int:
    """Simulate and draw the mapping and the localization drive of one scenario, without evaluating them."""
    from hippodrome.eval.run import render

    render(options.scenarios, options.network, options.seed, options.workers, options.out)
    return DONE


def _report(options: argparse.Namespace) -> int:
    """Make DIR/report.html from DIR/results.json and the files beside it."""
    from hippodrome.eval.report.report import write_report

    print(write_report(options.results))
    return DONE

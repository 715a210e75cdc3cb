"""The command line of ``hippodrome scenario``."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

from hippodrome.eval.commands.arguments import BAD_INPUT, DONE


def add_scenario_command(commands: Any) -> None:
    """Adds ``scenario`` with its four subcommands to the parser's ``commands``."""
    parser = commands.add_parser("scenario", help="write, check and preview scenarios", description=__doc__)
    actions = parser.add_subparsers(required=True, metavar="ACTION")

    new = actions.add_parser("new", help="write a commented scenario for a road network", description=_new.__doc__)
    new.add_argument("name", metavar="NAME")
    new.add_argument("--from", dest="source", required=True, metavar="SOURCE",
                     help="rural, grid, radial, random, or a .net.xml, .osm (also .gz, .pbf) or .xodr file")  # fmt: skip
    new.add_argument("--out", type=Path, metavar="FILE", help="default: NAME.yaml")
    new.set_defaults(command=_new)

    validate = actions.add_parser("validate", help="check scenarios and their networks", description=_validate.__doc__)
    validate.add_argument("files", type=Path, nargs="+", metavar="FILE")
    validate.set_defaults(command=_validate)

    preview = actions.add_parser("preview", help="both drives and a few frames, in seconds", description=_preview.__doc__)
    preview.add_argument("files", type=Path, nargs="+", metavar="FILE")
    preview.add_argument(
        "--out", type=Path, default=Path("out/preview"), metavar="DIR", help="pictures go to DIR/NAME (default: out/preview)"
    )
    preview.set_defaults(command=_preview)

    schema = actions.add_parser("schema", help="print the JSON schema of a scenario", description=_schema.__doc__)
    schema.set_defaults(command=_schema)


def _new(options: argparse.Namespace) -> int:
    """Write a commented scenario whose values suit the road network."""
    from hippodrome.eval.authoring.draft import new_scenario

    path = options.out or Path(f"{options.name}.yaml")
    draft = new_scenario(options.name, options.source, path)
    for note in draft.notes:
        print(f"note: {note}")
    print(f"{path}: written; {draft.drivable_km:.2f} km to drive, mapping tour {draft.tour_m:.0f} m\n"
          f"next: hippodrome scenario preview {path}")  # fmt: skip
    return DONE


def _validate(options: argparse.Namespace) -> int:
    """Check files, keys, values and road networks; names file, line and key. Exit status 2 if a file cannot be used."""
    from hippodrome.eval.authoring.check import check_scenario

    failed = False
    for path in options.files:
        finding = check_scenario(path)
        failed |= bool(finding.errors)
        if finding.errors:
            print("\n".join(finding.errors), file=sys.stderr)
            continue
        print(f"{path}: ok: {finding.summary}")
        for note in finding.notes:
            print(f"{path}: note: {note}")
    return BAD_INPUT if failed else DONE


def _preview(options: argparse.Namespace) -> int:
    """Simulate both drives of each scenario, draw them from above and a few frames; prints statistics."""
    from hippodrome.eval.authoring.preview import preview_scenario
    from hippodrome.eval.files.scenarios import read_scenario

    for path in options.files:
        scenario = read_scenario(path)
        out = options.out / scenario.name
        print("\n".join(preview_scenario(scenario, out).lines()))
        print(f"pictures: {out / 'overview.png'}, {out / 'stills.png'}")
    return DONE


def _schema(_: argparse.Namespace) -> int:
    """Print the JSON schema of a scenario; editors complete and check with it."""
    from hippodrome.eval.authoring.schema import schema_text

    print(schema_text())
    return DONE

"""``hippodrome scenario``: write, check and preview scenarios."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

from hippodrome.eval.commands.arguments import BAD_INPUT, DONE, add_command, add_group, positive_number, print_listed


def add_scenario_command(commands: Any) -> None:
    """Adds ``scenario`` with its five sub-commands to the parser's ``commands``."""
    actions = add_group(
        commands, "scenario", "write, check and preview scenarios",
        """Write, check and preview scenarios.

        A scenario is a YAML file that says where to drive, what is seen, how the two drives go, and which limits the figures must
        keep. docs/authoring.md goes from a map to a scenario; docs/scenarios.md lists every key.""",
        ["hippodrome scenario new my-town --from grid", "hippodrome scenario preview my-town.yaml"],
    )  # fmt: skip

    new = add_command(
        actions, "new", _new, "write a commented scenario for a road network",
        """Write a commented scenario whose values suit a road network.

        A map that is not SUMO's is imported once: its network is written beside the scenario, as NAME.net.xml.gz. What is odd
        about the network is said with its place and what to do. Nothing that exists is overwritten.""",
        ["hippodrome scenario new my-town --from my_town.osm",
         "hippodrome scenario new my-grid --from grid --out scenarios/my-grid.yaml",
         "hippodrome scenario new my-district --from my_town.osm --around 49.6116,6.1319 --radius 800"],
    )  # fmt: skip
    new.add_argument("name", metavar="NAME", help="the scenario's name, under which its results are filed")
    new.add_argument(
        "--from", dest="source", required=True, metavar="SOURCE",
        help="where to drive: a town to be generated (rural, grid, radial or random), or a map's file: SUMO (.net.xml, "
             ".net.xml.gz), OpenStreetMap (.osm, .osm.gz, .osm.pbf) or OpenDRIVE (.xodr)",
    )  # fmt: skip
    new.add_argument(
        "--driving-side", choices=("auto", "left", "right"), default="auto",
        help="where traffic keeps in a generated town or a map that is imported (default: auto, as the map's roundabouts, tags, "
             "rules or place say, else right; what is found is told in a note)",
    )  # fmt: skip
    new.add_argument(
        "--around", metavar="LAT,LON",
        help="cut a circle out of a large map, with this place in degrees as its middle (or xy:X,Y, in the metres of a SUMO "
             "network), written beside the scenario (default: all of the map)",
    )  # fmt: skip
    new.add_argument(
        "--radius", type=positive_number, default=1000.0, metavar="METRES", help="of the circle of --around (default: 1000)"
    )
    new.add_argument("--out", type=Path, metavar="FILE", help="file for the scenario (default: NAME.yaml)")

    validate = add_command(
        actions, "validate", _validate, "check scenarios and their networks",
        """Check the keys and values of scenarios, and whether their road networks can be driven.

        Lists every error with file, line, key and cure, and what is odd about a network. Nothing is run or written. Exits with 2
        if a file cannot be used.""",
        ["hippodrome scenario validate my-town.yaml"], light=True,
    )  # fmt: skip
    validate.add_argument("files", type=Path, nargs="+", metavar="FILE", help="a scenario's file")

    preview = add_command(
        actions, "preview", _preview, "see both drives and a few frames, in seconds",
        """Simulate both drives of each scenario, without mapping anything, and draw them.

        Writes DIR/NAME/overview.png (the roads and both drives from above, and what is driven more than once) and
        DIR/NAME/stills.png (a few frames of each drive), and prints how much of the roads is seen.""",
        ["hippodrome scenario preview my-town.yaml"],
    )  # fmt: skip
    preview.add_argument("files", type=Path, nargs="+", metavar="FILE", help="a scenario's file")
    preview.add_argument(
        "--out", type=Path, default=Path("out/preview"), metavar="DIR",
        help="pictures go to DIR/NAME, with the scenario's name (default: out/preview)",
    )  # fmt: skip

    add_command(
        actions, "list", _list_scenarios, "list the scenarios that come with hippodrome",
        """Print a line for each scenario that comes with hippodrome: its name, and what it is. `hippodrome eval` and the other
        commands take the name in place of a file, as in `hippodrome eval towns/rural`.""",
        ["hippodrome scenario list"], light=True,
    )  # fmt: skip

    add_command(
        actions, "schema", _schema, "print the JSON schema of a scenario",
        """Print the JSON schema of a scenario, with the meaning of each key. Editors complete and check with it.""",
        ["hippodrome scenario schema > scenario.schema.json"], light=True,
    )  # fmt: skip


def _new(options: argparse.Namespace) -> int:
    from hippodrome.eval.authoring.draft import new_scenario
    from hippodrome.sim.net_cut import parse_around

    path = options.out or Path(f"{options.name}.yaml")
    around = parse_around(options.around, options.radius) if options.around else None
    draft = new_scenario(options.name, options.source, path, options.driving_side, around)
    for note in draft.notes:
        print(f"note: {note}")
    print(f"{path}: written; {draft.drivable_km:.2f} km to drive, mapping tour {draft.tour_m:.0f} m\n"
          f"next: hippodrome scenario preview {path}")  # fmt: skip
    return DONE


def _validate(options: argparse.Namespace) -> int:
    from hippodrome.eval.commands.scenario_files import has_faults

    failed = False
    for path in options.files:
        if has_faults([path]):
            failed = True
            continue
        from hippodrome.eval.authoring.check import check_scenario  # not before it is needed: faults are said at once

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
    from hippodrome.sim.render.probe import gl_tried_beside

    with gl_tried_beside() as require_gl:  # begun first: the next line takes as long as the trial
        from hippodrome.eval.authoring.preview import preview_scenario
        from hippodrome.eval.files.scenarios import read_scenario

        for path in options.files:
            scenario = read_scenario(path)
            out = options.out / scenario.name
            print("\n".join(preview_scenario(scenario, out, require_gl).lines()))
            print(f"pictures: {out / 'overview.png'}, {out / 'stills.png'}")
    return DONE


def _list_scenarios(_: argparse.Namespace) -> int:
    from hippodrome.eval.files.shipped import names

    for name, comment in names():
        print_listed(f"{name:<22}", comment)
    return DONE


def _schema(_: argparse.Namespace) -> int:
    from hippodrome.eval.authoring.schema import schema_text

    print(schema_text())
    return DONE

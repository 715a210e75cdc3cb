"""``hippodrome export``: results and recordings in the formats of other tools."""

from __future__ import annotations

import json
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

from hippodrome.eval.exchange.drives.errors import ExchangeError
from hippodrome.eval.exchange.drives.exported import ExportedDrive, gather_drives
from hippodrome.eval.exchange.drives.folder import new_folder
from hippodrome.eval.exchange.drives.on_earth import placed_file
from hippodrome.eval.exchange.extra import optional_module

# Format -> module below ``formats``. Those with packages of the extra are imported only when they are asked for.
FORMATS: Final = {
    "tum": "tum",
    "kitti": "kitti",
    "euroc": "euroc",
    "mcap": "mcap_file",
    "rerun": "rerun_file",
    "evo": "evo_results",
    "rosbag2": "rosbag2_folder",
    "gpx": "gpx",
    "geojson": "geojson",
}
ABOUT: Final = "about.json"


def export(folder: Path, to: str, network: Path | None, out: Path) -> None:
    """Write all drives below ``folder`` in another tool's format, and say what was written.

    Args:
        folder: A recording, the results of a scenario, or those of a whole run.
        to: A key of ``FORMATS``.
        network: The road network's file, where it does not lie beside the results.
        out: A folder that does not exist yet. ``about.json`` in it says what is where, in which frames and units.

    Raises:
        HippodromeError: The folder has nothing to export, or ``out`` cannot be written; then nothing is left.
    """
    writer = optional_module(f"hippodrome.eval.exchange.formats.{FORMATS[to]}")
    if folder.is_file():
        _export_file(folder, to, network, out, writer)
        return
    drives = gather_drives(folder, network)
    with new_folder(out) as building:
        writer.write(drives, building)
        text = json.dumps(_about(to, writer.CONVENTIONS, drives), indent=1) + "\n"
        (building / ABOUT).write_text(text, encoding="utf-8")
    files = [path for path in out.rglob("*") if path.is_file()]
    size = sum(path.stat().st_size for path in files)
    print(f"{out}: {len(drives)} drive(s) as {to}, {len(files)} files, {size / 1e6:.1f} MB; conventions in {out / ABOUT}")
    for drive in drives:
        if drive.network is None:
            print(f"note: {drive.name}: its road network was not found and is left out; name it with --network")


def _export_file(source: Path, to: str, network: Path | None, out: Path, writer: Any) -> None:
    """Write one map or trajectory. Raises ExchangeError for the formats that need whole drives."""
    if not hasattr(writer, "write_one"):
        raise ExchangeError(f"{source}: --to {to} takes a folder of results or a recording; single files go to gpx and geojson")
    if network is None:
        raise ExchangeError(f"{source}: nobody knows where on Earth it lies; name its road network with --network")
    with new_folder(out) as building:
        writer.write_one(placed_file(source, network), building)
        about = {"made_by": f"hippodrome {version('hippodrome')}", "format": to, "conventions": list(writer.CONVENTIONS)}
        (building / ABOUT).write_text(json.dumps(about, indent=1) + "\n", encoding="utf-8")
    print(f"{out}: {source.name} as {to}; conventions in {out / ABOUT}")


def _about(to: str, conventions: Sequence[str], drives: Sequence[ExportedDrive]) -> dict[str, Any]:
    return {
        "made_by": f"hippodrome {version('hippodrome')}",
        "format": to,
        "conventions": list(conventions),
        "drives": [
            {
                "name": drive.name,
                "recording": drive.recording.folder.name,
                "frames": drive.recording.frame_count,
                "truth": drive.truth is not None,
                "estimates": {method: estimate.frame for method, estimate in drive.estimates.items()},
                "maps": list(drive.maps),
                "roads": drive.network is not None,
                "time_origin_s": drive.origin_ns() / 1e9,
                "maps_finished": drive.maps_finished,
                "truth_frame": drive.recording.manifest.get("truth_frame", "network"),
            }
            for drive in drives
        ],
    }

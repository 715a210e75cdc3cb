"""``hippodrome export``: results and recordings in the formats of other tools."""

from __future__ import annotations

import json
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

from hippodrome.eval.exchange.drives.exported import ExchangeError, ExportedDrive, gather_drives

# Format -> module below ``formats``. Those with packages of the extra are imported only when they are asked for.
FORMATS: Final = {
    "tum": "tum",
    "kitti": "kitti",
    "euroc": "euroc",
    "mcap": "mcap_file",
    "rerun": "rerun_file",
    "evo": "evo_results",
    "rosbag2": "rosbag2_folder",
}
ABOUT: Final = "about.json"
EXTRA_PACKAGES: Final = ("evo", "foxglove_schemas_protobuf", "mcap", "mcap_protobuf", "rerun", "rosbags")


def export(folder: Path, to: str, network: Path | None, out: Path) -> None:
    """Write everything below ``folder`` as format ``to`` into the new folder ``out``."""
    writer = format_module(f"hippodrome.eval.exchange.formats.{FORMATS[to]}")
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


def format_module(name: str) -> Any:
    """A module that may need packages of the extra. Raises ExchangeError that names it."""
    try:
        return import_module(name)
    except ModuleNotFoundError as error:
        if (error.name or "").split(".")[0] not in EXTRA_PACKAGES:
            raise
        raise ExchangeError(
            f"the package '{(error.name or '').split('.')[0]}' is missing; install the extra: pip install 'hippodrome[exchange]'"
        ) from None


@contextmanager
def new_folder(out: Path) -> Iterator[Path]:
    """A folder to fill, which takes the name ``out`` when all is there. Nothing that exists is touched."""
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise ExchangeError(f"{out}: exists already; remove it or choose another --out")
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        building = Path(tempfile.mkdtemp(prefix=f".{out.name}.", suffix=".part", dir=out.parent))
    except OSError as error:
        raise ExchangeError(f"{out}: cannot be written: {error.strerror}") from None
    try:
        yield building
        building.chmod(0o755)
        building.replace(out)
    except OSError as error:
        raise ExchangeError(f"{out}: cannot be written: {error.strerror or error}") from error
    finally:
        shutil.rmtree(building, ignore_errors=True)


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
                "truth_frame": drive.recording.manifest.get("truth_frame", "network"),
            }
            for drive in drives
        ],
    }

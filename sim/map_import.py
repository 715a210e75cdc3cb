"""Maps of other makers into SUMO networks: OpenStreetMap (also packed) and OpenDRIVE."""

from __future__ import annotations

import gzip
import hashlib
import tempfile
import zlib
from pathlib import Path
from typing import Final

from hippodrome._files import replacing, sha256_of
from hippodrome.core.types import HippodromeError
from hippodrome.sim.sumo_tools import run_tool

SUMO: Final = (".net.xml", ".net.xml.gz")
OSM: Final = (".osm", ".osm.xml", ".osm.gz", ".osm.bz2", ".osm.pbf", ".pbf")
OPENDRIVE: Final = (".xodr", ".xodr.gz")
IMPORTED: Final = (*OSM, *OPENDRIVE)
KNOWN: Final = (*SUMO, *IMPORTED)
MAX_UNPACKED_BYTES: Final = 512 << 20  # a city of a million; netconvert needs some ten times as much memory
PIECE_BYTES: Final = 1 << 20

# What SUMO's own OSM web wizard sets, as far as it concerns cars, and no more.
OSM_OPTIONS: Final[tuple[str, ...]] = (
    "--keep-edges.by-vclass=passenger",  # footways and rails have no part in a drive
    "--remove-edges.isolated=true",
    "--geometry.remove=true",  # nodes that are no crossings become bends
    "--roundabouts.guess=true",
    "--junctions.join=true",  # the four nodes of two dual carriageways are one crossing
    "--tls.discard-simple=true",
    "--tls.join=true",
    "--tls.guess-signals=true",  # signals are often drawn on the approaches, not on the crossing
    "--ramps.guess=true",
    "--junctions.corner-detail=5",
    "--no-turnarounds.except-deadend=true",  # nobody turns round in the middle of a street
    "--output.street-names=true",
)
OPENDRIVE_OPTIONS: Final[tuple[str, ...]] = (
    "--keep-edges.by-vclass=passenger",
    "--opendrive.curve-resolution=1",  # m between points of an arc: 2 cm off at 6 m radius
    "--geometry.min-dist=0.5",  # where arcs meet lines, points lie on one another
    "--junctions.corner-detail=5",
)


def is_foreign(name: str) -> bool:
    """Whether a file of this name has to be imported."""
    return name.endswith(IMPORTED)


def import_recipe(source: Path) -> str:
    """What the import of a map depends on, in twelve digits."""
    if not source.is_file():
        raise HippodromeError(f"{source}: no such file; give {', '.join(KNOWN)}")
    return hashlib.sha256(repr((sha256_of(source), OSM_OPTIONS, OPENDRIVE_OPTIONS)).encode()).hexdigest()[:12]


def import_map(source: Path, net_file: Path) -> None:
    """Write ``source`` as the SUMO network ``net_file`` (.net.xml.gz); the same map, the same bytes. Raises HippodromeError."""
    if not source.is_file():
        raise HippodromeError(f"{source}: no such file")
    if source.stat().st_size > MAX_UNPACKED_BYTES:
        raise _too_large(source)
    with tempfile.TemporaryDirectory() as folder:
        plain, made = Path(folder) / f"map{'.osm' if source.name.endswith(OSM) else '.xodr'}", Path(folder) / "made.net.xml"
        _unpack(source, plain)
        _convert(source, plain, made)
        with replacing(net_file) as temporary:
            temporary.write_bytes(gzip.compress(_without_comments(made.read_text(encoding="utf-8")).encode(), mtime=0))


def _convert(source: Path, plain: Path, made: Path) -> None:
    is_osm = plain.suffix == ".osm"
    options = OSM_OPTIONS if is_osm else OPENDRIVE_OPTIONS
    try:
        run_tool("netconvert", f"--{'osm' if is_osm else 'opendrive'}-files={plain}", *options, f"--output-file={made}",
                 "--no-warnings=true")  # fmt: skip
    except HippodromeError as error:
        raise HippodromeError(f"{source}: cannot be imported: {error}") from error
    if not made.is_file():
        raise HippodromeError(f"{source}: holds no roads for cars; choose a larger extract")


def _without_comments(text: str) -> str:
    """netconvert's heading holds the date and paths of this machine."""
    before, _, rest = text.partition("<!--")
    return before + rest.partition("-->")[2].lstrip() if rest else text


def _unpack(source: Path, plain: Path) -> None:
    """A plain copy, of bounded size whatever the packed file claims."""
    if source.name.endswith((".pbf", ".bz2")):
        _unpack_osm(source, plain)
        return
    opened = gzip.open if source.suffix == ".gz" else open
    try:
        with opened(source, "rb") as packed, plain.open("wb") as out:
            while piece := packed.read(PIECE_BYTES):
                out.write(piece)
                if out.tell() > MAX_UNPACKED_BYTES:
                    raise _too_large(source)
    except (OSError, EOFError, zlib.error) as error:
        raise HippodromeError(f"{source}: cannot be read: {error}") from error


def _too_large(source: Path) -> HippodromeError:
    return HippodromeError(f"{source}: more than {MAX_UNPACKED_BYTES >> 20} MiB; cut out a smaller area (osmium extract)")


def _unpack_osm(source: Path, plain: Path) -> None:
    """What only libosmium reads; ways and the nodes they need suffice for roads."""
    try:
        import osmium
    except ImportError:
        raise HippodromeError(
            f"{source}: reading this kind of file needs the package osmium (pip install 'hippodrome[osm]'); "
            "or convert it with `osmium cat` to .osm"
        ) from None
    try:
        with osmium.BackReferenceWriter(str(plain), ref_src=str(source), remove_tags=False) as writer:
            for one in osmium.FileProcessor(str(source), osmium.osm.WAY | osmium.osm.RELATION):
                if "highway" in one.tags or one.tags.get("type") == "restriction":
                    writer.add(one)
    except RuntimeError as error:
        raise HippodromeError(f"{source}: cannot be read: {error}") from error

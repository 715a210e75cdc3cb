"""Maps of other makers into SUMO networks: OpenStreetMap (also packed) and OpenDRIVE."""

from __future__ import annotations

import gzip
import hashlib
import re
import zlib
from pathlib import Path
from typing import Final

from hippodrome._files import replacing, sha256_of, write_atomically
from hippodrome._folders import temporary_folder
from hippodrome.core.types import HippodromeError
from hippodrome.sim.sumo_tools import run_tool

SUMO: Final = (".net.xml", ".net.xml.gz")
OSM: Final = (".osm", ".osm.xml", ".osm.gz", ".osm.xml.gz", ".osm.bz2", ".osm.xml.bz2", ".osm.pbf", ".pbf")
OPENDRIVE: Final = (".xodr", ".xodr.gz")
IMPORTED: Final = (*OSM, *OPENDRIVE)
KNOWN: Final = (*SUMO, *IMPORTED)
MAX_UNPACKED_BYTES: Final = 512 << 20  # a city of a million; netconvert needs some ten times as much memory
PIECE_BYTES: Final = 1 << 20
MAX_NOTES: Final = 5  # kinds of warnings that are shown; the rest is counted
STRAIGHT_ENOUGH_M: Final = 1e-3  # a spiral that bends away from an arc by less is taken for one, which netconvert can compute
ISOLATED: Final = "--remove-edges.isolated=true"

# What SUMO's own OSM web wizard sets, as far as it concerns cars, and no more.
OSM_OPTIONS: Final[tuple[str, ...]] = (
    "--keep-edges.by-vclass=passenger",  # footways and rails have no part in a drive
    ISOLATED,
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
    """Whether a file of this name has to be imported; upper and lower case are the same."""
    return name.lower().endswith(IMPORTED)


def sumo_network(source: Path, folder: Path) -> tuple[Path, tuple[str, ...]]:
    """A road network of any kind as a SUMO network.

    Args:
        source: A SUMO network, which is taken as it is, or a map of another maker, which is imported once.
        folder: Where an imported network lies, under a name that its content and our options give.

    Returns:
        The network's file, and netconvert's notes about a map that was imported, those of an earlier import included.

    Raises:
        HippodromeError: The map cannot be imported.
    """
    if not is_foreign(source.name):
        return source, ()
    net_file = folder / f"{source.name.partition('.')[0]}-{import_recipe(source)}.net.xml.gz"
    notes_file = net_file.with_name(net_file.name.removesuffix(".net.xml.gz") + ".notes.txt")
    if not net_file.exists():
        folder.mkdir(parents=True, exist_ok=True)
        notes = import_map(source, net_file)
        if notes:
            write_atomically(notes_file, "".join(f"{note}\n" for note in notes).encode())
        return net_file, notes
    return net_file, tuple(notes_file.read_text(encoding="utf-8").splitlines()) if notes_file.exists() else ()


def import_recipe(source: Path) -> str:
    """What the import of a map depends on, in twelve digits."""
    if not source.is_file():
        raise HippodromeError(f"{source}: no such file; give {', '.join(KNOWN)}")
    return hashlib.sha256(repr((sha256_of(source), OSM_OPTIONS, OPENDRIVE_OPTIONS)).encode()).hexdigest()[:12]


def import_map(source: Path, net_file: Path) -> tuple[str, ...]:
    """Write ``source`` as the SUMO network ``net_file`` (.net.xml.gz); the same map, the same bytes.

    Returns what netconvert warned of and what was done about it, one line for each kind of warning.

    Raises:
        HippodromeError: The map cannot be read, is too large, or has no roads for cars.
    """
    if not source.is_file():
        raise HippodromeError(f"{source}: no such file")
    if source.stat().st_size > MAX_UNPACKED_BYTES:
        raise _too_large(source)
    with temporary_folder() as folder:
        ending = ".osm" if source.name.lower().endswith(OSM) else ".xodr"
        plain, made = folder / f"map{ending}", folder / "made.net.xml"
        _unpack(source, plain)
        notes = _convert(source, plain, made)
        with replacing(net_file) as temporary:
            temporary.write_bytes(gzip.compress(_without_comments(made.read_text(encoding="utf-8")).encode(), mtime=0))
    return notes


def _convert(source: Path, plain: Path, made: Path) -> tuple[str, ...]:
    """netconvert's network of a map, and the notes on it. Roads that join no other are kept where there is nothing else."""
    if plain.suffix == ".xodr":
        straightened = _with_arcs_for_arcs(plain)
        notes = _netconvert(source, plain, made, OPENDRIVE_OPTIONS)
        if straightened:
            notes = (f"{straightened} spiral(s) of constant curvature were read as arcs or lines", *notes)
    else:
        notes = _netconvert(source, plain, made, OSM_OPTIONS)
        if not _has_roads(made):
            made.unlink(missing_ok=True)
            _netconvert(source, plain, made, tuple(option for option in OSM_OPTIONS if option != ISOLATED))
            notes = ("no road of it joins another one; such roads are left out elsewhere, here they are all there is and kept",)
    if not _has_roads(made):
        raise HippodromeError(
            f"{source}: holds no roads for cars (footways, tracks and service roads are none); choose a larger extract"
        )
    return notes


def _netconvert(source: Path, plain: Path, made: Path, options: tuple[str, ...]) -> tuple[str, ...]:
    """Run netconvert, and what it warned of. It writes no file where there is no road. Raises HippodromeError."""
    log = made.with_name("warnings.txt")
    kind = "osm" if plain.suffix == ".osm" else "opendrive"
    try:
        run_tool("netconvert", f"--{kind}-files={plain}", *options, f"--output-file={made}", f"--error-log={log}")
    except HippodromeError as error:
        if "No edges loaded" in str(error):
            return ()
        raise HippodromeError(f"{source}: cannot be imported: {_with_cure(str(error))}") from error
    return _summed_up(log.read_text(encoding="utf-8", errors="replace").splitlines()) if log.exists() else ()


def _with_cure(reason: str) -> str:
    """netconvert's complaint; where it says nothing that a user understands, with what usually helps."""
    if "bad_alloc" in reason:
        return f"{reason}: netconvert ran out of memory on a curve; write its spirals as arcs, or choose a smaller extract"
    return reason


def _has_roads(made: Path) -> bool:
    """Whether a network that netconvert wrote has an edge outside of junctions."""
    if not made.is_file():
        return False
    with made.open(encoding="utf-8") as lines:
        return any("<edge " in line and 'function="' not in line for line in lines)


def _summed_up(log: list[str]) -> tuple[str, ...]:
    """Warnings that differ in names and numbers only, as one note with the first of them and their number."""
    kinds: dict[str, list[str]] = {}
    for line in log:
        if line.startswith("Warning: "):
            text = line.removeprefix("Warning: ").strip()
            kinds.setdefault(re.sub(r"'[^']*'|[-\d.]+", "#", text), []).append(text)
    notes = [f"netconvert: {same[0]}" + (f" ({len(same)} of this kind)" if len(same) > 1 else "") for same in kinds.values()]
    more = [f"netconvert: {len(notes) - MAX_NOTES} more kinds of warnings"] if len(notes) > MAX_NOTES else []
    return (*notes[:MAX_NOTES], *more)


SPIRAL: Final = re.compile(r'(<geometry\b[^>]*\blength="([^"]+)"[^>]*>\s*)<spiral\b([^>]*?)(?:/>|>\s*</spiral>)')
CURVATURE: Final = re.compile(r'\b(curvStart|curvEnd)="([^"]+)"')


def _with_arcs_for_arcs(plain: Path) -> int:
    """Write spirals that are arcs as arcs, in place, and count them: netconvert divides by the change of their curvature.

    A spiral of length L whose curvature changes by c lies within |c| L^2 / 8 of the arc of its mean curvature: the heading
    differs by at most |c| L / 8.
    """
    text = plain.read_text(encoding="utf-8", errors="surrogateescape")
    if "<spiral" not in text:
        return 0
    count = 0

    def arc(match: re.Match[str]) -> str:
        nonlocal count
        try:
            length_m = float(match[2])
            curvature = {name: float(value) for name, value in CURVATURE.findall(match[3])}
            change, mean = curvature["curvEnd"] - curvature["curvStart"], 0.5 * (curvature["curvEnd"] + curvature["curvStart"])
        except (ValueError, KeyError):
            return match[0]  # netconvert says what is wrong with it
        if not abs(change) * length_m**2 / 8.0 < STRAIGHT_ENOUGH_M:
            return match[0]
        count += 1
        return f'{match[1]}<arc curvature="{mean!r}"/>' if abs(mean) * length_m > 1e-9 else f"{match[1]}<line/>"

    changed = SPIRAL.sub(arc, text)
    if count:
        plain.write_text(changed, encoding="utf-8", errors="surrogateescape")
    return count


def _without_comments(text: str) -> str:
    """netconvert's heading holds the date and paths of this machine."""
    before, _, rest = text.partition("<!--")
    return before + rest.partition("-->")[2].lstrip() if rest else text


def _unpack(source: Path, plain: Path) -> None:
    """A plain copy, of bounded size whatever the packed file claims."""
    if source.name.lower().endswith((".pbf", ".bz2")):
        _unpack_osm(source, plain)
        return
    opened = gzip.open if source.suffix.lower() == ".gz" else open
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

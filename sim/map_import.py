"""Maps of other makers into SUMO networks: OpenStreetMap (also packed) and OpenDRIVE."""

from __future__ import annotations

import gzip
import hashlib
import zlib
from pathlib import Path
from typing import Final

from hippodrome._files import replacing, sha256_of, why_unreadable, write_atomically
from hippodrome._folders import temporary_folder
from hippodrome.core.types import HippodromeError
from hippodrome.sim.driving_side import Choice, DrivingSide, opendrive_side, osm_side
from hippodrome.sim.netconvert_notes import SPIRALS, netconvert_notes
from hippodrome.sim.opendrive import with_arcs_for_arcs, with_lanes_swapped
from hippodrome.sim.sumo_tools import run_tool
from hippodrome.sim.xml_head import opened, root_of

SUMO: Final = (".net.xml", ".net.xml.gz")
OSM: Final = (".osm", ".osm.xml", ".osm.gz", ".osm.xml.gz", ".osm.bz2", ".osm.xml.bz2", ".osm.pbf", ".pbf")
OPENDRIVE: Final = (".xodr", ".xodr.gz")
IMPORTED: Final = (*OSM, *OPENDRIVE)
KNOWN: Final = (*SUMO, *IMPORTED)
MAX_UNPACKED_BYTES: Final = 512 << 20  # a city of a million; netconvert needs some ten times as much memory
PIECE_BYTES: Final = 1 << 20
IMPORT: Final = "import:"  # begins the notes on an import that are complete in themselves
CURVE_RESOLUTION: Final = "--opendrive.curve-resolution"
LEFT_HAND: Final = ("--lefthand=true",)
IMPORTER: Final = 2  # raised where an import comes out otherwise than before, so that none made before is taken for it
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
    f"{CURVE_RESOLUTION}=1",  # m between points of an arc: 2 cm off at 6 m radius
    "--geometry.min-dist=0.5",  # where arcs meet lines, points lie on one another
    "--junctions.corner-detail=5",
)


def is_foreign(name: str) -> bool:
    """Whether a file of this name has to be imported; upper and lower case are the same."""
    return name.lower().endswith(IMPORTED)


def sumo_network(source: Path, folder: Path, driving_side: Choice = "auto") -> tuple[Path, tuple[str, ...]]:
    """A road network of any kind as a SUMO network.

    Args:
        source: A SUMO network, which is taken as it is, or a map of another maker, which is imported once.
        folder: Where an imported network lies, under a name that its content and our options give.
        driving_side: Where its traffic keeps; ``auto``: as the map says. A SUMO network says it itself.

    Returns:
        The network's file, and netconvert's notes about a map that was imported, those of an earlier import included.

    Raises:
        HippodromeError: The map cannot be imported.
    """
    if not is_foreign(source.name):
        return source, ()
    net_file = folder / f"{source.name.partition('.')[0]}-{import_recipe(source, driving_side)}.net.xml.gz"
    notes_file = net_file.with_name(net_file.name.removesuffix(".net.xml.gz") + ".notes.txt")
    if not net_file.exists():
        folder.mkdir(parents=True, exist_ok=True)
        notes = import_map(source, net_file, driving_side)
        if notes:
            write_atomically(notes_file, "".join(f"{note}\n" for note in notes).encode())
        return net_file, notes
    return net_file, tuple(notes_file.read_text(encoding="utf-8").splitlines()) if notes_file.exists() else ()


def import_recipe(source: Path, driving_side: Choice = "auto") -> str:
    """What the import of a map depends on, in twelve digits."""
    _require_file(source)
    recipe = sha256_of(source), OSM_OPTIONS, OPENDRIVE_OPTIONS, IMPORTER, driving_side
    return hashlib.sha256(repr(recipe).encode()).hexdigest()[:12]


def _require_file(source: Path) -> None:
    """Raise HippodromeError where there is no file, or a folder, a pipe or a device in its place."""
    if not source.is_file():
        reason = "not a file, but a folder, a pipe or a device" if source.exists() else "no such file"
        raise HippodromeError(f"{source}: {reason}; give {', '.join(KNOWN)}")


def import_map(
    source: Path, net_file: Path, driving_side: Choice = "auto", more_options: tuple[str, ...] = ()
) -> tuple[str, ...]:
    """Write ``source`` as the SUMO network ``net_file`` (.net.xml.gz); the same map, the same bytes.

    ``more_options`` are netconvert's, beside those of this project.

    Returns what netconvert warned of and what was done about it, one line for each kind of warning.

    Raises:
        HippodromeError: The map cannot be read, is too large, or has no roads for cars.
    """
    _require_file(source)
    if source.stat().st_size > MAX_UNPACKED_BYTES:
        raise _too_large(source)
    with temporary_folder() as folder:
        ending = ".osm" if source.name.lower().endswith(OSM) else ".xodr"
        plain, made = folder / f"map{ending}", folder / "made.net.xml"
        _unpack(source, plain)
        _require_root(source, plain, root_of(plain, named=source)[0])
        notes = _convert(source, plain, made, driving_side, more_options)
        with replacing(net_file) as temporary:
            temporary.write_bytes(gzip.compress(_without_comments(made.read_text(encoding="utf-8")).encode(), mtime=0))
    return notes


def _require_root(source: Path, plain: Path, root: str) -> None:
    """Raise HippodromeError unless the first element of a map is one of its kind: netconvert finds no roads in all others."""
    kind, wanted = ("OpenStreetMap", "osm") if plain.suffix == ".osm" else ("OpenDRIVE", "OpenDRIVE")
    if root.rpartition(":")[2] == wanted:
        return
    with plain.open("rb") as stream:
        head = stream.read(64).removeprefix(b"\xef\xbb\xbf").lstrip()
    if root:
        what = f"it begins with <{root}>, and {kind} with <{wanted}>"
        cure = "that is a web page, fetch the map itself" if root.lower() == "html" else "give it the name of its kind"
    elif head.startswith((b"{", b"[")):
        what, cure = f"it is JSON, and {kind} is XML here", "ask for XML ([out:xml]), or convert it"
    else:
        what, cure = ("it has no XML element", "is it whole?") if head else ("it is empty", "fetch it again")
    raise HippodromeError(f"{source}: cannot be imported: {what}; {cure}")


def _convert(source: Path, plain: Path, made: Path, choice: Choice, more: tuple[str, ...] = ()) -> tuple[str, ...]:
    """netconvert's network of a map, and the notes on it. Roads that join no other are kept where there is nothing else."""
    convert = _convert_opendrive if plain.suffix == ".xodr" else _convert_osm
    notes = convert(source, plain, made, choice, more)
    if not _has_roads(made):
        raise HippodromeError(f"{source}: holds no roads for cars{_why_none(_lines(_log_of(made)))}")
    return notes


def _why_none(log: list[str]) -> str:
    """Why a map has no roads for cars, and what to do, as the end of a sentence."""
    if at_rest := [line for line in log if "because it has speed" in line]:
        words = at_rest[0].removeprefix("Warning: ").rstrip(".")
        return f" that may move ({len(at_rest)} edges, netconvert: {words}); correct maxspeed there"
    return " (footways, tracks and service roads are none); choose a larger extract"


def _convert_osm(source: Path, plain: Path, made: Path, choice: Choice, more: tuple[str, ...]) -> tuple[str, ...]:
    side = osm_side(plain) if choice == "auto" else DrivingSide(choice)
    options = (*OSM_OPTIONS, *(LEFT_HAND if side.side == "left" else ()), *more)
    notes = _netconvert(source, plain, made, options)
    if not _has_roads(made):
        made.unlink(missing_ok=True)
        _netconvert(source, plain, made, tuple(option for option in options if option != ISOLATED))
        notes = (
            f"{IMPORT} no road of it joins another one; such roads are left out elsewhere, here they are all there is and kept",
        )
    return (*_side_notes(side), *notes)


def _convert_opendrive(source: Path, plain: Path, made: Path, choice: Choice, more: tuple[str, ...]) -> tuple[str, ...]:
    """Arcs are followed finely; where netconvert cannot do that, with its own default."""
    side = opendrive_side(plain) if choice == "auto" else DrivingSide(choice)
    straightened = with_arcs_for_arcs(plain)
    if side.side == "left":
        try:
            with_lanes_swapped(plain)
        except HippodromeError as error:
            raise HippodromeError(f"{source}: {error}; write it again with the tool that made it") from error
    options = (*OPENDRIVE_OPTIONS, *(LEFT_HAND if side.side == "left" else ()), *more)
    arcs = (f"{IMPORT} {straightened} spiral(s) of constant curvature were read as arcs or lines",) if straightened else ()
    try:
        notes = _netconvert(source, plain, made, options)
    except HippodromeError as error:
        coarser = tuple(option for option in options if not option.startswith(CURVE_RESOLUTION))
        try:
            notes = _netconvert(source, plain, made, coarser)
        except HippodromeError:
            raise error from None
        notes = (f"{IMPORT} netconvert could not follow its arcs metre by metre and drew them more coarsely", *notes)
    return (*arcs, *_side_notes(side), *notes)


def _side_notes(side: DrivingSide) -> tuple[str, ...]:
    if not side.reason:
        return ()
    other = "right" if side.side == "left" else "left"
    return (
        f"{IMPORT} traffic keeps {side.side}, for {side.reason}; if that is wrong, set town.driving_side: {other}, or "
        f"give scenario new --driving-side {other}",
    )


def _netconvert(source: Path, plain: Path, made: Path, options: tuple[str, ...]) -> tuple[str, ...]:
    """Run netconvert, and what it warned of. It writes no file where there is no road. Raises HippodromeError."""
    log = _log_of(made)
    kind = "osm" if plain.suffix == ".osm" else "opendrive"
    files = f"--{kind}-files={plain}", f"--output-file={made}", f"--error-log={log}"
    try:
        run_tool("netconvert", *files, *options, input_bytes=plain.stat().st_size)
    except HippodromeError as error:
        if _says_it_is_empty(str(error)):
            return ()
        reason = str(error).replace(f"{plain.parent}/", "")  # the user knows no folder of ours
        raise HippodromeError(f"{source}: cannot be imported: {_with_cure(reason, log)}") from error
    return netconvert_notes(_lines(log), made)


def _log_of(made: Path) -> Path:
    return made.with_name("warnings.txt")


def _lines(log: Path) -> list[str]:
    return log.read_text(encoding="utf-8", errors="replace").splitlines() if log.exists() else []


def _with_cure(reason: str, log: Path) -> str:
    """netconvert's complaint, with what usually helps."""
    if any(SPIRALS in line for line in _lines(log)):
        return f"{reason}: it cannot draw a spiral of it; write its spirals as arcs"
    if "bad_alloc" in reason or "crashed" in reason or "no answer" in reason:
        return f"{reason}: in general it is a curve or a number that cannot be; look for it, or cut out a smaller area"
    if "Cannot read file" in reason:
        return f"{reason}: the map includes that file; put what is in it in the place of the <include>"
    return f"{reason}: correct this place of the map, or write it again with the tool that made it"


def _says_it_is_empty(said: str) -> bool:
    """Whether netconvert found no roads in a map, or nothing at all, and knows of no other cause."""
    nothing_else = "Warning:" not in said and said.count("Error:") == 1
    return "No edges loaded" in said or ("No nodes loaded" in said and nothing_else)


def _has_roads(made: Path) -> bool:
    """Whether a network that netconvert wrote has an edge outside of junctions."""
    if not made.is_file():
        return False
    with made.open(encoding="utf-8") as lines:
        return any("<edge " in line and 'function="' not in line for line in lines)


def _without_comments(text: str) -> str:
    """netconvert's heading holds the date and paths of this machine."""
    before, _, rest = text.partition("<!--")
    return before + rest.partition("-->")[2].lstrip() if rest else text


def _unpack(source: Path, plain: Path) -> None:
    """A plain copy, of bounded size whatever the packed file claims."""
    if source.name.lower().endswith((".pbf", ".bz2")):
        _unpack_osm(source, plain)
        return
    try:
        with opened(source) as packed, plain.open("wb") as out:  # by its first bytes: names say packed of what is not, and not
            while piece := packed.read(PIECE_BYTES):
                out.write(piece)
                if out.tell() > MAX_UNPACKED_BYTES:
                    raise _too_large(source)
    except (OSError, EOFError, zlib.error) as error:
        raise HippodromeError(f"{source}: cannot be read: {why_unreadable(error)}") from error


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

"""Towns: generated from a seed with netgenerate and netconvert, or any SUMO network, OpenStreetMap or OpenDRIVE file."""

from __future__ import annotations

import gc
import hashlib
import math
import os
import re
import sys
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Final

import numpy as np
import shapely

from hippodrome._files import replacing
from hippodrome._folders import temporary_folder
from hippodrome.core.types import FloatArray, HippodromeError
from hippodrome.sim.driving_side import Choice
from hippodrome.sim.generators import Plan, closest_plan, grid_plan, radial_plan, through_nodes, without_dead_ends
from hippodrome.sim.map_import import LEFT_HAND, sumo_network
from hippodrome.sim.net_file import SumoNet, check_places_to_wait, is_left_hand, load_net, many_objects
from hippodrome.sim.net_heights import crossings_without_height, lane_heights_m, too_steep
from hippodrome.sim.net_notes import check_network
from hippodrome.sim.network import road_network
from hippodrome.sim.rural import rural_plan
from hippodrome.sim.sumo_tools import check_that_sumo_reads, run_tool
from hippodrome.sim.town_file import is_large, kept_town, write_town
from hippodrome.sim.town_reader import ENCODING, REFUSED, read_apart
from hippodrome.sim.town_spec import TownSpec
from hippodrome.sim.types import Town

LANE_WIDTH_M: Final = 3.2  # SUMO's default
POLE_SETBACK_M: Final = 0.8  # signal poles stand this far outside the carriageway
READER: Final = "hippodrome.sim.town"  # this module, which reads a network if it is run
MANY_LANES: Final = 5_000  # sumolib takes some 5 kB for each
# A disc that holds what the ego sweeps when it turns round between two lanes of 3.2 m, as measured.
TURNING_RADIUS_M: Final = 7.9
TURNING_ASIDE_M: Final = 2.2  # of its middle, from the road's axis
TURNING_BACK_M: Final = 3.3  # and before the road's end
MIN_RING_M: Final = 40.0  # a narrower ring leaves no room for houses between the streets

CROSSING_RADIUS_M: Final = 6.0  # kerb radius, so that a right turn follows 7.6 m rather than SUMO's 5.6 m
THROUGH_RADIUS_M: Final = 0.0  # where a road merely goes on under another number, no room for turning is needed
CONVERT_OPTIONS: Final = (
    "--no-turnarounds.except-deadend=true",  # nobody turns round in the middle of a street
    "--junctions.limit-turn-speed=2.5",  # m/s^2, what passengers accept
    "--junctions.internal-link-detail=10",
    "--junctions.corner-detail=5",
    "--offset.disable-normalization=true",
    "--no-warnings=true",
)


def build_town(spec: TownSpec, rng_seed: int, work_dir: Path) -> Town:
    """The town of a scenario. What is generated lies below ``work_dir``, named by its content's recipe, and is made once."""
    if spec.network is not None:
        net_file, notes = sumo_network(spec.network, work_dir, spec.driving_side)
        town = kept_town(net_file, work_dir, lambda: _that_sumo_reads(net_file))
        _check_side(spec.driving_side, town.left_hand, spec.network)
        return replace(town, notes=(*notes, *town.notes))
    what = spec.model_dump_json(exclude={"driving_side"} if spec.driving_side != "left" else None)
    recipe = f"{what} {rng_seed} {CONVERT_OPTIONS} {CROSSING_RADIUS_M} {THROUGH_RADIUS_M}"
    net_file = work_dir / f"{spec.kind}-{hashlib.sha256(recipe.encode()).hexdigest()[:12]}.net.xml"
    if not net_file.exists():
        _write_plan_as_net(_plan(spec, rng_seed), spec, net_file)
    return replace(read_town(net_file, name=spec.kind), rural=spec.kind == "rural")


def _that_sumo_reads(net_file: Path) -> Town:
    """A town from a network that somebody gives."""
    if is_large(net_file):
        return read_apart(net_file, READER, lambda: check_that_sumo_reads(net_file))
    town = read_town(net_file)
    check_that_sumo_reads(net_file)
    return town


def _check_side(choice: Choice, left_hand: bool, network: Path) -> None:
    """A SUMO network's streets cannot change sides. Raises HippodromeError where they would have to."""
    side = "left" if left_hand else "right"
    if choice not in ("auto", side):
        raise HippodromeError(
            f"{network}: its traffic keeps {side}, town.driving_side says {choice}; leave the key out, or import again the map "
            f"that the network was made of"
        )


def read_town(net_file: Path, name: str | None = None) -> Town:
    """A town from a SUMO network file, checked."""
    town = _read_town(net_file, name)
    if town.network.lane_count > MANY_LANES:
        gc.collect()  # sumolib's objects hold one another: hundreds of megabytes would wait for the next collection
    return town


@many_objects()
def _read_town(net_file: Path, name: str | None = None) -> Town:
    net = load_net(net_file)
    check_places_to_wait(net, net_file)
    network = road_network(net, net_file)
    left_hand = is_left_hand(net_file)
    town = Town(
        name=name or net_file.name.split(".")[0],
        net_file=net_file,
        network=network,
        junction_polygons_m=_junction_polygons(net),
        signals_m=_signals(net, left_hand),
        left_hand=left_hand,
        other_lanes_m=_other_lanes(net),
        turning_places_m=tuple(_turning_places(net, left_hand)),
        notes=check_network(net, network, net_file),
    )
    heights_m = lane_heights_m(net, network)
    notes = (*town.notes, *crossings_without_height(net, network, heights_m), *too_steep(network, heights_m))
    if heights_m is not None:
        outlines = (np.array(node.getShape3D(), dtype=np.float64) for node in _paved_nodes(net))
        town = replace(town, heights_m=heights_m, junction_heights_m=tuple(outline[:, 2] for outline in outlines))
    return replace(town, notes=notes)


def _plan(spec: TownSpec, rng_seed: int) -> Plan:
    """The plan whose two-way streets come closest to the wanted length; every size is drawn from the same seed."""
    width, height, length = spec.width_m, spec.height_m, 500.0 * spec.road_km
    if spec.kind == "rural":
        percent = range(100, 141, 8)  # of the wanted length: crossings take away from the streets
        return closest_plan(lambda size: rural_plan(width, height, 0.01 * size * length, _rng(rng_seed)), percent, length)
    if spec.kind == "grid":
        blocks = round(length**2 / (4.0 * width * height))  # of n x n blocks with side a: length 2 n (n + 1) a
        return closest_plan(
            lambda size: grid_plan(width, height, size, _rng(rng_seed)), range(max(1, blocks // 2), 2 * blocks + 2), length
        )
    if spec.kind == "radial":
        rings = range(1, max(2, int(min(width, height) / 2.0 / MIN_RING_M)) + 1)
        layouts = list(product(rings, range(4, 13)))
        return closest_plan(lambda i: radial_plan(width, height, *layouts[i], _rng(rng_seed)), range(len(layouts)), length)
    # Streets that fill the box with the wanted length are about 1.4 area / length long (planar pattern of mean degree 3).
    street_m = 1.4 * width * height / length
    # Dead ends are cut off afterwards, on some seeds two thirds of the network: hence sizes well above the wanted one.
    sizes = [round(share * length / street_m) for share in np.geomspace(0.7, 4.0, 11)]
    return closest_plan(lambda size: _random_plan(street_m, size, rng_seed), sizes, length)


def _rng(seed: int) -> np.random.Generator:
    return np.random.default_rng(seed)


def _random_plan(street_m: float, size: int, seed: int) -> Plan:
    """netgenerate's random network of about ``size`` streets, without its dead ends."""
    with temporary_folder() as folder:
        prefix = folder / "random"
        run_tool(
            "netgenerate", "--rand", f"--rand.iterations={size}", f"--seed={seed % 2**31}",
            f"--rand.min-distance={0.7 * street_m:.2f}", f"--rand.max-distance={1.6 * street_m:.2f}",
            "--rand.min-angle=50", "--rand.connectivity=0.95", "--no-warnings", f"--plain-output-prefix={prefix}",
        )  # fmt: skip
        return without_dead_ends(_read_plain(Path(f"{prefix}.nod.xml"), Path(f"{prefix}.edg.xml")))


def _read_plain(nodes_file: Path, edges_file: Path) -> Plan:
    """A plan from SUMO's plain XML; both directions of a street become one."""
    nodes = list(ElementTree.parse(nodes_file).getroot().iter("node"))
    number = {node.attrib["id"]: i for i, node in enumerate(nodes)}
    points = np.array([[float(node.attrib["x"]), float(node.attrib["y"])] for node in nodes])
    edges = ElementTree.parse(edges_file).getroot().iter("edge")
    ends = {(number[edge.attrib["from"]], number[edge.attrib["to"]]) for edge in edges}
    streets = tuple(sorted({(min(pair), max(pair)) for pair in ends}))
    return Plan(points, streets, tuple(points[list(street)] for street in streets))


def _write_plan_as_net(plan: Plan, spec: TownSpec, net_file: Path) -> None:
    """netconvert's network of a plan, atomically, and without its comments, which hold the date."""
    with temporary_folder() as folder:  # not beside the result: to netconvert a comma in a path separates two files
        nodes, edges, net = (folder / name for name in ("town.nod.xml", "town.edg.xml", "town.net.xml"))
        options = (*CONVERT_OPTIONS, *(LEFT_HAND if spec.driving_side == "left" else ()))
        nodes.write_text(_nodes_xml(plan), encoding="utf-8")
        edges.write_text(_edges_xml(plan, spec), encoding="utf-8")
        run_tool("netconvert", f"--node-files={nodes}", f"--edge-files={edges}", f"--output-file={net}", *options)
        _strip_comments(net)
        with replacing(net_file) as temporary:
            temporary.write_bytes(net.read_bytes())


def _nodes_xml(plan: Plan) -> str:
    radii = [THROUGH_RADIUS_M if through else CROSSING_RADIUS_M for through in through_nodes(plan)]
    rows = (
        f'<node id="{i}" x="{x:.2f}" y="{y:.2f}" type="priority" radius="{radius}"/>'
        for i, ((x, y), radius) in enumerate(zip(plan.nodes_m, radii, strict=True))
    )
    return "\n".join(["<nodes>", *rows, "</nodes>", ""])


def _edges_xml(plan: Plan, spec: TownSpec) -> str:
    """Each street as two edges, ``a-b`` and ``b-a``, so that a name tells where it leads."""
    common = f'numLanes="{spec.lanes}" speed="{spec.speed_limit_mps:.2f}" width="{LANE_WIDTH_M}" spreadType="right"'
    rows = [
        f'<edge id="{a}-{b}" from="{a}" to="{b}" {common} shape="{_shape_text(points)}"/>'
        for (u, v), shape in zip(plan.streets, plan.shapes_m, strict=True)
        for a, b, points in ((u, v, shape), (v, u, shape[::-1]))
    ]
    return "\n".join(["<edges>", *rows, "</edges>", ""])


def _shape_text(points_m: FloatArray) -> str:
    return " ".join(f"{x:.2f},{y:.2f}" for x, y in points_m)


def _strip_comments(file: Path) -> None:
    text = file.read_text(encoding="utf-8")
    file.write_text(re.sub(r"<!--.*?-->\s*", "", text, flags=re.DOTALL), encoding="utf-8")


def _junction_polygons(net: SumoNet) -> tuple[FloatArray, ...]:
    """Paved outlines of the junctions that cars pass."""
    return tuple(np.array(node.getShape(), dtype=np.float64)[:, :2] for node in _paved_nodes(net))


def _other_lanes(net: SumoNet) -> tuple[FloatArray, ...]:
    """Outlines of all lanes that cars may not use, those of footpaths through junctions too."""
    lanes = [lane for edge in net.getEdges() for lane in edge.getLanes() if not lane.allows("passenger")]
    lines = [(np.array(lane.getShape(), dtype=np.float64).reshape(-1, 2), lane.getWidth()) for lane in lanes]
    strips = [shapely.LineString(line).buffer(0.5 * width, cap_style="flat") for line, width in lines if len(line) > 1]
    parts = shapely.get_parts(np.array(strips, dtype=object))
    return tuple(shapely.get_coordinates(part.exterior) for part in parts if not part.is_empty)


def _turning_places(net: SumoNet, left_hand: bool) -> Iterator[FloatArray]:
    """Discs (24, 2) at dead ends, on the side to which cars swing out."""
    angle = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    circle = TURNING_RADIUS_M * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    for edge in net.getEdges(withInternal=False):
        onward = [after for after, links in edge.getOutgoing().items() if any(link.allows("passenger") for link in links)]
        if len(onward) != 1 or onward[0].getToNode() is not edge.getFromNode():
            continue
        incoming = [other for other in edge.getToNode().getIncoming() if other.getFunction() != "internal"]
        if onward[0].getFromNode() is not edge.getToNode() or len(incoming) > 1:
            continue
        back, here = onward[0].getLanes()[-1].getShape()[0], edge.getLanes()[-1].getShape()[-2:]
        ahead = np.subtract(here[1], here[0])
        ahead /= max(float(np.linalg.norm(ahead)), 1e-9)
        aside = np.array([-ahead[1], ahead[0]]) * (-1.0 if left_hand else 1.0)
        yield 0.5 * np.add(here[1], back) + TURNING_ASIDE_M * aside - TURNING_BACK_M * ahead + circle


def _paved_nodes(net: SumoNet) -> list[SumoNet]:
    passed = (node for node in net.getNodes() if any(edge.allows("passenger") for edge in node.getIncoming()))
    return [node for node in passed if len(node.getShape()) >= 3]


def _signals(net: SumoNet, left_hand: bool) -> FloatArray:
    """Where approaches end at a traffic light or have to give way: (K, 3) pole position and driving direction."""
    rows = []
    for edge in net.getEdges(withInternal=False):
        links = [link for links in edge.getOutgoing().values() for link in links if link.allows("passenger")]
        controlled = any(link.getTLSID() for link in links)
        gives_way = len(links) > 1 and all(link.getState() in "mswz=" for link in links)
        if edge.allows("passenger") and (controlled or gives_way):
            rows.append(_beside_stop_line(edge.getLanes()[0], left_hand))
    return np.array(rows, dtype=np.float64).reshape(-1, 3)


def _beside_stop_line(lane: SumoNet, left_hand: bool) -> tuple[float, float, float]:
    (x0, y0), (x1, y1) = lane.getShape()[-2:]
    heading = math.atan2(y1 - y0, x1 - x0)
    aside = (0.5 * lane.getWidth() + POLE_SETBACK_M) * (1.0 if left_hand else -1.0)
    return x1 - aside * math.sin(heading), y1 + aside * math.cos(heading), heading


@many_objects()
def main(net_file: str, path: str) -> int:
    """Read a network and write the town, for ``read_apart``; the exit status."""
    try:
        write_town(Path(path), _read_town(Path(net_file)))
    except HippodromeError as error:
        sys.stdout.buffer.write(str(error).encode(*ENCODING))
        sys.stdout.buffer.flush()
        return REFUSED
    return 0


if __name__ == "__main__":
    os._exit(main(*sys.argv[1:]))  # the town is written: a second would go into the end of millions of objects

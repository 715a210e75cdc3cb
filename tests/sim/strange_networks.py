"""Small networks with the traits of public ones, made by netconvert of a few lines each."""

from __future__ import annotations

import math
import re
from pathlib import Path

from hippodrome.sim.sumo_tools import run_tool


def converted(folder: Path, nodes: str, edges: str, *options: str) -> Path:
    """The SUMO network that netconvert makes of plain nodes and edges."""
    (folder / "a.nod.xml").write_text(f"<nodes>{nodes}</nodes>")
    (folder / "a.edg.xml").write_text(f"<edges>{edges}</edges>")
    net_file = folder / "strange.net.xml"
    run_tool("netconvert", f"-n={folder}/a.nod.xml", f"-e={folder}/a.edg.xml", f"-o={net_file}", "--no-warnings", *options)
    return net_file


def node(name, x_m, y_m, **more):
    return f'<node id="{name}" x="{x_m}" y="{y_m}"{attributes(more)}/>'


def edge(ends, lanes="", **more):
    """An edge between two nodes with names of one letter."""
    return f'<edge id="{ends}" from="{ends[0]}" to="{ends[1]}"{attributes({"speed": 9, **more})}>{lanes}</edge>'


def both(*pairs, **more):
    return "".join(edge(ends, **more) + edge(ends[::-1], **more) for ends in pairs)


def attributes(more):
    return "".join(f' {name}="{value}"' for name, value in more.items())


def corners(side_m):
    return {"A": (0, 0), "B": (side_m, 0), "C": (side_m, side_m), "D": (0, side_m)}


def square(side_m=150.0, **more):
    return "".join(node(name, x, y, **more) for name, (x, y) in corners(side_m).items())


def motorway(folder):
    """Two carriageways of three lanes with 36 m/s, turned at the ends, with an exit and an entrance over a link road."""
    nodes = square(600) + node("E", 200, 0) + node("F", 400, 0) + node("G", 300, -80)
    ways = "".join(edge(ends, numLanes=3, speed=36) for ends in ("AE", "EF", "FB", "BC", "CD", "DA"))
    return converted(folder, nodes, ways + edge("EG", speed=14) + edge("GF", speed=14), "--ramps.guess")


def one_way_grid(folder):
    """Nine crossings of streets that have one direction each, in turn."""
    names = ("ABC", "DEF", "GHI")
    nodes = "".join(node(name, 90 * x, 90 * y) for y, row in enumerate(names) for x, name in enumerate(row))
    lines = ("ABC", "FED", "GHI", "GDA", "BEH", "IFC")
    return converted(folder, nodes, "".join(edge(line[i : i + 2]) for line in lines for i in (0, 1)))


def shared_space(folder):
    """A place of 25 m where six streets meet, all at walking pace."""
    arms = "BCDEFG"
    angle = [2 * math.pi * i / 6 for i in range(6)]
    ends = [node(n, 90 * math.cos(a), 90 * math.sin(a)) for n, a in zip(arms, angle, strict=True)]
    ring = [a + b for a, b in zip(arms, arms[1:] + "B", strict=True)]
    return converted(folder, node("A", 0, 0, radius=25) + "".join(ends), both(*(f"A{n}" for n in arms), *ring, speed=2))


def narrow_lanes(folder):
    """Lanes of half a metre."""
    return converted(folder, square(), both("AB", "BC", "CD", "DA", width=0.5))


def courts(folder):
    """Dead ends on both sides of one street."""
    nodes = square() + "".join(node(n, x, y) for n, x, y in (("E", 75, 0), ("F", 75, 40), ("G", 75, -40)))
    return converted(folder, nodes, both("AE", "EB", "BC", "CD", "DA", "EF", "EG"))


def opposite_overtaking(folder):
    """Roads on which SUMO may overtake on the lane of the oncoming traffic."""
    nodes = square(500)
    return converted(folder, nodes, both("AB", "BC", "CD", "DA", speed=20), "--opposites.guess", "--opposites.guess.fix-lengths")


def bus_lane_between(folder):
    """The middle one of three lanes is for buses: no car may cross it."""
    lanes = '<lane index="1" allow="bus"/>'
    return converted(folder, square(), "".join(edge(ends, lanes, numLanes=3) for ends in ("AB", "BC", "CD", "DA")))


def chain_of_short_edges(folder):
    """Edges of 0.3 m between two streets, as careless digitising leaves them."""
    nodes = square() + "".join(node(n, 75 + 0.3 * i, 0) for i, n in enumerate("EFGH"))
    return converted(folder, nodes, both("AE", "EF", "FG", "GH", "HB", "BC", "CD", "DA"))


def never_green(folder):
    """A traffic light whose program shows red for ever."""
    net_file = converted(folder, square(type="traffic_light"), both("AB", "BC", "CD", "DA", "AC"), "--junctions.corner-detail=0")
    red = re.sub(r'(<phase duration="[^"]*" +state=")([a-zA-Z]+)', lambda m: m[1] + "r" * len(m[2]), net_file.read_text())
    net_file.write_text(red)
    return net_file


def all_kinds_of_junctions(folder):
    """A zipper, stops on all ways, priority with stops, right before left, and a level crossing of a railway."""
    kinds = {"A": "allway_stop", "B": "priority_stop", "C": "right_before_left", "D": "zipper"}
    nodes = "".join(node(name, x, y, type=kinds[name]) for name, (x, y) in corners(150).items())
    rails = node("R", 75, 0, type="rail_crossing") + node("S", 75, -60) + node("T", 75, 60)
    tracks = edge("SR", allow="rail") + edge("RT", allow="rail")
    return converted(folder, nodes + rails, both("AR", "RB", "BC", "CD", "DA", "AC") + tracks)


def far_away(folder):
    """Coordinates of a map projection, 5,000 km from their origin, and longer in SUMO's books than drawn."""
    nodes = "".join(
        node(n, 500_000 + x, 5_400_000 + y) for n, x, y in (("A", 0, 0), ("B", 150, 0), ("C", 150, 150), ("D", 0, 150))
    )
    return converted(folder, nodes, both("AB", "BC", "CD", "DA", length=450), "--offset.disable-normalization")


def cloverleaf_ramp(folder):
    """A ramp that turns by 270 degrees and crosses the road that it came from without a junction."""
    loop = " ".join(f"{300 + 40 * math.sin(a):.1f},{-40 + 40 * math.cos(a):.1f}" for a in (0.3 * i for i in range(1, 16)))
    nodes = square(300) + node("E", 260, -60)
    ways = both("AB", "BC", "CD", "DA") + edge("BE", shape=f"300,0 {loop} 260,-60") + edge("EA")
    return converted(folder, nodes, ways)


def turn_lanes(folder):
    """Four lanes that each lead to one exit only, so that lanes must be changed within 60 m, among much traffic."""
    net_file = folder / "strange.net.xml"
    run_tool("netgenerate", "--grid", "--grid.number=3", "--grid.length=60", "--default.lanenumber=3", "--turn-lanes=1",
             "--default-junction-type=traffic_light", "--seed=4", f"--output-file={net_file}", "--no-warnings")  # fmt: skip
    return net_file


def pedestrian_zone(folder):
    """Pavements, crossings and walking areas beside the lanes."""
    return converted(
        folder,
        square(),
        both("AB", "BC", "CD", "DA", "AC"),
        "--sidewalks.guess",
        "--sidewalks.guess.max-speed=20",
        "--crossings.guess",
    )


def walking_pace(folder):
    """A speed limit of half a metre a second in one street."""
    return converted(folder, square(60), edge("AB", speed=0.5) + edge("BC") + edge("CD") + edge("DA"))


def u_turns_only(folder):
    """A dual carriageway on which one comes back only by turning round at its ends, 800 m apart."""
    nodes = node("A", 0, 0) + node("B", 400, 0) + node("C", 800, 0)
    return converted(folder, nodes, both("AB", "BC", numLanes=2, speed=14))


def osm(folder: Path, ways: str, places: dict[int, tuple[float, float]]) -> Path:
    nodes = "".join(f'<node id="{i}" version="1" lat="{a:.7f}" lon="{o:.7f}"/>' for i, (a, o) in places.items())
    file = folder / "strange.osm"
    file.write_text(f'<osm version="0.6">{nodes}{ways}</osm>')
    return file


def way(number, nodes, **tags):
    refs = "".join(f'<nd ref="{n}"/>' for n in nodes)
    return f'<way id="{number}" version="1">{refs}{"".join(f"""<tag k="{k}" v="{v}"/>""" for k, v in tags.items())}</way>'


def roundabout(folder, clockwise=False):
    """A roundabout of two lanes with four approaches, joined outside by a ring road."""
    places = {i + 1: (48 + 0.0003 * math.sin(i * math.pi / 4), 2 + 0.00045 * math.cos(i * math.pi / 4)) for i in range(8)}
    places |= {i + 11: (48 + 0.0012 * math.sin(i * math.pi / 2), 2 + 0.0018 * math.cos(i * math.pi / 2)) for i in range(4)}
    ring = [1, 2, 3, 4, 5, 6, 7, 8, 1]
    ways = way(1, ring[::-1] if clockwise else ring, highway="secondary", junction="roundabout", lanes=2)
    ways += "".join(way(10 + i, (2 * i + 1, 11 + i), highway="secondary", lanes=2) for i in range(4))
    return osm(folder, ways + way(20, (11, 12, 13, 14, 11), highway="residential"), places)


def roundabout_left(folder):
    """The same in a country that keeps left."""
    return roundabout(folder, clockwise=True)


def ferry(folder):
    """Two islands with a ferry for cars between them."""
    places = {
        1: (48, 2),
        2: (48, 2.002),
        3: (48.0015, 2.002),
        4: (48.0015, 2),
        5: (48, 2.02),
        6: (48, 2.021),
        7: (48.0007, 2.021),
    }
    ways = way(1, (1, 2, 3, 4, 1), highway="residential") + way(3, (1, 3), highway="residential")
    ways += way(2, (5, 6, 7, 5), highway="residential") + way(4, (2, 5), route="ferry", motor_vehicle="yes")
    return osm(folder, ways, places)


def odd_tags(folder):
    """Streets that are one-way against their drawing, private, alternating, or tagged with words where numbers belong."""
    places = {1: (48, 2), 2: (48, 2.002), 3: (48.0015, 2.002), 4: (48.0015, 2)}
    ways = way(1, (1, 2), highway="residential", oneway="-1") + way(
        2, (1, 4, 3, 2), highway="residential", maxspeed="walk", lanes="two"
    )
    ways += way(3, (1, 3), highway="service", access="private") + way(4, (2, 4), highway="tertiary", oneway="alternating")
    return osm(folder, ways + way(5, (1, 2, 77), highway="footway"), places)

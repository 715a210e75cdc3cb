"""More small networks with the traits of public ones: junctions, lanes and roads that are seldom seen."""

from __future__ import annotations

import math
import re
from pathlib import Path

from tests.sim.strange_networks import both, converted, edge, node, osm, square, way


def turbo_roundabout(folder):
    """Two lanes that part for their exits, with no change between them."""
    ring = {"A": (30, 0), "B": (0, 30), "C": (-30, 0), "D": (0, -30)}
    outer = {"E": (130, 0), "F": (0, 130), "G": (-130, 0), "H": (0, -130)}
    nodes = "".join(node(n, x, y) for n, (x, y) in (ring | outer).items())
    lanes = '<lane index="0" changeLeft="authority"/><lane index="1" changeRight="authority"/>'
    circle = "".join(edge(ends, lanes, numLanes=2) for ends in ("AB", "BC", "CD", "DA"))
    return converted(folder, nodes, circle + both("AE", "BF", "CG", "DH", numLanes=2) + both("EF", "FG", "GH", "HE"))


def seven_arms(folder):
    """Seven streets at one signal where one may turn right on red."""
    angle = {n: 2 * math.pi * i / 7 for i, n in enumerate("BCDEFGH")}
    ends = "".join(node(n, 110 * math.cos(a), 110 * math.sin(a)) for n, a in angle.items())
    middle = node("A", 0, 0, type="traffic_light_right_on_red")
    ring = ("BC", "CD", "DE", "EF", "FG", "GH", "HB")
    return converted(folder, middle + ends, both(*(f"A{n}" for n in angle), numLanes=2) + both(*ring))


def lane_drops(folder):
    """Three lanes, of which two end in the middle of the road; then one that begins again."""
    nodes = square(300) + node("E", 100, 0) + node("F", 200, 0, type="zipper")
    ways = edge("AE", numLanes=3) + edge("EF", numLanes=1) + edge("FB", numLanes=4) + both("BC", "CD", "DA")
    return converted(folder, nodes, ways + edge("BF") + edge("FE", numLanes=2) + edge("EA"))


def lanes_to_nowhere(folder):
    """A third lane that no connection leaves: whoever is on it must change in time."""
    net_file = lane_drops(folder)
    kept = [line for line in net_file.read_text().splitlines(keepends=True) if not _leaves(line, "AE", "2")]
    net_file.write_text("".join(kept))
    return net_file


def _leaves(line: str, of: str, lane: str) -> bool:
    return f'<connection from="{of}"' in line and f'fromLane="{lane}"' in line


def bus_street(folder):
    """The short way across a square is for buses, taxis and those with a permit."""
    return converted(folder, square(200), both("AB", "BC", "CD", "DA") + both("AC", allow="bus taxi private hov"))


def buses_between_halves(folder):
    """Two quarters that only buses can go between."""
    nodes = square(120) + "".join(node(n, x, y) for n, x, y in (("E", 400, 0), ("F", 500, 0), ("G", 500, 90)))
    return converted(folder, nodes, both("AB", "BC", "CD", "DA", "EF", "FG", "GE") + both("BE", allow="bus"))


def helix(folder):
    """The ramp of a car park: three turns above one another, and a street that comes down again."""
    turns = [(20 * math.cos(a), 20 * math.sin(a), 1.4 * a / math.pi) for a in (math.pi * i / 9 for i in range(1, 54))]
    up = " ".join(f"{x:.2f},{y:.2f},{z:.2f}" for x, y, z in [(20, 0, 0), *turns, (20, 0, 8.4), (20, 60, 8.4)])
    places = {"A": (20, -110, 0), "B": (20, -50, 0), "C": (20, 60, 8.4), "D": (120, 60, 8.4), "E": (120, -110, 0)}
    nodes = "".join(node(n, x, y, z=z) for n, (x, y, z) in places.items())
    return converted(
        folder, nodes, "".join(edge(e) for e in ("AB", "CD", "DE", "EA")) + edge("BC", shape=f"20,-50,0 {up}", speed=4)
    )


def cliff(folder):
    """A road that falls eight metres within four, as heights of a coarse model of the ground do."""
    nodes = "".join(node(n, x, y, z=0) for n, (x, y) in (("A", (0, 0)), ("B", (150, 0)), ("C", (150, 150)), ("D", (0, 150))))
    return converted(folder, nodes, edge("AB", shape="0,0,0 70,0,8 74,0,0 150,0,0") + both("BC", "CD", "DA") + edge("BA"))


def hairpins(folder):
    """A pass road with bends of 4 m radius, one over the other."""
    shape = " ".join(f"{0 if i % 2 else 90},{8 * i} {0 if i % 2 else 90},{8 * i + 8}" for i in range(1, 8))
    nodes = node("A", 0, 0) + node("B", 0, 90) + node("C", -80, 45)
    return converted(folder, nodes, both("BC", "CA") + edge("AB", shape=f"0,0 90,0 {shape} 0,90") + edge("BA"))


def spikes(folder):
    """Shapes that go back on themselves and repeat their points, as careless digitising leaves them."""
    shape = "0,0 60,0 60,0 59.9,0 60,0 75,0.01 70,0 150,0"
    return converted(folder, square(), edge("AB", shape=shape) + both("BC", "CD", "DA") + edge("BA"))


def ten_thousand_kilometres_apart(folder):
    """Two villages that far from each other, in one file."""
    nodes = square() + "".join(node(n, 9e6 + x, 7e6 + y) for n, x, y in (("E", 0, 0), ("F", 90, 0), ("G", 90, 90)))
    return converted(folder, nodes, both("AB", "BC", "CD", "DA", "EF", "FG", "GE"))


def road_through_a_desert(folder):
    """Fifty kilometres without a crossing, there and back."""
    return converted(folder, node("A", 0, 0) + node("B", 50_000, 0) + node("C", 50_100, 80), both("AB", "BC", speed=30))


def uneven_lanes(folder):
    """Lanes of 2.2 and 7 m in one road, each with its own limit, and stop lines 12 m before the crossing."""
    lanes = '<lane index="0" width="2.2" speed="4"/><lane index="1" width="7" speed="14"/><stopOffset value="12" vClasses="all"/>'
    return converted(folder, square(), "".join(edge(e, lanes, numLanes=2) for e in ("AB", "BC", "CD", "DA", "BA", "DC")))


def unregulated(folder):
    """Junctions where nobody has to wait, and signals that are out of order."""
    kinds = {"A": "unregulated", "B": "traffic_light_unregulated", "C": "priority", "D": "right_before_left"}
    nodes = "".join(node(n, *xy, type=kinds[n]) for n, xy in (("A", (0, 0)), ("B", (150, 0)), ("C", (150, 150)), ("D", (0, 150))))
    return converted(folder, nodes, both("AB", "BC", "CD", "DA", "AC"))


def junctions_without_outline(folder):
    """Junctions whose outline the file leaves empty."""
    net_file = converted(folder, square(), both("AB", "BC", "CD", "DA", "AC"))
    net_file.write_text(re.sub(r'(<junction id="[AB]"[^>]*shape=")[^"]*', r"\1", net_file.read_text()))
    return net_file


def junction_lanes_of_no_length(folder):
    """Ways through junctions that begin and end at one point."""
    net_file = converted(folder, square(), both("AB", "BC", "CD", "DA"), "--junctions.internal-link-detail=2")
    text = re.sub(r'(<lane id=":[^>]*length=")[^"]*(" shape=")([^" ]+) [^"]*', r"\g<1>0.10\2\3 \3", net_file.read_text())
    net_file.write_text(text)
    return net_file


PLACES = {1: (48, 2), 2: (48, 2.002), 3: (48.0015, 2.002), 4: (48.0015, 2), 5: (48.0007, 2.001)}
SIDES = ((1, 2), (2, 3), (3, 4), (4, 1))


def _sides(**tags):
    return "".join(way(i + 1, ends, highway="residential", **tags) for i, ends in enumerate(SIDES))


def _relation(number, kind, start, via, end):
    members = f'<member type="way" ref="{start}" role="from"/><member type="node" ref="{via}" role="via"/>'
    members += f'<member type="way" ref="{end}" role="to"/>'
    tags = f'<tag k="type" v="restriction"/><tag k="restriction" v="{kind}"/>'
    return f'<relation id="{number}" version="1">{members}{tags}</relation>'


def turn_restrictions(folder):
    """Turns that relations forbid or prescribe, one of them by a way that is not there."""
    ways = _sides() + way(5, (1, 5, 3), highway="residential")
    rules = _relation(1, "no_left_turn", 1, 2, 2) + _relation(2, "only_straight_on", 4, 1, 5) + _relation(3, "no_u_turn", 2, 3, 2)
    return osm(folder, ways + rules + _relation(4, "no_right_turn", 77, 3, 2) + _relation(5, "no_entry", 5, 3, 3), PLACES)


def ways_twice(folder):
    """Every street drawn twice, with another number, as some extracts have them; steps and an elevator between them."""
    twice = "".join(way(i + 11, ends, highway="residential") for i, ends in enumerate(SIDES))
    return osm(folder, _sides() + twice + way(30, (1, 5), highway="steps") + way(31, (5, 3), highway="elevator"), PLACES)


def shopping_street(folder):
    """A pedestrian street and a track that cars may use to deliver, between streets of 20 and 30 miles an hour."""
    ways = _sides(maxspeed="20 mph") + way(7, (1, 5), highway="pedestrian", motor_vehicle="delivery")
    return osm(folder, ways + way(8, (5, 3), highway="living_street", maxspeed="FR:zone30"), PLACES)


def reversible_lanes(folder):
    """Lanes whose direction changes in the course of the day, and a bus way."""
    odd = {"lanes:forward": 2, "lanes:backward": 1, "lanes:both_ways": 1, "turn:lanes:forward": "left|through;right"}
    ways = _sides() + way(7, (1, 5), highway="primary", lanes=4, **odd) + way(8, (5, 3), highway="busway")
    return osm(folder, ways + way(9, (5, 4), highway="secondary", oneway="reversible", lanes=1), PLACES)


XODR_LANE = '<lane id="{}" type="{}"><link/><width sOffset="0" a="{}" b="{}" c="0" d="0"/></lane>'


def _xodr(folder: Path, roads: str) -> Path:
    file = folder / "strange.xodr"
    file.write_text(f'<OpenDRIVE><header revMajor="1" revMinor="6"/>{roads}</OpenDRIVE>')
    return file


def _section(start, right, left=()):
    sides = "".join(XODR_LANE.format(i, *lane) for i, lane in sorted(left, reverse=True))
    down = "".join(XODR_LANE.format(i, *lane) for i, lane in right)
    opposite = f"<left>{sides}</left>" if left else ""
    return f'<laneSection s="{start}">{opposite}<center><lane id="0" type="none"/></center><right>{down}</right></laneSection>'


def odd_geometry(folder):
    """A road of a polynomial, a parametric one and a clothoid, with an offset of its lanes and three lane sections."""
    cubic = '<paramPoly3 aU="0" bU="1" cU="0" dU="0" aV="0" bV="0" cV="0.004" dV="-0.00002" pRange="arcLength"/>'
    parts = (
        (0, 0, 0, 0, 60, "<line/>"),
        (60, 60, 0, 0, 60, cubic),
        (120, 119, 8, 0.2, 50, '<spiral curvStart="0" curvEnd="0.03"/>'),
        (170, 160, 30, 0.9, 40, '<poly3 a="0" b="0" c="0.003" d="0"/>'),
    )
    plan = "".join(
        f'<geometry s="{s}" x="{x}" y="{y}" hdg="{h}" length="{long}">{kind}</geometry>' for s, x, y, h, long, kind in parts
    )
    one, two = (-1, ("driving", 3.5, 0)), (-2, ("driving", 0.1, 0.05))
    sections = _section(0, [one], [(1, ("driving", 3.5, 0))]) + _section(70, [one, two], [(1, ("driving", 3.5, 0))])
    sections += _section(140, [one, (-2, ("shoulder", 2, 0)), (-3, ("sidewalk", 2, 0))], [(1, ("driving", 3.5, 0))])
    lanes = (
        f'<lanes><laneOffset s="0" a="0" b="0.01" c="0" d="0"/><laneOffset s="100" a="1" b="0" c="0" d="0"/>{sections}</lanes>'
    )
    return _xodr(folder, f'<road name="r" length="210" id="1" junction="-1"><planView>{plan}</planView>{lanes}</road>')


def both_ways_on_one_side(folder):
    """An OpenDRIVE road without lanes on the left, one lane of which is for both directions."""
    line = '<geometry s="0" x="0" y="0" hdg="0" length="200"><line/></geometry>'
    lanes = _section(0, [(-1, ("bidirectional", 4, 0)), (-2, ("driving", 3, 0)), (-3, ("biking", 2, 0))])
    return _xodr(
        folder, f'<road name="r" length="200" id="1" junction="-1"><planView>{line}</planView><lanes>{lanes}</lanes></road>'
    )

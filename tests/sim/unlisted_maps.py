"""Small OpenStreetMap extracts and OpenDRIVE maps with traits of public ones that the other lists do not have."""

from __future__ import annotations

import math

from tests.sim.strange_networks import osm, way

PLACES = {
    1: (48, 2),
    2: (48, 2.002),
    3: (48.0015, 2.002),
    4: (48.0015, 2),
    5: (48.0007, 2.001),
    6: (48, 2.001),
    7: (48.0015, 2.001),
}
SIDES = ((1, 6, 2), (2, 3), (3, 7, 4), (4, 1))


def _streets(**tags):
    return "".join(way(i + 1, ends, highway="residential", **tags) for i, ends in enumerate(SIDES))


def _with_tags(file, number, **tags):
    """Gives a node tags of its own."""
    text, start = file.read_text(), f'<node id="{number}" '
    head, _, rest = text.partition(start)
    attributes, _, tail = rest.partition("/>")
    inner = "".join(f'<tag k="{key}" v="{value}"/>' for key, value in tags.items())
    file.write_text(f"{head}{start}{attributes}>{inner}</node>{tail}")
    return file


def circular_junctions(folder):
    """A ring that is called circular and not a roundabout, a mini-roundabout, places to turn in, and a stub with a loop."""
    places = PLACES | {
        i + 11: (48.0007 + 0.00012 * math.sin(i * math.pi / 3), 2.001 + 0.00018 * math.cos(i * math.pi / 3)) for i in range(6)
    }
    ways = _streets() + way(11, [*range(11, 17), 11], highway="residential", junction="circular")
    ways += way(12, (6, 15), highway="tertiary") + way(13, (7, 12), highway="tertiary") + way(14, (14, 5), highway="service")
    file = osm(folder, ways, places)
    _with_tags(file, 6, highway="mini_roundabout", direction="clockwise")
    return _with_tags(file, 5, highway="turning_circle")


def gates_and_bumps(folder):
    """Gates, bollards, bumps, crossings, stop signs for one direction and signals that stand beside the crossing."""
    file = osm(folder, _streets() + way(7, (6, 5, 7), highway="tertiary", access="destination"), PLACES)
    _with_tags(file, 5, barrier="lift_gate", access="no")
    _with_tags(file, 6, highway="traffic_signals", direction="backward")
    _with_tags(file, 7, highway="stop", direction="forward", stop="minor")
    return _with_tags(file, 2, highway="crossing", traffic_calming="bump")


def references_that_are_broken(folder):
    """Ways of one node, of nodes that are not there, of one node twice; numbers below zero and above 32 bits; objects deleted."""
    places = PLACES | {-8: (48.0003, 2.0005), 9_000_000_000_000: (48.0004, 2.0015)}
    ways = _streets() + way(20, (1,), highway="residential") + way(21, (77, 78), highway="residential")
    ways += way(22, (6, 6, 5, 5, 7), highway="residential") + way(-23, (1, -8, 5), highway="tertiary")
    ways += way(24, (2, 9_000_000_000_000, 5), highway="tertiary") + way(25, (3, 79, 5), highway="tertiary")
    gone = way(26, (2, 4), highway="primary").replace("<way ", '<way action="delete" visible="false" ')
    return osm(folder, ways + gone + '<relation id="1" version="1"><member type="way" ref="404" role="from"/></relation>', places)


def places_as_areas(folder):
    """A square for cars drawn as an area, a car park with its aisles, and a lay-by for emergencies."""
    area = {"area": "yes", "highway": "service"}
    ways = _streets() + way(30, (1, 6, 5, 1), **area) + way(31, (5, 7), highway="service", service="parking_aisle")
    ways += way(32, (6, 5), highway="residential") + way(33, (7, 3), highway="emergency_bay") + way(34, (4, 5), highway="raceway")
    return osm(folder, ways, PLACES)


def lanes_in_detail(folder):
    """Lanes tagged one by one: turns, changes, widths, buses, cycles against the traffic, half lanes."""
    odd = {"lanes": "3", "oneway": "yes", "turn:lanes": "left|through|merge_to_left;none", "change:lanes": "not_right|no|yes"}
    ways = way(1, (1, 6, 2), highway="secondary", **odd, **{"width:lanes": "3|2.5|", "bus:lanes": "||designated"})
    ways += way(2, (2, 3), highway="residential", lanes="1.5", width="12'6&quot;", maxspeed="30;50")
    ways += way(3, (3, 7, 4), highway="tertiary", oneway="yes", **{"oneway:bicycle": "no", "cycleway": "opposite_lane"})
    ways += way(4, (4, 1), highway="residential", **{"lanes:psv:forward": 1, "busway:right": "lane", "sidewalk": "both"})
    ways += way(
        5, (6, 5, 7), highway="unclassified", **{"maxspeed:forward": 20, "maxspeed:backward": "RO:urban", "parking:both": "lane"}
    )
    return osm(folder, ways + way(6, (2, 1), highway="residential"), PLACES)


def levels_without_heights(folder):
    """A bridge on layer 1, a passage below a house, a tunnel on layer -2, a street with embedded rails; no height anywhere."""
    ways = _streets() + way(40, (6, 7), highway="primary", bridge="yes", layer=1)
    ways += way(41, (4, 5, 2), highway="residential", tunnel="building_passage", layer=-2)
    return osm(folder, ways + way(42, (1, 3), highway="residential", railway="tram", embedded="yes"), PLACES)


LINK = '<link><predecessor elementType="{}" elementId="{}"{}/><successor elementType="{}" elementId="{}"{}/></link>'


def _road(number, geometry, long_m, lanes, *, junction=-1, link="", more="", attributes=""):
    plan = "".join(
        f'<geometry s="{s}" x="{x}" y="{y}" hdg="{h}" length="{n}">{kind}</geometry>' for s, x, y, h, n, kind in geometry
    )
    return (
        f'<road name="" length="{long_m}" id="{number}" junction="{junction}"{attributes}>{link}<planView>{plan}</planView>'
        f"{more}<lanes>{lanes}</lanes></road>"
    )


def _lane(number, kind="driving", width='<width sOffset="0" a="3.5" b="0" c="0" d="0"/>'):
    return f'<lane id="{number}" type="{kind}" level="false"><link/>{width}</lane>'


def _both_ways(left=None, right=None, start=0):
    center = '<center><lane id="0" type="none" level="false"/></center>'
    return f'<laneSection s="{start}"><left>{left or _lane(1)}</left>{center}<right>{right or _lane(-1)}</right></laneSection>'


def _opendrive(folder, roads, header='<header revMajor="1" revMinor="4"/>'):
    file = folder / "unlisted.xodr"
    file.write_text(f'<?xml version="1.0" standalone="yes"?><OpenDRIVE>{header}{roads}</OpenDRIVE>')
    return file


def banked_road(folder):
    """A road that leans over, with a camber, heights in steps, a limit that is none, and lanes told by their borders."""
    high = '<elevation s="0" a="-3" b="0" c="0" d="0"/><elevation s="100" a="2" b="0.02" c="0" d="0"/>'
    lean = '<superelevation s="0" a="0.1" b="0" c="0" d="0"/><crossfall side="both" s="0" a="0.02" b="0" c="0" d="0"/>'
    more = f"<elevationProfile>{high}</elevationProfile><lateralProfile>{lean}</lateralProfile>"
    speed = '<type s="0" type="motorway"><speed max="no limit" unit="mph"/></type>'
    border = '<border sOffset="0" a="3.5" b="0" c="0" d="0"/>'
    right = _lane(-1, width=border) + _lane(-2, "shoulder") + _lane(-3, "border") + _lane(-4, "parking")
    geometry = ((0, 0, 0, 0, 100, "<line/>"), (100, 100, 0, 0, 120, '<arc curvature="0.01"/>'))
    return _opendrive(folder, _road(1, geometry, 220, _both_ways(None, right), more=speed + more, attributes=' rule=""'))


def crossing_of_opendrive(folder):
    """Four roads at a junction whose connections name a master, and whose lanes are called ramps."""
    roads, ties = "", ""
    for i in range(4):
        a = i * math.pi / 2
        arm = ((0, 20 * math.cos(a), 20 * math.sin(a), a, 120, "<line/>"),)
        link = '<link><predecessor elementType="junction" elementId="9"/></link>'
        kind = ("driving", "onRamp", "driving", "connectingRamp")[i]
        roads += _road(i + 1, arm, 120, _both_ways(_lane(1), _lane(-1, kind if i != 0 else "driving")), link=link)
    number = 10
    for i in range(4):
        for turn in (1, 2, 3):
            j = (i + turn) % 4
            a, b = i * math.pi / 2, j * math.pi / 2
            start, end = (20 * math.cos(a), 20 * math.sin(a)), (20 * math.cos(b), 20 * math.sin(b))
            length = math.hypot(end[0] - start[0], end[1] - start[1])
            heading = math.atan2(end[1] - start[1], end[0] - start[0])
            link = LINK.format("road", i + 1, ' contactPoint="start"', "road", j + 1, ' contactPoint="start"')
            way_through = (
                '<laneSection s="0"><center><lane id="0" type="none"/></center><right>' + _lane(-1) + "</right></laneSection>"
            )
            way_through = way_through.replace("<link/>", '<link><predecessor id="1"/><successor id="-1"/></link>')
            geometry = ((0, *start, heading, length, "<line/>"),)
            roads += _road(number, geometry, length, way_through, junction=9, link=link)
            master = ' connectionMaster="10"' if number != 10 else ""
            ties += (
                f'<connection id="{number}" incomingRoad="{i + 1}" connectingRoad="{number}" contactPoint="start"{master}>'
                '<laneLink from="1" to="-1"/></connection>'
            )
            number += 1
    return _opendrive(folder, roads + f'<junction name="" id="9" type="direct">{ties}<priority high="1" low="2"/></junction>')


def offset_header(folder):
    """A map with a projection, an offset of its header that turns it, lane sections for one side, and contents of others."""
    header = (
        '<header revMajor="1" revMinor="8" name="" north="0" south="0" east="0" west="0" vendor="x">'
        "<geoReference><![CDATA[+proj=utm +zone=32 +ellps=WGS84 +units=m +no_defs]]></geoReference>"
        '<offset x="690000" y="5330000" z="480" hdg="0.7"/><userData code="x" value="y"/></header>'
    )
    sections = _both_ways() + _both_ways(_lane(1) + _lane(2, "mwyExit"), _lane(-1, "mwyEntry"), 90).replace(
        "<laneSection ", '<laneSection singleSide="false" '
    )
    more = '<surface><CRG file="a.crg" sStart="0" sEnd="9" orientation="same"/></surface>'
    thing = '<objects><object id="1" s="10" t="8" zOffset="0" type="tree"/></objects>'
    sign = '<signal id="1" s="50" t="5" dynamic="yes" orientation="+" type="1000001" name="x" zOffset="0" value="-1"/>'
    thing += f"<signals>{sign}</signals>"
    road = _road(1, ((0, 0, 0, 0, 200, "<line/>"),), 200, sections).replace("</road>", f"{thing}{more}</road>")
    return _opendrive(folder, road + '<station id="1" name="x" type="small"/>', header)

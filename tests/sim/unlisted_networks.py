"""Small networks with traits of public ones that the other lists do not have: SUMO's own attributes, seldom used."""

from __future__ import annotations

import math
import re

from tests.sim.strange_networks import both, converted, edge, node, square


def streets_of_types(folder):
    """Streets whose lanes come from a file of types: a pavement, a cycle path and a hedge are part of the type."""
    lane = '<lane index="{}" allow="{}" width="{}" speed="{}"/>'
    lanes = lane.format(0, "pedestrian", 2, 2) + lane.format(1, "bicycle", 1.5, 6) + lane.format(2, "passenger bus", 3.1, 14)
    kinds = f'<type id="city" numLanes="3">{lanes}</type><type id="lane.one" numLanes="1" oneway="1" speed="8" priority="3"/>'
    (folder / "a.typ.xml").write_text(f"<types>{kinds}</types>")
    ways = both("AB", "BC", "CD", "DA", type="city", speed="") + both("AC", type="lane.one", speed="")
    return converted(folder, square(), ways.replace(' speed=""', ""), f"--type-files={folder}/a.typ.xml")


def tram_through_a_roundabout(folder):
    """A roundabout that a tram crosses on its own track and then shares with the cars; a level crossing farther out."""
    ring, outer = ("A", "B", "C", "D"), ("E", "F", "G", "H")
    turn = {name: 2 * math.pi * i / 4 for i, name in enumerate(ring)}
    nodes = "".join(node(n, 22 * math.cos(a), 22 * math.sin(a)) for n, a in turn.items())
    nodes += "".join(node(o, 140 * math.cos(a), 140 * math.sin(a)) for o, a in zip(outer, turn.values(), strict=True))
    nodes += node("M", 0, 0) + node("R", 99, 99, type="rail_crossing") + node("S", 160, 170)
    lanes = '<lane index="0" disallow="tram"/><lane index="1" allow="tram passenger"/>'
    circle = edge("AB", lanes, numLanes=2) + edge("BC") + edge("CD", lanes, numLanes=2) + edge("DA")
    tram = edge("AM", allow="tram") + edge("MC", allow="tram") + edge("SR", allow="rail") + edge("RM", allow="rail")
    return converted(folder, nodes, circle + both("AE", "BF", "CG", "DH", "ER", "RF", "FG", "GH", "HE") + tram)


def permissions_that_change(folder):
    """One of two lanes is for cars, then for buses, then for bicycles, then for nobody, within one street."""
    stops = "AEFGHB"
    nodes = square(200) + "".join(node(n, 40 * (i + 1), 0) for i, n in enumerate("EFGH"))
    allowed = ("passenger", "bus", "bicycle", "", "passenger")
    parts = "".join(
        edge(stops[i : i + 2], f'<lane index="0" {"allow" if who else "disallow"}="{who or "all"}"/>', numLanes=2)
        for i, who in enumerate(allowed)
    )
    return converted(folder, nodes, parts + both("BC", "CD", "DA") + edge("BA"))


def shapes_of_one_point(folder):
    """Streets whose shape is one point between their ends, or their ends alone, and a street from a place to itself."""
    ways = edge("AB", shape="75,20") + edge("BA", shape="0,0 150,0") + both("BC", "CD", "DA")
    return converted(folder, square(), ways + edge("AA", shape="0,0 -60,-20 -60,-60 -20,-60 0,0"))


def below_the_sea(folder):
    """Heights below zero, and some nodes that have none, as a model of the ground with gaps gives them."""
    places = {"A": (0, 0, -14.5), "B": (150, 0, None), "C": (150, 150, -12), "D": (0, 150, None)}
    nodes = "".join(node(n, x, y, **({} if z is None else {"z": z})) for n, (x, y, z) in places.items())
    return converted(folder, nodes, both("AB", "BC", "CD", "DA", "AC"))


def prohibitions(folder):
    """Rights of way that are written by hand: who passes, who keeps clear, who sees late, and what forbids what."""
    line = '<connection from="{}" to="{}" fromLane="0" toLane="0" {}/>'
    rules = line.format("BA", "AD", 'pass="true" keepClear="false"') + line.format("CA", "AB", 'contPos="4" visibility="8"')
    rules += line.format("DA", "AB", 'uncontrolled="true" speed="4"') + '<prohibition prohibitor="CA->AB" prohibited="BA->AC"/>'
    (folder / "a.con.xml").write_text(f"<connections>{rules}</connections>")
    nodes = node("A", 0, 0, type="traffic_light") + square()[square().index("/>") + 2 :]
    return converted(folder, nodes, both("AB", "BC", "CD", "DA", "AC"), f"-x={folder}/a.con.xml")


def signals_that_count(folder):
    """Signals that ask detectors, wait by delay or ring by ring, one program for two junctions, and one that is off."""
    kinds = {"A": "actuated", "B": "delay_based", "C": "static", "D": "actuated"}
    corners = {"A": (0, 0), "B": (150, 0), "C": (150, 150), "D": (0, 150)}
    nodes = "".join(node(n, *corners[n], type="traffic_light", tlType=kind) for n, kind in kinds.items())
    nodes += node("E", 60, 60, type="traffic_light", tl="joint") + node("F", 90, 90, type="traffic_light", tl="joint")
    return converted(folder, nodes, both("AB", "BC", "CD", "DA", "AE", "EF", "FC"), "--tls.layout=incoming")


def ramps_with_lanes_for_speeding_up(folder):
    """A motorway with long lanes for speeding up and slowing down, 50 m/s, and exits on both sides."""
    nodes = square(700) + "".join(node(n, x, y) for n, x, y in (("E", 250, 0), ("F", 450, 0), ("G", 350, -60), ("H", 350, 60)))
    fast = '<lane index="0" acceleration="true"/>'
    ways = edge("AE", numLanes=2, speed=50) + edge("EF", numLanes=2, speed=50) + edge("FB", fast, numLanes=3, speed=50)
    ways += edge("EG", speed=14) + edge("GF", speed=14) + edge("EH", speed=14) + edge("HF", speed=14)
    return converted(folder, nodes, ways + "".join(edge(e, numLanes=2, speed=33) for e in ("BC", "CD", "DA")))


def lanes_about_their_line(folder):
    """Streets whose lanes lie on both sides of the line that is drawn, as maps of one line a street have them."""
    ways = "".join(edge(e, numLanes=2, spreadType="center") for e in ("AB", "BC", "CD", "DA"))
    return converted(folder, square(), ways + both("AC", spreadType="roadCenter", numLanes=2))


def lanes_of_their_own_shape(folder):
    """Lanes whose shapes were drawn by hand, so that two lanes of one street cross, and end 20 m before the junction."""
    crossing = '<lane index="0" shape="8,-8 75,-1 140,-2"/><lane index="1" shape="8,-2 75,-7 140,-8"/>'
    short = '<lane index="0" endOffset="20"/>'
    return converted(folder, square(), edge("AB", crossing, numLanes=2) + edge("BA", short) + both("BC", "CD", "DA", "AC"))


def three_streets_between_two_places(folder):
    """Three streets with the same ends, one of them beside the first by its own width."""
    one = edge("AB") + edge("AB", shape="0,0 20,-4 130,-4 150,0").replace('id="AB"', 'id="AB.2"')
    two = edge("AB", shape="0,0 75,60 150,0").replace('id="AB"', 'id="AB#3"')
    return converted(folder, square(), one + two + both("BC", "CD", "DA") + edge("BA"))


def large_joined_crossing(folder):
    """A crossing of two dual carriageways, its four nodes and two bends joined into one of 40 m."""
    inner = {"E": (-16, -16), "F": (16, -16), "G": (16, 16), "H": (-16, 16), "I": (0, -22), "J": (0, 22)}
    outer = {"A": (-140, -16), "B": (140, -16), "C": (140, 16), "D": (-140, 16)}
    outer |= {"K": (-16, 140), "L": (16, 140), "M": (-16, -140), "N": (16, -140)}
    nodes = "".join(node(n, *xy) for n, xy in (inner | outer).items())
    ways = "".join(
        edge(e, numLanes=2) for e in ("AE", "EI", "IF", "FB", "CG", "GJ", "JH", "HD", "KH", "HE", "EM", "NF", "FG", "GL")
    )
    return converted(
        folder, nodes, ways + both("BC", "DA", "KL", "MN", "LC", "NB", "KD", "AM"), "--junctions.join", "--junctions.join-dist=40"
    )


def junctions_of_wrong_kinds(folder):
    """Junctions that a file calls districts or dead ends though they are none, and edges that carry keys nobody knows."""
    net_file = converted(folder, square(), both("AB", "BC", "CD", "DA", "AC"))
    text = re.sub(r'(<junction id="B" type=")[^"]*', r"\1district", net_file.read_text())
    text = re.sub(r'(<junction id="D" type=")[^"]*', r"\1dead_end", text)
    net_file.write_text(text.replace('<edge id="AB"', '<edge id="AB" distance="-30.5" length="99" mood="blue"'))
    return net_file


def lanes_counted_longer(folder):
    """Lanes that a file counts fifty times as long as they are drawn, as schematic plans have them."""
    return converted(folder, square(30), both("AB", "BC", "CD", "DA", length=1500))


def speeds_of_trains(folder):
    """Streets on which 150 m/s are allowed."""
    return converted(folder, square(1200), both("AB", "BC", "CD", "DA", speed=150, numLanes=2))


def streets_that_end_in_water(folder):
    """One-way streets that lead nowhere, and others that nobody can come to, on all sides of a square."""
    ends = "".join(node(n, x, y) for n, x, y in (("E", -80, 0), ("F", 230, 0), ("G", 150, 230), ("H", 0, 230)))
    return converted(folder, square() + ends, both("AB", "BC", "CD", "DA") + edge("AE") + edge("FB") + edge("CG") + edge("HD"))


def crossings_everywhere(folder):
    """Crossings for people with and without lights, with places to walk of a shape of their own, in the middle of streets."""
    nodes = square() + node("E", 75, 0, type="traffic_light") + node("F", 150, 75, type="priority")
    plain = '<crossing node="E" edges="AE EA" priority="true" width="6"/>'
    plain += '<crossing node="F" edges="BF FB" discard="false" shape="140,73 160,77"/>'
    (folder / "a.con.xml").write_text(f"<connections>{plain}</connections>")
    walks = both("AE", "EB", "BF", "FC", "CD", "DA", sidewalkWidth=2)
    return converted(folder, nodes, walks, f"-x={folder}/a.con.xml", "--walkingareas")

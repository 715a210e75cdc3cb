"""The road network and the arithmetic on its lanes: lengths, positions along a lane, adjacent lanes, driving distances.

Begin with ``network`` (the arrays, and which lanes are adjacent), then ``geometry`` (from an arc length on a lane to a point, and
from a point to the nearest lanes). ``routing`` measures driving distances between nearby lanes; ``lane_graph`` cuts the lanes
into bins of about 1 m for the route search. Other packages take such arithmetic from here and have none of their own.
"""

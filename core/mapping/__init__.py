"""Mapping, Section III.A of Li et al. 2025: frames and self-motion in, a semi-metric cognitive map out.

- ``mapper``: the front of this room, one observation at a time. Begin here.
- ``memory``: is the place of a keyframe one seen before? It stores the views (``view_store``) that the answer needs.
- ``experience_map``: vertices, odometry and closure edges, and how the poses are relaxed (``pose_graph``).
- ``networks``: head-direction and grid cells, which run along and are recorded at every vertex.

Nothing here knows metres: lengths are in map units, one of which is an unknown, slowly varying number of metres.
"""

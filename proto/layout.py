"""Which arrays each message holds: field, type, dimensions. Named dimensions are counts of the Header."""

from __future__ import annotations

from typing import TypeAlias

from hippodrome.core.types import PAINT_PLACES

Layout: TypeAlias = tuple[tuple[str, str, tuple[str | int, ...]], ...]

TEMPLATE_TYPES = {"gradient": "int8", "grey": "uint8"}
ATTRACTORS: Layout = (
    ("head_mean_rad", "float32", ("vertices", 2)),
    ("head_reliability", "float32", ("vertices", 2)),
    ("grid_period", "float32", ("grid_modules",)),
    ("grid_mean_rad", "float32", ("vertices", "grid_modules", 2, 2)),
    ("grid_reliability", "float32", ("vertices", "grid_modules", 2, 2)),
)
VERTICES: Layout = (
    ("t_s", "float64", ("vertices",)),
    ("poses", "float64", ("vertices", 3)),
    ("view_cell", "int32", ("vertices",)),
)
REFINED_VERTICES: Layout = (
    ("log_scale", "float64", ("vertices",)),
    ("covariance", "float64", ("vertices", 3, 3)),
)
EDGES: Layout = (
    ("source", "int32", ("edges",)),
    ("target", "int32", ("edges",)),
    ("motion", "float64", ("edges", 3)),
    ("sigma", "float64", ("edges", 3)),
    ("kind", "uint8", ("edges",)),
    ("margin", "float32", ("edges",)),
)
VISITS: Layout = (
    ("t_s", "float64", ("visits",)),
    ("vertex", "int32", ("visits",)),
    ("motion", "float64", ("visits", 3)),
)
LANE_READINGS: Layout = (
    ("offset_m", "float32", ("visits",)),
    ("offset_variance_m2", "float32", ("visits",)),
    ("heading_rad", "float32", ("visits",)),
    ("heading_variance_rad2", "float32", ("visits",)),
    ("curvature_1pm", "float32", ("visits",)),
    ("curvature_change_1pm2", "float32", ("visits",)),
    ("end_m", "float32", ("visits",)),
    ("end_variance_m2", "float32", ("visits",)),
    ("end", "uint8", ("visits",)),
)
LANE_EXTRAS: Layout = (  # which older maps do not have
    ("edge_percent", "uint8", ("visits", 2)),
    ("paint", "uint8", ("visits", 2, PAINT_PLACES)),
)
ROAD_MATCH: Layout = (
    ("lane", "int32", ("vertices",)),
    ("position_m", "float64", ("vertices",)),
    ("status", "uint8", ("vertices",)),
)

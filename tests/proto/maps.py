"""Random maps for the codec's tests, and exact comparison."""

from dataclasses import fields, is_dataclass, replace

import numpy as np

from hippodrome.core.types import PAINT_PLACES, AttractorStates, CognitiveMap, Edges, LaneReadings, RoadMatch, ViewCells, Visits


def random_map(
    seed=0, vertices=5, cells=4, edges=6, visits=7, modules=2, shape=(2, 3), kind="gradient", refined=False, lanes=3, read=False
):
    """A map with arbitrary content that the checks accept."""
    rng = np.random.default_rng(seed)
    size = int(np.prod(shape))
    template_type, low = (np.int8, -128) if kind == "gradient" else (np.uint8, 0)
    index = lambda count, limit: rng.integers(0, limit, count).astype(np.int32)  # noqa: E731
    single = lambda *sizes: rng.normal(size=sizes).astype(np.float32)  # noqa: E731
    cognitive_map = CognitiveMap(
        frame="semi-metric",
        t_s=np.cumsum(rng.uniform(0.1, 1.0, vertices)),
        poses=rng.normal(0.0, 1e3, (vertices, 3)),
        view_cell=index(vertices, cells),
        view_cells=ViewCells(
            kind, rng.integers(low, low + 256, (cells, size)).astype(template_type), single(size), tuple(int(n) for n in shape)
        ),
        edges=Edges(
            index(edges, vertices),
            index(edges, vertices),
            rng.normal(size=(edges, 3)),
            rng.uniform(0.1, 1.0, (edges, 3)),
            rng.integers(0, 2, edges).astype(np.uint8),
            single(edges),
        ),
        visits=Visits(np.cumsum(rng.uniform(0.1, 1.0, visits)), index(visits, vertices), rng.normal(size=(visits, 3))),
        attractors=AttractorStates(
            single(vertices, 2),
            single(vertices, 2),
            single(modules),
            single(vertices, modules, 2, 2),
            single(vertices, modules, 2, 2),
        ),
    )
    if read:
        cognitive_map = replace(cognitive_map, visits=replace(cognitive_map.visits, lane=random_readings(rng, visits)))
    if not refined:
        return cognitive_map
    lane = rng.integers(-1, lanes, vertices).astype(np.int32)
    match = RoadMatch(
        tuple(f"straße{n}_0" for n in range(lanes)),
        lane,
        np.where(lane >= 0, rng.uniform(0.0, 100.0, vertices), np.nan),
        rng.integers(0, 4, vertices).astype(np.uint8),
    )
    covariance = rng.normal(size=(vertices, 3, 3))
    return replace(cognitive_map, frame="network", log_scale=rng.normal(size=vertices), covariance=covariance, road_match=match)


def random_readings(rng, count):
    """Readings of which some saw nothing."""
    seen = rng.random(count) < 0.7
    value = lambda: np.where(seen, rng.normal(size=count), np.nan).astype(np.float32)  # noqa: E731
    variance = lambda: np.where(seen, rng.uniform(0.01, 1.0, count), np.inf).astype(np.float32)  # noqa: E731
    pairs = [part for _ in range(2) for part in (value(), variance())]
    return LaneReadings(
        *pairs, value(), value(), value(), variance(), np.where(seen, rng.integers(0, 3, count), 0).astype(np.uint8),
        np.where(seen[:, None], rng.integers(0, 101, (count, 2)), 255).astype(np.uint8),
        np.where(seen[:, None, None], rng.integers(0, 251, (count, 2, PAINT_PLACES)), 0).astype(np.uint8),
    )  # fmt: skip


def assert_same(a, b):
    """The same values, types, shapes and bytes."""
    assert type(a) is type(b)
    if is_dataclass(a):
        for field in fields(a):
            assert_same(getattr(a, field.name), getattr(b, field.name))
    elif isinstance(a, np.ndarray):
        assert (a.dtype, a.shape, a.tobytes()) == (b.dtype, b.shape, b.tobytes())
    else:
        assert a == b

"""Recognition of places: offsets by hand, and how much evidence it takes to meet an old road and to stay on it."""

import numpy as np
import pytest

from hippodrome.core.mapping.config import PlaceMemoryConfig
from hippodrome.core.mapping.memory import PlaceMemory
from hippodrome.core.views.config import ViewCellConfig

SPACING = 5.0


def town_of(count, seed):
    """Random descriptors: every place unlike every other."""
    size = int(np.prod(ViewCellConfig().shape))
    return np.random.default_rng(seed).integers(0, 60, (count, size), dtype=np.int8)


def seen(descriptor, rng, blend):
    """The same place again, ``blend`` of the view replaced by chance."""
    other = rng.integers(0, 60, len(descriptor), dtype=np.int8)
    return np.where(rng.random(len(descriptor)) < blend, other, descriptor).astype(np.int8)


def drive(memory, descriptors, first_vertex=0):
    found = []
    for vertex, descriptor in enumerate(descriptors, start=first_vertex):
        found += memory.recognise(vertex, descriptor, SPACING, 0.0, SPACING)
    return found


def test_a_second_pass_is_recognised_from_its_first_view_on():
    memory, town, rng = PlaceMemory(PlaceMemoryConfig()), town_of(80, 0), np.random.default_rng(1)
    assert drive(memory, town) == []
    again = drive(memory, [seen(town[i], rng, 0.4) for i in range(20, 50)], first_vertex=80)
    assert sorted(r.vertex for r in again) == list(range(80, 110))  # the first ones in retrospect
    assert all(memory.cell_vertex[r.cell] == r.vertex - 60 for r in again)


def test_shared_cells_are_stored_once():
    memory, town = PlaceMemory(PlaceMemoryConfig()), town_of(80, 0)
    drive(memory, town)
    drive(memory, town[20:50], first_vertex=80)
    cells = memory.finish(SPACING)
    assert len(cells.templates) == 80
    assert memory.vertex_cell == [*range(80), *range(20, 50)]


def test_one_familiar_view_on_a_new_road_is_not_enough():
    memory, town, new = PlaceMemory(PlaceMemoryConfig()), town_of(80, 0), town_of(20, 9)
    drive(memory, town)
    new[10] = seen(town[30], np.random.default_rng(2), 0.5)
    assert drive(memory, new, first_vertex=80) == []


def test_staying_on_a_road_takes_less_than_meeting_it():
    """Fair views, of z about 4: enough between good ones, not enough for a beginning."""
    town, rng = town_of(120, 0), np.random.default_rng(3)
    fair = [seen(town[i], rng, 0.82) for i in range(20, 50)]
    memory = PlaceMemory(PlaceMemoryConfig())
    drive(memory, town)
    alone = drive(memory, fair, first_vertex=120)
    memory = PlaceMemory(PlaceMemoryConfig())
    drive(memory, town)
    after_good = drive(memory, [*town[10:20], *fair], first_vertex=120)
    assert len(alone) < len([r for r in after_good if r.vertex >= 130])


def test_views_wait_before_they_are_candidates():
    memory, town = PlaceMemory(PlaceMemoryConfig(waiting_views=16)), town_of(80, 0)
    drive(memory, town)
    assert drive(memory, town[70:80], first_vertex=80) == []  # seen less than 16 views ago, the first 6 of them at least
    assert len(memory.cell_vertex) == 80 + 10 - 16


@pytest.mark.parametrize("wrong", [{"closure_margin": 5.0}, {"waiting_views": 0}, {"column_rad": 0.0}])
def test_impossible_settings_are_rejected(wrong):
    with pytest.raises(ValueError, match="place memory"):
        PlaceMemoryConfig(**wrong)

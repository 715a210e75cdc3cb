"""Distribution of the mean APE per stress case."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

import numpy as np

from hippodrome.eval.figures.style import BLUE, VERMILION, log_errors, new_figure, save_figure, tidy

LEAST_WIDTH_IN: Final = 6.6  # the title takes so much


def draw_stress(path: Path, apes_m: Mapping[str, Sequence[float | None]]) -> None:
    """One column per case, with a dot per run at the mean APE of its map and a bar at the mean of the runs.

    Above each column stands in how many runs the refinement vouched for nothing, as it must where the drive never was.

    Args:
        path: The picture.
        apes_m: Mean APE of each run by name of the case, None where the refinement vouched for nothing.
    """
    figure = new_figure(max(1.2 + 1.15 * len(apes_m), LEAST_WIDTH_IN), 4.6)
    axes = figure.subplots()
    known = [np.array([value for value in values if value is not None]) for values in apes_m.values()]
    for place, (values, all_runs) in enumerate(zip(known, apes_m.values(), strict=True)):
        spread = np.linspace(-0.22, 0.22, len(values)) if len(values) > 1 else np.zeros(len(values))
        axes.plot(place + spread, np.sort(values), "o", color=BLUE, markersize=4, alpha=0.75)
        if len(values):
            axes.plot([place - 0.3, place + 0.3], [values.mean()] * 2, color=VERMILION, linewidth=2)
            axes.text(place + 0.32, values.mean(), f"{values.mean():.2f}", fontsize=8, va="center", color=VERMILION)
        if len(values) < len(all_runs):
            label, above = f"{len(all_runs) - len(values)} of {len(all_runs)}\nrefused", axes.get_xaxis_transform()
            axes.text(place, 0.98, label, transform=above, fontsize=8, ha="center", va="top")
    tidy(axes, "", "mean APE of a run (m)", "Refinement under stress: one dot a town and seed, bar: mean")
    axes.set_xticks(range(len(apes_m)), [name.replace(" ", "\n", 1) for name in apes_m], fontsize=8)
    axes.set_xlim(-0.6, len(apes_m) - 0.1)
    log_errors(axes, np.concatenate([*known, [1.0]]))
    save_figure(figure, path, for_print=True)

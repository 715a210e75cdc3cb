"""The whole chain on two drives of one town: map the first, lay the map on the roads, find the second in it.

    hippodrome render town.yaml --out out      # makes the town, both drives and their frames; docs/python.md has town.yaml
    python whole_chain.py out

Prints how good the map is, what could not be vouched for, and where the second drive found itself.
"""

import sys
from pathlib import Path

import numpy as np

from hippodrome import Trajectory, ape, localize, map_drive, read_network, refine, save_map
from hippodrome.sim.recording import open_recording


def main(out: Path) -> None:
    mapping_drive = open_recording(next(out.glob("recordings/*-mapping-*")))
    later_drive = open_recording(next(out.glob("recordings/*-localization-*")))
    network = read_network(next(out.glob("towns/*.net.xml")))

    semi_metric = map_drive(mapping_drive.observations())
    refinement = refine(semi_metric, network)
    topometric = refinement.cognitive_map
    save_map(out / "town.pbstream", topometric)
    print(f"{topometric}, saved as {out / 'town.pbstream'}")
    for stretch in refinement.breaks:
        print(f"  not vouched for, vertices {stretch.first_vertex} to {stretch.last_vertex}: {stretch.cause}")

    error = ape(Trajectory(topometric.t_s, topometric.poses), mapping_drive.ground_truth())
    print(f"map error: {error.mean_m:.2f} m in the mean, {error.max_m:.2f} m at worst ({error.definition})")

    estimates = localize(later_drive.observations(), topometric, network)
    known = [estimate for estimate in estimates if estimate.localized]
    if not known:
        print("the second drive was not localized: it may be too short, or lie on streets that the first did not see")
        return
    print(f"second drive: localized after {known[0].t_s:.1f} s, in {len(known)} of {len(estimates)} steps")
    found = Trajectory(np.array([estimate.t_s for estimate in known]), np.array([estimate.pose for estimate in known]))
    print(f"localization error: {ape(found, later_drive.ground_truth()).mean_m:.2f} m in the mean")


if __name__ == "__main__":
    main(Path(sys.argv[1]))

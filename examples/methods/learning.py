"""What descriptors whose words are learned on other towns have in common: the frames that they learn from."""

import numpy as np

from hippodrome.sim.recording import open_recording


def frames_to_learn_on(folders, count):
    """``count`` frames spread evenly over each recording of ``folders``."""
    for recording in map(open_recording, folders):
        for number in np.unique(np.linspace(0, recording.frame_count - 1, count).astype(int)):
            yield recording.frame(int(number))

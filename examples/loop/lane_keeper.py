"""A lane keeper of thirty lines: it follows the white line at the right-hand border of its lane, and stops for who is ahead."""

import sys

import gymnasium
import numpy as np

FOCAL_PX, CAMERA_M, LINE_M = 80.0, 1.4, 1.4  # of the default camera; from the lane's middle to the line
AHEAD_M = 6.0  # where the line is looked at
CRUISE = 1.6  # map units per second, some 3 m/s


def policy(observed):
    """Acceleration and steering in [-1, 1] for one observation."""
    frame = observed["frame"]
    height, width, _ = frame.shape
    places = []
    for below in range(14, 30):  # rows below the horizon: 8 to 4 metres ahead on a flat road
        white = frame[height // 2 + below, width // 2 :].min(axis=1) > 165
        if white.any():
            places.append((int(np.argmax(white)) + 0.5) * CAMERA_M / below)
    places = [place for place in places if 0.3 < place < 3.0]
    off_m = float(np.median(places)) - LINE_M if len(places) > 3 else 0.0  # positive: too far left
    steering_rad = 2.7 * 2.0 * -off_m / AHEAD_M**2
    brake = observed["gap_m"][0] < 8.0
    acceleration = -3.0 if brake else np.clip(2.0 * (CRUISE - observed["speed"][0]), -1.0, 1.0)
    return np.array([acceleration / 5.0, steering_rad / (0.25 * np.pi)], dtype=np.float32).clip(-1.0, 1.0)


def main(scenario="towns/grid", seed=1, root=None, duration_s=60.0):
    """Drives once, and prints and returns what it was worth."""
    env = gymnasium.make("hippodrome/Town-v0", scenario=scenario, root=root, radar=True, duration_s=duration_s)
    observed, info = env.reset(seed=seed)
    worth, fines, over = 0.0, {}, False
    while not over:
        observed, reward, terminated, truncated, info = env.step(policy(observed))
        worth, over = worth + reward, terminated or truncated
        fines = {kind: fines.get(kind, 0.0) + info["fines"].get(kind, 0.0) for kind in {**fines, **info["fines"]}}
    env.close()
    print(f"{info['truth']['driven_m']:.0f} m driven, worth {worth:.0f} m; fines: {fines}")
    return worth


if __name__ == "__main__":
    main(*sys.argv[1:2])

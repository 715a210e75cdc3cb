"""Self-motion from the frames of any camera that looks ahead from a vehicle, and whose focal length is known.

The way of a pair of frames, module by module:

1. ``camera``: frames are made small and grey.
2. ``tracks``: corners are followed from one to the other, but for those that ``static`` knows to move along with the camera.
3. ``epipolar``: how the camera turned, and which way it went. On the average that is the horizon, from which the road is known.
4. ``road``: how far it went, from the plane of the road. ``structure`` carries the last step on where the road tells nothing.
5. ``odometry`` joins them. Begin there.
"""

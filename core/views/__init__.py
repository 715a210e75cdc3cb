"""What a frame tells: small descriptors, how alike two of them are, and which stored view a sequence of frames passes by.

The way of a frame, module by module:

1. ``keyframes``: is a new keyframe due, that is, has the vehicle moved on or turned enough since the last one?
2. ``descriptors``: the frame becomes a template of a kilobyte. Begin here.
3. ``scoring``: the template is compared with all stored ones (local view cells); above some thousands of them ``index`` picks
   candidates first.
4. ``sequence``: scores are filtered along the ``graph`` of view cells, as one view may be mistaken but hardly three in a row.

Apart from these, ``odometry`` estimates the vehicle's motion from two frames. Both the mapper and the localizer are built on this
room; it knows nothing of poses or roads.
"""

"""Where am I in the map? From frames and self-motion, a pose in the road network's frame, without a known start.

Begin with ``localizer``: each observation passes through it from top to bottom. Self-motion moves a pose belief (folder
``beliefs``), with the noise that ``gyro`` finds in the signal. A query frame is compared with the map by ``recogniser``, for
which ``places`` lays the map out. A recognised view measures the pose; ``competition`` puts the measurement into the belief,
and ``fix`` counts the evidence: it has the table of states, from unknown to localized and lost. ``config`` has all parameters.
"""

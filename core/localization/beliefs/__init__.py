"""Beliefs about the pose of the vehicle: what holds the estimate, and how motions and measured poses change it.

Begin with ``belief``, which says what the localizer asks of a belief; ``start`` makes one for each mode. ``attractor`` is the
method of the project, mode "coupled"; ``paper`` is what it came from, the networks as printed. ``kalman`` and ``lanes`` are
yardsticks that are given the same motions and measurements. ``motion`` has the equations of motion and measurement that
attractor and kalman share, ``config`` the parameters of all.
"""

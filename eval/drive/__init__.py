"""Missions: the vehicle drives to goals on its own map, in the loop with the simulator, and is scored.

Begin with ``run`` (all scenarios, from the mapping drives to the table), then ``drive`` (one mission, step by step). ``missions``
draws starts and goals, ``rows`` says who drives, ``scoring`` counts.
"""

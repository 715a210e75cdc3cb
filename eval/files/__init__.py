"""Files of others and for others.

``scenarios.py`` reads scenarios and finds their networks, ``trajectories.py`` reads and writes TUM.
"""

"""Map matching: which roads a drive took, told from the map's own motions and a road network.

Two matchers share this room. ``search`` finds the route of a drive whose start and scale are unknown (mode ``route`` of the
refinement); begin with ``search/route.py``. ``hmm`` is the hidden Markov model of Li et al. 2025 (mode ``paper``); begin with
``hmm/match.py``. The modules beside them work on a route that was found: ``confidence`` says how far it can be trusted,
``route_line`` lays it out as one line, ``projection`` projects poses onto that line, ``lane_choice`` decides between parallel
lanes.
"""

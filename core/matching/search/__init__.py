"""Route search: the most likely drive through a road network for raw motions whose start, direction and scale are unknown.

Begin with ``route.py`` (``search_route`` and its answer, ``Route``). It builds on ``problem`` (the drive sampled at even steps,
the network cut into bins, the scales), ``starts`` (hypotheses to begin with) and ``passes`` (forward and backward pass over a
whole drive in bounded memory). The compiled core is ``beam``, with ``successors`` (one step on the network), ``off_network``
(one step off it), ``model`` and ``hypotheses`` (the data that these share). ``config`` holds the parameters.
"""

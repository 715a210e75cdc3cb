"""``hippodrome scenario``: write, check and preview scenarios, and the reference of their keys.

Begin with ``keys``, which reads every key with its meaning from the models themselves; ``errors``, ``schema`` and ``reference``
are made of it. ``draft`` writes a scenario for a road network, ``check`` validates one, ``preview`` draws its drives.
"""

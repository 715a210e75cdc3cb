"""Trials: what the chain withstands, and what it is worth beside others.

``stress`` refines maps under errors of self-motion, loop closures and roads; ``robustness`` localizes under other light,
weather, traffic and sensor errors; ``rivals`` runs other systems on the same drives. Begin with the module ``run`` of each.
"""

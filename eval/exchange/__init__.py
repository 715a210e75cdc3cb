"""To and from other people's tools and drives: ``hippodrome export``, ``import`` and ``score``.

Begin with ``export``, ``importing`` and ``score``, one module for each command. ``readers`` read foreign layouts, ``formats``
write ours in the formats of other tools, one module each; both know only ``drives``, what a drive is while it is exchanged.
"""

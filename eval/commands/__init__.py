"""The commands of ``hippodrome``: each module declares the arguments of a few commands and calls the part that does the work.

Begin with ``runs``, the whole chain in one command. ``arguments`` has what the commands share. The parts are imported inside
the functions: ``--help`` answers at once, and a command loads no simulator that it does not use.
"""

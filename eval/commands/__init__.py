"""The commands of ``hippodrome``: each module declares its arguments and calls the part that does the work.

The parts are imported inside the functions: ``--help`` answers at once, and a command loads no simulator that it does not use.
"""

"""What a drive is while it is exchanged: one of ours to be exported, or a foreign one to become a recording.

Begin with ``exported`` (what is exported) and ``foreign`` (what readers hand over). ``steps``, ``images`` and ``new_recording``
make a recording of the latter; ``poses``, ``camera``, ``tables`` and ``scene`` put the former into the terms that formats
share.
"""

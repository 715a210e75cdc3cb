"""Readers of foreign drives: functions that find frames, self-motion and truth in a folder or a file of one layout.

Begin with ``tables``, the layouts of text tables and image files; ``mcap_file`` and ``rosbag`` read logs of messages. Which
function reads which layout stands in ``importing.READERS``.
"""

"""Data sets of LeRobot, versions 2 and 3: what they declare, their episodes and tasks, and their shards of frames."""

"""A movement under live control: one step at a time, with a moving goal, a measured state, obstacles and any tempo."""

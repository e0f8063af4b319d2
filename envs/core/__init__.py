"""The one environment, and what a task declares to it: levels, obstacle placement, spaces, goal form."""

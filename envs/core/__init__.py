"""Parts shared by all tasks: base class, levels, obstacle placement, progress, spaces."""

"""The filter of every command."""

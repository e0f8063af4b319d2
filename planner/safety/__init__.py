"""The filter below every command."""

"""Strict settings and the shipped YAML files and demonstrations."""

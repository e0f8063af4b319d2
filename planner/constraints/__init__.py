"""Compiled constraints: what a demonstration keeps, measured, certified along joint lines, and searched on."""

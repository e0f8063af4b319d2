"""Benchmark: commands that run, train, measure, plan and report."""

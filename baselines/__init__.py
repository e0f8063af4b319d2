"""Policies, the planner among them, on one footing."""

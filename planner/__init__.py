"""Screw-theoretic planning and control; knows no simulator and no Gymnasium."""

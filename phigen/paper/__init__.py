"""Figures of the paper, redrawn with measured numbers: one module per example of the paper."""

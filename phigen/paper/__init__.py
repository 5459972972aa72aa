"""The figures of the paper, redrawn and with measured numbers: one module per example of the paper."""

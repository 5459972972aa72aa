"""The figures of the paper made again, each with what can be measured in it: one module per example of the paper."""

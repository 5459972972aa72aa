"""The one-step map as a staged straight-line program."""

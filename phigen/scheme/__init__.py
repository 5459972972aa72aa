"""The one-step map of a method as a staged straight-line program."""
